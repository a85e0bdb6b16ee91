"""Fourier sums along the rows of an image, sixteen pairs of rows at once: the lanes of a vector are rows, not samples.

    f_c = sum over m of Z_m e^{2 pi i m (c + 1/2) / columns},   |m| <= degree; columns = phases n, c = phases i + s
        = sum over k < n of X_k e^{2 pi i k i / n}, X_k = sum of Z_m e^{2 pi i m (s + 1/2) / columns}, m = k (mod n)

with n >= 2 degree: each phase s is a transform of n points, and orders beyond the degree cost nothing. A northern row
is the real part of f and its mirror image the imaginary part, so that a pair takes one complex transform.

    rings    (tiles, orders, 4, C LANES): of sixteen pairs cosine and sine sums of the even part, then of the odd part
    planes   (2, size): real and imaginary parts; the C LANES lanes of element k start at at[k]; element n is spare
    turns    (phases, orders, 2): real and imaginary part of e^{2 pi i m (s + 1/2) / columns} / 2

The transform is Stockham's, where each pass reads one pair of planes and writes the other, and nothing is reversed.
With n = l r m, and for all j < l, k < m, p < r:

    y[k + m (r j + p)] = sum over q < r of e^{2 pi i (j p / (l r) + p q / r)} x[k + m (j + l q)]

`at` leaves gaps between quarters: parts that lie a power of two apart would share a few lines of the cache.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .legendre import LANES

_STRIP = 32  # pixels of a row that are written or read before the next row

# Sums may be reordered and fused so that they vectorise; NaN and infinity still spread as they should.
_FAST = {"reassoc", "contract", "nsz"}


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _fours(x, y, l, m, lanes, at, factors):  # type: ignore[no-untyped-def]
    """A pass of radix 4; factors (6 l,): e^{2 pi i j p / (4 l)} for p = 1, 2, 3."""
    run = m * lanes
    for j in range(l):
        w1, v1, w2, v2, w3, v3 = factors[6 * j : 6 * j + 6]
        i0, i1, i2, i3 = at[m * j], at[m * (j + l)], at[m * (j + 2 * l)], at[m * (j + 3 * l)]
        a, b, c, d = x[0, i0 : i0 + run], x[0, i1 : i1 + run], x[0, i2 : i2 + run], x[0, i3 : i3 + run]
        e, f, g, h = x[1, i0 : i0 + run], x[1, i1 : i1 + run], x[1, i2 : i2 + run], x[1, i3 : i3 + run]
        i0, i1, i2, i3 = at[4 * m * j], at[m * (4 * j + 1)], at[m * (4 * j + 2)], at[m * (4 * j + 3)]
        y0, y1, y2, y3 = y[0, i0 : i0 + run], y[0, i1 : i1 + run], y[0, i2 : i2 + run], y[0, i3 : i3 + run]
        z0, z1, z2, z3 = y[1, i0 : i0 + run], y[1, i1 : i1 + run], y[1, i2 : i2 + run], y[1, i3 : i3 + run]
        for k in range(run):
            ac, bd, eg, fh = a[k] + c[k], b[k] + d[k], e[k] + g[k], f[k] + h[k]
            a_c, b_d, e_g, f_h = a[k] - c[k], b[k] - d[k], e[k] - g[k], f[k] - h[k]
            y0[k], z0[k] = ac + bd, eg + fh
            y1[k], z1[k] = w1 * (a_c - f_h) - v1 * (e_g + b_d), w1 * (e_g + b_d) + v1 * (a_c - f_h)
            y2[k], z2[k] = w2 * (ac - bd) - v2 * (eg - fh), w2 * (eg - fh) + v2 * (ac - bd)
            y3[k], z3[k] = w3 * (a_c + f_h) - v3 * (e_g - b_d), w3 * (e_g - b_d) + v3 * (a_c + f_h)


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _pass(x, y, l, r, m, lanes, at, factors):  # type: ignore[no-untyped-def]
    """A pass of any radix r; factors (2 l r r,): those of the sum above for every j, p, q."""
    run = m * lanes
    for j in range(l):
        for p in range(r):
            low = at[m * (r * j + p)]
            real, imaginary = y[0, low : low + run], y[1, low : low + run]
            for q in range(r):
                i = at[m * (j + l * q)]
                a, b = x[0, i : i + run], x[1, i : i + run]
                w, v = factors[2 * ((j * r + p) * r + q)], factors[2 * ((j * r + p) * r + q) + 1]
                if q == 0:
                    for k in range(run):
                        real[k], imaginary[k] = w * a[k] - v * b[k], w * b[k] + v * a[k]
                else:
                    for k in range(run):
                        real[k], imaginary[k] = real[k] + w * a[k] - v * b[k], imaginary[k] + w * b[k] + v * a[k]


@njit(cache=True, nogil=True, error_model="numpy")
def _transform(planes, lanes, at, radices, factors):  # type: ignore[no-untyped-def]
    """Transform planes[0], by way of planes[1]; which of the two holds the result."""
    l, m, used, turn = at.size - 1, 1, 0, 0
    for r in radices:
        l //= r
        x, y = planes[turn], planes[1 - turn]
        if r == 4:
            _fours(x, y, l, m, lanes, at, factors[used : used + 6 * l])
            used += 6 * l
        else:
            _pass(x, y, l, r, m, lanes, at, factors[used : used + 2 * l * r * r])
            used += 2 * l * r * r
        m *= r
        turn = 1 - turn
    return turn


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _distribute(rings, cosines, turns, at, x):  # type: ignore[no-untyped-def]
    """X_k of the orders of one tile, (orders, 4, lanes), at one phase; odd parts count `cosines` (lanes,) times."""
    orders, lanes, n = rings.shape[0], rings.shape[2], at.size - 1
    for i in range(orders, n - orders + 1):
        x[0, at[i] : at[i] + lanes] = 0
        x[1, at[i] : at[i] + lanes] = 0
    for m in range(orders):
        alone = 2 * m == n or m == 0  # m and -m are one element
        i, j = at[m], at[n] if alone else at[n - m]
        a, b, c, d = rings[m, 0], rings[m, 1], rings[m, 2], rings[m, 3]
        p, q, r, s = x[0, i : i + lanes], x[1, i : i + lanes], x[0, j : j + lanes], x[1, j : j + lanes]
        w, v = turns[m]
        for k in range(lanes):
            odd, odd_sine = c[k] * cosines[k], d[k] * cosines[k]
            # Z_m = (north cosine - i sine) + i (south cosine - i sine), Z_-m with the other sign of the sines
            real, imaginary = (a[k] + odd) + (b[k] - odd_sine), (a[k] - odd) - (b[k] + odd_sine)
            back_real, back_imaginary = (a[k] + odd) - (b[k] - odd_sine), (a[k] - odd) + (b[k] + odd_sine)
            p[k], q[k] = w * real - v * imaginary, w * imaginary + v * real
            r[k], s[k] = w * back_real + v * back_imaginary, w * back_imaginary - v * back_real
        if alone:
            for k in range(lanes):
                p[k] += r[k]
                q[k] += s[k]


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _collect(x, weights, turns, at, rings):  # type: ignore[no-untyped-def]
    """Add one phase to `rings` from transformed planes of imaginary and real parts: `_distribute` transposed."""
    lanes, n = rings.shape[2], at.size - 1
    for m in range(rings.shape[0]):
        i, j = at[m], at[n - m] if m else at[0]
        a, b, c, d = rings[m, 0], rings[m, 1], rings[m, 2], rings[m, 3]
        p, q, r, s = x[1, i : i + lanes], x[0, i : i + lanes], x[1, j : j + lanes], x[0, j : j + lanes]
        w, v = turns[m]
        for k in range(lanes):
            real, imaginary = w * p[k] + v * q[k], w * q[k] - v * p[k]
            back_real, back_imaginary = w * r[k] - v * s[k], w * s[k] + v * r[k]
            a[k] += weights[0, k] * ((real + back_real) + (imaginary + back_imaginary))
            b[k] += weights[0, k] * ((real - back_real) - (imaginary - back_imaginary))
            c[k] += weights[1, k] * ((real + back_real) - (imaginary + back_imaginary))
            d[k] -= weights[1, k] * ((real - back_real) + (imaginary - back_imaginary))


@njit(cache=True, nogil=True, error_model="numpy")
def _scatter(x, lanes, at, phase, phases, low, image):  # type: ignore[no-untyped-def]
    """Write the pixels of one phase into the rows of `image` that are pairs from `low` on."""
    n, channels, real, imaginary = at.size - 1, lanes // LANES, x[0], x[1]
    one, two = np.uintp(LANES), np.uintp(2 * LANES)  # unsigned indices are not tested for counting from the end
    for first in range(0, n, _STRIP):
        for lane in range(min(LANES, (image.shape[0] + 1) // 2 - low)):
            north, south = image[low + lane], image[image.shape[0] - 1 - low - lane]
            for i in range(first, min(first + _STRIP, n)):
                o, p = np.uintp(at[i] + lane), np.uintp((phases * i + phase) * channels)
                if channels == 3:
                    q, r = p + np.uintp(1), p + np.uintp(2)
                    north[p], north[q], north[r] = real[o], real[o + one], real[o + two]
                    south[p], south[q], south[r] = imaginary[o], imaginary[o + one], imaginary[o + two]
                else:
                    for k in range(channels):
                        north[p + np.uintp(k)] = real[o + np.uintp(k) * one]
                        south[p + np.uintp(k)] = imaginary[o + np.uintp(k) * one]


@njit(cache=True, nogil=True, error_model="numpy")
def _gather(image, lanes, at, phase, phases, low, x):  # type: ignore[no-untyped-def]
    """Read what `_scatter` writes, but northern rows as imaginary parts: so the transform runs the other way round.

    The equator of odd rows is its own mirror image and comes twice; lanes without a pair become 0.
    """
    n, channels, real, imaginary = at.size - 1, lanes // LANES, x[0], x[1]
    one, two = np.uintp(LANES), np.uintp(2 * LANES)
    pairs = min(LANES, (image.shape[0] + 1) // 2 - low)
    if pairs < LANES:
        x[:] = 0
    for first in range(0, n, _STRIP):
        for lane in range(pairs):
            north, south = image[low + lane], image[image.shape[0] - 1 - low - lane]
            for i in range(first, min(first + _STRIP, n)):
                o, p = np.uintp(at[i] + lane), np.uintp((phases * i + phase) * channels)
                if channels == 3:
                    q, r = p + np.uintp(1), p + np.uintp(2)
                    real[o], real[o + one], real[o + two] = south[p], south[q], south[r]
                    imaginary[o], imaginary[o + one], imaginary[o + two] = north[p], north[q], north[r]
                else:
                    for k in range(channels):
                        real[o + np.uintp(k) * one] = south[p + np.uintp(k)]
                        imaginary[o + np.uintp(k) * one] = north[p + np.uintp(k)]


@njit(cache=True, nogil=True, error_model="numpy")
def synthesise(rings, cosines, turns, at, radices, factors, image):  # type: ignore[no-untyped-def]
    """Fill `image` (rows, columns C) from `rings`, whose odd parts count cosines (tiles, lanes) times."""
    lanes = rings.shape[3]
    planes = np.empty((2, 2, at[-1] + lanes), rings.dtype)
    for tile in range(rings.shape[0]):
        for phase in range(turns.shape[0]):
            _distribute(rings[tile], cosines[tile], turns[phase], at, planes[0])
            result = _transform(planes, lanes, at, radices, factors)
            _scatter(planes[result], lanes, at, phase, turns.shape[0], tile * LANES, image)


@njit(cache=True, nogil=True, error_model="numpy")
def analyse(image, weights, turns, at, radices, factors, rings):  # type: ignore[no-untyped-def]
    """Fill `rings` from `image` (rows, columns C), even and odd parts times weights (tiles, 2, lanes)."""
    lanes = rings.shape[3]
    planes = np.empty((2, 2, at[-1] + lanes), rings.dtype)
    rings[:] = 0
    for tile in range(rings.shape[0]):
        for phase in range(turns.shape[0]):
            _gather(image, lanes, at, phase, turns.shape[0], tile * LANES, planes[0])
            result = _transform(planes, lanes, at, radices, factors)
            _collect(planes[result], weights[tile], turns[phase], at, rings[tile])
