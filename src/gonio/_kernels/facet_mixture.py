"""Reflection by facets whose distribution is a mixture of tabulated ones, pair by pair; `brdf/facet_mixture.py`.

A pair of directions gathers from the tables of each component; a site that is asked for many pairs has its mixture
composed first. h = wi + wo is not normalised: angles do not ask for its length, and wi.h is half of it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .brdf import dielectric


@njit(cache=True, nogil=True, error_model="numpy")
def facet_mixture(wi, wo, p, steps, out, tables, areas, sizes, warp, indices, weights, enough, D, g):  # type: ignore[no-untyped-def]
    """Parameters: number of the mixture, k_d / pi, k_s / (4 F(1)), eta.

    tables (M, rows columns), areas (M, rows columns), sizes: the four numbers of them; indices and weights (S, k) of
    the mixtures. A mixture that `enough` pairs or more ask for is composed in the scratch space D and g, as long as a
    table each.
    """
    rows, columns, channels = out.shape
    # Sites along the inner axis would be composed again and again: they go outside.
    across = steps[4] == 0 and steps[5] != 0
    outer, inner = (columns, rows) if across else (rows, columns)
    pairs = 1
    if indices.shape[0] == 1:
        pairs = rows * columns
    elif steps[4] == 0 or steps[5] == 0:
        pairs = inner
    compose = pairs >= enough
    last_o = last_s = composed = -1
    go = 0.0
    for m in range(outer):
        for n in range(inner):
            i, j = (n, m) if across else (m, n)
            a = i * steps[0] + j * steps[1]
            b = i * steps[2] + j * steps[3]
            q = i * steps[4] + j * steps[5]
            iz, oz = np.float64(wi[a + 2]), np.float64(wo[b + 2])
            if not (iz > 0 and oz > 0):
                for c in range(channels):
                    out[i, j, c] = 0.0
                continue
            ix, iy, ox, oy = np.float64(wi[a]), np.float64(wi[a + 1]), np.float64(wo[b]), np.float64(wo[b + 1])
            s = int(p[q])
            if compose and s != composed:
                _compose(tables, indices, weights, s, D)
                _compose(areas, indices, weights, s, g)
                composed = s
            x, y, z = ix + ox, iy + oy, iz + oz
            row = (math.atan2(math.sqrt(x * x + y * y), z) * (2 / math.pi)) ** (1 / warp) * (sizes[0] - 1)
            if compose:
                value = _between(D, *_corners(row, x, y, sizes[0], sizes[1]))
            else:
                value = _mixed(tables, indices, weights, s, *_corners(row, x, y, sizes[0], sizes[1]))
            cosine = 0.0
            if value > 0:
                cosine = min(0.5 * math.sqrt(x * x + y * y + z * z), 1.0)
                if b != last_o or s != last_s:  # one view, many lights: its area is known
                    go = _area(ox, oy, oz, areas, g, compose, sizes, indices, weights, s)
                    last_o, last_s = b, s
                value /= go * _area(ix, iy, iz, areas, g, compose, sizes, indices, weights, s)
            else:
                value = 0.0
            reflected = value * dielectric(cosine, p[q + 3]) if value > 0 else 0.0
            for c in range(channels):
                out[i, j, c] = p[q + 4 * c + 1] + p[q + 4 * c + 2] * reflected


@njit(cache=True, nogil=True, error_model="numpy")
def _area(x, y, z, areas, g, composed, sizes, indices, weights, s):  # type: ignore[no-untyped-def]
    """max(sum_j w_j g_j, cos theta) to (x, y, z) above the surface."""
    half = math.sqrt(x * x + y * y) / (1 + z)
    corners = _corners((1 - math.sqrt(max(1 - half, 0.0))) * (sizes[2] - 1), x, y, sizes[2], sizes[3])
    return max(_between(g, *corners) if composed else _mixed(areas, indices, weights, s, *corners), z)


@njit(cache=True, nogil=True, error_model="numpy")
def _corners(row, x, y, rows, columns):  # type: ignore[no-untyped-def]
    """Where the four knots about a row and the azimuth of (x, y) stand in a table, and their weights."""
    column = math.atan2(y, x) * (columns / (2 * math.pi))
    if column < 0:
        column += columns
    r, c = min(max(int(row), 0), rows - 2), min(int(column), columns - 1)
    v, u = min(max(row - r, 0.0), 1.0), column - c
    at, beside = r * columns + c, r * columns + (c + 1 if c + 1 < columns else 0)
    return at, beside, columns, (1 - v) * (1 - u), (1 - v) * u, v * (1 - u), v * u


@njit(cache=True, nogil=True, error_model="numpy")
def _between(table, at, beside, below, a, b, c, d):  # type: ignore[no-untyped-def]
    return a * table[at] + b * table[beside] + c * table[at + below] + d * table[beside + below]


@njit(cache=True, nogil=True, error_model="numpy")
def _mixed(tables, indices, weights, s, at, beside, below, a, b, c, d):  # type: ignore[no-untyped-def]
    # Entries by both indices: a view of a row would cost more than what is read of it.
    value = 0.0
    for j in range(indices.shape[1]):
        if weights[s, j] != 0:
            t = indices[s, j]
            upper = a * tables[t, at] + b * tables[t, beside]
            value += weights[s, j] * (upper + c * tables[t, at + below] + d * tables[t, beside + below])
    return value


@njit(cache=True, nogil=True, error_model="numpy")
def _compose(tables, indices, weights, s, out):  # type: ignore[no-untyped-def]
    for n in range(len(out)):
        out[n] = 0
    for j in range(indices.shape[1]):
        if weights[s, j] != 0:
            table, weight = tables[indices[s, j]], weights[s, j]
            for n in range(len(out)):
                out[n] += weight * table[n]
