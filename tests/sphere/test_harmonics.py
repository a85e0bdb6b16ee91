import numpy as np
import pytest

import gonio as gn
from gonio.sphere.harmonics import complex_from_real, degree_of, degrees_and_orders, index, real_from_complex


def close(actual, expected, atol):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=atol)


@pytest.fixture
def directions(rng):
    w = rng.normal(size=(20, 3))
    return np.concatenate([w / np.linalg.norm(w, axis=1, keepdims=True), [[0, 0, 1], [0, 0, -1], [1, 0, 0]]])


def test_real_harmonics_are_the_polynomials_of_rh_4_5(directions):
    x, y, z = directions.T
    expected = np.stack(
        [
            np.full_like(x, np.sqrt(1 / (4 * np.pi))),
            *(np.sqrt(3 / (4 * np.pi)) * c for c in (y, z, x)),
            *(np.sqrt(15 / (4 * np.pi)) * c for c in (x * y, y * z)),
            np.sqrt(5 / (16 * np.pi)) * (3 * z**2 - 1),
            np.sqrt(15 / (4 * np.pi)) * x * z,
            np.sqrt(15 / (16 * np.pi)) * (x**2 - y**2),
        ],
        axis=-1,
    )
    close(gn.harmonics(2, directions), expected, atol=1e-15)


@pytest.mark.parametrize("harmonics", [gn.harmonics, gn.complex_harmonics])
def test_harmonics_are_orthonormal(harmonics):
    grid = gn.GaussLegendre(12)
    Y = harmonics(12, grid.directions())
    gram = np.einsum("rci,rcj,r->ij", Y, Y.conj(), grid.weights)
    close(gram, np.eye(13**2), atol=1e-13)


def test_addition_theorem(directions):
    # sum over m of Y_lm(a) Y_lm(b) = (2l + 1) / (4 pi) P_l(a.b)
    Y = gn.harmonics(8, directions)
    cosine = directions @ directions.T
    for l in range(9):
        band = Y[:, l * l : (l + 1) ** 2]
        expected = (2 * l + 1) / (4 * np.pi) * np.polynomial.Legendre.basis(l)(cosine)
        close(band @ band.T, expected, atol=1e-13)


def test_every_degree_to_1000_has_its_energy(directions):
    # The sum over m of |Y_lm|^2 is (2l + 1) / (4 pi) everywhere. At a pole a rounding grows by l^2, to 1e-10.
    energy = gn.power_spectrum(gn.harmonics(1000, directions[[0, 5, 20, 22]]).T)
    expected = (2 * np.arange(1001) + 1) / (4 * np.pi)
    np.testing.assert_allclose(energy, np.repeat(expected[:, None], 4, axis=1), rtol=1e-10)


def test_complex_harmonics_agree_with_scipy_to_degree_1000(directions):
    special = pytest.importorskip("scipy.special")
    w = np.concatenate([directions[:3], [[np.sin(1e-3), 0, np.cos(1e-3)]]])
    l, m = degrees_and_orders(1000)
    some = np.random.default_rng(5).choice(l.size, 3000, replace=False)
    theta, phi = np.arctan2(np.hypot(w[:, 0], w[:, 1]), w[:, 2]), np.arctan2(w[:, 1], w[:, 0])
    expected = special.sph_harm_y(l[some], m[some], theta[:, None], phi[:, None])
    # SciPy is lost or NaN where its unnormalised functions leave the range of a float.
    known = np.isfinite(expected) & (np.abs(m[some]) < 700) & (theta[:, None] > 0.1)
    assert np.mean(known) > 0.2
    # Roundings of theta grow by l^2 near the poles: 1e-16 to 1e-10.
    close(gn.complex_harmonics(1000, w)[:, some][known], expected[known], atol=1e-9)


def test_real_and_complex_coefficients_are_the_same_function(directions, rng):
    f = rng.normal(size=(49, 2))
    c = complex_from_real(f)
    close(gn.complex_harmonics(6, directions) @ c, gn.harmonics(6, directions) @ f, atol=1e-13)
    close(real_from_complex(c), f, atol=1e-15)
    np.testing.assert_allclose(gn.power_spectrum(c), gn.power_spectrum(f), rtol=1e-13)


def test_order_of_coefficients():
    l, m = degrees_and_orders(3)
    assert [index(a, b) for a, b in zip(l, m, strict=True)] == list(range(16))
    assert degree_of(np.zeros((16, 3))) == 3


def test_harmonics_keep_float32_and_its_accuracy(directions):
    Y = gn.harmonics(30, directions.astype(np.float32))
    assert Y.dtype == np.float32
    assert gn.complex_harmonics(3, directions.astype(np.float32)).dtype == np.complex64
    # A float32 direction is 6e-8 off, and slopes reach degree^(3/2).
    close(Y, gn.harmonics(30, directions), atol=2e-5)


def test_torch_gives_what_numpy_gives(directions, rng):
    torch = pytest.importorskip("torch")
    w = torch.as_tensor(directions)
    close(gn.harmonics(7, w).numpy(), gn.harmonics(7, directions), atol=1e-14)
    close(gn.complex_harmonics(7, w).numpy(), gn.complex_harmonics(7, directions), atol=1e-14)
    assert gn.harmonics(7, w.float()).dtype == torch.float32
    f = torch.as_tensor(rng.normal(size=(49, 2)))
    close(real_from_complex(complex_from_real(f)).numpy(), f.numpy(), atol=1e-15)


def test_gradients_are_finite_at_the_poles():
    torch = pytest.importorskip("torch")
    w = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64, requires_grad=True)
    gn.harmonics(3, w)[0, index(1, 1)].backward()
    close(w.grad.numpy(), [[np.sqrt(3 / (4 * np.pi)), 0, 0]], atol=1e-15)


def test_what_is_refused():
    with pytest.raises(gn.GonioError, match=r"directions\[1\] has length 2"):
        gn.harmonics(2, [[0, 0, 1], [0, 0, 2]])
    with pytest.raises(gn.GonioError, match="degree = -1"):
        gn.harmonics(-1, [0, 0, 1])
    with pytest.raises(gn.GonioError, match=r"\(5,\)"):
        degree_of(np.zeros(5))
    with pytest.raises(gn.GonioError, match="real function"):
        real_from_complex(np.array([1, 1j, 0, 0]))
