"""Distributions of facets made whole from others like them, turned about the normal: the mean of many (beyond MS 5.2).

    D(h) = sum_b q_b W_b(h) s_b D_b(h) / sum_b q_b W_b(h)          where a distribution has no data of its own
    q_b = (d_0 / (d_b + d_0/5))^3                                   d_b: MS 15, relative, to b at its best turn
    s_b = s_1/s_2 of MS 16: both have the same integral over their overlap

over the four nearest b at each twelfth of a turn, each compared with the data themselves; d_0 is the third least of the
d_b. MS grows a distribution by one partner after the other around the normal (`synthesis`): each merger compares with
what earlier ones brought, and what is found on the far side is one distribution's, and as far off as it is. Here all is
found by one comparison of each with each.

Where a distribution has data of its own, others tell of it too, and a third of them (`blended`) evens out what noise
and the space between lights leave. Not here: which distributions stand for all (`representatives`).
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from ..arrays import Array, to_numpy
from ..brdf.polar_grid import PolarGrid
from ..errors import ArrayError
from ..threads import processors
from .turnable import Turnable
from .turned import Nearest, nearest_turns, turned_columns

_RANGES = 12  # of turns
_CANDIDATES = 4  # of each range
_OVERLAP = (0.2, 1.0)  # part of a partner's domain that lies within the data
_FLOOR = 0.2  # of d_0
_POWER = 3
_OTHERS = 1 / 3  # of a distribution's own data
_OWN_DOMAINS = 1024  # distributions: more are compared over the domain that all have in common, in a tenth of the time,
_COMMON = 0.7  # where that is so much of what one has
_BLOCK = 64


@dataclasses.dataclass(frozen=True, eq=False)
class CompletedNDFs:
    """`tables` (n, rows, columns) of D, whole, of integral (n.h) D = 1; `known`, the same, where data tell of D, its
    own or others' (the rest is filled); `others`, the same, what others have where they tell, in the unit of `tables`,
    NaN elsewhere; `own` and `told` (n,), the parts of the integral that are its own data, and that are known."""

    tables: np.ndarray
    known: np.ndarray
    others: np.ndarray
    own: np.ndarray
    told: np.ndarray

    def blended(self, tables: np.ndarray, own: np.ndarray) -> np.ndarray:
        """Whole `tables`, with a third of what others tell where they have data of their `own` (n, rows, columns)."""
        both = own & np.isfinite(self.others)
        return np.where(both, (1 - _OTHERS) * tables + _OTHERS * self.others, tables)


def complete_ndfs(
    tables: Array,
    confidence: Array,
    grid: PolarGrid,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> CompletedNDFs:
    """`tables` (n, rows, columns) of D >= 0, known where the `confidence` W of all (rows, columns) or of each (n, rows,
    columns) is positive, made whole from one another. progress(done, total) hears of distributions, compared and made.

    Raises `ArrayError` where they do not fit, are negative, or not finite where known.
    """
    partial = Partial.of(tables, confidence, grid)
    n, own = len(partial.D), partial.known

    def hear(done: int) -> None:
        if progress is not None:
            progress(done, 2 * n)

    W = partial.W
    solid = grid.solid_angles[:, None]
    if n > _OWN_DOMAINS and np.sum(solid * own.all(axis=0)) > _COMMON * np.sum(solid * own.mean(axis=0)):
        W = np.where(own.all(axis=0), W.min(axis=0), 0)
    turnable = Turnable.of(partial.D, W, grid, np.float32)
    steps = list(itertools.pairwise(np.linspace(0, grid.columns, _RANGES + 1).astype(int)))
    near = nearest_turns(
        turnable, turnable, _CANDIDATES, steps, _OVERLAP, relative=True, progress=lambda done, _: hear(done)
    )
    partners = Nearest(*(np.concatenate([getattr(x, name) for x in near], axis=1) for name in _NAMES))
    others = np.empty_like(partial.D)
    blocks = [np.arange(low, min(low + _BLOCK, n)) for low in range(0, n, _BLOCK)]
    with ThreadPoolExecutor(processors() if threads is None else threads) as pool:
        for some, found in zip(blocks, pool.map(lambda at: _mean(partial, partners, at), blocks), strict=True):
            others[some] = found
            hear(n + int(some[-1]) + 1)
    return finished(np.where(own, partial.D, others), own, others, grid)


_NAMES = [field.name for field in dataclasses.fields(Nearest)]


@dataclasses.dataclass(frozen=True, eq=False)
class Partial:
    """Partial distributions D, 0 outside their domains, and W, (n, rows, columns), float32, to be turned."""

    D: np.ndarray
    W: np.ndarray
    grid: PolarGrid

    @classmethod
    def of(cls, tables: Array, confidence: Array, grid: PolarGrid) -> Partial:
        """Raises `ArrayError` for shapes that are not the grid's."""
        D, W = to_numpy(tables), to_numpy(confidence)
        if D.ndim != 3 or D.shape[1:] != grid.shape:
            raise ArrayError(f"tables have shape {D.shape}; (n, {grid.rows}, {grid.columns}) is wanted.")
        if W.shape not in (D.shape, grid.shape):
            raise ArrayError(f"confidence has shape {W.shape}; {grid.shape} or {D.shape} is wanted.")
        W = np.broadcast_to(W, D.shape).astype(np.float32)
        return cls(np.where(W > 0, D, 0).astype(np.float32), W, grid)

    @property
    def known(self) -> np.ndarray:
        """Where data are (n, rows, columns)."""
        return np.asarray(self.W > 0)

    def turned(self, which: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """D and W of some (m,), each turned by so many columns."""
        columns = turned_columns(self.grid.columns, turn)[:, None]
        place = which[:, None, None], np.arange(self.grid.rows)[:, None], columns
        return self.D[place], self.W[place]

    def scale(self, D: np.ndarray, W: np.ndarray, D2: np.ndarray, W2: np.ndarray) -> np.ndarray:
        """s1/s2 of MS 16 (m, 1, 1): what brings D2 to the integral of D over their overlap; 0 where D2 has none."""
        both = self.grid.solid_angles[:, None].astype(np.float32) * ((W > 0) & (W2 > 0))
        s1, s2 = (np.sum(d * both, axis=(1, 2)) for d in (D, D2))
        return np.asarray(np.divide(s1, s2, out=np.zeros_like(s1), where=s2 > 0)[:, None, None])


def finished(D: np.ndarray, own: np.ndarray, others: np.ndarray, grid: PolarGrid) -> CompletedNDFs:
    """What is told, NaN where nothing tells, filled and normalised."""
    known = np.isfinite(D)
    D = filled(np.where(known, D, 0), known)
    mass = grid.projected[:, None]
    D[np.sum(D * mass, axis=(1, 2)) == 0] = 1  # of nothing that shines all facets are alike
    sums = np.sum(D * mass, axis=(1, 2))
    its_own, told = (np.sum(np.where(where, D, 0) * mass, axis=(1, 2)) / sums for where in (own, known))
    unit = (1 / sums).astype(np.float32)[:, None, None]
    return CompletedNDFs((D * unit).astype(np.float32), known, others * unit, its_own, told)


def filled(D: np.ndarray, known: np.ndarray) -> np.ndarray:
    """`D` (n, rows, columns) filled where it is not `known` (rows, columns), or (n, rows, columns): by the turn of pi,
    else by the mean of the ring, and beyond the outermost ring by the ring itself."""
    columns = D.shape[2]
    known = np.broadcast_to(known, D.shape)
    turned, seen = (np.roll(x, columns // 2, axis=2) for x in (D, known))
    D = np.where(known, D, np.where(seen, turned, 0))
    there = known | seen
    number = there.sum(axis=2)
    ring = D.sum(axis=2) / np.maximum(number, 1)
    D = np.where(there, D, ring[..., None])
    for r in range(1, D.shape[1]):
        empty = number[:, r] == 0
        D[empty, r] = D[empty, r - 1]
    return D


def _mean(partial: Partial, near: Nearest, some: np.ndarray) -> np.ndarray:
    """What others tell of those numbered `some` (m,), (m, rows, columns), NaN where none does."""
    D, W = partial.D[some], partial.W[some]
    distance, second = near.distance[some], near.second[some]
    # A distribution tells nothing of itself, as it stands.
    distance = np.where((second == some[:, None]) & (near.turn[some] == 0), np.inf, distance)
    usual = np.sort(distance, axis=1)[:, min(2, distance.shape[1] - 1), None]
    usual = np.where(np.isfinite(usual) & (usual > 0), usual, 1e-12)
    q = (usual / (distance + _FLOOR * usual)) ** _POWER
    sums, weights = np.zeros((2, *D.shape), np.float32)
    for k in range(q.shape[1]):
        D2, W2 = partial.turned(second[:, k], near.turn[some, k])
        scale = partial.scale(D, W, D2, W2)
        weight = np.where(scale > 0, q[:, k, None, None], 0).astype(np.float32) * W2
        sums += weight * scale * D2
        weights += weight
    return np.where(weights > 0, sums / np.where(weights > 0, weights, 1), np.float32(np.nan))
