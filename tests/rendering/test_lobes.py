"""Facts about the lobes of real-time engines and the degrees they need."""

import numpy as np
import pytest

from gonio.rendering import lobes
from gonio.sphere import zonal


@pytest.mark.parametrize("lobe", [lobes.ggx, lobes.phong])
def test_at_full_roughness_a_lobe_is_a_matte_surfaces_cosine(lobe):
    A, _ = lobes.spectrum(lobe, 1.0, 1e-2, 100)
    np.testing.assert_allclose(A, zonal.clamped_cosine(len(A) - 1) / np.pi, atol=1e-12)


def test_phong_has_the_coefficients_of_its_exponent():
    A, _ = lobes.spectrum(lobes.phong, 0.2, 1e-3, 100)
    np.testing.assert_allclose(A, zonal.phong(len(A) - 1, 0.5 + 0.5 / 0.2**2), atol=1e-10)


def test_phong_is_as_wide_as_what_beckmanns_facets_reflect():
    """RH 6.7: exp(-(theta_h / alpha)^2) about R is a lobe of exp(-theta^2 / (4 alpha^2)), theta = 2 theta_h."""
    theta = np.linspace(0, 0.1, 20)
    expected = np.exp(-(theta**2) / (4 * 0.02**2))
    # cos^s theta = exp(-s theta^2 / 2 (1 + theta^2 / 6 + ...)), and s is 1 / (2 alpha^2) + 1/2.
    np.testing.assert_allclose(lobes.phong(0.02, theta), expected, atol=2e-3)


@pytest.mark.parametrize("alpha", [0.05, 0.2, 0.6])
@pytest.mark.parametrize("error", [1e-2, 1e-3])
def test_what_a_series_leaves_out_is_what_is_told(alpha, error):
    A, told = lobes.spectrum(lobes.ggx, alpha, error, 2000)
    # The rms of the lobe less its series, by the midpoint rule over angles, relative to the rms of the lobe.
    theta = (np.arange(20_000) + 0.5) * (np.pi / 20_000)
    lobe = np.where(theta < np.pi / 2, lobes.ggx(alpha, theta), 0)
    lobe = lobe / (2 * np.pi * np.sum(np.sin(theta) * lobe) * np.pi / 20_000)
    left = lobe - zonal.values(A, np.cos(theta))
    found = np.sqrt(np.sum(np.sin(theta) * left**2) / np.sum(np.sin(theta) * lobe**2))
    # The rule's own error is the square of its step over the lobe's width: 1e-5 of the lobe at most.
    assert found == pytest.approx(told, rel=0.02)
    assert told <= error


def test_no_degree_fewer_would_do():
    A, told = lobes.spectrum(lobes.ggx, 0.1, 1e-3, 500)
    _, shorter = lobes.spectrum(lobes.ggx, 0.1, 1e-9, len(A) - 2)
    assert told <= 1e-3 < shorter
