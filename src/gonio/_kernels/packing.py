"""Coefficients and rows brought to where the sums over theta read them, and back, in one pass over each.

The array code beside the callers (`sphere/packing.py`, `sphere/transform.py`) says the same for other libraries.
"""

from __future__ import annotations

import math

from numba import njit

_TILE = 16  # orders: the cache lines that a tile writes, for a few channels, stay in the first cache


@njit(cache=True, nogil=True, error_model="numpy")
def fold(north, south, turn, low, rings):  # type: ignore[no-untyped-def]
    """rings[m, (even re, even -im, odd re, odd -im) c, r] for the rows r = low, low + 1, ... of `north`.

    north, south: (some rows, orders or more, C), a row and its mirror image; even is their sum, odd the difference,
    both turned by turn[m].
    """
    rows, _, channels = north.shape
    for tile in range(0, turn.size, _TILE):
        stop = min(tile + _TILE, turn.size)
        for r in range(rows):
            for m in range(tile, stop):
                for c in range(channels):
                    even = (north[r, m, c] + south[r, m, c]) * turn[m]
                    odd = (north[r, m, c] - south[r, m, c]) * turn[m]
                    rings[m, c, low + r] = even.real
                    rings[m, channels + c, low + r] = -even.imag
                    rings[m, 2 * channels + c, low + r] = odd.real
                    rings[m, 3 * channels + c, low + r] = -odd.imag


@njit(cache=True, nogil=True, error_model="numpy")
def unfold(rings, turn, cosines, low, north, south):  # type: ignore[no-untyped-def]
    """north, south (some rows, orders or more, C) from rings[m, (even cos, even sin, odd cos, odd sin) c, low + r].

    cos - i sin, turned by turn[m]; the odd parts are multiplied by cosines[low + r]. Further orders are left alone.
    """
    rows, _, channels = north.shape
    for tile in range(0, turn.size, _TILE):
        stop = min(tile + _TILE, turn.size)
        for r in range(rows):
            at = low + r
            for m in range(tile, stop):
                for c in range(channels):
                    even = complex(rings[m, c, at], -rings[m, channels + c, at]) * turn[m]
                    odd = complex(rings[m, 2 * channels + c, at], -rings[m, 3 * channels + c, at]) * turn[m]
                    north[r, m, c] = even + odd * cosines[at]
                    south[r, m, c] = even - odd * cosines[at]


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
