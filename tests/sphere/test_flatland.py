import math

import numpy as np
import pytest

from gonio.errors import ArrayError, ParameterError
from gonio.sphere import flatland


def glossy(theta_i, theta_o):
    return 0.2 + np.exp(-8 * (theta_i + theta_o) ** 2)


def lights(rng, degree):
    half = rng.normal(size=degree) + 1j * rng.normal(size=degree)
    return np.concatenate((half, [1.5], np.conj(half[::-1])))


def test_analysis_undoes_synthesis(rng):
    light = lights(rng, 6)
    theta = -math.pi + 2 * math.pi / 13 * np.arange(13)
    np.testing.assert_allclose(flatland.analysis(flatland.synthesis(light, theta), 6), light, rtol=0, atol=1e-13)


def test_lamberts_cosine_has_its_closed_form():
    # Integral of cos(theta) exp(i k theta) over the half circle: 2 cos(k pi/2) / (1 - k^2), pi/2 at k = +-1.
    found = flatland.transfer(lambda i, o: 0 * i + 0 * o + 1, 4, 0)[:, 0] * 2
    k = np.array([-4, -2, 0, 2, 4])
    np.testing.assert_allclose(found[k + 4], 2 * np.cos(k * math.pi / 2) / (1 - k**2), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found[[3, 5]], math.pi / 2, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found[[1, 7]], 0, rtol=0, atol=1e-12)


def test_reflection_is_convolution(rng):  # RH 2.24 against RH 2.6
    light = lights(rng, 5)
    field = flatland.reflect(light, flatland.transfer(glossy, 5, 40))
    alpha, theta_o = np.array([0.3, -2.0]), np.array([0.5, -0.2])
    theta = (np.arange(20000) + 0.5) / 20000 * math.pi - math.pi / 2  # a midpoint sum, not Gauss's
    rho = glossy(theta, theta_o[:, None]) * np.cos(theta)
    brute = np.sum(flatland.synthesis(light, alpha[:, None] + theta) * rho, axis=1) * (math.pi / 20000)
    # The series in theta_o converges as 1/p^2 or slower, since rho ends at the horizon; hold theta_o instead: RH 2.25.
    samples = flatland.reflect(light, at_exits(theta_o))
    found = np.einsum("kl,lk->k", flatland.synthesis(np.eye(11), alpha), samples)
    np.testing.assert_allclose(found, brute, rtol=0, atol=1e-7)
    np.testing.assert_allclose(flatland.radiance(field, alpha, theta_o), brute, rtol=0, atol=0.05)


def at_exits(theta_o):
    nodes, weights = np.polynomial.legendre.leggauss(200)
    theta = nodes * math.pi / 2
    waves = np.exp(1j * np.arange(-5, 6)[:, None] * theta) / math.sqrt(2 * math.pi)
    return (waves * weights * (math.pi / 2) * np.cos(theta)) @ glossy(theta[:, None], theta_o)


def test_light_and_brdf_come_back_from_the_field(rng):
    light, transfer = lights(rng, 5), flatland.transfer(glossy, 5, 8)
    field = flatland.reflect(light, transfer)
    found = flatland.light_from_brdf(field, transfer)
    assert found.known.all()
    np.testing.assert_allclose(found.value, light, rtol=1e-12)
    np.testing.assert_allclose(flatland.brdf_from_light(field, light).value, transfer, rtol=0, atol=1e-13)


def test_what_lambert_swallows_is_masked_not_guessed(rng):
    transfer = flatland.transfer(lambda i, o: 0 * i + 0 * o + 1, 5, 3)
    found = flatland.light_from_brdf(flatland.reflect(lights(rng, 5), transfer), transfer)
    np.testing.assert_array_equal(found.known, [False, True, False, True, True, True, True, True, False, True, False])
    assert np.all(found.value[~found.known] == 0)


def test_tensors_pass(rng):
    torch = pytest.importorskip("torch")
    light, transfer = lights(rng, 5), flatland.transfer(glossy, 5, 8)
    field = flatland.reflect(light, transfer)
    one, two = torch.tensor(light), torch.tensor(transfer)
    alpha = torch.tensor([0.3, -2.0], dtype=torch.float64)
    tensor_field = flatland.reflect(one, two)
    theta = -math.pi + 2 * math.pi / 13 * np.arange(13)
    pairs = [
        (tensor_field, field),
        (flatland.radiance(tensor_field, alpha, 0.5), flatland.radiance(field, [0.3, -2.0], 0.5)),
        (flatland.brdf_from_light(tensor_field, one).value, transfer),
        (flatland.light_from_brdf(tensor_field, two).value, light),
        (flatland.analysis(torch.tensor(np.cos(theta)), 6), flatland.analysis(np.cos(theta), 6)),
        (flatland.synthesis(one, alpha), flatland.synthesis(light, [0.3, -2.0])),
    ]
    for found, expected in pairs:
        assert isinstance(found, torch.Tensor) and found.dtype == torch.complex128
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
    assert flatland.synthesis(one.to(torch.complex64), alpha).dtype == torch.complex64


def test_bad_input_is_refused():
    with pytest.raises(ArrayError, match="degree 3"):
        flatland.analysis(np.zeros(6), 3)
    with pytest.raises(ParameterError, match="samples"):
        flatland.transfer(glossy, 9, 3, samples=8)
    with pytest.raises(ArrayError, match="odd"):
        flatland.synthesis(np.zeros(4), 0.1)
    with pytest.raises(ArrayError, match="meet"):
        flatland.reflect(np.zeros(3), np.zeros((5, 5)))
    with pytest.raises(ArrayError, match="field"):
        flatland.radiance(np.zeros(3), 0.1, 0.1)
    with pytest.raises(ArrayError, match="differ"):
        flatland.light_from_brdf(np.zeros((3, 3)), np.zeros((3, 5)))
