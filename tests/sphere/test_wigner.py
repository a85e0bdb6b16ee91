import numba
import numpy as np
import pytest
from reference import wigner as reference

import gonio as gn
from gonio._kernels import wigner as kernel
from gonio.errors import MemoryLimitError, ParameterError
from gonio.frames import euler
from gonio.sphere.harmonics import index
from gonio.sphere.wigner import big_lambda

compiled = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="takes minutes where loops are not compiled")
ANGLES = [0.0, 1e-6, 0.3, np.pi / 2, 2.0, 3.1, np.pi, -0.7, 7.0]


@pytest.mark.parametrize("degree", [0, 1, 2, 5, 8])
@pytest.mark.parametrize("angle", ANGLES)
def test_the_recursion_gives_wigners_sum(degree, angle):
    # The sum's terms cancel: at l = 8 they reach 1e3, so its own rounding is about 1e-13.
    np.testing.assert_allclose(gn.wigner_d(degree, angle), reference.wigner_d(degree, angle), rtol=0, atol=1e-12)


def test_degree_one_is_printed_in_rh_2_34():
    a = 0.4
    c, s, r = np.cos(a / 2) ** 2, np.sin(a / 2) ** 2, np.sin(a) / np.sqrt(2)
    np.testing.assert_allclose(gn.wigner_d(1, a), [[c, r, s], [-r, np.cos(a), r], [s, -r, c]], rtol=0, atol=1e-15)


@compiled
@pytest.mark.parametrize("angle", [1e-8, 1e-3, 0.3, np.pi / 2, 2.9, np.pi - 1e-5])
def test_d_is_orthogonal_at_degree_512(angle):
    # Rounding grows in proportion to the 512 steps of the recursion, and most, 5e-12, near the identity.
    d = gn.wigner_d(512, angle)
    np.testing.assert_allclose(d @ d.T, np.eye(1025), rtol=0, atol=1e-10)


@compiled
def test_the_highest_degree_keeps_its_digits():
    # Row norms touch every entry; the smallest starts of the recursion lie at 1e-480 here.
    d = gn.wigner_d(1500, 0.8)
    np.testing.assert_allclose(np.sum(d * d, axis=0), 1, rtol=0, atol=1e-10)


def test_turning_back_is_the_transpose():
    np.testing.assert_allclose(gn.wigner_d(6, -0.8), gn.wigner_d(6, 0.8).T, rtol=0, atol=1e-14)


def test_two_turns_make_one():
    np.testing.assert_allclose(gn.wigner_d(40, 0.8) @ gn.wigner_d(40, 1.7), gn.wigner_d(40, 2.5), rtol=0, atol=1e-12)


def test_harmonics_mix_by_D_when_the_sphere_turns(rng):
    degree, angles = 7, (1.1, -0.4, 2.3)
    w = gn.normalise(rng.normal(size=(20, 3)))
    turned = gn.complex_harmonics(degree, w @ euler(*angles).T)
    still = gn.complex_harmonics(degree, w)
    for l in range(degree + 1):
        part = slice(l * l, (l + 1) ** 2)
        np.testing.assert_allclose(turned[:, part], still[:, part] @ gn.wigner_D(l, *angles).T, rtol=0, atol=1e-13)


def test_the_middle_column_is_a_harmonic():  # RH 2.35
    l, alpha, beta = 9, 0.7, 1.9
    y = gn.complex_harmonics(l, [np.sin(alpha) * np.cos(beta), np.sin(alpha) * np.sin(beta), np.cos(alpha)])
    middle = gn.wigner_D(l, alpha, beta, 0.3)[:, l]
    np.testing.assert_allclose(middle, big_lambda(l)[l] * y[index(l, -l) :], rtol=0, atol=1e-13)


def test_angles_broadcast():
    D = gn.wigner_D(3, np.zeros((4, 1)) + 0.2, np.linspace(0, 1, 5))
    assert D.shape == (4, 5, 7, 7)
    np.testing.assert_array_equal(D[2, 3], gn.wigner_D(3, 0.2, 0.75))


def test_all_degrees_at_once_are_those_one_by_one():
    packed = np.empty(1 + 9 + 25 + 49)
    kernel.matrices(3, 0, 0.9, packed)
    np.testing.assert_array_equal(packed, np.concatenate([gn.wigner_d(l, 0.9).ravel() for l in range(4)]))


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_tensors_get_the_same_d(dtype):
    torch = pytest.importorskip("torch")
    angle = torch.tensor([0.0, 0.4, 2.2], dtype=getattr(torch, dtype))
    d = gn.wigner_d(20, angle)
    assert d.dtype == angle.dtype
    # float32 angles alone are off by 1e-7, twenty times that at degree 20.
    tolerance = 1e-12 if dtype == "float64" else 2e-5
    np.testing.assert_allclose(d, gn.wigner_d(20, angle.numpy().astype(float)), rtol=0, atol=tolerance)
    assert gn.wigner_D(3, angle, 0.5).dtype == (torch.complex64 if dtype == "float32" else torch.complex128)


def test_d_carries_gradients_to_the_angle():
    torch = pytest.importorskip("torch")
    angle = torch.tensor(0.4, dtype=torch.float64, requires_grad=True)
    gn.wigner_d(5, angle)[7, 3].backward()
    slope = (gn.wigner_d(5, 0.4 + 1e-5)[7, 3] - gn.wigner_d(5, 0.4 - 1e-5)[7, 3]) / 2e-5
    assert abs(float(angle.grad) - slope) < 1e-8


@pytest.mark.parametrize("degree", [-1, 1.5, "two", 1501])
def test_degrees_that_are_none_are_refused(degree):
    with pytest.raises(ParameterError, match="degree"):
        gn.wigner_d(degree, 0.1)


def test_memory_is_checked_before_it_is_taken():
    with pytest.raises(MemoryLimitError, match=r"1000000 matrices of degree 500"):
        gn.wigner_d(500, np.zeros(1_000_000))
    with pytest.raises(MemoryLimitError, match="limit"):
        gn.wigner_D(10, np.zeros(100), 0.0, memory_limit=1000)
