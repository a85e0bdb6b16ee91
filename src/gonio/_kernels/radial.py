"""Sums of distances to thousands of centres, in single precision: the loops of `brdf/radial.py` and its fits.

    s(q) = p_0 + sum_a p_a q_a + sum_i lambda_i |q - q_i|               q and q_i scaled already (RS 11, 13)

What binds is the square root: a core of Zen 3 takes eight in five cycles, and these loops little more where d = 3. An
approximate reciprocal root with a Newton step, in place of all roots or of every other, gained a tenth at best.

Centres are packed in blocks that stay in the first cache while a group of points passes: rows of one coordinate each,
then rows of coefficients. Within a block single precision adds up, in some thirty partial sums; blocks are added in
double precision, so that coefficients that cancel cost no more digits than the distances have.

All loops release the GIL: callers share points out to threads. Points (P, d), d = 1 to 6; values (P, C), C = 1 or 3.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

# Below, s of an exponential is held: float32 ends at e^88.
LARGEST = 80.0

_BLOCK = 256  # centres, a constant to the compiler: (6 + 3) rows are 9 kB, of a first cache of 32 kB
_GROUP = 64  # points

# Sums may be reordered and fused so that they vectorise. NaN and infinity still spread as they should.
_FAST = {"reassoc", "contract", "nsz"}


def packed(centres: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """The centres (N, d) and coefficients (N, C) as blocks (n, d + C, 256) float32, the last filled up with zeros."""
    rows = np.concatenate((centres, coefficients), axis=1)
    n = -(-len(rows) // _BLOCK)
    # Aligned to the lines of the cache: loads that straddle two of them take twice as long.
    memory = np.zeros(n * _BLOCK * rows.shape[1] + 16, np.float32)
    start = -memory.ctypes.data % 64 // 4
    blocks = memory[start : memory.size - 16 + start].reshape(n, rows.shape[1], _BLOCK)
    for k in range(n):
        part = rows[k * _BLOCK : (k + 1) * _BLOCK]
        blocks[k, :, : len(part)] = part.T
    return blocks


def evaluate(
    q: np.ndarray, centres: np.ndarray, coefficients: np.ndarray, polynomial: np.ndarray, out: np.ndarray
) -> None:
    """Fills `out` (P, C) with s at `q` (P, d) float32; centres (N, d), coefficients (N, C), polynomial (d + 1, C)."""
    evaluate_packed(q, packed(centres, coefficients), polynomial, out)


def evaluate_packed(q: np.ndarray, blocks: np.ndarray, polynomial: np.ndarray, out: np.ndarray) -> None:
    """`evaluate` with centres that are `packed` already."""
    _evaluate(q, blocks, polynomial, out, *_constants(*polynomial.shape))


def residuals(
    q: np.ndarray,
    centres: np.ndarray,
    coefficients: np.ndarray,
    polynomial: np.ndarray,
    targets: np.ndarray,
    out: np.ndarray,
) -> None:
    """Fills `out` (P, C) with `targets` (P, C) less what `evaluate` finds."""
    _residuals(q, packed(centres, coefficients), polynomial, targets, out, *_constants(*polynomial.shape))


def reflect(
    wi: np.ndarray,
    wo: np.ndarray,
    p: np.ndarray,
    steps: tuple[int, ...],
    out: np.ndarray,
    blocks: np.ndarray,
    polynomial: np.ndarray,
    scales: np.ndarray,
    origin: np.ndarray,
    limits: np.ndarray,
    flags: tuple[bool, bool, bool, bool],
) -> None:
    """f `out` (rows, columns, C) of pairs of directions, walked as `brdf/pairs.py` has it; p holds x and y, or nothing.

    Scaled coordinates are (M q - origin); s is held within `limits` (2, C). flags: spatial, logarithm, folded, flat.
    """
    _reflect(wi, wo, p, steps, out, blocks, polynomial, scales, origin, limits, flags, *_constants(*polynomial.shape))


def _constants(rows: int, channels: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Tuples as long as there are coordinates and channels: lengths of tuples are constants to the compiler."""
    return (0,) * (rows - 1), (0,) * channels


@njit(cache=True, nogil=True, error_model="numpy")
def _evaluate(q, blocks, polynomial, out, axes, channels):  # type: ignore[no-untyped-def]
    total = np.empty((_GROUP, len(channels)))
    for start in range(0, q.shape[0], _GROUP):
        count = min(_GROUP, q.shape[0] - start)
        _sum(q[start : start + count], blocks, polynomial, total, axes, channels)
        for k in range(count):
            for c in range(len(channels)):
                out[start + k, c] = total[k, c]


@njit(cache=True, nogil=True, error_model="numpy")
def _residuals(q, blocks, polynomial, targets, out, axes, channels):  # type: ignore[no-untyped-def]
    total = np.empty((_GROUP, len(channels)))
    for start in range(0, q.shape[0], _GROUP):
        count = min(_GROUP, q.shape[0] - start)
        _sum(q[start : start + count], blocks, polynomial, total, axes, channels)
        for k in range(count):
            for c in range(len(channels)):
                out[start + k, c] = targets[start + k, c] - total[k, c]


@njit(cache=True, nogil=True, error_model="numpy")
def _reflect(wi, wo, p, steps, out, blocks, polynomial, scales, origin, limits, flags, axes, channels):  # type: ignore[no-untyped-def]
    rows, columns, _ = out.shape
    spatial, logarithm, folded, flat = flags
    first = 2 if spatial else 0
    q = np.empty((_GROUP, len(axes)), np.float32)
    total = np.empty((_GROUP, len(channels)))
    place = np.empty(_GROUP, np.int64)
    count = 0
    for i in range(rows):
        for j in range(columns):
            a = i * steps[0] + j * steps[1]
            b = i * steps[2] + j * steps[3]
            s = i * steps[4] + j * steps[5]
            iz, oz = np.float64(wi[a + 2]), np.float64(wo[b + 2])
            if iz > 0 and oz > 0:
                u, v, w = _uvw(np.float64(wi[a]), np.float64(wi[a + 1]), iz, wo[b], wo[b + 1], oz)
                if spatial:
                    q[count, 0] = p[s] * scales[0] - origin[0]
                    q[count, 1] = p[s + 1] * scales[1] - origin[1]
                q[count, first] = u * scales[first] - origin[first]
                q[count, first + 1] = (abs(v) if folded else v) * scales[first + 1] - origin[first + 1]
                if not flat:
                    q[count, first + 2] = w * scales[first + 2] - origin[first + 2]
                place[count] = i * columns + j
                count += 1
            else:
                for c in range(len(channels)):
                    out[i, j, c] = 0.0
            if count == _GROUP or (count > 0 and i == rows - 1 and j == columns - 1):
                _sum(q[:count], blocks, polynomial, total, axes, channels)
                for k in range(count):
                    for c in range(len(channels)):
                        value = min(max(total[k, c], limits[0, c]), limits[1, c])
                        value = math.exp(min(value, LARGEST)) if logarithm else max(value, 0.0)
                        out[place[k] // columns, place[k] % columns, c] = value
                count = 0


@njit(cache=True, nogil=True, error_model="numpy")
def _uvw(ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """RS 7 of directions above the surface; phi_d = 0 where theta_d = 0."""
    x, y, z = ix + ox, iy + oy, iz + oz
    scale = 1.0 / math.sqrt(x * x + y * y + z * z)
    x, y, z = x * scale, y * scale, z * scale
    sine = math.sqrt(x * x + y * y)
    cos_p, sin_p = 1.0, 0.0
    if sine > 0.0:
        cos_p, sin_p = x / sine, y / sine
    # wi seen from the frame whose pole is h.
    along = cos_p * ix + sin_p * iy
    dx = z * along - sine * iz
    dy = cos_p * iy - sin_p * ix
    dz = sine * along + z * iz
    d2 = dx * dx + dy * dy
    w = math.atan2(math.sqrt(d2), dz) * (2 / math.pi)
    if d2 > 0.0:
        return sine * (dx * dx - dy * dy) / d2, sine * 2 * dx * dy / d2, w
    return sine, 0.0, w


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _sum(q, blocks, polynomial, total, axes, channels):  # type: ignore[no-untyped-def]
    """Fills `total` (P, C) float64 at q (P, d) float32. One loop over centres: it must stay one that vectorises."""
    d = len(axes)
    for k in range(q.shape[0]):
        for c in range(len(channels)):
            value = np.float64(polynomial[0, c])
            for a in range(d):
                value += np.float64(polynomial[a + 1, c]) * np.float64(q[k, a])
            total[k, c] = value
    for b in range(blocks.shape[0]):
        rows = blocks[b]
        for k in range(q.shape[0]):
            point = q[k]
            if len(channels) == 1:
                red = np.float32(0)
                for i in range(_BLOCK):
                    red += rows[d, i] * _distance(point, rows, i, axes)
                total[k, 0] += red
            else:
                red = green = blue = np.float32(0)
                for i in range(_BLOCK):
                    r = _distance(point, rows, i, axes)
                    red += rows[d, i] * r
                    green += rows[d + 1, i] * r
                    blue += rows[d + 2, i] * r
                total[k, 0] += red
                total[k, 1] += green
                total[k, 2] += blue


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy", inline="always")
def _distance(point, rows, i, axes):  # type: ignore[no-untyped-def]
    square = np.float32(0)
    for a in range(len(axes)):
        e = point[a] - rows[a, i]
        square += e * e
    return np.float32(math.sqrt(square))
