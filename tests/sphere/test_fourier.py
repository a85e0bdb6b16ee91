import numpy as np
import pytest
from reference import fourier as plain

from gonio._kernels import mending
from gonio.sphere.fourier import Transforms
from gonio.sphere.grids import LatLong
from gonio.sphere.row_pairs import Matrices
from gonio.sphere.tiles import tiled, untiled

# rows, columns, degree, channels: radices 4, 2, 3, 5 and 11, one phase and several, orders up to half of the points of
# a phase, tiles that are full and not, an equator and none.
SIZES = [
    (20, 32, 8, 3),
    (64, 32, 9, 3),
    (35, 128, 20, 3),
    (7, 16, 4, 1),
    (7, 16, 7, 2),
    (33, 30, 14, 3),
    (16, 22, 5, 1),
    (16, 2, 0, 3),
    (5, 7, 3, 3),
    (5, 1, 0, 1),
]


def rings_of(tiles, rows):
    """(orders, 2, 2, C, pairs)."""
    rings = untiled(tiles, (rows + 1) // 2)
    return rings.reshape(rings.shape[0], 2, 2, -1, rings.shape[2])


@pytest.mark.parametrize(("rows", "columns", "degree", "channels"), SIZES)
def test_transforms_are_sums_of_cosines_and_sines(rows, columns, degree, channels, rng):
    pairs, way = (rows + 1) // 2, Transforms(LatLong(rows, columns), degree)
    rings, cosines = rng.normal(size=(degree + 1, 2, 2, channels, pairs)), rng.random(pairs)
    rings[0, :, 1] = 0  # there is no sin(0 phi)
    if rows % 2:
        cosines[-1] = 0  # as on the equator
    values = way.synthesise(tiled(rings.reshape(degree + 1, -1, pairs)), cosines)
    # Rounding: a few units for each level of the transform, of sums over all orders.
    np.testing.assert_allclose(values, plain.image(rings, cosines, rows, columns), rtol=0, atol=1e-13 * (degree + 1))


@pytest.mark.parametrize(("rows", "columns", "degree", "channels"), SIZES)
def test_transforms_back_are_products_with_cosines_and_sines(rows, columns, degree, channels, rng):
    pairs, way = (rows + 1) // 2, Transforms(LatLong(rows, columns), degree)
    values, weights = rng.normal(size=(rows, columns, channels)), rng.random((2, pairs))
    tiles = way.analyse(values, weights)
    expected = plain.rings(values, weights, degree)
    np.testing.assert_allclose(rings_of(tiles, rows), expected, rtol=0, atol=1e-14 * columns)
    # Lanes without a pair go on into the sums over theta, and must not hold what memory held before.
    assert not tiles[-1, ..., (pairs - 1) % tiles.shape[-1] + 1 :].any()


@pytest.mark.parametrize(("rows", "columns", "degree"), [(6, 16, 7), (7, 16, 4), (40, 32, 9)])
def test_products_and_transforms_give_the_same(rows, columns, degree, rng):
    grid, values = LatLong(rows, columns), rng.normal(size=(rows, columns, 2))
    pairs, ways = (rows + 1) // 2, (Matrices(grid, degree), Transforms(grid, degree))
    weights = rng.random((2, pairs))
    by_products, by_transforms = (way.analyse(values, weights) for way in ways)
    np.testing.assert_allclose(by_products, by_transforms, rtol=0, atol=1e-12)
    by_products, by_transforms = (way.synthesise(by_products, np.full(pairs, 0.5)) for way in ways)
    np.testing.assert_allclose(by_products, by_transforms, rtol=0, atol=1e-12)


def test_single_precision_keeps_its_digits(rng):
    way, rings = Transforms(LatLong(64, 128), 40), rng.normal(size=(41, 12, 32)).astype(np.float32)
    rings[0, 3:6], rings[0, 9:12] = 0, 0
    cosines = rng.random(32).astype(np.float32)
    values = way.synthesise(tiled(rings), cosines)
    expected = plain.image(rings.astype(float).reshape(41, 2, 2, 3, 32), cosines.astype(float), 64, 128)
    assert values.dtype == np.float32
    assert np.max(np.abs(values - expected)) < 1e-6 * np.max(np.abs(expected))


@pytest.mark.parametrize("rings", [1, 16, 21])
def test_tiles_hold_all_rings_and_zeros(rings, rng):
    x = rng.normal(size=(3, 4, rings))
    tiles = tiled(x)
    np.testing.assert_array_equal(untiled(tiles, rings), x)
    assert np.sum(np.abs(tiles)) == pytest.approx(np.sum(np.abs(x)), rel=1e-14)


def test_mending_adds_what_the_products_with_waves_spread(rng):
    x, waves, spread = rng.normal(size=(5, 4, 20)), rng.normal(size=(3, 20)), rng.normal(size=(3, 20))
    tiles = tiled(x)
    mending.mend(
        tiles, 1, 5, 2, *(np.ascontiguousarray(tiled(w[:, None])[:, :, 0].swapaxes(0, 1)) for w in (waves, spread))
    )
    expected = x.copy()
    expected[1::2, 2:] = plain.mended(x[1::2, 2:], waves, spread)
    np.testing.assert_allclose(untiled(tiles, 20), expected, rtol=0, atol=1e-12)
