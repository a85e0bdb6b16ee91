"""The theta factor of every harmonic, scalar and spin-weighted, as three-term recursions ready for the kernels.

    lambda_lm(theta) = sqrt((2 l + 1) / (4 pi)) d^l_{m,-s}(theta)                                 s the spin weight
    g_l lambda_{l+1} = (cos theta - b_l) lambda_l - g_{l-1} lambda_{l-1},      b_l = -m s / (l (l + 1))
    g_l = sqrt((l + 1)^2 - m^2) sqrt((l + 1)^2 - s^2) / ((l + 1) sqrt((2 l + 1) (2 l + 3)))

starting at l = max(m, abs(s)) with a product of powers of cos and sin of theta/2. Only m >= 0 is needed: the functions
at -m are those at m seen from the other pole, d^l_{-m,-s}(theta) = (-1)^(l+s) d^l_{m,-s}(pi - theta).

The kernels are spared a product a step: with lambda_i = scale_i P_i and scale_{i+1} g_i = scale_{i-1} g_{i-1} the last
term becomes P_{i-1} itself. Since g grows towards 1/2, every scale lies between g of the first step and 2.

Without spin two steps make one in cos^2 theta, on the northern rings alone: the even l - m are symmetric about the
equator, and the odd ones are cos theta times a sum over the even ones (Ishioka 2018, "A new recurrence formula for
efficient computation of spherical harmonic transform"; the way of libsharp and ducc).
The transforms over phi and the public functions stand in `transform.py`.
"""

from __future__ import annotations

import dataclasses
import math
from functools import lru_cache

import numpy as np

from .._kernels import legendre as kernels
from ..arrays import Array
from .grids import Grid
from .tiles import empty_tiles, tiled, untiled

_LEVEL = 512  # a number is start 2^(_LEVEL level), as in the kernels
_NEGLIGIBLE = 54.0  # exp(-54) = 4e-24: beside it a norm of up to sqrt(degree) and the like has no say


@dataclasses.dataclass(frozen=True, eq=False)
class Recursion:
    """What the kernels take: for every order m = 0..degree its start at every ring and its factors at every step."""

    start: np.ndarray  # (orders, rings)
    level: np.ndarray  # (orders, rings), 0 or less
    a: np.ndarray  # (orders, steps), steps padded to eights with zeros
    b: np.ndarray
    scale: np.ndarray
    count: np.ndarray  # (orders,): steps that are not padding
    first: np.ndarray  # (orders,): the rings first..stop are not negligible
    stop: np.ndarray
    t: np.ndarray  # (rings,): the argument, cos theta or its square
    kept: dict[tuple[str, str], list[Array]] = dataclasses.field(default_factory=dict, repr=False)
    """Tables of all orders for other libraries, by dtype and device (whose names tell the libraries apart)."""

    def synthesise(self, coefficients: np.ndarray) -> np.ndarray:
        """(orders, steps, channels) -> rings (orders, channels, rings)."""
        tiles = empty_tiles(coefficients.shape[0], coefficients.shape[2], self.t.size, coefficients.dtype)
        self.fill(tiles, coefficients, slice(0, coefficients.shape[0]))
        return untiled(tiles, self.t.size)

    def fill(self, tiles: np.ndarray, coefficients: np.ndarray, orders: slice) -> None:
        """The same for some orders, into `tiles` of all."""
        kernels.synthesise(coefficients, *self._arguments(orders), tiles)

    def analyse(self, rings: np.ndarray) -> np.ndarray:
        """Rings (orders, channels, rings) -> (orders, steps, channels)."""
        return self.project(tiled(rings), slice(0, rings.shape[0]))

    def project(self, tiles: np.ndarray, orders: slice) -> np.ndarray:
        """The same for some orders, from `tiles` of all."""
        coefficients = np.empty((orders.stop - orders.start, self.a.shape[1], tiles.shape[2]), tiles.dtype)
        kernels.analyse(tiles, *self._arguments(orders), coefficients)
        return coefficients

    def table(self, m: int) -> np.ndarray:
        """The functions of order `m`, (steps, rings), in float64; the padding is 0."""
        table = np.empty((self.a.shape[1], self.t.size))
        kernels.tabulate(self.start[m], self.level[m], self.a[m], self.b[m], self.scale[m], self.t, table)
        table[self.count[m] :] = 0
        return table

    def _arguments(self, orders: slice) -> tuple[np.ndarray | int, ...]:
        fields = (self.start, self.level, self.a, self.b, self.scale, self.count, self.first, self.stop)
        return *(x[orders] for x in fields), self.t, orders.start


@lru_cache(maxsize=8)
def spin_recursion(grid: Grid, degree: int, spin: int) -> Recursion:
    """lambda_lm at all rows of `grid`, one step for each l from max(m, abs(spin)) to `degree`."""
    m, l = _steps(degree, spin)
    centre = -m * spin / np.maximum(l * (l + 1), 1)
    return _recursion(grid.theta, degree, spin, l, _coupling(l, m, spin), centre, np.cos(grid.theta))


@lru_cache(maxsize=8)
def folded_recursion(grid: Grid, degree: int) -> Recursion:
    """(-1)^m lambda_lm (no Condon-Shortley sign) for l = m, m + 2, ..., at the northern rows and the equator."""
    m, l = _steps(degree, 0)
    l = m + 2 * (l - m)[:, : degree // 2 + 1]
    g = _coupling(l, m, 0)
    theta = grid.theta[: (grid.rows + 1) // 2]
    centre = g**2 + _coupling(l - 1, m, 0) ** 2
    return _recursion(theta, degree, 0, l, g * _coupling(l + 1, m, 0), centre, np.cos(theta) ** 2, sign=False)


@lru_cache(maxsize=8)
def odd_factors(degree: int, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """(1 / g_l, g_{l+1}) for l = m, m + 2, ..., each (steps, orders): what turns sums over odd l into even ones.

    cos theta lambda_l = g_l lambda_{l+1} + g_{l-1} lambda_{l-1}, so that the sum over odd l - m of f_l lambda_l is cos
    theta times the sum over even l - m of h_l lambda_l, where g_l h_l = f_{l+1} - g_{l+1} h_{l+2}.
    """
    m = np.arange(degree + 1)[None, :]
    l = m + 2 * np.arange(steps)[:, None]
    return 1 / _coupling(l, m, 0), _coupling(l + 1, m, 0)


def _steps(degree: int, spin: int) -> tuple[np.ndarray, np.ndarray]:
    """m (orders, 1) and l (orders, steps), counted from max(m, abs(spin))."""
    m = np.arange(degree + 1)[:, None]
    return m, np.maximum(m, abs(spin)) + np.arange(degree - abs(spin) + 1)[None, :]


def _coupling(l: np.ndarray, m: np.ndarray, spin: int) -> np.ndarray:
    """g_l; 0 below the first l."""
    n = np.maximum(l + 1.0, 1.0)
    square = np.maximum(n * n - m * m, 0) * np.maximum(n * n - spin * spin, 0) / (n * n * (4 * n * n - 1))
    return np.sqrt(np.where(l >= np.maximum(m, abs(spin)), square, 0))


def _recursion(
    theta: np.ndarray,
    degree: int,
    spin: int,
    l: np.ndarray,
    g: np.ndarray,
    centre: np.ndarray,
    t: np.ndarray,
    sign: bool = True,
) -> Recursion:
    """g_i lambda_{i+1} = (t - centre_i) lambda_i - g_{i-1} lambda_{i-1}; degrees, g and centre are (orders, steps)."""
    inside = l <= degree
    scale = np.ones_like(g)
    for i in range(2, g.shape[1]):
        scale[:, i] = scale[:, i - 2] * g[:, i - 2] / g[:, i - 1]
    slope = scale / g
    slope[:, :-1] /= scale[:, 1:]
    shape = degree + 1, -(-l.shape[1] // kernels.EIGHT) * kernels.EIGHT
    factors = []
    for factor in (slope, -centre * slope, scale):
        padded = np.zeros(shape)
        padded[:, : l.shape[1]] = np.where(inside, factor, 0)
        factors.append(padded)
    start, level = _start(theta, degree, spin, sign)
    first, stop = _range(theta, degree, spin)
    a, b, scale = factors
    return Recursion(start, level, a, b, scale, inside.sum(axis=1), first, stop, t)


def _start(theta: np.ndarray, degree: int, spin: int, sign: bool) -> tuple[np.ndarray, np.ndarray]:
    """lambda at l = max(m, abs(s)) for m = 0..degree: sqrt((2l + 1)/(4 pi) binomial(2l, p)) cos^p sin^q of theta/2.

    p = abs(m - s), q = abs(m + s). As start 2^(512 level) with start in (2^-513, 1].
    """
    highest = degree + abs(spin)
    cosine, sine = _powers(np.cos(theta / 2), highest), _powers(np.sin(theta / 2), highest)
    start, level = np.empty((degree + 1, theta.size)), np.empty((degree + 1, theta.size), np.int64)
    for m in range(degree + 1):
        l, p, q = max(m, abs(spin)), abs(m - spin), abs(m + spin)
        square = (2 * l + 1) * math.comb(2 * l, p)
        shift = max(square.bit_length() - 100, 0) // 2  # a binomial may exceed every float
        norm = math.sqrt((square >> (2 * shift)) / (4 * math.pi))
        negative = sign and q % 2 == 1 and -spin <= m
        mantissa, exponent = np.frexp(cosine[0][p] * sine[0][q] * (-norm if negative else norm))
        exponent = exponent + cosine[1][p] + sine[1][q] + shift
        level[m] = np.minimum(-(-exponent // _LEVEL), 0)
        start[m] = np.ldexp(mantissa, exponent - _LEVEL * level[m])
    return start, level


def _powers(x: np.ndarray, highest: int) -> tuple[np.ndarray, np.ndarray]:
    """x^0..x^highest as (mantissa, exponent), each (highest + 1, x.size), beyond the range of a float64."""
    mantissa, exponent = np.ones((highest + 1, x.size)), np.zeros((highest + 1, x.size), np.int64)
    for k in range(highest):
        mantissa[k + 1], carried = np.frexp(mantissa[k] * x)
        exponent[k + 1] = exponent[k] + carried
    return mantissa, exponent


def _range(theta: np.ndarray, degree: int, spin: int) -> tuple[np.ndarray, np.ndarray]:
    """For each order the rings first..stop where lambda is not negligible: what is left out is below 1e-20.

    With y = log tan(theta / 2) the functions obey lambda'' = Q lambda, Q = n^2 - l (l + 1) sin^2 theta, n^2 = m^2 + s^2
    - 2 m s cos theta. Where Q > 0, towards a pole, v = lambda' / lambda starts at n with v' = Q - v^2; it stays above
    sqrt(Q), since Q falls on the way out (v' = 0 where they meet). So lambda dies at least as exp(-S), S = integral of
    sqrt(Q) dy out to Q = 0. There x = (l + 1/2) sin theta, no less than the root of what is taken off n^2, has
    dy = dx / (x cos theta) >= dx / x; the n of here is the least from here on if s cos theta counts as positive. So S
    is at least the integral of sqrt(n^2 - x^2) dx / x from here to x = n (with spin Q need not fall; a test measures):

        n artanh(w / n) - w,  w = sqrt(n^2 - x^2)        (Debye's exponent of the Bessel function J_n(x))
    """
    m = np.arange(degree + 1)[:, None]
    n = np.sqrt(m * m + spin * spin - 2 * m * abs(spin) * np.abs(np.cos(theta)))
    w = np.sqrt(np.maximum(n * n - ((degree + 0.5) * np.sin(theta)) ** 2, 0))
    lives = n * np.arctanh(w / np.maximum(n, 1)) - w <= _NEGLIGIBLE
    lives[:, -1] |= ~lives.any(axis=1)  # never an empty range
    return np.argmax(lives, axis=1), theta.size - np.argmax(lives[:, ::-1], axis=1)
