"""Fibres that lie along the tangent (Kajiya and Kay 1989), on a surface (Banks 1994).

    f = 3/8 kd sin t_i + N ks (sin t_i sin t_o - cos t_i cos t_o)_+^s = 3/8 kd sin t_i + N ks cos^s(t_i + t_o - pi)

t is the angle to the tangent s = (1, 0, 0). The highlight is the cone that a mirroring fibre throws: t_i + t_o = pi,
both pointing away from the fibre (RH 5.3.1 writes cos(t_i - t_o), with the light's direction of travel). Normalised so
that kd and ks are albedos: of the matte term for every wo, of the highlight, N = Gamma(s/2 + 2) / (2 sqrt(pi)
Gamma(s/2 + 3/2)), for wo across the fibres, where it is highest. The highlight is reciprocal; the matte term, which
knows only the light, is not. Samples fall by the cosine.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, ClassVar

from .._kernels import brdf as kernels
from ..arrays import Array, like, namespace, special, to_numpy
from .model import BRDF, Bounds
from .pairs import through
from .sampling import power


@dataclasses.dataclass(frozen=True, eq=False)
class KajiyaKay(BRDF):
    """`kd`, `ks` (..., C) in [0, 1]; `shininess` (...) in [0, 1e6]."""

    kd: Array = 0.3
    ks: Array = 0.3
    shininess: Array = 32.0

    bounds: ClassVar[dict[str, Bounds]] = {
        "kd": Bounds(0.0, 1.0, colour=True),
        "ks": Bounds(0.0, 1.0, colour=True),
        "shininess": Bounds(0.0, 1e6),
    }

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        s = like(self.shininess, wi)
        sine_i, sine_o = (xp.sqrt(w[..., 1] ** 2 + w[..., 2] ** 2) for w in (wi, wo))
        matte = 0.375 * sine_i + xp.zeros_like(sine_o)
        cone = _unit_albedo(s) * power(xp, sine_i * sine_o - wi[..., 0] * wo[..., 0], s)
        return like(self.kd, wi) * matte[..., None] + like(self.ks, wi) * cone[..., None]

    def _compiled(self, wi: Array, wo: Array) -> Array:
        (s,) = self._lanes("shininess")
        cone = to_numpy(self.ks) * _unit_albedo(s)
        return through(kernels.kajiya_kay, wi, wo, (0.375 * to_numpy(self.kd), cone, s))

    def _strength(self, xp: Any, wo: Array) -> Array:
        return self._mean(xp, self.kd, wo) + self._mean(xp, self.ks, wo)


def _unit_albedo(s: Array) -> Array:
    """N: what gives the highlight of exponent s the albedo 1 across the fibres."""
    gammaln = special(s).gammaln
    return namespace(s).exp(gammaln(s / 2 + 2) - gammaln(s / 2 + 1.5)) / (2 * math.sqrt(math.pi))
