import math

import numba
import numpy as np
import pytest
from reference import wigner as reference

import gonio as gn
from gonio._kernels import wigner as kernel
from gonio.errors import ArrayError, DirectionError, ParameterError
from gonio.frames import euler, euler_angles, rotation_y, rotation_z

compiled = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="takes minutes where loops are not compiled")


@pytest.mark.parametrize("degree", [0, 1, 2, 9])
@pytest.mark.parametrize("alpha", [0.0, 0.3, math.pi / 2, 2.7, math.pi])
def test_the_kernel_follows_wigners_sum(rng, degree, alpha):
    # The explicit sum rounds at 1e-13 for degree 9.
    coefficients = rng.normal(size=(degree + 1) ** 2)
    expected = reference.rotate(coefficients, alpha, 0.4, -1.3)
    np.testing.assert_allclose(gn.rotate(coefficients, euler(alpha, 0.4, -1.3)), expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("degree", [1, 6, 40])
def test_turning_coefficients_is_looking_elsewhere(rng, degree):
    coefficients = rng.normal(size=((degree + 1) ** 2, 3))
    R = euler(2.1, -0.6, 0.9)
    w = gn.normalise(rng.normal(size=(50, 3)))
    values = gn.harmonics(degree, w) @ gn.rotate(coefficients, R)
    # f'(w) = f(R^T w); sums of degree^2 terms of size one.
    np.testing.assert_allclose(
        values, gn.harmonics(degree, w @ R) @ coefficients, rtol=0, atol=1e-13 * (degree + 1) ** 2
    )


def test_what_stood_at_a_direction_stands_at_the_turned_direction():
    towards_x = gn.harmonics(8, [1.0, 0, 0])  # a peak at +x
    np.testing.assert_allclose(gn.rotate(towards_x, rotation_z(np.pi / 2)), gn.harmonics(8, [0, 1.0, 0]), atol=1e-14)
    np.testing.assert_allclose(gn.rotate(towards_x, rotation_y(np.pi / 2)), gn.harmonics(8, [0, 0, -1.0]), atol=1e-14)


def test_two_rotations_make_one(rng):
    coefficients = rng.normal(size=(31**2, 3))
    one, two = euler(0.4, 2.0, -1.0), euler(2.9, 0.1, 0.7)
    # 30 steps of rounding on coefficients of size one.
    np.testing.assert_allclose(
        gn.rotate(gn.rotate(coefficients, one), two), gn.rotate(coefficients, two @ one), rtol=0, atol=1e-12
    )


def test_no_rotation_changes_nothing(rng):
    coefficients = rng.normal(size=31**2)
    np.testing.assert_allclose(gn.rotate(coefficients, np.eye(3)), coefficients, rtol=0, atol=1e-13)


@compiled
def test_turning_there_and_back_changes_nothing(rng):
    coefficients = rng.normal(size=(201**2, 1))
    R = euler(1.2, 0.3, 5.0)
    np.testing.assert_allclose(gn.rotate(gn.rotate(coefficients, R), R.T), coefficients, rtol=0, atol=1e-12)


@compiled
def test_each_degree_keeps_its_energy(rng):
    coefficients = rng.normal(size=(513**2, 1))
    turned = gn.rotate(coefficients, euler(0.02, 1.0, 2.0))
    np.testing.assert_allclose(gn.power_spectrum(turned), gn.power_spectrum(coefficients), rtol=1e-11)


@pytest.mark.parametrize("degree", [3, 40])
def test_ducc_turns_alike(rng, degree):
    ducc0 = pytest.importorskip("ducc0")
    coefficients = rng.normal(size=(degree + 1) ** 2)
    alpha, beta, gamma = 1.0, 0.4, -2.0
    # ducc keeps m >= 0 of the complex coefficients, order by order; psi is the first turn, phi the last.
    f = gn.sphere.harmonics.complex_from_real(coefficients)
    order = [l * (l + 1) + m for m in range(degree + 1) for l in range(m, degree + 1)]
    turned = ducc0.sht.rotate_alm(f[order], degree, gamma, alpha, beta)
    expected = gn.sphere.harmonics.complex_from_real(gn.rotate(coefficients, euler(alpha, beta, gamma)))[order]
    np.testing.assert_allclose(turned, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_tensors_turn_alike_in_their_dtype(rng, dtype):
    torch = pytest.importorskip("torch")
    values = rng.normal(size=(13**2, 3))
    R = euler(2.0, 0.4, 1.0)
    turned = gn.rotate(torch.tensor(values, dtype=getattr(torch, dtype)), torch.tensor(R))
    assert turned.dtype == getattr(torch, dtype)
    tolerance = 1e-6 if dtype == "float32" else 1e-12  # rounding of the coefficients, of size one
    np.testing.assert_allclose(turned, gn.rotate(values, R), rtol=0, atol=tolerance)


def test_gradients_reach_coefficients_and_rotation(rng):
    torch = pytest.importorskip("torch")
    values = torch.tensor(rng.normal(size=16), requires_grad=True)
    R = torch.tensor(euler(2.0, 0.4, 1.0), requires_grad=True)
    gn.rotate(values, R)[10].backward()
    # The answer is linear in the coefficients.
    np.testing.assert_allclose(
        float(values.grad @ values.detach()), float(gn.rotate(values, R)[10].detach()), rtol=1e-12
    )
    assert bool(torch.all(torch.isfinite(R.grad))) and float(torch.abs(R.grad).max()) > 0


@pytest.mark.parametrize("alpha", [0.0, 1e-9, 0.4, math.pi / 2, math.pi])
def test_the_kernel_finds_the_angles_of_rh_2_10(alpha):
    R = euler(alpha, -2.0, 0.7)
    *found, error = kernel.angles(R)
    np.testing.assert_allclose(euler(*found), R, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found, [float(a) for a in euler_angles(R)], rtol=0, atol=1e-12)
    assert error < 1e-28
    assert kernel.angles(np.diag([1.0, 1, -1]))[-1] > 1


@pytest.mark.parametrize("size", [1e-150, 1e150])
def test_large_and_small_coefficients_turn_alike(rng, size):
    # The kernel scales its rows by 2^900; what it turns must neither overflow with them nor vanish.
    coefficients, R = rng.normal(size=(36, 3)), euler(0.7, 0.1, 2.0)
    np.testing.assert_allclose(gn.rotate(size * coefficients, R), size * gn.rotate(coefficients, R), rtol=1e-12)


def test_single_precision_is_kept(rng):
    coefficients = rng.normal(size=(9, 3)).astype(np.float32)
    assert gn.rotate(coefficients, np.eye(3)).dtype == np.float32


def test_bad_input_is_refused(rng):
    with pytest.raises(ArrayError, match="degree"):
        gn.rotate(np.zeros(8), np.eye(3))
    with pytest.raises(ArrayError, match="shape"):
        gn.rotate(np.zeros((9, 3, 2)), np.eye(3))
    with pytest.raises(ArrayError, match="real"):
        gn.rotate(np.zeros(9, dtype=complex), np.eye(3))
    with pytest.raises(DirectionError, match="mirrors"):
        gn.rotate(np.zeros(9), np.diag([1.0, 1, -1]))
    with pytest.raises(DirectionError, match="shape"):
        gn.rotate(np.zeros(9), np.zeros((2, 3, 3)))
    with pytest.raises(DirectionError, match="orthonormal"):
        gn.rotate(np.zeros(9), np.full((3, 3), np.nan))
    with pytest.raises(DirectionError, match="orthonormal"):
        gn.rotate(np.zeros(9), 2 * np.eye(3))
    with pytest.raises(ParameterError, match="1500"):
        gn.rotate(np.zeros((1502**2, 1)), np.eye(3))
