"""What Fejer's weights miss on a lat-long grid of n rows where degrees add up to n or more, put back exactly.

At a given order every function of theta at hand is a sum of cos k theta (m + s even) or of sin k theta (odd), k <= L.
Products of two of them hold frequencies K up to 2 L, and the rule integrates them exactly while K < n. Beyond,

    err(K) = integral of cos(K theta) sin(theta) - sum of w_r cos(K theta_r) = 2 / (1 - K^2) + 2 / (1 - (2 n - K)^2)

for even K > n, the first term alone at K = n, 0 for odd K. So only the frequencies k from n - L to L need mending:

    integral of f g sin theta = sum_r g_r (w_r f_r + [B^T M B f]_r),   B_kr = cos or sin(k theta_r),
    M_jk = +- err(j + k) / 2 times the norms of the two frequencies.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from .._kernels import mending as kernels
from ..arrays import Array, like, namespace
from .grids import Grid, LatLong
from .tiles import tiled


def weighted(rings: Array, grid: Grid, degree: int, spin: int, symmetry: int | None = None) -> Array:
    """Rings f (orders, channels, rows) so weighted that their sums against functions to `degree` are integrals.

    With `symmetry` None the rings are all rows; with 0 the sums of the northern rows and their mirror images, with 1
    the differences, which come out times cos theta.
    """
    plain = rings * like(_factors(grid, rings.shape[2], symmetry), rings)
    if not _mends(grid, degree):
        return plain
    xp = namespace(rings)
    mended = []
    for odd in (0, 1):
        waves, spread = (like(x, rings) for x in _mending(grid, degree, (odd + spin) % 2, symmetry))
        mended.append((rings[odd::2, ...] @ waves.mT) @ spread)
    order = np.arange(rings.shape[0])
    order = xp.asarray(order // 2 + (order % 2) * mended[0].shape[0], device=rings.device)
    return plain + xp.take(xp.concat(mended, axis=0), order, axis=0)


def mend(tiles: np.ndarray, orders: slice, grid: Grid, degree: int) -> None:
    """Put into some orders, from an even one on, of the `tiles` of sums and differences of mirror rows, which have
    their plain weights already (the differences times cos theta), what these weights miss."""
    if not _mends(grid, degree):
        return
    for symmetry in (0, 1):
        for odd in (0, 1):
            waves, spread = _tiled_mending(grid, degree, odd, symmetry, tiles.dtype)
            low = symmetry * tiles.shape[2] // 2
            kernels.mend(tiles, orders.start + odd, orders.stop, low, waves, spread)


def _mends(grid: Grid, degree: int) -> bool:
    """Whether the plain weights miss anything."""
    return isinstance(grid, LatLong) and 2 * degree >= grid.rows


@lru_cache(maxsize=16)
def _tiled_mending(grid: Grid, degree: int, odd: int, symmetry: int, dtype: np.dtype) -> tuple[np.ndarray, np.ndarray]:
    """B and M B for rings that have their plain weights, each (frequencies, tiles, LANES)."""
    waves, spread = _mending(grid, degree, odd, symmetry)
    waves = waves / _factors(grid, waves.shape[1], symmetry)
    first, second = (tiled(x[:, None, :])[:, :, 0].swapaxes(0, 1).astype(dtype) for x in (waves, spread))
    return np.ascontiguousarray(first), np.ascontiguousarray(second)


def _factors(grid: Grid, rows: int, symmetry: int | None) -> np.ndarray:
    """The plain weights of a grid's first rows."""
    factors: np.ndarray = grid.weights[:rows] * (np.cos(grid.theta[:rows]) if symmetry == 1 else 1)
    return factors


@lru_cache(maxsize=16)
def _mending(grid: Grid, degree: int, odd: int, symmetry: int | None) -> tuple[np.ndarray, np.ndarray]:
    """B and M B, each (frequencies, rows), in the normalisation of `grid.weights`."""
    n = grid.rows
    k = np.arange(n - degree, degree + 1)
    theta = grid.theta
    if symmetry is not None:
        # cos k theta is symmetric about the equator for even k, sin k theta for odd k.
        k = k[(k + odd) % 2 == symmetry]
        theta = theta[: (n + 1) // 2]
    both = k[:, None] + k[None, :]
    error = 2 / (1 - 1.0 * both**2) + np.where(both == n, 0, 2 / (1 - (2.0 * n - both) ** 2))
    error = np.where((both >= n) & (both % 2 == 0), error, 0) * (math.pi / grid.columns)
    norms = np.where(k == 0, 1, 2) / n
    waves = np.sin(np.outer(k, theta)) if odd else np.cos(np.outer(k, theta))
    spread = (norms[:, None] * (-error if odd else error) * norms[None, :]) @ waves
    if symmetry is not None:
        spread[:, : n // 2] *= 2  # a northern row stands for its mirror image as well
    if symmetry == 1:
        spread *= np.cos(theta)
    return waves, spread
