"""Fourier sums over the rows of real images by fast transforms, for NumPy: `row_pairs.py` tells when.

Written for this use rather than taken from SciPy: the lanes of a vector are sixteen pairs of rows, which is how the
sums over theta leave and want them, and orders beyond the degree cost nothing.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from .._kernels import fourier as kernels
from .grids import Grid
from .tiles import LANES, scratch_tiles

_LINE = 64  # bytes


class Transforms:
    """The way by fast Fourier transforms: steps as the logarithm of the degree for every sample."""

    def __init__(self, grid: Grid, degree: int) -> None:
        self.grid, self.degree = grid, degree

    def analyse(self, values: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Tiles of values (rows, columns, C), times `weights` (2, pairs); the equator counts twice.

        In memory that this thread's next transform uses again.
        """
        channels = values.shape[2]
        image = np.ascontiguousarray(values).reshape(self.grid.rows, -1)
        tiles = scratch_tiles(self.degree + 1, 4 * channels, weights.shape[1], values.dtype)
        plan = _plan(self.degree, self.grid.columns, channels, values.dtype)
        kernels.analyse(image, _lanes(weights, channels), *plan, _by_parts(tiles))
        return tiles

    def synthesise(self, tiles: np.ndarray, cosines: np.ndarray) -> np.ndarray:
        """Values (rows, columns, C) from tiles whose differences have yet to be multiplied by `cosines`."""
        channels = tiles.shape[2] // 4
        image = np.empty((self.grid.rows, self.grid.columns * channels), tiles.dtype)
        plan = _plan(self.degree, self.grid.columns, channels, tiles.dtype)
        kernels.synthesise(_by_parts(tiles), _lanes(cosines, channels), *plan, image)
        return image.reshape(self.grid.rows, self.grid.columns, channels)


def _by_parts(tiles: np.ndarray) -> np.ndarray:
    """(tiles, orders, 4, C LANES)."""
    return tiles.reshape(*tiles.shape[:2], 4, -1)


def _lanes(pairs: np.ndarray, channels: int) -> np.ndarray:
    """Numbers for each pair (..., pairs) as lanes, the same for every channel: (tiles, ..., C LANES)."""
    whole = -(-pairs.shape[-1] // LANES) * LANES
    padded = np.zeros((*pairs.shape[:-1], whole), pairs.dtype)
    padded[..., : pairs.shape[-1]] = pairs
    lanes = np.moveaxis(padded.reshape(*pairs.shape[:-1], -1, LANES), -2, 0)
    return np.tile(lanes, channels)


@lru_cache(maxsize=8)
def _plan(degree: int, columns: int, channels: int, dtype: np.dtype) -> tuple[np.ndarray, ...]:
    """turns, at, radices and factors, as the kernels take them."""
    n = next(n for n in range(max(2 * degree, 1), columns + 1) if columns % n == 0)
    radices = _radices(n)
    element = np.arange(n + 1)
    gap = _LINE // dtype.itemsize if n % 4 == 0 else 0
    at = element * (channels * LANES) + element // max(n // 4, 1) * gap
    factors, l = [np.empty(0, complex)], n
    for r in radices:
        l //= r
        j, p = np.arange(l)[:, None, None], np.arange(r)[:, None]
        if r == 4:
            factors.append(_wave(j * p[1:], 4 * l))
        else:
            factors.append(_wave(j * p + l * p * p.T, l * r))
    phase, m = np.arange(columns // n)[:, None], np.arange(degree + 1)
    turns = _wave(m * (2 * phase + 1), 2 * columns) / 2
    flat = np.concatenate([factor.ravel() for factor in factors])
    return _pairs(turns, dtype), at, np.array(radices, np.int64), _pairs(flat, dtype).ravel()


def _wave(k: np.ndarray, n: int) -> np.ndarray:
    """e^{2 pi i k / n}."""
    wave: np.ndarray = np.exp(2j * math.pi * (k % n) / n)
    return wave


def _pairs(z: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """Real and imaginary parts, (..., 2)."""
    return np.stack((z.real, z.imag), axis=-1).astype(dtype)


def _radices(n: int) -> list[int]:
    """Factors of n: primes, but pairs of twos as fours, which stand last as the gaps between quarters want it."""
    primes, factor = [], 2
    while factor * factor <= n:
        while n % factor == 0:
            primes.append(factor)
            n //= factor
        factor += 1
    primes += [n] if n > 1 else []
    twos = primes.count(2)
    return [2] * (twos % 2) + primes[twos:] + [4] * (twos // 2)
