"""Real values on a grid <-> their Fourier sums, folded about the equator.

    rings    (degree + 1, 4 C, northern rows and the equator): for every order m
             sums of a row and its mirror image: cos, sin; differences: cos, sin; of C channels each

`fold` gives sum over c of f(theta_r, phi_c) cos or sin(m phi_c), summed or subtracted over the two rows; the equator is
its own image and counts once. `unfold` is its transpose, with the differences multiplied by cos theta first.
"""

from __future__ import annotations

import numpy as np

from .._kernels import packing as kernels
from ..arrays import Array, is_numpy, like, namespace
from .azimuth import real_from_waves, turns, waves_of_real
from .grids import Grid

_PIECE = 2**19  # bytes of values taken at once: they and their transforms stay in the second or third cache


def fold(values: Array, grid: Grid, degree: int) -> Array:
    """Rings of values (rows, columns, C)."""
    if is_numpy(values):
        return _fold_in_pieces(values, grid, degree)
    xp = namespace(values)
    waves = waves_of_real(values, degree)
    south = xp.flip(waves[grid.rows // 2 :, ...], axis=0)
    north = waves[: south.shape[0], ...]
    if grid.rows % 2:
        south = xp.concat((south[:-1, ...], xp.zeros_like(south[-1:, ...])), axis=0)
    even, odd = north + south, north - south
    parts = xp.concat((xp.real(even), -xp.imag(even), xp.real(odd), -xp.imag(odd)), axis=-1)
    return xp.permute_dims(parts, (1, 2, 0))


def unfold(rings: Array, grid: Grid) -> Array:
    """Values (rows, columns, C) from rings."""
    cosines = like(np.cos(grid.theta[: rings.shape[2]]), rings)
    if is_numpy(rings):
        return _unfold_in_pieces(rings, grid, cosines)
    xp = namespace(rings)
    channels = rings.shape[1] // 4
    cosine, sine, odd_cosine, odd_sine = (rings[:, k * channels : (k + 1) * channels, :] for k in range(4))
    even, odd = cosine - 1j * sine, (odd_cosine - 1j * odd_sine) * cosines
    south = xp.flip((even - odd)[..., : grid.rows // 2], axis=-1)
    waves = xp.permute_dims(xp.concat((even + odd, south), axis=-1), (2, 0, 1))
    return real_from_waves(waves, grid.columns)


def _fold_in_pieces(values: np.ndarray, grid: Grid, degree: int) -> np.ndarray:
    from scipy.fft import rfft

    rings = np.empty((degree + 1, 4 * values.shape[2], (grid.rows + 1) // 2), values.dtype)
    turn = turns(degree, grid.columns, -1)
    for low, high in _pieces(values.nbytes, rings.shape[2]):
        north = rfft(values[low:high], axis=1)
        south = rfft(values[grid.rows - high : grid.rows - low], axis=1)[::-1]
        if grid.rows % 2 and high == rings.shape[2]:
            south[-1] = 0
        kernels.fold(north, south, turn.astype(north.dtype), low, rings)
    return rings


def _unfold_in_pieces(rings: np.ndarray, grid: Grid, cosines: np.ndarray) -> np.ndarray:
    from scipy.fft import irfft

    orders, channels, half = rings.shape[0], rings.shape[1] // 4, rings.shape[2]
    kind = np.complex64 if rings.dtype == np.float32 else np.complex128
    # irfft counts every m > 0 twice.
    turn = (turns(orders - 1, grid.columns, 1) * np.where(np.arange(orders) > 0, 0.5, 1)).astype(kind)
    values = np.empty((grid.rows, grid.columns, channels), rings.dtype)
    pieces = _pieces(values.nbytes, half)
    waves = np.zeros((2, pieces[0][1], grid.columns // 2 + 1, channels), kind)
    for low, high in pieces:
        north, south = waves[0, : high - low], waves[1, : high - low]
        kernels.unfold(rings, turn, cosines, low, north, south)
        # The equator belongs to both; its odd part is 0.
        values[grid.rows - high : grid.rows - low] = irfft(south, n=grid.columns, axis=1, norm="forward")[::-1]
        values[low:high] = irfft(north, n=grid.columns, axis=1, norm="forward")
    return values


def _pieces(size: int, half: int) -> list[tuple[int, int]]:
    """Ranges of northern rows that cover `half` of them, of about `_PIECE` bytes each; `size` is that of all rows."""
    step = max(1, _PIECE * half // size)
    return [(low, min(low + step, half)) for low in range(0, half, step)]
