"""What photographs of one view show beyond a model of it: shadows, light between surfaces, normals a little off.

    B(x, l) = E (f(x, l, wo) cos theta_i + sum_k w_k(l) R_k(x)),       R_k = I_k / E_k - f(x, l_k, wo) cos theta_k
    w(l) = C(l, L) (C(L, L) + noise 1)^-1,        C(l, m) = exp(-|l - m| / reach)

Residuals of each pixel are interpolated between the lights of the photographs as a Gaussian process has it (Rasmussen
and Williams 2006, 2.25); far from all of them the model stands alone. They belong to the view, not to the material.

reach and noise are those with the least median error of photographs that are left out (Rasmussen and Williams 5.12):

    left out, R_k is missed by    [(C + noise 1)^-1 R]_k / [(C + noise 1)^-1]_kk

with fewer than a dozen photographs, which tell this only of lights far from all others, they are 1 and .03.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from scipy.spatial.distance import cdist

from ..arrays import frozen, require_finite, to_numpy
from ..directions import require_unit
from ..errors import ArrayError, ParameterError
from ..lights.model import Light

_REACHES, _NOISES = (0.25, 0.5, 1.0, 2.0), (0.01, 0.03, 0.1, 0.3, 1.0)
_USUAL = 1.0, 0.03
_DOZEN = 12
_TRIED = 20_000  # pixels at which reach and noise are chosen


@dataclasses.dataclass(frozen=True, eq=False)
class Residuals:
    """`directions` (N, 3), unit, world, of the photographs' lights; `images` (N, S, 3), under unit irradiance, at the S
    pixels of a view's mask along its rows; `reach` > 0, between directions; `noise` > 0, a variance over another.

    Raises `ArrayError` where shapes do not fit or values are not finite, `ParameterError` for other numbers.
    """

    directions: np.ndarray
    images: np.ndarray
    reach: float
    noise: float

    def __post_init__(self) -> None:
        directions = frozen(to_numpy(self.directions), np.dtype(np.float64))
        images = np.ascontiguousarray(self.images, np.float32)
        if images.ndim != 3 or images.shape[2] != 3 or directions.shape != (len(images), 3) or not len(images):
            raise ArrayError(
                f"directions have shape {directions.shape}, images {images.shape}; (N, 3) and (N, S, 3) are wanted."
            )
        require_unit(directions, "directions")
        require_finite(images, "images")
        for name in ("reach", "noise"):
            if not 0 < getattr(self, name) < math.inf:
                raise ParameterError(f"Residuals: {name} = {getattr(self, name)!r} is not a number > 0.")
        object.__setattr__(self, "directions", directions)
        object.__setattr__(self, "images", images)

    @classmethod
    def of(cls, directions: np.ndarray, images: np.ndarray, radiance: np.ndarray) -> Residuals:
        """The same with reach and noise as the images tell them; radiance (N,) > 0, the rms of each photograph."""
        reach, noise = _USUAL
        if len(images) >= _DOZEN:
            some = images[:, :: -(-images.shape[1] // _TRIED)].reshape(len(images), -1)
            gram = (some @ some.T).astype(np.float64) / some.shape[1]
            reach, noise = min(
                ((r, n) for r in _REACHES for n in _NOISES), key=lambda p: _left_out(directions, gram, radiance, *p)
            )
        return cls(directions, images, reach, noise)

    def weights(self, directions: np.ndarray) -> np.ndarray:
        """w (M, N) of lights from `directions` (M, 3)."""
        inverse = _inverse(self.directions, self.reach, self.noise)
        return np.asarray(np.exp(-cdist(directions, self.directions) / self.reach) @ inverse)

    def under(self, light: Light, samples: int | None = None) -> np.ndarray:
        """What is added to the radiance of the pixels, (S, 3), under the distant parts of `light`."""
        total = np.zeros((len(self.images), 3))
        for part in light.parts:
            if part.distant:
                beams = part.beams(budget=samples)
                total += self.weights(to_numpy(beams.directions)).T @ to_numpy(beams.irradiance)
        added = np.zeros(self.images.shape[1:], np.float32)
        for image, weight in zip(self.images, total.astype(np.float32), strict=True):
            added += image * weight
        return added


def _inverse(directions: np.ndarray, reach: float, noise: float) -> np.ndarray:
    C = np.exp(-cdist(directions, directions) / reach)
    return np.linalg.inv(C + noise * np.eye(len(C)))


def _left_out(directions: np.ndarray, gram: np.ndarray, radiance: np.ndarray, reach: float, noise: float) -> float:
    """The median over photographs of their relative rms when left out, from their residuals' products `gram`."""
    inverse = _inverse(directions, reach, noise)
    squares = np.sum((inverse @ gram) * inverse, axis=1) / np.diag(inverse) ** 2
    return float(np.median(np.sqrt(squares) / radiance))
