"""Facts about the refractive index from partial distributions: turned ones agree for the true one alone."""

import numpy as np
import pytest

import gonio as gn
from gonio.brdf.ndf_table import TabulatedNDF
from gonio.brdf.polar_grid import PolarGrid
from gonio.fitting.facet_domain import Domain
from gonio.fitting.facet_index import estimate_index, facing

GRID = PolarGrid(24, 48)


def seen(theta, eta, start=1.5):
    """Of 48 turns of a cloth of index `eta`, D as it is fitted with `start`; confidence and h.o."""
    domain = Domain(GRID, gn.from_spherical(np.radians(theta), 0.3))
    cloth = TabulatedNDF.of(gn.Beckmann(0.45, 0.25), GRID.shape).values
    c = np.clip(domain.cosines, 0, 1)
    tables = np.stack([np.roll(cloth, k, axis=1) for k in range(48)]) * facing(eta, c) / facing(start, c)
    return tables, np.broadcast_to(domain.confidence, tables.shape), np.broadcast_to(c, tables.shape)


@pytest.mark.parametrize("eta", [1.3, 1.5, 1.8])
def test_the_index_is_that_at_which_turned_facets_agree(eta):
    """A parabola through distances .09 apart in index; without noise partners are the very same."""
    np.testing.assert_allclose(estimate_index(*seen(60, eta), GRID), eta, atol=0.02)


def test_where_nothing_tells_it_is_the_one_that_was_taken():
    tables, W, c = seen(0, 1.5)
    # From above every facet has one cosine at all turns: no index is better than another.
    found = estimate_index(tables, W, c, GRID, 1.6)
    assert np.isfinite(found).all() and found.min() >= 1.15
    flat = np.ones_like(tables)
    np.testing.assert_allclose(estimate_index(flat * facing(9.0, c), W, 0 * c + 0.7, GRID), 1.5)


def test_fresnel_rises_from_one():
    np.testing.assert_allclose(facing(np.array([1.2, 1.5, 2.0]), np.ones(3)), 1, rtol=1e-12)
    expected = np.asarray(gn.Fresnel(1.5)(np.array([0.3])))[0, 0] / 0.04
    assert facing(1.5, np.array([0.3]))[0] == pytest.approx(expected, rel=1e-12)
