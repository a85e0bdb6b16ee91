"""Facts about irradiance from harmonic coefficients (RH 4)."""

import numpy as np
import pytest

import gonio as gn
from gonio.directions import from_spherical, normalise
from gonio.rendering.irradiance import irradiance, irradiance_coefficients, irradiance_matrix
from gonio.sphere.harmonics import harmonics


def directions(rng, count=64):
    return normalise(rng.normal(size=(count, 3)))


def test_the_matrix_and_the_series_are_the_same_polynomial(rng):
    light = rng.normal(size=(9, 3))
    n = directions(rng)
    M = irradiance_matrix(light)
    homogeneous = np.concatenate((n, np.ones((len(n), 1))), axis=-1)
    quadratic = np.einsum("pi,cij,pj->pc", homogeneous, M, homogeneous)
    # Two ways to the same quadratic polynomial: rounding alone lies between them.
    np.testing.assert_allclose(quadratic, irradiance(light, n), atol=1e-13)


def test_the_matrix_is_made_of_the_constants_printed_in_RH_4_15():
    constants = {4: (0.429043, 0), 8: (0.429043, 0), 3: (0.511664, 0), 6: (0.743125, 0), 0: (0.886227, 0)}
    places = {4: (0, 1), 8: (0, 0), 3: (0, 3), 6: (2, 2), 0: (3, 3)}
    for k, (constant, _) in constants.items():
        light = np.zeros((9, 1))
        light[k] = 1
        # Printed with six decimals, the last of c2 and c3 off by one.
        assert irradiance_matrix(light)[0][places[k]] == pytest.approx(constant, abs=1.5e-6)


def test_irradiance_under_light_of_degree_two_is_the_hemispherical_integral(rng):
    light = rng.normal(size=(9, 3))
    n = directions(rng, 5)
    # Midpoint rule over the sphere, error of order step^2 at the clamped cosine's kink: 1e-5 at 1,000 rows.
    rows, columns = 1000, 2000
    theta = (np.arange(rows) + 0.5) * np.pi / rows
    phi = (np.arange(columns) + 0.5) * 2 * np.pi / columns
    w = from_spherical(theta[:, None], phi[None, :]).reshape(-1, 3)
    area = np.repeat(np.sin(theta), columns) * (np.pi / rows) * (2 * np.pi / columns)
    L = harmonics(2, w) @ light
    brute = np.maximum(n @ w.T, 0) * area @ L
    np.testing.assert_allclose(irradiance(light, n), brute, atol=2e-4)


def test_uniform_light_gives_pi_times_its_radiance_everywhere(rng):
    light = np.zeros((9, 1))
    light[0] = np.sqrt(4 * np.pi)
    np.testing.assert_allclose(irradiance(light, directions(rng)), np.pi, rtol=1e-14)


def test_irradiance_keeps_the_odd_degrees_above_one_at_zero(rng):
    E = irradiance_coefficients(rng.normal(size=(16, 3)))
    assert np.all(E[9:16] == 0)


def test_the_matrix_refuses_other_than_nine_coefficients():
    with pytest.raises(gn.GonioError, match="nine coefficients"):
        irradiance_matrix(np.zeros((16, 3)))


def test_tensors_are_answered_with_tensors(rng):
    torch = pytest.importorskip("torch")
    light, n = rng.normal(size=(9, 3)), directions(rng)
    answer = irradiance(torch.tensor(light), torch.tensor(n))
    assert isinstance(answer, torch.Tensor)
    np.testing.assert_allclose(answer.numpy(), irradiance(light, n), atol=1e-13)
    np.testing.assert_allclose(irradiance_matrix(torch.tensor(light)).numpy(), irradiance_matrix(light), atol=1e-15)
