"""Distributions of facets completed from one another, turned about the normal (MS 14-17).

    (x', phi') = argmin of dist(D_i, D' turned by phi')      over those that lie .5 to .85 within what D_i knows   MS 14
    s1, s2 = integrals of D_i and D' over the overlap
    D_i+1 = (W_i D_i + s1/s2 W' D') / (W_i + W'),    W_i+1 = max(W_i, W')                                      MS 16, 17

until D is known wherever any of them is known at some turn. A distribution's own data are kept where it has them: what
MS 16 would average into them is of others. The little that no turn tells is filled: by the turn of pi, else by the mean
of the ring, and beyond the outermost ring by the ring itself.

The search is exhaustive (`turned`), over all distributions and turns. Not here: which distributions stand for all
(`representatives`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from ..arrays import Array, require_finite, to_numpy
from ..brdf.polar_grid import PolarGrid
from ..errors import ArrayError, ParameterError
from .turnable import Turnable
from .turned import best_turns

_ENOUGH = 0.01  # of what could be known, unknown yet
_MERGERS = 12


@dataclasses.dataclass(frozen=True, eq=False)
class CompletedNDFs:
    """`tables` (n, rows, columns) of D, whole, of integral (n.h) D = 1; `known`, the same, where data tell of D, its own
    or others' (the rest is filled); `own` and `told` (n,), the parts of the integral that are its own data, and that
    are known; `partners` (mergers, n, 2): whom it was merged with and by how many columns that was turned, -1 where
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
    partial = Turnable.of(D, W, grid, np.float32)
    known, own = W.copy(), W > 0
    D = np.where(own, D, 0)
    # Columns do not matter at all turns: a ring is told of if any of them is, of any distribution.
    could = np.broadcast_to((W > 0).any(axis=(0, 2))[:, None], grid.shape)
    w = grid.solid_angles[:, None]
    partners = []
    for merger in range(_MERGERS):
        missing = np.sum(w * (could & ~(known > 0)), axis=(1, 2)) > _ENOUGH * np.sum(w * could)
        open_ = np.flatnonzero(missing)
        if not len(open_):
            break
        found = _searched(D[open_], known[open_], partial, grid, overlap, relative)
        merged = found[:, 0] >= 0
        if not merged.any():
            break
        step = np.full((n, 2), -1)
        step[open_] = found
        partners.append(step)
        at = open_[merged]
        _merge(D, known, at, step[at], tables=np.where(W > 0, to_numpy(tables), 0), W=W, own=own if keep_own else None, w=w)
        if progress is not None:
            progress(merger + 1, _MERGERS)
    mass = grid.projected[:, None]
    told = known > 0
    _fill(D, told, grid)
    total = np.sum(D * mass, axis=(1, 2))
    total = np.where(total > 0, total, 1)
    parts = (np.sum(np.where(where, D, 0) * mass, axis=(1, 2)) / total for where in (own, told))
    return CompletedNDFs(
        (D / total[:, None, None]).astype(np.float32), told, *parts, np.array(partners, int).reshape(-1, n, 2)
    )


def _checked(tables: Array, confidence: Array, grid: PolarGrid) -> tuple[np.ndarray, np.ndarray]:
    D, W = to_numpy(tables).astype(np.float64), to_numpy(confidence).astype(np.float64)
    if D.ndim != 3 or D.shape[1:] != grid.shape:
        raise ArrayError(f"tables have shape {D.shape}; (n, {grid.rows}, {grid.columns}) is wanted.")
    if W.shape not in (D.shape, grid.shape):
        raise ArrayError(f"confidence has shape {W.shape}; {grid.shape} or {D.shape} is wanted.")
    return D, np.broadcast_to(W, D.shape)


def _searched(D, W, partial, grid, overlap, relative) -> np.ndarray:
    """(n, 2): partner and turn, -1 where there is none; of those that extend most where none is within the overlap."""
    growing = Turnable.of(D, W, grid, np.float32)
    best = best_turns(growing, partial, overlap, relative=relative)
    found = np.stack((best.second, best.turn), axis=1)
    # Nearly whole, what is left is less than any partner's sixth.
    left = np.flatnonzero(best.second < 0)
    if len(left):
        last = Turnable.of(D[left], W[left], grid, np.float32)
        best = best_turns(last, partial, (overlap[0], 0.99), relative=relative)
        found[left] = np.stack((best.second, best.turn), axis=1)
    return found


def _merge(D, known, at, step, *, tables, W, own, w) -> None:
    columns = D.shape[2]
    turned = (np.arange(columns) - step[:, 1:]) % columns
    rows = np.arange(D.shape[1])
    D2 = tables[step[:, 0, None, None], rows[:, None], turned[:, None]]
    W2 = W[step[:, 0, None, None], rows[:, None], turned[:, None]]
    D1, W1 = D[at], known[at]
    both = (W1 > 0) & (W2 > 0)
    s1, s2 = (np.sum(np.where(both, d, 0) * w, axis=(1, 2)) for d in (D1, D2))
    scale = (s1 / np.where(s2 > 0, s2, 1))[:, None, None]
    sums = W1 + W2
    merged = (W1 * D1 + scale * W2 * D2) / np.where(sums > 0, sums, 1)
    D[at] = merged if own is None else np.where(own[at], D1, merged)
    known[at] = np.maximum(W1, W2)


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
