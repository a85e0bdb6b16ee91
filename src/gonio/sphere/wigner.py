"""Wigner's functions: how spherical harmonics of one degree mix when the sphere turns.

    Y_lm(R w) = sum over k of D^l_mk(alpha, beta, gamma) Y_lk(w),    R = R_z(beta) R_y(alpha) R_z(gamma)     (RH 2.29)
    D^l_mk(alpha, beta, gamma) = e^{i m beta} d^l_mk(alpha) e^{i k gamma}                                   (RH 2.31)

d^l is real and orthogonal, d^l(-alpha) = d^l(alpha)^T; rows and columns run m, k = -l..l ascending, as RH 2.34 prints.
RH's D(alpha, beta, gamma) is the complex conjugate of the D(beta, alpha, gamma) of quantum mechanics; d is the same.
Also D^l_m0(alpha, beta, gamma) = Lambda_l Y_lm(alpha, beta), Lambda_l = sqrt(4 pi / (2l+1))            (RH 2.35, 2.51)

Functions are turned in `rotation.py`, which never forms these matrices.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from .._kernels import wigner as kernel
from ..arrays import Array, floats, is_numpy, like
from ..errors import MEMORY_LIMIT, MemoryLimitError, ParameterError
from .harmonics import require_degree

# Beyond it the smallest starts of the recursion leave float64, and rows the kernel's room.
HIGHEST_DEGREE = 1500


def wigner_d(degree: int, angle: Array, memory_limit: int = MEMORY_LIMIT) -> Array:
    """d^l(angle) of the one degree l = `degree`: angles (...) in radians -> (..., 2l+1, 2l+1). RH 2.33.

    Orthogonal to 1e-11 at degree 512. Raises `ParameterError` above degree 1500, `MemoryLimitError` where the
    matrices would take more than `memory_limit` bytes.
    """
    require_degree_of_d(degree)
    xp, angle = floats(angle)
    n = 2 * degree + 1
    _require_memory(degree, math.prod(angle.shape), 8, memory_limit)
    if not is_numpy(angle):
        return _by_quarter_turns(xp, degree, angle)
    d = np.empty((*angle.shape, n * n))
    for at in np.ndindex(angle.shape):
        kernel.matrices(degree, degree, float(angle[at]), d[at])
    return d.reshape(*angle.shape, n, n).astype(angle.dtype, copy=False)


def wigner_D(degree: int, alpha: Array, beta: Array, gamma: Array = 0.0, memory_limit: int = MEMORY_LIMIT) -> Array:
    """D^l(alpha, beta, gamma) of the one degree l = `degree`: angles in radians -> complex (..., 2l+1, 2l+1).

    RH 2.31; the angles are those of `frames.euler`. Raises as `wigner_d` does.
    """
    require_degree_of_d(degree)
    xp, alpha, beta, gamma = floats(alpha, beta, gamma)
    alpha, beta, gamma = xp.broadcast_arrays(alpha, beta, gamma)
    _require_memory(degree, math.prod(alpha.shape), 16, memory_limit)
    m = like(np.arange(-degree, degree + 1.0), alpha)
    turn = m[:, None] * beta[..., None, None] + m * gamma[..., None, None]
    return wigner_d(degree, alpha, memory_limit) * (xp.cos(turn) + 1j * xp.sin(turn))


def big_lambda(degree: int) -> np.ndarray:
    """Lambda_l = sqrt(4 pi / (2l+1)) for l = 0..degree, (degree+1,). RH 2.51."""
    require_degree(degree)
    root: np.ndarray = np.sqrt(4 * math.pi / (2 * np.arange(degree + 1) + 1))
    return root


def quarter_turns(degree: int) -> tuple[np.ndarray, ...]:
    """d^l(pi/2) for l = 0..degree, each (2l+1, 2l+1), read-only, kept for the next call.

    Between two of them every turn about y is a turn about z, which needs no matrix: the way of array libraries
    other than NumPy, and of gradients with respect to the angles.
    """
    require_degree_of_d(degree)
    _require_memory(degree, degree // 3 + 1, 8, MEMORY_LIMIT)  # (2l+1)^2 summed over l is a third of the last by l
    return _quarter_turns(degree)


@functools.lru_cache(maxsize=4)
def _quarter_turns(degree: int) -> tuple[np.ndarray, ...]:
    count = degree + 1
    packed = np.empty(count * (2 * count - 1) * (2 * count + 1) // 3)
    kernel.matrices(degree, 0, math.pi / 2, packed)
    packed.flags.writeable = False
    ends = np.cumsum((2 * np.arange(count) + 1) ** 2)
    return tuple(packed[e - (2 * l + 1) ** 2 : e].reshape(2 * l + 1, 2 * l + 1) for l, e in enumerate(ends))


def _by_quarter_turns(xp: Array, degree: int, angle: Array) -> Array:
    """d_mk(angle) = i^(m-k) sum over j of d_jm(pi/2) e^{-i j angle} d_jk(pi/2): real, so cosines or sines alone."""
    m = np.arange(-degree, degree + 1)
    quarter = like(quarter_turns(degree)[degree], angle)
    phase = like(m, angle) * angle[..., None]
    cosines = xp.matrix_transpose(quarter) @ (xp.cos(phase)[..., None] * quarter)
    sines = xp.matrix_transpose(quarter) @ (xp.sin(phase)[..., None] * quarter)
    power = (m[:, None] - m) % 4  # i^power: 1, i, -1, -i, and -i sines where the power is odd
    return like([1.0, 0.0, -1.0, 0.0], angle)[power] * cosines + like([0.0, 1.0, 0.0, -1.0], angle)[power] * sines


def require_degree_of_d(degree: int) -> None:
    """Raises `ParameterError` where `degree` is not an integer from 0 to 1500."""
    require_degree(degree)
    if degree > HIGHEST_DEGREE:
        raise ParameterError(f"degree = {degree} is above {HIGHEST_DEGREE}, the highest at which d^l keeps its digits.")


def _require_memory(degree: int, count: int, size: int, limit: int) -> None:
    needed = count * (2 * degree + 1) ** 2 * size
    if needed > limit:
        raise MemoryLimitError(
            f"{count} matrices of degree {degree} take {needed / 1e9:.1f} GB, the limit is {limit / 1e9:.1f} GB. "
            "Ask for a lower degree or fewer angles at a time."
        )
