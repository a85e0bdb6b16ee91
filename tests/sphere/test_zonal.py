import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import eval_legendre, gammaln

import gonio as gn
from gonio.errors import AccuracyWarning, ArrayError, ParameterError
from gonio.sphere import zonal


def integral(lobe, l, end=math.pi / 2):
    """A_l by adaptive quadrature."""
    value, _ = quad(lambda t: lobe(t) * eval_legendre(l, math.cos(t)) * math.sin(t), 0, end, epsabs=1e-12, limit=400)
    return 2 * math.pi * value


def test_the_clamped_cosine_begins_as_rh_3_33_says():
    expected = [1, 2 / 3, 1 / 4, 0, -1 / 24, 0, 1 / 64]
    np.testing.assert_allclose(zonal.clamped_cosine(6), math.pi * np.array(expected), rtol=1e-15, atol=0)
    assert zonal.clamped_cosine(0).shape == (1,)


@pytest.mark.parametrize("l", [0, 1, 2, 3, 4, 10, 41, 60])
def test_closed_forms_are_integrals_of_their_lobes(l):
    # quad is asked for 1e-12.
    np.testing.assert_allclose(zonal.clamped_cosine(60)[l], integral(math.cos, l), rtol=0, atol=1e-10)
    for s in (0.0, 0.5, 1.0, 7.0, 32.7):
        lobe = integral(lambda t, s=s: (s + 1) / (2 * math.pi) * math.cos(t) ** s, l)
        np.testing.assert_allclose(zonal.phong(60, s)[l], lobe, rtol=0, atol=1e-10)
    for sigma in (0.1, 0.3):
        lobe = integral(lambda t, s=sigma: math.exp(-t * t / (4 * s * s)) / (4 * math.pi * s * s), l)
        np.testing.assert_allclose(zonal.microfacet_at_normal(60, sigma)[l], lobe, rtol=0, atol=1e-10)


def test_the_clamped_cosine_falls_as_l_to_minus_five_halves():  # RH after 3.32
    A = zonal.clamped_cosine(2000)
    assert math.log2(A[2000] / A[1000]) == pytest.approx(-2.5, abs=0.01)


def test_quadrature_finds_the_closed_forms():
    found = zonal.coefficients(50, lambda t: np.stack((np.maximum(np.cos(t), 0), np.cos(t) ** 2), axis=-1))
    np.testing.assert_allclose(found[:, 0], zonal.clamped_cosine(50), rtol=0, atol=1e-10)
    expected = np.zeros(51)
    expected[[0, 2]] = 4 * math.pi / 3, 8 * math.pi / 15  # cos^2 = (1 + 2 P_2) / 3
    np.testing.assert_allclose(found[:, 1], expected, rtol=0, atol=1e-10)


def test_a_narrow_lobe_is_found_within_its_extent():
    width = 1e-3
    found = zonal.coefficients(8, lambda t: np.exp(-((t / width) ** 2)) / (math.pi * width**2), 8 * width)
    # exp(-(theta/w)^2) is the heat kernel of w^2/4, up to the curvature of the sphere, w^2.
    np.testing.assert_allclose(found, zonal.gaussian(8, width / 2), rtol=0, atol=1e-6)


def test_a_step_where_no_panel_ends_is_warned_of():
    with pytest.warns(AccuracyWarning, match="extent"):
        zonal.coefficients(2, lambda t: (t < 1).astype(float))


def test_rh_3_40_mended_stays_within_what_is_printed():
    assert np.max(np.abs(zonal.phong_gaussian(100, 32.0) - zonal.phong(100, 32.0))) < 0.0032


def test_rh_3_39_mended_is_the_series_of_rh_3_38():
    s, l = 400.0, np.arange(21)
    gammas = np.exp(2 * gammaln(s / 2) - gammaln(s / 2 - l / 2) - gammaln(s / 2 + l / 2))
    # The next term is of the order l^4 / s^3, 2.5e-3 at l = 20, times at most exp(-.5).
    np.testing.assert_allclose(zonal.phong_small_degree(20, s), gammas, rtol=0, atol=1e-3)


@pytest.mark.parametrize("sigma", [0.1, 0.2])
def test_rh_3_51_mended_stays_within_what_is_printed(sigma):
    exact = zonal.microfacet_at_normal(60, sigma)
    np.testing.assert_allclose(exact[0], {0.1: 0.993, 0.2: 0.974}[sigma], rtol=0, atol=5e-4)
    np.testing.assert_allclose(exact[0] * zonal.gaussian(60, sigma), exact, rtol=0, atol=0.005)
    np.testing.assert_allclose(zonal.microfacet(60, sigma), exact, rtol=0, atol=0.005)


def lobe_about_the_mirror_direction(sigma, cosine):
    """exp(-(theta_h/sigma)^2) / (4 pi sigma^2 c), t away from the mirror direction: t, its solid angle, wi, lobe."""
    nodes, weights = np.polynomial.legendre.leggauss(160)
    end = min(math.pi, 24 * sigma)
    t, phi = (nodes[:, None] + 1) * (end / 2), (np.arange(160) + 0.5) * (2 * math.pi / 160)
    sine = math.sqrt(1 - cosine**2)
    wo, mirrored = np.array([-sine, 0, cosine]), np.array([sine, 0, cosine])
    across, along = np.array([0, 1.0, 0]), np.array([cosine, 0, -sine])
    wi = np.cos(t)[..., None] * mirrored + np.sin(t)[..., None] * (
        np.cos(phi)[:, None] * along + np.sin(phi)[:, None] * across
    )
    theta_h = np.arccos(np.clip(gn.normalise(wi + wo)[..., 2], -1, 1))
    lobe = np.exp(-((theta_h / sigma) ** 2)) / (4 * math.pi * sigma**2 * cosine)
    return t[:, 0], weights[:, None] * (end / 2) * np.sin(t) * (2 * math.pi / 160), wi, lobe


@pytest.mark.parametrize("sigma", [0.02, 0.1, 0.2])
@pytest.mark.parametrize("cosine", [1.0, 0.8, 0.5])
def test_rh_3_53_mended_is_the_lobe_averaged_about_the_mirror_direction(sigma, cosine):
    t, measure, _, lobe = lobe_about_the_mirror_direction(sigma, cosine)
    degree = round(4 / sigma)  # A_l falls below 1e-3 there
    A = np.array([np.sum(np.sum(measure * lobe, axis=1) * eval_legendre(l, np.cos(t))) for l in range(degree + 1)])
    np.testing.assert_allclose(zonal.microfacet(degree, sigma, cosine), A, rtol=0, atol=0.21 * sigma**2)
    # The energy does not depend on the exit angle: what the lobe loses in width it has in height.
    assert A[0] == pytest.approx(zonal.microfacet_at_normal(0, sigma)[0], rel=1e-5)


def test_the_horizon_takes_from_wide_lobes_what_the_docstring_says():
    _, measure, wi, lobe = lobe_about_the_mirror_direction(0.2, 0.5)
    seen = np.sum(measure * np.where(wi[..., 2] > 0, lobe, 0))
    assert zonal.microfacet(0, 0.2, 0.5)[0] - seen == pytest.approx(0.015, abs=1e-3)


def test_values_are_the_legendre_sum(rng):
    kernel, u = rng.normal(size=(31, 2)), np.linspace(-1, 1, 21)
    terms = np.stack([(2 * l + 1) / (4 * math.pi) * eval_legendre(l, u) for l in range(31)], axis=-1)
    np.testing.assert_allclose(zonal.values(kernel, u), terms @ kernel, rtol=0, atol=1e-12)
    np.testing.assert_allclose(zonal.values(kernel[:, 0], u), terms @ kernel[:, 0], rtol=0, atol=1e-12)


def test_values_stay_accurate_at_high_degree():
    # The sum over all (2l+1)/(4 pi) P_l(u), closed by Christoffel and Darboux: (n+1) (P_n - P_(n+1)) / (4 pi (1-u)).
    n, u = 1000, np.array([-0.7, 0.1, 0.99])
    closed = (n + 1) * (eval_legendre(n, u) - eval_legendre(n + 1, u)) / (4 * math.pi * (1 - u))
    np.testing.assert_allclose(zonal.values(zonal.mirror(n), u), closed, rtol=0, atol=1e-9)


def test_convolution_is_the_integral_against_the_turned_kernel(rng):
    degree, kernel = 5, rng.normal(size=6)
    light = rng.normal(size=(36, 3))
    grid = gn.GaussLegendre(10)
    w = grid.directions()
    weights = np.broadcast_to(grid.weights[:, None], grid.shape)
    axis = gn.normalise(rng.normal(size=3))
    brute = np.einsum("rc,rc,rcx->x", weights, zonal.values(kernel, w @ axis), gn.harmonics(degree, w) @ light)
    found = gn.harmonics(degree, axis) @ zonal.convolve(light, kernel)
    np.testing.assert_allclose(found, brute, rtol=0, atol=1e-12)


def test_two_blurs_are_one_and_a_mirror_is_none(rng):
    light = rng.normal(size=49)
    blurred = zonal.convolve(zonal.convolve(light, zonal.gaussian(6, 0.3)), zonal.gaussian(6, 0.4))
    np.testing.assert_allclose(blurred, zonal.convolve(light, zonal.gaussian(6, 0.5)), rtol=1e-13)
    np.testing.assert_array_equal(zonal.convolve(light, zonal.mirror(6)), light)
    np.testing.assert_allclose(zonal.phong(20, 1e12), 1, rtol=1e-9)  # the mirror, again


def test_one_kernel_for_each_channel(rng):
    sharpness = np.array([5.0, 20.0, 80.0])
    kernel = zonal.phong(6, sharpness)
    assert kernel.shape == (7, 3)
    light = rng.normal(size=(49, 3))
    found = zonal.convolve(light, kernel)
    np.testing.assert_array_equal(found[:, 1], zonal.convolve(light[:, 1], zonal.phong(6, 20.0)))
    assert zonal.convolve(light[:, 0], kernel).shape == (49, 3)


def test_tensors_pass(rng):
    torch = pytest.importorskip("torch")
    s = torch.tensor([3.0, 9.0], dtype=torch.float32)
    kernel = zonal.phong(6, s)
    assert kernel.dtype == torch.float32
    np.testing.assert_allclose(kernel, zonal.phong(6, [3.0, 9.0]), rtol=1e-5, atol=1e-7)
    light = rng.normal(size=(49, 2)).astype(np.float32)
    found = zonal.convolve(torch.tensor(light), kernel)
    np.testing.assert_allclose(found, zonal.convolve(light, zonal.phong(6, [3.0, 9.0])), rtol=1e-5, atol=1e-6)
    assert zonal.values(kernel, torch.tensor([0.5], dtype=torch.float32)).shape == (1, 2)


def test_bad_kernels_are_refused():
    with pytest.raises(ParameterError, match="negative"):
        zonal.phong(3, -1.0)
    with pytest.raises(ParameterError, match="positive"):
        zonal.gaussian(3, 0.0)
    with pytest.raises(ParameterError, match="sigma"):
        zonal.microfacet(3, 0.0)
    with pytest.raises(ParameterError, match="extent"):
        zonal.coefficients(3, np.cos, 4.0)
    with pytest.raises(ArrayError, match="finite"):
        zonal.coefficients(3, lambda t: np.where(t > 2, np.nan, 1))
    with pytest.raises(ArrayError, match="degree 3"):
        zonal.convolve(np.zeros(16), np.ones(3))
    with pytest.raises(ArrayError, match="kernel"):
        zonal.values(np.zeros((2, 2, 2)), 0.5)
