"""The real transforms of NumPy arrays, by the kernels: Fourier sums over pairs of rows, then the sums over theta a few
orders at a time, so that what lies between the steps stays in the cache.

The same steps as array code, for other libraries, stand in `folding.py`, `packing.py` and `transform.py`.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from .._kernels import packing as kernels
from . import row_pairs
from .grids import Grid
from .legendre import folded_recursion, odd_factors
from .packing import root_two
from .quadrature import mend

_PIECE = 2**19  # bytes of rings that the sums over theta take at once


def analyse(values: np.ndarray, grid: Grid, degree: int) -> np.ndarray:
    """((degree + 1)^2, C) from values (rows, columns, C)."""
    channels = values.shape[2]
    way = row_pairs.way(grid, degree)
    rings = way.analyse(values, _weights(grid, values.dtype))
    recursion = folded_recursion(grid, degree)
    factors = odd_factors(degree, recursion.a.shape[1])
    turn = _turn(grid, degree, 1, values.dtype)
    coefficients = np.empty(((degree + 1) ** 2, channels), values.dtype)
    for orders in _orders(degree, rings[0].nbytes):
        mend(rings[orders, :, : recursion.t.size], grid, degree)
        kernels.unpack(recursion.analyse(rings[orders], orders), degree, *factors, turn, orders.start, coefficients)
    return coefficients


def synthesise(coefficients: np.ndarray, grid: Grid, degree: int) -> np.ndarray:
    """Values (rows, columns, C) from coefficients ((degree + 1)^2, C)."""
    channels = coefficients.shape[1]
    way = row_pairs.way(grid, degree)
    recursion = folded_recursion(grid, degree)
    factors = odd_factors(degree, recursion.a.shape[1])
    turn = _turn(grid, degree, -1, coefficients.dtype)
    rings = row_pairs.empty_rings(grid, degree, channels, coefficients.dtype)
    for orders in _orders(degree, rings[0].nbytes):
        packed = np.empty((orders.stop - orders.start, recursion.a.shape[1], 4 * channels), coefficients.dtype)
        kernels.pack(coefficients, degree, *factors, turn, orders.start, packed)
        recursion.synthesise(packed, orders, rings[orders])
    return way.synthesise(rings, _cosines(grid, rings.dtype))


# The next three are kept: where other work has used the caches, making them takes as long as the sums over theta.


@lru_cache(maxsize=8)
def _weights(grid: Grid, dtype: np.dtype) -> np.ndarray:
    """Weights (2, pairs) of the sums and, times cos theta, of the differences; the equator comes twice."""
    pairs = (grid.rows + 1) // 2
    weights: np.ndarray = grid.weights[:pairs] * np.stack((np.ones(pairs), np.cos(grid.theta[:pairs])))
    if grid.rows % 2:
        weights[:, -1] /= 2
    return weights.astype(dtype)


@lru_cache(maxsize=8)
def _cosines(grid: Grid, dtype: np.dtype) -> np.ndarray:
    """cos theta of the northern rows and the equator, (pairs,)."""
    cosines: np.ndarray = np.cos(grid.theta[: (grid.rows + 1) // 2]).astype(dtype)
    return cosines


@lru_cache(maxsize=8)
def _turn(grid: Grid, degree: int, sign: int, dtype: np.dtype) -> np.ndarray:
    """The turn of `row_pairs` for each order, times the norm of the real harmonics; (degree + 1,)."""
    turn: np.ndarray = row_pairs.way(grid, degree).turn(sign) * root_two(degree)
    return turn.astype(np.complex64 if dtype == np.float32 else np.complex128)


def _orders(degree: int, size: int) -> Iterator[slice]:
    """Slices that cover the orders to `degree`, of `size` bytes each; every slice starts at an even one."""
    step = max(2, _PIECE // size // 2 * 2)
    return (slice(low, min(low + step, degree + 1)) for low in range(0, degree + 1, step))
