"""Look-ups in maps of harmonics: at each direction of a lat-long map a series in real harmonics of where the eye is.

    out[k] = gain[k] sum over t of Y_t(eye[k]) map_t(w[k]),      map_t bilinear between texel centres

The atlas is that of `environment.py`, (h + 2) (w + 2) texels of T C numbers, harmonic by harmonic. The harmonics are

    Y_l,+-m = Q_lm (cos, sin)(m phi) sin^m theta,     Q_lm = a_lm z Q_l-1,m - b_lm Q_l-2,m,     Q_mm = d_m

with a, b, d as `factors` (3, (degree + 1)^2) at index l (l + 1) + m, norms of the real harmonics taken in.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .environment import in_latlong

_BLOCK = 256


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"}, error_model="numpy")
def harmonics(degree, factors, x, y, z, out):  # type: ignore[no-untyped-def]
    """Y_lm of the unit direction (x, y, z), ((degree + 1)^2,)."""
    c, s = 1.0, 0.0  # Re and Im of (x + i y)^m
    for m in range(degree + 1):
        before, now = 0.0, factors[2, m * (m + 1) + m]
        for l in range(m, degree + 1):
            at = l * (l + 1)
            if l > m:
                before, now = now, factors[0, at + m] * z * now - factors[1, at + m] * before
            out[at + m] = now * c
            if m:
                out[at - m] = now * s
        c, s = x * c - y * s, x * s + y * c


@njit(cache=True, nogil=True, fastmath={"contract", "nsz", "reassoc"}, error_model="numpy")
def _blend(texels, at, stride, f, g, eye, out):  # type: ignore[no-untyped-def]
    """Add the series `eye` (T,) of the four texels around to out (C,)."""
    channels = out.size
    for q in range(2):
        for r in range(2):
            share = (f if q else 1 - f) * (g if r else 1 - g)
            row = texels[at + q * stride + r]
            if channels == 3:
                a, b, c = 0.0, 0.0, 0.0
                for t in range(eye.size):
                    a += eye[t] * row[3 * t]
                    b += eye[t] * row[3 * t + 1]
                    c += eye[t] * row[3 * t + 2]
                out[0] += share * a
                out[1] += share * b
                out[2] += share * c
            else:
                for t in range(eye.size):
                    for k in range(channels):
                        out[k] += share * eye[t] * row[channels * t + k]


@njit(cache=True, nogil=True, error_model="numpy")
def look_up(height, width, texels, degree, factors, w, eyes, gain, out):  # type: ignore[no-untyped-def]
    """Fill `out` (n, C) at unit directions w (n, 3), for unit eyes (n, 3), or (1, 3) for a far one; gain (n,)."""
    u, v = np.empty(_BLOCK), np.empty(_BLOCK)
    x, y, z = np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK)
    eye, total = np.empty((degree + 1) ** 2), np.empty(out.shape[1])
    stride = width + 2
    if eyes.shape[0] == 1:
        harmonics(degree, factors, eyes[0, 0], eyes[0, 1], eyes[0, 2], eye)
    for start in range(0, w.shape[0], _BLOCK):
        n = min(_BLOCK, w.shape[0] - start)
        for k in range(n):
            x[k], y[k], z[k] = w[start + k, 0], w[start + k, 1], w[start + k, 2]
        in_latlong(n, x, y, z, u, v)
        for k in range(n):
            if eyes.shape[0] > 1:
                harmonics(degree, factors, eyes[start + k, 0], eyes[start + k, 1], eyes[start + k, 2], eye)
            row, column = v[k] * height + 0.5, u[k] * width + 0.5
            i, j = min(max(int(row), 0), height), min(max(int(column), 0), width)
            total[:] = 0
            _blend(texels, i * stride + j, stride, row - i, column - j, eye, total)
            for c in range(out.shape[1]):
                out[start + k, c] = gain[start + k] * total[c]
