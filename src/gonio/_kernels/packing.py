"""Coefficients brought to where the sums over theta read them, and back, for some orders at a time.

The array code of `sphere/packing.py` says the same for arrays of other libraries, but for `turn`: one complex number an
order, that multiplies cosine + i sine. It is where the norm of the real harmonics and a shift in phi cost least.
"""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def pack(flat, degree, inverse, coupling, turn, low, packed):  # type: ignore[no-untyped-def]
    """Packed coefficients (orders, steps, 4 C) of the orders low, low + 1, ... from flat ((degree + 1)^2, C)."""
    channels = flat.shape[1]
    zero = flat.dtype.type(0)
    packed[:] = 0
    for l in range(degree, low - 1, -1):
        for m in range(low, min(low + packed.shape[0], l + 1)):
            real, imaginary = turn[m].real, turn[m].imag
            step, odd = (l - m) // 2, (l - m) % 2
            for k in range(channels):
                given_cosine, given_sine = flat[l * (l + 1) + m, k], flat[l * (l + 1) - m, k] if m else zero
                cosine = real * given_cosine - imaginary * given_sine
                sine = real * given_sine + imaginary * given_cosine
                at = 2 * channels * odd + k
                if odd:
                    if l + 2 <= degree:
                        cosine -= coupling[step, m] * packed[m - low, step + 1, at]
                        sine -= coupling[step, m] * packed[m - low, step + 1, at + channels]
                    cosine *= inverse[step, m]
                    sine *= inverse[step, m]
                packed[m - low, step, at] = cosine
                packed[m - low, step, at + channels] = sine


@njit(cache=True, nogil=True, error_model="numpy")
def unpack(packed, degree, inverse, coupling, turn, low, flat):  # type: ignore[no-untyped-def]
    """Fill the orders low, low + 1, ... of `flat` from packed sums, which are overwritten: `pack` transposed."""
    channels = flat.shape[1]
    for l in range(low, degree + 1):
        for m in range(low, min(low + packed.shape[0], l + 1)):
            real, imaginary = turn[m].real, turn[m].imag
            step, odd = (l - m) // 2, (l - m) % 2
            for k in range(channels):
                at = 2 * channels * odd + k
                cosine, sine = packed[m - low, step, at], packed[m - low, step, at + channels]
                if odd:
                    if step:
                        cosine -= coupling[step - 1, m] * packed[m - low, step - 1, at]
                        sine -= coupling[step - 1, m] * packed[m - low, step - 1, at + channels]
                    cosine *= inverse[step, m]
                    sine *= inverse[step, m]
                    packed[m - low, step, at] = cosine
                    packed[m - low, step, at + channels] = sine
                if m:
                    flat[l * (l + 1) - m, k] = real * sine + imaginary * cosine
                flat[l * (l + 1) + m, k] = real * cosine - imaginary * sine
