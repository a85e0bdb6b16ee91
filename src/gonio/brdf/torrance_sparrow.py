"""The simplified Torrance-Sparrow model of RH 6.2: matte ground, and facets without shadowing.

    f = K_d / pi + K_s F(mu, theta_o) / F(mu, 0) S / (4 cos theta_i cos theta_o)
    S = exp(-(theta_h / sigma)^2) / (pi sigma^2)

RH prints K_d without 1/pi, which would give teflon an albedo of 2.8. F depends on theta_o where physics has the angle
to the half vector, and G is left out: the model is not reciprocal, and reflects more than it receives as wo grazes.
It is what RH's closed forms and fits are about; `Microfacet` is the physical model.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, ClassVar

from .._kernels import brdf as kernels
from ..arrays import Array, floats, like, to_numpy
from ..directions import dot
from .diffuse import Lambert
from .fresnel import Fresnel
from .model import BRDF, Bounds
from .pairs import through
from .sampling import cosine_direction, facet_between, mirrored


@dataclasses.dataclass(frozen=True, eq=False)
class TorranceSparrow(BRDF):
    """`kd`, `ks` (..., C) in [0, 1]; index `mu` (...) in [1.01, 10]; roughness `sigma` (...), radians, in [1e-3, 1]."""

    kd: Array = 0.5
    ks: Array = 0.5
    mu: Array = 1.5
    sigma: Array = 0.2

    bounds: ClassVar[dict[str, Bounds]] = {
        "kd": Bounds(0.0, 1.0, colour=True),
        "ks": Bounds(0.0, 1.0, colour=True),
        "mu": Bounds(1.01, 10.0),
        "sigma": Bounds(1e-3, 1.0),
    }

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        above = (wi[..., 2] > 0) & (wo[..., 2] > 0)
        sigma = like(self.sigma, wi)
        t = self._theta(xp, facet_between(wi, wo)) / sigma
        S = xp.exp(-t * t) / (math.pi * sigma * sigma)
        lobe = self._facing(xp, wo) * S / (4 * xp.where(above, wi[..., 2] * wo[..., 2], xp.ones_like(t)))
        return like(self.kd, wi) / math.pi + like(self.ks, wi) * lobe[..., None]

    def _compiled(self, wi: Array, wo: Array) -> Array:
        mu, sigma = self._lanes("mu", "sigma")
        normal = ((mu - 1) / (mu + 1)) ** 2
        specular = to_numpy(self.ks) / (4 * math.pi * sigma * sigma * normal)
        return through(kernels.torrance_sparrow, wi, wo, (to_numpy(self.kd) / math.pi, specular, mu, 1 / sigma))

    def lobes(self) -> tuple[BRDF, ...]:
        return Lambert(self.kd), dataclasses.replace(self, kd=0.0)

    def _facing(self, xp: Any, wo: Array) -> Array:
        """F(mu, theta_o) / F(mu, 0), (...)."""
        mu = like(self.mu, wo)
        F = Fresnel(mu[..., None])(wo[..., 2])[..., 0]
        return F / ((mu - 1) / (mu + 1)) ** 2

    @staticmethod
    def _theta(xp: Any, h: Array) -> Array:
        return xp.atan2(xp.sqrt(h[..., 0] ** 2 + h[..., 1] ** 2), h[..., 2])

    def _strength(self, xp: Any, wo: Array) -> Array:
        matte, glossy = self._parts(xp, wo)
        return matte + glossy

    def _parts(self, xp: Any, wo: Array) -> tuple[Array, Array]:
        return self._mean(xp, self.kd, wo), self._mean(xp, self.ks, wo) * self._facing(xp, wo)

    def _matte_share(self, xp: Any, wo: Array) -> Array:
        matte, glossy = self._parts(xp, wo)
        total = matte + glossy
        return xp.where(total > 0, matte / xp.where(total > 0, total, xp.ones_like(total)), xp.ones_like(total))

    def sample(self, wo: Array, u: Array) -> Array:
        xp, wo, u = floats(wo, u)
        sigma = like(self.sigma, wo)
        # theta_h of density 2 t exp(-t^2) / (sigma Z), t = theta_h / sigma, cut off at pi/2.
        Z = 1 - xp.exp(-((0.5 * math.pi / sigma) ** 2))
        theta, phi = sigma * xp.sqrt(-xp.log(1 - u[..., 1] * Z)), 2 * math.pi * u[..., 2]
        s, phi = xp.sin(theta), phi + xp.zeros_like(theta)
        glossy = mirrored(wo, xp.stack((s * xp.cos(phi), s * xp.sin(phi), xp.cos(theta)), axis=-1))
        matte = (u[..., 0] < self._matte_share(xp, wo))[..., None]
        return xp.where(matte, cosine_direction(u[..., 1:]) + xp.zeros_like(glossy), glossy)

    def pdf(self, wi: Array, wo: Array) -> Array:
        xp, wi, wo = floats(wi, wo)
        sigma = like(self.sigma, wo)
        Z = 1 - xp.exp(-((0.5 * math.pi / sigma) ** 2))
        h = facet_between(wi, wo)
        theta = self._theta(xp, h)
        small = theta < 1e-6
        stretch = xp.where(small, xp.ones_like(theta), theta / xp.sin(xp.where(small, xp.ones_like(theta), theta)))
        glossy = xp.exp(-((theta / sigma) ** 2)) / (math.pi * sigma * sigma * Z) * stretch
        glossy = glossy / (4 * xp.clip(xp.abs(dot(wo, h)), xp.finfo(wo.dtype).eps, None))
        matte = self._matte_share(xp, wo)
        return matte * super().pdf(wi, wo) + (1 - matte) * glossy
