"""The facets that one view shows (MS 10, 12).

    i(h) = 2 (h.o) h - o                     the light that a facet reflects to the eye
    Omega = {h: i(h).n > 0}                  W(h) = sqrt(i(h).n) within, 0 outside: how far to trust what is found there

Lights that were there cover a part of it; what was never lit is not data. Not here: what facets reflect (`slices`).
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import Array, frozen, to_numpy
from ..brdf.polar_grid import PolarGrid
from ..directions import half_vector, lambert_map, require_unit
from ..errors import ArrayError, DirectionError

_GRAZING = 0.05  # of light, cosine: below it noise and Fresnel's rise are most of what there is
_FEWEST = 4  # lights: each has a third neighbour
_NEAR = 1.5  # times as far


@dataclasses.dataclass(frozen=True, eq=False)
class Domain:
    """What facets on a `grid` a view `wo` (3,), unit, local, shows: under lights from all over the hemisphere, or those
    that `lit` (rows, columns) marks."""

    grid: PolarGrid
    wo: Array
    lit: Array | None = None

    def __post_init__(self) -> None:
        wo = frozen(to_numpy(self.wo), np.dtype(np.float64))
        if wo.shape != (3,):
            raise ArrayError(f"Domain: wo has shape {wo.shape}; (3,) is wanted.")
        require_unit(wo, "wo")
        if wo[2] <= 0:
            raise DirectionError(f"Domain: wo = {wo.tolist()} is below the surface, from where nothing is seen.")
        object.__setattr__(self, "wo", wo)
        if self.lit is not None:
            lit = frozen(to_numpy(self.lit), np.dtype(bool))
            if lit.shape != self.grid.shape:
                raise ArrayError(f"Domain: lit has shape {lit.shape}; {self.grid.shape} is wanted.")
            object.__setattr__(self, "lit", lit)

    @classmethod
    def under(cls, grid: PolarGrid, wo: Array, lights: Array) -> Domain:
        """The same under `lights` (N, 3), unit, local: facets are lit whose half vector is near that of a light.

        Near is 1.5 times as far as the nearest half vector is from its own third neighbour, on Lambert's equal-area
        map: lamps of a plane are close together towards the horizon and far apart overhead.
        Raises `ArrayError` for fewer than four lights above the surface, `DirectionError` where they are not unit.
        """
        whole = cls(grid, wo)
        w = to_numpy(lights).astype(np.float64)
        if w.ndim != 2 or w.shape[1] != 3:
            raise ArrayError(f"lights have shape {w.shape}; (N, 3) is wanted.")
        require_unit(w, "lights")
        w = w[w[:, 2] > 0]
        if len(w) < _FEWEST:
            raise ArrayError(f"{len(w)} lights are above the surface; {_FEWEST} or more are wanted.")
        at = lambert_map(half_vector(w, whole.wo))
        apart = np.unique(at.round(9), axis=0)
        tree = cKDTree(apart)
        spacing = tree.query(apart, k=[min(len(apart), _FEWEST)])[0][:, 0]
        away, nearest = tree.query(lambert_map(grid.directions))
        return cls(grid, wo, away <= _NEAR * spacing[nearest])

    @functools.cached_property
    def cosines(self) -> np.ndarray:
        """h.o (rows, columns)."""
        cosines: np.ndarray = frozen(self.grid.directions @ self.wo)
        return cosines

    @functools.cached_property
    def lights(self) -> np.ndarray:
        """i (rows, columns, 3): from where light is reflected to the eye; below the surface outside Omega (MS 10)."""
        lights: np.ndarray = frozen(2 * self.cosines[..., None] * self.grid.directions - self.wo)
        return lights

    @functools.cached_property
    def confidence(self) -> np.ndarray:
        """W (rows, columns): the root of i.n within Omega, 0 outside (MS 12)."""
        W = np.sqrt(np.maximum(self.lights[..., 2], 0))
        W[(self.cosines <= 0) | (self.lights[..., 2] <= _GRAZING)] = 0
        if self.lit is not None:
            W[~self.lit] = 0
        confidence: np.ndarray = frozen(W)
        return confidence
