import math

import numpy as np
import pytest

import gonio as gn
from gonio.brdf import harmonic as brdf_harmonic
from gonio.errors import ArrayError, DirectionError, ParameterError
from gonio.lights import harmonic
from gonio.sphere import convolution, zonal
from gonio.sphere.harmonics import complex_from_real


def test_a_source_lights_a_plane_by_the_cosine(rng):
    w = gn.normalise([0.3, -0.2, 0.9])
    light = harmonic.directional(200, w, [1.0, 2.0, 3.0])
    n = gn.normalise(rng.normal(size=(20, 3)))
    E = gn.harmonics(200, n) @ zonal.convolve(light, zonal.clamped_cosine(200))
    # What is cut off above degree 200 falls as l^-3/2.
    np.testing.assert_allclose(E, np.maximum(n @ w, 0)[:, None] * [1, 2, 3], rtol=0, atol=5e-3)


def test_a_source_at_the_pole_reads_out_the_brdf():  # RH 3.14, 3.15
    rho = brdf_harmonic.transfer(gn.Lambert(0.5), 6, 5)
    light = complex_from_real(harmonic.directional(6, [0, 0, 1.0]))
    field = convolution.reflect(light, rho)
    for l in range(7):
        np.testing.assert_allclose(field[l * l + l], rho[l], rtol=0, atol=1e-14)
        np.testing.assert_allclose(np.delete(field[l * l : (l + 1) ** 2], l, axis=0), 0, rtol=0, atol=1e-14)


def test_an_axial_light_is_its_profile_about_its_axis(rng):
    axis = gn.normalise([1.0, 2.0, -0.5])
    w = gn.normalise(rng.normal(size=(30, 3)))
    light = harmonic.axial(axis, zonal.coefficients(4, lambda t: 1 + np.cos(t) ** 4))
    np.testing.assert_allclose(gn.harmonics(4, w) @ light, 1 + (w @ axis) ** 4, rtol=0, atol=1e-9)


def test_an_axial_light_about_z_has_m_0_alone():  # RH 3.18
    light = harmonic.axial([0, 0, 1.0], zonal.gaussian(5, [0.2, 0.4]))
    _, m = gn.sphere.harmonics.degrees_and_orders(5)
    np.testing.assert_allclose(light[m != 0], 0, rtol=0, atol=1e-15)
    # A source blurred is an axial light.
    blurred = zonal.convolve(harmonic.directional(5, [0, 0, 1.0]), zonal.gaussian(5, [0.2, 0.4]))
    np.testing.assert_allclose(light, blurred, rtol=1e-13, atol=1e-15)


def test_uniform_light_is_the_same_everywhere(rng):
    w = gn.normalise(rng.normal(size=(10, 3)))
    light = harmonic.uniform(3, [2.0, 0.0, 1.0])
    np.testing.assert_allclose(gn.harmonics(3, w) @ light, np.tile([2.0, 0, 1], (10, 1)), rtol=0, atol=1e-14)
    assert harmonic.uniform(3).shape == (16,)


def test_under_uniform_light_a_white_matte_surface_is_as_bright(rng):  # RH 3.20, 3.22
    light = complex_from_real(harmonic.uniform(4, 1 / math.sqrt(4 * math.pi)))
    field = convolution.reflect(light, brdf_harmonic.transfer_at(gn.Lambert(1.0), 4, [0.3, 1.2]))
    np.testing.assert_allclose(field[1:], 0, rtol=0, atol=1e-14)
    # B = B_00(theta_o) / (sqrt(2 pi) Lambda_0): the light's own 1 / Lambda_0 times an albedo of one.
    B = field[0, :, 0, 0].real / math.sqrt(2 * math.pi) / math.sqrt(4 * math.pi)
    np.testing.assert_allclose(B, 1 / math.sqrt(4 * math.pi), rtol=1e-12)


def test_tensors_pass():
    torch = pytest.importorskip("torch")
    light = harmonic.directional(3, torch.tensor([0.0, 0.6, 0.8]), 2.0)
    assert light.dtype == torch.float32
    np.testing.assert_allclose(light, harmonic.directional(3, [0.0, 0.6, 0.8], 2.0), rtol=0, atol=1e-6)
    assert harmonic.uniform(2, torch.tensor([1.0, 2.0])).shape == (9, 2)
    assert harmonic.axial(torch.tensor([0.0, 0.6, 0.8]), torch.ones(4)).shape == (16,)


def test_bad_lights_are_refused():
    with pytest.raises(DirectionError, match="direction"):
        harmonic.directional(3, [0, 0, 2.0])
    with pytest.raises(ArrayError, match="one light"):
        harmonic.directional(3, [[0, 0, 1.0]])
    with pytest.raises(ParameterError, match="irradiance"):
        harmonic.directional(3, [0, 0, 1.0], -1.0)
    with pytest.raises(ParameterError, match="radiance"):
        harmonic.uniform(3, [np.nan, 1.0])
    with pytest.raises(ArrayError, match="kernel"):
        harmonic.axial([0, 0, 1.0], np.zeros((2, 2, 2)))
