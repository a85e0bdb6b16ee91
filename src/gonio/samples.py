"""Tables of what was measured: what the estimators eat, whatever the camera and the lights were.

    reflectance    f(wi, wo) at a site, wi and wo in its local frame (s, t, n): value in 1/sr, up to one factor
    radiance       B(n, wo) at a site, both in the world's frame: value in W / m^2 sr, up to one factor

`weight` is the inverse variance of a value, up to one factor; what is not known is not in the table.
"""

from __future__ import annotations

import dataclasses
from functools import cached_property

import numpy as np

from .arrays import frozen, to_numpy
from .directions import half_difference, require_unit, uvw
from .errors import ArrayError


@dataclasses.dataclass(frozen=True, eq=False)
class ReflectanceSamples:
    """K samples of reflectance: site (K,) whole numbers; wi, wo (K, 3), unit, local; value (K, 3); weight (K,) >= 0.

    Raises `ArrayError` for shapes that do not fit or values that are not finite, `DirectionError` for directions.
    """

    site: np.ndarray
    wi: np.ndarray
    wo: np.ndarray
    value: np.ndarray
    weight: np.ndarray

    def __post_init__(self) -> None:
        _check(self, "wi", "wo")

    def __len__(self) -> int:
        return len(self.site)

    @cached_property
    def uvw(self) -> np.ndarray:
        """(u, v, w) of RS 7, (K, 3)."""
        coordinates: np.ndarray = uvw(self.wi, self.wo)
        return coordinates

    @cached_property
    def half_difference(self) -> np.ndarray:
        """theta_h, phi_h, theta_d, phi_d of Rusinkiewicz, (K, 4), radians."""
        return np.stack(half_difference(self.wi, self.wo), axis=-1)


@dataclasses.dataclass(frozen=True, eq=False)
class RadianceSamples:
    """K samples of radiance: site (K,) whole numbers; normal, wo (K, 3), unit, world; value (K, 3); weight (K,) >= 0.

    Raises as `ReflectanceSamples` does.
    """

    site: np.ndarray
    normal: np.ndarray
    wo: np.ndarray
    value: np.ndarray
    weight: np.ndarray

    def __post_init__(self) -> None:
        _check(self, "normal", "wo")

    def __len__(self) -> int:
        return len(self.site)


def _check(samples: ReflectanceSamples | RadianceSamples, *directions: str) -> None:
    count = len(to_numpy(samples.site))
    for name, shape in {"site": (), **dict.fromkeys((*directions, "value"), (3,)), "weight": ()}.items():
        kind = np.intp if name == "site" else np.float64
        array = frozen(to_numpy(getattr(samples, name)), np.dtype(kind))
        if array.shape != (count, *shape):
            raise ArrayError(f"{type(samples).__name__}: {name} has shape {array.shape}; {(count, *shape)} is wanted.")
        if not np.isfinite(array).all() or (name == "weight" and (array < 0).any()):
            raise ArrayError(f"{type(samples).__name__}: {name} is not all finite{' and >= 0' * (name == 'weight')}.")
        object.__setattr__(samples, name, array)
    for name in directions:
        require_unit(getattr(samples, name), name)
