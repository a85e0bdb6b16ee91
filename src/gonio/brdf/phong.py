"""Powers of a cosine: Phong's lobe about the mirrored view, and Blinn's about the normal.

    Phong           f cos theta_i = albedo (s+1) / (2 pi) (R.wi)_+^s           R = 2 (n.wo) n - wo        (RH 3.34)
    ModifiedPhong   f = albedo (s+2) / (2 pi) (R.wi)_+^s                               (Lafortune and Willems 1994)
    BlinnPhong      f = albedo (s+2)(s+4) / (8 pi (2^(-s/2) + s)) (n.h)^s                             (Giesen 2009)

RH's lobe is the BRDF times the cosine, so that light is convolved with one fixed shape: as a BRDF it is not
reciprocal, and grows without bound as wi grazes. The other two are reciprocal; their factor makes the reflectance at
normal incidence, which is the highest, the albedo.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, ClassVar

from .._kernels import brdf as kernels
from ..arrays import Array, floats, like
from ..directions import dot, reflect
from .model import BRDF, Bounds
from .pairs import through
from .sampling import facet_between, lobe_density, lobe_direction, mirrored, power


@dataclasses.dataclass(frozen=True, eq=False)
class _PhongLobe(BRDF):
    albedo: Array = 0.5
    shininess: Array = 50.0

    bounds: ClassVar[dict[str, Bounds]] = {
        "albedo": Bounds(0.0, 1.0, colour=True),
        "shininess": Bounds(0.0, 1e6),
    }

    def _strength(self, xp: Any, wo: Array) -> Array:
        return self._mean(xp, self.albedo, wo)


class Phong(_PhongLobe):
    """Phong's lobe as RH has it: `albedo` (..., C) in [0, 1], `shininess` (...) in [0, 1e6]. Not reciprocal.

    The lobe has the albedo for its energy; what reaches below the surface is cut off.
    """

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        s = like(self.shininess, wi)
        lobe = (s + 1) / (2 * math.pi) * power(xp, dot(reflect(wo), wi), s)
        lit = wi[..., 2] > 0
        lobe = lobe / xp.where(lit, wi[..., 2], xp.ones_like(wi[..., 2]))
        return like(self.albedo, wi) * lobe[..., None]

    def _compiled(self, wi: Array, wo: Array) -> Array:
        (s,) = self._lanes("shininess")
        return through(kernels.one_colour, wi, wo, (self.albedo, s, (s + 1) / (2 * math.pi)), kernels.PHONG)

    def sample(self, wo: Array, u: Array) -> Array:
        _, wo, u = floats(wo, u)
        return lobe_direction(reflect(wo), like(self.shininess, wo), u[..., 1:])

    def pdf(self, wi: Array, wo: Array) -> Array:
        _, wi, wo = floats(wi, wo)
        return lobe_density(reflect(wo), like(self.shininess, wo), wi)


class ModifiedPhong(Phong):
    """Phong's lobe without the division by the cosine: `albedo` (..., C), `shininess` (...). Reciprocal."""

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        s = like(self.shininess, wi)
        lobe = (s + 2) / (2 * math.pi) * power(xp, dot(reflect(wo), wi), s)
        return like(self.albedo, wi) * lobe[..., None]

    def _compiled(self, wi: Array, wo: Array) -> Array:
        (s,) = self._lanes("shininess")
        return through(kernels.one_colour, wi, wo, (self.albedo, s, (s + 2) / (2 * math.pi)), kernels.MODIFIED_PHONG)


class BlinnPhong(_PhongLobe):
    """Blinn's lobe of half vectors: `albedo` (..., C) in [0, 1], `shininess` (...) in [0, 1e6]. Reciprocal.

    About a quarter of Phong's exponent makes a highlight as wide.
    """

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        s = like(self.shininess, wi)
        h = facet_between(wi, wo)
        return like(self.albedo, wi) * (_blinn(s) * power(xp, h[..., 2], s))[..., None]

    def _compiled(self, wi: Array, wo: Array) -> Array:
        (s,) = self._lanes("shininess")
        return through(kernels.one_colour, wi, wo, (self.albedo, s, _blinn(s)), kernels.BLINN_PHONG)

    def sample(self, wo: Array, u: Array) -> Array:
        _, wo, u = floats(wo, u)
        n = like([0.0, 0.0, 1.0], wo)
        return mirrored(wo, lobe_direction(n, like(self.shininess, wo), u[..., 1:]))

    def pdf(self, wi: Array, wo: Array) -> Array:
        xp, wi, wo = floats(wi, wo)
        h = facet_between(wi, wo)
        s = like(self.shininess, wo)
        facing = xp.clip(xp.abs(dot(wo, h)), xp.finfo(wo.dtype).eps, None)
        return (s + 1) / (2 * math.pi) * power(xp, h[..., 2], s) / (4 * facing)


def _blinn(s: Array) -> Array:
    return (s + 2) * (s + 4) / (8 * math.pi * (2 ** (-s / 2) + s))
