import os

import numpy as np
import pytest
from reference import legendre as plain
from reference import moments as plain_moments

import gonio as gn
from gonio._kernels import moments
from gonio.sphere.grids import GaussLegendre, LatLong
from gonio.sphere.legendre import folded_recursion, spin_recursion


def close(actual, expected, atol):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=atol)


GRIDS = [
    (LatLong(20, 40), 9),  # plain quadrature
    (LatLong(21, 31), 9),  # an equator, odd columns
    (LatLong(20, 40), 10),  # one degree above what Fejer's weights integrate
    (LatLong(20, 40), 19),  # the highest a grid can tell apart
    (LatLong(21, 41), 20),
    (GaussLegendre(9), 9),
    (LatLong(1, 1), 0),
    (LatLong(20, 40), 8),  # few degrees: one pass over the image
    (LatLong(9, 14), 4),
]
LARGE = [(LatLong(256, 512), 30), (GaussLegendre(200), 200), (LatLong(201, 402), 200)]
SPINS = [0, 1, -2, 5]

compiled = pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="too large for uncompiled kernels")


def coefficients(rng, degree, spin=None, channels=2):
    f = rng.normal(size=((degree + 1) ** 2, channels))
    if spin is None:
        return f
    f = f + 1j * rng.normal(size=f.shape)
    f[: spin * spin] = 0
    return f


@pytest.mark.parametrize(("grid", "degree"), GRIDS)
def test_synthesis_is_the_sum_of_harmonics(grid, degree, rng):
    f = coefficients(rng, degree)
    close(gn.synthesis(f, grid), gn.harmonics(degree, grid.directions()) @ f, atol=1e-12)


@pytest.mark.parametrize("spin", [0, 1, -1, 2, -3])
def test_synthesis_is_the_sum_of_spin_weighted_harmonics(spin, rng):
    grid, degree = LatLong(9, 15), 5
    f = coefficients(rng, degree, spin, 1)[:, 0]
    theta, phi = grid.theta[:, None], grid.phi[None, :]
    expected = sum(
        f[l * (l + 1) + m] * plain.spin_weighted(spin, l, m, theta, phi)
        for l in range(abs(spin), degree + 1)
        for m in range(-l, l + 1)
    )
    close(gn.synthesis_spin(f, grid, spin), expected, atol=1e-13)


@pytest.mark.parametrize(("grid", "degree"), [*GRIDS, *(pytest.param(*large, marks=compiled) for large in LARGE)])
def test_analysis_undoes_synthesis(grid, degree, rng):
    f = coefficients(rng, degree, channels=3)
    close(gn.analysis(gn.synthesis(f, grid), grid, degree), f, atol=1e-12)


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(
    ("grid", "degree"), [*GRIDS[:6], *(pytest.param(*large, marks=compiled) for large in LARGE[1:])]
)
def test_analysis_undoes_synthesis_with_spin(grid, degree, spin, rng):
    f = coefficients(rng, degree, spin, 1)
    close(gn.analysis_spin(gn.synthesis_spin(f, grid, spin), grid, degree, spin), f, atol=1e-12)


def test_low_coefficients_are_exact_where_degrees_add_up_to_less_than_the_rows(rng):
    f = coefficients(rng, 27)
    grid = LatLong(30, 60)
    close(gn.analysis(gn.synthesis(f, grid), grid, 2), f[:9], atol=1e-13)


@pytest.mark.parametrize("grid", [LatLong(20, 40), LatLong(21, 40), GaussLegendre(9)])
def test_analysis_is_the_adjoint_of_synthesis_under_the_weights(grid, rng):
    values, f = rng.normal(size=grid.shape), coefficients(rng, 9, channels=1)[:, 0]
    inner = np.sum(grid.weights[:, None] * values * gn.synthesis(f, grid))
    assert inner == pytest.approx(np.sum(gn.analysis(values, grid, 9) * f), rel=1e-12)
    values, z = values + 1j * rng.normal(size=grid.shape), coefficients(rng, 9, 2, 1)[:, 0]
    inner = np.sum(grid.weights[:, None] * values * np.conj(gn.synthesis_spin(z, grid, 2)))
    assert inner == pytest.approx(np.sum(gn.analysis_spin(values, grid, 9, 2) * np.conj(z)), rel=1e-12)


def test_spin_0_is_the_scalar_transform(rng):
    from gonio.sphere.harmonics import complex_from_real

    f, grid = coefficients(rng, 9), LatLong(20, 40)
    close(gn.synthesis_spin(complex_from_real(f), grid, 0), gn.synthesis(f, grid), atol=1e-13)


def test_conjugation_turns_the_spin(rng):
    # conj(sY_lm) = (-1)^(s + m) {-s}Y_{l,-m}
    grid, f = LatLong(10, 21), coefficients(rng, 6, 2, 1)[:, 0]
    mirrored = np.array([(-1) ** (2 + m) * np.conj(f[l * (l + 1) - m]) for l in range(7) for m in range(-l, l + 1)])
    expected = np.conj(gn.synthesis_spin(f, grid, 2))
    close(gn.synthesis_spin(mirrored, grid, -2), expected, atol=1e-13)


@compiled
def test_degree_600_neither_overflows_nor_drowns(rng):
    # At high order the functions start below 1e-300 and still reach 1 at a higher degree.
    grid, degree = GaussLegendre(600), 600
    f = coefficients(rng, degree, channels=1)
    w = grid.directions()[[0, 3, 60, 300, 590], [0, 7, 100, 600, 1199]]
    values = gn.synthesis(f, grid)
    at = values[[0, 3, 60, 300, 590], [0, 7, 100, 600, 1199]]
    close(at, gn.harmonics(degree, w) @ f, atol=1e-9)
    close(gn.analysis(values, grid, degree), f, atol=1e-11)


@compiled
def test_transforms_agree_with_ducc(rng):
    ducc0 = pytest.importorskip("ducc0")
    from gonio.sphere.harmonics import complex_from_real

    degree, grid = 100, LatLong(128, 256)
    f = coefficients(rng, degree, channels=1)[:, 0]
    c = complex_from_real(f)
    alm = np.concatenate([[c[l * (l + 1) + m] for l in range(m, degree + 1)] for m in range(degree + 1)])
    expected = ducc0.sht.synthesis_2d(
        alm=alm[None], spin=0, lmax=degree, geometry="F1", ntheta=128, nphi=256, phi0=np.pi / 256
    )[0]
    # A rounding of cos theta grows by degree^2 near the poles, where values reach 60.
    close(gn.synthesis(f, grid), expected, atol=1e-10)


@compiled
def test_float32_stays_float32_and_is_accurate(rng):
    grid, f = LatLong(128, 256), coefficients(rng, 60)
    values = gn.synthesis(f.astype(np.float32), grid)
    back = gn.analysis(values, grid, 60)
    assert values.dtype == back.dtype == np.float32
    # 3,721 terms of size 1, each rounded to 6e-8, add up to values of size 17.
    close(values, gn.synthesis(f, grid), atol=5e-5)
    close(back, f, atol=1e-5)
    z = coefficients(rng, 60, 2).astype(np.complex64)
    assert gn.analysis_spin(gn.synthesis_spin(z, grid, 2), grid, 60, 2).dtype == np.complex64


@pytest.mark.parametrize("degree", [0, 1, 2, 3, 10])
def test_channels_do_not_meet(degree, rng):
    grid, values = LatLong(24, 48), rng.normal(size=(24, 48, 5))
    together = gn.analysis(values, grid, degree)
    apart = np.stack([gn.analysis(values[..., k], grid, degree) for k in range(5)], axis=-1)
    close(together, apart, atol=1e-14)
    close(
        gn.synthesis(together, grid), np.stack([gn.synthesis(apart[:, k], grid) for k in range(5)], axis=-1), atol=1e-13
    )


@pytest.mark.parametrize(("grid", "degree"), [(LatLong(20, 40), 9), (LatLong(21, 41), 20), (GaussLegendre(9), 9)])
def test_torch_gives_what_numpy_gives(grid, degree, rng):
    torch = pytest.importorskip("torch")
    f, z = coefficients(rng, degree), coefficients(rng, degree, 2)
    values, spun = gn.synthesis(f, grid), gn.synthesis_spin(z, grid, 2)
    close(gn.synthesis(torch.as_tensor(f), grid).numpy(), values, atol=1e-12)
    close(gn.analysis(torch.as_tensor(values), grid, degree).numpy(), f, atol=1e-12)
    close(gn.synthesis_spin(torch.as_tensor(z), grid, 2).numpy(), spun, atol=1e-12)
    close(gn.analysis_spin(torch.as_tensor(spun), grid, degree, 2).numpy(), z, atol=1e-12)
    assert gn.synthesis(torch.as_tensor(f).float(), grid).dtype == torch.float32


def test_gradients_flow_through_torch(rng):
    torch = pytest.importorskip("torch")
    f = torch.zeros(16, dtype=torch.float64, requires_grad=True)
    target = torch.as_tensor(rng.normal(size=(8, 16)))
    torch.sum(gn.synthesis(f, LatLong(8, 16)) * target).backward()
    expected = np.einsum("rc,rci->i", target.numpy(), gn.harmonics(3, LatLong(8, 16).directions()))
    close(f.grad.numpy(), expected, atol=1e-12)


def test_gradients_flow_after_inference_with_the_same_tables():
    torch = pytest.importorskip("torch")
    grid, f = LatLong(10, 20), torch.ones(9, dtype=torch.float64)
    with torch.inference_mode():
        gn.synthesis(f.clone(), grid)
    f.requires_grad_()
    gn.synthesis(f, grid)[0, 0].backward()
    close(f.grad.numpy(), gn.harmonics(2, grid.directions()[0, 0]), atol=1e-13)


@pytest.mark.parametrize("recursion", [folded_recursion(LatLong(24, 48), 21), spin_recursion(LatLong(24, 48), 21, 2)])
def test_kernels_agree_with_the_plain_recursion(recursion, rng):
    parts = recursion.start, recursion.level, recursion.a, recursion.b, recursion.scale, recursion.t
    orders, steps = recursion.a.shape
    f = rng.normal(size=(orders, steps, 8)) * (np.arange(steps)[None, :, None] < recursion.count[:, None, None])
    close(recursion.synthesise(f), plain.synthesise(f, *parts), atol=1e-12)
    rings = rng.normal(size=(orders, 8, recursion.t.size))
    inside = np.arange(steps)[None, :, None] < recursion.count[:, None, None]
    close(np.where(inside, recursion.analyse(rings), 0), np.where(inside, plain.analyse(rings, *parts), 0), atol=1e-12)
    table = plain.three_term(*(x[3] for x in parts[:5]), recursion.t)
    close(recursion.table(3)[: recursion.count[3]], table[: recursion.count[3]], atol=1e-13)


@compiled
@pytest.mark.parametrize(("degree", "spin"), [(300, None), (300, 0), (300, 3), (700, None)])
def test_what_the_kernels_leave_out_is_negligible(degree, spin):
    # Of values that reach sqrt(degree): no digit of a float64, to spare.
    grid = GaussLegendre(degree)
    recursion = folded_recursion(grid, degree) if spin is None else spin_recursion(grid, degree, spin)
    skipped = 0
    for m in range(0, degree + 1, 50):
        table, first, stop = recursion.table(m), recursion.first[m], recursion.stop[m]
        skipped += table.shape[1] - (stop - first)
        outside = np.concatenate((table[:, :first], table[:, stop:]), axis=1)
        assert np.max(np.abs(outside), initial=0) < 1e-20
    assert skipped > 0


@pytest.mark.parametrize(("rows", "width"), [(6, 5), (7, 5), (2, 1030)])
def test_kernels_of_few_degrees_agree_with_the_plain_sums(rows, width, rng):
    half, plane = (rows + 1) // 2, np.array([0, 3, 1, 2, 0])
    image, functions = rng.normal(size=(rows, 2 * width)), rng.normal(size=(5, half))
    if rows % 2:
        functions[[1, 3], -1] = 0  # what is odd about the equator vanishes there
    sums, waves = np.empty((5, width)), rng.normal(size=(5, width))
    moments.moments(image, functions, plane, sums)
    close(sums, plain_moments.moments(image, functions, plane), atol=1e-13)
    moments.spread(waves, functions, plane, image)
    close(image, plain_moments.spread(waves, functions, plane, rows), atol=1e-13)


class TestRefusals:
    grid = LatLong(8, 16)

    def test_a_degree_beyond_the_grid(self):
        with pytest.raises(gn.GonioError, match=r"degree 8 is more than .* can carry \(7\)"):
            gn.analysis(np.zeros((8, 16)), self.grid, 8)
        with pytest.raises(gn.GonioError, match="can carry"):
            gn.synthesis(np.zeros(100), self.grid)

    def test_values_that_do_not_lie_on_the_grid(self):
        for shape in ((16, 8), (8, 16, 3, 1), (8,)):
            with pytest.raises(gn.GonioError, match="values have shape"):
                gn.analysis(np.zeros(shape), self.grid, 3)

    def test_values_that_are_not_finite_are_named(self):
        values = np.zeros((8, 16, 3))
        values[2, 5, 1] = np.nan
        for degree in (0, 2, 7):
            with pytest.raises(gn.GonioError, match=r"values\[2, 5, 1\] is nan"):
                gn.analysis(values, self.grid, degree)
        with pytest.raises(gn.GonioError, match=r"values\[2, 5, 1\] is nan"):
            gn.analysis_spin(values, self.grid, 3, 1)

    def test_coefficients_that_are_not_finite_are_named(self):
        with pytest.raises(gn.GonioError, match=r"coefficients\[3\] is inf"):
            gn.synthesis([0, 0, 0, np.inf], self.grid)

    def test_coefficients_of_another_shape(self):
        with pytest.raises(gn.GonioError, match="must hold"):
            gn.synthesis(np.zeros(5), self.grid)
        with pytest.raises(gn.GonioError, match="channels"):
            gn.synthesis(np.zeros((4, 2, 2)), self.grid)

    def test_complex_values_in_the_real_transform(self):
        with pytest.raises(gn.GonioError, match="real"):
            gn.analysis(np.zeros((8, 16), complex), self.grid, 3)

    def test_a_spin_above_the_degree(self):
        with pytest.raises(gn.GonioError, match="spin = 4"):
            gn.analysis_spin(np.zeros((8, 16)), self.grid, 3, 4)
