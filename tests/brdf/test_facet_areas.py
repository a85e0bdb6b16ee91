"""Areas of many tabulated distributions at once: against direct quadrature, closed forms, identities, refusals."""

import functools

import numpy as np
import pytest

import gonio as gn
from gonio.brdf.facet_areas import FacetAreas
from gonio.brdf.ndf_table import TabulatedNDF
from gonio.brdf.polar_grid import PolarGrid
from gonio.brdf.projected_area import AreaTable
from gonio.directions import from_spherical
from gonio.errors import ArrayError, DirectionError, ParameterError

GRID = PolarGrid()
NDFS = {
    "cloth": gn.GGX(0.3),
    "anisotropic cloth": gn.Beckmann(0.4, 0.6),
    "wood": gn.Beckmann(0.15),
    "metal": gn.GGX(0.05, 0.2),
}


@functools.cache
def table(name):
    return TabulatedNDF.of(NDFS[name], GRID.shape).values


@functools.cache
def direct(name):
    return AreaTable.of(NDFS[name].D)


def error(name, areas):
    """Relative rms error of g below 80 degrees."""
    theta, phi = np.radians(np.linspace(0, 80, 41)), 2 * np.pi * np.arange(24) / 24
    k, weight = from_spherical(theta[:, None], phi), np.sin(theta)[:, None]
    g = areas.areas(areas.coefficients(table(name)), k.reshape(-1, 3)).reshape(41, 24)
    expected = direct(name)(k)
    return np.sqrt((weight * (g - expected) ** 2).sum() / (weight * expected**2).sum())


@pytest.mark.parametrize(
    ("name", "at_8", "at_12"),
    [
        # What the series leaves out decides for narrow slopes (measured figures, a tenth to spare); for cloth at 12 the
        # table's rows do. Direct quadrature is good to 6e-5 here.
        ("cloth", 1e-3, 2e-4),
        ("anisotropic cloth", 5e-4, 4e-4),
        ("wood", 5.5e-3, 1.6e-3),
        ("metal", 5.3e-3, 2.1e-3),
    ],
)
def test_direct_quadrature_is_met(name, at_8, at_12):
    assert error(name, FacetAreas(GRID, 8)) < at_8
    assert error(name, FacetAreas(GRID, 12)) < at_12


@pytest.mark.parametrize("grid", [GRID, PolarGrid(5, 17, 3.0)])
def test_facets_turned_every_way_show_the_sky_of_a_slope(grid, rng):
    # D = 1: the even part of the cosine sees half a sphere alike all around, the odd one is linear.
    areas = FacetAreas(grid, 8)
    k = gn.normalise(rng.normal(size=(50, 3)))
    g = areas.areas(areas.coefficients(np.ones((1, *grid.shape))), k)
    np.testing.assert_allclose(g[0], np.pi / 2 * (1 + k[:, 2]), atol=1e-13)


def test_what_faces_up_less_what_faces_down_is_the_ground_covered(rng):
    # (h.n)_+ - (-h.n)_+ = h.n: its integral is the table's mass, whatever the degree.
    tables = rng.uniform(size=(3, *GRID.shape))
    areas = FacetAreas(GRID)
    up, down = areas.areas(areas.coefficients(tables), np.array([[0, 0, 1.0], [0, 0, -1.0]])).T
    np.testing.assert_allclose(up - down, [float(TabulatedNDF(values).mass) for values in tables], rtol=1e-13)


def test_coefficients_are_the_sum_of_what_knots_have(rng):
    tables, areas = rng.uniform(size=(2, *GRID.shape)), FacetAreas(GRID)
    summed = np.tensordot(tables, areas.of_knots, 2)
    # Those of knots are in single precision.
    np.testing.assert_allclose(areas.coefficients(tables), summed, rtol=1e-6, atol=1e-6)


def test_coefficients_are_those_of_a_convolution(rng):
    # The same from all harmonics at once, by gonio's own convolution.
    grid = PolarGrid(24, 40)
    areas, D = FacetAreas(grid, 8), TabulatedNDF.of(NDFS["metal"], grid.shape).values
    l, m = gn.sphere.harmonics.degrees_and_orders(8)
    assert [*zip(l[areas.kept], m[areas.kept], strict=True)][:5] == [(0, 0), (1, -1), (1, 0), (1, 1), (2, -2)]
    assert set(l[areas.kept]) == {0, 1, 2, 4, 6, 8}
    assert areas.kept.size == 48
    assert FacetAreas(GRID, 12).kept.size == 94
    Y = gn.harmonics(8, grid.directions)
    plain = gn.sphere.zonal.convolve(
        np.einsum("rc,rcn->n", D * grid.solid_angles[:, None], Y), gn.sphere.zonal.clamped_cosine(8)
    )
    # The quadrature here takes Y at the knots, so that rows of 24 differ by the square of their spacing.
    np.testing.assert_allclose(areas.coefficients(D), plain[areas.kept], atol=2e-3)
    np.testing.assert_allclose(np.delete(plain, areas.kept), 0, atol=1e-15)


def test_a_turn_about_the_normal_turns_g(rng):
    tables, areas = rng.uniform(size=(2, *GRID.shape)), FacetAreas(GRID, 12)
    theta, phi, angle = rng.uniform(0, 1.5, 40), rng.uniform(0, 2 * np.pi, 40), 7 * 2 * np.pi / GRID.columns
    turned = areas.coefficients(np.roll(tables, 7, axis=2))
    g = areas.areas(areas.coefficients(tables), from_spherical(theta, phi))
    np.testing.assert_allclose(areas.areas(turned, from_spherical(theta, phi + angle)), g, rtol=1e-12)
    # Four columns are the step from azimuth to azimuth of a ring.
    c, turned = (areas.coefficients(np.roll(tables, shift, axis=2)) for shift in (0, 4))
    rings = np.linspace(0, 1, 5)
    np.testing.assert_allclose(areas.turned_least(turned, rings), areas.turned_least(c, rings), rtol=1e-12)


def test_tables_add_up(rng):
    a, b = rng.uniform(size=(2, *GRID.shape))
    areas, k = FacetAreas(GRID), from_spherical(rng.uniform(0, 1.5, 9), 1.0)
    one = areas.areas(areas.coefficients(np.stack((a, b, 2 * a - 3 * b))), k)
    np.testing.assert_allclose(one[2], 2 * one[0] - 3 * one[1], atol=1e-12)


@pytest.mark.parametrize("name", ["cloth", "anisotropic cloth", "metal"])
@pytest.mark.parametrize("degree", [8, 12])
def test_the_greatest_of_a_ring_is_what_a_close_search_finds(name, degree):
    areas, rings = FacetAreas(GRID, degree), np.cos(np.radians([0, 20, 40, 60, 75, 85, 90]))
    # Turned by half a step, so that the greatest lies between two of the 24 azimuths.
    coefficients = areas.coefficients(TabulatedNDF(table(name)).turned(np.pi / 24).values[None])
    phi = np.linspace(0, 2 * np.pi, 720)
    closely = [areas.areas(coefficients, from_spherical(np.arccos(z), phi)).max() for z in rings]
    np.testing.assert_allclose(areas.turned_least(coefficients, rings)[0], closely, rtol=2e-4)


def test_shadowing_is_least_where_facets_are_known():
    # MS 5.1: an isotropic distribution known for h_x > 0 alone. Seen from there, half the facets count at grazing
    # angles: half of what is not known would have counted less.
    D = table("cloth")
    known = np.where(GRID.directions[..., 0] > 0, D, 0)
    areas, ring = FacetAreas(GRID), np.array([0.1])
    whole, part = areas.turned_least(areas.coefficients(np.stack((D, known))), ring)[:, 0]
    opposite = areas.areas(areas.coefficients(known), from_spherical(np.arccos(ring), np.pi))[0]
    assert opposite < 0.3 * whole < 0.6 * whole < part <= whole


def test_the_dtype_is_kept_and_float32_suffices():
    areas, D = FacetAreas(GRID, 12), table("metal")
    k, rings = from_spherical(np.linspace(0, 1.5, 20), 0.3), np.linspace(0.05, 1, 6)
    half = areas.coefficients(D.astype(np.float32))
    assert half.dtype == np.float32
    assert areas.areas(half, k).dtype == areas.turned_least(half, rings).dtype == np.float32
    whole = areas.coefficients(D)
    # 3,072 products of up to some hundred, rounded at 6e-8 each.
    np.testing.assert_allclose(areas.areas(half, k), areas.areas(whole, k), atol=1e-5)
    np.testing.assert_allclose(areas.turned_least(half, rings), areas.turned_least(whole, rings), atol=1e-5)


def test_shapes_lead_as_they_came(rng):
    areas = FacetAreas(PolarGrid(6, 24), 8)
    assert areas.coefficients(rng.uniform(size=(2, 3, 6, 24))).shape == (2, 3, 48)
    assert areas.coefficients(np.ones((0, 6, 24))).shape == (0, 48)
    one = areas.coefficients(np.ones((6, 24)))
    assert one.shape == (48,)
    assert areas.areas(one, np.array([[0, 0, 1.0]])).shape == areas.turned_least(one, [1.0]).shape == (1,)


def test_tensors_are_answered_in_kind(rng):
    torch = pytest.importorskip("torch")
    areas, tables = FacetAreas(GRID), rng.uniform(size=(3, *GRID.shape))
    k, rings = from_spherical(np.linspace(0, 1.5, 7), 0.3), np.linspace(0.05, 1, 6)
    given = torch.tensor(tables, requires_grad=True)
    c = areas.coefficients(given)
    np.testing.assert_allclose(c.detach().numpy(), areas.coefficients(tables), atol=1e-13)
    g, most = areas.areas(c, torch.tensor(k)), areas.turned_least(c, torch.tensor(rings))
    np.testing.assert_allclose(g.detach().numpy(), areas.areas(areas.coefficients(tables), k), atol=1e-13)
    np.testing.assert_allclose(most.detach().numpy(), areas.turned_least(areas.coefficients(tables), rings), atol=1e-13)
    (g.sum() + most.sum()).backward()
    assert torch.isfinite(given.grad).all()
    assert areas.coefficients(given.detach().to(torch.float32)).dtype == torch.float32


@pytest.mark.parametrize(
    ("grid", "degree", "said"),
    [(GRID, 7, "even"), (GRID, 0, "2 or more"), (GRID, 8.0, "integer"), (PolarGrid(8, 24), 12, "25 columns or more")],
)
def test_what_is_no_degree_is_refused(grid, degree, said):
    with pytest.raises(ParameterError, match=said):
        FacetAreas(grid, degree)


def test_the_degree_that_is_offered_is_taken():
    with pytest.raises(ParameterError, match="degree 10 at most"):
        FacetAreas(PolarGrid(8, 23), 12)
    FacetAreas(PolarGrid(8, 23), 10)


def test_other_shapes_are_refused():
    areas = FacetAreas(GRID)
    c = np.zeros((2, 48))
    with pytest.raises(ArrayError, match=r"tables have shape \(4, 96, 32\)"):
        areas.coefficients(np.zeros((4, 96, 32)))
    with pytest.raises(ArrayError, match="degree 8 has"):
        areas.areas(np.zeros((2, 94)), [[0, 0, 1.0]])
    with pytest.raises(ArrayError, match="directions have shape"):
        areas.areas(c, [0, 0, 1.0])
    with pytest.raises(DirectionError, match="length 2"):
        areas.areas(c, [[0, 0, 2.0]])
    with pytest.raises(ArrayError, match="cos_theta has shape"):
        areas.turned_least(c, 0.5)
    with pytest.raises(ParameterError, match=r"outside \[-1, 1\]"):
        areas.turned_least(c, [0.5, np.nan])
