"""Reflection by facets that are small mirrors (Torrance and Sparrow 1967, Cook and Torrance 1982, MS 2).

    f = D(h) G(wi, wo) F(wi.h) / (4 cos theta_i cos theta_o),        h = (wi + wo) / |wi + wo|

D from `ndf.py` or `ndf_table.py`, G from `shadowing.py`, F from `fresnel.py`: any with any. Light that is reflected
more than once between facets is lost, as in every model of this kind. Reciprocal.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from ..arrays import Array, floats
from ..directions import dot, half_vector
from .fresnel import Fresnel, Reflectance
from .model import BRDF
from .ndf import GGX, NDF
from .sampling import mirrored
from .shadowing import Shadowing, Smith


@dataclasses.dataclass(frozen=True, eq=False)
class Microfacet(BRDF):
    """Facets distributed by `ndf`, reflecting by `fresnel`, hiding each other by `shadowing`."""

    ndf: NDF = dataclasses.field(default_factory=GGX)
    fresnel: Reflectance = dataclasses.field(default_factory=Fresnel)
    shadowing: Shadowing = Smith()  # noqa: RUF009  (a frozen value)

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        above = ((wi[..., 2] > 0) & (wo[..., 2] > 0))[..., None]
        up = xp.concat((xp.zeros_like(wi[..., :2]), xp.ones_like(wi[..., 2:])), axis=-1)
        # Below the surface the terms have no meaning and may divide by zero; the answer there is cut out later.
        wi, wo = xp.where(above, wi, up), xp.where(above, wo, up)
        h = half_vector(wi, wo)
        DV = self.ndf.D(h) * self.shadowing.visibility(xp, self.ndf, wi, wo)
        return DV[..., None] * self.fresnel(dot(wo, h))

    def _strength(self, xp: Any, wo: Array) -> Array:
        return xp.mean(self.fresnel(wo[..., 2]), axis=-1)

    def sample(self, wo: Array, u: Array) -> Array:
        _, wo, u = floats(wo, u)
        return mirrored(wo, self.ndf.sample(wo, u[..., 1:]))

    def pdf(self, wi: Array, wo: Array) -> Array:
        xp, wi, wo = floats(wi, wo)
        h = half_vector(wi, wo)
        # A half vector below the horizon is never drawn.
        facing = (h[..., 2] > 0) & (dot(wo, h) > 0)
        safe = xp.where(facing, dot(wo, h), xp.ones_like(h[..., 2]))
        return xp.where(facing, self.ndf.pdf(h, wo) / (4 * safe), xp.zeros_like(safe))
