"""How far queries lie from samples: what is covered is trusted, what is not fades."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

import gonio as gn
from gonio.brdf.coverage import LENGTH, Coverage
from gonio.brdf.radial import Interpolant, Radial


def test_samples_are_covered_by_a_few_thousand_of_them(rng):
    samples = rng.normal(size=(200_000, 3)) * [1, 0.5, 0.01]
    coverage = Coverage.of(samples, np.array([1.0, 2.0, 1.0]))
    assert 500 < len(coverage.points) <= 4096
    # What is kept are samples, to single precision.
    assert cKDTree(samples).query(coverage.points)[0].max() < 1e-6
    within = coverage.confidence(samples[:5000]) == 1
    # By the 99th percentile; of 5,000 draws the share is off by .0014, rms.
    assert abs(np.mean(within) - 0.99) < 0.005


def test_confidence_falls_by_e_for_each_length_beyond(rng):
    coverage = Coverage(np.zeros((1, 2)), [1.0, 2.0], 0.3)
    q = np.array([[0.0, 0.0], [0.3, 0.0], [0.0, (0.3 + LENGTH) / 2], [0.3 + 2 * LENGTH, 0.0]])
    np.testing.assert_allclose(coverage.confidence(q), [1, 1, np.exp(-1), np.exp(-2)], rtol=1e-6)
    assert len(Coverage.of(np.ones((5, 2)), np.ones(2)).points) == 5


def test_a_sum_is_trusted_by_what_its_terms_reflect():
    level = np.array([[-np.log(np.pi)], [0], [0], [0]])
    one = Interpolant(np.zeros((1, 3)), np.ones(3), np.zeros((1, 1)), level)
    up, aside = np.array([0.0, 0, 1]), gn.normalise([1.0, 0, 1])
    fitted = Radial(one, coverage=Coverage(np.zeros((1, 3)), np.ones(3), 0.0))
    assert fitted.confidence(up, up) == 1
    alone = fitted.confidence(aside, up)
    assert alone < 0.2
    # The fit is 1/pi everywhere, the matte surface as bright and known.
    assert (fitted + gn.Lambert(1.0)).confidence(aside, up) == pytest.approx((1 + alone) / 2, rel=1e-6)
    assert (0.0 * fitted + gn.Lambert(1.0)).confidence(aside, up) == 1
    assert (0.5 * fitted).confidence(aside, up) == alone


def test_other_coverage_is_refused():
    with pytest.raises(gn.errors.ArrayError, match="points and scales have shapes"):
        Coverage(np.zeros(3), np.ones(3), 0.1)
    with pytest.raises(gn.errors.ParameterError, match="reach = nan"):
        Coverage(np.zeros((3, 2)), np.ones(2), np.nan)
    with pytest.raises(gn.errors.ParameterError, match="a scale is -1"):
        Coverage(np.zeros((3, 2)), [1.0, -1.0], 0.1)
    with pytest.raises(gn.errors.ArrayError, match=r"expected \(..., 2\)"):
        Coverage(np.zeros((3, 2)), np.ones(2), 0.1).confidence(np.zeros(3))
    one = Interpolant(np.zeros((1, 3)), np.ones(3), np.zeros((1, 1)), np.zeros((4, 1)))
    with pytest.raises(gn.errors.ParameterError, match="the coverage has 2 coordinates"):
        Radial(one, coverage=Coverage(np.zeros((3, 2)), np.ones(2), 0.1))
