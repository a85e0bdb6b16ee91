import numpy as np
import pytest
from reference import row_pairs as plain

from gonio._kernels import packing, row_pairs
from gonio.sphere.legendre import odd_factors


def close(actual, expected, atol=1e-13):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=atol)


@pytest.mark.parametrize(("rows", "channels"), [(6, 3), (7, 3), (6, 1), (7, 2)])
def test_lines_are_the_sum_of_their_quarters_continued(rows, channels, rng):
    pairs = (rows + 1) // 2
    quarters, cosines = rng.normal(size=(4, pairs, 2 * channels, 5)), rng.random(pairs)
    if rows % 2:
        cosines[-1] = 0  # as on the equator
    image = np.empty((rows, 20 * channels))
    row_pairs.unfold(*quarters, cosines, 0, image)
    lines = sum(plain.turn(quarters[k], k > 1, k % 2 == 1) for k in range(4)).transpose(1, 0, 2)
    lines[channels:] *= cosines[:, None]
    close(image, plain.image(lines, rows))


def test_folding_is_unfolding_transposed(rng):
    image, quarters, weights = rng.normal(size=(6, 60)), rng.normal(size=(4, 3, 6, 5)), np.ones((2, 3))
    folded, unfolded = np.empty_like(quarters), np.empty_like(image)
    row_pairs.fold(image, weights, 0, *folded)
    row_pairs.unfold(*quarters, np.ones(3), 0, unfolded)
    assert np.sum(folded * quarters) == pytest.approx(np.sum(image * unfolded), rel=1e-12)


@pytest.mark.parametrize("low", [0, 2])
def test_packing_solves_for_factors_of_cos_theta(low, rng):
    degree, steps, orders = 7, 8, 4
    flat, norms = rng.normal(size=((degree + 1) ** 2, 2)), rng.random((2, degree + 1))
    norms[1, 0] = 0
    packed = np.empty((orders, steps, 8))
    packing.pack(flat, degree, *odd_factors(degree, steps), norms, low, packed)

    def g(l, m):
        return np.sqrt(((l + 1.0) ** 2 - m * m) / (4 * (l + 1.0) ** 2 - 1))

    close(packed, plain.pack(flat, degree, g, norms, low, orders, steps))
    # Unpacking is its transpose.
    sums, out = rng.normal(size=packed.shape), np.zeros_like(flat)
    expected = np.sum(sums * packed)
    packing.unpack(sums, degree, *odd_factors(degree, steps), norms, low, out)
    assert np.sum(out * flat) == pytest.approx(expected, rel=1e-12)
