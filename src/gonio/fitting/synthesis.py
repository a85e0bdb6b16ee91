"""Distributions of facets completed from one another, turned about the normal (MS 14-17).

    (x', phi') = argmin of dist(D_i, D' turned by phi')      over those that lie .5 to .85 within what D_i knows   MS 14
    s1, s2 = integrals of D_i and D' over the overlap
    D_i+1 = (W_i D_i + s1/s2 W' D') / (W_i + W'),    W_i+1 = max(W_i, W')                                      MS 16, 17

until D is known wherever any of them is known at some turn. A distribution's own data are kept where it has them: what
MS 16 would average into them is of others. The little that no turn tells is filled: by the turn of pi, else by the mean
of the ring, and beyond the outermost ring by the ring itself.

The search is exhaustive, over all distributions and turns (`turned`), up to 1,024 of them. Beyond, each is compared
with all once, and then, as it grows, with those alone that were nearest at some turn. Not here: which distributions
stand for all (`representatives`).
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable

import numpy as np

from ..arrays import Array, to_numpy
from ..brdf.polar_grid import PolarGrid
from ..errors import ArrayError
from .turnable import Turnable
from .turned import best_turns, nearest_turns

_ENOUGH = 0.01  # of what could be known, unknown yet
_MERGERS = 16
_EXHAUSTIVE = 1024
_RANGES = 12  # of turns
_CANDIDATES = 4  # of each range
_LOW = 0.2  # of a domain within the other at the least, among candidates
_ADDS = 0.995  # of a partner's domain, at most, is known already


@dataclasses.dataclass(frozen=True, eq=False)
class CompletedNDFs:
    """`tables` (n, rows, columns) of D, whole, of integral (n.h) D = 1; `known`, the same, where data tell of D, its
    own or others' (the rest is filled); `own` and `told` (n,), the parts of the integral that are its own data, and
    that are known; `partners` (mergers, n, 2): whom it was merged with and by how many columns that was turned, -1 where
    none was."""

    tables: np.ndarray
    known: np.ndarray
    own: np.ndarray
    told: np.ndarray
    partners: np.ndarray


def complete_ndfs(
    tables: Array,
    confidence: Array,
    grid: PolarGrid,
    *,
    overlap: tuple[float, float] = (0.5, 0.85),
    relative: bool = True,
    keep_own: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> CompletedNDFs:
    """`tables` (n, rows, columns) of D >= 0, known where the `confidence` W of all (rows, columns) or of each (n, rows,
    columns) is positive, made whole from one another.

    overlap: the part of a partner's domain that lies within what is known already. relative: distances by `best_turns`,
    which are MS 15's where False. keep_own: False averages others into a distribution's own data, as MS 16 does.
    progress(done, total) hears of distributions times mergers.

    Raises `ArrayError` where they do not fit, are negative, or not finite where known.
    """
    D, W = _checked(tables, confidence, grid)
    n = len(D)
    own: np.ndarray = W > 0
    D = np.where(own, D, 0).astype(np.float32)
    partial = _Tables(D.copy(), W.astype(np.float32), grid)
    known = partial.W.copy()
    # Columns do not matter at all turns: a ring is told of if any of them is, of any distribution.
    could = np.broadcast_to(own.any(axis=(0, 2))[:, None], grid.shape)
    w = grid.solid_angles[:, None]
    candidates = None
    total = _MERGERS * n
    if n > _EXHAUSTIVE:
        total += 8 * n

        def hear(done: int, of: int) -> None:
            if progress is not None:
                progress(8 * done, total)

        common = Turnable.of(D, np.where(own.all(axis=0), W.min(axis=0), 0), grid, np.float32)
        steps = np.linspace(1, grid.columns, _RANGES + 1).astype(int)
        near = nearest_turns(
            common,
            common,
            _CANDIDATES,
            list(itertools.pairwise(steps)),
            (_LOW, _ADDS),
            relative=relative,
            progress=hear,
        )
        candidates = np.concatenate([x.second for x in near], axis=1)
    each = Turnable.of(partial.D, partial.W, grid, np.float32)
    partners: list[np.ndarray] = []
    open_ = np.arange(n)
    for merger in range(_MERGERS):
        missing = np.sum(w * (could & ~(known[open_] > 0)), axis=(1, 2)) > _ENOUGH * np.sum(w * could)
        open_ = open_[missing]
        if not len(open_):
            break
        few = None if candidates is None else candidates[open_]
        found = _nearest(Turnable.of(D[open_], known[open_], grid, np.float32), each, few, overlap, relative)
        told = found[:, 0] >= 0
        open_, found = open_[told], found[told]
        D[open_], known[open_] = partial.merged(D[open_], known[open_], found, own[open_] if keep_own else None)
        step = np.full((n, 2), -1)
        step[open_] = found
        partners.append(step)
        if progress is not None:
            progress(total - (_MERGERS - merger - 1) * n, total)
    mass = grid.projected[:, None]
    data = known > 0
    _fill(D, data, grid)
    D[np.sum(D * mass, axis=(1, 2)) == 0] = 1  # of nothing that shines all facets are alike
    sums = np.sum(D * mass, axis=(1, 2))
    its_own, told = (np.sum(np.where(where, D, 0) * mass, axis=(1, 2)) / sums for where in (own, data))
    return CompletedNDFs(
        (D / sums[:, None, None]).astype(np.float32), data, its_own, told, np.array(partners, int).reshape(-1, n, 2)
    )


def _checked(tables: Array, confidence: Array, grid: PolarGrid) -> tuple[np.ndarray, np.ndarray]:
    D, W = to_numpy(tables).astype(np.float64), to_numpy(confidence).astype(np.float64)
    if D.ndim != 3 or D.shape[1:] != grid.shape:
        raise ArrayError(f"tables have shape {D.shape}; (n, {grid.rows}, {grid.columns}) is wanted.")
    if W.shape not in (D.shape, grid.shape):
        raise ArrayError(f"confidence has shape {W.shape}; {grid.shape} or {D.shape} is wanted.")
    return D, np.broadcast_to(W, D.shape)


@dataclasses.dataclass(frozen=True, eq=False)
class _Tables:
    """Partial distributions D, 0 outside their domains, and W, (n, rows, columns), to be turned."""

    D: np.ndarray
    W: np.ndarray
    grid: PolarGrid

    def turned(self, which: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """D and W of some (m,), each turned by so many columns."""
        columns = (np.arange(self.grid.columns) - turn[:, None]) % self.grid.columns
        place = which[:, None, None], np.arange(self.grid.rows)[:, None], columns[:, None]
        return self.D[place], self.W[place]

    def merged(
        self, D: np.ndarray, W: np.ndarray, step: np.ndarray, own: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """D and W (MS 16, 17) with partners and turns `step` (m, 2); as they were where they are `own`."""
        D2, W2 = self.turned(step[:, 0], step[:, 1])
        both = self.grid.solid_angles[:, None] * ((W > 0) & (W2 > 0))
        s1, s2 = (np.sum(d * both, axis=(1, 2)) for d in (D, D2))
        scale = (s1 / np.where(s2 > 0, s2, 1)).astype(np.float32)[:, None, None]
        sums = W + W2
        merged = (W * D + scale * W2 * D2) / np.where(sums > 0, sums, 1)
        return merged if own is None else np.where(own, D, merged), np.maximum(W, W2)


def _nearest(
    growing: Turnable, each: Turnable, candidates: np.ndarray | None, overlap: tuple[float, float], relative: bool
) -> np.ndarray:
    """(m, 2): the best of all, or of the `candidates` (m, count), and its turn; -1 where there is none. Where none lies
    within the `overlap`, as when little is unknown, those count that add the least bit."""
    best = best_turns(growing, each, overlap, relative=relative, partners=candidates)
    found = np.stack((best.second, best.turn), axis=1)
    left = np.flatnonzero(best.second < 0)
    if len(left):
        few = None if candidates is None else candidates[left]
        last = best_turns(growing.part(left), each, (overlap[0], _ADDS), relative=relative, partners=few)
        found[left] = np.stack((last.second, last.turn), axis=1)
    return found


def _fill(D: np.ndarray, told: np.ndarray, grid: PolarGrid) -> None:
    """What is not told, in place."""
    columns = grid.columns
    turned, seen = (np.roll(x, columns // 2, axis=2) for x in (D, told))
    D[:] = np.where(told, D, np.where(seen, turned, 0))
    known = told | seen
    number = known.sum(axis=2)
    ring = D.sum(axis=2) / np.maximum(number, 1)
    D[:] = np.where(known, D, ring[..., None])
    for r in range(1, grid.rows):
        empty = number[:, r] == 0
        D[empty, r] = D[empty, r - 1]
