"""Reflection by facets that are small mirrors (Torrance and Sparrow 1967, Cook and Torrance 1982, MS 2).

    f = D(h) G(wi, wo) F(wi.h) / (4 cos theta_i cos theta_o),        h = (wi + wo) / |wi + wo|

D from `ndf.py` or `ndf_table.py`, G from `shadowing.py`, F from `fresnel.py`: any with any. Light that is reflected
more than once between facets is lost, as in every model of this kind. Reciprocal.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from .._kernels import microfacet as kernels
from ..arrays import Array, floats, to_numpy
from ..directions import dot, half_vector
from ..errors import ParameterError
from .fresnel import Conductor, Fresnel, Reflectance, Schlick
from .model import BRDF
from .ndf import GGX, NDF, Beckmann, Slopes
from .pairs import through
from .sampling import facet_between, mirrored
from .shadowing import Ashikhmin, Shadowing, Smith, VGroove

# What the compiled loop knows; everything else goes through array code.
NDFS: dict[type, int] = {Beckmann: kernels.BECKMANN, GGX: kernels.GGX}
REFLECTANCES: dict[type, int] = {
    Fresnel: kernels.DIELECTRIC,
    Conductor: kernels.CONDUCTOR,
    Schlick: kernels.SCHLICK,
}
SHADOWINGS: dict[type, int] = {Smith: kernels.CORRELATED, Ashikhmin: kernels.SEPARABLE, VGroove: kernels.GROOVE}


@dataclasses.dataclass(frozen=True, eq=False)
class Microfacet(BRDF):
    """Facets distributed by `ndf`, reflecting by `fresnel`, hiding each other by `shadowing`."""

    ndf: NDF = dataclasses.field(default_factory=GGX)
    fresnel: Reflectance = dataclasses.field(default_factory=Fresnel)
    shadowing: Shadowing = Smith()  # noqa: RUF009  (a frozen value)

    def __post_init__(self) -> None:
        for name, kind in (("ndf", NDF), ("fresnel", Reflectance), ("shadowing", Shadowing)):
            value = getattr(self, name)
            if not isinstance(value, kind):
                raise ParameterError(
                    f"Microfacet: {name} = {value!r:.60} is no {kind.__name__}. "
                    "As in Microfacet(GGX(0.3), Fresnel(1.5), Smith())."
                )

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

    def _compiled(self, wi: Array, wo: Array) -> Array | None:
        # By exact type: a subclass may have another formula.
        ndf, fresnel = NDFS.get(type(self.ndf)), REFLECTANCES.get(type(self.fresnel))
        shadowing = SHADOWINGS.get(type(self.shadowing))
        if isinstance(self.shadowing, Smith) and not self.shadowing.correlated:
            shadowing = kernels.SEPARABLE
        if not isinstance(self.ndf, Slopes) or ndf is None or fresnel is None or shadowing is None:
            return None
        widths = (to_numpy(alpha)[..., None] for alpha in self.ndf.widths())
        numbers = [getattr(self.fresnel, name) for name in self.fresnel.bounds]
        return through(kernels.microfacet, wi, wo, (*widths, numbers[0], numbers[-1]), ndf, shadowing, fresnel)

    def pdf(self, wi: Array, wo: Array) -> Array:
        xp, wi, wo = floats(wi, wo)
        h = facet_between(wi, wo)
        return self.ndf.pdf(h, wo) / (4 * xp.clip(xp.abs(dot(wo, h)), xp.finfo(wo.dtype).eps, None))
