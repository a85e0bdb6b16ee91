"""Choice of scales and of the stiffness by samples that were left out (Wahba 1990).

    error(M) = exp mean over groups k of  log rms over samples i of k of  w_i (g_i - s_k(q_i))
    error(rho) = rms over samples i that are no centres of  w_i (g_i - s(q_i))

Scales decide what happens between images (RS 6, 7: m_w, m_xy), so s_k is fitted without group k, as a rule an image.
The mean is of logarithms, since an image at the rim is extrapolated to badly whatever the scales, and would rule a
plain one. Noise differs from pixel to pixel, and so the stiffness is judged by the samples that are no centres: those
of an image left out would ask for none, since what lacks between images is far more than noise.

The scales are sought along one coordinate after the other, over a grid, with a few hundred centres among a few thousand
samples; the stiffness once before, and once after with three times as many. It is of the order of the variance of noise
over that of the function a unit of distance away, and little larger for many centres than for few.

Not here: gradients of the error, scales that turn the axes, generalised cross-validation.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from ..arrays import Array, to_numpy
from ..brdf.radial import Interpolant
from ..errors import ArrayError, ParameterError
from .centres import Choice, choose_centres
from .rules import Rule, Spread

SCALES = (1 / 64, 1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0, 2.0)
STIFFNESS = (0.0, 0.003, 0.01, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0)
_SAMPLES = 4000
_MORE = 3  # times as many samples and centres where the stiffness is chosen in the end
_FOLDS = 8
_TOGETHER = {2: (), 3: ((2,),), 4: ((0, 1),), 5: ((0, 1), (4,))}  # (u, v), (u, v, w), (x, y, u, v), (x, y, u, v, w)


@dataclasses.dataclass(frozen=True, eq=False)
class Validation:
    """`scales` (d,) of the least `error`, and the stiffness `rho`. `error` is that at groups left out, the geometric
    mean over groups, in units of the values, weighted, and holds the noise of the samples.

    table: (K, d + 1), scales and error of all that were tried with one stiffness. stiffness: (R, 2), rho and the rms at
    samples that are no centres, with the scales found.
    """

    scales: np.ndarray
    rho: float
    error: float
    table: np.ndarray
    stiffness: np.ndarray


def choose_scales(
    points: Array,
    values: Array,
    groups: Array,
    weights: Array | None = None,
    together: Sequence[Sequence[int]] | None = None,
    grid: Sequence[float] = SCALES,
    stiffness: Sequence[float] = STIFFNESS,
    centres: int = 300,
    rule: Rule | None = None,
    seed: int = 0,
) -> Validation:
    """Scales of coordinates with the least error at groups that were left out, and a stiffness that fits the noise.

    points (M, d), values (M, C), weights (M,) as for `choose_centres`; groups (M,): integers, the image of each sample.
    together: coordinates that share a scale, which is sought on `grid` (ascending, > 0); the others keep 1. Otherwise
    w for d = 3, (x, y) for d = 4, (x, y) and w for d = 5. stiffness: values of rho to try. centres and rule: of the
    fits, three times as many for the stiffness. Of more than eight groups several are left out at a time; of more than
    4,000 samples (12,000 for the stiffness), some are drawn by `seed`. The same arguments give the same answer.

    Raises `ArrayError` where there is one group, or where what is left without a group lies in a plane (two images:
    add one), and `ParameterError` for a grid, stiffness or `together` that cannot be.
    """
    q, g = np.asarray(to_numpy(points), np.float64), np.asarray(to_numpy(values), np.float64)
    labels = np.asarray(to_numpy(groups))
    w = np.ones(len(q)) if weights is None else np.asarray(to_numpy(weights), np.float64)
    if q.ndim != 2 or g.ndim != 2 or not len(q) == len(g) == len(labels) == len(w) or labels.ndim != 1 or w.ndim != 1:
        raise ArrayError(
            f"points, values, groups and weights have shapes {q.shape}, {g.shape}, {labels.shape} and {w.shape}; "
            "expected (M, d), (M, C), (M,) and (M,)."
        )
    steps, stiff = np.array(grid, np.float64), np.array(stiffness, np.float64)
    if steps.ndim != 1 or not steps.size or not (steps > 0).all() or not (np.diff(steps) > 0).all():
        raise ParameterError("the grid of scales is to be ascending, and > 0.")
    if stiff.ndim != 1 or not stiff.size or not (stiff >= 0).all():
        raise ParameterError("the stiffness to try is to be some values >= 0.")
    blocks = [list(b) for b in (_together(q.shape[1]) if together is None else together)]
    used = [axis for block in blocks for axis in block]
    if len(set(used)) != len(used) or not set(used) <= set(range(q.shape[1])):
        raise ParameterError(f"together is {blocks}: distinct coordinates of {q.shape[1]} are wanted.")
    usable = np.flatnonzero(w > 0)
    rule = Spread(0.2) if rule is None else rule

    def fits(times: int) -> _Fits:
        kept = usable[_drawn(labels[usable], times * _SAMPLES, np.random.default_rng(seed))]
        return _Fits(q[kept], g[kept], w[kept], labels[kept], times * centres, rule)

    def scales(at: tuple[int, ...]) -> np.ndarray:
        M = np.ones(q.shape[1])
        for block, k in zip(blocks, at, strict=True):
            M[block] = steps[k]
        return M

    middle = (int(np.abs(np.log(4 * steps)).argmin()),) * len(blocks)
    few = fits(1)
    rho = _least(stiff, few.noise(scales(middle), stiff))
    best, tried = _search(lambda at: few.error(scales(at), rho), middle, steps.size)
    # Centres are where noise is large, the more so the more they are: a few would ask for too little.
    noise = fits(_MORE).noise(scales(best), stiff)
    rho = _least(stiff, noise)
    table = np.array([[*scales(at), error] for at, error in tried.items()])
    return Validation(scales(best), rho, tried[best], table, np.stack((stiff, noise), axis=1))


def _least(stiffness: np.ndarray, errors: np.ndarray) -> float:
    return float(stiffness[errors.argmin()])


def _together(d: int) -> Sequence[Sequence[int]]:
    if d not in _TOGETHER:
        raise ParameterError(f"together is wanted for {d} coordinates: which of them share a scale.")
    return _TOGETHER[d]


def _search(
    error_at: Callable[[tuple[int, ...]], float], start: tuple[int, ...], size: int
) -> tuple[tuple[int, ...], dict[tuple[int, ...], float]]:
    """Along one axis of a grid after the other as long as the error falls: the place of the least, and all errors."""
    tried = {start: error_at(start)}

    def error(at: tuple[int, ...]) -> float:
        if at not in tried:
            tried[at] = error_at(at)
        return tried[at]

    best, moved = start, True
    while moved:
        moved = False
        for axis in range(len(start)):
            for step in (1, -1):
                while 0 <= best[axis] + step < size:
                    beside = (*best[:axis], best[axis] + step, *best[axis + 1 :])
                    if error(beside) >= error(best):
                        break
                    best, moved = beside, True
    return best, tried


def _drawn(groups: np.ndarray, most: int, rng: np.random.Generator) -> np.ndarray:
    """Indices of `most` samples or fewer, as many of each group as far as it has them."""
    _, label = np.unique(groups, return_inverse=True)
    order = rng.permutation(label.size)
    order = order[np.argsort(label[order], kind="stable")]
    counts = np.bincount(label)
    rank = np.arange(label.size) - np.repeat(np.cumsum(counts) - counts, counts)
    if counts.sum() > most:
        order = order[rank < max(most // counts.size, 1)]
    return np.asarray(np.sort(order))


class _Fits:
    """Errors of fits to some of the samples."""

    def __init__(
        self,
        points: np.ndarray,
        values: np.ndarray,
        weights: np.ndarray,
        groups: np.ndarray,
        centres: int,
        rule: Rule,
    ) -> None:
        self.points, self.values, self.weights = points, values, weights
        names, self.label = np.unique(groups, return_inverse=True)
        if names.size < 2:
            raise ArrayError("all samples are of one group: two at least are wanted, so that one can be left out.")
        self.groups = names.size
        # Neighbours go to different folds: what is left out together is not one large hole.
        self.fold = np.arange(names.size) % min(names.size, _FOLDS)
        self.centres, self.rule = centres, rule

    def error(self, scales: np.ndarray, rho: float) -> float:
        """At groups that were left out."""
        squares = np.zeros(len(self.points))
        fold = self.fold[self.label]
        for k in range(int(self.fold.max()) + 1):
            out = np.flatnonzero(fold == k)
            squares[out] = self._squares(self._fitted(np.flatnonzero(fold != k), scales, rho).interpolant, out)
        mass = np.bincount(self.label, self.weights**2, self.groups) * self.values.shape[1]
        each = np.bincount(self.label, squares, self.groups) / mass
        return float(np.exp(np.mean(np.log(np.maximum(each, 1e-30))) / 2))

    def noise(self, scales: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
        """At samples that are no centres, for each stiffness."""
        errors = np.empty(stiffness.size)
        every = np.arange(len(self.points))
        for k, rho in enumerate(stiffness):
            choice = self._fitted(every, scales, rho)
            others = np.delete(every, choice.indices)
            mass = np.sum(self.weights[others] ** 2) * self.values.shape[1]
            errors[k] = np.sqrt(np.sum(self._squares(choice.interpolant, others)) / mass)
        return errors

    def _fitted(self, some: np.ndarray, scales: np.ndarray, rho: float) -> Choice:
        # A quarter at most, so that others are left to judge by.
        most = max(min(self.centres, some.size // 4), scales.size + 1)
        return choose_centres(
            self.points[some], self.values[some], self.weights[some], scales, float(rho), self.rule, most
        )

    def _squares(self, interpolant: Interpolant, some: np.ndarray) -> np.ndarray:
        left = self.values[some] - interpolant(self.points[some])
        return np.asarray(np.einsum("ij,ij->i", left, left) * self.weights[some] ** 2)
