import numpy as np
import pytest

import gonio as gn
from gonio.directions import spherical


def close(actual, expected, atol):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=atol)


@pytest.mark.parametrize("grid", [gn.LatLong(1, 1), gn.LatLong(6, 7), gn.LatLong(7, 12), gn.GaussLegendre(5)])
def test_weights_cover_the_sphere_and_are_positive(grid):
    assert np.sum(grid.weights) * grid.columns == pytest.approx(4 * np.pi, rel=1e-13)
    assert np.all(grid.weights > 0)


@pytest.mark.parametrize(("grid", "exact"), [(gn.LatLong(8, 16), 7), (gn.LatLong(9, 16), 9), (gn.GaussLegendre(7), 15)])
def test_weights_integrate_powers_of_cos_theta_up_to_their_degree(grid, exact):
    # Fejer's rule on n rows is exact for degree n - 1, Gauss's for 2 n - 1; odd powers are 0 by symmetry anyway.
    for power in range(exact + 2):
        quadrature = np.sum(grid.weights * np.cos(grid.theta) ** power) * grid.columns
        integral = 4 * np.pi / (power + 1) if power % 2 == 0 else 0
        if power <= exact:
            assert quadrature == pytest.approx(integral, abs=1e-13)
    even = exact + 1 if exact % 2 else exact + 2
    assert abs(np.sum(grid.weights * np.cos(grid.theta) ** even) * grid.columns - 4 * np.pi / (even + 1)) > 1e-6


@pytest.mark.parametrize("grid", [gn.LatLong(4, 8), gn.GaussLegendre(3)])
def test_row_0_is_nearest_plus_z_and_columns_turn_from_x_to_y(grid):
    theta, phi = spherical(grid.directions())
    close(theta, np.broadcast_to(grid.theta[:, None], grid.shape), atol=1e-14)
    close(phi, np.broadcast_to(grid.phi[None, :], grid.shape), atol=1e-14)
    assert np.all(np.diff(grid.theta) > 0)
    assert grid.phi[0] == pytest.approx(np.pi / grid.columns)


def test_lat_long_samples_are_pixel_centres():
    grid = gn.LatLong(2, 4)
    close(grid.theta, [np.pi / 4, 3 * np.pi / 4], atol=1e-15)
    close(grid.phi, np.array([1, 3, 5, 7]) * np.pi / 4, atol=1e-15)


def test_grids_are_values():
    assert gn.LatLong(4, 8) == gn.LatLong(4, 8) != gn.LatLong(4, 9)
    with pytest.raises(ValueError, match="read-only"):
        gn.LatLong(4, 8).weights[0] = 1


@pytest.mark.parametrize("rows", [0, -3, 2.0, True])
def test_a_count_that_is_none_is_refused_by_name(rows):
    with pytest.raises(gn.GonioError, match="rows"):
        gn.LatLong(rows, 4)


def test_a_degree_that_is_none_is_refused_by_name():
    with pytest.raises(gn.GonioError, match="degree = -1"):
        gn.GaussLegendre(-1)
