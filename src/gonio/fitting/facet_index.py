"""The refractive index that makes facets alike which were seen at other angles (MS 19, 20).

    D(h; eta) = D(h; eta_0) F(h.o; eta_0)/F(1; eta_0) / (F(h.o; eta)/F(1; eta))
    eta = argmin of the sum over partners b of  | D_a(eta)/s_a - D_b(eta)/s_b |^2 / (|D_a/s_a|^2 + |D_b/s_b|^2)

over the overlaps of a with its nearest partners, turned: there one facet is seen at two angles to the eye, and F tells
them apart. MS compares F with what is left of a texel's own data when D is divided out; but that D was made of those
data, and answers to any eta. That of cloth of 1.38 to 1.58 comes back to .03, rms: `microfacet_synthesis.py` of the
reproductions.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array, to_numpy
from ..brdf.fresnel import dielectric
from ..brdf.polar_grid import PolarGrid
from .turnable import Turnable
from .turned import Best, best_turns, turned_columns

LEAST, MOST = 1.15, 2.5  # clear dielectrics, and what shines as they do
_CANDIDATES = np.linspace(LEAST, MOST, 16)
_OVERLAPS = ((0.4, 0.5), (0.5, 0.6), (0.6, 0.7), (0.7, 0.8))  # a partner of each
_ROUNDS = 2
_BLOCK = 256
_STEP = 2  # of columns: distances change smoothly with eta


def facing(eta: Array, cosine: np.ndarray) -> np.ndarray:
    """F(cosine; eta) / F(1; eta), broadcast."""
    index = to_numpy(eta)
    return np.asarray(dielectric(np, index, cosine) / ((index - 1) / (index + 1)) ** 2)


def estimate_index(
    tables: np.ndarray, confidence: np.ndarray, cosines: np.ndarray, grid: PolarGrid, start: float = 1.5
) -> np.ndarray:
    """eta (n,), in [1.15, 2.5], of partial distributions `tables` (n, rows, columns) that were fitted with `start`;
    which it is where nothing tells: seen from above, say, F hardly changes.

    confidence: W >= 0, 0 outside their domains, and cosines: h.o, both (n, rows, columns). Where a distribution has no
    partner, that of all others.
    """
    eta = np.full(len(tables), start)
    for _ in range(_ROUNDS):
        scale = facing(start, cosines) / facing(eta[:, None, None], cosines)
        partial = Turnable.of(np.where(confidence > 0, tables * scale, 0), confidence, grid, np.float32)
        off, told = np.zeros((len(_CANDIDATES), len(tables))), np.zeros(len(tables))
        for overlap in _OVERLAPS:
            best = best_turns(partial, partial, overlap, relative=True)
            told += best.second >= 0
            for low in range(0, len(tables), _BLOCK):
                some = np.arange(low, min(low + _BLOCK, len(tables)))
                off[:, some] += _apart(
                    tables, confidence, cosines, grid, start, best, some[best.second[some] >= 0], some
                )
        eta = _least(np.where(told > 0, off, off.sum(axis=1, keepdims=True)), start)
    return eta


def _apart(
    tables: np.ndarray,
    confidence: np.ndarray,
    cosines: np.ndarray,
    grid: PolarGrid,
    start: float,
    best: Best,
    at: np.ndarray,
    some: np.ndarray,
) -> np.ndarray:
    """(candidates, some): how far those `at` are from their partners with each index; 0 for others."""
    off = np.zeros((len(_CANDIDATES), len(some)))
    if not len(at):
        return off
    columns = turned_columns(grid.columns, best.turn[at])[:, None, ::_STEP]
    place = best.second[at, None, None], np.arange(grid.rows)[:, None], columns
    own = at, slice(None), slice(None, None, _STEP)
    W = np.sqrt(confidence[own] * confidence[place]).astype(np.float32)
    weight = W * grid.solid_angles[:, None].astype(np.float32)
    inside = (W > 0) * grid.solid_angles[:, None].astype(np.float32)
    c = [x.astype(np.float32) for x in (cosines[own], cosines[place])]
    D = [
        np.where(W > 0, x, 0).astype(np.float32) * facing(start, y)
        for x, y in zip((tables[own], tables[place]), c, strict=True)
    ]
    for k, eta in enumerate(_CANDIDATES):
        a, b = (x / facing(np.float32(eta), y) for x, y in zip(D, c, strict=True))
        for x in (a, b):
            total = np.sum(x * inside, axis=(1, 2), keepdims=True)
            x /= np.where(total > 0, total, 1)
        squares = np.sum(weight * (a * a + b * b), axis=(1, 2))
        off[k, at - some[0]] = np.sum(weight * (a - b) ** 2, axis=(1, 2)) / np.where(squares > 0, squares, 1)
    return off


def _least(off: np.ndarray, start: float) -> np.ndarray:
    """Where a parabola through the least of each column and its neighbours is least; `start` where it is at an end."""
    k = off.argmin(axis=0)
    inside = (k > 0) & (k < len(_CANDIDATES) - 1)
    k = np.clip(k, 1, len(_CANDIDATES) - 2)
    each = np.arange(off.shape[1])
    before, least, after = off[k - 1, each], off[k, each], off[k + 1, each]
    bend = before - 2 * least + after
    step = 0.5 * (before - after) / np.where(bend > 0, bend, np.inf)
    found = _CANDIDATES[k] + np.clip(step, -1, 1) * (_CANDIDATES[1] - _CANDIDATES[0])
    return np.asarray(np.where(inside, found, start))
