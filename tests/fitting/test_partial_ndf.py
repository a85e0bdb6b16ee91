"""Facts about distributions of facets from one view: what is known of them comes back."""

import numpy as np
import pytest

import gonio as gn
from gonio.brdf.ndf_table import TabulatedNDF
from gonio.brdf.polar_grid import PolarGrid
from gonio.fitting.facet_domain import Domain
from gonio.fitting.partial_ndf import Bare, Ringed, Symmetric, fit_partial_ndfs

GRID = PolarGrid(32, 96)
WO = gn.from_spherical(np.radians(50), 0.3)
CLOTH = gn.Beckmann(0.4, 0.2)  # GGX has a tenth of its facets where no view sees them


@pytest.fixture(scope="module")
def domain():
    return Domain(GRID, WO)


def turned(angle):
    return TabulatedNDF.of(CLOTH, GRID.shape).turned(angle)


def slices(domain, ndf, eta=1.5, k_s=0.7):
    """What facets reflect at the half vectors of the domain, by the BRDF itself; NaN outside."""
    rho = np.full(GRID.shape, np.nan)
    known = domain.confidence > 0
    model = gn.Microfacet(ndf, gn.Fresnel(eta), gn.Ashikhmin())
    wi = domain.lights[known]
    # k_s takes in F at normal incidence.
    rho[known] = k_s * model.f(wi, np.broadcast_to(WO, wi.shape))[:, 0] / ((eta - 1) / (eta + 1)) ** 2
    return rho


def off(found, truth, known, scaled=False):
    found, truth = found[known], truth[known]
    if scaled:
        found = found * (found @ truth) / (found @ found)
    return np.sqrt(np.mean((found - truth) ** 2) / np.mean(truth**2))


def test_the_domain_is_where_light_above_reflects_to_the_eye(domain):
    known = domain.confidence > 0
    h = gn.half_vector(domain.lights[known], WO)
    np.testing.assert_allclose(h, GRID.directions[known], atol=1e-12)
    assert (domain.lights[known][:, 2] > 0).all() and (domain.cosines[known] > 0).all()
    np.testing.assert_allclose(domain.confidence[known] ** 2, domain.lights[known][:, 2])
    # The mirror direction's half vector is the normal.
    np.testing.assert_allclose(domain.lights[0, 0], WO * (-1, -1, 1), atol=1e-12)


@pytest.mark.parametrize("eta", [1.5, 2.2])
def test_what_a_view_shows_of_symmetric_facets_comes_back(domain, eta):
    angles = np.linspace(0, np.pi, 6)
    truth = np.stack([turned(a).values for a in angles])
    found = fit_partial_ndfs(np.stack([slices(domain, turned(a), eta) for a in angles]), domain, eta)
    known = domain.confidence > 0
    # Harmonics of degree 8 leave a thousandth of g, and g enters twice.
    assert max(off(f, t, known) for f, t in zip(found.tables, truth, strict=True)) < 0.005
    np.testing.assert_allclose(found.k_s, 0.7, rtol=0.005)
    assert found.still.max() < 0.01
    assert not found.tables[:, ~known].any()


def test_what_ngan_takes_for_the_whole_biases_what_is_seen_and_the_paper_s_rings_less(domain):
    angles = np.linspace(0, np.pi, 6)
    truth = np.stack([turned(a).values for a in angles])
    rho = np.stack([slices(domain, turned(a)) for a in angles])
    known = domain.confidence > 0
    errors = []
    for completion in (Symmetric(), Ringed(), Bare()):
        found = fit_partial_ndfs(rho, domain, completion=completion)
        errors.append(np.mean([off(f, t, known, scaled=True) for f, t in zip(found.tables, truth, strict=True)]))
    assert errors[0] < errors[1] < errors[2]
    assert errors[2] > 10 * errors[0]


def test_a_larger_strength_is_k_s_and_not_more_facets(domain):
    rho = slices(domain, turned(0.4))
    found = fit_partial_ndfs(np.stack((rho, 5 * rho, -rho)), domain)
    np.testing.assert_allclose(found.tables[1], found.tables[0], rtol=1e-4, atol=1e-6)
    assert found.k_s[1] == pytest.approx(5 * found.k_s[0], rel=1e-4)
    assert found.k_s[2] == 0 and not found.tables[2].any()


def test_fresnel_left_out_is_taken_for_facets(domain):
    rho, known = slices(domain, turned(0.4))[None], domain.confidence > 0
    without, with_it = (fit_partial_ndfs(rho, domain, eta).tables[0] for eta in (30.0, 1.5))
    truth = turned(0.4).values
    # F of an index of 30 is all but flat: towards grazing light the dielectric's rise is left in D.
    assert off(without, truth, known) > 4 * off(with_it, truth, known)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"slices": np.ones((2, 8, 8))}, r"slices have shape \(2, 8, 8\)"),
        ({"slices": np.full((1, *GRID.shape), np.inf)}, "slices within the domain"),
        ({"eta": 0.9}, "numbers >= 1"),
        ({"turns": 0}, "turns = 0"),
    ],
)
def test_what_cannot_be_fitted_is_refused(domain, change, message):
    given = {"slices": np.ones((1, *GRID.shape)), "eta": 1.5, "turns": 2, **change}
    with pytest.raises(gn.GonioError, match=message):
        fit_partial_ndfs(given["slices"], domain, given["eta"], turns=given["turns"])


@pytest.mark.parametrize("wo", [(0.0, 0, -1), (0.0, 0, 2), (0.0, 1)])
def test_a_view_from_below_is_refused(wo):
    with pytest.raises(gn.GonioError, match="wo"):
        Domain(GRID, np.array(wo))
