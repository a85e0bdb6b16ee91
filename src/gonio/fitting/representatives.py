"""A few texels that stand for all: clusters of what was found at each, and mixtures of the nearest (MS 5.3, 18).

    a = (d - mean) V                                 d: weighted values of a texel; V: the principal directions
    k-means of a (Lloyd 1982); of each cluster the texel nearest to its mean stands for it
    d ~ sum_j w_j d_j,   sum_j w_j = 1               over the nearest 16, least squares (MS 18)

Weights are solved for about the texel itself: w ~ G^-1 1, G the products of the d_j - d. MS cuts the neighbours by
five times the least distance between representatives; here a ridge on G, of its trace, cuts by rank. MS clusters 1 % of
the texels.

Not here: which distance: the square root of what a knot counts, as MS 15's W and solid angle, multiplies the values.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_array

from ..errors import ParameterError

_COMPONENTS = 48
_SAMPLE = 4096  # texels that the principal directions are of
_BLOCK = 4096
_ROUNDS = 12
_STILL = 1e-3  # part of the texels that still change cluster
_NEIGHBOURS = 16
_RIDGE = 1e-3

# (first, last) -> values (last - first, K) of so many texels: an array, or what reads a store.
Values = Callable[[int, int], np.ndarray]


@dataclasses.dataclass(frozen=True, eq=False)
class Representatives:
    """`texels` (M,), ascending, that stand for all; of each texel `indices` (T, k) among them, nearest first, and
    `weights` (T, k) that sum to 1; `residual`, what mixtures leave of the values about their mean, relative, rms."""

    texels: np.ndarray
    indices: np.ndarray
    weights: np.ndarray
    residual: float


def choose_representatives(
    values: Values,
    count: int,
    most: int | None = None,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Representatives:
    """Representatives of `count` texels and their mixtures; `values(first, last)` are finite, (last - first, K).

    most: representatives, 1 % of the texels where None, 2 at least. Values are read twice, in blocks; memory is 200
    bytes a texel for what is kept of them, and those of the mixtures. progress(done, total): texels, in all passes.
    Raises `ParameterError` for a `most` that is no number from 1 to `count`.
    """
    most = max(2, math.ceil(count / 100)) if most is None else most
    if not 1 <= most <= count:
        raise ParameterError(f"most = {most}: from 1 to {count} texels can stand for {count}.")
    rng = np.random.default_rng(seed)
    passes = _ROUNDS + 2

    def hear(number: int, done: int) -> None:
        if progress is not None:
            progress(number * count + done, passes * count)

    a, energy = _projected(values, count, rng, lambda done: hear(0, done))
    mean = _clustered(a, most, rng, hear)
    texels = np.sort(np.unique(_nearest_members(a, mean)))
    indices, weights, left = _mixtures(a, a[texels], lambda done: hear(passes - 1, done))
    # What lies outside the principal directions is left in any case.
    outside = max(energy - float(np.sum(a.astype(np.float64) ** 2)), 0.0)
    residual = math.sqrt((left + outside) / energy) if energy > 0 else 0.0
    return Representatives(texels, indices, weights, residual)


def _blocks(count: int, size: int = _BLOCK) -> Iterator[slice]:
    for low in range(0, count, size):
        yield slice(low, min(low + size, count))


def _projected(
    values: Values, count: int, rng: np.random.Generator, hear: Callable[[int], None]
) -> tuple[np.ndarray, float]:
    """Coordinates (T, n), float32, in the principal directions of some texels, about their mean; and the sum of the
    squares of all values about it."""
    chosen = np.sort(rng.choice(count, min(_SAMPLE, count), replace=False))
    sample = np.concatenate([values(some.start, some.stop)[_of(chosen, some)] for some in _blocks(count)])
    mean = sample.mean(axis=0, dtype=np.float64)
    C = np.atleast_2d(np.cov(sample, rowvar=False, bias=True))
    # Numbers near the least there is take a processor seventy times as long: a little of the trace keeps them away.
    C[np.diag_indices_from(C)] += 1e-15 * max(np.trace(C), 1e-300)
    K = len(C)
    _, V = eigh(C, subset_by_index=[max(K - _COMPONENTS, 0), K - 1])
    V = V[:, ::-1].astype(np.float32)
    a, energy = np.empty((count, V.shape[1]), np.float32), 0.0
    for some in _blocks(count):
        off = (values(some.start, some.stop) - mean).astype(np.float32)
        a[some] = off @ V
        energy += float(np.sum(off.astype(np.float64) ** 2))
        hear(some.stop)
    return a, energy


def _of(chosen: np.ndarray, some: slice) -> np.ndarray:
    """The places within a block of those chosen (ascending) that lie in it."""
    low, high = np.searchsorted(chosen, (some.start, some.stop))
    return np.asarray(chosen[low:high] - some.start)


def _clustered(a: np.ndarray, most: int, rng: np.random.Generator, hear: Callable[[int, int], None]) -> np.ndarray:
    """Means (M, n) of clusters of `a` (T, n)."""
    mean = a[np.sort(rng.choice(len(a), most, replace=False))]
    label = np.full(len(a), -1)
    for number in range(_ROUNDS):
        sums, sizes, moved = np.zeros((most, a.shape[1])), np.zeros(most), 0
        far = np.empty(len(a), np.float32)
        for some in _blocks(len(a)):
            squares = _squares(a[some], mean)
            found = squares.argmin(axis=1)
            far[some] = squares[np.arange(len(found)), found]
            moved += int(np.count_nonzero(found != label[some]))
            label[some] = found
            ones = np.ones(len(found), np.float32), (found, np.arange(len(found)))
            sums += csr_array(ones, shape=(most, len(found))) @ a[some]
            sizes += np.bincount(found, minlength=most)
            hear(number + 1, some.stop)
        mean = (sums / np.maximum(sizes, 1)[:, None]).astype(np.float32)
        # A cluster that lost all its texels begins anew where one is worst served.
        if len(empty := np.flatnonzero(sizes == 0)):
            mean[empty] = a[np.argsort(far)[::-1][: len(empty)]]
        elif moved <= _STILL * len(a):
            break
    return mean


def _nearest_members(a: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Of each mean (M, n) the texel that is nearest to it."""
    best, at = np.full(len(mean), np.inf, np.float32), np.zeros(len(mean), np.intp)
    for some in _blocks(len(a)):
        squares = _squares(a[some], mean)
        nearest = squares.argmin(axis=0)
        square = squares[nearest, np.arange(len(mean))]
        better = square < best
        best[better], at[better] = square[better], some.start + nearest[better]
    return at


def _mixtures(a: np.ndarray, r: np.ndarray, hear: Callable[[int], None]) -> tuple[np.ndarray, np.ndarray, float]:
    """Of each of `a` (T, n) the nearest of `r` (M, n), (T, k), their weights (T, k), and the sum of squares left."""
    k = min(_NEIGHBOURS, len(r))
    indices = np.empty((len(a), k), np.int32 if len(r) > np.iinfo(np.uint16).max else np.uint16)
    weights, left = np.empty((len(a), k), np.float32), 0.0
    for some in _blocks(len(a), _BLOCK // 4):
        squares = _squares(a[some], r)
        near = np.argpartition(squares, k - 1, axis=1)[:, :k]
        near = np.take_along_axis(near, np.take_along_axis(squares, near, axis=1).argsort(axis=1), axis=1)
        off = (r[near] - a[some, None]).astype(np.float64)
        G = off @ off.swapaxes(1, 2)
        G[:, range(k), range(k)] += _RIDGE * np.trace(G, axis1=1, axis2=2)[:, None] / k + 1e-30
        w = np.linalg.solve(G, np.ones((len(off), k, 1)))[..., 0]
        w /= w.sum(axis=1, keepdims=True)
        indices[some], weights[some] = near, w
        left += float(np.sum(np.einsum("tk,tkn->tn", w, off) ** 2))
        hear(some.stop)
    return indices, weights, left


def _squares(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Squared distances (A, B)."""
    squares = np.sum(a * a, axis=1)[:, None] + np.sum(b * b, axis=1) - 2 * (a @ b.T)
    return np.asarray(np.maximum(squares, 0))
