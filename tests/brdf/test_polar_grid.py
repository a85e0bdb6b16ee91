"""Facts about the grid of facets: its weights are integrals over the hemisphere."""

import numpy as np
import pytest

import gonio as gn
from gonio.brdf.polar_grid import PolarGrid


@pytest.mark.parametrize("grid", [PolarGrid(), PolarGrid(96, 256, 2.0), PolarGrid(2, 3, 1.0)])
def test_weights_sum_to_the_hemisphere_and_its_projection(grid):
    assert grid.columns * grid.solid_angles.sum() == pytest.approx(2 * np.pi, rel=1e-12)
    assert grid.columns * grid.projected.sum() == pytest.approx(np.pi, rel=1e-12)


def test_smooth_functions_are_integrated_as_bilinear_ones():
    grid = PolarGrid()
    f = gn.GGX(0.5, 0.3).D(grid.directions * (1, 1, 1 - 1e-9) + (0, 0, 1e-12))
    # What a table of 32 rows leaves of a lobe .3 wide.
    assert (grid.projected[:, None] * f).sum() == pytest.approx(1, abs=5e-3)
    z = grid.directions[..., 2]
    assert (grid.solid_angles[:, None] * z**2).sum() == pytest.approx(2 * np.pi / 3, rel=2e-3)


def test_knots_run_from_the_pole_to_the_horizon():
    grid = PolarGrid(5, 8, 2.0)
    np.testing.assert_allclose(grid.theta, np.pi / 2 * np.array([0, 1, 4, 9, 16]) / 16)
    np.testing.assert_allclose(grid.directions[0], np.tile([0, 0, 1.0], (8, 1)))
    np.testing.assert_allclose(grid.directions[4, 2], [0, 1, 0], atol=1e-15)
    assert grid.shape == (5, 8)


@pytest.mark.parametrize("arguments", [(1, 8, 1.5), (8, 2, 1.5), (8, 8, 0.9), (8, 8, np.nan)])
def test_what_is_no_grid_is_refused(arguments):
    with pytest.raises(gn.errors.ParameterError, match="PolarGrid"):
        PolarGrid(*arguments)
