"""Coefficients and rows brought to where the sums over theta read them, and back, in one pass over each.

The array code beside the callers (`sphere/packing.py`, `sphere/transform.py`) says the same for other libraries.
"""

from __future__ import annotations

import math

from numba import njit

_TILE = 16  # orders: the cache lines that a tile writes, for a few channels, stay in the first cache


@njit(cache=True, nogil=True, error_model="numpy")
def fold(waves, turn, rings):  # type: ignore[no-untyped-def]
    """rings[m, (even re, even -im, odd re, odd -im) c, r] from waves (rows, orders or more, C), turned by turn[m].

    Even is the sum of row r and its mirror image, odd the difference. The equator is its own image and counts once.
    """
    rows, channels = waves.shape[0], waves.shape[2]
    for tile in range(0, turn.size, _TILE):
        stop = min(tile + _TILE, turn.size)
        for r in range((rows + 1) // 2):
            mirror = rows - 1 - r
            for m in range(tile, stop):
                for c in range(channels):
                    north = waves[r, m, c] * turn[m]
                    south = waves[mirror, m, c] * turn[m] if mirror > r else 0 * north
                    even, odd = north + south, north - south
                    rings[m, c, r] = even.real
                    rings[m, channels + c, r] = -even.imag
                    rings[m, 2 * channels + c, r] = odd.real
                    rings[m, 3 * channels + c, r] = -odd.imag


@njit(cache=True, nogil=True, error_model="numpy")
def unfold(rings, turn, cosines, waves):  # type: ignore[no-untyped-def]
    """waves (rows, orders or more, C) from rings[m, (even cos, even sin, odd cos, odd sin) c, r]: cos - i sin, turned.

    Odd parts are multiplied by cosines[r]. Orders beyond those of `turn` become 0.
    """
    rows, channels = waves.shape[0], waves.shape[2]
    waves[:, turn.size :] = 0
    for tile in range(0, turn.size, _TILE):
        stop = min(tile + _TILE, turn.size)
        for r in range((rows + 1) // 2):
            for m in range(tile, stop):
                for c in range(channels):
                    even = complex(rings[m, c, r], -rings[m, channels + c, r]) * turn[m]
                    odd = complex(rings[m, 2 * channels + c, r], -rings[m, 3 * channels + c, r]) * turn[m] * cosines[r]
                    waves[rows - 1 - r, m, c] = even - odd
                    waves[r, m, c] = even + odd


@njit(cache=True, nogil=True, error_model="numpy")
def pack(flat, inverse, coupling, packed):  # type: ignore[no-untyped-def]
    """`sphere.packing.pack`: packed (orders, steps, 4 C) from flat ((degree + 1)^2, C)."""
    orders, steps = packed.shape[:2]
    channels = flat.shape[1]
    for m in range(orders):
        root = math.sqrt(2.0) if m else 1.0
        packed[m] = 0
        for i in range((orders - 1 - m) // 2, -1, -1):
            l = m + 2 * i
            at, above = l * (l + 1), (l + 1) * (l + 2)
            for c in range(channels):
                packed[m, i, c] = root * flat[at + m, c]
                if m:
                    packed[m, i, channels + c] = root * flat[at - m, c]
                if l + 1 < orders:
                    cosine, sine = root * flat[above + m, c], root * flat[above - m, c] if m else 0.0
                    if i + 1 < steps:
                        cosine -= coupling[i, m] * packed[m, i + 1, 2 * channels + c]
                        sine -= coupling[i, m] * packed[m, i + 1, 3 * channels + c]
                    packed[m, i, 2 * channels + c] = inverse[i, m] * cosine
                    packed[m, i, 3 * channels + c] = inverse[i, m] * sine


@njit(cache=True, nogil=True, error_model="numpy")
def unpack(packed, inverse, coupling, flat):  # type: ignore[no-untyped-def]
    """`sphere.packing.unpack`: flat ((degree + 1)^2, C) from packed (orders, steps, 4 C), which is overwritten."""
    orders = packed.shape[0]
    channels = flat.shape[1]
    for m in range(orders):
        root = math.sqrt(2.0) if m else 1.0
        for i in range((orders - 1 - m) // 2 + 1):
            l = m + 2 * i
            at, above = l * (l + 1), (l + 1) * (l + 2)
            for c in range(channels):
                flat[at + m, c] = root * packed[m, i, c]
                if m:
                    flat[at - m, c] = root * packed[m, i, channels + c]
            if l + 1 < orders:
                for k in range(2 * channels, 4 * channels):
                    if i:
                        packed[m, i, k] -= coupling[i - 1, m] * packed[m, i - 1, k]
                    packed[m, i, k] *= inverse[i, m]
                for c in range(channels):
                    flat[above + m, c] = root * packed[m, i, 2 * channels + c]
                    if m:
                        flat[above - m, c] = root * packed[m, i, 3 * channels + c]
