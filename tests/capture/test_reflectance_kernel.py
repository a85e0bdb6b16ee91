"""The kernels of samples beside their plain twins."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from reference import reflectance as plain

import gonio as gn
from gonio._kernels import reflectance as kernels

N, S = 7, 30


@pytest.fixture
def scene(rng):
    normals = gn.normalise(rng.normal(size=(S, 3)) + np.array([0, 0, 1]))
    irradiance = rng.random((N, S, 3)) + 0.1
    irradiance[2, 4] = 0  # a lamp that looks away
    return {
        "radiance": rng.random((N, S, 3)).astype(np.float32),
        "known": rng.random((N, S)) < 0.8,
        "facing": rng.random((N, S)) < 0.8,
        "frames": gn.frame(normals),
        "direction": gn.normalise(rng.normal(size=(N, S, 3))),
        "irradiance": irradiance,
    }


def filled(*arguments):
    wi, value, weight = np.empty((S, N, 3)), np.empty((S, N, 3)), np.empty((S, N))
    kernels.reflect(*arguments, wi, value, weight)
    return wi, value, weight


def test_photographs_become_reflectance_as_by_the_plain_twin(scene):
    floor = np.linspace(0, 1.5, S)
    for found, expected in zip(
        filled(*scene.values(), 0.3, floor), plain.reflect(*scene.values(), 0.3, floor), strict=True
    ):
        assert_allclose(found, expected, rtol=1e-12, atol=1e-15)


def test_one_light_and_one_eye_serve_all_sites(scene):
    same = scene | {name: scene[name][:, :1] for name in ("direction", "irradiance")} | {"facing": scene["facing"][:1]}
    each = scene | {name: np.repeat(same[name], S, axis=1) for name in ("direction", "irradiance")}
    each["facing"] = np.repeat(same["facing"], N, axis=0)
    for found, expected in zip(
        filled(*same.values(), 0.0, np.zeros(S)), filled(*each.values(), 0.0, np.zeros(S)), strict=True
    ):
        assert_array_equal(found, expected)


def test_brightness_is_summed_as_by_the_plain_twin(scene):
    total, count = np.zeros(S), np.zeros(S)
    kernels.brightness(scene["radiance"], scene["known"], scene["irradiance"], total, count)
    expected, number = plain.brightness(scene["radiance"], scene["known"], scene["irradiance"])
    assert_allclose(total, expected, rtol=1e-12)
    assert_array_equal(count, number)


def test_what_has_weight_is_gathered_as_by_the_plain_twin(rng):
    columns = *rng.random((3, S, 3)), np.where(rng.random(S) < 0.4, rng.random(S), 0)
    expected = plain.gather(*columns)
    found = tuple(np.empty_like(column) for column in expected)
    kernels.gather(*columns, *found)
    for one, other in zip(found, expected, strict=True):
        assert_array_equal(one, other)
