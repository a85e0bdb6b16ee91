"""Loops over Wigner's d^l(alpha): a recursion in l that keeps two degrees at a time.

    d^l_mk = l (2l-1) / (S_l(m) S_l(k)) [(cos alpha - m k / (l (l-1))) d^(l-1)_mk
             - S_(l-1)(m) S_(l-1)(k) / ((l-1) (2l-1)) d^(l-2)_mk],      S_l(m) = sqrt(l^2 - m^2)

for m < l, started at m = l by the closed form |d^l_lk| = sqrt(C(2l, l+k)) cos(alpha/2)^(l+k) sin(alpha/2)^(l-k).
Only abs(k) <= m is kept, all else is symmetry: row m holds (-1)^(m + max(k, 0)) d_mk, k = -m..m, from entry m^2 on.
Upward in l the recursion is stable. Rows are scaled by 2^900, so that starts as small as 1e-570 keep their digits:
enough up to degree 1,700 (a start that still matters at degree L is never below exp(-.74 L)).
"""

import math

import numpy as np
from numba import njit

SCALE = 2.0**900

# Sums may be reordered, so that they run in vector registers; NaN and infinity keep their meaning.
_FAST = {"reassoc", "contract", "nsz"}


@njit(cache=True, nogil=True, error_model="numpy")
def _halves(alpha):
    """cos(alpha/2), sin(alpha/2), and `side`, `near` with cos alpha = side (1 - near): no digits cancel at 0 and pi."""
    cos_half, sin_half = math.cos(alpha / 2), math.sin(alpha / 2)
    if abs(cos_half) > abs(sin_half):
        return cos_half, sin_half, 1.0, 2 * sin_half * sin_half
    return cos_half, sin_half, -1.0, 2 * cos_half * cos_half


@njit(cache=True, nogil=True, error_model="numpy")
def _tables(degree):
    """What the rows of one degree share, k = -degree..degree: k, S_l(k), S_(l-1)(k) / S_l(k), 1 / S_l(k); sqrt(n)."""
    n = 2 * degree + 1
    orders = np.arange(n) - float(degree)
    return orders, np.zeros(n), np.zeros(n), np.zeros(n), np.sqrt(np.arange(n + 1.0))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST)
def _to_degree(l, orders, s, ratio, inverse):
    """Brings the tables from degree l - 1 to l, for abs(k) < l."""
    inner = slice(len(orders) // 2 - l + 1, len(orders) // 2 + l)
    orders, s, ratio, inverse = orders[inner], s[inner], ratio[inner], inverse[inner]
    for j in range(2 * l - 1):
        root = math.sqrt((l - orders[j]) * (l + orders[j]))
        inverse[j] = 1.0 / root
        ratio[j] = s[j] / root
        s[j] = root


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST)
def _start(l, cos_half, sin_half, roots, row):
    """Row m = l: by ratios from the largest entry outwards, then brought to length SCALE."""
    peak = round(l * (cos_half - sin_half) * (cos_half + sin_half)) + l
    odd = ((2 * l - peak) & 1 and sin_half < 0) != (peak & 1 and cos_half < 0)
    row[peak] = -SCALE if odd else SCALE
    square = 1.0
    for j in range(peak, 2 * l):
        row[j + 1] = row[j] * (roots[2 * l - j] / roots[j + 1] * (cos_half / sin_half))
        square += (row[j + 1] / SCALE) ** 2
    for j in range(peak, 0, -1):
        row[j - 1] = row[j] * (roots[j] / roots[2 * l - j + 1] * (sin_half / cos_half))
        square += (row[j - 1] / SCALE) ** 2
    unit = 1.0 / math.sqrt(square)
    for j in range(2 * l + 1):
        row[j] *= unit
    for j in range(l - 1, -1, -2):
        row[j] = -row[j]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST)
def _advance(l, m, side, near, orders, s, ratio, inverse, row, before):
    """Row m < l of degree l, written over degree l - 2 in `row`, from degree l - 1 in `before`."""
    centre = len(orders) // 2
    a = l * (2 * l - 1) * inverse[centre + m]
    whole, slope, b = side, a, 0.0
    if l > 1:
        whole, slope, b = side * l * (l - 1), a / (l * (l - 1)), l / (l - 1) * ratio[centre + m]
    near = a * side * near
    order = float(m)
    inner = slice(centre - m, centre + m + 1)
    orders, ratio, inverse = orders[inner], ratio[inner], inverse[inner]
    for j in range(2 * m + 1):
        row[j] = inverse[j] * (slope * (whole - order * orders[j]) - near) * before[j] - b * ratio[j] * row[j]


@njit(cache=True, nogil=True, error_model="numpy")
def matrices(degree, lowest, alpha, out):
    """d^l(alpha) for l = lowest..degree, each (2l+1, 2l+1), row after row and one after the other in `out` (flat)."""
    cos_half, sin_half, side, near = _halves(alpha)
    rows = np.zeros((2, (degree + 1) ** 2))
    orders, s, ratio, inverse, roots = _tables(degree)
    at = 0
    for l in range(degree + 1):
        new, old = rows[l & 1], rows[1 - (l & 1)]
        if l > 0:
            _to_degree(l, orders, s, ratio, inverse)
        for m in range(l):
            row = slice(m * m, (m + 1) ** 2)
            _advance(l, m, side, near, orders, s, ratio, inverse, new[row], old[row])
        _start(l, cos_half, sin_half, roots, new[l * l : (l + 1) ** 2])
        if l < lowest:
            continue
        n = 2 * l + 1
        d = out[at : at + n * n].reshape((n, n))
        at += n * n
        for m in range(l + 1):
            for k in range(m + 1):
                sign = 1.0 - 2.0 * ((m + k) & 1)
                same = new[m * m + m + k] / SCALE
                across = (1.0 - 2.0 * (m & 1)) * new[m * m + m - k] / SCALE
                d[l + m, l + k] = d[l - k, l - m] = sign * same
                d[l - m, l - k] = d[l + k, l + m] = same
                d[l + m, l - k] = d[l + k, l - m] = across
                d[l - m, l + k] = d[l - k, l + m] = sign * across


@njit(cache=True, nogil=True, error_model="numpy")
def angles(R):
    """`frames.euler_angles` of one matrix (3, 3), and fourth its squared distance from a rotation."""
    error = 0.0
    for i in range(3):
        for j in range(i + 1):
            product = R[i, 0] * R[j, 0] + R[i, 1] * R[j, 1] + R[i, 2] * R[j, 2]
            error += (product - (1.0 if i == j else 0.0)) ** 2
        # Each row is the cross product of the two after it; a mirror has the opposite.
        j, k = (i + 1) % 3, (i + 2) % 3
        for m in range(3):
            n, o = (m + 1) % 3, (m + 2) % 3
            error += (R[j, n] * R[k, o] - R[j, o] * R[k, n] - R[i, m]) ** 2
    sine = math.hypot(R[0, 2], R[1, 2])
    alpha = math.atan2(sine, R[2, 2])
    if sine > 1e-7:
        return alpha, math.atan2(R[1, 2], R[0, 2]), math.atan2(R[2, 1], -R[2, 0]), error
    return alpha, 0.0, math.atan2(R[1, 0], R[1, 1]), error


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST)
def rotate(coefficients, alpha, beta, gamma, out):
    """Real coefficients ((degree+1)^2, C) of f turned by R_z(beta) R_y(alpha) R_z(gamma), written to `out`.

    On real harmonics d^l falls into a matrix for the cosines and one for the sines, with entries
    (-1)^(m+k) d_mk +- (-1)^m d_m,-k for m, k > 0; m = 0 follows the same rule when its coefficient is divided by
    sqrt 2 before and after. Their transposes differ by (-1)^(m+k), so that each entry is used as it is made, twice.
    """
    channels = coefficients.shape[1]
    degree = round(math.sqrt(coefficients.shape[0])) - 1
    n = degree + 1
    cos_half, sin_half, side, near = _halves(alpha)
    rows = np.zeros((2, n * n))
    orders, s, ratio, inverse, roots = _tables(degree)
    first, last, even, odd = np.empty((2, n)), np.empty((2, n)), np.empty((2, n + 1)), np.empty((2, n + 1))
    for m in range(n):
        first[0, m], first[1, m] = math.cos(m * gamma), math.sin(m * gamma)
        last[0, m], last[1, m] = math.cos(m * beta), math.sin(m * beta)
    cosines, sines = np.zeros((channels, n + 1)), np.zeros((channels, n + 1))
    below_c, below_s = np.zeros((channels, n + 1)), np.zeros((channels, n + 1))
    above_c, above_s = np.zeros((channels, n + 1)), np.zeros((channels, n + 1))
    for l in range(n):
        new, old = rows[l & 1], rows[1 - (l & 1)]
        if l > 0:
            _to_degree(l, orders, s, ratio, inverse)
        at = l * l + l
        for i in range(channels):
            cosines[i, 0], sines[i, 0] = coefficients[at, i] * math.sqrt(0.5), 0.0
            for m in range(1, l + 1):
                x, y = coefficients[at + m, i], coefficients[at - m, i]
                cosines[i, m] = x * first[0, m] - y * first[1, m]
                sines[i, m] = y * first[0, m] + x * first[1, m]
            for m in range(l + 1):
                above_c[i, m] = above_s[i, m] = 0.0
        # Two rows at a time, so that coefficients are read half as often; where l is even the last one's mate is zero.
        for m in range(0, l + 1, 2):
            even[1, : m + 2] = odd[1, : m + 2] = 0.0
            for upper in range(min(2, l + 1 - m)):
                order = m + upper
                part = slice(order * order, (order + 1) ** 2)
                row = new[part]
                if order < l:
                    _advance(l, order, side, near, orders, s, ratio, inverse, row, old[part])
                else:
                    _start(l, cos_half, sin_half, roots, row)
                positive, even_row, odd_row = row[order:], even[upper], odd[upper]
                for k in range(order + 1):
                    x, y = positive[k], row[order - k]
                    even_row[k], odd_row[k] = (x + y) * (1 / SCALE), (x - y) * (1 / SCALE)
            for i in range(channels):
                x, y = cosines[i, m], -cosines[i, m + 1]
                one, two = even[0, m] * x, even[1, m] * x - even[1, m + 1] * y
                for k in range(m):
                    one += even[0, k] * cosines[i, k]
                    two += even[1, k] * cosines[i, k]
                    above_c[i, k] += even[0, k] * x + even[1, k] * y
                above_c[i, m] += even[1, m] * y
                below_c[i, m], below_c[i, m + 1] = one, two
                x, y = sines[i, m], -sines[i, m + 1]
                one, two = odd[0, m] * x, odd[1, m] * x - odd[1, m + 1] * y
                for k in range(m):
                    one += odd[0, k] * sines[i, k]
                    two += odd[1, k] * sines[i, k]
                    above_s[i, k] += odd[0, k] * x + odd[1, k] * y
                above_s[i, m] += odd[1, m] * y
                below_s[i, m], below_s[i, m + 1] = one, two
        for i in range(channels):
            out[at, i] = (below_c[i, 0] + above_c[i, 0]) * math.sqrt(0.5)
            for m in range(1, l + 1):
                sign = 1.0 - 2.0 * (m & 1)
                x, y = below_c[i, m] + sign * above_c[i, m], below_s[i, m] + sign * above_s[i, m]
                out[at + m, i] = x * last[0, m] - y * last[1, m]
                out[at - m, i] = y * last[0, m] + x * last[1, m]
