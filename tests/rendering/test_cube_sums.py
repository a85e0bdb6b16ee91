"""The kernel of means over a cube's texels against its plain twin."""

import numpy as np
import pytest
from reference import cube_sums as plain

import gonio as gn
from gonio._kernels import cube_sums as kernels


@pytest.mark.parametrize("channels", [1, 3])
def test_means_over_texels_are_sums_over_parts_of_pixels(channels, rng):
    size = 3
    image, weights = rng.random((8, 16, channels), dtype=np.float32), rng.random(16)
    fine = gn.LatLong(16, 32)
    polar, around = (np.stack((np.cos(x), np.sin(x)), axis=-1).astype(np.float32) for x in (fine.theta, fine.phi))
    turn = gn.euler(0.3, 0.4, 0.5)
    sums = np.zeros((6 * size * size, channels + 1))
    kernels.add(image, around, polar, weights, turn.astype(np.float32), size, sums)
    expected = plain.cube_sums(image, fine.directions() @ turn.T, weights, size)
    np.testing.assert_allclose(sums, expected, atol=1e-6)
