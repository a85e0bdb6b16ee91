"""Cubic B-splines on lat-long grids: the filter that makes them interpolate, look-ups, and look-ups transposed.

A sheet (rows + 2 GHOSTS, (columns + 2 GHOSTS) C) holds a grid with rows beyond either pole, where it goes on half a
turn away, and columns before the first and after the last. Position x in samples lies between those at j = floor(x)
and j + 1; at t = x - j the four splines about it are

    (1 - t)^3 / 6,   (4 - 6 t^2 + 3 t^3) / 6,   the second at 1 - t,   t^3 / 6
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

GHOSTS = 2
POLE = math.sqrt(3.0) - 2.0  # of the filter that undoes (1, 4, 1) / 6

_REACH = 30  # POLE^30 = 7e-18
_PIECE = 1024  # numbers of a row at a time, so that what is added up stays in the first cache

# Sums may be fused so that they vectorise; NaN and infinity still spread as they should.
_FAST = {"contract", "nsz"}


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def sharpen(grid):  # type: ignore[no-untyped-def]
    """Undo (1, 4, 1) / 6 along the meridians of `grid` (rows, width), in place and across the poles.

    The inverse is sqrt(3) sum over k of POLE^abs(k): a recursion down, and one up. What they start from at either pole
    is summed on beyond it, until nothing is left.
    """
    rows, width = grid.shape
    pole, end = grid.dtype.type(POLE), grid.dtype.type(-6 * POLE)
    first, last = np.zeros(width, grid.dtype), np.zeros(width, grid.dtype)
    for k in range(_REACH, 0, -1):
        factor = POLE**k
        _add_row(first, grid, -k, factor)
        _add_row(last, grid, rows - 1 - k, math.sqrt(3.0) * factor)
        _add_row(last, grid, rows - 1 + k, math.sqrt(3.0) * factor)
    _add_row(last, grid, rows - 1, math.sqrt(3.0))
    for i in range(width):
        grid[0, i] += first[i]
    for r in range(1, rows):
        line, before = grid[r], grid[r - 1]
        for i in range(width):
            line[i] += pole * before[i]
    for i in range(width):
        grid[rows - 1, i] = last[i]
    for r in range(rows - 2, -1, -1):
        line, after = grid[r], grid[r + 1]
        for i in range(width):
            line[i] = end * line[i] + pole * after[i]


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _add_row(total, grid, r, factor):  # type: ignore[no-untyped-def]
    """total += factor times row r, counted along the great circle of the meridians."""
    rows, width = grid.shape
    at, by, half = r % (2 * rows), total.dtype.type(factor), width // 2
    if at < rows:
        line = grid[at]
        for i in range(width):
            total[i] += by * line[i]
    else:
        line = grid[2 * rows - 1 - at]
        for i in range(half):
            total[i] += by * line[half + i]
            total[half + i] += by * line[i]


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def splines(t):  # type: ignore[no-untyped-def]
    """The four that overlap at t in [0, 1]."""
    s = 1.0 - t
    return s * s * s / 6, (4 + t * t * (3 * t - 6)) / 6, (4 + s * s * (3 * s - 6)) / 6, t * t * t / 6


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def look_up(sheet, columns, v, u, out):  # type: ignore[no-untyped-def]
    """`out` (n, C), C is 1 or 3: what the splines of `sheet` sum to at theta = pi v, phi = 2 pi u, both (n,)."""
    channels = out.shape[1]
    rows = sheet.shape[0] - 2 * GHOSTS
    number = sheet.dtype.type
    sums = np.empty(12, sheet.dtype)
    for k in range(out.shape[0]):
        y, x = v[k] * rows + (GHOSTS - 0.5), u[k] * columns + (GHOSTS - 0.5)
        i, j = int(y), int(x)
        a, b, c, d = splines(y - i)
        a, b, c, d = number(a), number(b), number(c), number(d)
        e, f, g, h = splines(x - j)
        e, f, g, h = number(e), number(f), number(g), number(h)
        low, high = (j - 1) * channels, (j + 3) * channels
        first, second = sheet[i - 1, low:high], sheet[i, low:high]
        third, fourth = sheet[i + 1, low:high], sheet[i + 2, low:high]
        if channels == 3:
            for q in range(12):  # constants, so that the loops become vectors
                sums[q] = a * first[q] + b * second[q] + c * third[q] + d * fourth[q]
            for q in range(3):
                out[k, q] = e * sums[q] + f * sums[3 + q] + g * sums[6 + q] + h * sums[9 + q]
        else:
            for q in range(4):
                sums[q] = a * first[q] + b * second[q] + c * third[q] + d * fourth[q]
            out[k, 0] = e * sums[0] + f * sums[1] + g * sums[2] + h * sums[3]


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def thin(image, weights, taps, sheet):  # type: ignore[no-untyped-def]
    """Fill `sheet` with `image` (rows, columns C), row r times weights[r], on splines `factor` times as coarse.

    The look-up of every pixel's centre, transposed. taps (factor, 4): the splines at t = (k + 1/2) / factor, factor
    even. sheet (rows / factor + 2 GHOSTS, columns / factor + 2 GHOSTS, C).
    """
    rows, width = image.shape
    factor = taps.shape[0]
    lines = np.zeros((4, width), image.dtype)
    coarse = np.empty((sheet.shape[2], sheet.shape[1]), image.dtype)
    phases = np.zeros((sheet.shape[2], factor, sheet.shape[1] - 2 * GHOSTS + 1), image.dtype)
    for g in range(sheet.shape[0]):
        # Rows between the grid's rows g - 1 and g, which touch those from g - 2 to g + 1.
        start = g * factor - factor // 2
        low, high = max(start, 0), min(start + factor, rows)
        if low < high:
            _spread(image[low:high], weights[low:high], taps[low - start :], g, lines)
        coarse[:] = 0
        _gather(lines[g % 4], taps, phases, coarse)
        lines[g % 4] = 0
        for i in range(sheet.shape[1]):
            for q in range(sheet.shape[2]):
                sheet[g, i, q] = coarse[q, i]


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _spread(some, weights, taps, g, lines):  # type: ignore[no-untyped-def]
    """Add a few rows (few, width), all between the same two of the grid, to the four lines that they touch."""
    few, width = some.shape
    for start in range(0, width, _PIECE):
        stop = min(start + _PIECE, width)
        p, q = lines[g % 4, start:stop], lines[(g + 1) % 4, start:stop]
        r, s = lines[(g + 2) % 4, start:stop], lines[(g + 3) % 4, start:stop]
        for k in range(few % 2):
            x, w = some[k, start:stop], weights[k]
            a, b, c, d = w * taps[k, 0], w * taps[k, 1], w * taps[k, 2], w * taps[k, 3]
            for i in range(p.size):
                p[i] += a * x[i]
                q[i] += b * x[i]
                r[i] += c * x[i]
                s[i] += d * x[i]
        for k in range(few % 2, few, 2):
            n = k + 1
            x, y, w, v = some[k, start:stop], some[n, start:stop], weights[k], weights[n]
            a, b, c, d = w * taps[k, 0], w * taps[k, 1], w * taps[k, 2], w * taps[k, 3]
            e, f, h, o = v * taps[n, 0], v * taps[n, 1], v * taps[n, 2], v * taps[n, 3]
            for i in range(p.size):
                p[i] += a * x[i] + e * y[i]
                q[i] += b * x[i] + f * y[i]
                r[i] += c * x[i] + h * y[i]
                s[i] += d * x[i] + o * y[i]


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _gather(line, taps, phases, coarse):  # type: ignore[no-untyped-def]
    """Add a line (columns C,) to `coarse` (C, columns / factor + 2 GHOSTS); `phases` begin as 0."""
    channels, factor, steps = phases.shape
    for q in range(channels):
        for k in range(0, factor, 2):
            # Columns k of every group of `factor` that begins half a group before a column of the grid.
            first, second = phases[q, k], phases[q, k + 1]
            for h in range(steps):
                j = h * factor - factor // 2 + k
                if 0 <= j < (steps - 1) * factor:
                    first[h] = line[j * channels + q]
                if 0 <= j + 1 < (steps - 1) * factor:
                    second[h] = line[(j + 1) * channels + q]
            for tap in range(4):
                a, b = taps[k, tap], taps[k + 1, tap]
                out = coarse[q, tap : tap + steps]
                for h in range(steps):
                    out[h] += a * first[h] + b * second[h]
