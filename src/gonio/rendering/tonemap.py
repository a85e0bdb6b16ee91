"""From scene radiance to a display: exposure, then a curve onto [0, 1], both linear in light.

    clipped     y = min(x, 1)
    Reinhard    y = x (1 + x / white^2) / (1 + x)                  Reinhard et al. 2002, eq. 4, on luminance
    Filmic      y = h(x) / h(white),  h(x) = (x (.15 x + .05) + .004) / (x (.15 x + .5) + .06) - .02 / .3
                                                                   Hable, "Uncharted 2: HDR Lighting", GDC 2010

x is radiance times 2^exposure. Every curve rises, takes 0 to 0 and grey to grey. The result is not encoded: files put
the sRGB curve on it (`write_image`), and so does a screen.
Not here: curves that change over the image.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

from ..arrays import Array, floats, namespace, require_finite
from ..colour import luminance
from ..errors import ArrayError, ParameterError

_KEY = 0.18


def _require_white(white: float) -> None:
    if not 0 < white < math.inf:
        raise ParameterError(f"white must be a finite number above 0, got {white}. It is the least value shown as 1.")


def clipped(x: Array) -> Array:
    """The image as it is up to 1, and 1 beyond: what a screen does."""
    xp = namespace(x)
    return xp.minimum(x, xp.ones_like(x))


@dataclasses.dataclass(frozen=True)
class Reinhard:
    """Photographic tone reproduction, global: luminance `white` (> 0) and above becomes 1.

    Acts on luminance and keeps the ratios of the channels, up to 1 in each.
    """

    white: float = 4.0

    def __post_init__(self) -> None:
        _require_white(self.white)

    def __call__(self, x: Array) -> Array:
        y = luminance(x)[..., None]
        return clipped(x * ((1 + y / self.white**2) / (1 + y)))


@dataclasses.dataclass(frozen=True)
class Filmic:
    """Hable's curve, with the toe and shoulder of film: each channel by itself, `white` (> 0) and above becomes 1.

    Without the doubled exposure of his slides, which is `exposure=1`.
    """

    white: float = 11.2

    def __post_init__(self) -> None:
        _require_white(self.white)

    def __call__(self, x: Array) -> Array:
        xp = namespace(x)
        # The curve squares x, which overflows beyond 1e19 in single precision.
        return self._curve(xp.minimum(x, xp.full_like(x, self.white))) / self._curve(self.white)

    @staticmethod
    def _curve(x: Any) -> Any:
        # A = .15, B = .5, C = .1, D = .2, E = .02, F = .3; the last term is E / F, which takes 0 to 0.
        return (x * (0.15 * x + 0.05) + 0.004) / (x * (0.15 * x + 0.5) + 0.06) - 0.02 / 0.3


def tone_map(image: Array, operator: Callable[[Array], Array] = Filmic(), exposure: float | None = 0.0) -> Array:
    """Display colours in [0, 1], linear, of radiance `image` (..., 3); ready for `write_image`.

    operator: `clipped`, `Reinhard()`, `Filmic()` or any function of exposed radiance (..., 3).
    exposure: in stops, radiance times 2^exposure. None takes the log-average luminance to .18 (Reinhard et al. 2002,
        eq. 1 and 2; black pixels are left out). It depends on the image: give a number to compare images.

    Raises `ArrayError` where the image has NaN, infinite or negative values, or no colours in its last axis.
    """
    xp, image = floats(image)
    if image.ndim == 0 or image.shape[-1] != 3:
        raise ArrayError(f"image has shape {tuple(image.shape)}; expected (..., 3), colours last.")
    require_finite(image, "image")
    if bool(xp.any(image < 0)):
        raise ArrayError(
            f"image has negative radiance, down to {float(xp.min(image)):.4g}. Bring it to 0 (numpy.maximum) first."
        )
    stops = exposure_of(image) if exposure is None else exposure
    if not abs(stops) <= 1000:
        raise ParameterError(f"exposure must be a number of stops, at most 1000 either way, or None, got {exposure}.")
    brightest = xp.full_like(image, float(xp.finfo(image.dtype).max))  # rather than infinity, of which no curve is 1
    mapped = operator(xp.minimum(image * 2.0**stops, brightest))
    # Rounding may leave a value a few units of the last place outside.
    return xp.maximum(clipped(mapped), xp.zeros_like(mapped))


def exposure_of(image: Array) -> float:
    """Stops that bring the log-average luminance of `image` (..., 3) to .18; 0 where all is black."""
    xp, y = floats(luminance(image))
    lit = y > 0
    count = int(xp.count_nonzero(lit))
    if count == 0:
        return 0.0
    total = xp.sum(xp.where(lit, xp.log2(xp.where(lit, y, xp.ones_like(y))), xp.zeros_like(y)))
    return math.log2(_KEY) - float(total) / count
