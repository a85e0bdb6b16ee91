"""The reflected light field as harmonics of where the surface faces, one set for each harmonic of where the eye is.

    B(n, wo) = sum over p, s of B_ps(n) Y_ps(wo)

With wo in the frame (e_theta, e_phi, n) of the surface, (alpha, beta) the direction of n (RH 5.9, 5.10):

    B_pq(n) = sum over l, m of L_lm rho_lpq D^l_mq(alpha, beta)         a function of spin -q: q turns with the frame

With wo in the world's frame (RH 5.11, 5.14) each B_ps is a plain function, without seam or swirl at the poles, since
Y_ps(wo in the surface's frame) = sum over s of conj D^p_sq Y_ps(wo), and products of Wigner's functions are sums:

    B_ps(n) = sum over j, M of c_jM Y_jM(n),   c_jM = (-1)^s sum over l of <l M+s p -s | j M> kappa_lpj L_l,M+s
    kappa_lpj = Lambda_j sum over q of (-1)^q <l q p -q | j 0> rho_lpq             j = l - p, l - p + 2, ..., l + p

so that (P+1)^2 scalar transforms make all maps, and the coefficients are the light field itself. `n` may be any
direction that the BRDF's coefficients are counted from, as the mirror direction is in `brdf/harmonic.py`.

A BRDF that is not isotropic sees a tangent too, turned by gamma from e_theta (RH 2.43); one map of spin -k for each
order k of the light in the surface's frame, and no transform over rotations:

    B_pq(n, gamma) = sum over k of e^{i k gamma} sum over l, m of L_lm rho_lk,pq D^l_mk(alpha, beta)
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from .._kernels import coupling as kernels
from ..arrays import Array, floats, is_numpy, like
from ..errors import ArrayError
from .coupling import clebsch_gordan
from .grids import Grid
from .harmonics import complex_from_real, degree_of, degrees_and_orders
from .transform import synthesis_spin
from .wigner import big_lambda


def world_coefficients(light: Array, transfer: Array) -> Array:
    """c_jM of every B_ps in real harmonics of both: ((F+P+1)^2, (P+1)^2, C), `index` order in j, M and in p, s.

    light: real coefficients ((F+1)^2, C). transfer: rho_lpq (F+1, P+1, Q+1, C), as in `convolution.py`; either C may
    be 1. Raises `ArrayError` for shapes that do not fit.
    """
    xp, light, transfer = _fitting(light, transfer)
    degree, exit_degree = degree_of(light), transfer.shape[1] - 1
    coupling = _coupling(degree, exit_degree, transfer.shape[2] - 1, str(light.dtype) if is_numpy(light) else "float64")
    L = complex_from_real(light)
    # kappa (p, i, l, C) from rho (l, p, q, C), j = l + p - 2 i
    kappa = xp.sum(
        like(coupling.kappa, light)[..., None] * xp.permute_dims(transfer, (1, 0, 2, 3))[:, None, ...], axis=3
    )
    if is_numpy(L, kappa):
        parts = np.ascontiguousarray(np.stack((L.real, L.imag)).mT)
        channels = max(L.shape[1], kappa.shape[3])
        real = np.empty((coupling.weight.shape[2], (exit_degree + 1) ** 2, channels), light.dtype)
        kernels.couple(parts, kappa, coupling.weight, real)
        return real
    L = xp.concat((L, xp.zeros_like(L[:1, :])), axis=0)
    kappa = xp.reshape(kappa, (-1, kappa.shape[-1]))
    light_at, kappa_at = (xp.asarray(x, device=light.device) for x in _places(degree, exit_degree))
    weight = like(coupling.weight, light)[..., None]
    coefficients: Any = 0.0
    for i in range(exit_degree + 1):
        part = xp.take(kappa, xp.reshape(kappa_at[i, ...], (-1,)), axis=0) * xp.reshape(weight[i, ...], (-1, 1))
        coefficients = coefficients + part * xp.take(L, xp.reshape(light_at[i, ...], (-1,)), axis=0)
    coefficients = xp.reshape(coefficients, (*coupling.weight.shape[1:], -1))
    return _real(xp, coefficients, exit_degree)


def local_map(light: Array, transfer: Array, grid: Grid, p: int, q: int) -> Array:
    """B_pq of RH 5.9 on `grid`, q >= 0: complex (rows, columns, C). B_p,-q = (-1)^q conj B_pq.

    Arguments as in `world_coefficients`.
    """
    xp, light, transfer = _fitting(light, transfer)
    degree = degree_of(light)
    l = degrees_and_orders(degree)[0]
    scale = like((-1.0) ** q * big_lambda(degree), light)[:, None] * transfer[:, p, q, :]
    return synthesis_spin(
        xp.take(scale, xp.asarray(l, device=light.device), axis=0) * complex_from_real(light), grid, -q
    )


def anisotropic_map(light: Array, transfer: Array, grid: Grid, gamma: Array) -> Array:
    """B_pq of RH 2.43 on `grid`, for a field of tangents: complex (rows, columns, (P+1)^2, C), `index` order in p, q.

    light: real coefficients ((F+1)^2, C). transfer: rho_lk,pq ((F+1)^2, (P+1)^2, C), complex, of
    `brdf.harmonic.anisotropic_transfer`. gamma (rows, columns), radians, from e_theta towards e_phi to the tangent. The
    exit directions are local, in the frame of the tangent. Raises `ArrayError` for shapes that do not fit.
    """
    xp, gamma = floats(gamma)
    _, light = floats(light)
    degree = degree_of(light)
    shapes = tuple(light.shape), tuple(transfer.shape), tuple(gamma.shape)
    if light.ndim != 2 or transfer.ndim != 3 or transfer.shape[0] < light.shape[0] or shapes[2] != grid.shape:
        raise ArrayError(
            f"light, transfer and gamma have shapes {shapes[0]}, {shapes[1]} and {shapes[2]}; expected ((F+1)^2, C), "
            f"((F+1)^2, (P+1)^2, C) and {grid.shape}."
        )
    l, _ = degrees_and_orders(degree)
    L = complex_from_real(light)[:, None, :]
    total: Any = 0.0
    for k in range(-degree, degree + 1):
        # rho_lk of every l, m; there is none where l < k.
        place = xp.asarray(np.clip(l * (l + 1) + k, 0, light.shape[0] - 1), device=light.device)
        scale = like(np.where(l >= abs(k), (-1.0) ** k * big_lambda(degree)[l], 0), light)[:, None, None]
        c = scale * xp.take(transfer, place, axis=0) * L
        maps = synthesis_spin(xp.reshape(c, (c.shape[0], -1)), grid, -k)
        turn = xp.cos(k * gamma) + 1j * xp.sin(k * gamma)
        total = total + turn[..., None, None] * xp.reshape(maps, (*grid.shape, *c.shape[1:]))
    return total


def _fitting(light: Array, transfer: Array) -> tuple[Any, Array, Array]:
    xp, light, transfer = floats(light, transfer)
    degree = degree_of(light)
    if light.ndim != 2 or transfer.ndim != 4 or transfer.shape[0] <= degree or transfer.shape[2] > transfer.shape[1]:
        raise ArrayError(
            f"light has shape {tuple(light.shape)}, transfer {tuple(transfer.shape)}; expected ((F+1)^2, C) and "
            "(F+1, P+1, Q+1, C), Q <= P."
        )
    return xp, light, transfer[: degree + 1, ...]


class _Coupling(NamedTuple):
    """What L kappa counts in c_jM, for each term i of the sum over l (j = l + p - 2 i), each p, s >= 0 and each j, M:
    <l M+s p -s | j M>, times sqrt2 where s > 0. So Re and -Im of the sums are the real B_ps and B_p,-s, whose signs
    (-1)^s cancel those of c_jM. `kappa` (p, i, l, q): what rho_lpq counts in kappa_lpj."""

    weight: np.ndarray
    kappa: np.ndarray


@lru_cache(maxsize=8)
def _coupling(degree: int, exit_degree: int, highest: int, dtype: str) -> _Coupling:
    l = np.arange(degree + 1)[:, None]
    q = np.arange(highest + 1)
    kappa = np.zeros((exit_degree + 1, exit_degree + 1, degree + 1, highest + 1))
    for p in range(exit_degree + 1):
        for i in range(p + 1):
            j = l + p - 2 * i
            both = np.where(q > 0, 2.0, 1.0) * (-1.0) ** q * clebsch_gordan(l, q, p, -q, j)
            kappa[p, i] = both * np.sqrt(4 * math.pi / (2 * np.maximum(j, 0) + 1))
    j, M = degrees_and_orders(degree + exit_degree)
    sets = _sets(exit_degree)
    weight = np.zeros((exit_degree + 1, len(sets), j.size))
    for k, (p, s) in enumerate(sets):
        for i in range(p + 1):
            l = j - p + 2 * i
            coefficient = clebsch_gordan(l, M + s, p, np.array(-s), j)  # 0 where there is none
            weight[i, k] = np.where(l <= degree, coefficient, 0) * (math.sqrt(2) if s else 1)
    return _Coupling(weight.astype(dtype), kappa)


@lru_cache(maxsize=8)
def _places(degree: int, exit_degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Where L and kappa of each weight stand, for array code, which takes them by index; beyond L's last is none."""
    j, M = degrees_and_orders(degree + exit_degree)
    sets = _sets(exit_degree)
    shape = exit_degree + 1, len(sets), j.size
    light_at, kappa_at = np.full(shape, (degree + 1) ** 2), np.zeros(shape, np.int64)
    for k, (p, s) in enumerate(sets):
        for i in range(p + 1):
            l = j - p + 2 * i
            exists = (l >= 0) & (l <= degree) & (np.abs(M + s) <= l)
            light_at[i, k] = np.where(exists, l * (l + 1) + M + s, (degree + 1) ** 2)
            kappa_at[i, k] = (p * (exit_degree + 1) + i) * (degree + 1) + np.clip(l, 0, degree)
    return light_at, kappa_at


def _sets(exit_degree: int) -> list[tuple[int, int]]:
    """p and s >= 0, in the order of the weights."""
    return [(p, s) for p in range(exit_degree + 1) for s in range(p + 1)]


def _real(xp: Any, coefficients: Array, exit_degree: int) -> Array:
    """Real coefficients ((J+1)^2, (P+1)^2, C) of Re and, at -s, of -Im of functions given by complex ones, (sets of p,
    s >= 0, (J+1)^2, C)."""
    degree = math.isqrt(coefficients.shape[1]) - 1
    j, M = degrees_and_orders(degree)
    mirror = xp.asarray(j * (j + 1) - M, device=coefficients.device)
    reflected = xp.conj(xp.take(coefficients, mirror, axis=1)) * like((-1.0) ** M, xp.real(coefficients))[:, None]
    # Complex coefficients of the real functions 2 Re B and 2 Im B, and from them real ones: at M >= 0 (-1)^M sqrt2
    # times the real part, at -M minus that times the imaginary part.
    both, less = coefficients + reflected, coefficients - reflected
    norm = like(np.where(M == 0, 0.5, math.sqrt(0.5) * (-1.0) ** M), xp.real(coefficients))[:, None]
    ahead = xp.asarray((M >= 0)[:, None], device=coefficients.device)
    real = xp.where(ahead, xp.real(both), -xp.take(xp.imag(both), mirror, axis=1)) * norm
    imaginary = xp.where(ahead, xp.imag(less), xp.take(xp.real(less), mirror, axis=1)) * norm
    parts: list[Any] = [None] * (exit_degree + 1) ** 2
    for k, (p, s) in enumerate(_sets(exit_degree)):
        parts[p * (p + 1) + s] = real[k, ...]
        if s:
            parts[p * (p + 1) - s] = -imaginary[k, ...]
    return xp.stack(parts, axis=1)
