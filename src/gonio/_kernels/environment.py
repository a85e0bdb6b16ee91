"""Look-ups in environment maps: where directions lie in a layout, and the radiance there.

A layout is one or more sheets (the faces of a cube, the halves of a paraboloid pair), each with coordinates u, v in
[0, 1] (right, down); the formulas stand in `lights/mappings.py`, `discs.py` and `cubes.py`. `parameter` is the extent
of a paraboloid half, or one over the camera's distance from a mirror ball. An atlas (sheets, h + 2, w + 2, C), given
as (sheets * (h + 2) * (w + 2), C), has one ghost texel around each sheet, so that bilinear look-ups cross its edges.

Directions go in blocks through loops of one task each: first without branches, so that the compiler takes four at a
time, then through memory, so that the processor waits for many texels at once. NaN is not expected anywhere; `nsz` and
`contract` (no signed zeros, fused multiplications) leave it alone in any case.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

LATLONG, ANGULAR, BALL, PARABOLOID, CUBE = range(5)

_BLOCK = 512
_TINY = 1e-300


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nsz"})
def look_up(layout, parameter, height, width, texels, turn, w, nearest, out):  # type: ignore[no-untyped-def]
    """`out` (n, C) = radiance towards the world directions `w` (n, 3), own = turn^T w, C is 1 or 3.

    Bilinear between texel centres, or, if `nearest`, that of the texel in which the direction lies.
    """
    x, y, z, u, v = np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK)
    sheet = np.zeros(_BLOCK, np.int64)
    for start in range(0, w.shape[0], _BLOCK):
        n = min(_BLOCK, w.shape[0] - start)
        for k in range(n):
            a, b, c = np.float64(w[start + k, 0]), np.float64(w[start + k, 1]), np.float64(w[start + k, 2])
            x[k] = turn[0, 0] * a + turn[1, 0] * b + turn[2, 0] * c
            y[k] = turn[0, 1] * a + turn[1, 1] * b + turn[2, 1] * c
            z[k] = turn[0, 2] * a + turn[1, 2] * b + turn[2, 2] * c
        if layout == LATLONG:
            in_latlong(n, x, y, z, u, v)
        elif layout == CUBE:
            in_cube(n, x, y, z, sheet, u, v)
        elif layout == PARABOLOID:
            in_paraboloids(n, parameter, x, y, z, sheet, u, v)
        elif layout == ANGULAR:
            in_angular_map(n, x, y, z, u, v)
        elif parameter == 0.0:
            in_far_ball(n, x, y, z, u, v)
        else:
            in_near_ball(n, parameter, x, y, z, u, v)
        if nearest:
            take(height, width, texels, sheet, u, v, out[start : start + n])
        else:
            blend(height, width, texels, sheet, u, v, out[start : start + n])


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nsz"})
def arctangent(y, x):  # type: ignore[no-untyped-def]
    """atan2(y, x) to 3e-16 of a turn, 0 at the origin: Cephes' rational function, without branches."""
    ax, ay = abs(x), abs(y)
    high, low = max(ax, ay), min(ax, ay)
    # atan(t) = pi/4 + atan((t - 1)/(t + 1)) keeps the argument small.
    steep = low > 0.66 * high
    t = (low - high if steep else low) / max(low + high if steep else high, _TINY)
    s = t * t
    p = (((-0.8750608600031904 * s - 16.157537187333652) * s - 75.00855792314705) * s - 122.88666844901362) * s
    q = ((((s + 24.858464901423062) * s + 165.02700983169885) * s + 432.88106049129027) * s + 485.3903996359137) * s
    angle = (0.25 * math.pi if steep else 0.0) + (t + t * s * (p - 64.85021904942025) / (q + 194.5506571482614))
    angle = 0.5 * math.pi - angle if ay > ax else angle
    angle = math.pi - angle if x < 0 else angle
    return -angle if y < 0 else angle


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nsz"})
def in_latlong(n, x, y, z, u, v):  # type: ignore[no-untyped-def]
    """(u, v) of the first `n` own directions of a latitude-longitude map; here and below their length is about 1."""
    for k in range(n):
        turns = arctangent(y[k], x[k]) / (2 * math.pi)
        u[k] = turns + 1.0 if turns < 0 else turns
        v[k] = arctangent(math.sqrt(x[k] * x[k] + y[k] * y[k]), z[k]) / math.pi


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nsz"})
def in_cube(n, x, y, z, sheet, u, v):  # type: ignore[no-untyped-def]
    """(sheet, u, v) on the faces of a cube."""
    for k in range(n):
        ax, ay, az = abs(x[k]), abs(y[k]), abs(z[k])
        on_x = (ax >= ay) & (ax >= az)
        on_y = (not on_x) & (ay >= az)
        across = x[k] if on_x else (y[k] if on_y else z[k])
        sign = 1.0 if across > 0 else -1.0
        scale = 0.5 / abs(across)
        u[k] = 0.5 + scale * (-sign * z[k] if on_x else (x[k] if on_y else sign * x[k]))
        v[k] = 0.5 - scale * (-sign * z[k] if on_y else y[k])
        sheet[k] = (0 if on_x else (2 if on_y else 4)) + (0 if across > 0 else 1)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nsz"})
def in_paraboloids(n, extent, x, y, z, sheet, u, v):  # type: ignore[no-untyped-def]
    """(sheet, u, v) on a pair of paraboloids."""
    for k in range(n):
        length = math.sqrt(x[k] * x[k] + y[k] * y[k] + z[k] * z[k])
        scale = 0.5 / (extent * (length + abs(z[k])))
        scale = scale if z[k] >= 0 else -scale
        u[k], v[k] = 0.5 + scale * x[k], 0.5 - scale * y[k]
        sheet[k] = 0 if z[k] >= 0 else 1


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nsz"})
def in_angular_map(n, x, y, z, u, v):  # type: ignore[no-untyped-def]
    """(u, v) on an angular map."""
    for k in range(n):
        side = math.sqrt(x[k] * x[k] + y[k] * y[k])
        r = arctangent(side, z[k]) / (2 * math.pi)
        scale = r / max(side, _TINY)
        u[k], v[k] = (0.5 + scale * x[k] if side > 0 else 0.5 + r), 0.5 - scale * y[k]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nsz"})
def in_far_ball(n, x, y, z, u, v):  # type: ignore[no-untyped-def]
    """(u, v) on a mirror ball far from the camera: sin(theta / 2) = sqrt((1 - z) / 2), each half without cancelling."""
    for k in range(n):
        side2 = x[k] * x[k] + y[k] * y[k]
        length = math.sqrt(side2 + z[k] * z[k])
        apart = math.sqrt((length + abs(z[k])) / (2 * length))
        side = math.sqrt(side2)
        scale = 0.25 / (apart * length) if z[k] >= 0 else 0.5 * apart / max(side, _TINY)
        u[k], v[k] = (0.5 + scale * x[k] if (side > 0) | (z[k] >= 0) else 1.0), 0.5 - scale * y[k]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nsz"})
def in_near_ball(n, parameter, x, y, z, u, v):  # type: ignore[no-untyped-def]
    """(u, v) on a mirror ball 1 / `parameter` radii from the camera."""
    rim = parameter / math.sqrt(1 - parameter * parameter)
    for k in range(n):
        side = math.sqrt(x[k] * x[k] + y[k] * y[k])
        theta = arctangent(side, z[k])
        # Angle of incidence i: 2 i - asin(parameter sin i) = theta. Convex and rising, so Newton's steps do not stray.
        i = 0.5 * theta
        for _ in range(6):
            s = parameter * math.sin(i)
            i -= (2 * i - math.asin(s) - theta) / (2 - parameter * math.cos(i) / math.sqrt(1 - s * s))
            i = min(max(i, 0.0), 0.5 * math.pi)
        s = parameter * math.sin(i)
        r = 0.5 * s / math.sqrt(1 - s * s) / rim
        scale = r / max(side, _TINY)
        u[k], v[k] = (0.5 + scale * x[k] if side > 0 else 0.5 + r), 0.5 - scale * y[k]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nsz"})
def blend(height, width, texels, sheet, u, v, out):  # type: ignore[no-untyped-def]
    """`out` (n, C): bilinear between texel centres."""
    stride = width + 2
    for k in range(out.shape[0]):
        row, column = v[k] * height + 0.5, u[k] * width + 0.5
        i, j = min(max(int(row), 0), height), min(max(int(column), 0), width)
        f, g = row - i, column - j
        at = (sheet[k] * (height + 2) + i) * stride + j
        a, b, c, d = (1 - f) * (1 - g), (1 - f) * g, f * (1 - g), f * g
        if out.shape[1] == 1:
            out[k, 0] = (
                a * texels[at, 0] + b * texels[at + 1, 0] + c * texels[at + stride, 0] + d * texels[at + stride + 1, 0]
            )
        else:
            for q in range(3):  # a constant, so that the loop is unrolled
                out[k, q] = (
                    a * texels[at, q]
                    + b * texels[at + 1, q]
                    + c * texels[at + stride, q]
                    + d * texels[at + stride + 1, q]
                )


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nsz"})
def take(height, width, texels, sheet, u, v, out):  # type: ignore[no-untyped-def]
    """`out` (n, C): the texel in which each direction lies."""
    for k in range(out.shape[0]):
        i, j = min(max(int(v[k] * height), 0), height - 1), min(max(int(u[k] * width), 0), width - 1)
        at = (sheet[k] * (height + 2) + i + 1) * (width + 2) + j + 1
        for q in range(out.shape[1]):
            out[k, q] = texels[at, q]
