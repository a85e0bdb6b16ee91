"""Generalised cosine lobes (Lafortune et al. 1997).

    f = (C_x x_i x_o + C_y y_i y_o + C_z z_i z_o)_+^n

C_x = C_y = -1, C_z = 1 is a Phong lobe; C_x = C_y > 0 reflects back; C_x /= C_y is anisotropic; C_z > -C_x leans
towards the normal, C_z < -C_x beyond the mirror direction. A material of several lobes is a sum:
`Lambert(0.3) + Lafortune(...) + Lafortune(...)`. As in the paper and in published fits, every channel may have its own
numbers, and the strength of a lobe lies in C: scaling f by k scales C by k^(1/n).
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, ClassVar

import numpy as np

from .._kernels import brdf as kernels
from ..arrays import Array, floats, like, to_numpy
from ..errors import ParameterError
from .combine import Scaled
from .model import BRDF, Bounds
from .pairs import through
from .sampling import lobe_density, lobe_direction, power


@dataclasses.dataclass(frozen=True, eq=False)
class Lafortune(BRDF):
    """One lobe: `cx`, `cy`, `cz` in [-10, 10] and exponent `n` in [0, 1e6], each a number or (..., C). Reciprocal.

    Nothing bounds its albedo by 1. Raises `ParameterError` where the peak max(abs(C))^n exceeds 1e9, too.
    """

    cx: Array = -0.9
    cy: Array = -0.9
    cz: Array = 0.9
    n: Array = 10.0

    bounds: ClassVar[dict[str, Bounds]] = {
        "cx": Bounds(-10.0, 10.0, colour=True),
        "cy": Bounds(-10.0, 10.0, colour=True),
        "cz": Bounds(-10.0, 10.0, colour=True),
        "n": Bounds(0.0, 1e6, colour=True),
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        widest = np.maximum(np.maximum(*(np.abs(to_numpy(c)) for c in (self.cx, self.cy))), np.abs(to_numpy(self.cz)))
        peak = float(np.max(to_numpy(self.n) * np.log(np.maximum(widest, 1.0))))
        if peak > math.log(1e9):
            raise ParameterError(
                f"Lafortune: the lobe's peak is 10^{peak / math.log(10):.3g} /sr. An albedo below 1 needs C near 1."
            )

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        product = wi * wo
        cosine = sum(like(c, wi) * product[..., k : k + 1] for k, c in enumerate((self.cx, self.cy, self.cz)))
        return power(xp, cosine, like(self.n, wi))

    def _compiled(self, wi: Array, wo: Array) -> Array:
        return through(kernels.lafortune, wi, wo, (self.cx, self.cy, self.cz, self.n))

    def lobes(self) -> tuple[BRDF, ...]:
        numbers = [getattr(self, name) for name in self.bounds]
        count = max((p.shape[-1] for p in numbers if p.ndim), default=1)
        if count == 1:
            return (self,)
        one = [[p[..., c % p.shape[-1], None] if p.ndim else p for p in numbers] for c in range(count)]
        return tuple(Scaled(Lafortune(*one[c]), np.eye(count)[c]) for c in range(count))

    def _axes(self, xp: Any, wo: Array) -> tuple[Array, Array, Array]:
        """Each channel's axis (..., C, 3), unit, its exponent (..., C), and the length of C wo (..., C)."""
        o = xp.zeros_like(wo[..., :1])
        cx, cy, cz, n = (like(p, wo) + o for p in (self.cx, self.cy, self.cz, self.n))
        axis = xp.stack(xp.broadcast_arrays(cx * wo[..., :1], cy * wo[..., 1:2], cz * wo[..., 2:]), axis=-1)
        length = xp.sqrt(xp.sum(axis * axis, axis=-1))
        lost = length < 1e-12
        axis = axis / xp.where(lost, xp.ones_like(length), length)[..., None]
        axis = xp.where(lost[..., None], like([0.0, 0.0, 1.0], wo), axis)
        axis, n, length = axis, n + xp.zeros_like(length), length + xp.zeros_like(n)
        return axis, n, length

    def _strength(self, xp: Any, wo: Array) -> Array:
        _, n, length = self._axes(xp, wo)
        # A lobe cut off by the horizon counts whole: the share matters only to the noise of a sum's samples.
        return xp.mean(2 * math.pi / (n + 2) * power(xp, length, n), axis=-1)

    def sample(self, wo: Array, u: Array) -> Array:
        xp, wo, u = floats(wo, u)
        axis, n, _ = self._axes(xp, wo)
        count = n.shape[-1]
        wi = lobe_direction(axis[..., 0, :], n[..., 0], u[..., 1:])
        for c in range(1, count):
            drawn = lobe_direction(axis[..., c, :], n[..., c], u[..., 1:])
            wi = xp.where((u[..., 0] * count >= c)[..., None], drawn, wi)
        return wi

    def pdf(self, wi: Array, wo: Array) -> Array:
        xp, wi, wo = floats(wi, wo)
        axis, n, _ = self._axes(xp, wo)
        return xp.mean(lobe_density(axis, n, wi[..., None, :]), axis=-1)
