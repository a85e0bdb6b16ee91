"""Facts about slices of reflectance: they go through what lights showed, and only where lights were."""

import numpy as np
import pytest

import gonio as gn
from gonio.brdf.polar_grid import PolarGrid
from gonio.fitting.facet_domain import Domain, lambert_map
from gonio.fitting.facet_slices import FacetSlices, blended_slices
from gonio.fitting.partial_ndf import fit_partial_ndfs
from gonio.frames import rotation_y

GRID = PolarGrid()
WO = gn.from_spherical(np.radians(40), 0.3)
CLOTH = gn.Beckmann(0.4, 0.2)
MODEL = gn.Microfacet(CLOTH, gn.Fresnel(1.5), gn.Ashikhmin())


def hemisphere(rows, columns, least=0.06):
    """Lights on rings of equal steps of z."""
    z = np.repeat(least + (np.arange(rows) + 0.5) * (1 - least) / rows, columns)
    turn = np.tile(np.arange(columns), rows) + 0.5 * np.repeat(np.arange(rows), columns)
    return gn.from_spherical(np.arccos(z), 2 * np.pi * turn / columns)


LIGHTS = hemisphere(20, 24)


def shown(model, lights):
    return model.f(lights, np.broadcast_to(WO, lights.shape))[:, 0]


@pytest.fixture(scope="module")
def domain():
    return Domain.under(GRID, WO, LIGHTS)


def test_lights_all_over_the_hemisphere_show_the_domain_and_a_few_a_part(domain):
    whole = Domain(GRID, WO).confidence > 0
    covered = domain.confidence > 0
    assert not covered[~whole].any()
    solid = GRID.solid_angles[:, None]
    assert (solid * covered).sum() > 0.97 * (solid * whole).sum()
    aside = Domain.under(GRID, WO, LIGHTS[LIGHTS[:, 0] > 0]).confidence > 0
    assert (solid * aside).sum() < 0.75 * (solid * whole).sum()
    # Half vectors of lights with x > 0 are those whose mirrored view has it too, a spacing more or less.
    far = domain.lights[..., 0] < -0.3
    assert not (aside & far).any()


def linear(h):
    """Its logarithm is linear on the map, but for a floor of a hundredth of the greatest, which is at a light."""
    values = np.exp(lambert_map(h) @ [0.5, -0.3])
    return values - np.exp(lambert_map(gn.half_vector(LIGHTS, WO)) @ [0.5, -0.3]).max() / 101


def test_what_is_linear_on_the_map_is_met_everywhere(domain):
    found = FacetSlices(domain, LIGHTS)(linear(gn.half_vector(LIGHTS, WO))[None])
    where = domain.confidence > 0
    np.testing.assert_allclose(found[0, where], linear(GRID.directions[where]), rtol=1e-4)
    assert np.isnan(found[0, ~where]).all()


def test_between_two_nodes_slices_are_those_of_lights_between(domain):
    """What turns by 2 degrees from node to node bends by some .4 % of itself halfway: .5 (.0175)^2 / (.2^2 / 2)."""
    tilted = [np.asarray(rotation_y(np.radians(a))) for a in (-1, 0, 1)]
    nodes = [FacetSlices(Domain.under(GRID, R @ WO, LIGHTS @ R.T), LIGHTS @ R.T) for R in tilted]
    rho = shown(MODEL, LIGHTS)[None]
    found = blended_slices((nodes[0], nodes[2]), [[0.5, 0.5]], rho)
    expected = nodes[1](rho)
    where = np.isfinite(found) & np.isfinite(expected)
    assert where.sum() > 0.9 * np.isfinite(expected).sum()
    assert np.sqrt(np.mean((found - expected)[where] ** 2) / np.mean(expected[where] ** 2)) < 0.02


def test_lights_that_tell_nothing_are_as_if_they_were_not_there(domain, rng):
    rho = rng.random((5, len(LIGHTS))).astype(np.float32)
    known = rng.random((5, len(LIGHTS))) > 0.1
    known[0] = True
    found = FacetSlices(domain, LIGHTS)(np.where(known, rho, np.nan), known)
    where = domain.confidence > 0
    for t in range(5):
        alone = FacetSlices(domain, LIGHTS[known[t]])(rho[t : t + 1, known[t]])
        np.testing.assert_allclose(found[t, where], alone[0, where], rtol=1e-2, atol=1e-3)


def test_facets_of_a_cloth_are_found_from_lights_that_are_photographed(domain):
    rho = shown(MODEL, LIGHTS)[None] / 0.04
    found = fit_partial_ndfs(FacetSlices(domain, LIGHTS)(rho), domain)
    where = domain.confidence > 0
    truth = gn.TabulatedNDF.of(CLOTH, GRID.shape).values[where]
    assert np.sqrt(np.mean((found.tables[0, where] - truth) ** 2) / np.mean(truth**2)) < 0.02
    assert found.k_s[0] == pytest.approx(1, rel=0.02)


@pytest.mark.parametrize(
    ("lights", "message"),
    [
        (LIGHTS[:3], "3 lights are above the surface"),
        (LIGHTS * 2, "lights"),
        (np.concatenate((LIGHTS[:3], [[0.6, 0, -0.8]])), "3 lights are above the surface"),
        (LIGHTS[[0, 1, 2, 3, 1]], "lights 1 and 4 are at one place"),
        (gn.from_spherical(np.radians([0, 10, 20, 30]), 0.3), "on a line"),
    ],
)
def test_lights_that_make_no_surface_are_refused(domain, lights, message):
    with pytest.raises(gn.GonioError, match=message):
        FacetSlices(domain, lights)


def test_what_is_no_reflectance_is_refused(domain):
    slices, rho = FacetSlices(domain, LIGHTS), np.ones((2, len(LIGHTS)))
    for values, known, message in (
        (rho[:, 1:], None, r"\(texels, 480\) is wanted"),
        (np.where(np.arange(480) == 7, -1, rho), None, r"rho\[0, 7\] is -1"),
        (rho * np.nan, None, "rho"),
        (rho, rho * 0 > 0, "four or more"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            slices(values, known)
    with pytest.raises(gn.GonioError, match="3 lights are above the surface"):
        Domain.under(GRID, WO, LIGHTS[:3])
    with pytest.raises(gn.GonioError, match=r"lit has shape \(2, 2\)"):
        Domain(GRID, WO, np.ones((2, 2)))
