"""Loops over Wigner's d^l(alpha): a recursion in l that keeps two degrees at a time.

    d^l_mk = l (2l-1) / (S_l(m) S_l(k)) [(cos alpha - m k / (l (l-1))) d^(l-1)_mk
             - S_(l-1)(m) S_(l-1)(k) / ((l-1) (2l-1)) d^(l-2)_mk],      S_l(m) = sqrt(l^2 - m^2)

for m < l, started at m = l by the closed form |d^l_lk| = sqrt(C(2l, l+k)) cos(alpha/2)^(l+k) sin(alpha/2)^(l-k).
Upward in l it is stable. The last factor becomes one with d^l_mk = u_l(m) u_l(k) e^l_mk:

    e^l_mk = l (2l-1) f_l(m) f_l(k) (cos alpha - m k / (l (l-1))) e^(l-1)_mk - e^(l-2)_mk,
    f_l(k) = u_(l-1)(k) / (S_l(k) u_l(k)),
    u_l(k) = sqrt(l / (l-1)) S_(l-1)(k) / S_l(k) u_(l-2)(k),    u_k(k) = u_(k+1)(k) = 1

Only 0 <= k <= m is kept, all else is symmetry: `plus`, (-1)^(m+k) e_mk, and `minus`, (-1)^m e_m,-k, both halved at
m = k, which the symmetries meet twice. Their sum and difference turn cosines and sines, but cannot stand for them in
the recursion: the small of the two would drown in the rounding of the large, and grow.

Rows lie in chunks of 16 entries, padded with zeros, in each chunk plus and minus of the even degree and of the odd one:
at distances that the compiler knows, so that it need not ask whether they overlap, which took longer than the sums.
Entries are scaled by 2^900, so that starts as small as 1e-570 keep their digits: enough up to degree 1,500.
"""

import math

import numpy as np
from numba import njit

SCALE = 2.0**900
CHUNK = 16
ROWS = 4  # turned at a time, so that coefficients are read a quarter as often
ROOM = 1544  # entries of a row of sums at most; not a multiple of 512, which would meet itself in the cache

# Products and sums may fuse; long sums may run in vector registers. NaN and infinity keep their meaning.
_FUSED = {"contract"}
_REORDERED = {"contract", "reassoc", "nsz"}


@njit(cache=True, nogil=True, error_model="numpy")
def _halves(alpha):
    """cos(alpha/2), sin(alpha/2), and `side`, `near` with cos alpha = side (1 - near): no digits cancel at 0 and pi."""
    cos_half, sin_half = math.cos(alpha / 2), math.sin(alpha / 2)
    if abs(cos_half) > abs(sin_half):
        return cos_half, sin_half, 1.0, 2 * sin_half * sin_half
    return cos_half, sin_half, -1.0, 2 * cos_half * cos_half


@njit(cache=True, nogil=True, error_model="numpy")
def _chunk_of(m):
    """The chunk that row m begins with: 16 rows have one, the next 16 two, ..."""
    return (m // CHUNK + 1) * (m - CHUNK // 2 * (m // CHUNK))


@njit(cache=True, nogil=True, error_model="numpy")
def _tables(degree):
    """Empty rows, and what they share: u of two degrees; f and k in chunks; S; row m = l of d, and its ends."""
    width = CHUNK * (degree // CHUNK + 1)
    rows = np.zeros((_chunk_of(width), 4 * CHUNK))
    factors = np.zeros((width // CHUNK, 2 * CHUNK))
    factors[:, CHUNK:] = np.arange(width).reshape(-1, CHUNK)
    return rows, np.ones((2, width)), factors, np.zeros(width), np.zeros((2, width)), np.full(2, SCALE)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_FUSED)
def _to_degree(l, cos_half, sin_half, u, before, factors, s, start, ends):
    """Brings the tables from degree l - 1 to l, and `u`, with `before` of l - 1, from l - 2."""
    shrink = math.sqrt(l / (l - 1.0)) if l > 1 else 0.0
    grow = math.sqrt(2.0 * l * (2 * l - 1)) * cos_half * sin_half
    for k in range(l):
        root = math.sqrt(float((l - k) * (l + k)))
        inverse = 1.0 / root
        u[k] = shrink * s[k] * inverse * u[k] if k < l - 1 else 1.0
        factors[k // CHUNK, k % CHUNK] = inverse * before[k] / u[k]
        s[k] = root
        start[0, k] *= grow * inverse
        start[1, k] *= grow * inverse
    if l > 0:
        ends[0] *= cos_half * cos_half
        ends[1] *= -sin_half * sin_half
    start[0, l], start[1, l] = ends[0], ends[1]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_FUSED)
def _start(l, odd, u, start, row, sums):
    """Row m = l, its sums and differences."""
    new = 2 * CHUNK * odd
    for k in range(l + 1):
        share = (1.0 if k < l else 0.5) / u[k]
        plus, minus = start[0, k] * share, start[1, k] * share
        row[k // CHUNK, new + k % CHUNK] = plus
        row[k // CHUNK, new + CHUNK + k % CHUNK] = minus
        sums[k], sums[ROOM + k] = plus + minus, plus - minus


@njit(cache=True, nogil=True, error_model="numpy")
def _terms(l, side, near):
    """a, b, c with l (2l-1) (cos alpha - m k / (l (l-1))) = b (a - m k) - c, a and m k whole numbers."""
    pair, scale = max(l * (l - 1.0), 1.0), l * (2 * l - 1.0)
    return side * pair, scale / pair, scale * side * near


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_FUSED)
def _advance(m, terms, odd, factors, row, sums):
    """Row m < l over degree l - 2, in its chunks, from degree l - 1 beside it; its sums and differences."""
    new, old = 2 * CHUNK * odd, 2 * CHUNK - 2 * CHUNK * odd
    f = factors[m // CHUNK, m % CHUNK]
    order, a, b, c = float(m), terms[0], terms[1] * f, terms[2] * f
    for i in range(len(row)):
        chunk, factor, out = row[i], factors[i], sums[i * CHUNK :]
        for k in range(CHUNK):
            product = order * factor[CHUNK + k]
            up, down = factor[k] * (b * (a - product) - c), factor[k] * (b * (a + product) - c)
            plus = up * chunk[old + k] - chunk[new + k]
            minus = down * chunk[old + CHUNK + k] - chunk[new + CHUNK + k]
            chunk[new + k] = plus
            chunk[new + CHUNK + k] = minus
            out[k] = plus + minus
            out[ROOM + k] = plus - minus


@njit(cache=True, nogil=True, error_model="numpy")
def matrices(degree, lowest, alpha, out):
    """d^l(alpha) for l = lowest..degree, each (2l+1, 2l+1), row after row and one after the other in `out` (flat)."""
    cos_half, sin_half, side, near = _halves(alpha)
    rows, both, factors, s, start, ends = _tables(degree)
    sums = np.empty(2 * ROOM)
    at = 0
    for l in range(degree + 1):
        odd = l & 1
        u = both[odd]
        _to_degree(l, cos_half, sin_half, u, both[1 - odd], factors, s, start, ends)
        terms = _terms(l, side, near)
        for m in range(l):
            _advance(m, terms, odd, factors, rows[_chunk_of(m) : _chunk_of(m + 1)], sums)
        _start(l, odd, u, start, rows[_chunk_of(l) : _chunk_of(l + 1)], sums)
        if l < lowest:
            continue
        n = 2 * l + 1
        d = out[at : at + n * n].reshape((n, n))
        at += n * n
        for m in range(l + 1):
            for k in range(m + 1):
                chunk, place = rows[_chunk_of(m) + k // CHUNK], 2 * CHUNK * odd + k % CHUNK
                share = u[m] * u[k] * (1.0 if k < m else 2.0)
                sign = 1.0 - 2.0 * ((m + k) & 1)
                same = chunk[place] * share / SCALE
                across = (1.0 - 2.0 * (m & 1)) * (chunk[place + CHUNK] * share / SCALE)
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


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_REORDERED)
def _turn_rows(a, b, c, d, x, at, below, above):
    """Four rows times `x` into `below`, and x `at` these rows times them, signs alternating, onto `above`."""
    one, two, three, four = at[0], -at[1], at[2], -at[3]
    e = f = g = h = 0.0
    for k in range(8 * (len(x) // 8)):
        e += a[k] * x[k]
        f += b[k] * x[k]
        g += c[k] * x[k]
        h += d[k] * x[k]
        above[k] += a[k] * one + b[k] * two + c[k] * three + d[k] * four
    below[0], below[1], below[2], below[3] = e, f, g, h


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_FUSED)
def rotate(coefficients, alpha, beta, gamma, out):
    """Real coefficients ((degree+1)^2, C) of f turned by R_z(beta) R_y(alpha) R_z(gamma), written to `out`.

    On real harmonics d^l falls into a matrix for the cosines and one for the sines, with entries
    (-1)^(m+k) d_mk +- (-1)^m d_m,-k for m, k > 0; m = 0 follows the same rule when its coefficient is divided by
    sqrt 2 before and after. Their transposes differ by (-1)^(m+k), so that each entry is used as it is made, twice.
    """
    channels = coefficients.shape[1]
    n = round(math.sqrt(coefficients.shape[0]))
    cos_half, sin_half, side, near = _halves(alpha)
    rows, both, factors, s, start, ends = _tables(n - 1)
    sums = np.empty((ROWS, 2 * ROOM))
    width = both.shape[1]
    first, last, share = np.empty((2, n)), np.empty((2, n)), np.empty(n)
    for m in range(n):
        first[0, m], first[1, m] = math.cos(m * gamma), math.sin(m * gamma)
        last[0, m], last[1, m] = math.cos(m * beta), math.sin(m * beta)
    x, below, above = np.zeros((channels, 2, width)), np.zeros((channels, 2, width)), np.zeros((channels, 2, width))
    for l in range(n):
        odd = l & 1
        u = both[odd]
        _to_degree(l, cos_half, sin_half, u, both[1 - odd], factors, s, start, ends)
        for m in range(l + 1):  # half of what undoes SCALE before and half after, so that nothing overflows
            share[m] = u[m] / math.sqrt(SCALE)
        share[0] *= math.sqrt(0.5)
        at = l * l + l
        for i in range(channels):
            x[i, 0, 0] = coefficients[at, i] * share[0]
            for m in range(1, l + 1):
                cosine, sine = coefficients[at + m, i] * share[m], coefficients[at - m, i] * share[m]
                x[i, 0, m] = cosine * first[0, m] - sine * first[1, m]
                x[i, 1, m] = sine * first[0, m] + cosine * first[1, m]
        above[:, :, : l + 1] = 0.0
        terms = _terms(l, side, near)
        for m in range(0, l + 1, ROWS):
            padded = 8 * (m // 8 + 1)
            for j in range(ROWS):
                order = m + j
                row = rows[_chunk_of(order) : _chunk_of(order + 1)]
                if order < l and odd == 0:  # two calls, so that the compiler knows either place
                    _advance(order, terms, 0, factors, row, sums[j])
                elif order < l:
                    _advance(order, terms, 1, factors, row, sums[j])
                else:
                    sums[j, :padded] = 0.0
                    sums[j, ROOM : ROOM + padded] = 0.0
                    if order == l:
                        _start(l, odd, u, start, row, sums[j])
            here = slice(m, m + ROWS)
            for kind in range(2):
                part = slice(ROOM * kind, ROOM * kind + padded)
                a, b, c, d = sums[0, part], sums[1, part], sums[2, part], sums[3, part]
                for i in range(channels):
                    of, onto = x[i, kind], above[i, kind]
                    _turn_rows(a, b, c, d, of[:padded], of[here], below[i, kind, here], onto[:padded])
        for i in range(channels):
            out[at, i] = (below[i, 0, 0] + above[i, 0, 0]) * share[0]
            for m in range(1, l + 1):
                sign = 1.0 - 2.0 * (m & 1)
                cosine = (below[i, 0, m] + sign * above[i, 0, m]) * share[m]
                sine = (below[i, 1, m] + sign * above[i, 1, m]) * share[m]
                out[at + m, i] = cosine * last[0, m] - sine * last[1, m]
                out[at - m, i] = sine * last[0, m] + cosine * last[1, m]
