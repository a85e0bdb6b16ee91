"""Every analytic model once, with its plain twin, for the tests of what all have in common."""

from __future__ import annotations

import numpy as np
from reference import brdf as plain

import gonio as gn

METAL = (np.array([0.2, 0.92, 1.1]), np.array([3.9, 2.45, 2.14]))

# ks, alpha, p, scale, f0, f1, shadow, c, k and theta_0 of violet rubber in red, as Bagher et al. published them
SHIFTED_GAMMA = 0.547456, 0.445092, 0.923481, 3.58673, 0.0518927, -0.0208955, 2.83007, 0.00374266, 9.67534, -0.0037936


def directions(n, seed=1):
    """n directions above the surface, uniform."""
    rng = np.random.default_rng(seed)
    z, phi = rng.uniform(0.02, 1, n), rng.uniform(0, 2 * np.pi, n)
    s = np.sqrt(1 - z * z)
    return np.stack((s * np.cos(phi), s * np.sin(phi), z), axis=-1)


def _facets(kind, ax, ay, shadowing, F):
    return lambda wi, wo: plain.microfacet(wi, wo, ax, ay, kind, shadowing, F)


def _schlick(c):
    return 0.04 + 0.96 * (1 - c) ** 5


# name: (model, twin, whether exchanging the directions changes nothing)
MODELS = {
    "lambert": (gn.Lambert(0.6), lambda wi, wo: 0.6 / np.pi, True),
    "oren-nayar": (gn.OrenNayar(0.6, 0.4), lambda wi, wo: plain.oren_nayar(wi, wo, 0.6, 0.4), True),
    "phong": (gn.Phong(0.4, 20.0), lambda wi, wo: plain.phong(wi, wo, 0.4, 20.0), False),
    "modified phong": (gn.ModifiedPhong(0.4, 20.5), lambda wi, wo: plain.modified_phong(wi, wo, 0.4, 20.5), True),
    "blinn-phong": (gn.BlinnPhong(0.4, 30.0), lambda wi, wo: plain.blinn_phong(wi, wo, 0.4, 30.0), True),
    "lafortune": (
        gn.Lafortune(-0.95, -0.8, 0.9, 12.5),
        lambda wi, wo: plain.lafortune(wi, wo, -0.95, -0.8, 0.9, 12.5),
        True,
    ),
    "lafortune rgb": (
        gn.Lafortune([-0.9, -0.95, -1.0], -0.9, [0.8, 0.9, 0.7], 8.0),
        lambda wi, wo: [
            plain.lafortune(wi, wo, x, -0.9, z, 8.0) for x, z in zip((-0.9, -0.95, -1.0), (0.8, 0.9, 0.7), strict=True)
        ],
        True,
    ),
    "ward": (gn.Ward(0.5, 0.15, 0.4), lambda wi, wo: plain.ward(wi, wo, 0.5, 0.15, 0.4), True),
    "bounded ward": (
        gn.Ward(0.5, 0.15, 0.4, bounded=True),
        lambda wi, wo: plain.bounded_ward(wi, wo, 0.5, 0.15, 0.4),
        True,
    ),
    "torrance-sparrow": (
        gn.TorranceSparrow(0.5, 0.3, 1.7, 0.25),
        lambda wi, wo: plain.torrance_sparrow(wi, wo, 0.5, 0.3, 1.7, 0.25),
        False,
    ),
    "kajiya-kay": (gn.KajiyaKay(0.2, 0.5, 25.0), lambda wi, wo: plain.kajiya_kay(wi, wo, 0.2, 0.5, 25.0), False),
    "abc": (
        gn.ABC(0.1, [2.0, 3.0, 4.0], 120.0, 1.4, 1.5),
        lambda wi, wo: [plain.abc(wi, wo, 0.1, a, 120.0, 1.4, 1.5) for a in (2.0, 3.0, 4.0)],
        True,
    ),
    "shifted gamma": (
        gn.ShiftedGamma(0.2, *SHIFTED_GAMMA),
        lambda wi, wo: plain.shifted_gamma(wi, wo, 0.2, *SHIFTED_GAMMA),
        True,
    ),
    "ggx": (
        gn.Microfacet(gn.GGX(0.3), gn.Fresnel(1.5)),
        _facets("ggx", 0.3, 0.3, "correlated", lambda c: plain.fresnel(c, 1.5)),
        True,
    ),
    "ggx metal": (
        gn.Microfacet(gn.GGX(0.15, 0.5), gn.Conductor(*METAL)),
        lambda wi, wo: [
            plain.microfacet(wi, wo, 0.15, 0.5, "ggx", "correlated", lambda c, n=n, k=k: plain.fresnel(c, n, k))
            for n, k in zip(*METAL, strict=True)
        ],
        True,
    ),
    "beckmann": (
        gn.Microfacet(gn.Beckmann(0.4, 0.25), gn.Schlick(0.04), gn.Smith(correlated=False)),
        _facets("beckmann", 0.4, 0.25, "separable", _schlick),
        True,
    ),
    "cook-torrance": (
        gn.Microfacet(gn.Beckmann(0.3), gn.Schlick(0.04), gn.VGroove()),
        _facets("beckmann", 0.3, 0.3, "groove", _schlick),
        True,
    ),
    "ashikhmin": (
        gn.Microfacet(gn.GGX(0.3), gn.Schlick(0.04), gn.Ashikhmin()),
        _facets("ggx", 0.3, 0.3, "separable", _schlick),
        True,
    ),
    "sum": (
        gn.Lambert([0.3, 0.2, 0.1]) + 0.5 * gn.Microfacet(gn.GGX(0.3), gn.Fresnel(1.5)),
        lambda wi, wo: (
            np.array([0.3, 0.2, 0.1]) / np.pi
            + 0.5 * plain.microfacet(wi, wo, 0.3, 0.3, "ggx", "correlated", lambda c: plain.fresnel(c, 1.5))
        ),
        True,
    ),
}
