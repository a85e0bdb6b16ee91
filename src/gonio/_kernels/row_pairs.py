"""An image's rows <-> the sums and differences of its mirror rows, one line a channel, folded for products.

    line       (2 C, columns): sums of a northern row and its mirror image, then differences; C channels each
    quarters   four arrays (pairs, 2 C, columns / 4): what is left of a line for cos(m phi) of even m and of odd m, then
               for sin(m phi) of even m and of odd m, where column c lies at phi_c = (c + 1/2) 2 pi / columns

`fold` and `unfold` are a sum and its transpose. Indices are unsigned where they run backwards, since numba would test
signed ones for wrapping around, and where they take every third number, which would cost half as much again otherwise.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# Sums may be fused so that they vectorise; NaN and infinity still spread as they should.
_FAST = {"contract", "nsz"}


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _gather(north, south, x, y, line):  # type: ignore[no-untyped-def]
    """Sums of the two rows (columns C,) times x, and differences times y, into `line`."""
    channels, columns = line.shape[0] // 2, line.shape[1]
    if channels == 3:
        a, b, c = line[0], line[1], line[2]
        d, e, f = line[3], line[4], line[5]
        for i in range(columns):
            j = np.uintp(3 * i)
            n0, n1, n2 = north[j], north[j + np.uintp(1)], north[j + np.uintp(2)]
            s0, s1, s2 = south[j], south[j + np.uintp(1)], south[j + np.uintp(2)]
            a[i], b[i], c[i] = x * (n0 + s0), x * (n1 + s1), x * (n2 + s2)
            d[i], e[i], f[i] = y * (n0 - s0), y * (n1 - s1), y * (n2 - s2)
    else:
        for k in range(channels):
            for i in range(columns):
                n0, s0 = north[i * channels + k], south[i * channels + k]
                line[k, i] = x * (n0 + s0)
                line[channels + k, i] = y * (n0 - s0)


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _scatter(line, by, north, south):  # type: ignore[no-untyped-def]
    """The two rows (columns C,) whose sums and, times `by`, whose differences the line holds."""
    channels, columns = line.shape[0] // 2, line.shape[1]
    if channels == 3:
        for i in range(columns):
            south[3 * i] = line[0, i] - by * line[3, i]
            south[3 * i + 1] = line[1, i] - by * line[4, i]
            south[3 * i + 2] = line[2, i] - by * line[5, i]
        for i in range(columns):
            north[3 * i] = line[0, i] + by * line[3, i]
            north[3 * i + 1] = line[1, i] + by * line[4, i]
            north[3 * i + 2] = line[2, i] + by * line[5, i]
    else:
        for c in range(channels):
            for i in range(columns):
                even, odd = line[c, i], by * line[channels + c, i]
                south[i * channels + c] = even - odd
                north[i * channels + c] = even + odd


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _fold(line, p, cos_even, cos_odd, sin_even, sin_odd):  # type: ignore[no-untyped-def]
    quarter = np.uintp(cos_even.shape[2])
    half, last = quarter + quarter, quarter + quarter + quarter + quarter - np.uintp(1)
    before = half - np.uintp(1)
    for k in range(line.shape[0]):
        for j in range(cos_even.shape[2]):
            i = np.uintp(j)
            a, b, c, d = line[k, i], line[k, before - i], line[k, half + i], line[k, last - i]
            cos_even[p, k, i] = (a + d) + (b + c)
            cos_odd[p, k, i] = (a + d) - (b + c)
            sin_even[p, k, i] = (a - d) - (b - c)
            sin_odd[p, k, i] = (a - d) + (b - c)


@njit(cache=True, nogil=True, error_model="numpy")
def fold(image, weights, low, cos_even, cos_odd, sin_even, sin_odd):  # type: ignore[no-untyped-def]
    """Fill the quarters from `image` (rows, columns C), from the pair `low` on; both kinds times weights (2, pairs).

    phi, pi - phi, pi + phi and -phi share cosine and sine up to signs. The equator of odd rows is its own mirror image
    and comes twice.
    """
    line = np.empty((cos_even.shape[1], 4 * cos_even.shape[2]), image.dtype)
    for p in range(cos_even.shape[0]):
        r = low + p
        _gather(image[r], image[image.shape[0] - 1 - r], weights[0, r], weights[1, r], line)
        _fold(line, p, cos_even, cos_odd, sin_even, sin_odd)


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _unfold(cos_even, cos_odd, sin_even, sin_odd, p, line):  # type: ignore[no-untyped-def]
    n = cos_even.shape[2]
    for k in range(line.shape[0]):
        first, second = line[k, :n], line[k, n : 2 * n]
        third, fourth = line[k, 2 * n : 3 * n], line[k, 3 * n : 4 * n]
        x, y, z, w = cos_even[p, k], cos_odd[p, k], sin_even[p, k], sin_odd[p, k]
        for i in range(n):
            back = np.uintp(n - 1 - i)  # subtracted as signed numbers, which LLVM sees run backwards
            a, b, c, d = x[i], y[i], z[i], w[i]
            first[i] = (a + b) + (c + d)
            second[back] = (a - b) - (c - d)
            third[i] = (a - b) + (c - d)
            fourth[back] = (a + b) - (c + d)


@njit(cache=True, nogil=True, error_model="numpy")
def unfold(cos_even, cos_odd, sin_even, sin_odd, cosines, low, image):  # type: ignore[no-untyped-def]
    """Fill the rows of `image` (rows, columns C) from the pair `low` on; differences count cosines[pair] times."""
    line = np.empty((cos_even.shape[1], 4 * cos_even.shape[2]), image.dtype)
    for p in range(cos_even.shape[0]):
        r = low + p
        _unfold(cos_even, cos_odd, sin_even, sin_odd, p, line)
        _scatter(line, cosines[r], image[r], image[image.shape[0] - 1 - r])
