import math

import numpy as np
import pytest

import gonio as gn
from gonio.brdf import harmonic
from gonio.errors import ArrayError, ParameterError
from gonio.frames import euler
from gonio.sphere import convolution
from gonio.sphere.harmonics import complex_from_real, degrees_and_orders

DEGREE = 4


class Polynomial(gn.brdf.model.BRDF):
    """f(wi, wo) cos theta_i without the cosine, a polynomial above the surface: glossy, isotropic or brushed."""

    def __init__(self, brushed=0.0):
        object.__setattr__(self, "brushed", brushed)

    def _f(self, xp, wi, wo):
        mirrored = wi[..., 2] * wo[..., 2] - wi[..., 0] * wo[..., 0] - wi[..., 1] * wo[..., 1]
        f = 0.1 + 0.3 * (1 + mirrored) ** 3 + self.brushed * (wi[..., 0] + wo[..., 0] + wi[..., 1] * wo[..., 2]) ** 2
        return xp.stack((f, 2 * f, f + 0.1 * mirrored), axis=-1)


@pytest.fixture
def light(rng):
    """Complex coefficients (25, 3) of a real light, and what it shows at directions."""
    real = rng.normal(size=((DEGREE + 1) ** 2, 3))
    return complex_from_real(real), lambda w: gn.harmonics(DEGREE, w) @ real


def reflected(brdf, radiance, R, wo):
    """B by summing over the half sphere, in a frame R: equal steps in phi, Gauss in theta (not in cos theta)."""
    nodes, weights = np.polynomial.legendre.leggauss(48)
    theta, phi = (nodes + 1) * math.pi / 4, np.arange(96) * (2 * math.pi / 96)
    wi = np.stack(
        np.broadcast_arrays(
            np.sin(theta)[:, None] * np.cos(phi), np.sin(theta)[:, None] * np.sin(phi), np.cos(theta)[:, None]
        ),
        axis=-1,
    )
    measure = (weights * (math.pi / 4) * np.sin(theta) * np.cos(theta))[:, None] * (2 * math.pi / 96)
    return np.einsum("ij,ijc,ijc->c", np.broadcast_to(measure, (48, 96)), brdf.f(wi, wo), radiance(wi @ R.T))


def exits(rng, count):
    w = gn.normalise(rng.normal(size=(count, 3)))
    w[:, 2] = np.abs(w[:, 2])
    return w


def test_reflection_is_convolution_for_isotropic_brdfs(rng, light):  # RH 2.57: exact in theta_o
    coefficients, radiance = light
    brdf = Polynomial()
    for wo in exits(rng, 3):
        theta_o, phi_o = math.acos(wo[2]), math.atan2(wo[1], wo[0])
        alpha, beta = rng.uniform(0, math.pi), rng.uniform(0, 2 * math.pi)
        field = convolution.reflect(coefficients, harmonic.transfer_at(brdf, DEGREE, [theta_o]))[:, 0]
        found = np.zeros(3, dtype=complex)
        for l in range(DEGREE + 1):
            D = gn.wigner_D(l, alpha, beta) / convolution.big_lambda(l)[l]
            part = field[l * l : (l + 1) ** 2]
            for q in range(-l, l + 1):
                sign = (-1) ** q if q < 0 else 1
                found += sign * np.exp(1j * q * phi_o) / math.sqrt(2 * math.pi) * (D[:, l + q] @ part[:, abs(q)])
        expected = reflected(brdf, radiance, euler(alpha, beta, 0.0), wo)
        np.testing.assert_allclose(found.real, expected, rtol=0, atol=1e-10)
        np.testing.assert_allclose(found.imag, 0, rtol=0, atol=1e-10)


def test_reflection_is_convolution_for_lambert(rng, light):
    coefficients, radiance = light
    brdf = gn.Lambert([0.2, 0.5, 0.8])
    wo = exits(rng, 1)[0]
    at = math.acos(wo[2])
    field = convolution.reflect(coefficients, harmonic.transfer_at(brdf, DEGREE, [at]))[:, 0, 0]
    # Only q = 0 is left, and D_m0 = Lambda_l Y_lm: an irradiance map.
    n = euler(1.0, 0.4, 0.0) @ [0, 0, 1.0]
    found = (gn.complex_harmonics(DEGREE, n) @ field).real / math.sqrt(2 * math.pi)
    np.testing.assert_allclose(found, reflected(brdf, radiance, euler(1.0, 0.4, 0.0), wo), rtol=0, atol=1e-10)


def smooth(rng, degree, exit_degree):
    """Random coefficients of a smooth reciprocal transfer function, as if measured on the whole sphere."""
    rho = rng.normal(size=(degree + 1, exit_degree + 1, min(degree, exit_degree) + 1))
    l, p, q = np.indices(rho.shape)
    rho[(q > l) | (q > p)] = 0
    return rho


def test_the_field_is_summed_as_rh_2_63_writes_it(rng, light):
    coefficients, radiance = light
    rho = smooth(rng, DEGREE, 3)
    field = convolution.reflect(coefficients, rho)
    alpha, beta, wo = 0.8, 2.0, exits(rng, 1)[0]
    # The transfer function at wo is sum rho conj Y Y; its integral with the turned light, by a grid exact to degree 8.
    grid = gn.GaussLegendre(8)
    wi = grid.directions()
    y, z = gn.complex_harmonics(DEGREE, wi), gn.complex_harmonics(3, wo)
    transfer = np.zeros(grid.shape, dtype=complex)
    for l, m in zip(*degrees_and_orders(DEGREE), strict=True):
        for p in range(abs(m), 4):
            transfer += rho[l, p, abs(m)] * np.conj(y[..., l * (l + 1) + m]) * z[p * (p + 1) + m]
    turned = radiance(wi @ euler(alpha, beta, 0.0).T)
    expected = np.einsum("r,rc,rcx->x", grid.weights, transfer, turned)
    np.testing.assert_allclose(convolution.radiance(field, alpha, beta, wo), expected.real, rtol=0, atol=1e-11)
    assert convolution.radiance(field, np.zeros((5, 1)), np.zeros(4), wo).shape == (5, 4, 3)
    alone = convolution.radiance(field[..., 0], alpha, beta, wo)
    np.testing.assert_allclose(alone, expected[0].real, rtol=0, atol=1e-11)


def test_reflection_is_convolution_for_anisotropic_brdfs(rng, light):  # RH 2.44: exit directions as they are
    coefficients, radiance = light
    brdf = Polynomial(brushed=0.2)
    angles = (0.7, 2.1, -0.5)
    wo = exits(rng, 2)
    # rho_ln(wo) by quadrature in cos theta: integral of rho^ Y_ln over the half sphere.
    nodes, weights = np.polynomial.legendre.leggauss(32)
    z, phi = (nodes + 1) / 2, np.arange(40) * (2 * math.pi / 40)
    r = np.sqrt(1 - z * z)[:, None]
    wi = np.stack(np.broadcast_arrays(r * np.cos(phi), r * np.sin(phi), z[:, None]), axis=-1).reshape(-1, 3)
    measure = np.repeat(weights / 2 * (2 * math.pi / 40), 40) * wi[:, 2]
    rho = np.einsum("k,kn,koc->noc", measure, gn.complex_harmonics(DEGREE, wi), brdf.f(wi[:, None], wo))
    field = convolution.reflect_anisotropic(coefficients, rho)
    assert field.shape[0] == sum((2 * l + 1) ** 2 for l in range(DEGREE + 1))
    found, at = np.zeros((2, 3), dtype=complex), 0
    for l in range(DEGREE + 1):
        n = 2 * l + 1
        D = gn.wigner_D(l, *angles).ravel() * math.sqrt(n / (8 * math.pi**2))
        found += np.einsum("m,moc->oc", D, field[at : at + n * n])
        at += n * n
    for k in range(2):
        expected = reflected(brdf, radiance, euler(*angles), wo[k])
        np.testing.assert_allclose(found[k], expected, rtol=0, atol=1e-10)


def test_the_anisotropic_field_is_summed_over_exits_too(rng, light):  # RH 2.42, 2.43
    coefficients, radiance = light
    brdf = Polynomial(brushed=0.2)
    rho = harmonic.anisotropic_transfer(brdf, DEGREE, 3, samples=20)
    field = convolution.reflect_anisotropic(coefficients, rho)
    wo, angles = exits(rng, 3), (0.7, 2.1, -0.5)
    found = convolution.radiance_anisotropic(field, *angles, wo)
    # The same projected to degree 3 in wo: brute force at the samples of a half sphere (zero below it), then analysis.
    nodes, weights = np.polynomial.legendre.leggauss(10)
    z, phi = (nodes + 1) / 2, np.arange(12) * (2 * math.pi / 12)
    r = np.sqrt(1 - z * z)[:, None]
    w = np.stack(np.broadcast_arrays(r * np.cos(phi), r * np.sin(phi), z[:, None]), axis=-1).reshape(-1, 3)
    measure = np.repeat(weights / 2 * (2 * math.pi / 12), 12)
    B = np.stack([reflected(brdf, radiance, euler(*angles), each) for each in w])
    expected = gn.harmonics(3, wo) @ np.einsum("k,kp,kc->pc", measure, gn.harmonics(3, w), B)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10)


def test_an_isotropic_brdf_reflects_alike_by_either_theorem(rng, light):
    coefficients, _ = light
    brdf, wo = Polynomial(), exits(rng, 4)
    one = convolution.reflect(coefficients, harmonic.transfer(brdf, DEGREE, 3, samples=14))
    two = convolution.reflect_anisotropic(coefficients, harmonic.anisotropic_transfer(brdf, DEGREE, 3, samples=14))
    np.testing.assert_allclose(
        convolution.radiance(one, 1.0, 0.3, wo),
        convolution.radiance_anisotropic(two, 1.0, 0.3, 0.0, wo),
        rtol=0,
        atol=1e-11,
    )


def test_a_mirror_shows_the_light(rng, light):  # RH 3.24, 3.25
    coefficients, radiance = light
    field = convolution.reflect(coefficients, harmonic.mirror(DEGREE))
    wo = exits(rng, 5)
    seen = radiance((wo * [-1, -1, 1]) @ euler(0.6, -1.0, 0.0).T)
    np.testing.assert_allclose(convolution.radiance(field, 0.6, -1.0, wo), seen, rtol=0, atol=1e-12)


def test_light_and_brdf_come_back_from_the_field(rng, light):  # RH 2.64, 2.65
    coefficients, _ = light
    rho = smooth(rng, DEGREE, 3)
    field = convolution.reflect(coefficients, rho)
    found = convolution.brdf_from_light(field, coefficients)
    assert found.known.all() and found.value.dtype == np.float64
    np.testing.assert_allclose(found.value, np.repeat(rho[..., None], 3, axis=-1), rtol=0, atol=1e-12)
    lit = convolution.light_from_brdf(field, rho)
    assert lit.known.all()
    np.testing.assert_allclose(lit.value, coefficients, rtol=0, atol=1e-12)


def test_a_degree_without_light_is_masked_not_guessed(rng, light):
    coefficients, _ = light
    coefficients[4:9, 1] = 0
    rho = smooth(rng, DEGREE, 3)
    found = convolution.brdf_from_light(convolution.reflect(coefficients, rho), coefficients)
    expected = np.ones((5, 3), dtype=bool)
    expected[2, 1] = False
    np.testing.assert_array_equal(found.known, expected)
    assert np.all(found.value[2, ..., 1] == 0) and np.all(np.isfinite(found.value))


def test_what_lambert_swallows_is_masked_not_guessed(light):
    coefficients, _ = light
    rho = harmonic.transfer(gn.Lambert(1.0), DEGREE, 3)
    found = convolution.light_from_brdf(convolution.reflect(coefficients, rho), rho)
    np.testing.assert_array_equal(found.known[:, 0], [True, True, True, False, True])
    assert np.all(found.value[9:16] == 0)


def reciprocal(rng, degree):
    rho = smooth(rng, degree, degree)
    return rho + np.swapaxes(rho, 0, 1)


def test_a_reciprocal_field_factors_up_to_scale(rng, light):  # RH 2.68
    coefficients, _ = light
    rho = reciprocal(rng, DEGREE)
    found = convolution.factor(convolution.reflect(coefficients, rho))
    assert found.known.all()
    scale = coefficients[0].real * math.sqrt(4 * math.pi)
    np.testing.assert_allclose(found.light, coefficients / scale, rtol=0, atol=1e-10)
    np.testing.assert_allclose(found.transfer, rho[..., None] * scale, rtol=0, atol=1e-10)


def test_factoring_does_not_need_the_terms_rh_uses(rng, light):
    # With rho_l00 = 0 for l > 1 the formulas of RH 2.68 divide by zero.
    coefficients, _ = light
    rho = reciprocal(rng, DEGREE)
    rho[2:, 0] = rho[0, 2:] = 0
    found = convolution.factor(convolution.reflect(coefficients[:, 0], rho))
    assert found.known.all()
    scale = coefficients[0, 0].real * math.sqrt(4 * math.pi)
    np.testing.assert_allclose(found.light, coefficients[:, 0] / scale, rtol=0, atol=1e-9)


def test_factoring_bears_noise_in_proportion(rng, light):
    coefficients, _ = light
    rho = reciprocal(rng, DEGREE)
    field = convolution.reflect(coefficients[:, 0], rho)
    noise = 1e-4 * np.abs(field).max() * (rng.normal(size=field.shape) + 1j * rng.normal(size=field.shape))
    found = convolution.factor(field + noise, level=1e-2)
    scale = coefficients[0, 0].real * math.sqrt(4 * math.pi)
    error = np.linalg.norm(found.light - coefficients[:, 0] / scale) / np.linalg.norm(coefficients[:, 0] / scale)
    assert error < 1e-2  # a hundredfold of the noise: scales are chained from l = 0


def test_a_mirror_cannot_be_factored(light):  # RH 3.26: each degree has a scale of its own
    coefficients, _ = light
    found = convolution.factor(convolution.reflect(coefficients[:, 0], harmonic.mirror(DEGREE)))
    np.testing.assert_array_equal(found.known, [True, False, False, False, False])
    assert np.all(found.light[1:] == 0) and np.all(np.isfinite(found.transfer))


def test_degrees_above_the_exits_stay_open(rng, light):
    coefficients, _ = light
    found = convolution.factor(convolution.reflect(coefficients[:, 0], reciprocal(rng, DEGREE)[:, :3, :3]))
    np.testing.assert_array_equal(found.known, [True, True, True, False, False])


@pytest.mark.parametrize("dtype", ["complex64", "complex128"])
def test_tensors_pass(rng, light, dtype):
    torch = pytest.importorskip("torch")
    kind, real = getattr(torch, dtype), getattr(torch, {"complex64": "float32", "complex128": "float64"}[dtype])
    tolerance = {"complex64": 1e-4, "complex128": 1e-12}[dtype]  # 5e-7 of rounding, divided by what is small
    coefficients, _ = light
    rho, wo = smooth(rng, DEGREE, 3), exits(rng, 2)
    field = convolution.reflect(coefficients, rho)
    every = rng.normal(size=((DEGREE + 1) ** 2, 16))
    whole = convolution.reflect_anisotropic(coefficients, every)
    one, two, three = torch.tensor(coefficients, dtype=kind), torch.tensor(rho, dtype=real), torch.tensor(every)
    beta = torch.tensor([0.3, 1.0], dtype=real)
    tensors, all_tensors = convolution.reflect(one, two), convolution.reflect_anisotropic(one, three.to(real))
    pairs = [
        (tensors, field, kind),
        (all_tensors, whole, kind),
        (convolution.radiance(tensors, 1.0, beta, wo.tolist()), convolution.radiance(field, 1.0, [0.3, 1], wo), real),
        (
            convolution.radiance_anisotropic(all_tensors, 1.0, beta, 0.2, torch.tensor(wo, dtype=real)),
            convolution.radiance_anisotropic(whole, 1.0, [0.3, 1], 0.2, wo),
            real,
        ),
        (convolution.brdf_from_light(tensors, one).value, np.repeat(rho[..., None], 3, axis=-1), real),
        (convolution.light_from_brdf(tensors, two).value, coefficients, kind),
    ]
    for found, expected, wanted in pairs:
        assert isinstance(found, torch.Tensor) and found.dtype == wanted
        np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * np.abs(expected).max())
    with pytest.raises(ArrayError, match="NumPy"):
        convolution.factor(tensors)
    with pytest.raises(ArrayError, match="mixed"):
        convolution.reflect(one, rho)


def test_gradients_reach_light_and_brdf(rng, light):
    torch = pytest.importorskip("torch")
    one = torch.tensor(light[0], requires_grad=True)
    two = torch.tensor(smooth(rng, DEGREE, 3), requires_grad=True)
    B = convolution.radiance(convolution.reflect(one, two), 1.0, 0.3, exits(rng, 1)[0].tolist())
    B.sum().backward()
    # B is linear in either.
    np.testing.assert_allclose(torch.sum(two.grad * two.detach()), B.sum().detach(), rtol=1e-10)
    np.testing.assert_allclose(torch.sum(one.grad.conj() * one.detach()).real, B.sum().detach(), rtol=1e-10)


def test_the_lower_degree_counts(rng, light):
    coefficients, _ = light
    assert convolution.reflect(coefficients, smooth(rng, 2, 3)).shape == (9, 4, 3, 3)
    assert convolution.reflect(coefficients, smooth(rng, 9, 3)).shape == (25, 4, 4, 3)


def test_a_grey_brdf_reflects_coloured_light(rng, light):
    coefficients, _ = light
    rho = rng.normal(size=((DEGREE + 1) ** 2, 16))
    field = convolution.reflect_anisotropic(coefficients, rho)
    assert field.shape == (165, 16, 3)
    np.testing.assert_array_equal(field[..., 1], convolution.reflect_anisotropic(coefficients[:, 1], rho))


def test_bad_input_is_refused(rng, light):
    coefficients, _ = light
    rho = smooth(rng, DEGREE, 3)
    field = convolution.reflect(coefficients, rho)
    with pytest.raises(ArrayError, match="axes"):
        convolution.reflect(coefficients, rho[0])
    with pytest.raises(ArrayError, match="finite"):
        convolution.reflect(coefficients * np.nan, rho)
    with pytest.raises(ArrayError, match="channels"):
        convolution.reflect(coefficients, np.stack((rho, rho), axis=-1))
    with pytest.raises(ArrayError, match="degree 2"):
        convolution.brdf_from_light(field, coefficients[:9])
    with pytest.raises(ArrayError, match="meet"):
        convolution.light_from_brdf(field, rho[:, :2])
    with pytest.raises(ParameterError, match="level"):
        convolution.brdf_from_light(field, coefficients, level=0)
    with pytest.raises(ArrayError, match="no light"):
        convolution.factor(0 * field)
    with pytest.raises(ArrayError, match="1, 10, 35"):
        convolution.radiance_anisotropic(np.zeros((12, 4)), 0.0, 0.0, 0.0, [0, 0, 1.0])
