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

from ..arrays import Array, like
from .model import BRDF, Bounds


@dataclasses.dataclass(frozen=True, eq=False)
class Lambert(BRDF):
    """`albedo` in [0, 1]: a number or (..., C). f = albedo / pi."""

    albedo: Array = 0.5

    bounds: ClassVar[dict[str, Bounds]] = {"albedo": Bounds(0.0, 1.0, colour=True)}

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        value = like(self.albedo, wi) / math.pi
        return value + xp.zeros_like(wi[..., :1]) + xp.zeros_like(wo[..., :1])
