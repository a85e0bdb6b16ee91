"""Mitsuba 3 as an outside authority; its si.wi is the eye, and what it evaluates holds the cosine of the light."""

from __future__ import annotations

import numpy as np
import pytest

import gonio as gn

from .cases import METAL, directions


@pytest.fixture(scope="module")
def mi():
    mitsuba = pytest.importorskip("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    return mitsuba


def theirs(mi, plugin, wi, wo):
    bsdf = mi.load_dict(plugin)
    si = mi.SurfaceInteraction3f()
    values, densities = [], []
    for i, o in zip(wi.tolist(), wo.tolist(), strict=True):
        si.wi = mi.Vector3f(o)
        light = mi.Vector3f(i)
        values.append(np.array(bsdf.eval(mi.BSDFContext(), si, light)) / i[2])
        densities.append(bsdf.pdf(mi.BSDFContext(), si, light))
    return np.array(values), np.array(densities)


@pytest.fixture(scope="module")
def pairs():
    wi, wo = directions(150, 50), directions(150, 51)
    # Half of the lights stand near the mirror direction, where narrow lobes are.
    wi[::2] = wo[::2] * [-1, -1, 1] + 0.1 * (wi[::2] - 0.5)
    wi /= np.linalg.norm(wi, axis=1, keepdims=True)
    above = wi[:, 2] > 0.02
    return wi[above], wo[above]


def test_diffuse(mi, pairs):
    values, densities = theirs(
        mi, {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.2, 0.5, 0.8]}}, *pairs
    )
    # 1e-5: Mitsuba reckons in single precision.
    np.testing.assert_allclose(gn.Lambert([0.2, 0.5, 0.8]).f(*pairs), values, rtol=1e-5)
    np.testing.assert_allclose(gn.Lambert(0.5).pdf(*pairs), densities, rtol=1e-5)


@pytest.mark.parametrize("alpha", [(0.1, 0.1), (0.05, 0.3), (0.6, 0.6)])
@pytest.mark.parametrize("kind", ["ggx", "beckmann"])
def test_rough_conductors(mi, pairs, kind, alpha):
    plugin = {
        "type": "roughconductor",
        "distribution": kind,
        "alpha_u": alpha[0],
        "alpha_v": alpha[1],
        "eta": {"type": "rgb", "value": METAL[0].tolist()},
        "k": {"type": "rgb", "value": METAL[1].tolist()},
    }
    values, densities = theirs(mi, plugin, *pairs)
    ndf = (gn.GGX if kind == "ggx" else gn.Beckmann)(*alpha)
    model = gn.Microfacet(ndf, gn.Conductor(*METAL), gn.Smith(correlated=False))
    # Single precision, magnified by 1/alpha^2; its Beckmann shadowing is Walter's rational fit, good to .35 % each way.
    tolerance = 2e-3 if kind == "ggx" else 1e-2
    np.testing.assert_allclose(model.f(*pairs), values, rtol=tolerance, atol=1e-6)
    np.testing.assert_allclose(model.pdf(*pairs), densities, rtol=tolerance, atol=1e-6)


@pytest.mark.parametrize("kind", ["ggx", "beckmann"])
def test_reflection_by_rough_dielectrics(mi, pairs, kind):
    plugin = {"type": "roughdielectric", "distribution": kind, "alpha": 0.3, "int_ior": 1.5, "ext_ior": 1.0}
    values, _ = theirs(mi, plugin, *pairs)
    ndf = (gn.GGX if kind == "ggx" else gn.Beckmann)(0.3)
    model = gn.Microfacet(ndf, gn.Fresnel(1.5), gn.Smith(correlated=False))
    tolerance = 2e-4 if kind == "ggx" else 1e-2
    np.testing.assert_allclose(np.broadcast_to(model.f(*pairs), values.shape), values, rtol=tolerance, atol=1e-6)
