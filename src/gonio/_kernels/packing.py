"""Coefficients brought to where the sums over theta read them, and back, for some orders at a time.

The array code of `sphere/packing.py` says the same for arrays of other libraries.
"""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def pack(flat, degree, inverse, coupling, norms, low, packed):  # type: ignore[no-untyped-def]
    """Packed coefficients (orders, steps, 4 C) of the orders low, low + 1, ... from flat ((degree + 1)^2, C).

    norms: (2, degree + 1), of cosines and of sines; a sine of order 0 has none.
    """
    channels = flat.shape[1]
    packed[:] = 0
    for l in range(degree, low - 1, -1):
        centre, end = l * (l + 1), min(low + packed.shape[0], l + 1)
        for m in range(low + (l - low) % 2, end, 2):
            cosine, sine = flat[centre + m], flat[centre - m]
            to = packed[m - low, (l - m) // 2]
            for k in range(channels):
                to[k] = norms[0, m] * cosine[k]
                to[channels + k] = norms[1, m] * sine[k]
        for m in range(low + (l - low + 1) % 2, end, 2):
            cosine, sine, step = flat[centre + m], flat[centre - m], (l - m) // 2
            to, above = packed[m - low, step], packed[m - low, step + 1 if l + 2 <= degree else step]  # there still 0
            by, less = inverse[step, m], inverse[step, m] * coupling[step, m]
            for k in range(channels):
                i, j = 2 * channels + k, 3 * channels + k
                to[i] = by * norms[0, m] * cosine[k] - less * above[i]
                to[j] = by * norms[1, m] * sine[k] - less * above[j]


@njit(cache=True, nogil=True, error_model="numpy")
def unpack(packed, degree, inverse, coupling, norms, low, flat):  # type: ignore[no-untyped-def]
    """Fill the orders low, low + 1, ... of `flat` from packed sums, which are overwritten: `pack` transposed."""
    channels = flat.shape[1]
    for l in range(low, degree + 1):
        centre, end = l * (l + 1), min(low + packed.shape[0], l + 1)
        for m in range(low + (l - low) % 2, end, 2):
            cosine, sine = flat[centre + m], flat[centre - m]
            sums = packed[m - low, (l - m) // 2]
            for k in range(channels):
                sine[k] = norms[1, m] * sums[channels + k]
                cosine[k] = norms[0, m] * sums[k]
        for m in range(low + (l - low + 1) % 2, end, 2):
            cosine, sine, step = flat[centre + m], flat[centre - m], (l - m) // 2
            sums = packed[m - low, step]
            by = inverse[step, m]
            for k in range(2 * channels, 4 * channels):
                sums[k] *= by
            if step:
                below, less = packed[m - low, step - 1], by * coupling[step - 1, m]
                for k in range(2 * channels, 4 * channels):
                    sums[k] -= less * below[k]
            for k in range(channels):
                sine[k] = norms[1, m] * sums[3 * channels + k]
                cosine[k] = norms[0, m] * sums[2 * channels + k]
