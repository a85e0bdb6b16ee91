"""Mitsuba 3 as an outside authority: what its path tracer sees of a ball under an environment, against gonio's maps."""

import numpy as np
import pytest

import gonio as gn
from gonio.files.environments import as_picture

# gonio's (x, y, z) with z up in Mitsuba's axes with y up.
TO_MITSUBA = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
SAMPLES = 3000


@pytest.fixture(scope="module")
def mi():
    mitsuba = pytest.importorskip("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    return mitsuba


def traced(mi, room, bsdf, n, wo):
    """Mean radiance (N, 3) of `SAMPLES` paths from each point n of a unit ball towards wo, and its standard error."""
    picture = as_picture(room, gn.LatLongMap(), gn.Orientation.MITSUBA).image.astype(np.float32)
    scene = mi.load_dict(
        {
            "type": "scene",
            "light": {"type": "envmap", "bitmap": mi.Bitmap(picture), "to_world": mi.ScalarTransform4f()},
            "ball": {"type": "sphere", "bsdf": bsdf},
        }
    )
    integrator = mi.load_dict({"type": "direct"})
    sampler = mi.load_dict({"type": "independent", "sample_count": SAMPLES})
    means, errors = [], []
    for k, (point, eye) in enumerate(zip(n @ TO_MITSUBA.T, wo @ TO_MITSUBA.T, strict=True)):
        sampler.seed(k)
        ray = mi.RayDifferential3f(mi.Point3f((point + 3 * eye).tolist()), mi.Vector3f((-eye).tolist()))
        values = np.array([list(integrator.sample(scene, sampler, ray)[0]) for _ in range(SAMPLES)])
        means.append(values.mean(axis=0))
        errors.append(values.std(axis=0) / np.sqrt(SAMPLES))
    return np.array(means), np.array(errors)


@pytest.mark.parametrize("kind", ["matte", "metal"])
def test_a_ball_in_a_room_is_as_mitsuba_traces_it(mi, kind, rng):
    room = gn.studio(64)
    n = gn.normalise(rng.normal(size=(24, 3)))
    theta, phi = rng.random(24) * 1.1, rng.random(24) * 2 * np.pi
    wo = gn.to_world(gn.frame(n), gn.from_spherical(theta, phi))
    if kind == "matte":
        brdf, bsdf = gn.Lambert(0.7), {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.7}}
    else:
        eta, k = [0.18, 0.54, 1.33], [3.43, 2.23, 1.87]
        brdf = gn.Microfacet(gn.GGX(0.4), gn.Conductor(eta, k), gn.Smith(correlated=False))
        bsdf = {"type": "roughconductor", "distribution": "ggx", "alpha": 0.4}
        bsdf |= {name: {"type": "rgb", "value": value} for name, value in (("eta", eta), ("k", k))}
    maps = gn.prefilter(room, brdf, 0.08)
    means, errors = traced(mi, room, bsdf, n, wo)
    scale = np.sqrt(np.mean(means**2))
    noise = np.sqrt(np.mean(errors**2)) / scale
    found = np.sqrt(np.mean((maps.radiance(n, wo) - means) ** 2)) / scale
    # Its noise, about 1 to 2 %, its bilinear pixels of 64 rows, and what the maps say they leave out.
    assert found < 1.5 * maps.error + 2 * noise + 0.005
    # The sum over every pixel, without maps: the noise alone.
    summed = gn.radiance(brdf, room, gn.frame(n), wo)
    assert np.sqrt(np.mean((summed - means) ** 2)) / scale < 2 * noise + 0.005
