"""A correction of low rank to sums over the sphere: the loop of `sphere/quadrature.py`.

f <- f + sum over k of spread_k (waves_k . f)        for every order and channel; f are its rings
"""

from __future__ import annotations

import numpy as np
from numba import njit

# Sums may be reordered and fused so that they vectorise; NaN and infinity still spread as they should.
_FAST = {"reassoc", "contract", "nsz"}


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def mend(tiles, first, stop, low, waves, spread):  # type: ignore[no-untyped-def]
    """Mend every second order of first..stop in half of the channels, from `low` on, of tiles (tiles, orders, channels,
    LANES). waves, spread: (frequencies, tiles, LANES)."""
    half = tiles.shape[2] // 2
    dots = np.empty((waves.shape[0], half), tiles.dtype)
    for m in range(first, stop, 2):
        dots[:] = 0
        for k in range(waves.shape[0]):
            for i in range(tiles.shape[0]):
                wave = waves[k, i]
                for c in range(half):
                    rings, dot = tiles[i, m, low + c], dots[k, c]
                    for lane in range(rings.size):
                        dot += rings[lane] * wave[lane]
                    dots[k, c] = dot
        for k in range(waves.shape[0]):
            for i in range(tiles.shape[0]):
                wave = spread[k, i]
                for c in range(half):
                    rings, dot = tiles[i, m, low + c], dots[k, c]
                    for lane in range(rings.size):
                        rings[lane] += dot * wave[lane]
