"""Facts about facet distributions on the upper half of a cube."""

import numpy as np
import pytest

import gonio as gn
from gonio.brdf.hemicube import Hemicube, cell_directions, cell_solid_angles, from_hemicube, to_hemicube
from gonio.brdf.polar_grid import PolarGrid
from gonio.errors import GonioError

GRID = PolarGrid(32, 96)
NDFS = (gn.Beckmann(0.3), gn.GGX(0.5, 0.3), gn.Beckmann(0.3, 0.6))
CLOTH = np.stack([np.roll(gn.TabulatedNDF.of(ndf, GRID.shape).values, turn, axis=1) for ndf in NDFS for turn in (0, 9)])


def cube(function, side):
    """The hemicube of a function of directions."""
    return Hemicube(*(function(w)[None] for w in cell_directions(side)))


@pytest.mark.parametrize("side", [2, 8, 32])
def test_cells_cover_the_hemisphere(side):
    top, sides = cell_solid_angles(side)
    assert top.sum() + 4 * sides.sum() == pytest.approx(2 * np.pi, rel=1e-12)
    assert top.sum() == pytest.approx(2 * np.pi / 3, rel=1e-12)  # a sixth of the sphere
    assert top.min() > 0
    # A small cell is its centre's cosine to the face over its squared distance.
    cells, w = 4 / side**2, cell_directions(side)
    if side == 32:
        np.testing.assert_allclose(top, cells * w[0][..., 2] ** 3, rtol=2e-3)
        np.testing.assert_allclose(sides, cells * w[1][0, ..., 0] ** 3, rtol=2e-3)


def test_rows_and_columns_run_as_they_are_told():
    top, sides = cell_directions(8)
    assert np.all(top[0, :, 1] > 0)
    assert np.all(top[:, -1, 0] > 0)
    assert np.all(np.diff(sides[..., 2], axis=1) < 0)
    phi = np.arctan2(sides[..., 1], sides[..., 0])
    assert np.all(np.diff(np.unwrap(phi, axis=2), axis=2) > 0)
    middle = gn.normalise(sides.mean(axis=(1, 2)) * [1, 1, 0])
    np.testing.assert_allclose(middle, [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]], atol=1e-12)


def test_projected_areas_are_kept():
    # Cells of 3.6 degrees at the pole, where cloth is 17 wide.
    hemicube = to_hemicube(CLOTH, GRID)
    weights = [w[..., 2] * solid for w, solid in zip(cell_directions(32), cell_solid_angles(32), strict=True)]
    mass = np.einsum("mrc,rc->m", hemicube.top, weights[0]) + np.einsum("mkrc,krc->m", hemicube.sides, weights[1])
    np.testing.assert_allclose(mass, 1, rtol=0.01)
    back = from_hemicube(hemicube, GRID)
    np.testing.assert_allclose(back.sum(axis=2) @ GRID.projected, 1, rtol=0.01)


def test_cloth_comes_back_as_fine_as_the_cells():
    # Linear between cells of h = 1/16: h^2/8 D'' at the pole, D'' = 2/.3^2 D of slopes of .3, is 1 % of D along each of
    # two axes; the grid's own interpolation adds about as much.
    back = from_hemicube(to_hemicube(CLOTH, GRID), GRID)
    peak = CLOTH.max(axis=(1, 2), keepdims=True)
    assert np.abs(back - CLOTH).max() < 0.04 * peak.max()
    off = np.sqrt((((back - CLOTH) / peak) ** 2).sum(axis=2) @ GRID.solid_angles / (2 * np.pi))
    assert off.max() < 0.005
    finer = from_hemicube(to_hemicube(CLOTH, GRID, 64), GRID)
    assert np.abs(finer - CLOTH).max() < 0.6 * np.abs(back - CLOTH).max()


def test_smooth_functions_come_back_at_all_knots():
    # h^2/8 of second derivatives of at most 3 along each axis is .0015, and a part of h at corners, where three faces
    # meet; below the lowest centres, h/2 of a slope of 1.
    for function in (lambda w: 1 + w[..., 0], lambda w: 1 + w[..., 1], lambda w: 1 + w[..., 0] * w[..., 1]):
        off = from_hemicube(cube(function, 32), GRID)[0] - function(GRID.directions)
        assert np.abs(off).max() < 8e-3
    off = from_hemicube(cube(lambda w: w[..., 2], 32), GRID)[0] - GRID.directions[..., 2]
    assert np.abs(off[:-3]).max() < 8e-3
    assert np.abs(off).max() < 1 / 32 + 1e-3


def test_there_is_no_step_at_edges_and_corners(rng):
    # Chance values: a face that took no notice of its neighbour would jump by about 1.
    hemicube = Hemicube(rng.random((1, 8, 8)), rng.random((1, 4, 4, 8)))
    grid = PolarGrid(2000, 8, 1.0)  # columns through the corners and the middles of edges
    assert np.abs(np.diff(from_hemicube(hemicube, grid)[0], axis=0)).max() < 0.02
    grid = PolarGrid(9, 8000, 1.0)  # rings across the sides' edges
    ring = from_hemicube(hemicube, grid)[0]
    assert np.abs(ring - np.roll(ring, 1, axis=1)).max() < 0.02


def test_what_is_no_hemicube_is_refused(rng):
    top, sides = np.ones((2, 8, 8)), np.ones((2, 4, 4, 8))
    for change, message in (
        ({"top": np.ones((2, 7, 7))}, "top has shape"),
        ({"top": np.ones((2, 8, 6))}, "top has shape"),
        ({"sides": np.ones((2, 4, 8, 8))}, r"sides has shape .* \(2, 4, 4, 8\) is wanted"),
        ({"top": -top}, "top has values that are negative"),
        ({"sides": sides * np.nan}, "sides has values"),
    ):
        with pytest.raises(GonioError, match=message):
            Hemicube(**({"top": top, "sides": sides} | change))
    with pytest.raises(GonioError, match="side = 7"):
        to_hemicube(CLOTH, GRID, 7)
    with pytest.raises(GonioError, match=r"tables have shape \(32, 96\)"):
        to_hemicube(CLOTH[0], GRID)
