"""Slices of reflectance on a grid of facets, from what lights showed: one operator for all texels (MS 8, 5.1).

    s(x) = p(x) + sum_k c_k |x - x_k|^3,    s(x_k) = v_k          x: half vectors on Lambert's map; p linear
    v = log(rho + .01 max rho)                                    highlights span decades, and logarithms bend less

s is linear in v: at the knots of a domain s = W v, with W (knots, lights) the same for all texels under the same
lights, and a mean of operators where lights are near and a texel lies between their places (`facet_cells`). Where some
lights tell nothing of a texel (clipped, shaded), their v are those that make their c_k 0: then s is what the others
alone determine.

Only knots that the domain holds are filled: push and pull, or any surface, goes on beyond the lights, and what it finds
there is no data.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence

import numpy as np
from scipy.spatial.distance import cdist

from ..arrays import Array, frozen, require_finite, to_numpy
from ..directions import half_vector, lambert_map, require_unit
from ..errors import ArrayError
from .facet_domain import Domain

_APART = 1e-6  # on the map: nearer lights are one
_GRAZING = 0.02  # cosine of light below which it is not looked at
_FLOOR = 0.01  # of the greatest: what is darker is noise as likely as not
_BEYOND = 3.0  # times the greatest that lights showed, at most, between them


@dataclasses.dataclass(frozen=True, eq=False)
class FacetSlices:
    """From reflectance under `lights` (N, 3), unit, local, to the knots of `domain`; lights below the surface, or
    nearly, are not looked at.

    Raises `ArrayError` for fewer than four lights above the surface, two at one place, or all on a line;
    `DirectionError` where they are not unit.
    """

    domain: Domain
    lights: Array

    def __post_init__(self) -> None:
        w = frozen(to_numpy(self.lights), np.dtype(np.float64))
        if w.ndim != 2 or w.shape[1] != 3:
            raise ArrayError(f"FacetSlices: lights have shape {w.shape}; (N, 3) is wanted.")
        require_unit(w, "lights")
        object.__setattr__(self, "lights", w)
        if np.count_nonzero(self.used) < 4:
            raise ArrayError(f"FacetSlices: {np.count_nonzero(self.used)} lights are above the surface; four or more.")
        at = self._at
        near = cdist(at, at) + np.eye(len(at))
        if near.min() < _APART:
            i, j = np.flatnonzero(self.used)[list(np.unravel_index(int(near.argmin()), near.shape))]
            raise ArrayError(f"FacetSlices: lights {i} and {j} are at one place; average what they show.")
        if np.linalg.matrix_rank(at - at.mean(axis=0), tol=_APART) < 2:
            raise ArrayError("FacetSlices: all lights are on a line: they tell nothing of what lies beside it.")

    @functools.cached_property
    def used(self) -> np.ndarray:
        """Which lights are looked at, (N,) bool."""
        return np.asarray(self.lights[:, 2] > _GRAZING)

    def __call__(self, rho: Array, known: Array | None = None) -> np.ndarray:
        """Slices (T, rows, columns), float32, NaN outside the domain, from `rho` (T, N) >= 0, where `known` (T, N).

        Raises `ArrayError` for shapes that do not fit, values that are not finite or below 0 where known, and texels of
        which fewer than four lights tell.
        """
        return blended_slices((self,), np.ones((len(to_numpy(rho)), 1)), rho, known)

    @functools.cached_property
    def weights(self) -> np.ndarray:
        """W (knots, lights used), float32, of the knots of the domain along its rows."""
        x = lambert_map(self.domain.grid.directions[self.domain.confidence > 0])
        basis = np.column_stack((cdist(x, self._at) ** 3, np.ones(len(x)), x))
        W: np.ndarray = frozen(basis @ self._inverse[:, : len(self._at)], np.dtype(np.float32))
        return W

    @functools.cached_property
    def _at(self) -> np.ndarray:
        return np.asarray(lambert_map(half_vector(self.lights[self.used], self.domain.wo)))

    @functools.cached_property
    def _inverse(self) -> np.ndarray:
        """From (v, 0) to the coefficients (c, p)."""
        x = self._at
        P = np.column_stack((np.ones(len(x)), x))
        return np.asarray(np.linalg.inv(np.block([[cdist(x, x) ** 3, P], [P.T, np.zeros((3, 3))]])))

    def mended(self, v: np.ndarray, told: np.ndarray) -> np.ndarray:
        """v (T, lights used) with what is not told made up so that its coefficients are 0."""
        B = self._inverse[: len(self._at), : len(self._at)]
        v = v.copy()
        patterns, of = np.unique(told, axis=0, return_inverse=True)
        of = of.reshape(-1)
        for k, pattern in enumerate(patterns):
            if pattern.all():
                continue
            texels, missing = np.flatnonzero(of == k), ~pattern
            if np.count_nonzero(pattern) < 4:
                raise ArrayError(f"texel {texels[0]} is told of by {np.count_nonzero(pattern)} lights; four or more.")
            own = np.linalg.solve(B[np.ix_(missing, missing)], -B[np.ix_(missing, pattern)])
            v[np.ix_(texels, np.flatnonzero(missing))] = v[np.ix_(texels, np.flatnonzero(pattern))] @ own.T
        return v


def blended_slices(nodes: Sequence[FacetSlices], shares: Array, rho: Array, known: Array | None = None) -> np.ndarray:
    """Slices (T, rows, columns), float32, of texels between `nodes`, which have `shares` (T, nodes) of sum 1: NaN
    outside what the domains of all nodes hold. `rho`, `known` and errors as of `FacetSlices`."""
    values, b = to_numpy(rho), to_numpy(shares).astype(np.float32)
    told = None if known is None else to_numpy(known)
    count = len(nodes[0].lights)
    if values.ndim != 2 or values.shape[1] != count or (told is not None and told.shape != values.shape):
        raise ArrayError(f"rho has shape {values.shape}; (texels, {count}) is wanted, and the same of known.")
    if b.shape != (len(values), len(nodes)):
        raise ArrayError(f"shares have shape {b.shape}; {(len(values), len(nodes))} is wanted.")
    values = values if told is None else np.where(told, values, 0)
    require_finite(values, "rho")
    if values.size and values.min() < 0:
        t, k = np.unravel_index(int(values.argmin()), values.shape)
        raise ArrayError(f"rho[{t}, {k}] is {values[t, k]:g}; reflectance is not below 0: cut it there.")
    most = values.max(axis=1, keepdims=True).astype(np.float32)
    floor = _FLOOR * np.where(most > 0, most, 1)
    logs = np.log(values.astype(np.float32) + floor)
    where = np.logical_and.reduce([node.domain.confidence > 0 for node in nodes])
    found: np.ndarray = np.zeros((len(values), np.count_nonzero(where)), np.float32)
    for node, share in zip(nodes, b.T, strict=True):
        v = logs[:, node.used]
        if told is not None and not (of := told[:, node.used]).all():
            v = node.mended(v, of)
        kept = where[node.domain.confidence > 0]
        found += share[:, None] * (v @ node.weights[kept].T)
    slices = np.full((len(values), *where.shape), np.nan, np.float32)
    slices[:, where] = np.maximum(np.exp(np.minimum(found, np.log(_BEYOND * most + floor))) - floor, 0)
    return slices
