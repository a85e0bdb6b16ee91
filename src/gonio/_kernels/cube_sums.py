"""Means of a lat-long map over the texels of a cube, by giving every part of a pixel to the texel in which it lies.

Parts are parts x parts a pixel. The faces are those of `lights/cubes.py`, X right, Y up, Z into the front face.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# Sums may be fused so that they vectorise.
_FAST = {"contract", "nsz"}


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def texels(x, y, z, size, out):  # type: ignore[no-untyped-def]
    """`out` (n,): the texel, counted through faces, rows and columns, that each direction x, y, z, (n,), meets."""
    last, side = np.float32(size - 1), np.int32(size)
    half = np.float32(0.5 * size)
    for k in range(out.size):
        a, b, c = x[k], y[k], z[k]
        ax, ay, az = abs(a), abs(b), abs(c)
        on_x = (ax >= ay) & (ax >= az)
        on_y = (not on_x) & (ay >= az)
        across = a if on_x else (b if on_y else c)
        sign = np.float32(1.0) if across > 0 else np.float32(-1.0)
        scale = half / abs(across)
        u = half + scale * (-sign * c if on_x else (a if on_y else sign * a))
        v = half - scale * (-sign * c if on_y else b)
        pair = np.int32(0) if on_x else (np.int32(2) if on_y else np.int32(4))
        face = pair + (np.int32(0) if across > 0 else np.int32(1))
        u = min(max(u, np.float32(0)), last)
        v = min(max(v, np.float32(0)), last)
        out[k] = (face * side + np.int32(v)) * side + np.int32(u)


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def add(image, around, polar, weights, turn, size, sums):  # type: ignore[no-untyped-def]
    """Add image (rows, columns, C) to `sums` (6 size^2, C + 1), C is 1 or 3: radiance times weight, then weight.

    around (columns parts, 2): cos and sin of phi of the parts' centres; polar (rows parts, 2): of theta. weights (rows
    parts,): of a part of each row. turn (3, 3): the map's axes to the cube's.
    """
    parts, channels = polar.shape[0] // image.shape[0], image.shape[2]
    n = around.shape[0]
    x, y, z = np.empty(n, np.float32), np.empty(n, np.float32), np.empty(n, np.float32)
    at = np.empty(n, np.int32)
    for r in range(polar.shape[0]):
        c, s, weight = polar[r, 0], polar[r, 1], weights[r]
        for k in range(n):
            p, q = s * around[k, 0], s * around[k, 1]
            x[k] = turn[0, 0] * p + turn[0, 1] * q + turn[0, 2] * c
            y[k] = turn[1, 0] * p + turn[1, 1] * q + turn[1, 2] * c
            z[k] = turn[2, 0] * p + turn[2, 1] * q + turn[2, 2] * c
        texels(x, y, z, size, at)
        row = image[r // parts]
        for i in range(row.shape[0]):
            first, mid, last = weight * row[i, 0], weight * row[i, channels // 2], weight * row[i, channels - 1]
            k, stop = i * parts, (i + 1) * parts
            while k < stop:
                # Mostly all parts of a pixel lie in one texel, which is convex.
                count = stop - k if at[k] == at[stop - 1] else 1
                texel = sums[at[k]]
                texel[0] += count * first
                if channels == 3:
                    texel[1] += count * mid
                    texel[2] += count * last
                texel[channels] += count * weight
                k += count
