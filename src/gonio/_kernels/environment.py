"""Environment maps: look-ups, sheet to sheet, and the pixels under a direction.

A layout is one or more sheets (the faces of a cube, the halves of a paraboloid pair), each with coordinates u, v in
[0, 1] (right, down). `locate` takes a direction in the layout's own axes to (sheet, u, v), `direct` goes back; the
formulas, and what they mean, stand in `lights/mappings.py`, `discs.py` and `cubes.py`. `parameter` is the extent of a
paraboloid half, or one over the camera's distance from a mirror ball.
An atlas (sheets, h + 2, w + 2, C) has one ghost texel around each sheet, so that bilinear look-ups cross its edges.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

LATLONG, ANGULAR, BALL, PARABOLOID, CUBE = range(5)


@njit(cache=True, nogil=True)
def arctangent(y, x):  # type: ignore[no-untyped-def]
    """atan2(y, x) to 2e-16, three times as fast as the C library's: Cephes' rational function, inlined."""
    ax, ay = abs(x), abs(y)
    if ax == 0.0 and ay == 0.0:
        return 0.0
    turned = ay > ax
    t = ax / ay if turned else ay / ax
    base = 0.0
    if t > 0.66:
        t = (t - 1) / (t + 1)
        base = 0.25 * math.pi
    z = t * t
    p = (((-0.8750608600031904 * z - 16.157537187333652) * z - 75.00855792314705) * z - 122.88666844901362) * z
    q = ((((z + 24.858464901423062) * z + 165.02700983169885) * z + 432.88106049129027) * z + 485.3903996359137) * z
    angle = base + (t + t * z * (p - 64.85021904942025) / (q + 194.5506571482614))
    if turned:
        angle = 0.5 * math.pi - angle
    if x < 0:
        angle = math.pi - angle
    return -angle if y < 0 else angle


@njit(cache=True, nogil=True)
def locate(layout, parameter, x, y, z):  # type: ignore[no-untyped-def]
    """(sheet, u, v) of the direction (x, y, z); its length does not matter."""
    if layout == LATLONG:
        u = arctangent(y, x) / (2 * math.pi)
        if u < 0:
            u += 1.0
        return 0, u, arctangent(math.sqrt(x * x + y * y), z) / math.pi
    if layout == CUBE:
        ax, ay, az = abs(x), abs(y), abs(z)
        if ax >= ay and ax >= az:
            sheet, s, t, a = (0, -z, y, ax) if x > 0 else (1, z, y, ax)
        elif ay >= az:
            sheet, s, t, a = (2, x, -z, ay) if y > 0 else (3, x, z, ay)
        else:
            sheet, s, t, a = (4, x, y, az) if z > 0 else (5, -x, y, az)
        return sheet, 0.5 + 0.5 * s / a, 0.5 - 0.5 * t / a
    if layout == PARABOLOID:
        length = math.sqrt(x * x + y * y + z * z)
        scale = 0.5 / (parameter * (length + abs(z)))
        if z < 0:
            scale = -scale
        return (0 if z >= 0 else 1), 0.5 + scale * x, 0.5 - scale * y
    side = math.sqrt(x * x + y * y)
    theta = arctangent(side, z)
    if layout == ANGULAR:
        r = theta / math.pi
    else:
        r = ball_radius(parameter, theta)
    if side == 0.0:
        return 0, 0.5 + 0.5 * r, 0.5
    return 0, 0.5 + 0.5 * r * x / side, 0.5 - 0.5 * r * y / side


@njit(cache=True, nogil=True)
def ball_radius(parameter, theta):  # type: ignore[no-untyped-def]
    """Radius on the picture of a mirror ball (1 at its outline) that reflects the angle `theta` from the camera."""
    if parameter == 0.0:
        return math.sin(0.5 * theta)
    # Angle of incidence i: 2 i - asin(parameter sin i) = theta. Convex and rising, so Newton's steps do not stray.
    i = 0.5 * theta
    for _ in range(6):
        s = parameter * math.sin(i)
        i -= (2 * i - math.asin(s) - theta) / (2 - parameter * math.cos(i) / math.sqrt(1 - s * s))
        i = min(max(i, 0.0), 0.5 * math.pi)
    s = parameter * math.sin(i)
    return (s / math.sqrt(1 - s * s)) / (parameter / math.sqrt(1 - parameter * parameter))


@njit(cache=True, nogil=True)
def direct(layout, parameter, sheet, u, v):  # type: ignore[no-untyped-def]
    """(x, y, z, density): the unit direction at (sheet, u, v), and solid angle per sheet area there up to a constant.

    Outside a disc the direction is that of the nearest point of its rim, and the density is 0.
    """
    if layout == LATLONG:
        theta, phi = math.pi * v, 2 * math.pi * u
        s = math.sin(theta)
        return s * math.cos(phi), s * math.sin(phi), math.cos(theta), s
    a, b = 2 * u - 1, 1 - 2 * v
    if layout == CUBE:
        k = 1 / math.sqrt(1 + a * a + b * b)
        density = k * k * k
        a, b = a * k, b * k
        if sheet == 0:
            return k, b, -a, density
        if sheet == 1:
            return -k, b, a, density
        if sheet == 2:
            return a, k, -b, density
        if sheet == 3:
            return a, -k, b, density
        if sheet == 4:
            return a, b, k, density
        return -a, b, -k, density
    if layout == PARABOLOID:
        a, b = a * parameter, b * parameter
    r = math.hypot(a, b)
    outside = r > 1
    if outside:
        a, b, r = a / r, b / r, 1.0
    if layout == PARABOLOID:
        k = 1 / (1 + r * r)
        density = 0.0 if outside else k * k
        sign = 1.0 if sheet == 0 else -1.0
        return sign * 2 * a * k, sign * 2 * b * k, sign * (1 - r * r) * k, density
    if r < 1e-12:
        return 0.0, 0.0, 1.0, 1.0
    if layout == ANGULAR:
        theta = math.pi * r
        density = math.sin(theta) / (math.pi * r)
    elif parameter == 0.0:
        theta = 2 * math.asin(r)
        density = 1.0
    else:
        tangent = parameter / math.sqrt(1 - parameter * parameter)
        alpha = math.atan(r * tangent)
        sine = min(math.sin(alpha) / parameter, 1.0)
        theta = 2 * math.asin(sine) - alpha
        # d theta / d r, kept finite where the ray grazes the ball.
        slope = 2 * math.cos(alpha) / (parameter * math.sqrt(max(1 - sine * sine, 1e-12))) - 1
        density = math.sin(theta) * slope * tangent / (1 + (r * tangent) ** 2) / r
    s = math.sin(theta) / r
    return s * a, s * b, math.cos(theta), (0.0 if outside else density)


@njit(cache=True, nogil=True)
def look_up(layout, parameter, height, width, texels, turn, w, out):  # type: ignore[no-untyped-def]
    """`out` (n, C) = bilinear radiance towards the world directions `w` (n, 3); own = turn^T w.

    `texels` is the atlas of sheets of (height, width), as (sheets * (height + 2) * (width + 2), C).
    """
    stride = width + 2
    for k in range(w.shape[0]):
        a, b, c = np.float64(w[k, 0]), np.float64(w[k, 1]), np.float64(w[k, 2])
        x = turn[0, 0] * a + turn[1, 0] * b + turn[2, 0] * c
        y = turn[0, 1] * a + turn[1, 1] * b + turn[2, 1] * c
        z = turn[0, 2] * a + turn[1, 2] * b + turn[2, 2] * c
        sheet, u, v = locate(layout, parameter, x, y, z)
        column, row = u * width + 0.5, v * height + 0.5
        i, j = min(max(int(row), 0), height), min(max(int(column), 0), width)
        f, g = row - i, column - j
        at = (sheet * (height + 2) + i) * stride + j
        for q in range(out.shape[1]):
            top = texels[at, q] * (1 - g) + texels[at + 1, q] * g
            bottom = texels[at + stride, q] * (1 - g) + texels[at + stride + 1, q] * g
            out[k, q] = top * (1 - f) + bottom * f


@njit(cache=True, nogil=True)
def resample(  # type: ignore[no-untyped-def]
    layout, parameter, height, width, texels, to_layout, to_parameter, turn, samples, total, out
):
    """`out` (sheets, h, w, C) = mean of `texels` (see `look_up`) over the solid angle of another layout's texels.

    `samples` x `samples` bilinear look-ups a texel, weighted by solid angle; `turn` takes the target's own axes to
    the source's. `total` (C,) is scratch.
    """
    stride, channels = width + 2, out.shape[3]
    for sheet in range(out.shape[0]):
        for r in range(out.shape[1]):
            for s in range(out.shape[2]):
                weight = 0.0
                total[:] = 0.0
                for k in range(samples * samples):
                    u = (s + (k % samples + 0.5) / samples) / out.shape[2]
                    v = (r + (k // samples + 0.5) / samples) / out.shape[1]
                    a, b, c, density = direct(to_layout, to_parameter, sheet, u, v)
                    # A texel without any sample inside the disc still gets its rim's radiance.
                    density = max(density, 1e-30)
                    x = turn[0, 0] * a + turn[0, 1] * b + turn[0, 2] * c
                    y = turn[1, 0] * a + turn[1, 1] * b + turn[1, 2] * c
                    z = turn[2, 0] * a + turn[2, 1] * b + turn[2, 2] * c
                    source, p, q = locate(layout, parameter, x, y, z)
                    column, row = p * width + 0.5, q * height + 0.5
                    i, j = min(max(int(row), 0), height), min(max(int(column), 0), width)
                    f, g = row - i, column - j
                    at = (source * (height + 2) + i) * stride + j
                    for n in range(channels):
                        top = texels[at, n] * (1 - g) + texels[at + 1, n] * g
                        bottom = texels[at + stride, n] * (1 - g) + texels[at + stride + 1, n] * g
                        total[n] += density * (top * (1 - f) + bottom * f)
                    weight += density
                for n in range(channels):
                    out[sheet, r, s, n] = total[n] / weight
