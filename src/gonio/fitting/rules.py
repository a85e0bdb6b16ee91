"""How centres are added, a round after the other: three rules, each a value.

`Greedy` is the paper's: a random start, then the worst, some at a time. In batches it puts centres side by side where
one would do; one at a time, each centre costs a solve and a look at the samples.
`Spread` adds a share of the centres that are there, and lets each lower the errors around it by a rule: in proportion
to the distance, up to as far as the nearest centre was.
`Lookahead` lets `Spread` find twice as many, and takes each the worst in turn of these, whose residuals follow every
choice exactly, by Newton's rows, with no look at other samples. It errs as one at a time does, `Spread` by some 5 %
more. Two fits that differ in one early choice differ by as much.

Not here: the rounds themselves (`centres`).
"""

from __future__ import annotations

import abc
import dataclasses
import math

import numpy as np
from scipy.spatial import KDTree

from ..errors import ParameterError
from .radial_basis import RadialSystem


@dataclasses.dataclass(frozen=True, eq=False)
class Worst:
    """The worst samples, worst first: `points` (K, d), `values` (K, C), `weights` (K,), `squares` (K,) of errors."""

    system: RadialSystem
    points: np.ndarray
    values: np.ndarray
    weights: np.ndarray
    squares: np.ndarray


class Rule(abc.ABC):
    """How centres are added."""

    @abc.abstractmethod
    def first(self, total: int) -> np.ndarray:
        """Samples of `total` to begin with, beside the d + 1 that span space."""

    @abc.abstractmethod
    def batch(self, count: int) -> int:
        """How many to add to `count` centres."""

    @abc.abstractmethod
    def candidates(self, batch: int) -> int:
        """How many of the worst samples to look through for them."""

    @abc.abstractmethod
    def pick(self, worst: Worst, batch: int, given: np.ndarray) -> np.ndarray:
        """Places in `worst` of the samples to add, at most `batch`: first those `given`, then by the rule."""


@dataclasses.dataclass(frozen=True)
class Greedy(Rule):
    """The paper's: `start` random samples, by `seed`, then the `batch` worst at a time."""

    batch_size: int = 1
    start: int = 50
    seed: int = 0

    def __post_init__(self) -> None:
        require(self.batch_size >= 1 and self.start >= 0, f"{self}: a batch >= 1 and a start >= 0 are wanted.")

    def first(self, total: int) -> np.ndarray:
        return np.random.default_rng(self.seed).choice(total, min(self.start, total), replace=False)

    def batch(self, count: int) -> int:
        return self.batch_size

    def candidates(self, batch: int) -> int:
        return 2 * batch + 8  # some may coincide

    def pick(self, worst: Worst, batch: int, given: np.ndarray) -> np.ndarray:
        _, same = np.unique(worst.points, axis=0, return_index=True)
        distinct = np.zeros(len(worst.points), bool)
        distinct[same] = True
        distinct |= worst.system.rho > 0
        rest = np.setdiff1d(np.flatnonzero(distinct), given)
        return np.concatenate((given, rest))[:batch]


@dataclasses.dataclass(frozen=True)
class Spread(Rule):
    """A `share` of the centres at a time, the worst thinned by distance, among `reach` times as many."""

    share: float = 0.05
    reach: int = 32

    def __post_init__(self) -> None:
        require(0 < self.share <= 1 and self.reach >= 1, f"{self}: a share in (0, 1] and a reach >= 1 are wanted.")

    def first(self, total: int) -> np.ndarray:
        return np.empty(0, np.intp)

    def batch(self, count: int) -> int:
        return max(1, math.floor(self.share * count))

    def candidates(self, batch: int) -> int:
        return self.reach * batch

    def pick(self, worst: Worst, batch: int, given: np.ndarray) -> np.ndarray:
        return _thinned(worst, batch, given)


@dataclasses.dataclass(frozen=True)
class Lookahead(Spread):
    """A `share` of the centres at a time, each the worst in turn among `tried` times as many, which are found by
    `Spread`."""

    tried: int = 2

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.tried >= 1, f"{self}: at least 1 to be tried is wanted.")

    def pick(self, worst: Worst, batch: int, given: np.ndarray) -> np.ndarray:
        # As many as for a whole round, also where there is room for a part of it only.
        few = _thinned(worst, self.tried * self.batch(worst.system.count), given[:0])
        few = np.concatenate((few, np.setdiff1d(given, few)))
        if not few.size:
            return few
        candidates = worst.system.candidates(worst.points[few], worst.values[few])
        scale = worst.weights[few] ** 2
        picked = []
        for k in range(batch):
            if k < given.size:
                j = int(np.flatnonzero(few == given[k])[0])
            else:
                errors = np.einsum("ij,ij->i", candidates.residuals, candidates.residuals) * scale
                j = int(np.where(candidates.free, errors, -1).argmax())
            if candidates.free[j]:
                candidates.pick(j)
                picked.append(j)
        return few[np.array(picked, np.intp)]


def _thinned(worst: Worst, count: int, given: np.ndarray) -> np.ndarray:
    """Places of at most `count`, those `given` and then the worst in turn, where each lowers the errors about it."""
    q, stiff = worst.points * worst.system.scales, worst.system.rho > 0
    room, _ = KDTree(worst.system.scaled_centres).query(q)
    errors = worst.squares.astype(np.float64)
    if not stiff:
        errors[room <= 0] = -1
    picked = []
    for k in range(count):
        j = int(given[k]) if k < given.size else int(errors.argmax())
        if errors[j] < 0:
            continue
        picked.append(j)
        off = q - q[j]
        near = np.einsum("ij,ij->i", off, off)
        errors *= np.minimum(near / max(room[j] ** 2, 1e-30), 1)
        errors[j] = -1
        if not stiff:
            errors[near <= 0] = -1
    return np.array(picked, np.intp)


def require(holds: bool, message: str) -> None:
    """Raises `ParameterError` with the message where it does not hold."""
    if not holds:
        raise ParameterError(message)
