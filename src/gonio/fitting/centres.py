"""Choice of centres: a few hundreds or thousands of samples that stand for a million (RS 6, after Carr et al. 2001).

    e_i = w_i |g_i - s(q_i)|        the norm over channels, w_i = cos theta_i where g is a BRDF (RS 6: radiance)

The samples with the largest e become centres, the interpolant is fitted anew, and so on. How many at once is a `Rule`:
a value, of which there are three (`rules`).

Between looks at all samples, while the centres grow by two fifths, only the worst twentieth is watched.

Not here: removal of centres, centres that are no samples, fits by least squares.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from .._kernels import radial as kernels
from ..arrays import Array, require_finite, to_numpy
from ..brdf.radial import Interpolant
from ..errors import ArrayError
from ..threads import processors
from .radial_basis import RadialSystem, anchors
from .rules import Lookahead, Rule, Worst, require

_BLOCK = 16384  # samples at once: their residuals stay in the cache
_FEW = 20_000  # samples of which all are looked at each time
_WATCHED = 0.05  # of the samples, the worst
_GROWTH = 1.4  # of the centres, until all samples are looked at again
_LEAST = 8  # centres that are added until then


@dataclasses.dataclass(frozen=True, eq=False)
class Choice:
    """`indices` (N,) of the samples that became centres, in that order, and the `interpolant` of them, which is held
    within the range of the values.

    history: (count, error) each time all samples were looked at: error is the rms of the residuals over samples and
    channels, weighted by w^2, in units of the values. `converged`: whether the error asked for was reached, and the
    `reason` why the choice ended.
    """

    indices: np.ndarray
    interpolant: Interpolant
    history: tuple[tuple[int, float], ...]
    converged: bool
    reason: str


def choose_centres(
    points: Array,
    values: Array,
    weights: Array | None = None,
    scales: Array | None = None,
    rho: float = 0.0,
    rule: Rule | None = None,
    most: int = 1000,
    error: float = 0.0,
    progress: Callable[[int, int], None] | None = None,
    start: Array | None = None,
    until: Callable[[], bool] | None = None,
) -> Choice:
    """At most `most` centres among samples `points` (M, d) with `values` (M, C), fewer where the `error` is reached.

    weights: (M,) >= 0, by which residuals are multiplied, of which only ratios matter; samples of weight 0 become no
    centres. scales (d,) and rho: of the interpolant (`RadialSystem`), otherwise 1 and 0. rule: otherwise `Lookahead()`.
    error: weighted rms over samples and channels, in units of the values. start: indices of centres that are chosen
    already; those of an earlier `Choice` by the same rule and of the same samples go on as if it had not ended.
    `progress(done, total)` hears of centres. `until()` is asked after each round: True ends the choice as it stands.

    A million samples in three dimensions take 6 s for 2,000 centres and 15 s for 5,000, of one core, and half a GB.
    Raises `ArrayError` for shapes, values that are not finite, and points that lie in a plane (drop a coordinate then),
    `ParameterError` for `most` < d + 1, `MemoryLimitError` where so many centres need more than 4 GB.
    """
    samples = _Samples.of(points, values, weights, scales)
    d = samples.points.shape[1]
    require(most > d, f"most is {most}: {d + 1} centres at least are wanted in {d} dimensions.")
    given = samples.indices(start)
    rounds = _Rounds(samples, Lookahead() if rule is None else rule, rho, most, given, progress)
    with samples.looks() as looks:
        return rounds.run(looks, error, until or (lambda: False))


class _Rounds:
    """A choice under way. Each round follows from the centres before it alone, so that a choice can be gone on with."""

    def __init__(
        self,
        samples: _Samples,
        rule: Rule,
        rho: float,
        most: int,
        given: np.ndarray,
        progress: Callable[[int, int], None] | None,
    ) -> None:
        self.samples, self.rule, self.progress, self.given = samples, rule, progress, given
        self.free = samples.weights > 0
        self.most = max(min(most, int(np.count_nonzero(self.free))), given.size)
        self.system = RadialSystem(samples.scales, rho, self.most)
        self.chosen: np.ndarray = np.empty(0, np.intp)
        self.history: list[tuple[int, float]] = []
        self.looked = 0  # how many centres there were when all samples were looked at
        self.watched: np.ndarray | None = None  # the samples that are looked at meanwhile
        self.others = 0.0  # the sum of the squares of those that are not
        self._take(self._beginning())
        self.settled = self._last_look()

    def run(self, looks: _Looks, error: float, until: Callable[[], bool]) -> Choice:
        watch = looks
        while True:
            count = self.chosen.size
            batch = self.rule.batch(count)
            due = self._due(count, self.looked)
            if due:
                self.looked = count
            if count + batch <= self.given.size and count != self.settled:
                self._take(self.given[count : count + batch])
                continue
            interpolant = self.system.solve()
            if due or self.watched is None:
                squares, total = looks(interpolant)
                self.history.append((count, self._rms(total)))
                at = self._largest(squares, self._share())
                watch, self.watched, squares = looks.at(at), at, squares[at]
                self.others = total - float(squares.sum(dtype=np.float64))
            else:
                squares, total = watch(interpolant)
                total += self.others
                if self._rms(total) <= error or count >= self.most:
                    _, total = looks(interpolant)
                    self.history.append((count, self._rms(total)))
            found = self._rms(total)
            if found <= error:
                return self._choice(interpolant, True, f"the error fell to {found:.3g}")
            if count >= self.most:
                return self._choice(interpolant, False, f"there are {count} centres, as many as were asked for")
            if until():
                return self._choice(interpolant, False, f"it was stopped with {count} centres")
            if not self.free.any():
                return self._choice(interpolant, False, f"no sample is left that is not a centre, of {count}")
            self._take(self._picked(squares, batch))

    def _picked(self, squares: np.ndarray, batch: int) -> np.ndarray:
        """The next samples to be centres, by their squares among the watched."""
        assert self.watched is not None
        count = self.chosen.size
        given = self.given[count : count + batch]
        at = self._worst(squares, self.watched, self.rule.candidates(batch))
        indices: np.ndarray = self.watched[at]
        squares = squares[at]
        beside = given[~np.isin(given, indices)]
        if beside.size:
            indices, squares = np.concatenate((indices, beside)), np.concatenate((squares, np.zeros(beside.size)))
        if not indices.size:
            self.watched = None
            return indices
        of = self.samples
        worst = Worst(self.system, of.points[indices], of.values[indices], of.weights[indices], squares)
        order = np.argsort(indices)
        places = order[np.searchsorted(indices, given, sorter=order)]
        picked: np.ndarray = indices[self.rule.pick(worst, min(batch, self.most - count), places)]
        if not picked.size:
            self.free[indices] = False  # all of them coincide with centres
        return picked

    def _take(self, picked: np.ndarray) -> None:
        self.free[picked] = False
        if picked.size:
            taken = self.system.add(self.samples.points[picked], self.samples.values[picked])
            self.chosen = np.concatenate((self.chosen, picked[taken]))
            if not taken.all():
                self.given = self.given[~np.isin(self.given, picked[~taken])]
        if self.progress is not None:
            self.progress(self.chosen.size, self.most)

    def _beginning(self) -> np.ndarray:
        """Those that span space and those with which the rule begins; or those given, where they begin otherwise."""
        usable = np.flatnonzero(self.free)
        spanning = usable[anchors(self.samples.points[usable] * self.samples.scales)]
        drawn = usable[self.rule.first(usable.size)]
        first = np.concatenate((spanning, drawn[~np.isin(drawn, spanning)]))[: self.most]
        return first if np.array_equal(self.given[: first.size], first[: self.given.size]) else self.given

    def _due(self, count: int, looked: int) -> bool:
        """Whether it is time to look at all samples."""
        return self.samples.count <= _FEW or count >= looked + max(_LEAST, (_GROWTH - 1) * looked) or looked == 0

    def _last_look(self) -> int:
        """With how many centres the last look at all samples falls before those that are given are at an end."""
        count, looked = self.chosen.size, 0
        while True:
            if self._due(count, looked):
                looked = count
            batch = self.rule.batch(count)
            if count + batch > self.given.size:
                return looked
            count += batch

    def _share(self) -> int:
        count = self.samples.count
        return count if count <= _FEW else max(int(_WATCHED * count), _FEW)

    def _largest(self, squares: np.ndarray, count: int) -> np.ndarray:
        """The samples with the `count` largest squares (M,) that are no centres, as they stand."""
        if count >= squares.size:
            return np.arange(squares.size)
        return np.sort(np.argpartition(np.where(self.free, squares, -1), -count)[-count:])

    def _worst(self, squares: np.ndarray, indices: np.ndarray, count: int) -> np.ndarray:
        """Places of the `count` largest of `squares`, those of samples `indices`, that are no centres, worst first."""
        squares = np.where(self.free[indices], squares, -1)
        at = np.arange(squares.size)
        if count < squares.size:
            at = np.sort(np.argpartition(squares, -count)[-count:])
        at = at[np.argsort(-squares[at], kind="stable")]
        return np.asarray(at[self.free[indices[at]]])

    def _rms(self, total: float) -> float:
        return math.sqrt(max(total, 0.0) / (self.samples.values.shape[1] * self.samples.mass))

    def _choice(self, interpolant: Interpolant, converged: bool, reason: str) -> Choice:
        values = self.samples.values[self.samples.weights > 0]
        interpolant = dataclasses.replace(interpolant, limits=np.stack((values.min(axis=0), values.max(axis=0))))
        return Choice(self.chosen, interpolant, tuple(self.history), converged, reason)


class _Looks:
    """Weighted squares of the residuals of samples, by threads in single precision."""

    def __init__(
        self, q: np.ndarray, middle: np.ndarray, targets: np.ndarray, scale: np.ndarray, pool: ThreadPoolExecutor
    ) -> None:
        self.q, self.middle, self.targets, self.scale, self.pool = q, middle, targets, scale, pool

    def at(self, indices: np.ndarray) -> _Looks:
        return _Looks(self.q[indices], self.middle, self.targets[indices], self.scale[indices], self.pool)

    def __call__(self, interpolant: Interpolant) -> tuple[np.ndarray, float]:
        """Of each (n,), and their sum."""
        polynomial = np.array(interpolant.polynomial)
        polynomial[0] += self.middle @ polynomial[1:]
        centres = interpolant.centres * interpolant.scales - self.middle
        fitted = centres.astype(np.float32), interpolant.coefficients.astype(np.float32), polynomial.astype(np.float32)
        n, channels = self.targets.shape
        squares = np.empty(n, np.float32)

        def part(low: int, high: int) -> float:
            out, total = np.empty((_BLOCK, channels), np.float32), 0.0
            for start in range(low, high, _BLOCK):
                some = slice(start, min(start + _BLOCK, high))
                left = out[: some.stop - start]
                kernels.residuals(self.q[some], *fitted, self.targets[some], left)
                np.einsum("ij,ij->i", left, left, out=squares[some])
                squares[some] *= self.scale[some]
                total += float(squares[some].sum(dtype=np.float64))
            return total

        parts = 1 if n <= 2 * _BLOCK else 4 * processors()
        bounds = [k * n // parts for k in range(parts + 1)]
        if parts == 1:
            return squares, part(0, n)
        return squares, sum(self.pool.map(part, bounds[:-1], bounds[1:]))


@dataclasses.dataclass(frozen=True, eq=False)
class _Samples:
    """What is to be fitted: `points` (M, d), `values` (M, C), `weights` (M,) up to 1, whose squares sum to `mass`."""

    points: np.ndarray
    values: np.ndarray
    weights: np.ndarray
    scales: np.ndarray
    mass: float

    @property
    def count(self) -> int:
        return len(self.points)

    @classmethod
    def of(cls, points: Array, values: Array, weights: Array | None, scales: Array | None) -> _Samples:
        q, g = np.asarray(to_numpy(points), np.float64), np.asarray(to_numpy(values), np.float64)
        if q.ndim != 2 or g.ndim != 2 or len(q) != len(g) or 0 in q.shape or 0 in g.shape:
            raise ArrayError(f"points and values have shapes {q.shape} and {g.shape}; expected (M, d) and (M, C).")
        w = np.ones(len(q)) if weights is None else np.asarray(to_numpy(weights), np.float64)
        if w.shape != (len(q),):
            raise ArrayError(f"weights have shape {w.shape}; expected ({len(q)},), one for each sample.")
        for name, array in (("points", q), ("values", g), ("weights", w)):
            require_finite(array, name)
        if w.min() < 0 or w.max() == 0:
            raise ArrayError("weights are to be >= 0, and not 0 throughout.")
        w = w / w.max()
        M = np.ones(q.shape[1]) if scales is None else np.asarray(to_numpy(scales), np.float64)
        if M.shape != (q.shape[1],):
            raise ArrayError(f"scales have shape {M.shape}; expected ({q.shape[1]},), one for each coordinate.")
        return cls(q, g, w, M, float(w @ w))

    @contextlib.contextmanager
    def looks(self) -> Iterator[_Looks]:
        pool = ThreadPoolExecutor(processors())
        try:
            q = self.points * self.scales
            # About the mean, since single precision counts distances in parts of the coordinates.
            middle = q.mean(axis=0)
            q, g, w2 = (x.astype(np.float32) for x in (q - middle, self.values, self.weights**2))
            yield _Looks(q, middle, g, w2, pool)
        finally:
            # Ctrl-C is not to wait for what has not begun.
            pool.shutdown(cancel_futures=True)

    def indices(self, start: Array | None) -> np.ndarray:
        if start is None:
            return np.empty(0, np.intp)
        given = np.asarray(to_numpy(start))
        if given.ndim != 1 or given.dtype.kind not in "iu" or given.size != np.unique(given).size:
            raise ArrayError("start is to be the indices (N,) of distinct samples.")
        if given.size and (given.min() < 0 or given.max() >= self.count):
            raise ArrayError(f"start has indices outside [0, {self.count}).")
        return given.astype(np.intp)
