import numpy as np
import pytest

import gonio as gn
from gonio.fitting import centres
from gonio.fitting.centres import choose_centres
from gonio.fitting.rules import Greedy, Lookahead, Spread

SCALES = np.array([1, 1, 0.5])
RULES = [Greedy(5), Lookahead(0.2), Spread(0.2)]


ASIDE = np.array([0, 30, 0])


def highlights(rng, count):
    """A sharp peak over a smooth ground, in images of constant w; weights as of a cosine."""
    q = np.stack((*rng.uniform(-1, 1, (2, count)), rng.integers(0, 8, count) / 8), axis=-1)
    r2 = q[:, :1] ** 2 + q[:, 1:2] ** 2
    g = np.log(0.1 + (1 + q[:, 2:]) * np.array([1.0, 2.0, 3.0]) * 0.01 / (0.02 + r2) ** 2)
    return q, g, rng.uniform(0.2, 1, count)


def rms(interpolant, q, g, w):
    left = (g - interpolant(q)) * w[:, None]
    return np.sqrt(np.sum(left**2) / (g.shape[1] * np.sum(w**2)))


@pytest.fixture
def watched(monkeypatch):
    """Small samples are watched in part, as large ones are."""
    monkeypatch.setattr(centres, "_FEW", 400)


def test_rules_err_as_one_at_a_time_does_and_batches_far_more(rng):
    q, g, w = highlights(rng, 4000)
    there = highlights(rng, 3000)
    found = {
        rule: choose_centres(q, g, w, SCALES, 0, rule, 150).interpolant
        for rule in (Greedy(1, start=0), Lookahead(), Spread(), Greedy(40))
    }
    one, ahead, spread, batches = (rms(s, *there) for s in found.values())
    assert one < 0.1
    assert ahead < 1.15 * one and spread < 1.2 * one
    assert batches > 1.4 * one


def test_looking_ahead_among_all_samples_is_one_at_a_time(rng):
    q, g, w = highlights(rng, 500)
    one = choose_centres(q, g, w, SCALES, 0, Greedy(1, start=0), 60)
    ahead = choose_centres(q, g, w, SCALES, 0, Lookahead(0.5, reach=500, tried=500), 60)
    np.testing.assert_array_equal(ahead.indices, one.indices)


def test_watching_the_worst_loses_nothing(rng, monkeypatch):
    q, g, w = highlights(rng, 10_000)
    errors = []
    for few in (10_000, 400):
        monkeypatch.setattr(centres, "_FEW", few)
        choice = choose_centres(q, g, w, SCALES, 0, Lookahead(), 300)
        errors.append(choice.history[-1][1])
    assert len(choice.history) < 30
    # Choices that differ early differ by some percent to either side.
    assert errors[1] < 1.1 * errors[0]


@pytest.mark.parametrize("rule", RULES)
def test_the_history_tells_the_error_of_the_interpolant(rng, rule, watched):
    q, g, w = highlights(rng, 2000)
    choice = choose_centres(q + ASIDE, g, 7 * w, SCALES, 0.01, rule, 80)
    count, error = choice.history[-1]
    assert count == choice.indices.size == 80 and np.unique(choice.indices).size == 80
    np.testing.assert_array_equal(choice.interpolant.centres, (q + ASIDE)[choice.indices])
    # The interpolant is held within the range of the values, which can but lower the error.
    assert 0.9 * error < rms(choice.interpolant, q + ASIDE, g, w) <= error * (1 + 1e-4)
    counts = [n for n, _ in choice.history]
    assert counts == sorted(counts) and choice.history[0][1] > 3 * error


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("few", [400, 20_000])
def test_a_choice_goes_on_as_if_it_had_not_stopped(rng, rule, few, monkeypatch):
    monkeypatch.setattr(centres, "_FEW", few)
    q, g, w = highlights(rng, 2000)
    whole = choose_centres(q, g, w, SCALES, 0, rule, 120)
    for stop in (30, 83):
        part = choose_centres(q, g, w, SCALES, 0, rule, stop)
        np.testing.assert_array_equal(part.indices, whole.indices[:stop])
        on = choose_centres(q, g, w, SCALES, 0, rule, 120, start=part.indices)
        np.testing.assert_array_equal(on.indices, whole.indices)
        np.testing.assert_array_equal(on.interpolant.coefficients, whole.interpolant.coefficients)


def test_any_centres_that_span_space_can_be_gone_on_from(rng):
    q, g, w = highlights(rng, 2000)
    given = np.arange(100, 140)
    choice = choose_centres(q, g, w, SCALES, 0, Spread(), 60, start=given)
    np.testing.assert_array_equal(choice.indices[:40], given)
    assert choice.indices.size == 60
    alone = choose_centres(q, g, w, SCALES, 0, Spread(), 20, start=given)
    np.testing.assert_array_equal(alone.indices, given)


@pytest.mark.parametrize("rule", RULES)
def test_centres_that_were_given_twice_are_left_out(rng, rule):
    q, g, w = highlights(rng, 300)
    q[50:60], g[50:60] = q[:10], g[:10]
    choice = choose_centres(q, g, w, SCALES, 0, rule, 80, start=np.arange(60))
    np.testing.assert_array_equal(choice.indices[:50], np.arange(50))
    assert choice.indices.size == 80 and np.unique(q[choice.indices], axis=0).shape[0] == 80


@pytest.mark.parametrize("rule", RULES)
def test_it_ends_where_the_error_asked_for_is_reached(rng, rule, watched):
    q, g, w = highlights(rng, 2000)
    choice = choose_centres(q, g, w, SCALES, 0, rule, 1000, error=0.2)
    assert choice.converged and "fell to" in choice.reason
    assert choice.history[-1][1] <= 0.2 < choice.history[-2][1]
    fewer = choose_centres(q, g, w, SCALES, 0, rule, 12, error=0.2)
    assert not fewer.converged and "12" in fewer.reason


@pytest.mark.parametrize("rule", RULES)
def test_every_sample_may_become_a_centre(rng, rule):
    q, g, w = highlights(rng, 90)
    choice = choose_centres(q, g, w, SCALES, 0, rule, 500)
    assert np.sort(choice.indices).tolist() == list(range(90))
    np.testing.assert_allclose(choice.interpolant(q), g, atol=1e-4)


@pytest.mark.parametrize("rule", RULES)
def test_samples_at_one_point_give_one_centre(rng, rule):
    q, g, _ = highlights(rng, 60)
    choice = choose_centres(np.repeat(q, 3, axis=0), np.repeat(g, 3, axis=0), None, SCALES, 0, rule, 500)
    assert sorted(set(choice.indices // 3)) == list(range(60)) and choice.indices.size == 60
    assert "no sample is left" in choice.reason or choice.converged


def test_samples_without_weight_are_no_centres_and_only_ratios_of_weights_matter(rng):
    q, g, w = highlights(rng, 1000)
    g[::3] += 100
    w[::3] = 0
    choice = choose_centres(q, g, w, SCALES, 0, Lookahead(), 100)
    assert (choice.indices % 3 != 0).all()
    assert choice.interpolant.limits.max() < 50
    again = choose_centres(q, g, 8 * w, SCALES, 0, Lookahead(), 100)
    np.testing.assert_array_equal(again.indices, choice.indices)
    assert again.history == choice.history


def test_centres_gather_where_weights_are_large(rng):
    q, g, _ = highlights(rng, 3000)
    g = g + rng.normal(size=g.shape)
    indices = choose_centres(q, g, np.where(q[:, 0] > 0, 1, 0.1), SCALES, 0.1, Spread(), 100).indices
    assert np.mean(q[indices, 0] > 0) > 0.8


def test_progress_hears_of_centres_and_an_interruption_passes(rng):
    q, g, w = highlights(rng, 1000)
    heard = []
    choose_centres(q, g, w, SCALES, 0, Spread(), 50, 0, lambda done, total: heard.append((done, total)))
    assert heard[-1] == (50, 50) and [n for n, _ in heard] == sorted(n for n, _ in heard)

    def interrupt(done, total):
        if done > 20:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        choose_centres(q, g, w, SCALES, 0, Spread(), 50, 0, interrupt)


Q = np.random.default_rng(1).random((50, 3))
G = Q[:, :1]


@pytest.mark.parametrize(
    ("points", "values", "options", "error", "message"),
    [
        (Q, G[:, 0], {}, gn.errors.ArrayError, r"expected \(M, d\) and \(M, C\)"),
        (Q[:0], G[:0], {}, gn.errors.ArrayError, "expected"),
        (Q, G * np.inf, {}, gn.errors.ArrayError, r"values\[0, 0\] is inf"),
        (Q * [1, 1, 0], G, {}, gn.errors.ArrayError, "coordinate 2 is constant"),
        (Q, G, {"weights": np.ones(3)}, gn.errors.ArrayError, r"expected \(50,\)"),
        (Q, G, {"weights": -np.ones(50)}, gn.errors.ArrayError, ">= 0"),
        (Q, G, {"weights": np.zeros(50)}, gn.errors.ArrayError, "not 0 throughout"),
        (Q, G, {"scales": [1, 1]}, gn.errors.ArrayError, r"expected \(3,\)"),
        (Q, G, {"scales": [1, 1, 0]}, gn.errors.ParameterError, "scales are"),
        (Q, G, {"rho": -1}, gn.errors.ParameterError, "rho"),
        (Q, G, {"most": 3}, gn.errors.ParameterError, "4 centres at least"),
        (Q, G, {"start": [1, 1]}, gn.errors.ArrayError, "distinct"),
        (Q, G, {"start": [50]}, gn.errors.ArrayError, r"outside \[0, 50\)"),
    ],
)
def test_what_cannot_be_fitted_is_refused_by_name(points, values, options, error, message):
    with pytest.raises(error, match=message):
        choose_centres(points, values, **options)


@pytest.mark.parametrize(
    "make", [lambda: Greedy(0), lambda: Lookahead(0), lambda: Spread(0.1, 0), lambda: Lookahead(tried=0)]
)
def test_rules_refuse_what_adds_nothing(make):
    with pytest.raises(gn.errors.ParameterError, match="wanted"):
        make()
