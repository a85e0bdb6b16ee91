"""How far a query lies from all that was measured, and how far to trust what is made of it there.

    beyond(q) = max(min over k of |W (q - q_k)| - reach, 0)             q_k: where samples were, thinned
    confidence = exp(-beyond / LENGTH)

W is that of the interpolant, but .7 for w: how far a fit goes astray depends on angles, not on its m_w. `reach` is what
thinning took: of a hundred samples ninety-nine lie within it of a q_k. LENGTH is such that the confidence is about the
part of radiance that is right (reproductions/confidence.py).
"""

from __future__ import annotations

import dataclasses
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import Array, floats, frozen, like, require_finite, to_numpy
from ..errors import ArrayError, ParameterError

LENGTH = 0.1
_NEAR = 1.5  # spacings of samples: what is farther from all is not covered
_MOST = 4096
_DRAWN = 20_000


@dataclasses.dataclass(frozen=True, eq=False)
class Coverage:
    """`points` (K, d), q_k; `scales` (d,) > 0, the diagonal of W; `reach` >= 0. Raises `ArrayError`, `ParameterError`
    for others."""

    points: Array
    scales: Array
    reach: float

    def __post_init__(self) -> None:
        for name, dtype in (("points", np.float32), ("scales", np.float64)):
            array = frozen(to_numpy(getattr(self, name)), np.dtype(dtype))
            require_finite(array, name)
            object.__setattr__(self, name, array)
        if self.points.ndim != 2 or 0 in self.points.shape or self.scales.shape != self.points.shape[1:]:
            raise ArrayError(f"points and scales have shapes {self.points.shape}, {self.scales.shape}; (K, d), (d,).")
        if self.scales.min() <= 0:
            raise ParameterError(f"Coverage: a scale is {self.scales.min():.6g}; all are positive.")
        if not 0 <= self.reach < np.inf:
            raise ParameterError(f"Coverage: reach = {self.reach:g}; a distance is wanted.")

    @classmethod
    def of(cls, q: np.ndarray, scales: np.ndarray, seed: int = 0) -> Coverage:
        """Of samples at q (M, d): one of each cell of a grid as coarse as leaves some thousand of them."""
        samples = q * scales
        low, extent = samples.min(axis=0), np.ptp(samples, axis=0)
        cell = float(extent.max()) / 1024 or 1.0
        kept = samples
        while len(kept) > _MOST:
            at = ((kept - low) / cell).astype(np.int64)
            # By one number for each cell: rows are sorted ten times as slowly.
            number = np.ravel_multi_index(tuple(at.T), tuple(at.max(axis=0) + 1))
            _, first = np.unique(number, return_index=True)
            kept, cell = kept[first], cell * 2**0.5
        drawn = samples[np.random.default_rng(seed).permutation(len(samples))[:_DRAWN]]
        away = cKDTree(kept).query(drawn)[0]
        return cls(kept / scales, scales, float(np.quantile(away, 0.99)))

    def confidence(self, q: Array) -> Array:
        """(...) in (0, 1] at q (..., d), in its library. Raises `ArrayError` for another number of coordinates."""
        _, q = floats(q)
        if q.ndim == 0 or q.shape[-1] != self.points.shape[1]:
            raise ArrayError(f"q has shape {tuple(q.shape)}; expected (..., {self.points.shape[1]}).")
        away = self._tree.query(to_numpy(q) * self.scales)[0]
        return like(np.exp(-np.maximum(away - self.reach, 0) / LENGTH), q)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.points * self.scales)


def near_samples(samples: np.ndarray, places: np.ndarray, least: float = 0.0) -> np.ndarray:
    """Which of `places` (..., d) have one of `samples` (N, d) within 1.5 spacings, bool (...).

    The spacing is the median distance of a sample to its third neighbour, the same for a lattice and for chance, and
    `least` at the least.
    """
    apart = np.unique(samples.round(9), axis=0)
    tree = cKDTree(apart)
    spacing = max(float(np.median(tree.query(apart, k=[min(len(apart), 4)])[0])), least)
    return np.asarray(tree.query(places)[0] <= _NEAR * spacing)
