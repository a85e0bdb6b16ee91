import math

import numpy as np
import pytest

import gonio as gn
from gonio.brdf import harmonic
from gonio.errors import ArrayError, ParameterError
from gonio.sphere import zonal
from gonio.sphere.harmonics import complex_harmonics
from gonio.sphere.wigner import big_lambda


class Polynomial(gn.brdf.model.BRDF):
    """A cubic lobe about the mirror direction: every quadrature below integrates it exactly."""

    def _f(self, xp, wi, wo):
        mirrored = wi[..., 2] * wo[..., 2] - wi[..., 0] * wo[..., 0] - wi[..., 1] * wo[..., 1]
        f = 0.1 + 0.3 * (1 + mirrored) ** 3
        return xp.stack((f, 2 * f, f + 0.1 * mirrored), axis=-1)


GLOSSY = gn.Lambert([0.3, 0.2, 0.1]) + gn.Microfacet(gn.GGX(0.5), gn.Fresnel(1.5))


def half_sphere(samples):
    nodes, weights = np.polynomial.legendre.leggauss(samples)
    z, phi = (nodes + 1) / 2, (np.arange(2 * samples) + 0.3) * (math.pi / samples)
    r = np.sqrt(1 - z * z)[:, None]
    w = np.stack(np.broadcast_arrays(r * np.cos(phi), r * np.sin(phi), z[:, None]), axis=-1).reshape(-1, 3)
    return w, np.repeat(weights / 2 * (math.pi / samples), 2 * samples)


def test_lamberts_coefficients_are_products_of_two_zonal_ones():
    found = harmonic.transfer(gn.Lambert(0.6), 6, 5)[..., 0]
    cosine = zonal.clamped_cosine(6) / big_lambda(6)
    half = zonal.coefficients(5, lambda t: (t < math.pi / 2).astype(float)) / big_lambda(5)
    np.testing.assert_allclose(found[:, :, 0], 0.6 / math.pi * np.outer(cosine, half), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found[:, :, 1:], 0, rtol=0, atol=1e-13)


def test_isotropic_coefficients_are_the_double_integral():  # RH 2.38, 2.53
    found = harmonic.transfer(Polynomial(), 3, 2)
    w, measure = half_sphere(10)
    f = Polynomial().f(w[:, None], w) * w[:, None, 2:]
    incident, leaving = complex_harmonics(3, w), np.conj(complex_harmonics(2, w))
    for l, p, q in [(0, 0, 0), (1, 1, 1), (3, 2, 1), (3, 2, 2), (2, 1, 0)]:
        for sign in (1, -1):
            i, o = incident[:, l * l + l + sign * q], leaving[:, p * p + p + sign * q]
            value = np.einsum("i,o,ioc->c", measure * i, measure * o, f)
            np.testing.assert_allclose(found[l, p, q], value, rtol=0, atol=1e-12)


def test_holding_the_exit_angle_is_summing_over_p():  # RH 2.53 against 2.56
    theta_o = np.array([0.2, 0.9])
    held = harmonic.transfer_at(gn.Lambert(0.5), 4, theta_o)[..., 0]
    np.testing.assert_allclose(held[:, :, 1:], 0, rtol=0, atol=1e-13)
    expected = math.sqrt(2 * math.pi) * 0.5 / math.pi * zonal.clamped_cosine(4) / big_lambda(4)
    np.testing.assert_allclose(held[:, :, 0], np.repeat(expected[:, None], 2, axis=1), rtol=0, atol=1e-12)
    # Projected on Y_pq over the half sphere, the held coefficients are those of all p.
    nodes, weights = np.polynomial.legendre.leggauss(12)
    z = (nodes + 1) / 2
    held = harmonic.transfer_at(Polynomial(), 4, np.arccos(z))
    leaving = complex_harmonics(4, np.stack((np.sqrt(1 - z * z), 0 * z, z), axis=-1)).real
    found = harmonic.transfer(Polynomial(), 4, 4)
    for p, q in [(0, 0), (3, 1), (4, 2)]:
        value = math.sqrt(2 * math.pi) * np.einsum("k,k,lkc->lc", weights / 2, leaving[:, p * p + p + q], held[:, :, q])
        np.testing.assert_allclose(found[:, p, q], value, rtol=0, atol=1e-12)


def test_both_cosines_make_reciprocal_brdfs_symmetric():  # RH 2.59
    rho = harmonic.transfer(GLOSSY, 5, 5, reciprocal=True)
    np.testing.assert_allclose(rho, np.swapaxes(rho, 0, 1), rtol=0, atol=1e-12)
    brushed = gn.Microfacet(gn.GGX(0.3, 0.6), gn.Fresnel(1.5))
    rho = harmonic.anisotropic_transfer(brushed, 3, 3, reciprocal=True, samples=8)
    np.testing.assert_allclose(rho, np.conj(np.swapaxes(rho, 0, 1)), rtol=0, atol=1e-12)


def test_isotropic_brdfs_have_n_equal_q():
    rho = harmonic.anisotropic_transfer(Polynomial(), 2, 2, samples=8)
    small = harmonic.transfer(Polynomial(), 2, 2)
    for l, n in [(0, 0), (1, -1), (1, 1), (2, -2), (2, 0)]:
        for p, q in [(0, 0), (1, 1), (1, -1), (2, 1), (2, -2)]:
            expected = small[l, p, abs(q)] if n == q else np.zeros(3)
            np.testing.assert_allclose(rho[l * l + l + n, p * p + p + q], expected, rtol=0, atol=1e-12)


def test_uniform_light_finds_the_mean_of_the_lobe():  # RH 3.21, 3.22 mended
    theta_o = np.array([0.0, 0.8])
    found = harmonic.transfer_at(GLOSSY, 0, theta_o, samples=64)[0, :, 0]
    w, measure = half_sphere(64)
    for k, theta in enumerate(theta_o):
        wo = np.array([math.sin(theta), 0, math.cos(theta)])
        albedo = np.einsum("i,ic->c", measure * w[:, 2], GLOSSY.f(w, wo))
        np.testing.assert_allclose(found[k], math.sqrt(2 * math.pi) / big_lambda(0)[0] * albedo, rtol=1e-4)


def test_a_mirror_is_one_on_the_diagonal_with_turned_azimuth():  # RH 3.23
    rho = harmonic.mirror(3)
    assert rho[2, 2, 1] == -1 and rho[3, 3, 2] == 1 and rho[1, 1, 2] == 0 and rho[2, 1, 0] == 0


def test_tensors_are_refused_not_cut_from_their_gradients():
    torch = pytest.importorskip("torch")
    glossy = gn.Lambert(0.2) + gn.Microfacet(gn.GGX(torch.tensor(0.3)), gn.Fresnel(1.5))
    with pytest.raises(ArrayError, match="alpha"):
        harmonic.transfer(glossy, 2, 2)
    with pytest.raises(ArrayError, match="alpha"):
        harmonic.anisotropic_transfer(glossy, 2, 2)
    with pytest.raises(ArrayError, match="theta_o"):
        harmonic.transfer_at(gn.Lambert(0.5), 2, torch.tensor([0.3]))


def test_bad_input_is_refused():
    with pytest.raises(ParameterError, match="isotropic"):
        harmonic.transfer(gn.Microfacet(gn.GGX(0.1, 0.6), gn.Fresnel(1.5)), 2, 2)
    with pytest.raises(ParameterError, match="samples"):
        harmonic.transfer(gn.Lambert(0.5), 8, 2, samples=8)
    with pytest.raises(ParameterError, match="theta_o"):
        harmonic.transfer_at(gn.Lambert(0.5), 2, [2.0])
    with pytest.raises(ParameterError, match="exit_degree"):
        harmonic.anisotropic_transfer(gn.Lambert(0.5), 2, -1)
