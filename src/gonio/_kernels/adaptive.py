"""The warps of Dupuy and Jakob 2018: the fused loops of `brdf/adaptive.py`, on raw arrays.

A warp takes the unit square to itself so that uniform points get the density of a bilinear table: rows are drawn from
the marginal, then columns from the conditional density. Tables come in slices over the eye's azimuth and elevation,
which are interpolated linearly, densities and their running sums alike.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numba import njit

# Divisions are guarded where they can fail; Python's own check of each costs a third of the time. Contraction rounds
# once where twice were asked for, and leaves NaN and infinity alone.
compiled: Any = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})


class Warp(NamedTuple):
    """Bilinear densities (S, rows, columns) and their running sums from 0, flat so that indexing stays cheap."""

    rows: int
    columns: int
    cells: np.ndarray  # (S rows columns 2,): density, and its sum along the row so far, side by side in the cache
    whole: np.ndarray  # (S rows,): the sum of each row
    marginal: np.ndarray  # (S rows,): the sum of the rows so far


class Tables(NamedTuple):
    """What the loops read. `phi` (P,) and `theta` (T,) are the slices' azimuths and elevations, S = P T."""

    phi: np.ndarray
    theta: np.ndarray
    ndf: np.ndarray  # (rows, columns)
    sigma: np.ndarray  # (rows, columns)
    vndf: Warp
    luminance: Warp
    rgb: np.ndarray  # (S rows columns C,), rows and columns of luminance
    isotropic: bool
    folds: int  # the turn over the range of phi: 1, 2 or 4
    jacobian: bool


Four: TypeAlias = Any  # the slices around an eye direction, their weights, or the corners of a cell


@compiled
def _interval(knots: np.ndarray, x: float) -> tuple[int, float]:
    """(k, w): x lies at the fraction w between knots k and k + 1, held within the range."""
    n = len(knots)
    if n == 1:
        return 0, 0.0
    low = 0  # counted, not searched by halves: the knots are few, and no branch is guessed wrong
    for k in range(1, n - 1):
        low += knots[k] < x
    return low, min(max((x - knots[low]) / (knots[low + 1] - knots[low]), 0.0), 1.0)


@compiled
def _slices(t: Tables, phi: float, theta: float) -> tuple[Four, Four]:
    """The four slices around an eye direction and their weights; an isotropic material weighs the first two alone."""
    T = len(t.theta)
    p, wp = _interval(t.phi, phi)
    k, wt = _interval(t.theta, theta)
    dp = T if len(t.phi) > 1 else 0
    dt = 1 if T > 1 else 0
    s = p * T + k
    return (s, s + dt, s + dp, s + dp + dt), ((1 - wp) * (1 - wt), (1 - wp) * wt, wp * (1 - wt), wp * wt)


@compiled
def _mixed(table: np.ndarray, size: int, s: Four, w: Four, at: int) -> float:
    """Entry `at` of a table with `size` entries a slice, mixed among the slices."""
    value: float = w[0] * table[s[0] * size + at] + w[1] * table[s[1] * size + at]
    if w[2] + w[3] > 0:
        value += w[2] * table[s[2] * size + at] + w[3] * table[s[3] * size + at]
    return value


@compiled
def _edges(t: Warp, s: Four, w: Four, row: int, column: int, fy: float) -> tuple[float, float, float]:
    """(left, right, before): at the height `fy` of a cell, the density at both its edges and the sum before it."""
    left = right = before = 0.0
    for j in range(4):
        if w[j] > 0:
            k = 2 * ((s[j] * t.rows + row) * t.columns + column)
            upper, lower = w[j] * (1 - fy), w[j] * fy
            left += upper * t.cells[k]
            before += upper * t.cells[k + 1]
            right += upper * t.cells[k + 2]
            k += 2 * t.columns
            left += lower * t.cells[k]
            before += lower * t.cells[k + 1]
            right += lower * t.cells[k + 2]
    return left, right, before


@compiled
def _cell(u: float, n: int) -> tuple[int, float]:
    """(k, fraction) of u in [0, 1] among n - 1 cells."""
    x = min(max(u, 0.0), 1.0) * (n - 1)
    k = min(int(x), n - 2)
    return k, x - k


@compiled
def _bilinear(table: np.ndarray, x: float, y: float) -> float:
    row, fy = _cell(y, table.shape[0])
    column, fx = _cell(x, table.shape[1])
    upper = table[row, column] * (1 - fx) + table[row, column + 1] * fx
    lower = table[row + 1, column] * (1 - fx) + table[row + 1, column + 1] * fx
    value: float = upper * (1 - fy) + lower * fy
    return value


@compiled
def _share(f: float, a: float, b: float) -> float:
    """The integral from 0 to f of the line from a to b over the unit interval."""
    return f * (a + 0.5 * f * (b - a))


@compiled
def _place(area: float, a: float, b: float) -> float:
    """The f with `_share(f, a, b)` = area, in the form that loses no digits where a = b."""
    root = math.sqrt(max(a * a + 2 * area * (b - a), 0.0))
    return min(2 * area / (a + root), 1.0) if a + root > 0 else 0.5


@compiled
def _unwarp(t: Warp, s: Four, w: Four, x: float, y: float) -> tuple[float, float, float]:
    """(u, v, density): the uniform point that is warped to (x, y), and the density there."""
    row, fy = _cell(y, t.rows)
    column, fx = _cell(x, t.columns)
    left, right, before = _edges(t, s, w, row, column, fy)
    r0, r1 = _mixed(t.whole, t.rows, s, w, row), _mixed(t.whole, t.rows, s, w, row + 1)
    whole = r0 * (1 - fy) + r1 * fy
    u = (before + _share(fx, left, right) / (t.columns - 1)) / whole if whole > 0 else x
    v = _mixed(t.marginal, t.rows, s, w, row) + _share(fy, r0, r1) / (t.rows - 1)
    return u, v, left * (1 - fx) + right * fx


@compiled
def _warp(t: Warp, s: Four, w: Four, u: float, v: float) -> tuple[float, float]:
    """(x, y): where the uniform point (u, v) is warped to; undoes `_unwarp`."""
    row, high = 0, t.rows - 1
    while high - row > 1:
        middle = (row + high) // 2
        if _mixed(t.marginal, t.rows, s, w, middle) < v:
            row = middle
        else:
            high = middle
    r0, r1 = _mixed(t.whole, t.rows, s, w, row), _mixed(t.whole, t.rows, s, w, row + 1)
    fy = _place((v - _mixed(t.marginal, t.rows, s, w, row)) * (t.rows - 1), r0, r1)
    area = u * (r0 * (1 - fy) + r1 * fy)
    column, high = 0, t.columns - 1
    while high - column > 1:
        middle = (column + high) // 2
        if _edges(t, s, w, row, middle, fy)[2] < area:
            column = middle
        else:
            high = middle
    left, right, before = _edges(t, s, w, row, column, fy)
    fx = _place((area - before) * (t.columns - 1), left, right)
    return (column + fx) / (t.columns - 1), (row + fy) / (t.rows - 1)


@compiled
def _mirror(t: Tables, ox: float, oy: float) -> tuple[float, float]:
    """The signs of x and y that bring an eye direction into the range of azimuths that was measured."""
    if t.folds == 1:
        return 1.0, 1.0
    sy = -math.copysign(1.0, oy)
    return (-math.copysign(1.0, ox) if t.folds == 4 else sy), sy


@compiled
def _square(x: float, y: float, z: float) -> tuple[float, float]:
    """A direction's place in the unit square: (sqrt(2 theta/pi), (phi + pi)/(2 pi))."""
    theta = math.atan2(math.sqrt(x * x + y * y), z)
    return math.sqrt(theta * (2 / math.pi)), (math.atan2(y, x) + math.pi) / (2 * math.pi)


@compiled
def _density(um: float, sin_m: float, om: float) -> float:
    """The solid angle of wi over the area of the unit square, by way of the facets: d omega_i = 4 (o.m) d omega_m."""
    return max(2 * math.pi**2 * um * sin_m, 1e-6) * 4 * om


@compiled
def reflect(t: Tables, wi: np.ndarray, wo: np.ndarray, f: np.ndarray, pdf: np.ndarray) -> None:
    """Fills `f` (n, C) and `pdf` (n,) at local directions `wi`, `wo` (n, 3); either may have no rows, to be left out.

    Zero where a direction lies below the surface, or f is negative (a colour outside sRGB).
    """
    rows, columns = t.luminance.rows, t.luminance.columns
    C = len(t.rgb) // (len(t.phi) * len(t.theta) * rows * columns)
    for k in range(wi.shape[0]):
        for channel in range(f.shape[1] if k < f.shape[0] else 0):
            f[k, channel] = 0.0
        if k < pdf.shape[0]:
            pdf[k] = 0.0
        if wi[k, 2] <= 0 or wo[k, 2] <= 0:
            continue
        sx, sy = _mirror(t, wo[k, 0], wo[k, 1])
        ox, oy, oz = sx * wo[k, 0], sy * wo[k, 1], float(wo[k, 2])
        mx, my, mz = sx * wi[k, 0] + ox, sy * wi[k, 1] + oy, wi[k, 2] + oz
        length = math.sqrt(mx * mx + my * my + mz * mz)
        mx, my, mz = mx / length, my / length, mz / length
        uo, vo = _square(ox, oy, oz)
        um, vm = _square(mx, my, mz)
        if t.isotropic:
            vm -= vo - 0.5
            vm -= math.floor(vm)
        s, w = _slices(t, (2 * vo - 1) * math.pi, uo * uo * (math.pi / 2))
        x, y, density = _unwarp(t.vndf, s, w, um, vm)
        if k < f.shape[0]:
            scale = 1.0 / wi[k, 2]
            if t.jacobian:
                scale *= _bilinear(t.ndf, um, vm) / (4 * _bilinear(t.sigma, uo, vo))
            row, fy = _cell(y, rows)
            column, fx = _cell(x, columns)
            for j in range(4):
                if w[j] > 0:
                    at = ((s[j] * rows + row) * columns + column) * C
                    below = at + columns * C
                    a, b = scale * w[j] * (1 - fx) * (1 - fy), scale * w[j] * fx * (1 - fy)
                    c, d = scale * w[j] * (1 - fx) * fy, scale * w[j] * fx * fy
                    for channel in range(C):
                        f[k, channel] += a * t.rgb[at + channel] + b * t.rgb[at + C + channel]
                        f[k, channel] += c * t.rgb[below + channel] + d * t.rgb[below + C + channel]
            for channel in range(C):
                f[k, channel] = max(f[k, channel], 0.0)
        if k < pdf.shape[0]:
            om = ox * mx + oy * my + oz * mz
            row, fy = _cell(y, t.luminance.rows)
            column, fx = _cell(x, t.luminance.columns)
            left, right, _ = _edges(t.luminance, s, w, row, column, fy)
            density *= left * (1 - fx) + right * fx
            pdf[k] = density / _density(um, math.sqrt(mx * mx + my * my), om)


@compiled
def draw(t: Tables, wo: np.ndarray, u: np.ndarray, wi: np.ndarray) -> None:
    """Fills `wi` (n, 3) with directions drawn for `wo` (n, 3) from uniform numbers `u` (n, 2)."""
    for k in range(wo.shape[0]):
        sx, sy = _mirror(t, wo[k, 0], wo[k, 1])
        ox, oy, oz = sx * wo[k, 0], sy * wo[k, 1], float(wo[k, 2])
        uo, vo = _square(ox, oy, oz)
        phi_o = (2 * vo - 1) * math.pi
        s, w = _slices(t, phi_o, uo * uo * (math.pi / 2))
        x, y = _warp(t.luminance, s, w, float(u[k, 1]), float(u[k, 0]))
        x, y = _warp(t.vndf, s, w, x, y)
        theta, phi = x * x * (math.pi / 2), (2 * y - 1) * math.pi
        if t.isotropic:
            phi += phi_o
        mx, my, mz = math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)
        om = ox * mx + oy * my + oz * mz
        wi[k, 0] = sx * (2 * om * mx - ox)
        wi[k, 1] = sy * (2 * om * my - oy)
        wi[k, 2] = 2 * om * mz - oz
