"""Slices of reflectance on a grid of facets, from what lights showed: one operator for all texels (MS 8, 5.1).

    s(x) = p(x) + sum_k c_k |x - x_k|^3,    s(x_k) = v_k          x: half vectors on Lambert's map; p linear
    v = sqrt(rho)                                                 highlights span decades, and their roots far less

s is linear in v: at the knots of a domain s = W v, with W (knots, lights) the same for all texels under the same
lights. Where some lights tell nothing of a texel (clipped, shaded), their v are those that make their c_k 0: then s is
what the others alone determine.

Only knots that the domain holds are filled: push and pull, or any surface, goes on beyond the lights, and what it finds
there is no data.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from scipy.spatial.distance import cdist

from ..arrays import Array, frozen, require_finite, to_numpy
from ..directions import half_vector, lambert_map, require_unit
from ..errors import ArrayError
from .facet_domain import Domain

_APART = 1e-6  # on the map: nearer lights are one


@dataclasses.dataclass(frozen=True, eq=False)
class FacetSlices:
    """From reflectance under `lights` (N, 3), unit, local, all above the surface, to the knots of `domain`.

    Raises `ArrayError` for fewer than four lights, two at one place, or all on a line; `DirectionError` where they are
    not unit.
    """

    domain: Domain
    lights: Array

    def __post_init__(self) -> None:
        w = frozen(to_numpy(self.lights), np.dtype(np.float64))
        if w.ndim != 2 or w.shape[1] != 3 or len(w) < 4:
            raise ArrayError(f"FacetSlices: lights have shape {w.shape}; (N, 3), N >= 4, is wanted.")
        require_unit(w, "lights")
        if w[:, 2].min() <= 0:
            raise ArrayError(f"FacetSlices: lights[{int(w[:, 2].argmin())}] is below the surface; leave it out.")
        object.__setattr__(self, "lights", w)
        at = self._at
        near = cdist(at, at) + np.eye(len(at))
        if near.min() < _APART:
            i, j = np.unravel_index(int(near.argmin()), near.shape)
            raise ArrayError(f"FacetSlices: lights {i} and {j} are at one place; average what they show.")
        if np.linalg.matrix_rank(at - at.mean(axis=0), tol=_APART) < 2:
            raise ArrayError("FacetSlices: all lights are on a line: they tell nothing of what lies beside it.")

    def __call__(self, rho: Array, known: Array | None = None) -> np.ndarray:
        """Slices (T, rows, columns), float32, NaN outside the domain, from `rho` (T, N) >= 0, where `known` (T, N).

        Raises `ArrayError` for shapes that do not fit, values that are not finite or below 0 where known, and texels of
        which fewer than four lights tell.
        """
        v, told = to_numpy(rho), None if known is None else to_numpy(known)
        count = len(self.lights)
        if v.ndim != 2 or v.shape[1] != count or (told is not None and told.shape != v.shape):
            raise ArrayError(f"rho has shape {v.shape}; (texels, {count}) is wanted, and the same of known.")
        v = v if told is None else np.where(told, v, 0)
        require_finite(v, "rho")
        if v.size and v.min() < 0:
            t, k = np.unravel_index(int(v.argmin()), v.shape)
            raise ArrayError(f"rho[{t}, {k}] is {v[t, k]:g}; reflectance is not below 0: cut it there.")
        v = np.sqrt(v, dtype=np.float32)
        if told is not None and not told.all():
            v = self._mended(v, told)
        where = self.domain.confidence > 0
        slices = np.full((len(v), *where.shape), np.nan, np.float32)
        slices[:, where] = np.maximum(v @ self.weights.T, 0) ** 2
        return slices

    @functools.cached_property
    def weights(self) -> np.ndarray:
        """W (knots, N), float32, of the knots of the domain along its rows."""
        x = lambert_map(self.domain.grid.directions[self.domain.confidence > 0])
        basis = np.column_stack((cdist(x, self._at) ** 3, np.ones(len(x)), x))
        W: np.ndarray = frozen(basis @ self._inverse[:, : len(self._at)], np.dtype(np.float32))
        return W

    @functools.cached_property
    def _at(self) -> np.ndarray:
        return np.asarray(lambert_map(half_vector(self.lights, self.domain.wo)))

    @functools.cached_property
    def _inverse(self) -> np.ndarray:
        """From (v, 0) to the coefficients (c, p)."""
        x = self._at
        P = np.column_stack((np.ones(len(x)), x))
        return np.asarray(np.linalg.inv(np.block([[cdist(x, x) ** 3, P], [P.T, np.zeros((3, 3))]])))

    def _mended(self, v: np.ndarray, told: np.ndarray) -> np.ndarray:
        """v with what is not told made up so that its coefficients are 0: patterns of what is told, one by one."""
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
