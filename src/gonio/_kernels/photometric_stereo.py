"""Photometric stereo of one pixel after the other: the loops of `capture/photometric_stereo.py`.

lights (1 or pixels, 3, N): their directions, at every pixel where they are near
values (pixels, N): what each light made of a pixel, NaN where that is not known
g (pixels, 3) = albedo n: least squares over the lights that count, those with `counts` (pixels, N) = 1
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

ROUNDS = 30  # of reweighting, at most
_CLOSE = 1e-3  # of the length of g: less change ends the rounds, and residuals below it weigh alike
_DARK = 0.05  # of the length of g: darker pixels that face away from a light are as they should be
_SPREAD = 1.4826  # standard deviations in a median of absolute residuals, for normal noise

# Sums may be reordered and fused so that they vectorise.
_FAST = {"reassoc", "contract", "nsz"}


@njit(cache=True, nogil=True, error_model="numpy")
def gather(radiance, clipped, low, scale, values):  # type: ignore[no-untyped-def]
    """`values`: radiance (N, all, 3) times scale (N, 3), summed, of pixels from `low` on; NaN if clipped (N, all)."""
    for k in range(scale.shape[0]):
        for i in range(values.shape[0]):
            p = low + i
            value = radiance[k, p, 0] * scale[k, 0] + radiance[k, p, 1] * scale[k, 1] + radiance[k, p, 2] * scale[k, 2]
            values[i, k] = np.nan if clipped[k, p] else value


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def colour(radiance, low, scale, lights, g, counts, albedo):  # type: ignore[no-untyped-def]
    """`albedo` (pixels, 3), of pixels from `low` on: least squares of radiance (N, all, 3) times scale (N, 3) over the
    photographs that count, counts (pixels, N)."""
    last = lights.shape[0] - 1
    for i in range(counts.shape[0]):
        own, x, y, z = lights[min(i, last)], g[i, 0], g[i, 1], g[i, 2]
        red = green = blue = bottom = 0.0
        for k in range(counts.shape[1]):
            cosine = (own[0, k] * x + own[1, k] * y + own[2, k] * z) * counts[i, k]
            red += cosine * scale[k, 0] * radiance[k, low + i, 0]
            green += cosine * scale[k, 1] * radiance[k, low + i, 1]
            blue += cosine * scale[k, 2] * radiance[k, low + i, 2]
            bottom += cosine * cosine
        factor = _length(g[i]) / bottom if bottom > 0 else np.nan
        albedo[i, 0], albedo[i, 1], albedo[i, 2] = red * factor, green * factor, blue * factor


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _solve(row, lights, weights, g, inverse):  # type: ignore[no-untyped-def]
    """Weighted least squares into `g` (3,), and the inverse of its matrix (3, 3); False where lights lie in a plane."""
    along, up, out = lights[0], lights[1], lights[2]
    a = b = c = d = e = f = x = y = z = 0.0
    for k in range(row.size):
        l, m, n = weights[k] * along[k], weights[k] * up[k], weights[k] * out[k]
        a, b, c = a + l * along[k], b + l * up[k], c + l * out[k]
        d, e, f = d + m * up[k], e + m * out[k], f + n * out[k]
        x, y, z = x + l * row[k], y + m * row[k], z + n * row[k]
    return _inverted(a, b, c, d, e, f, x, y, z, g, inverse)


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _resolve(row, known, lights, dark, close, robust, g, inverse):  # type: ignore[no-untyped-def]
    """`_solve` of what faces the light by `g`, or sees it all the same, weighted 1, or over its absolute residual."""
    along, up, out = lights[0], lights[1], lights[2]
    gx, gy, gz = g[0], g[1], g[2]
    a = b = c = d = e = f = x = y = z = 0.0
    for k in range(row.size):
        expected = along[k] * gx + up[k] * gy + out[k] * gz
        weight = known[k] if expected > 0 or row[k] > dark else 0.0
        if robust:
            weight /= max(abs(row[k] - expected), close)
        l, m, n = weight * along[k], weight * up[k], weight * out[k]
        a, b, c = a + l * along[k], b + l * up[k], c + l * out[k]
        d, e, f = d + m * up[k], e + m * out[k], f + n * out[k]
        x, y, z = x + l * row[k], y + m * row[k], z + n * row[k]
    return _inverted(a, b, c, d, e, f, x, y, z, g, inverse)


@njit(cache=True, nogil=True, error_model="numpy")
def _inverted(a, b, c, d, e, f, x, y, z, g, inverse):  # type: ignore[no-untyped-def]
    """g = M^-1 (x, y, z), M of rows a b c, b d e, c e f, and the inverse; False where M is singular."""
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    s, t, u = a * f - c * c, b * c - a * e, a * d - b * b
    determinant = a * p + b * q + c * r
    trace = a + d + f
    if not determinant > 1e-9 * trace * trace * trace:
        return False
    inverse[0, 0], inverse[0, 1], inverse[0, 2] = p / determinant, q / determinant, r / determinant
    inverse[1, 0], inverse[1, 1], inverse[1, 2] = q / determinant, s / determinant, t / determinant
    inverse[2, 0], inverse[2, 1], inverse[2, 2] = r / determinant, t / determinant, u / determinant
    for i in range(3):
        g[i] = inverse[i, 0] * x + inverse[i, 1] * y + inverse[i, 2] * z
    return True


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _expect(lights, g, expected):  # type: ignore[no-untyped-def]
    for k in range(expected.size):
        expected[k] = lights[0, k] * g[0] + lights[1, k] * g[1] + lights[2, k] * g[2]


@njit(cache=True, nogil=True, error_model="numpy")
def _length(g):  # type: ignore[no-untyped-def]
    return math.sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2])


@njit(cache=True, nogil=True, error_model="numpy")
def _median(x, n):  # type: ignore[no-untyped-def]
    """The median of the first n of `x`, which are turned about: Hoare's selection, without branches."""
    low, high, middle = 0, n - 1, n // 2
    while low < high:
        at = (low + high) // 2
        pivot, x[at] = x[at], x[high]
        below = low
        for i in range(low, high):
            value = x[i]
            x[i], x[below] = x[below], value
            below += value < pivot
        x[high], x[below] = x[below], pivot
        if below == middle:
            break
        if below < middle:
            low = below + 1
        else:
            high = below - 1
    return x[middle] if n % 2 else (x[:middle].max() + x[middle]) / 2


@njit(cache=True, nogil=True, error_model="numpy")
def _choose(row, known, expected, length, robust, sizes, weights):  # type: ignore[no-untyped-def]
    """Weights 1 of those that count: known, facing the light, and if robust not far off."""
    used = 0
    for k in range(row.size):
        weights[k] = known[k] if expected[k] > 0 else 0.0
        if weights[k] > 0:
            sizes[used] = abs(row[k] - expected[k])
            used += 1
    if robust and used > 0:
        limit = max(3 * _SPREAD * _median(sizes, used), 3 * _CLOSE * length)
        for k in range(row.size):
            if abs(row[k] - expected[k]) > limit:
                weights[k] = 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def solve(values, lights, robust, found, counts, residual, error):  # type: ignore[no-untyped-def]
    """Fill `found` (pixels, 3), `counts`, and for each pixel the rms `residual` and the standard `error` of n, radians.

    All lights count that are known and that g does not face away from; on the way, also those that it
    faces away from and yet sees, since g is wrong then. Robust: first the sum of absolute residuals is brought down, by
    weights 1 / residual; then those count that lie within three standard deviations of it, by the median. A pixel that
    fewer than three lights tell about, or lights in a plane, gets NaN.
    """
    pixels, n = values.shape
    row, known, weights, sizes, expected = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    g, inverse, last = np.empty(3), np.empty((3, 3)), lights.shape[0] - 1
    for i in range(pixels):
        own = lights[min(i, last)]
        for k in range(n):
            blind = math.isnan(values[i, k])
            known[k], row[k] = (0.0, 0.0) if blind else (1.0, values[i, k])
        good = _solve(row, own, known, g, inverse)
        rounds = 0
        while good and rounds < ROUNDS:
            length, x, y, z = _length(g), g[0], g[1], g[2]
            good = _resolve(row, known, own, _DARK * length, _CLOSE * length, robust, g, inverse)
            rounds += 1
            if abs(g[0] - x) + abs(g[1] - y) + abs(g[2] - z) <= _CLOSE * length:
                break
        if good:
            _expect(own, g, expected)
            _choose(row, known, expected, _length(g), robust, sizes, weights)
            good = _solve(row, own, weights, g, inverse)
        length = _length(g) if good else 0.0
        if not length > 0:
            found[i], counts[i], residual[i], error[i] = np.nan, 0, np.nan, np.nan
            continue
        found[i] = g
        _expect(own, g, expected)
        total, used = 0.0, 0
        for k in range(n):
            counts[i, k] = 1 if weights[k] > 0 else 0
            if weights[k] > 0:
                total += (row[k] - expected[k]) ** 2
                used += 1
        residual[i] = math.sqrt(total / used)
        # Var(g) = s^2 inverse, s^2 by the degrees of freedom; of it, what is across g turns n.
        within = 0.0
        for a in range(3):
            for b in range(3):
                within += g[a] * inverse[a, b] * g[b]
        across = inverse[0, 0] + inverse[1, 1] + inverse[2, 2] - within / (length * length)
        error[i] = math.sqrt(max(across, 0.0) * total / max(used - 3, 1)) / length
