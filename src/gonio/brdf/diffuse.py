"""Matte reflectance: Lambert, and Oren and Nayar's rough matte facets.

    Lambert      f = albedo / pi
    Oren-Nayar   f = albedo / pi (A + B max(0, cos(phi_i - phi_o)) sin a tan b),   a = max(theta_i, theta_o), b = min
                 A = 1 - s^2 / (2 (s^2 + .33)),   B = .45 s^2 / (s^2 + .09)

s is the standard deviation of the facets' slope angle, in radians (Oren and Nayar 1994, the qualitative model).
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, ClassVar

from .._kernels import brdf as kernels
from ..arrays import Array, like
from .model import BRDF, Bounds
from .pairs import through


@dataclasses.dataclass(frozen=True, eq=False)
class Lambert(BRDF):
    """`albedo` in [0, 1]: a number or (..., C). f = albedo / pi."""

    albedo: Array = 0.5

    bounds: ClassVar[dict[str, Bounds]] = {"albedo": Bounds(0.0, 1.0, colour=True)}

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        value = like(self.albedo, wi) / math.pi
        return value + xp.zeros_like(wi[..., :1]) + xp.zeros_like(wo[..., :1])

    def _compiled(self, wi: Array, wo: Array) -> Array:
        return through(kernels.one_colour, wi, wo, (self.albedo, 0.0, 0.0), kernels.LAMBERT)

    def _strength(self, xp: Any, wo: Array) -> Array:
        return self._mean(xp, self.albedo, wo)


@dataclasses.dataclass(frozen=True, eq=False)
class OrenNayar(BRDF):
    """`albedo` in [0, 1], a number or (..., C); `sigma` in [0, pi/2], radians, (...). Reciprocal.

    sigma = 0 is Lambert; rough surfaces reflect somewhat less than their albedo.
    """

    albedo: Array = 0.5
    sigma: Array = 0.5

    bounds: ClassVar[dict[str, Bounds]] = {
        "albedo": Bounds(0.0, 1.0, colour=True),
        "sigma": Bounds(0.0, math.pi / 2),
    }

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        A, B = _oren_nayar(like(self.sigma, wi))
        # cos(phi_i - phi_o) sin a tan b = (x_i x_o + y_i y_o) / max(cos theta_i, cos theta_o)
        high = xp.maximum(wi[..., 2] + 0 * wo[..., 2], wo[..., 2] + 0 * wi[..., 2])
        high = xp.where(high > 0, high, xp.ones_like(high))
        along = xp.clip(wi[..., 0] * wo[..., 0] + wi[..., 1] * wo[..., 1], 0.0, None)
        return like(self.albedo, wi) * (A + B * along / high)[..., None]

    def _compiled(self, wi: Array, wo: Array) -> Array:
        return through(
            kernels.one_colour, wi, wo, (self.albedo, *_oren_nayar(*self._lanes("sigma"))), kernels.OREN_NAYAR
        )

    def _strength(self, xp: Any, wo: Array) -> Array:
        return self._mean(xp, self.albedo, wo)


def _oren_nayar(sigma: Array) -> tuple[Array, Array]:
    """A / pi and B / pi."""
    s = sigma * sigma
    return (1 - s / (2 * (s + 0.33))) / math.pi, 0.45 * s / (s + 0.09) / math.pi
