"""Fourier sums over the rows of real images, two mirror rows at a time, by the kernels, for NumPy.

    rings   (degree + 1, 4 C, northern rows and the equator): for every order m sum over c of f(theta_r, phi_c) times
            cos or sin(m phi_c): cos and sin of the sums of a row and its mirror image, then of their differences

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
from .grids import Grid

_PIECE = 2**19  # bytes of rows taken at once


class Matrices:
    """The way by products: (degree + 1) / 4 products and a few sums for every sample."""

    def __init__(self, grid: Grid, degree: int) -> None:
        self.grid, self.degree = grid, degree

    def turn(self, sign: int) -> np.ndarray:
        """What cosine + i sine of each order still have to be multiplied by, (degree + 1,): 1."""
        return np.ones(self.degree + 1, np.complex128)

    def analyse(self, values: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Rings of values (rows, columns, C), times `weights` (2, pairs); the equator counts twice."""
        channels = values.shape[2]
        image = np.ascontiguousarray(values).reshape(self.grid.rows, -1)
        matrices, sums = self._matrices(values.dtype), self._sums(channels, values.dtype)
        for pairs in _pieces(self.grid, image[:2].nbytes):
            quarters = self._quarters(channels, pairs, values.dtype)
            kernels.fold(image, weights, pairs.start, *quarters)
            np.matmul(quarters.reshape(4, -1, quarters.shape[3]), matrices.mT, out=_flat(sums, pairs))
        rings = empty_rings(self.grid, self.degree, channels, values.dtype)
        for ring, part in self._orders(rings, sums):
            ring[...] = part
        return rings

    def synthesise(self, rings: np.ndarray, cosines: np.ndarray) -> np.ndarray:
        """Values (rows, columns, C) from rings whose differences have yet to be multiplied by `cosines`."""
        channels = rings.shape[1] // 4
        matrices, sums = self._matrices(rings.dtype), self._sums(channels, rings.dtype)
        for ring, part in self._orders(rings, sums):
            part[...] = ring
        image = np.empty((self.grid.rows, self.grid.columns * channels), rings.dtype)
        for pairs in _pieces(self.grid, image[:2].nbytes):
            quarters = self._quarters(channels, pairs, rings.dtype)
            np.matmul(_flat(sums, pairs), matrices, out=quarters.reshape(4, -1, quarters.shape[3]))
            kernels.unfold(*quarters, cosines, pairs.start, image)
        return image.reshape(self.grid.rows, self.grid.columns, channels)

    def _matrices(self, dtype: np.dtype) -> np.ndarray:
        return _waves(self.degree, self.grid.columns, dtype)

    def _sums(self, channels: int, dtype: np.dtype) -> np.ndarray:
        """(quarters, pairs, 2 C, orders of a quarter); where the odd orders are one fewer, a 0 stands last."""
        return np.zeros((4, (self.grid.rows + 1) // 2, 2 * channels, self.degree // 2 + 1), dtype)

    def _quarters(self, channels: int, pairs: slice, dtype: np.dtype) -> np.ndarray:
        return np.empty((4, pairs.stop - pairs.start, 2 * channels, self.grid.columns // 4), dtype)

    def _orders(self, rings: np.ndarray, sums: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Views of the same numbers in `rings` and in `sums`, (orders, 2, C, pairs), for each quarter."""
        pairs = sums.shape[1]
        parts = rings.reshape(rings.shape[0], 2, 2, -1, rings.shape[2])[..., :pairs]
        for k in range(4):
            sine, odd = divmod(k, 2)
            ring = parts[odd::2, :, sine]
            yield ring, sums[k].T[: ring.shape[0]].reshape(ring.shape[0], 2, -1, pairs)


class Transforms:
    """The way by fast Fourier transforms."""

    def __init__(self, grid: Grid, degree: int) -> None:
        self.grid, self.degree = grid, degree

    def turn(self, sign: int) -> np.ndarray:
        """What cosine + i sine of each order still have to be multiplied by, (degree + 1,).

        Column 0 stands half a step from phi = 0; and irfft counts every m > 0 twice.
        """
        order = np.arange(self.degree + 1)
        turn: np.ndarray = np.exp(1j * sign * order * (math.pi / self.grid.columns))
        return turn if sign > 0 else turn * np.where(order > 0, 0.5, 1)

    def analyse(self, values: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Rings of values (rows, columns, C), times `weights` (2, pairs); the equator counts twice."""
        from scipy.fft import rfft

        channels = values.shape[2]
        image = np.ascontiguousarray(values).reshape(self.grid.rows, -1)
        rings = empty_rings(self.grid, self.degree, channels, values.dtype)
        for pairs in _pieces(self.grid, image[:2].nbytes):
            lines = np.empty((2 * channels, pairs.stop - pairs.start, self.grid.columns), values.dtype)
            kernels.gather(image, weights, pairs.start, lines)
            kernels.collect(rfft(lines), pairs.start, rings)
        return rings

    def synthesise(self, rings: np.ndarray, cosines: np.ndarray) -> np.ndarray:
        """Values (rows, columns, C) from rings whose differences have yet to be multiplied by `cosines`."""
        from scipy.fft import irfft

        channels = rings.shape[1] // 4
        kind = np.complex64 if rings.dtype == np.float32 else np.complex128
        image = np.empty((self.grid.rows, self.grid.columns * channels), rings.dtype)
        for pairs in _pieces(self.grid, image[:2].nbytes):
            waves = np.empty((2 * channels, pairs.stop - pairs.start, self.grid.columns // 2 + 1), kind)
            kernels.distribute(rings, pairs.start, waves)
            kernels.scatter(irfft(waves, n=self.grid.columns, norm="forward"), cosines, pairs.start, image)
        return image.reshape(self.grid.rows, self.grid.columns, channels)


def way(grid: Grid, degree: int) -> Matrices | Transforms:
    """The faster of the two: products cost as the degree, transforms as the logarithm of the columns.

    They meet between 7 and 10 times that logarithm, measured from 128 to 2,048 columns in either precision.
    """
    few = grid.columns % 4 == 0 and degree <= 8 * math.log2(grid.columns)
    return Matrices(grid, degree) if few else Transforms(grid, degree)


def empty_rings(grid: Grid, degree: int, channels: int, dtype: np.dtype) -> np.ndarray:
    """Memory for rings, longer than the pairs of rows by 16 or more: the same pair of all orders, a power of two apart,
    would have to share a few lines of the cache."""
    return np.empty((degree + 1, 4 * channels, ((grid.rows + 1) // 2 + 31) // 16 * 16), dtype)


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
