"""How far apart two partial distributions of facets are, for all turns about the normal at once (MS 13-15).

    dist(1, 2) = integral over O of sqrt(W1 W2) (D1/s1 - D2/s2)^2 d omega / integral over O of sqrt(W1 W2) d omega
    s1, s2 = integrals of D1, D2 over the overlap O = {h: W1 W2 > 0}                                          MS 15

With V = sqrt(W), M = (W > 0) the square expands into circular correlations x * y (k) = sum over knots w x(c) y(c - k):

    dist = (V D^2 * V / s1^2  -  2 V D * V D / (s1 s2)  +  V * V D^2 / s2^2) / (V * V)
    s1 = M D * M,    s2 = M * M D,    M * M is the solid angle of the overlap

Only V D * V D is of each pair. The others take one factor, or both, from W alone, and are made once for each W that
differs: one correlation a pair where all share one Omega, three where those of one side do, seven at the worst.

D and W have integral 1. Where s1, s2 or V * V is below 1e-4 (1e-2 in single precision) rounding would speak for the
facets: there, and where nothing overlaps, the distance is infinite. What the square loses by its expansion is, for
cloth and metal, 5e-15 (3e-6) of the mean of (D1/s1)^2 over the overlap, of which distances are 1 to 90 %.

Not here: turns between two columns; merging what was found (MS 16, 17).
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..arrays import Array, frozen, to_numpy
from ..errors import MEMORY_LIMIT, ArrayError, MemoryLimitError, ParameterError
from .turnable import Spectra, Turnable, require_alike

_LEAST = {np.dtype(np.float64): 1e-4, np.dtype(np.float32): 1e-2}
_ROUNDING = {np.dtype(np.float64): 1e-12, np.dtype(np.float32): 1e-5}  # of overlaps, beside their bounds
# Multiply-adds of one product of matrices: up to here OpenBLAS takes one thread, and so does not wait for others, which
# costs time slices where processors are shared. It is enough: products fit the cache.
_PRODUCT = 1 << 18
_FEW = 8  # what W alone tells is kept for all pairs if it is so many times less than what pairs tell


@dataclasses.dataclass(frozen=True, eq=False)
class Best:
    """For each of A: `second` (A,), the index of its best partner, -1 where there is none; `turn` (A,), the columns by
    which that is turned (numpy.roll); `distance` (A,) in 1/sr^2, infinite where there is none; `overlap` (A,)."""

    second: np.ndarray
    turn: np.ndarray
    distance: np.ndarray
    overlap: np.ndarray


def turned_distances(first: Turnable, second: Turnable) -> tuple[np.ndarray, np.ndarray]:
    """Distances (A, B, columns) in 1/sr^2 of A distributions from B turned by 2 pi k/columns from s towards t, and the
    part of each turned domain that lies within the first's, (A, B, columns), in [0, 1].

    Raises `ArrayError` where their grids or precisions differ, `MemoryLimitError` for too many pairs: `best_turns`
    keeps only the best.
    """
    require_alike(first, second)
    shape = len(first), len(second), first.columns
    need = 2 * math.prod(shape) * first.dtype.itemsize
    if need > MEMORY_LIMIT:
        raise MemoryLimitError(
            f"all turns of {shape[0]} x {shape[1]} pairs need {1e-9 * need:.1f} GB of at most {MEMORY_LIMIT / 1e9:g}: "
            "ask for `best_turns`."
        )
    distances, overlaps = np.full(shape, np.inf, first.dtype), np.empty(shape, first.dtype)
    pairs = _Pairs(first, second, MEMORY_LIMIT)
    for a in pairs.blocks(shape[0]):
        both = _both(pairs.first.VD[a])
        for b in pairs.blocks(shape[1]):
            terms = pairs.terms(a, b)
            whole = len(terms.planes) == shape[2]  # as a rule, and a slice is quicker
            distances[a, b, slice(None) if whole else terms.planes] = np.moveaxis(
                pairs.distances(both, b, terms), 0, -1
            )
            overlaps[a, b] = np.moveaxis(terms.overlap, 0, -1)
    return distances, overlaps


def best_turns(
    first: Turnable,
    second: Turnable,
    overlap: tuple[float, float] = (0.5, 0.85),
    allowed: Array | None = None,
    coarse: int = 1,
    keep: int = 40,
    memory: int = 256_000_000,
    relative: bool = False,
) -> Best:
    """The nearest of B turned distributions to each of A, of those whose domains lie between `overlap[0]` and
    `overlap[1]` within its own (MS 5.2 wants 50 to 85 %: likeness is told, and something is added).

    relative: divide distances by the mean of (D1/s1)^2 + (D2/s2)^2, so that sharp facets are as far as dull ones.
    allowed: (A, B) False where a pair is excluded (itself, say). coarse: > 1 looks at means over so many rows by so
    many columns first, and then at the best `keep` of B as they are: among 1,600 cloths 4 finds the same for 99 % in
    half of the time, among 400 nothing is gained. memory: bytes to use beside the transforms.

    Raises `ArrayError` where grids, precisions or `allowed` do not fit, `ParameterError` for bounds that are no
    interval in [0, 1] and for other coarse and keep, `MemoryLimitError` where `memory` is too little for one pair.
    """
    require_alike(first, second)
    _require_interval(overlap)
    if keep < 1:
        raise ParameterError(f"keep = {keep}; one or more are wanted.")
    shape = len(first), len(second)
    may = None if allowed is None else to_numpy(allowed)
    if may is not None and (may.shape != shape or may.dtype != bool):
        raise ArrayError(f"allowed is {may.dtype} {may.shape}; bool {shape} is wanted.")
    best = Best(np.full(shape[0], -1), np.zeros(shape[0], int), np.full(shape[0], np.inf), np.zeros(shape[0]))
    if not min(shape):
        return best
    exact = _Pairs(first, second, memory, overlap, relative=relative)
    looking = exact
    if coarse != 1:
        looking = _Pairs(first.coarser(coarse), second.coarser(coarse), memory, overlap, True, relative)
    keep = 1 if coarse == 1 else min(keep, shape[1])
    for a in looking.blocks(shape[0]):
        least = looking.least(a)
        if may is not None:
            least[~may[a]] = np.inf
        partners = np.argpartition(least, keep - 1, axis=1)[:, :keep]
        seen = np.isfinite(np.take_along_axis(least, partners, axis=1))
        exact.write_best(np.arange(a.start, a.stop), partners, seen, best)
    return best


@dataclasses.dataclass(frozen=True, eq=False)
class Nearest:
    """For each of A the nearest partners, nearest first: `second` (A, count), -1 where there are no more; `turn` and
    `distance` as of `Best`."""

    second: np.ndarray
    turn: np.ndarray
    distance: np.ndarray


def nearest_turns(
    first: Turnable,
    second: Turnable,
    count: int,
    ranges: Sequence[tuple[int, int]],
    overlap: tuple[float, float] = (0.5, 0.85),
    memory: int = 256_000_000,
    relative: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> list[Nearest]:
    """Of each range of turns, columns from the first to before the last, the `count` nearest of B to each of A, each of
    them at its best turn; overlaps, errors and `relative` as of `best_turns`. progress(done, total): of A."""
    require_alike(first, second)
    _require_interval(overlap)
    A, B = len(first), len(second)
    count = min(count, B)
    if count < 1:
        raise ParameterError(f"count = {count}; one or more of {B} partners are wanted.")
    found = [Nearest(np.full((A, count), -1), np.zeros((A, count), int), np.full((A, count), np.inf)) for _ in ranges]
    pairs = _Pairs(first, second, memory, overlap, relative=relative)
    for a in pairs.blocks(A):
        both = _both(pairs.first.VD[a])
        least = np.full((len(ranges), a.stop - a.start, B), np.inf, first.dtype)
        turn = np.zeros(least.shape, int)
        for b in pairs.blocks(B):
            terms = pairs.terms(a, b)
            d = pairs.distances(both, b, terms)
            for k, ends in enumerate(ranges):
                some = slice(*np.searchsorted(terms.planes, ends))
                if len(planes := terms.planes[some]):
                    best = d[some].argmin(axis=0)
                    least[k, :, b] = np.take_along_axis(d[some], best[None], axis=0)[0]
                    turn[k, :, b] = planes[best]
        order = np.argpartition(least, count - 1, axis=2)[..., :count]
        order = np.take_along_axis(order, np.take_along_axis(least, order, axis=2).argsort(axis=2), axis=2)
        for k, nearest in enumerate(found):
            nearest.distance[a] = np.take_along_axis(least[k], order[k], axis=1)
            nearest.turn[a] = np.take_along_axis(turn[k], order[k], axis=1)
            nearest.second[a] = np.where(np.isfinite(nearest.distance[a]), order[k], -1)
        if progress is not None:
            progress(a.stop, A)
    return found


def turned_columns(columns: int, turn: np.ndarray) -> np.ndarray:
    """(n, columns): where each column of a table turned by `turn` (n,) columns comes from, as numpy.roll has it."""
    return np.asarray((np.arange(columns) - turn[:, None]) % columns)


def _require_interval(overlap: tuple[float, float]) -> None:
    low, high = overlap
    if not 0 <= low <= high <= 1:
        raise ParameterError(f"overlap = ({low:g}, {high:g}); an interval within [0, 1] is wanted.")


class _Pairs:
    """All pairs of two `Turnable`, in blocks that fit the cache and `memory`; at turns with overlaps within `bounds`,
    which `widened` opens to turns whose neighbours lie beyond them."""

    def __init__(
        self,
        first: Turnable,
        second: Turnable,
        memory: int,
        bounds: tuple[float, float] = (0.0, 1.0),
        widened: bool = False,
        relative: bool = False,
    ) -> None:
        self.first, self.second, self.bounds, self.widened = first.spectra, second.spectra, bounds, widened
        self.relative = relative
        number = first.dtype.itemsize
        self._pair = 16 * number * first.columns  # transforms, their products, and what W alone tells at its most
        self._table = 5 * number * first.D[0].size if len(first) else 0
        line = number * len(second)
        side = _side(self.first.VD.shape[-1])
        while side and side * (side * self._pair + 2 * self._table + 2 * line) > memory:
            side //= 2
        if not side or 41 * (self._pair + self._table) > memory:
            raise MemoryLimitError(
                f"memory = {memory:,} bytes; {41 * (self._pair + self._table) + 2 * line:,} at least are needed."
            )
        self.side, self._memory = side, memory
        A, B, U, V = len(first), len(second), len(first.V), len(second.V)
        few = A * V + U * B + U * V
        self._whole = None
        if few * _FEW <= A * B and few * self._pair <= memory // 4:
            self._whole = _terms(self.first, self.second, bounds, widened)

    def blocks(self, count: int) -> list[slice]:
        """`count` in even parts of at most `side`: small ones cost more a pair."""
        ends = np.linspace(0, count, -(-count // self.side) + 1).astype(int)
        return [slice(int(low), int(high)) for low, high in itertools.pairwise(ends)]

    def distances(self, both: np.ndarray, b: Any, terms: _Terms) -> np.ndarray:
        """(planes, a, b) of slices; (planes, n, 1, m) of indices (n, 1) and (n, m). `terms` are theirs, `both` made of
        the first's."""
        turns = _inverse(self.first.columns, self.first.area.dtype)[terms.planes]
        d = _turned(both, self.second.VD[b], turns)
        d *= terms.i
        d *= terms.j
        squares = terms.p + terms.r
        d += squares
        if self.relative:
            d /= np.where((squares > 0) & np.isfinite(squares), squares, 1)
        np.maximum(d, 0, out=d)  # what rounding leaves of equal ones
        return d

    def terms(self, a: Any, b: Any) -> _Terms:
        """Of slices, or of indices (n, 1) and (n, m)."""
        if self._whole is None:
            x, y = self.first.part(a), self.second.part(b)
            return _terms(x, y, self.bounds, self.widened).spread(x.which, y.which)
        if isinstance(a, slice):
            a, b = np.arange(a.start, a.stop)[:, None], np.arange(b.start, b.stop)
        else:
            a, b = a[..., None], b[:, None]
        one = np.zeros((1,) * a.ndim, int)
        of_a = one if self.first.which is None else self.first.which[a]
        of_b = one if self.second.which is None else self.second.which[b]
        t = self._whole
        return _Terms(
            t.planes, t.p[:, a, of_b], t.i[:, a, of_b], t.r[:, of_a, b], t.j[:, of_a, b], t.overlap[:, of_a, of_b]
        )

    def least(self, a: slice) -> np.ndarray:
        """The least distance over turns (a, B)."""
        least = np.full((a.stop - a.start, len(self.second.VD)), np.inf, self.first.area.dtype)
        both = _both(self.first.VD[a])
        for b in self.blocks(least.shape[1]):
            least[:, b] = self.distances(both, b, self.terms(a, b)).min(axis=0, initial=np.inf)
        return least

    def write_best(self, rows: np.ndarray, partners: np.ndarray, seen: np.ndarray, best: Best) -> None:
        """Into `best` at `rows` (n,) the nearest of `partners` (n, keep), where they are `seen`."""
        keep = partners.shape[1]
        step = max(1, self._memory // (2 * (keep + 1) * (self._pair + self._table)))
        for low in range(0, len(rows), min(step, self.side)):
            some = slice(low, low + min(step, self.side))
            a, b = rows[some, None], partners[some]
            terms = self.terms(a, b)
            d = self.distances(_both(self.first.VD[a]), b, terms)[:, :, 0]
            d[:, ~seen[some]] = np.inf
            if not d.size:
                continue
            d = np.moveaxis(d, 0, 1).reshape(len(a), -1)
            at = d.argmin(axis=1)
            each = np.arange(len(a))
            told = np.isfinite(d[each, at])
            each, at = each[told], at[told]
            plane, chosen = np.divmod(at, keep)
            row, turn = a[each, 0], terms.planes[plane]
            best.second[row], best.turn[row] = b[each, chosen], turn
            best.distance[row] = d[each, at]
            overlap = np.broadcast_to(terms.overlap[:, ..., 0, :], (len(terms.overlap), len(a), keep))
            best.overlap[row] = overlap[turn, each, chosen]


@dataclasses.dataclass(frozen=True, eq=False)
class _Terms:
    """What a distance has beside V D * V D, at the turns `planes`: it is p + r + i j (V D * V D), with p and i
    (planes, a, U of b), r and j (planes, U of a, b), and `overlap` (columns, U of a, U of b)."""

    planes: np.ndarray
    p: np.ndarray
    i: np.ndarray
    r: np.ndarray
    j: np.ndarray
    overlap: np.ndarray

    def spread(self, first: np.ndarray | None, second: np.ndarray | None) -> _Terms:
        """With a and b for each U."""
        p, i, r, j, overlap = self.p, self.i, self.r, self.j, self.overlap
        if second is not None:
            p, i, overlap = p[..., second], i[..., second], overlap[..., second]
        if first is not None:
            r, j, overlap = r[..., first, :], j[..., first, :], overlap[..., first, :]
        return _Terms(self.planes, p, i, r, j, overlap)


def _terms(x: Spectra, y: Spectra, bounds: tuple[float, float], widened: bool) -> _Terms:
    dtype = x.area.dtype
    least, rounding = _LEAST[dtype], _ROUNDING[dtype]
    inverse = _inverse(x.columns, dtype)
    overlap = np.clip(_correlations(x.M, y.M, inverse) / y.area[..., None, :], 0, 1)
    lowest = highest = overlap
    if widened:
        beside = np.stack((overlap, np.roll(overlap, 1, axis=0), np.roll(overlap, -1, axis=0)))
        lowest, highest = beside.min(axis=0), beside.max(axis=0)
    T = _correlations(x.V, y.V, inverse)
    told = (least < T) & (highest >= bounds[0] - rounding) & (lowest <= bounds[1] + rounding)
    planes = np.flatnonzero(told.any(axis=tuple(range(1, told.ndim))))
    T = np.where(told, T, 0)[planes]
    inverse = inverse[planes]

    def parted(s: np.ndarray, square: np.ndarray, T: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """1/s and square / (s^2 T), 0 and infinite where nothing is told."""
        good = (s > least) & (T > 0)
        inverse = np.divide(1, s, out=np.zeros_like(s), where=good)
        return inverse, np.divide(square * inverse**2, T, out=np.full_like(s, np.inf), where=good)

    T_a = T if x.which is None else T[..., x.which, :]
    T_b = T if y.which is None else T[..., y.which]
    i, p = parted(_correlations(x.MD, y.M, inverse), _correlations(x.VDD, y.V, inverse), T_a)
    j, r = parted(_correlations(x.M, y.MD, inverse), _correlations(x.V, y.VDD, inverse), T_b)
    np.divide(-2 * i, T_a, out=i, where=i > 0)
    return _Terms(planes, p, i, r, j, overlap)


def _side(rows: int) -> int:
    """As many by as many pairs make a block."""
    return max(8, min(96, math.isqrt(_PRODUCT // (4 * rows))))


def _correlations(x: np.ndarray, y: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """(turns, ..., n, m), summed over rows, from transforms (..., n, orders, rows) and (..., m, orders, rows); `turns`
    are `_inverse`'s rows."""
    side = _side(x.shape[-1])
    if x.shape[-3] <= side and y.shape[-3] <= side:
        return _turned(_both(x), y, turns)
    batch = np.broadcast_shapes(x.shape[:-3], y.shape[:-3])
    found = np.empty((len(turns), *batch, x.shape[-3], y.shape[-3]), turns.dtype)
    for a in range(0, x.shape[-3], side):
        both = _both(x[..., a : a + side, :, :])
        for b in range(0, y.shape[-3], side):
            found[..., a : a + side, b : b + side] = _turned(both, y[..., b : b + side, :, :], turns)
    return found


def _both(x: np.ndarray) -> np.ndarray:
    """(..., orders, 2 n, 2 rows) of x and -i x: their real products with y are the parts of x conj(y)."""
    both = np.stack((x, -1j * x), axis=-4).view(x.real.dtype)
    both = np.moveaxis(both, -2, -4)
    return both.reshape(*both.shape[:-3], -1, both.shape[-1])


def _turned(both: np.ndarray, y: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """The same, from `_both` of x."""
    products = both @ np.moveaxis(y.view(turns.dtype), -3, -1)
    m = products.shape[-1]
    products = products.reshape(*products.shape[:-3], -1, products.shape[-2] // 2, m)
    products = np.moveaxis(products, -2, -3)  # for each n, the two parts of all orders by m
    parts = products.shape[-2]
    sums = np.empty((*products.shape[:-2], len(turns), m), turns.dtype)
    step = max(1, _PRODUCT // max(1, parts * m))
    for low in range(0, len(turns), step):
        np.matmul(turns[low : low + step], products, out=sums[..., low : low + step, :])
    return np.moveaxis(sums, -2, 0)


@functools.lru_cache(maxsize=8)
def _inverse(columns: int, dtype: np.dtype) -> np.ndarray:
    """What makes values at turns (columns,) of the real and imaginary parts of each order in turn: as few of its rows
    as are wanted cost less than a fast transform."""
    order = np.arange(columns // 2 + 1)
    angle = 2 * np.pi / columns * (np.arange(columns)[:, None] * order % columns)
    both = np.where((order == 0) | (2 * order == columns), 1, 2)[:, None] / columns
    parts = both * np.stack((np.cos(angle), -np.sin(angle)), axis=-1)
    inverse: np.ndarray = frozen(parts.reshape(columns, -1), dtype)
    return inverse
