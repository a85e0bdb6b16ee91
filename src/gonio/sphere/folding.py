"""Real values on a grid <-> their Fourier sums, folded about the equator.

    rings    (degree + 1, 4 C, northern rows and the equator): for every order m
             sums of a row and its mirror image: cos, sin; differences: cos, sin; of C channels each

`fold` gives sum over c of f(theta_r, phi_c) cos or sin(m phi_c), summed or subtracted over the two rows; the equator is
its own image and counts once. `unfold` is its transpose, with the differences multiplied by cos theta first.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array, like, namespace
from .azimuth import real_from_waves, waves_of_real
from .grids import Grid


def fold(values: Array, grid: Grid, degree: int) -> Array:
    """Rings of values (rows, columns, C)."""
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
    xp = namespace(rings)
    channels = rings.shape[1] // 4
    cosine, sine, odd_cosine, odd_sine = (rings[:, k * channels : (k + 1) * channels, :] for k in range(4))
    cosines = like(np.cos(grid.theta[: rings.shape[2]]), rings)
    even, odd = cosine - 1j * sine, (odd_cosine - 1j * odd_sine) * cosines
    south = xp.flip((even - odd)[..., : grid.rows // 2], axis=-1)
    waves = xp.permute_dims(xp.concat((even + odd, south), axis=-1), (2, 0, 1))
    return real_from_waves(waves, grid.columns)
