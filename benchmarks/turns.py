"""Distances of partial distributions of facets at all turns (MS 15), beside the direct formula: CPU time of one thread.

    OMP_NUM_THREADS=1 python benchmarks/turns.py [distributions] [repetitions]

400 cloths turned at random on 32 x 96 knots, each compared with each at 96 turns; `best` keeps the nearest that covers
50 to 85 %, `coarse` looks at means over 4 x 4 knots first and at the best 40 then; `own` has a domain of each on one
side, as synthesis does once it has begun. The transforms of the second side are made before, those of the first within.
`direct` is the formula by NumPy, one pair and turn at a time, over some pairs; `by turns` is what BLAS can do for it:
one product of matrices over the knots for each turn that `best` may take, over a part of the pairs. All take turns, so
that a busy machine slows all of them; medians are printed, in microseconds a pair, all turns in.
Errors are over the mean of (D/s)^2 over the overlap.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys

import numpy as np
from sphere import Work, times

import gonio as gn
from gonio.brdf.ndf_table import TabulatedNDF
from gonio.brdf.polar_grid import PolarGrid
from gonio.fitting.facet_domain import Domain
from gonio.fitting.turnable import Turnable
from gonio.fitting.turned import Best, best_turns, turned_distances

GRID = PolarGrid(32, 96)
DIRECT = 12  # pairs that the direct formula gets
SOME = 100  # of the first side that the formula by turns gets


def cloths(rng: np.random.Generator, n: int) -> np.ndarray:
    """(n, rows, columns): threads of two directions, of any strengths and turns, with 3 % of noise."""
    tables = np.empty((n, *GRID.shape))
    weft = TabulatedNDF.of(gn.Beckmann(0.15, 0.15), GRID.shape).values
    for table in tables:
        width = rng.uniform(0.15, 0.4)
        warp = TabulatedNDF.of(gn.Beckmann(width * rng.uniform(1, 2), width), GRID.shape).values
        turned = TabulatedNDF(warp + rng.uniform(0, 0.3) * weft).turned(rng.uniform(0, 2 * np.pi))
        table[:] = turned.values * np.maximum(1 + 0.03 * rng.normal(size=GRID.shape), 0)
    return tables


def direct(D1: np.ndarray, W1: np.ndarray, D2: np.ndarray, W2: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances (columns,) and the mean of (D1/s1)^2 over the overlap."""
    found, squares = np.empty(GRID.columns), np.empty(GRID.columns)
    w = GRID.solid_angles[:, None]
    for turn in range(GRID.columns):
        D, W = np.roll(D2, turn, axis=1), np.roll(W2, turn, axis=1)
        weight = np.sqrt(W1 * W) * w
        inside = w * (weight > 0)
        a, b = D1 / np.sum(D1 * inside), D / np.sum(D * inside)
        below = weight.sum()
        found[turn], squares[turn] = np.sum(weight * (a - b) ** 2) / below, np.sum(weight * a * a) / below
    return found, squares


def by_turns(D: np.ndarray, W: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """The least distance (SOME, n) of those at `turns`, where W is of all."""
    w = GRID.solid_angles[:, None].astype(D.dtype)
    least = np.full((min(SOME, len(D)), len(D)), np.inf, D.dtype)
    for turn in turns:
        weight = np.sqrt(W * np.roll(W, turn, axis=1)) * w
        inside = weight > 0
        w_O, weight = np.broadcast_to(w, W.shape)[inside], weight[inside]
        a, b = D[:SOME, inside], np.roll(D, turn, axis=2)[:, inside]
        a, b = a / (a @ w_O)[:, None], b / (b @ w_O)[:, None]
        weighted = a * weight
        d = weighted @ b.T
        d *= -2
        d += np.einsum("ak,ak->a", weighted, a)[:, None]
        d += (b * b) @ weight
        np.minimum(least, d / weight.sum(), out=least)
    return least


def main() -> None:
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 400
    repetitions = int(sys.argv[2]) if len(sys.argv) > 2 else 5
    rng = np.random.default_rng(0)
    D = cloths(rng, n)
    W = Domain(GRID, gn.from_spherical(np.radians(60), 0.3)).confidence
    # Domains of all sizes, as partners widen them.
    own = np.stack([np.maximum(W, np.roll(W, k, axis=1)) * (1 + 1e-9 * j) for j, k in enumerate(np.arange(n) % 24)])
    others = ~np.eye(n, dtype=bool)
    found: dict[str, Best] = {}

    def best(name: str, first: np.ndarray, second: Turnable, coarse: int) -> Work:
        def call() -> None:
            made = Turnable.of(D, first, GRID, second.dtype)
            found[name] = best_turns(made, second, allowed=others, coarse=coarse)

        return call

    pairs = rng.integers(0, n, (DIRECT, 2))
    exact = []

    def directly() -> None:
        exact[:] = [direct(D[i], W, D[j], W) for i, j in pairs]

    _, overlaps = turned_distances(*(Turnable.of(D[:1], W, GRID),) * 2)
    turns = np.flatnonzero((overlaps[0, 0] >= 0.5) & (overlaps[0, 0] <= 0.85))
    works: dict[str, Work] = {"direct": directly}
    for precision in ("float64", "float32"):
        works[f"by turns {precision}"] = lambda p=precision: by_turns(D.astype(p), W.astype(p), turns)
    for precision in ("float64", "float32"):
        second = Turnable.of(D, W, GRID, precision)
        second.spectra  # noqa: B018  (made once, for all that come)
        if n <= 400:
            works[f"all turns {precision}"] = lambda second=second: turned_distances(second, second)
        works[f"best {precision}"] = best(f"best {precision}", W, second, 1)
        works[f"coarse {precision}"] = best(f"coarse {precision}", W, second, 4)
        if n <= 400:
            works[f"own {precision}"] = best(f"own {precision}", own, second, 1)
    taken = times(works, repetitions)
    print(f"{n} x {n} pairs, {GRID.rows} x {GRID.columns} knots, {repetitions} rounds")
    count = {"direct": DIRECT, "by turns float64": min(SOME, n) * n, "by turns float32": min(SOME, n) * n}
    for name, ms in taken.items():
        print(f"  {name:<20} {1e3 * ms / count.get(name, n * n):9.2f} us a pair")
    for precision in ("float64", "float32"):
        some = [Turnable.of(D[index], W, GRID, precision) for index in pairs.T]
        ours = np.diagonal(turned_distances(*some)[0]).T
        errors = [(np.abs(a - d) / m).max() for a, (d, m) in zip(ours, exact, strict=True)]
        a, b, c = found["best float64"], found[f"best {precision}"], found[f"coarse {precision}"]
        same = np.mean((c.second == a.second) & (c.turn == a.turn))
        told = a.second >= 0
        worse = c.distance[told] / a.distance[told]
        print(
            f"  {precision}: error {max(errors):.1e}; the same pair and turn as best float64: best "
            f"{100 * np.mean((b.second == a.second) & (b.turn == a.turn)):.1f} %, coarse {100 * same:.1f} % "
            f"(distances {worse.mean():.3f} times as large, {worse.max():.2f} at the worst)"
        )


if __name__ == "__main__":
    main()
