"""Fresnel's equations: against the complex amplitudes, Brewster's angle, and the limits."""

from __future__ import annotations

import numpy as np
import pytest
from reference import brdf as plain

import gonio as gn

COSINES = np.linspace(0, 1, 101)


@pytest.mark.parametrize("eta", [1.001, 1.33, 1.5, 2.4, 10.0])
def test_dielectrics_follow_the_amplitudes(eta):
    expected = [[plain.fresnel(c, eta)] for c in COSINES]
    np.testing.assert_allclose(gn.Fresnel(eta)(COSINES), expected, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("eta, k", [(0.05, 4.0), (0.2, 3.9), (1.5, 0.01), (2.8, 3.1), (1.5, 0.0)])
def test_metals_follow_the_amplitudes(eta, k):
    expected = [[plain.fresnel(c, eta, k)] for c in COSINES]
    np.testing.assert_allclose(gn.Conductor(eta, k)(COSINES), expected, rtol=1e-9, atol=1e-12)


def test_a_clear_metal_is_a_dielectric():
    np.testing.assert_allclose(gn.Conductor(1.7, 0.0)(COSINES), gn.Fresnel(1.7)(COSINES), rtol=1e-9)


def test_normal_and_grazing_incidence():
    for eta in (1.2, 1.5, 3.0):
        assert gn.Fresnel(eta)(1.0) == pytest.approx(((eta - 1) / (eta + 1)) ** 2)
        assert gn.Fresnel(eta)(0.0) == pytest.approx(1)
    assert gn.Schlick(0.04)(1.0) == pytest.approx(0.04)
    assert gn.Schlick(0.04)(0.0) == pytest.approx(1)


def test_half_of_the_light_vanishes_at_brewsters_angle():
    # There only the s wave is reflected: ((eta^2 - 1) / (eta^2 + 1))^2 of it.
    eta = 1.5
    cosine = np.cos(np.arctan(eta))
    assert gn.Fresnel(eta)(cosine) == pytest.approx(0.5 * ((eta**2 - 1) / (eta**2 + 1)) ** 2)


def test_no_boundary_reflects_nothing():
    for dtype in (np.float32, np.float64):
        F = gn.Fresnel(1.0)(COSINES.astype(dtype))
        assert np.isfinite(F).all()
        assert F[1:].max() < 1e-6


def test_colours_broadcast_against_cosines():
    assert gn.Conductor([0.2, 0.9, 1.1], [3.9, 2.4, 2.3])(COSINES).shape == (101, 3)
    assert gn.Schlick(np.full((101, 3), 0.5))(COSINES).shape == (101, 3)
    assert gn.Fresnel(1.5)(0.5).shape == (1,)


@pytest.mark.parametrize("F", [gn.Fresnel(1.5), gn.Conductor(0.2, 3.9), gn.Schlick(0.04)], ids=str)
def test_pytorch_answers_alike(F):
    torch = pytest.importorskip("torch")
    np.testing.assert_allclose(F(torch.tensor(COSINES)).numpy(), F(COSINES), rtol=1e-12, atol=1e-16)
