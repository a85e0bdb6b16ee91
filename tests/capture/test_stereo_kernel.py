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
    kernels.solve(values, np.ascontiguousarray(lights.T), robust, found, counts, residual, error)
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
    kernels.solve(values, lights, True, found, counts, residual, error)
    assert np.isnan(found[0]).all()
    assert np.isnan(residual[0])
    assert not counts[0].any()
    assert_allclose(found[1], 0.5)
