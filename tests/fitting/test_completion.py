"""Facts about distributions made whole from one another: what is found where nothing was seen is what is there."""

import numpy as np
import pytest

import gonio as gn
from gonio.brdf.ndf_table import TabulatedNDF
from gonio.brdf.polar_grid import PolarGrid
from gonio.fitting.completion import complete_ndfs
from gonio.fitting.facet_domain import Domain
from gonio.fitting.synthesis import grow_ndfs

GRID = PolarGrid(16, 48)
CONFIDENCE = Domain(GRID, gn.from_spherical(np.radians(60), 0.3)).confidence
OUTSIDE = CONFIDENCE == 0
SOLID = np.broadcast_to(GRID.solid_angles[:, None], GRID.shape)


@pytest.fixture(scope="module")
def cloths():
    """Tables of 96: two cloths of two lobes each, without symmetry, turned by chance."""
    rng = np.random.default_rng(1)
    turns = rng.integers(0, 48, 96)
    ndfs = []
    for along, across, turn in ((0.5, 0.2, 5), (0.3, 0.4, 9)):
        one, other = (TabulatedNDF.of(gn.Beckmann(a, b), GRID.shape).values for a, b in ((along, across), (0.25, 0.25)))
        theta, phi = GRID.theta[:, None], GRID.phi
        leaning = other * np.exp(2 * np.sin(theta) * np.cos(phi))  # brighter on one side
        ndfs.append(one + np.roll(leaning, turn, axis=1))
    tables = np.stack([np.roll(ndfs[k % 2], turn, axis=1) for k, turn in enumerate(turns)])
    return tables / np.sum(tables * GRID.projected[:, None], axis=(1, 2), keepdims=True)


def off(found, truth, where=OUTSIDE):
    return np.sqrt(np.sum((SOLID * (found - truth) ** 2)[:, where]) / np.sum((SOLID * truth**2)[:, where]))


@pytest.mark.parametrize("make", [complete_ndfs, grow_ndfs])
def test_what_was_not_seen_is_found_from_what_others_show(cloths, make):
    """To rounding: others are the very same, turned. Without them a fourth of all is missing."""
    seen = np.where(OUTSIDE, np.nan, cloths)
    found = make(seen, CONFIDENCE, GRID)
    assert off(found.tables, cloths) < 1e-5
    assert off(np.where(OUTSIDE, 0, cloths), cloths, np.ones(GRID.shape, bool)) > 0.2
    np.testing.assert_allclose(np.sum(found.tables * GRID.projected[:, None], axis=(1, 2)), 1, rtol=1e-5)
    assert found.told.min() > 0.97 and found.own.max() < found.told.min()


def test_the_mean_of_many_is_nearer_than_growing_by_one_where_data_are_noisy(cloths):
    noisy = cloths * (1 + 0.1 * np.random.default_rng(2).standard_normal(cloths.shape))
    seen = np.where(OUTSIDE, 0, np.maximum(noisy, 0))
    assert off(complete_ndfs(seen, CONFIDENCE, GRID).tables, cloths) < 0.8 * off(
        grow_ndfs(seen, CONFIDENCE, GRID).tables, cloths
    )


def test_own_data_stay_and_a_third_of_others_evens_them_out(cloths):
    noise = 1 + 0.1 * np.random.default_rng(3).standard_normal(cloths.shape)
    seen = np.where(OUTSIDE, 0, np.maximum(cloths * noise, 0))
    found = complete_ndfs(seen, CONFIDENCE, GRID)
    unit = found.tables[:, :1, :1] / seen[:, :1, :1]
    np.testing.assert_allclose(found.tables[:, ~OUTSIDE], (unit * seen)[:, ~OUTSIDE], rtol=1e-4)
    blended = found.blended(found.tables, np.broadcast_to(~OUTSIDE, found.tables.shape))
    assert off(blended, cloths, ~OUTSIDE) < 0.85 * off(found.tables, cloths, ~OUTSIDE)
    np.testing.assert_array_equal(blended[:, OUTSIDE], found.tables[:, OUTSIDE])


def test_units_do_not_matter_nor_does_the_order(cloths):
    seen = np.where(OUTSIDE, 0, cloths)
    found = complete_ndfs(seen, CONFIDENCE, GRID).tables
    order = np.random.default_rng(4).permutation(96)
    again = complete_ndfs(1e3 * seen[order], CONFIDENCE, GRID).tables
    np.testing.assert_allclose(again, found[order], rtol=2e-3, atol=1e-3)  # float32 correlations choose among equals


def test_one_alone_is_filled_by_its_turn_of_pi_and_its_rings():
    ndf = TabulatedNDF.of(gn.Beckmann(0.5, 0.2), GRID.shape).values[None]
    found = complete_ndfs(np.where(OUTSIDE, 0, ndf), CONFIDENCE, GRID)
    turned = np.roll(~OUTSIDE, 24, axis=1)
    # The same at other turns weighs up to a hundredth of that at the turn of pi: (.2/1.2)^3, some times.
    assert off(found.tables, ndf, turned & OUTSIDE) < 0.03
    assert np.isfinite(found.tables).all() and found.tables.min() >= 0
    # Itself, turned, tells what it can: all that rings within its domain hold.
    assert found.told[0] > found.own[0]


def test_what_does_not_shine_has_facets_that_are_all_alike():
    tables = np.zeros((3, *GRID.shape))
    tables[0] = TabulatedNDF.of(gn.Beckmann(0.4), GRID.shape).values
    for make in (complete_ndfs, grow_ndfs):
        found = make(tables, CONFIDENCE, GRID).tables
        np.testing.assert_allclose(found[1:], 1 / np.pi, rtol=1e-3)


def test_progress_ends_at_its_total(cloths):
    heard = []
    complete_ndfs(np.where(OUTSIDE, 0, cloths), CONFIDENCE, GRID, progress=lambda *x: heard.append(x))
    assert heard[-1] == (192, 192) and [done for done, _ in heard] == sorted(done for done, _ in heard)


def test_shapes_that_are_not_the_grids_are_refused():
    with pytest.raises(gn.GonioError, match=r"tables have shape \(2, 3\); \(n, 16, 48\) is wanted"):
        complete_ndfs(np.ones((2, 3)), CONFIDENCE, GRID)
    with pytest.raises(gn.GonioError, match=r"confidence has shape \(3,\)"):
        grow_ndfs(np.ones((2, *GRID.shape)), np.ones(3), GRID)
