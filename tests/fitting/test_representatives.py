"""Facts about texels that stand for others: every kind has one, and mixtures are the nearest there are."""

import numpy as np
import pytest

import gonio as gn
from gonio.fitting.representatives import choose_representatives


def reader(values):
    return lambda first, last: values[first:last]


def test_every_kind_has_a_texel_that_stands_for_it(rng):
    kinds = 10 * rng.normal(size=(12, 60))
    label = rng.integers(0, 12, 5000)
    values = (kinds[label] + rng.normal(scale=0.01, size=(5000, 60))).astype(np.float32)
    found = choose_representatives(reader(values), 5000, 40)
    assert set(label[found.texels]) == set(range(12))
    # The nearest is of the same kind, and what is left is the noise, a thousandth of what tells kinds apart.
    assert (label[found.texels][found.indices[:, 0]] == label).all()
    assert found.residual < 2e-3
    np.testing.assert_allclose(found.weights.sum(axis=1), 1, atol=1e-5)


def test_mixtures_of_four_are_found_as_such(rng):
    corners = rng.normal(size=(4, 30))
    w = rng.dirichlet(np.ones(4), 3000)
    w[:4] = np.eye(4)
    values = (w @ corners).astype(np.float32)
    found = choose_representatives(reader(values), 3000, 64)
    again = np.einsum("tk,tkn->tn", found.weights, values[found.texels][found.indices])
    # A ridge of a thousandth leaves a thousandth of the distance to the neighbours, which is a fifth of the whole.
    assert np.sqrt(np.mean((again - values) ** 2) / np.var(values, axis=0).mean()) == pytest.approx(
        found.residual, abs=1e-4
    )
    assert found.residual < 0.01


def test_texels_that_stand_for_others_are_themselves(rng):
    values = rng.normal(size=(400, 20)).astype(np.float32)
    found = choose_representatives(reader(values), 400, 30)
    assert (found.indices[found.texels, 0] == np.arange(len(found.texels))).all()
    # A ridge of a thousandth lets each of fifteen neighbours in by about as much.
    np.testing.assert_allclose(found.weights[found.texels, 0], 1, atol=0.03)


def test_the_same_seed_gives_the_same_and_blocks_change_nothing(rng, monkeypatch):
    values = rng.normal(size=(900, 24)).astype(np.float32)
    first, second = (choose_representatives(reader(values), 900, 20, seed=3) for _ in range(2))
    np.testing.assert_array_equal(first.texels, second.texels)
    monkeypatch.setattr("gonio.fitting.representatives._BLOCK", 128)
    third = choose_representatives(reader(values), 900, 20, seed=3)
    np.testing.assert_array_equal(first.texels, third.texels)
    np.testing.assert_allclose(first.weights, third.weights, atol=1e-4)


def test_texels_that_are_all_alike_are_one(rng):
    values = np.ones((50, 8), np.float32)
    found = choose_representatives(reader(values), 50, 3)
    assert found.residual == 0 and np.isfinite(found.weights).all()


def test_one_percent_stands_for_all_and_progress_hears(rng):
    values, heard = rng.normal(size=(1000, 16)).astype(np.float32), []
    found = choose_representatives(reader(values), 1000, progress=lambda done, total: heard.append((done, total)))
    assert 2 <= len(found.texels) <= 10
    assert heard[-1][0] == heard[-1][1] and np.diff(heard, axis=0).min() >= 0


@pytest.mark.parametrize("most", [0, 51])
def test_other_numbers_are_refused(most):
    with pytest.raises(gn.errors.ParameterError, match=f"most = {most}: from 1 to 50"):
        choose_representatives(reader(np.ones((50, 8))), 50, most)
