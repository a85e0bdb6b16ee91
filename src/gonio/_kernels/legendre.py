"""Sums over sequences that obey a three-term recursion, at many arguments at once: the inner loops of `sphere`.

    P_0 = start 2^(512 level),   P_{i+1} = (a_i t + b_i) P_i - P_{i-1}
    synthesise   ring_r[m, k] = sum_i coefficients[m, i, k] scale[m, i] P_i(m, t_r)
    analyse      coefficients[m, i, k] = sum_r ring_r[m, k] scale[m, i] P_i(m, t_r)

Rings stand in tiles, (tiles, orders, channels, LANES): ring r in lane r % LANES of tile r // LANES.

Eight steps are taken for a block of rings that stays in the first cache, then used for every channel k. The recursion
runs in float64, the sums in the dtype of the channels. Steps come in eights, channels in pairs.

`level` < 0 marks numbers too small to matter; they count as 0 until the recursion has lifted them to level 0. They are
looked at after every eight steps, and 2^512 is the root of a float64's range: a number of 2^-513 or more has 509 powers
of two below it before it loses digits, and one below 1 stays below 2^512 if each step multiplies by less than 2^64.
"""

from __future__ import annotations

import numpy as np
from numba import njit

BLOCK = 2048  # bytes of rings: less, and entering the loops costs as much as they do; more, and the first cache is full
EIGHT = 8
LANES = 16  # rings are taken in multiples of this, so that vectorised loops leave no remainder
_LIFT = 2.0**-512

# Sums may be reordered and fused so that they vectorise; NaN and infinity still spread as they should.
_FAST = {"reassoc", "contract", "nsz"}


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _advance(steps, t, last, now, a, b, m, i, count):  # type: ignore[no-untyped-def]
    """P_i .. P_{i+7} into `steps`; `last` and `now` go from P_{i-1}, P_i to P_{i+7}, P_{i+8}."""
    a0, a1, a2, a3 = a[m, i], a[m, i + 1], a[m, i + 2], a[m, i + 3]
    a4, a5, a6, a7 = a[m, i + 4], a[m, i + 5], a[m, i + 6], a[m, i + 7]
    b0, b1, b2, b3 = b[m, i], b[m, i + 1], b[m, i + 2], b[m, i + 3]
    b4, b5, b6, b7 = b[m, i + 4], b[m, i + 5], b[m, i + 6], b[m, i + 7]
    for r in range(count):
        u, v, x = last[r], now[r], t[r]
        steps[0, r] = v
        u = (a0 * x + b0) * v - u
        steps[1, r] = u
        v = (a1 * x + b1) * u - v
        steps[2, r] = v
        u = (a2 * x + b2) * v - u
        steps[3, r] = u
        v = (a3 * x + b3) * u - v
        steps[4, r] = v
        u = (a4 * x + b4) * v - u
        steps[5, r] = u
        v = (a5 * x + b5) * u - v
        steps[6, r] = v
        u = (a6 * x + b6) * v - u
        steps[7, r] = u
        v = (a7 * x + b7) * u - v
        last[r], now[r] = u, v


@njit(cache=True, nogil=True, error_model="numpy")
def _lift(steps, last, now, level, count):  # type: ignore[no-untyped-def]
    """Clear the steps that lie below the range, lift what has grown to 1, return how many rings are in range now."""
    ready = 0
    for r in range(count):
        if level[r] < 0:
            for j in range(EIGHT):
                steps[j, r] = 0
            if abs(now[r]) > 1:
                now[r] *= _LIFT
                last[r] *= _LIFT
                level[r] += 1
        if level[r] >= 0:
            ready += 1
    return ready


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _accumulate(sums, steps, weights, i, count):  # type: ignore[no-untyped-def]
    for k in range(0, sums.shape[0], 2):
        for j in range(0, EIGHT, 4):
            f0, f1, f2, f3 = weights[k, i + j], weights[k, i + j + 1], weights[k, i + j + 2], weights[k, i + j + 3]
            n = k + 1
            g0, g1, g2, g3 = weights[n, i + j], weights[n, i + j + 1], weights[n, i + j + 2], weights[n, i + j + 3]
            for r in range(count):
                p0, p1, p2, p3 = steps[j, r], steps[j + 1, r], steps[j + 2, r], steps[j + 3, r]
                sums[k, r] += f0 * p0 + f1 * p1 + f2 * p2 + f3 * p3
                sums[n, r] += g0 * p0 + g1 * p1 + g2 * p2 + g3 * p3


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _project(weights, steps, values, i, count, zero):  # type: ignore[no-untyped-def]
    for k in range(0, values.shape[0], 2):
        n = k + 1
        for j in range(0, EIGHT, 4):
            x0, x1, x2, x3 = zero, zero, zero, zero
            y0, y1, y2, y3 = zero, zero, zero, zero
            for r in range(count):
                p0, p1, p2, p3 = steps[j, r], steps[j + 1, r], steps[j + 2, r], steps[j + 3, r]
                x, y = values[k, r], values[n, r]
                x0 += p0 * x
                x1 += p1 * x
                x2 += p2 * x
                x3 += p3 * x
                y0 += p0 * y
                y1 += p1 * y
                y2 += p2 * y
                y3 += p3 * y
            weights[k, i + j] += x0
            weights[k, i + j + 1] += x1
            weights[k, i + j + 2] += x2
            weights[k, i + j + 3] += x3
            weights[n, i + j] += y0
            weights[n, i + j + 1] += y1
            weights[n, i + j + 2] += y2
            weights[n, i + j + 3] += y3


@njit(cache=True, nogil=True, error_model="numpy")
def _begin(start, level, t, m, low, count, ring):  # type: ignore[no-untyped-def]
    """Set ring = (t, last, now, level) for `count` rings from `low`; those beyond the last are 0. How many in range."""
    x, last, now, deep = ring
    ready = 0
    for r in range(count):
        inside = low + r < t.size
        last[r] = 0.0
        x[r], now[r], deep[r] = (t[low + r], start[m, low + r], level[m, low + r]) if inside else (0.0, 0.0, 0)
        if deep[r] >= 0:
            ready += 1
    return ready


@njit(cache=True, nogil=True, error_model="numpy")
def synthesise(coefficients, start, level, a, b, scale, count, first, stop, t, low, tiles):  # type: ignore[no-untyped-def]
    """Fill `tiles` of the orders low, low + 1, ... from `coefficients` (orders, steps, channels), of one dtype.

    start, level: (orders, rings). a, b, scale: (orders, steps). count, first, stop: (orders,): steps of each order, and
    its range of rings; the others become 0. t: (rings,).
    """
    channels = tiles.shape[2]
    block = BLOCK // tiles.itemsize
    steps = np.empty((EIGHT, block), tiles.dtype)
    sums = np.empty((channels, block), tiles.dtype)
    weights = np.empty((channels, a.shape[1]), tiles.dtype)
    x, last, now, deep = np.empty(block), np.empty(block), np.empty(block), np.empty(block, np.int64)
    for m in range(coefficients.shape[0]):
        for i in range(a.shape[1]):
            for k in range(channels):
                weights[k, i] = coefficients[m, i, k] * scale[m, i]
        begin, end = first[m] // LANES, (stop[m] + LANES - 1) // LANES
        tiles[:begin, low + m] = 0
        tiles[end:, low + m] = 0
        for from_ring in range(begin * LANES, end * LANES, block):
            whole = min(block, end * LANES - from_ring)
            ready = _begin(start, level, t, m, from_ring, whole, (x, last, now, deep))
            sums[:, :whole] = 0
            for i in range(0, count[m], EIGHT):
                _advance(steps, x, last, now, a, b, m, i, whole)
                before = ready
                if ready < whole:
                    ready = _lift(steps, last, now, deep, whole)
                if before > 0:
                    _accumulate(sums, steps, weights, i, whole)
            for i in range(whole // LANES):
                tile = tiles[from_ring // LANES + i, low + m]
                for k in range(channels):
                    for lane in range(LANES):
                        tile[k, lane] = sums[k, i * LANES + lane]


@njit(cache=True, nogil=True, error_model="numpy")
def analyse(tiles, start, level, a, b, scale, count, first, stop, t, low, coefficients):  # type: ignore[no-untyped-def]
    """Fill `coefficients` from the orders low, low + 1, ... of `tiles`: `synthesise` transposed."""
    channels = tiles.shape[2]
    block = BLOCK // tiles.itemsize
    steps = np.empty((EIGHT, block), tiles.dtype)
    values = np.empty((channels, block), tiles.dtype)
    weights = np.empty((channels, a.shape[1]), tiles.dtype)
    x, last, now, deep = np.empty(block), np.empty(block), np.empty(block), np.empty(block, np.int64)
    zero = tiles.dtype.type(0)
    for m in range(coefficients.shape[0]):
        weights[:] = 0
        begin, end = first[m] // LANES, (stop[m] + LANES - 1) // LANES
        for from_ring in range(begin * LANES, end * LANES, block):
            whole = min(block, end * LANES - from_ring)
            ready = _begin(start, level, t, m, from_ring, whole, (x, last, now, deep))
            for i in range(whole // LANES):
                tile = tiles[from_ring // LANES + i, low + m]
                for k in range(channels):
                    for lane in range(LANES):
                        values[k, i * LANES + lane] = tile[k, lane]
            for i in range(0, count[m], EIGHT):
                _advance(steps, x, last, now, a, b, m, i, whole)
                before = ready
                if ready < whole:
                    ready = _lift(steps, last, now, deep, whole)
                if before > 0:
                    _project(weights, steps, values, i, whole, zero)
        for i in range(a.shape[1]):
            for k in range(channels):
                coefficients[m, i, k] = weights[k, i] * scale[m, i]


@njit(cache=True, nogil=True, error_model="numpy")
def tabulate(start, level, a, b, scale, t, table):  # type: ignore[no-untyped-def]
    """Fill `table` (steps, rings) with scale_i P_i(t_r) of one order: start, level, t (rings,); the others (steps,)."""
    for r in range(t.size):
        last, now, deep = 0.0, start[r], level[r]
        for i in range(table.shape[0]):
            table[i, r] = scale[i] * now if deep >= 0 else 0.0
            last, now = now, (a[i] * t[r] + b[i]) * now - last
            if deep < 0 and abs(now) > 1:
                last, now, deep = last * _LIFT, now * _LIFT, deep + 1
