"""Facts about distances of turned distributions: those of MS 15, and who is the nearest."""

import tracemalloc

import numpy as np
import pytest
from reference import turned as twin

import gonio as gn
from gonio.brdf.ndf_table import TabulatedNDF
from gonio.brdf.polar_grid import PolarGrid
from gonio.errors import ArrayError, MemoryLimitError, ParameterError
from gonio.fitting.facet_domain import Domain
from gonio.fitting.turnable import Turnable
from gonio.fitting.turned import best_turns, nearest_turns, turned_distances

SMALL = PolarGrid(5, 8)
GRID = PolarGrid(16, 48)


def view(grid, azimuth=0.3):
    return Domain(grid, gn.from_spherical(np.radians(60), azimuth)).confidence


def confidences(rng, grid, n):
    """Of each its own, two fifths of the knots outside."""
    W = rng.random((n, *grid.shape))
    return np.where(W > 0.4, W, 0)


@pytest.fixture(scope="module")
def brushed():
    """48 anisotropic distributions, three widths turned at random, as one view shows them, and their turns."""
    rng = np.random.default_rng(5)
    turns = rng.integers(0, 48, 48)
    tables = []
    for k, turn in enumerate(turns):
        ndf = TabulatedNDF.of(gn.Beckmann(0.5, (0.15, 0.25, 0.35)[k % 3]), GRID.shape)
        tables.append(np.roll(ndf.values, turn, axis=1))
    return Turnable.of(np.stack(tables), view(GRID), GRID), np.stack(tables), turns


@pytest.mark.parametrize("grid", [SMALL, PolarGrid(4, 9)])  # an even and an odd number of columns
@pytest.mark.parametrize("kinds", ["one", "second has one", "first has one", "two of each", "all differ"])
def test_distances_are_those_of_the_paper(rng, grid, kinds):
    D1, D2 = rng.random((3, *grid.shape)), rng.random((4, *grid.shape))
    W1, W2 = confidences(rng, grid, 3), confidences(rng, grid, 4)
    if kinds == "one":
        W1[:] = W2[:] = W1[0]
    elif kinds == "second has one":
        W2[:] = W2[0]
    elif kinds == "first has one":
        W1[:] = W1[0]
    elif kinds == "two of each":
        W1[2], W2[1], W2[3] = W1[0], W2[0], W2[2]
    expected, parts = twin.distances(D1, W1, D2, W2, grid.solid_angles)
    found, overlaps = turned_distances(Turnable.of(D1, W1, grid), Turnable.of(D2, W2, grid))
    np.testing.assert_allclose(found, expected, rtol=1e-11)
    np.testing.assert_allclose(overlaps, parts, atol=1e-11)
    single, _ = turned_distances(Turnable.of(D1, W1, grid, np.float32), Turnable.of(D2, W2, grid, np.float32))
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, expected, rtol=1e-4)


def test_many_that_share_one_domain_are_as_the_paper_has_them(rng):
    """What W alone tells is made once for all pairs then."""
    D, W = rng.random((20, *SMALL.shape)), np.repeat(confidences(rng, SMALL, 1), 20, axis=0)
    expected, parts = twin.distances(D[:3], W[:3], D, W, SMALL.solid_angles)
    found, overlaps = turned_distances(*(Turnable.of(D, W[0], SMALL),) * 2)
    np.testing.assert_allclose(found[:3], expected, rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(overlaps[:3], parts, atol=1e-11)


def test_nothing_is_told_where_nothing_overlaps(rng):
    """The first sees half a turn, the second an eighth; the third has facets only where they do not look."""
    W, D = np.zeros((3, *SMALL.shape)), rng.random((3, *SMALL.shape))
    W[0, 1:, :4], W[1, 1:, :1], W[2] = 1, 1, 1
    D[2, 1:] = 0
    expected, parts = twin.distances(D, W, D, W, SMALL.solid_angles)
    found, overlaps = turned_distances(*(Turnable.of(D, W, SMALL),) * 2)
    assert np.isinf(expected[0, 2]).all() and np.isinf(expected[0, 1]).sum() == 4
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(overlaps, parts, atol=1e-11)


def test_empty_tables_and_domains_are_infinitely_far(rng):
    D, W = rng.random((3, *SMALL.shape)), np.ones((3, *SMALL.shape))
    D[0], W[1] = 0, 0
    some = Turnable.of(D, W, SMALL)
    found, overlaps = turned_distances(some, some)
    assert np.isinf(found[:2]).all() and np.isinf(found[:, :2]).all()
    assert not overlaps[1].any()
    best = best_turns(some, some, (0, 1), allowed=~np.eye(3, dtype=bool))
    assert best.second.tolist() == [-1] * 3 and np.isinf(best.distance).all()


def test_none_are_no_pairs(rng):
    some = Turnable.of(rng.random((3, *SMALL.shape)), np.ones(SMALL.shape), SMALL)
    none = Turnable.of(np.ones((0, *SMALL.shape)), np.ones(SMALL.shape), SMALL)
    assert turned_distances(none, some)[0].shape == (0, 3, 8)
    assert turned_distances(some, none)[1].shape == (3, 0, 8)
    assert best_turns(none, some).second.shape == (0,)
    assert best_turns(some, none).second.tolist() == [-1] * 3


def test_a_turned_copy_is_found_at_its_turn(rng):
    D = rng.random((5, *GRID.shape))
    turns = rng.integers(1, 48, 5)
    copies = np.stack([np.roll(d, -k, axis=1) for d, k in zip(D, turns, strict=True)])[::-1]
    best = best_turns(
        Turnable.of(D, np.ones(GRID.shape), GRID), Turnable.of(3 * copies, np.ones(GRID.shape), GRID), (0, 1)
    )
    assert best.second.tolist() == [4, 3, 2, 1, 0]
    np.testing.assert_array_equal(best.turn, turns)
    np.testing.assert_allclose(best.distance, 0, atol=1e-14)
    np.testing.assert_allclose(best.overlap, 1)


def test_exchanged_they_are_as_far_at_the_opposite_turn(rng):
    a = Turnable.of(rng.random((3, *GRID.shape)), confidences(rng, GRID, 3), GRID)
    b = Turnable.of(rng.random((2, *GRID.shape)), confidences(rng, GRID, 2), GRID)
    there, back = turned_distances(a, b)[0], turned_distances(b, a)[0]
    np.testing.assert_allclose(back.swapaxes(0, 1), there[..., -np.arange(48) % 48], rtol=1e-11)


def test_units_of_facets_and_of_confidence_do_not_matter(rng):
    D, W = rng.random((3, *GRID.shape)), confidences(rng, GRID, 3)
    a = Turnable.of(D, W, GRID)
    b = Turnable.of(D * np.array([1e-9, 1, 1e9])[:, None, None], 1e6 * W, GRID)
    np.testing.assert_allclose(turned_distances(a, b)[0], turned_distances(a, a)[0], rtol=1e-11, atol=1e-13)


def test_facets_outside_the_domain_are_not_looked_at(rng):
    D, W = rng.random((3, *GRID.shape)), confidences(rng, GRID, 3)
    hidden = np.where(W > 0, D, np.nan)
    np.testing.assert_array_equal(Turnable.of(hidden, W, GRID).D, Turnable.of(D, W, GRID).D)


@pytest.mark.parametrize("bounds", [(0.5, 0.85), (0.6, 0.7), (1, 1)])
def test_the_best_is_the_least_within_the_bounds(brushed, bounds):
    some, _, _ = brushed
    allowed = ~np.eye(48, dtype=bool)
    allowed[3, 20:] = False
    allowed[7] = False
    distances, overlaps = turned_distances(some, some)
    within = (overlaps > bounds[0] - 1e-9) & (overlaps < bounds[1] + 1e-9) & allowed[..., None]
    least = np.where(within, distances, np.inf)
    best = best_turns(some, some, bounds, allowed)
    rows = np.delete(np.arange(48), 7)
    np.testing.assert_allclose(best.distance[rows], least.min(axis=(1, 2))[rows], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(
        least[rows, best.second[rows], best.turn[rows]], best.distance[rows], rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(overlaps[rows, best.second[rows], best.turn[rows]], best.overlap[rows], atol=1e-12)
    assert best.second[3] < 20 and best.second[7] == -1


@pytest.mark.parametrize("own", [False, True])
@pytest.mark.parametrize("coarse", [1, 4])
def test_blocks_of_any_size_find_the_same(rng, own, coarse):
    D = rng.random((30, *GRID.shape))
    first = Turnable.of(D, view(GRID), GRID)
    if own:
        turned = np.stack([np.roll(view(GRID), k // 3, axis=1) for k in range(30)])
        first = Turnable.of(D, turned, GRID)
    second = Turnable.of(rng.random((50, *GRID.shape)), view(GRID), GRID)
    whole = best_turns(first, second, coarse=coarse, keep=50)
    parts = best_turns(first, second, coarse=coarse, keep=50, memory=6_000_000)
    np.testing.assert_array_equal(parts.second, whole.second)
    np.testing.assert_array_equal(parts.turn, whole.turn)
    np.testing.assert_allclose(parts.distance, whole.distance, rtol=1e-10)
    exact = best_turns(first, second)
    np.testing.assert_array_equal(whole.second, exact.second)  # keep = 50 is all


@pytest.mark.parametrize("coarse", [1, 4])
def test_memory_stays_below_what_is_given(rng, coarse):
    D = rng.random((150, *GRID.shape))
    some = Turnable.of(D, np.stack([np.roll(view(GRID), k // 2, axis=1) for k in range(150)]), GRID)
    memory = 5_000_000  # given 100 MB they take 9 and 52
    some.spectra  # noqa: B018  (made when first asked for)
    tracemalloc.start()
    try:
        best_turns(some, some, coarse=coarse, memory=memory)
        assert tracemalloc.get_traced_memory()[1] < memory
    finally:
        tracemalloc.stop()


def test_a_coarse_look_finds_nearly_the_same(brushed):
    some, _, _ = brushed
    allowed = ~np.eye(48, dtype=bool)
    exact, coarse = (best_turns(some, some, allowed=allowed, coarse=k, keep=12) for k in (1, 4))
    same = coarse.distance <= exact.distance * (1 + 1e-6) + 1e-12
    assert same.mean() > 0.9


def test_means_keep_what_they_are_means_of(brushed):
    some, _, _ = brushed
    coarse = some.coarser(4)
    assert coarse.D.shape == (48, 4, 12)
    assert coarse.weights.sum() * 12 == pytest.approx(2 * np.pi)
    np.testing.assert_allclose(np.sum(coarse.M * coarse.D * coarse.weights[:, None], axis=(1, 2)), 1)


def test_what_cannot_be_compared_is_refused(rng):
    D, W = rng.random((2, *SMALL.shape)), np.ones(SMALL.shape)
    some = Turnable.of(D, W, SMALL)
    with pytest.raises(ArrayError, match=r"tables have shape .* \(n, 5, 8\) is wanted"):
        Turnable.of(D[0], W, SMALL)
    with pytest.raises(ArrayError, match=r"confidence has shape \(5,\)"):
        Turnable.of(D, W[:, 0], SMALL)
    with pytest.raises(ArrayError, match="confidence has -1"):
        Turnable.of(D, -W, SMALL)
    with pytest.raises(ArrayError, match="clip what noise left"):
        Turnable.of(D - 1, W, SMALL)
    with pytest.raises(ArrayError, match="tables within the domain"):
        Turnable.of(np.full_like(D, np.nan), W, SMALL)
    with pytest.raises(ArrayError, match="dtype is float16"):
        Turnable.of(D, W, SMALL, np.float16)
    for other in (Turnable.of(D, W, SMALL, np.float32), Turnable.of(D, W, PolarGrid(5, 8, 2.0))):
        with pytest.raises(ArrayError, match="one grid and precision"):
            turned_distances(some, other)
    with pytest.raises(ParameterError, match="overlap"):
        best_turns(some, some, (0.9, 0.5))
    with pytest.raises(ParameterError, match="keep = 0"):
        best_turns(some, some, keep=0)
    with pytest.raises(ParameterError, match="coarse = 3"):
        best_turns(some, some, coarse=3)
    with pytest.raises(ArrayError, match=r"bool \(2, 2\) is wanted"):
        best_turns(some, some, allowed=np.ones((2, 3), bool))
    with pytest.raises(MemoryLimitError, match="at least are needed"):
        best_turns(some, some, memory=1000)


def test_too_many_turns_are_refused_before_any_memory_is_taken():
    thin = PolarGrid(2, 3)
    many = Turnable.of(np.ones((10_000, 2, 3)), np.ones(thin.shape), thin)
    with pytest.raises(MemoryLimitError, match="ask for `best_turns`"):
        turned_distances(many, many)


def test_the_nearest_of_each_range_of_turns_are_the_least(brushed):
    some, _, _ = brushed
    distances, overlaps = turned_distances(some, some)
    ranges = ((0, 10), (10, 30), (30, 48))
    found = nearest_turns(some, some, 5, ranges, (0.3, 0.9))
    for (first, last), near in zip(ranges, found, strict=True):
        within = np.where((overlaps > 0.3 - 1e-9) & (overlaps < 0.9 + 1e-9), distances, np.inf)[..., first:last]
        least = np.sort(within.min(axis=2), axis=1)[:, :5]
        np.testing.assert_allclose(near.distance, least, rtol=1e-9, atol=1e-12)
        rows, known = np.arange(48)[:, None], near.second >= 0
        at = within[rows, np.maximum(near.second, 0), np.clip(near.turn - first, 0, last - first - 1)]
        np.testing.assert_allclose(at[known], near.distance[known], rtol=1e-9, atol=1e-12)
        assert np.isinf(near.distance[~known]).all()
    with pytest.raises(ParameterError, match="count = 0"):
        nearest_turns(some, some, 0, ranges)
    with pytest.raises(ParameterError, match="overlap"):
        nearest_turns(some, some, 1, ranges, (0.9, 0.3))


def test_relative_distances_are_over_the_squares_of_both(rng):
    D, W = rng.random((4, *SMALL.shape)), confidences(rng, SMALL, 1)[0]
    some, allowed = Turnable.of(D, W, SMALL), ~np.eye(4, dtype=bool)
    best = best_turns(some, some, (0, 1), allowed, relative=True)
    for a in range(4):
        b, k = best.second[a], best.turn[a]
        W2, D2 = np.roll(W, k, axis=1), np.roll(D[b], k, axis=1)
        inside, weight = SMALL.solid_angles[:, None] * (W * W2 > 0), SMALL.solid_angles[:, None] * np.sqrt(W * W2)
        x, y = D[a] / np.sum(D[a] * inside), D2 / np.sum(D2 * inside)
        expected = np.sum(weight * (x - y) ** 2) / np.sum(weight * (x**2 + y**2))
        assert best.distance[a] == pytest.approx(expected, rel=1e-9)
