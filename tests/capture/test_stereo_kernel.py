"""The kernel of photometric stereo beside its plain twin."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from reference import photometric_stereo as plain

import gonio as gn
from gonio._kernels import photometric_stereo as kernels


@pytest.mark.parametrize("robust", [False, True])
def test_the_kernel_solves_as_its_plain_twin(robust, rng):
    lights = gn.normalise(rng.normal(size=(15, 3)) * [1, 1, 0.3] + [0, 0, 1])
    n = gn.normalise(rng.normal(size=(40, 3)) * 0.5 + [0, 0, 1])
    values = 0.7 * np.maximum(n @ lights.T, 0) + rng.normal(size=(40, 15)) * 0.01
    values[::3, 2] += 2.0  # highlights
    values[::4, 5] = np.nan
    found, counts = np.empty((40, 3)), np.empty((40, 15), np.uint8)
    residual, error = np.empty(40), np.empty(40)
    kernels.solve(values, np.ascontiguousarray(lights.T[None]), robust, found, counts, residual, error)
    g, counted, off, spread = plain.solve(values, lights, robust)
    assert_array_equal(counts, counted)
    assert_allclose(found, g, rtol=1e-9, atol=1e-12)
    assert_allclose(residual, off, rtol=1e-7)
    assert_allclose(error, spread, rtol=1e-7)


def test_pixels_that_too_few_lights_tell_about_have_no_normal():
    lights = np.eye(3)
    values = np.array([[0.5, 0.5, np.nan], [0.5, 0.5, 0.5]])
    found, counts = np.empty((2, 3)), np.empty((2, 3), np.uint8)
    residual, error = np.empty(2), np.empty(2)
    kernels.solve(values, lights[None], True, found, counts, residual, error)
    assert np.isnan(found[0]).all()
    assert np.isnan(residual[0])
    assert not counts[0].any()
    assert_allclose(found[1], 0.5)


def test_lights_of_each_pixel_are_solved_as_those_of_all(rng):
    lights = gn.normalise(rng.normal(size=(40, 12, 3)) * [1, 1, 0.3] + [0, 0, 1])
    n = gn.normalise(rng.normal(size=(40, 3)) * 0.5 + [0, 0, 1])
    values = 0.7 * np.maximum(np.einsum("pi,pki->pk", n, lights), 0) + rng.normal(size=(40, 12)) * 0.01
    found, counts = np.empty((40, 3)), np.empty((40, 12), np.uint8)
    residual, error = np.empty(40), np.empty(40)
    kernels.solve(values, np.ascontiguousarray(np.swapaxes(lights, 1, 2)), True, found, counts, residual, error)
    for i in range(40):
        assert_allclose(found[i], plain.solve(values[i : i + 1], lights[i], True)[0][0], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("near", [False, True])
def test_photographs_are_gathered_and_their_colours_fitted(near, rng):
    radiance = rng.random((6, 30, 3)).astype(np.float32)
    clipped = rng.random((6, 30)) < 0.2
    scale, lights = rng.random((6, 3)), rng.normal(size=(20 if near else 1, 3, 6))
    values = np.empty((20, 6))
    kernels.gather(radiance, clipped, 5, scale, values)
    expected = np.sum(radiance[:, 5:25] * scale[:, None], axis=2)
    assert_allclose(values, np.where(clipped[:, 5:25], np.nan, expected).T, rtol=1e-6)
    g, counts, albedo = rng.normal(size=(20, 3)), (rng.random((20, 6)) < 0.7).astype(np.uint8), np.empty((20, 3))
    kernels.colour(radiance, 5, scale, lights, g, counts, albedo)
    cosine = np.einsum("pik,pi->pk", np.broadcast_to(lights, (20, 3, 6)), g) * counts
    top = np.einsum("pk,kpc->pc", cosine, radiance[:, 5:25] * scale[:, None])
    length = np.linalg.norm(g, axis=1, keepdims=True)
    assert_allclose(albedo, top * length / np.sum(cosine**2, axis=1, keepdims=True), rtol=1e-6, atol=1e-9)
