import numpy as np
import pytest
from reference import row_pairs as plain

from gonio._kernels import packing, row_pairs
from gonio.sphere.grids import LatLong
from gonio.sphere.legendre import odd_factors
from gonio.sphere.row_pairs import Matrices, Transforms


def close(actual, expected, atol=1e-13):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=atol)


@pytest.mark.parametrize(("rows", "channels"), [(6, 3), (7, 3), (6, 1), (7, 2), (1, 3)])
def test_lines_are_sums_and_differences_of_mirror_rows(rows, channels, rng):
    image, pairs = rng.normal(size=(rows, 8 * channels)), (rows + 1) // 2
    weights, lines = rng.random((2, pairs)), np.empty((2 * channels, pairs, 8))
    row_pairs.gather(image, weights, 0, lines)
    close(lines, plain.lines(image, channels) * np.repeat(weights, channels, axis=0)[:, :, None])


@pytest.mark.parametrize(("rows", "channels"), [(6, 3), (7, 3), (6, 1), (7, 2)])
def test_rows_are_sums_and_differences_of_lines(rows, channels, rng):
    pairs = (rows + 1) // 2
    lines, cosines = rng.normal(size=(2 * channels, pairs, 8)), rng.random(pairs)
    if rows % 2:
        cosines[-1] = 0  # as on the equator
    image = np.empty((rows, 8 * channels))
    row_pairs.scatter(lines, cosines, 0, image)
    scaled = np.concatenate((lines[:channels], lines[channels:] * cosines[None, :, None]))
    close(image, plain.image(scaled, rows))


def test_lines_are_the_sum_of_their_quarters_continued(rng):
    quarters = rng.normal(size=(4, 3, 6, 5))
    image = np.empty((6, 60))
    row_pairs.unfold(*quarters, np.ones(3), 0, image)
    lines = sum(plain.turn(quarters[k], k > 1, k % 2 == 1) for k in range(4))
    close(image, plain.image(lines.transpose(1, 0, 2), 6))


def test_folding_is_unfolding_transposed(rng):
    image, quarters, weights = rng.normal(size=(6, 60)), rng.normal(size=(4, 3, 6, 5)), np.ones((2, 3))
    folded, unfolded = np.empty_like(quarters), np.empty_like(image)
    row_pairs.fold(image, weights, 0, *folded)
    row_pairs.unfold(*quarters, np.ones(3), 0, unfolded)
    assert np.sum(folded * quarters) == pytest.approx(np.sum(image * unfolded), rel=1e-12)


def test_rings_are_waves_by_order(rng):
    waves = rng.normal(size=(6, 4, 7)) + 1j * rng.normal(size=(6, 4, 7))
    rings = np.zeros((5, 12, 9))
    row_pairs.collect(waves, 2, rings)
    parts = waves[:, :, :5].reshape(2, 3, 4, 5).transpose(3, 0, 1, 2)
    close(rings[:, :, 2:6], np.stack((parts.real, -parts.imag), axis=2).reshape(5, 12, 4))
    back = np.empty_like(waves)
    row_pairs.distribute(rings, 2, back)
    close(back[:, :, :5], waves[:, :, :5])
    assert not back[:, :, 5:].any()


@pytest.mark.parametrize("low", [0, 2])
def test_packing_solves_for_factors_of_cos_theta(low, rng):
    degree, steps, orders = 7, 8, 4
    flat, turn = rng.normal(size=((degree + 1) ** 2, 2)), np.exp(1j * rng.normal(size=degree + 1))
    packed = np.empty((orders, steps, 8))
    packing.pack(flat, degree, *odd_factors(degree, steps), turn, low, packed)

    def g(l, m):
        return np.sqrt(((l + 1.0) ** 2 - m * m) / (4 * (l + 1.0) ** 2 - 1))

    close(packed, plain.pack(flat, degree, g, turn, low, orders, steps))
    # Unpacking is its transpose, by the conjugate turn.
    sums, out = rng.normal(size=packed.shape), np.zeros_like(flat)
    expected = np.sum(sums * packed)
    packing.unpack(sums, degree, *odd_factors(degree, steps), np.conj(turn), low, out)
    assert np.sum(out * flat) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("rows", "columns", "degree"), [(6, 16, 7), (7, 16, 4), (20, 32, 9)])
def test_products_and_transforms_give_the_same_rings(rows, columns, degree, rng):
    grid, values = LatLong(rows, columns), rng.normal(size=(rows, columns, 2))
    pairs, ways = (rows + 1) // 2, (Matrices(grid, degree), Transforms(grid, degree))
    turned = []
    for way in ways:
        rings = way.analyse(values, np.ones((2, pairs)))[:, :, :pairs].reshape(degree + 1, 2, 2, 2, pairs)
        turned.append((rings[:, :, 0] + 1j * rings[:, :, 1]) * way.turn(1)[:, None, None, None])
    close(turned[0], turned[1], atol=1e-12)
