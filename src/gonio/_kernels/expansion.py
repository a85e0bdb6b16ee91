"""Look-ups in maps of harmonics: at each direction of a lat-long grid a series in real harmonics of where the eye is.

    out[k] = gain[k] sum over t of Y_t(eye[k]) map_t(w[k])

The maps are sums of cubic B-splines, a sheet as in `splines.py` with T C numbers for each place, harmonic by harmonic.
The harmonics are

    Y_l,+-m = Q_lm (cos, sin)(m phi) sin^m theta,     Q_lm = a_lm z Q_l-1,m - b_lm Q_l-2,m,     Q_mm = d_m

with a, b, d as `factors` (3, (degree + 1)^2) at index l (l + 1) + m, norms of the real harmonics taken in.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .environment import in_latlong
from .splines import GHOSTS, splines

_BLOCK = 256

# Sums may be reordered and fused so that they vectorise; NaN and infinity still spread as they should.
_FAST = {"contract", "nsz", "reassoc"}


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
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


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _gather(sheet, y, x, terms):  # type: ignore[no-untyped-def]
    """terms (T C,): the maps at row y and column x of the sheet."""
    i, j = int(y), int(x)
    rows, columns = splines(y - i), splines(x - j)
    terms[:] = 0
    for q in range(4):
        for r in range(4):
            low = (j - 1 + r) * terms.size
            near, share = sheet[i - 1 + q, low : low + terms.size], sheet.dtype.type(rows[q] * columns[r])
            for k in range(terms.size):
                terms[k] += share * near[k]


@njit(cache=True, nogil=True, error_model="numpy")
def look_up(sheet, border, columns, degree, factors, w, eyes, gain, out):  # type: ignore[no-untyped-def]
    """Fill `out` (n, C) at unit directions w (n, 3), for unit eyes (n, 3), or (1, 3) for a far one; gain (n,)."""
    u, v = np.empty(_BLOCK), np.empty(_BLOCK)
    x, y, z = np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK)
    count, channels, rows = (degree + 1) ** 2, out.shape[1], sheet.shape[0] - 2 * border
    eye, terms = np.empty(count), np.empty(count * channels, sheet.dtype)
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
            _gather(sheet, v[k] * rows + (border - 0.5), u[k] * columns + (GHOSTS - 0.5), terms)
            for c in range(channels):
                total = 0.0
                for t in range(count):
                    total += eye[t] * terms[t * channels + c]
                out[start + k, c] = gain[start + k] * total
