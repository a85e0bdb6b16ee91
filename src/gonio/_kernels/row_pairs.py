"""An image's rows <-> the sums and differences of its mirror rows, one line a channel, and what follows along a line.

    lines      (2 C, pairs, columns): sums of a northern row and its mirror image, then differences; C channels each
    quarters   four arrays (pairs, 2 C, columns / 4): what is left of a line for cos(m phi) of even m and of odd m, then
               for sin(m phi) of even m and of odd m, where column c lies at phi_c = (c + 1/2) 2 pi / columns
    rings      (orders, 4 C, all pairs): cosine sums of the sums, sine sums of them, the same of the differences

Each pair of functions is a sum and its transpose. Indices are unsigned where they run backwards, since numba would test
signed ones for wrapping around, and where they take every third number, which would cost half as much again otherwise.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# Sums may be fused so that they vectorise; NaN and infinity still spread as they should.
_FAST = {"contract", "nsz"}


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def gather(image, weights, low, lines):  # type: ignore[no-untyped-def]
    """Fill `lines` from `image` (rows, columns C), from the pair `low` on; both kinds times weights (2, pairs).

    The equator of odd rows is its own mirror image and comes twice.
    """
    channels, columns = lines.shape[0] // 2, lines.shape[2]
    for p in range(lines.shape[1]):
        r, s = low + p, image.shape[0] - 1 - low - p
        x, y = weights[0, r], weights[1, r]
        if channels == 3:
            north, south = image[r], image[s]
            a, b, c = lines[0, p], lines[1, p], lines[2, p]
            d, e, f = lines[3, p], lines[4, p], lines[5, p]
            for i in range(columns):
                j = np.uintp(3 * i)
                n0, n1, n2 = north[j], north[j + np.uintp(1)], north[j + np.uintp(2)]
                s0, s1, s2 = south[j], south[j + np.uintp(1)], south[j + np.uintp(2)]
                a[i], b[i], c[i] = x * (n0 + s0), x * (n1 + s1), x * (n2 + s2)
                d[i], e[i], f[i] = y * (n0 - s0), y * (n1 - s1), y * (n2 - s2)
        else:
            for k in range(channels):
                for i in range(columns):
                    n0, s0 = image[r, i * channels + k], image[s, i * channels + k]
                    lines[k, p, i] = x * (n0 + s0)
                    lines[channels + k, p, i] = y * (n0 - s0)


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def scatter(lines, cosines, low, image):  # type: ignore[no-untyped-def]
    """Fill the rows of `image` (rows, columns C) from the pair `low` on; differences count cosines[pair] times."""
    channels, columns = lines.shape[0] // 2, lines.shape[2]
    for p in range(lines.shape[1]):
        r, s = low + p, image.shape[0] - 1 - low - p
        by = cosines[low + p]
        if channels == 3:
            for i in range(columns):
                image[s, 3 * i] = lines[0, p, i] - by * lines[3, p, i]
                image[s, 3 * i + 1] = lines[1, p, i] - by * lines[4, p, i]
                image[s, 3 * i + 2] = lines[2, p, i] - by * lines[5, p, i]
            for i in range(columns):
                image[r, 3 * i] = lines[0, p, i] + by * lines[3, p, i]
                image[r, 3 * i + 1] = lines[1, p, i] + by * lines[4, p, i]
                image[r, 3 * i + 2] = lines[2, p, i] + by * lines[5, p, i]
        else:
            for c in range(channels):
                for i in range(columns):
                    even, odd = lines[c, p, i], by * lines[channels + c, p, i]
                    image[s, i * channels + c] = even - odd
                    image[r, i * channels + c] = even + odd


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _fold(line, p, cos_even, cos_odd, sin_even, sin_odd):  # type: ignore[no-untyped-def]
    quarter = np.uintp(cos_even.shape[2])
    half, last = quarter + quarter, quarter + quarter + quarter + quarter - np.uintp(1)
    before = half - np.uintp(1)
    for k in range(line.shape[0]):
        for j in range(cos_even.shape[2]):
            i = np.uintp(j)
            a, b, c, d = line[k, 0, i], line[k, 0, before - i], line[k, 0, half + i], line[k, 0, last - i]
            cos_even[p, k, i] = (a + d) + (b + c)
            cos_odd[p, k, i] = (a + d) - (b + c)
            sin_even[p, k, i] = (a - d) - (b - c)
            sin_odd[p, k, i] = (a - d) + (b - c)


@njit(cache=True, nogil=True, error_model="numpy")
def fold(image, weights, low, cos_even, cos_odd, sin_even, sin_odd):  # type: ignore[no-untyped-def]
    """`gather`, and the lines into quarters: phi, pi - phi, pi + phi and -phi share cosine and sine up to signs."""
    line = np.empty((cos_even.shape[1], 1, 4 * cos_even.shape[2]), image.dtype)
    for p in range(cos_even.shape[0]):
        gather(image, weights, low + p, line)
        _fold(line, p, cos_even, cos_odd, sin_even, sin_odd)


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _unfold(cos_even, cos_odd, sin_even, sin_odd, p, line):  # type: ignore[no-untyped-def]
    n = cos_even.shape[2]
    for k in range(line.shape[0]):
        first, second = line[k, 0, :n], line[k, 0, n : 2 * n]
        third, fourth = line[k, 0, 2 * n : 3 * n], line[k, 0, 3 * n : 4 * n]
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
    """The quarters into lines, and `scatter`."""
    line = np.empty((cos_even.shape[1], 1, 4 * cos_even.shape[2]), image.dtype)
    for p in range(cos_even.shape[0]):
        _unfold(cos_even, cos_odd, sin_even, sin_odd, p, line)
        scatter(line, cosines, low + p, image)


@njit(cache=True, nogil=True, error_model="numpy")
def collect(waves, low, rings):  # type: ignore[no-untyped-def]
    """Fill `rings` from the pair `low` on from waves (2 C, pairs, orders or more) = cos - i sin."""
    channels = waves.shape[0] // 2
    for k in range(waves.shape[0]):
        cosine, sine = np.uintp(k + k // channels * channels), np.uintp(k + (k // channels + 1) * channels)
        for m in range(rings.shape[0]):
            for p in range(waves.shape[1]):
                r = np.uintp(low) + np.uintp(p)
                rings[m, cosine, r] = waves[k, p, m].real
                rings[m, sine, r] = -waves[k, p, m].imag


@njit(cache=True, nogil=True, error_model="numpy")
def distribute(rings, low, waves):  # type: ignore[no-untyped-def]
    """Fill `waves` (2 C, pairs, orders or more) from `rings` from the pair `low` on; orders beyond them become 0."""
    channels = waves.shape[0] // 2
    waves[:, :, rings.shape[0] :] = 0
    for k in range(waves.shape[0]):
        cosine, sine = np.uintp(k + k // channels * channels), np.uintp(k + (k // channels + 1) * channels)
        for m in range(rings.shape[0]):
            for p in range(waves.shape[1]):
                r = np.uintp(low) + np.uintp(p)
                waves[k, p, m] = complex(rings[m, cosine, r], -rings[m, sine, r])
