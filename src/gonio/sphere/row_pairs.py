"""Fourier sums over the rows of real images, in pairs of mirror rows, by the kernels, for NumPy.

    tiles   (tiles, degree + 1, 4 C, LANES), as in `tiles.py`, of the northern rows and the equator: for every order m
            sum over c of f(theta_r, phi_c) times cos or sin(m phi_c): cos and sin of the sums of a row and its mirror
            image, then of their differences

By fast Fourier transforms; or, for a few orders of many columns, by products with matrices of cosines and sines, for
which a turn is folded fourfold. The pairs are taken some at a time, so that what lies between stays in the cache.
`folding.py` says the same in array code for other libraries.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from .._kernels import row_pairs as kernels
from .fourier import Transforms
from .grids import Grid
from .tiles import LANES, scratch_tiles

_PIECE = 2**19  # bytes of rows taken at once


class Matrices:
    """The way by products: (degree + 1) / 4 products and a few sums for every sample."""

    def __init__(self, grid: Grid, degree: int) -> None:
        self.grid, self.degree = grid, degree

    def analyse(self, values: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Tiles of values (rows, columns, C), times `weights` (2, pairs); the equator counts twice.

        In memory that this thread's next transform uses again.
        """
        channels = values.shape[2]
        image = np.ascontiguousarray(values).reshape(self.grid.rows, -1)
        tiles = scratch_tiles(self.degree + 1, 4 * channels, weights.shape[1], values.dtype)
        matrices, sums = self._matrices(values.dtype), self._sums(tiles)
        for pairs in _pieces(self.grid, image[:2].nbytes):
            quarters = self._quarters(channels, pairs, values.dtype)
            kernels.fold(image, weights, pairs.start, *quarters)
            np.matmul(quarters.reshape(4, -1, quarters.shape[3]), matrices.mT, out=_flat(sums, pairs))
        for tile, part in self._orders(tiles, sums):
            tile[...] = part
        return tiles

    def synthesise(self, tiles: np.ndarray, cosines: np.ndarray) -> np.ndarray:
        """Values (rows, columns, C) from tiles whose differences have yet to be multiplied by `cosines`."""
        channels = tiles.shape[2] // 4
        matrices, sums = self._matrices(tiles.dtype), self._sums(tiles)
        for tile, part in self._orders(tiles, sums):
            part[...] = tile
        image = np.empty((self.grid.rows, self.grid.columns * channels), tiles.dtype)
        for pairs in _pieces(self.grid, image[:2].nbytes):
            quarters = self._quarters(channels, pairs, tiles.dtype)
            np.matmul(_flat(sums, pairs), matrices, out=quarters.reshape(4, -1, quarters.shape[3]))
            kernels.unfold(*quarters, cosines, pairs.start, image)
        return image.reshape(self.grid.rows, self.grid.columns, channels)

    def _matrices(self, dtype: np.dtype) -> np.ndarray:
        return _waves(self.degree, self.grid.columns, dtype)

    def _sums(self, tiles: np.ndarray) -> np.ndarray:
        """(quarters, pairs, 2 C, orders of a quarter); where the odd orders are one fewer, a 0 stands last."""
        return np.zeros((4, tiles.shape[0] * LANES, tiles.shape[2] // 2, self.degree // 2 + 1), tiles.dtype)

    def _quarters(self, channels: int, pairs: slice, dtype: np.dtype) -> np.ndarray:
        return np.empty((4, pairs.stop - pairs.start, 2 * channels, self.grid.columns // 4), dtype)

    def _orders(self, tiles: np.ndarray, sums: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Views of the same numbers in `tiles` and in `sums`, (tiles, orders, 2, C, LANES), for each quarter."""
        parts = tiles.reshape(*tiles.shape[:2], 2, 2, -1, LANES)
        for k in range(4):
            sine, odd = divmod(k, 2)
            tile = parts[:, odd::2, :, sine]
            part = sums[k].reshape(tiles.shape[0], LANES, 2, tile.shape[3], -1).transpose(0, 4, 2, 3, 1)
            yield tile, part[:, : tile.shape[1]]


def way(grid: Grid, degree: int) -> Matrices | Transforms:
    """The faster of the two: they meet between degree 40 and 80, measured from 256 to 2,048 columns in float32."""
    few = grid.columns % 4 == 0 and degree <= 64
    return Matrices(grid, degree) if few else Transforms(grid, degree)


def _flat(sums: np.ndarray, pairs: slice) -> np.ndarray:
    return sums[:, pairs].reshape(4, -1, sums.shape[3])


def _pieces(grid: Grid, size: int) -> Iterator[slice]:
    """Slices that cover the pairs of rows, of `size` bytes each; every slice but the last holds a multiple of 8."""
    step, pairs = max(8, _PIECE // size // 8 * 8), (grid.rows + 1) // 2
    return (slice(low, min(low + step, pairs)) for low in range(0, pairs, step))


@lru_cache(maxsize=8)
def _waves(degree: int, columns: int, dtype: np.dtype) -> np.ndarray:
    """cos(m phi) of even m and of odd m, sin(m phi) of them, at the first quarter of the columns; (4, orders, columns).

    Where the odd orders are one fewer, a 0 stands last.
    """
    angle = np.arange(degree + 1)[:, None] * ((np.arange(columns // 4) + 0.5) * (2 * math.pi / columns))
    waves = np.zeros((4, degree // 2 + 1, columns // 4), dtype)
    for k in range(4):
        part = angle[k % 2 :: 2]
        waves[k, : part.shape[0]] = np.sin(part) if k > 1 else np.cos(part)
    return waves
