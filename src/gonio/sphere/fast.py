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
from .tiles import scratch_tiles

_PIECE = 2**19  # bytes of rings that the sums over theta take at once


def analyse(values: np.ndarray, grid: Grid, degree: int) -> np.ndarray:
    """((degree + 1)^2, C) from values (rows, columns, C)."""
    channels = values.shape[2]
    tiles = row_pairs.way(grid, degree).analyse(values, _weights(grid, values.dtype))
    recursion = folded_recursion(grid, degree)
    factors = odd_factors(degree, recursion.a.shape[1])
    norms = _norms(degree, values.dtype)
    coefficients = np.empty(((degree + 1) ** 2, channels), values.dtype)
    for orders in _orders(tiles):
        mend(tiles, orders, grid, degree)
        kernels.unpack(recursion.project(tiles, orders), degree, *factors, norms, orders.start, coefficients)
    return coefficients


def synthesise(coefficients: np.ndarray, grid: Grid, degree: int) -> np.ndarray:
    """Values (rows, columns, C) from coefficients ((degree + 1)^2, C)."""
    channels, dtype = coefficients.shape[1], coefficients.dtype
    recursion = folded_recursion(grid, degree)
    factors = odd_factors(degree, recursion.a.shape[1])
    norms = _norms(degree, dtype)
    tiles = scratch_tiles(degree + 1, 4 * channels, recursion.t.size, dtype)
    for orders in _orders(tiles):
        packed = np.empty((orders.stop - orders.start, recursion.a.shape[1], 4 * channels), dtype)
        kernels.pack(coefficients, degree, *factors, norms, orders.start, packed)
        recursion.fill(tiles, packed, orders)
    return row_pairs.way(grid, degree).synthesise(tiles, _cosines(grid, dtype))


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
def _norms(degree: int, dtype: np.dtype) -> np.ndarray:
    """What the real harmonics have beside lambda, (2, degree + 1): cosines, and sines, of which order 0 has none."""
    norms = np.stack((root_two(degree), root_two(degree)))
    norms[1, 0] = 0
    return norms.astype(dtype)


def _orders(tiles: np.ndarray) -> Iterator[slice]:
    """Slices that cover the orders; every slice starts at an even one."""
    orders = tiles.shape[1]
    step = max(2, _PIECE // (tiles.nbytes // orders) // 2 * 2)
    return (slice(low, min(low + step, orders)) for low in range(0, orders, step))
