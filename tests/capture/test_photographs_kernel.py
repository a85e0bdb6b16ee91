"""The kernel that picks pixels of photographs."""

import numpy as np
from numpy.testing import assert_array_equal

from gonio._kernels.photographs import decode


def test_codes_become_the_light_of_a_table_where_they_are_wanted(rng):
    codes, table = rng.integers(0, 256, (4, 50, 3)).astype(np.uint8), rng.random(256).astype(np.float32)
    codes[2, 7] = [3, 255, 4]
    table.flags.writeable = False
    at, here = rng.permutation(50)[:20], rng.permutation(30)[:20]
    at[0] = 7
    radiance, clipped = np.full((4, 30, 3), -1, np.float32), np.zeros((4, 30), bool)
    decode(codes, at, table, here, radiance, clipped)
    assert_array_equal(radiance[:, here], table[codes[:, at]])
    assert_array_equal(clipped[:, here], (codes[:, at] == 255).any(axis=2))
    assert clipped[2, here[0]]
    assert (radiance[:, np.setdiff1d(np.arange(30), here)] == -1).all()


def test_grey_codes_become_three_equal_channels(rng):
    codes, table = rng.integers(0, 256, (1, 50, 1)).astype(np.uint8), rng.random(256).astype(np.float32)
    codes[0, 9] = 255
    table.flags.writeable = False
    every, radiance, clipped = np.arange(50), np.empty((1, 50, 3), np.float32), np.empty((1, 50), bool)
    decode(codes, every, table, every, radiance, clipped)
    assert_array_equal(radiance, np.repeat(table[codes], 3, axis=2))
    assert_array_equal(clipped, codes[..., 0] == 255)
