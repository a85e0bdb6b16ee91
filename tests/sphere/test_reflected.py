"""Facts about maps of the reflected light field."""

import numpy as np
import pytest

import gonio as gn
from gonio.sphere.convolution import radiance, radiance_anisotropic, reflect, reflect_anisotropic
from gonio.sphere.coupling import clebsch_gordan
from gonio.sphere.harmonics import complex_from_real, complex_harmonics, harmonics
from gonio.sphere.reflected import anisotropic_map, local_map, world_coefficients


def close(actual, expected, atol=1e-12):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=atol)


def light_and_transfer(rng, degree, exit_degree, channels=3):
    transfer = rng.normal(size=(degree + 1, exit_degree + 1, min(degree, exit_degree) + 1, channels))
    for l in range(degree + 1):
        for p in range(exit_degree + 1):
            transfer[l, p, min(l, p) + 1 :] = 0
    return rng.normal(size=((degree + 1) ** 2, channels)), transfer


def field_at(light, transfer, grid, wo):
    """RH 2.54 at the grid's directions towards local `wo`: sums of Wigner's functions."""
    alpha, beta = np.broadcast_arrays(grid.theta[:, None], grid.phi)
    return radiance(reflect(complex_from_real(light), transfer), alpha, beta, wo)


def in_world(grid, wo):
    frames = gn.euler(*np.broadcast_arrays(grid.theta[:, None], grid.phi, 0.0))
    return np.einsum("rcij,rcj->rci", frames, wo)


@pytest.mark.parametrize(("degree", "exit_degree"), [(7, 3), (2, 4), (5, 0), (0, 2)])
def test_world_coefficients_are_the_reflected_light_field(degree, exit_degree, rng):
    light, transfer = light_and_transfer(rng, degree, exit_degree)
    grid = gn.LatLong(9, 14)
    wo = gn.normalise(rng.normal(size=(*grid.shape, 3)))
    coefficients = world_coefficients(light, transfer)
    facing = harmonics(degree + exit_degree, grid.directions())
    eye = harmonics(exit_degree, in_world(grid, wo))
    close(np.einsum("rcj,jtk,rct->rck", facing, coefficients, eye), field_at(light, transfer, grid, wo))


def test_local_maps_are_the_reflected_light_field(rng):
    light, transfer = light_and_transfer(rng, 6, 3)
    grid = gn.LatLong(13, 18)
    wo = gn.normalise(rng.normal(size=(*grid.shape, 3)))
    eye = complex_harmonics(3, wo)
    total = 0
    for p in range(4):
        for q in range(p + 1):
            # q and -q are each other's conjugates.
            part = np.real(local_map(light, transfer, grid, p, q) * eye[..., p * (p + 1) + q, None])
            total = total + (2 if q else 1) * part
    close(total, field_at(light, transfer, grid, wo))


def test_a_transfer_without_high_q_needs_no_zeros_there(rng):
    light, transfer = light_and_transfer(rng, 5, 3)
    transfer[:, :, 2:] = 0
    close(world_coefficients(light, transfer[:, :, :2]), world_coefficients(light, transfer))


def test_one_grey_light_serves_coloured_brdfs(rng):
    light, transfer = light_and_transfer(rng, 4, 2)
    grey = world_coefficients(light[:, :1], transfer)
    close(grey, world_coefficients(np.repeat(light[:, :1], 3, axis=1), transfer))


def test_single_precision_keeps_its_digits(rng):
    light, transfer = light_and_transfer(rng, 12, 3)
    single = world_coefficients(light.astype(np.float32), transfer.astype(np.float32))
    assert single.dtype == np.float32
    double = world_coefficients(light, transfer)
    # Sums of a few dozen terms of alternating sign.
    assert np.max(np.abs(single - double)) < 1e-5 * np.max(np.abs(double))


def test_tensors_are_answered_in_kind(rng):
    torch = pytest.importorskip("torch")
    light, transfer = light_and_transfer(rng, 6, 2)
    answer = world_coefficients(torch.asarray(light), torch.asarray(transfer))
    close(answer.numpy(), world_coefficients(light, transfer))


@pytest.mark.parametrize("shape", [(4, 3, 3), (3, 3, 3, 3), (4, 2, 3, 3)])
def test_transfers_that_do_not_fit_are_refused(shape):
    with pytest.raises(gn.GonioError, match=r"expected \(\(F\+1\)"):
        world_coefficients(np.zeros((16, 3)), np.zeros(shape))


@pytest.mark.parametrize(("l", "p"), [(3, 2), (60, 5), (200, 8)])
def test_clebsch_gordan_coefficients_are_orthonormal(l, p):
    m, s = np.arange(-l, l + 1)[:, None], np.arange(-p, p + 1)
    total = sum(clebsch_gordan(l, m, p, s, j) ** 2 for j in range(l - p, l + p + 1))
    # Long doubles have 80 bits on some machines, 64 on others.
    close(total, np.ones((2 * l + 1, 2 * p + 1)), atol=1e-12)


def test_products_of_wigner_functions_are_their_sums():
    l, p, q, angle = 7, 3, 2, 0.7
    first, second = gn.wigner_d(l, angle), gn.wigner_d(p, angle)
    for m, s in ((2, 1), (-5, -3), (0, 2)):
        total = sum(
            clebsch_gordan(l, m, p, -s, j) * clebsch_gordan(l, q, p, -q, j) * gn.wigner_d(j, angle)[j + m - s, j]
            for j in range(l - p, l + p + 1)
            if abs(m - s) <= j
        )
        close(total, first[l + m, l + q] * second[p - s, p - q])


def test_anisotropic_maps_are_the_reflected_light_field(rng):
    grid, degree, exit_degree = gn.LatLong(9, 14), 4, 2
    light = rng.normal(size=(25, 3))
    transfer = rng.normal(size=(25, 9, 3)) + 1j * rng.normal(size=(25, 9, 3))
    # A real BRDF: rho_l-k,p-q = (-1)^(k + q) conj rho_lk,pq.
    for l in range(degree + 1):
        for p in range(exit_degree + 1):
            for k in range(-l, l + 1):
                for q in range(-p, p + 1):
                    mirror = np.conj(transfer[l * (l + 1) + k, p * (p + 1) + q]) * (-1.0) ** (k + q)
                    transfer[l * (l + 1) - k, p * (p + 1) - q] = mirror if (k, q) != (0, 0) else mirror.real
    gamma = rng.uniform(-3, 3, grid.shape)
    wo = gn.normalise(rng.normal(size=(*grid.shape, 3)))
    alpha, beta = np.broadcast_arrays(grid.theta[:, None], grid.phi)
    field = reflect_anisotropic(complex_from_real(light), transfer)
    expected = radiance_anisotropic(field, alpha, beta, gamma, wo)
    maps = anisotropic_map(light, transfer, grid, gamma)
    found = np.einsum("rct,rctk->rck", complex_harmonics(exit_degree, wo), maps)
    close(found, expected, atol=1e-11)


def test_brushed_metal_along_a_field_of_tangents_is_the_integral_over_the_light(rng):
    from gonio.brdf.harmonic import anisotropic_transfer

    brdf, degree, exit_degree = gn.Ward(0.5, 0.35, 0.8), 6, 12
    grid = gn.LatLong(26, 52)
    light = np.asarray(gn.studio(64).harmonics(degree), float)
    gamma = np.broadcast_to(0.8 * grid.phi, grid.shape)
    maps = anisotropic_map(light, anisotropic_transfer(brdf, degree, exit_degree), grid, gamma)
    fine = gn.LatLong(64, 128)
    w, E = (
        fine.directions().reshape(-1, 3),
        gn.synthesis(light, fine).reshape(-1, 3) * np.repeat(fine.weights, 128)[:, None],
    )
    local = gn.normalise(np.array([0.3, -0.2, 0.9]))
    eye = complex_harmonics(exit_degree, local)
    found, exact = [], []
    for r, c in ((3, 5), (12, 20), (20, 41)):
        frame = gn.euler(grid.theta[r], grid.phi[c], gamma[r, c]).T
        f = brdf.f(w @ frame.T, local) * np.maximum(w @ frame[2], 0)[:, None]
        found.append(np.real(eye @ maps[r, c]))
        exact.append((f * E).sum(axis=0))
    # Exits below the surface are black, an edge about which degree 12 rings by some per cent of what is brightest.
    np.testing.assert_allclose(found, exact, atol=0.02 * np.max(exact))


def test_tangents_that_do_not_fit_the_grid_are_refused():
    with pytest.raises(gn.GonioError, match="gamma have shapes"):
        anisotropic_map(np.zeros((9, 3)), np.zeros((9, 4, 3), complex), gn.LatLong(6, 12), np.zeros((6, 6)))
