"""Two models that are published as fits to all hundred MERL materials.

    f = [kd + F D G / (cos theta_i cos theta_o)] / pi                                          ABC (Löw et al. 2012)
    D = A / (1 + B (1 - cos theta_h))^C,   F of clear dielectrics of index ior at theta_d,   G of V-shaped grooves

    f = [kd + ks F D G(theta_i) G(theta_o) / (cos theta_i cos theta_o)] / pi                  SGD (Bagher et al. 2012)
    D = N exp(-t) / (pi t^p cos^4 theta_h),   t = alpha + tan^2 theta_h / alpha
    F = f0 - f1 cos theta_d + (1 - f0) (1 - cos theta_d)^5
    G = 1 + L (1 - exp(c (theta - theta_0)_+^k)), cut to [0, 1]

Both are fits of curves: D is not a normalised distribution, and F may leave [0, 1]; where f falls below zero it is cut.
Each channel of SGD has its own curve. Reciprocal. `files/merl_fits.py` reads the published parameters.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, ClassVar

from .._kernels import merl_models as kernels
from ..arrays import Array, like, to_numpy
from .fresnel import dielectric
from .model import BRDF, Bounds
from .pairs import through


@dataclasses.dataclass(frozen=True, eq=False)
class ABC(BRDF):
    """`kd` in [0, 2] and `a` in [0, 1e6], (..., C); `b` in [0, 1e9], `c` in [0, 20] and `ior` in [1, 100], (...)."""

    kd: Array
    a: Array
    b: Array
    c: Array
    ior: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "kd": Bounds(0.0, 2.0, colour=True),
        "a": Bounds(0.0, 1e6, colour=True),
        "b": Bounds(0.0, 1e9),
        "c": Bounds(0.0, 20.0),
        "ior": Bounds(1.0, 100.0),
    }

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        ci, co, l2, flat = _geometry(xp, wi, wo)
        l = xp.sqrt(l2)
        beyond = flat / (l * (l + ci + co))  # 1 - cos theta_h, which does not cancel so
        D = like(self.a, wi) * ((1 + like(self.b, wi) * beyond) ** -like(self.c, wi))[..., None]
        G = xp.minimum(xp.ones_like(l), 4 * (ci + co) * xp.minimum(ci, co) / l2)
        F = dielectric(xp, like(self.ior, wi)[..., None], xp.clip(0.5 * l, 0.0, 1.0)[..., None])
        return (like(self.kd, wi) + F * D * (G / (ci * co))[..., None]) / math.pi

    def _compiled(self, wi: Array, wo: Array) -> Array:
        return through(kernels.abc, wi, wo, (self.kd, self.a, *self._lanes("b", "c", "ior")))


@dataclasses.dataclass(frozen=True, eq=False)
class ShiftedGamma(BRDF):
    """SGD. `kd`, `ks` in [0, 10]; `alpha` in [1e-6, 10], `p` in [0, 10], `scale` (N) in [0, 1e6]; `f0` in [0, 10], `f1`
    in [-2, 10]; `shadow` (L) in [0, 1e9], `c` in [0, 1e38], `k` in [0, 1e4]; `theta_0` in [-2, 2], radians; (..., C).
    """

    kd: Array
    ks: Array
    alpha: Array
    p: Array
    scale: Array
    f0: Array
    f1: Array
    shadow: Array
    c: Array
    k: Array
    theta_0: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "kd": Bounds(0.0, 10.0, colour=True),
        "ks": Bounds(0.0, 10.0, colour=True),
        "alpha": Bounds(1e-6, 10.0, colour=True),
        "p": Bounds(0.0, 10.0, colour=True),
        "scale": Bounds(0.0, 1e6, colour=True),
        "f0": Bounds(0.0, 10.0, colour=True),
        "f1": Bounds(-2.0, 10.0, colour=True),
        "shadow": Bounds(0.0, 1e9, colour=True),
        "c": Bounds(0.0, 1e38, colour=True),
        "k": Bounds(0.0, 1e4, colour=True),
        "theta_0": Bounds(-2.0, 2.0, colour=True),
    }

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        ci, co, l2, flat = (x[..., None] for x in _geometry(xp, wi, wo))
        alpha, f0, square = like(self.alpha, wi), like(self.f0, wi), (ci + co) ** 2
        t = alpha + flat / (square * alpha)
        D = like(self.scale, wi) * xp.exp(-t) * t ** -like(self.p, wi) * (l2 / square) ** 2 / math.pi
        cd = xp.clip(0.5 * xp.sqrt(l2), 0.0, 1.0)
        F = f0 - like(self.f1, wi) * cd + (1 - f0) * (1 - cd) ** 5
        G = self._seen(xp, ci) * self._seen(xp, co)
        f = (like(self.kd, wi) + like(self.ks, wi) * F * D * G / (ci * co)) / math.pi
        return xp.clip(f, 0.0, None)

    def _compiled(self, wi: Array, wo: Array) -> Array:
        strength = to_numpy(self.ks) * to_numpy(self.scale)
        lobe = self.alpha, self.p, self.f0, self.f1, self.shadow, self.c, self.k, self.theta_0
        return through(kernels.shifted_gamma, wi, wo, (self.kd, strength, *lobe))

    def _seen(self, xp: Any, cosine: Array) -> Array:
        """G of one direction."""
        beyond = xp.clip(xp.acos(xp.clip(cosine, 0.0, 1.0)) - like(self.theta_0, cosine), 0.0, None)
        # Some fits have c = 1e38: what a float cannot hold has long been cut to 0.
        power = xp.clip(like(self.c, cosine) * beyond ** like(self.k, cosine), 0.0, 80.0)
        return xp.clip(1 - like(self.shadow, cosine) * xp.expm1(power), 0.0, 1.0)


def _geometry(xp: Any, wi: Array, wo: Array) -> tuple[Array, Array, Array, Array]:
    """cos theta_i and theta_o, the square of wi + wo, and that of its horizontal part; finite below the surface too."""
    above = (wi[..., 2] > 0) & (wo[..., 2] > 0)
    one = xp.ones_like(wi[..., 2] + wo[..., 2])
    ci, co = xp.where(above, wi[..., 2], one), xp.where(above, wo[..., 2], one)
    flat = (wi[..., 0] + wo[..., 0]) ** 2 + (wi[..., 1] + wo[..., 1]) ** 2
    return ci, co, flat + (ci + co) ** 2, flat
