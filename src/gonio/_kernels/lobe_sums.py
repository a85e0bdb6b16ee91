"""Sums over the pixels of a lat-long map that lie within a lobe: the loop of `rendering/angular.py`."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

# Sums may be reordered and fused so that they vectorise; NaN and infinity still spread as they should.
_FAST = {"reassoc", "contract", "nsz"}


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _weigh(c, a, b, around, scale, lobe, weights):  # type: ignore[no-untyped-def]
    """The lobe at pixels of a row, whose cosines are c + a cos phi + b sin phi: each in `weights`, and their sum."""
    last = lobe.size - 2
    total = 0.0
    for k in range(around.shape[1]):
        u = scale * (1 - (c + a * around[0, k] + b * around[1, k]))
        i = min(max(int(u), 0), last)
        weights[k] = lobe[i] + (u - i) * (lobe[i + 1] - lobe[i])
        total += weights[k]
    return total


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _gather(weights, row, sums):  # type: ignore[no-untyped-def]
    """Add to `sums` (C,), C is 1 or 3, the pixels row (n, C) times weights (n,)."""
    x = y = z = 0.0
    if row.shape[1] == 1:
        for k in range(row.shape[0]):
            x += weights[k] * row[k, 0]
    else:
        for k in range(row.shape[0]):
            x += weights[k] * row[k, 0]
            y += weights[k] * row[k, 1]
            z += weights[k] * row[k, 2]
        sums[1] += y
        sums[2] += z
    sums[0] += x


@njit(cache=True, nogil=True, error_model="numpy")
def add(image, polar, around, directions, least, lobe, out):  # type: ignore[no-untyped-def]
    """Fill `out` (N, C) with means of image (rows, columns, C) about each direction, by lobe times solid angle.

    polar (2, rows): cos and sin of theta, around (2, columns): of phi, at the pixels' centres. directions (N, 3), unit,
    in the map's axes. The lobe reaches to the cosine `least`; lobe (K + 2,): at cosines from 1 down to it, in K equal
    steps, and once more. A pixel counts by its centre; where none is within the lobe, the nearest one does.
    """
    rows, columns, channels = image.shape
    reach, scale = math.acos(least), (lobe.size - 2) / (1 - least)
    turn, height = columns / (2 * math.pi), math.pi / rows
    sums, own, weights = np.empty(channels), np.empty(channels), np.empty(columns)
    for i in range(directions.shape[0]):
        x, y, z = directions[i, 0], directions[i, 1], min(max(directions[i, 2], -1.0), 1.0)
        sine = math.sqrt(x * x + y * y)
        across, down = (math.atan2(y, x) * turn) % columns, math.atan2(sine, z)
        sums[:] = 0
        total = 0.0
        first, last = math.ceil((down - reach) / height - 0.5), math.floor((down + reach) / height - 0.5)
        for r in range(max(first, 0), min(last, rows - 1) + 1):
            c, s = polar[0, r] * z, polar[1, r] * sine
            if c + s < least:
                continue
            # The pixels low, low + 1, ... of the row, which may run over its end, are within the lobe.
            low, count = 0, columns
            if c - s < least:
                half = math.acos(min(max((least - c) / s, -1.0), 1.0)) * turn
                low = math.ceil(across - half - 0.5)
                count = min(max(math.floor(across + half - 0.5) - low + 1, 0), columns)
                low %= columns
            ahead = min(count, columns - low)
            own[:] = 0
            part = 0.0
            for start, stop in ((low, low + ahead), (0, count - ahead)):
                some = weights[: stop - start]
                part += _weigh(c, polar[1, r] * x, polar[1, r] * y, around[:, start:stop], scale, lobe, some)
                _gather(some, image[r, start:stop], own)
            total += polar[1, r] * part
            for k in range(channels):
                sums[k] += polar[1, r] * own[k]
        if total > 0:
            for k in range(channels):
                out[i, k] = sums[k] / total
        else:
            out[i] = image[min(int(down / height), rows - 1), int(across) % columns]
