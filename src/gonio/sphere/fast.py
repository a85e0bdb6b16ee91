"""The real transforms of NumPy arrays, by the kernels: the rows in pieces, then the sums over theta a few orders at a
time, so that what lies between the steps stays in the cache.

The same steps as array code, for other libraries, stand in `folding.py`, `packing.py` and `transform.py`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .._kernels import packing as kernels
from .azimuth import turns
from .grids import Grid
from .legendre import folded_recursion, odd_factors
from .quadrature import weighted

_PIECE = 2**19  # bytes taken at once: of values by the Fourier transform, of rings by the sums over theta


def analyse(values: np.ndarray, grid: Grid, degree: int) -> np.ndarray:
    """((degree + 1)^2, C) from values (rows, columns, C)."""
    from scipy.fft import rfft

    channels, kind = values.shape[2], _complex_kind(values.dtype)
    waves = np.empty((grid.rows, degree + 1, channels), kind)
    for rows in _pieces(grid.rows, values[0].nbytes):
        waves[rows] = rfft(values[rows], axis=1)[:, : degree + 1]
    recursion = folded_recursion(grid, degree)
    factors = odd_factors(degree, recursion.a.shape[1])
    turn = turns(degree, grid.columns, -1).astype(kind)
    coefficients = np.empty(((degree + 1) ** 2, channels), values.dtype)
    for orders in _orders(degree, 4 * channels * recursion.t.size * values.itemsize):
        rings = np.empty((orders.stop - orders.start, 4 * channels, recursion.t.size), values.dtype)
        kernels.fold(waves, turn, orders.start, rings)
        weighted(rings[:, : 2 * channels], grid, degree, 0, 0)
        weighted(rings[:, 2 * channels :], grid, degree, 0, 1)
        kernels.unpack(recursion.analyse(rings, orders), degree, *factors, orders.start, coefficients)
    return coefficients


def synthesise(coefficients: np.ndarray, grid: Grid, degree: int) -> np.ndarray:
    """Values (rows, columns, C) from coefficients ((degree + 1)^2, C)."""
    from scipy.fft import irfft

    channels, kind = coefficients.shape[1], _complex_kind(coefficients.dtype)
    recursion = folded_recursion(grid, degree)
    factors = odd_factors(degree, recursion.a.shape[1])
    cosines = np.cos(grid.theta[: recursion.t.size]).astype(coefficients.dtype)
    # irfft counts every m > 0 twice.
    turn = (turns(degree, grid.columns, 1) * np.where(np.arange(degree + 1) > 0, 0.5, 1)).astype(kind)
    waves = np.empty((grid.rows, degree + 1, channels), kind)
    for orders in _orders(degree, 4 * channels * recursion.t.size * coefficients.itemsize):
        packed = np.empty((orders.stop - orders.start, recursion.a.shape[1], 4 * channels), coefficients.dtype)
        kernels.pack(coefficients, degree, *factors, orders.start, packed)
        kernels.unfold(recursion.synthesise(packed, orders), turn, cosines, orders.start, waves)
    values = np.empty((grid.rows, grid.columns, channels), coefficients.dtype)
    for rows in _pieces(grid.rows, values[0].nbytes):
        values[rows] = irfft(waves[rows], n=grid.columns, axis=1, norm="forward")
    return values


def _complex_kind(dtype: np.dtype) -> type[np.complexfloating]:
    return np.complex64 if dtype == np.float32 else np.complex128


def _pieces(rows: int, size: int) -> Iterator[slice]:
    """Slices that cover `rows` rows of `size` bytes each, about `_PIECE` bytes a slice."""
    step = max(1, _PIECE // size)
    return (slice(low, min(low + step, rows)) for low in range(0, rows, step))


def _orders(degree: int, size: int) -> Iterator[slice]:
    """Slices that cover the orders to `degree`, of `size` bytes each; every slice starts at an even one."""
    step = max(2, _PIECE // size // 2 * 2)
    return (slice(low, min(low + step, degree + 1)) for low in range(0, degree + 1, step))
