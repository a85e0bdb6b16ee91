"""Coefficients and rows brought to where the sums over theta read them, and back, for some orders at a time.

The array code of `sphere/packing.py` and `sphere/folding.py` says the same for arrays of other libraries.
"""

from __future__ import annotations

import math

from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def fold(waves, turn, low, rings):  # type: ignore[no-untyped-def]
    """rings (orders, 4 C, northern rows and equator) of the orders low, low + 1, ... of waves (rows, all orders, C).

    Parts of C channels: real and negative imaginary part of the sum of a row and its mirror image, and the same of the
    difference; both turned by turn[order]. The equator is its own image and counts once.
    """
    rows, _, channels = waves.shape
    for r in range(rings.shape[2]):
        north, south = waves[r], waves[rows - 1 - r]
        share = 0.5 if 2 * r == rows - 1 else 1.0
        for m in range(rings.shape[0]):
            by = turn[low + m] * share
            for c in range(channels):
                even = (north[low + m, c] + south[low + m, c]) * by
                odd = (north[low + m, c] - south[low + m, c]) * by
                rings[m, c, r] = even.real
                rings[m, channels + c, r] = -even.imag
                rings[m, 2 * channels + c, r] = odd.real
                rings[m, 3 * channels + c, r] = -odd.imag


@njit(cache=True, nogil=True, error_model="numpy")
def unfold(rings, turn, cosines, low, waves):  # type: ignore[no-untyped-def]
    """Fill the orders low, low + 1, ... of `waves` from `rings`, shaped as in `fold`.

    cos - i sin, turned by turn[order]; the odd parts are multiplied by cosines[r].
    """
    rows, _, channels = waves.shape
    for r in range(rings.shape[2]):
        for m in range(rings.shape[0]):
            for c in range(channels):
                even = complex(rings[m, c, r], -rings[m, channels + c, r]) * turn[low + m]
                odd = complex(rings[m, 2 * channels + c, r], -rings[m, 3 * channels + c, r]) * turn[low + m]
                waves[rows - 1 - r, low + m, c] = even - odd * cosines[r]
                waves[r, low + m, c] = even + odd * cosines[r]


@njit(cache=True, nogil=True, error_model="numpy")
def pack(flat, degree, inverse, coupling, low, packed):  # type: ignore[no-untyped-def]
    """Packed coefficients (orders, steps, 4 C) of the orders low, low + 1, ... from flat ((degree + 1)^2, C)."""
    channels = flat.shape[1]
    packed[:] = 0
    for l in range(degree, low - 1, -1):
        for m in range(low, min(low + packed.shape[0], l + 1)):
            root = math.sqrt(2.0) if m else 1.0
            step, odd = (l - m) // 2, (l - m) % 2
            row = packed[m - low, step]
            for c in range(channels):
                cosine, sine = root * flat[l * (l + 1) + m, c], root * flat[l * (l + 1) - m, c] if m else 0.0
                if odd:
                    if l + 2 <= degree:
                        above = packed[m - low, step + 1]
                        cosine -= coupling[step, m] * above[2 * channels + c]
                        sine -= coupling[step, m] * above[3 * channels + c]
                    row[2 * channels + c] = inverse[step, m] * cosine
                    row[3 * channels + c] = inverse[step, m] * sine
                else:
                    row[c] = cosine
                    row[channels + c] = sine


@njit(cache=True, nogil=True, error_model="numpy")
def unpack(packed, degree, inverse, coupling, low, flat):  # type: ignore[no-untyped-def]
    """Fill the orders low, low + 1, ... of `flat` from packed sums, which are overwritten."""
    channels = flat.shape[1]
    for l in range(low, degree + 1):
        for m in range(low, min(low + packed.shape[0], l + 1)):
            root = math.sqrt(2.0) if m else 1.0
            step, odd = (l - m) // 2, (l - m) % 2
            row = packed[m - low, step]
            if odd:
                for k in range(2 * channels, 4 * channels):
                    if step:
                        row[k] -= coupling[step - 1, m] * packed[m - low, step - 1, k]
                    row[k] *= inverse[step, m]
            for c in range(channels):
                if m:
                    flat[l * (l + 1) - m, c] = root * row[(2 * odd + 1) * channels + c]
                flat[l * (l + 1) + m, c] = root * row[2 * odd * channels + c]
