"""Sums over sequences that obey a three-term recursion, at many arguments at once: the inner loops of `sphere`.

    P_0 = start 2^(800 level),   P_{i+1} = (a_i t + b_i) P_i - c_i P_{i-1}
    synthesise   rings[m, k, r] = sum_i coefficients[m, i, k] P_i(m, t_r)
    analyse      coefficients[m, i, k] = sum_r rings[m, k, r] P_i(m, t_r)

Eight steps are taken for a block of rings that stays in the first cache, then used for every channel k. `level` < 0
marks numbers below the range of a float64; they count as 0 until the recursion has lifted them to level 0. The
recursion runs in float64, the sums in the dtype of the channels. Steps come in eights, channels in pairs.
"""

from __future__ import annotations

import numpy as np
from numba import njit

BLOCK = 128  # rings: eight steps of them and the sums of a few channels fit a first cache of 32 KiB
EIGHT = 8
_LIFT = 2.0**-800

# Sums may be reordered and fused so that they vectorise; NaN and infinity still spread as they should.
_FAST = {"reassoc", "contract", "nsz"}


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _advance(steps, t, last, now, a, b, c, i, count):  # type: ignore[no-untyped-def]
    """P_i .. P_{i+7} into `steps`; `last` and `now` go from P_{i-1}, P_i to P_{i+7}, P_{i+8}."""
    a0, a1, a2, a3, a4, a5, a6, a7 = a[i], a[i + 1], a[i + 2], a[i + 3], a[i + 4], a[i + 5], a[i + 6], a[i + 7]
    b0, b1, b2, b3, b4, b5, b6, b7 = b[i], b[i + 1], b[i + 2], b[i + 3], b[i + 4], b[i + 5], b[i + 6], b[i + 7]
    c0, c1, c2, c3, c4, c5, c6, c7 = c[i], c[i + 1], c[i + 2], c[i + 3], c[i + 4], c[i + 5], c[i + 6], c[i + 7]
    for r in range(count):
        u, v, x = last[r], now[r], t[r]
        steps[0, r] = v
        u = (a0 * x + b0) * v - c0 * u
        steps[1, r] = u
        v = (a1 * x + b1) * u - c1 * v
        steps[2, r] = v
        u = (a2 * x + b2) * v - c2 * u
        steps[3, r] = u
        v = (a3 * x + b3) * u - c3 * v
        steps[4, r] = v
        u = (a4 * x + b4) * v - c4 * u
        steps[5, r] = u
        v = (a5 * x + b5) * u - c5 * v
        steps[6, r] = v
        u = (a6 * x + b6) * v - c6 * u
        steps[7, r] = u
        v = (a7 * x + b7) * u - c7 * v
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
def _accumulate(sums, steps, coefficients, i, count):  # type: ignore[no-untyped-def]
    p0, p1, p2, p3, p4, p5, p6, p7 = steps[0], steps[1], steps[2], steps[3], steps[4], steps[5], steps[6], steps[7]
    for k in range(sums.shape[0]):
        row = sums[k]
        f0, f1, f2, f3 = coefficients[i, k], coefficients[i + 1, k], coefficients[i + 2, k], coefficients[i + 3, k]
        f4, f5, f6, f7 = coefficients[i + 4, k], coefficients[i + 5, k], coefficients[i + 6, k], coefficients[i + 7, k]
        for r in range(count):
            row[r] += (
                f0 * p0[r] + f1 * p1[r] + f2 * p2[r] + f3 * p3[r] + f4 * p4[r] + f5 * p5[r] + f6 * p6[r] + f7 * p7[r]
            )


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _project(coefficients, steps, values, i, count, zero):  # type: ignore[no-untyped-def]
    for k in range(0, values.shape[0], 2):
        x, y = values[k], values[k + 1]
        for j in range(0, EIGHT, 4):
            p0, p1, p2, p3 = steps[j], steps[j + 1], steps[j + 2], steps[j + 3]
            x0, x1, x2, x3 = zero, zero, zero, zero
            y0, y1, y2, y3 = zero, zero, zero, zero
            for r in range(count):
                x0 += p0[r] * x[r]
                x1 += p1[r] * x[r]
                x2 += p2[r] * x[r]
                x3 += p3[r] * x[r]
                y0 += p0[r] * y[r]
                y1 += p1[r] * y[r]
                y2 += p2[r] * y[r]
                y3 += p3[r] * y[r]
            coefficients[i + j, k] += x0
            coefficients[i + j + 1, k] += x1
            coefficients[i + j + 2, k] += x2
            coefficients[i + j + 3, k] += x3
            coefficients[i + j, k + 1] += y0
            coefficients[i + j + 1, k + 1] += y1
            coefficients[i + j + 2, k + 1] += y2
            coefficients[i + j + 3, k + 1] += y3


@njit(cache=True, nogil=True, error_model="numpy")
def synthesise(coefficients, start, level, a, b, c, count, first, stop, t, rings):  # type: ignore[no-untyped-def]
    """Fill `rings` (orders, channels, rings) from `coefficients` (orders, steps, channels), of one dtype.

    start, level: (orders, rings). a, b, c: (orders, steps). count, first, stop: (orders,): steps of each order, and
    its range of rings; the others become 0. t: (rings,).
    """
    channels = rings.shape[1]
    steps = np.empty((EIGHT, BLOCK), rings.dtype)
    sums = np.empty((channels, BLOCK), rings.dtype)
    last, now, deep = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK, np.int64)
    for m in range(rings.shape[0]):
        rings[m, :, : first[m]] = 0
        rings[m, :, stop[m] :] = 0
        for low in range(first[m], stop[m], BLOCK):
            n = min(BLOCK, stop[m] - low)
            ready = 0
            for r in range(n):
                last[r], now[r], deep[r] = 0.0, start[m, low + r], level[m, low + r]
                if deep[r] >= 0:
                    ready += 1
            sums[:, :n] = 0
            for i in range(0, count[m], EIGHT):
                _advance(steps, t[low : low + n], last, now, a[m], b[m], c[m], i, n)
                before = ready
                if ready < n:
                    ready = _lift(steps, last, now, deep, n)
                if before > 0:
                    _accumulate(sums, steps, coefficients[m], i, n)
            rings[m, :, low : low + n] = sums[:, :n]


@njit(cache=True, nogil=True, error_model="numpy")
def analyse(rings, start, level, a, b, c, count, first, stop, t, coefficients):  # type: ignore[no-untyped-def]
    """Fill `coefficients` (orders, steps, channels) from `rings` (orders, channels, rings): `synthesise` transposed."""
    channels = rings.shape[1]
    steps = np.empty((EIGHT, BLOCK), rings.dtype)
    values = np.empty((channels, BLOCK), rings.dtype)
    last, now, deep = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK, np.int64)
    zero = rings.dtype.type(0)
    for m in range(rings.shape[0]):
        coefficients[m] = 0
        for low in range(first[m], stop[m], BLOCK):
            n = min(BLOCK, stop[m] - low)
            ready = 0
            for r in range(n):
                last[r], now[r], deep[r] = 0.0, start[m, low + r], level[m, low + r]
                if deep[r] >= 0:
                    ready += 1
            values[:, :n] = rings[m, :, low : low + n]
            for i in range(0, count[m], EIGHT):
                _advance(steps, t[low : low + n], last, now, a[m], b[m], c[m], i, n)
                before = ready
                if ready < n:
                    ready = _lift(steps, last, now, deep, n)
                if before > 0:
                    _project(coefficients[m], steps, values, i, n, zero)


@njit(cache=True, nogil=True, error_model="numpy")
def tabulate(start, level, a, b, c, t, table):  # type: ignore[no-untyped-def]
    """Fill `table` (steps, rings) with P_i(t_r) of one order: start, level, t (rings,), a, b, c (steps,)."""
    for r in range(t.size):
        last, now, deep = 0.0, start[r], level[r]
        for i in range(table.shape[0]):
            table[i, r] = now if deep >= 0 else 0.0
            last, now = now, (a[i] * t[r] + b[i]) * now - c[i] * last
            if deep < 0 and abs(now) > 1:
                last, now, deep = last * _LIFT, now * _LIFT, deep + 1
