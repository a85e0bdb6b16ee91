"""Distributions of facets grown from one another, turned about the normal, as the paper has it (MS 14-17).

    (x', phi') = argmin of dist(D_i, D' turned by phi')      over those that lie .5 to .85 within what D_i knows   MS 14
    s1, s2 = integrals of D_i and D' over the overlap
    D_i+1 = (W_i D_i + s1/s2 W' D') / (W_i + W'),    W_i+1 = max(W_i, W')                                      MS 16, 17

until D is known wherever any of them is known at some turn. The search is exhaustive, over all distributions and turns
(`turned`), in the place of the paper's histograms, which find the same partner three times out of four. The mean of
many is nearer to the truth and quicker: `completion`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Array
from ..brdf.polar_grid import PolarGrid
from .completion import CompletedNDFs, Partial, finished
from .turnable import Turnable
from .turned import best_turns

_ENOUGH = 0.01  # of what could be known, unknown yet
_MERGERS = 16
_ADDS = 0.995  # of a partner's domain, at most, is known already


def grow_ndfs(
    tables: Array,
    confidence: Array,
    grid: PolarGrid,
    overlap: tuple[float, float] = (0.5, 0.85),
    progress: Callable[[int, int], None] | None = None,
) -> CompletedNDFs:
    """As `complete_ndfs`. overlap: the part of a partner's domain that lies within what is known already."""
    partial = Partial.of(tables, confidence, grid)
    D, known = partial.D.copy(), partial.W.copy()
    own = partial.known
    # Columns do not matter at all turns: a ring is told of if any of them is, of any distribution.
    could = np.broadcast_to(np.asarray(own.any(axis=(0, 2)))[:, None], grid.shape)
    w = grid.solid_angles[:, None]
    each = Turnable.of(partial.D, partial.W, grid, np.float32)
    left = np.arange(len(D))
    for merger in range(_MERGERS):
        missing = np.sum(w * (could & ~(known[left] > 0)), axis=(1, 2)) > _ENOUGH * np.sum(w * could)
        left = left[missing]
        if not len(left):
            break
        growing = Turnable.of(D[left], known[left], grid, np.float32)
        best = best_turns(growing, each, overlap)
        second, turn = best.second, best.turn
        # Nearly whole, what is left is less than any partner's sixth.
        if len(late := np.flatnonzero(second < 0)):
            last = best_turns(growing.part(late), each, (overlap[0], _ADDS))
            second[late], turn[late] = last.second, last.turn
        left, second, turn = (x[second >= 0] for x in (left, second, turn))
        D1, W1 = D[left], known[left]
        D2, W2 = partial.turned(second, turn)
        sums = W1 + W2
        D[left] = (W1 * D1 + partial.scale(D1, W1, D2, W2) * W2 * D2) / np.where(sums > 0, sums, 1)
        known[left] = np.maximum(W1, W2)
        if progress is not None:
            progress(merger + 1, _MERGERS)
    nothing = np.float32(np.nan)
    return finished(np.where(known > 0, D, nothing), own, np.full_like(D, nothing), grid)
