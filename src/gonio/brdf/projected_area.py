"""The area that facets of any distribution show to a direction, tabulated.

    g(w) = integral of (w.h)_+ D(h) d omega_h          (the denominator of MS 5)

g is the distribution blurred by a clamped cosine, hence smooth: a table of 65 x 64 directions, read linearly, is good
to 1e-3 of g wherever the quadrature over h resolves D.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from ..arrays import Array, floats, like, to_numpy

# The table's rows run from the pole to the horizon, both included, and crowd towards the horizon, where g of narrow
# distributions bends within their width: theta = pi/2 (1 - (1 - r)^2).
ROWS, COLUMNS = 97, 64


@dataclasses.dataclass(frozen=True, eq=False)
class AreaTable:
    """`values` (ROWS, COLUMNS) of g; called with unit local directions (..., 3), it answers g (...)."""

    values: np.ndarray

    @classmethod
    def of(cls, D: Callable[[Array], Array], rings: int = 192, spokes: int = 128) -> AreaTable:
        """The table of the density `D`, by quadrature over `rings` x `spokes` facet normals crowded at the pole."""
        t, weight = np.polynomial.legendre.leggauss(rings)
        # theta = pi/2 ((1 + t) / 2)^3: the finest distributions have their facets within a few degrees of n.
        t = 0.5 * (1 + t)
        theta, weight = 0.5 * np.pi * t**3, 0.5 * weight * 1.5 * np.pi * t**2 * np.sin(0.5 * np.pi * t**3)
        phi = 2 * np.pi * (np.arange(spokes) + 0.5) / spokes
        h = _directions(theta, phi)
        mass = to_numpy(D(h)).reshape(rings, spokes) * weight[:, None] * (2 * np.pi / spokes)
        rows = np.linspace(0, 1, ROWS)
        w = _directions(0.5 * np.pi * (1 - (1 - rows) ** 2), 2 * np.pi * np.arange(COLUMNS) / COLUMNS)
        values = np.empty(len(w))
        for k in range(0, len(w), COLUMNS):
            values[k : k + COLUMNS] = np.maximum(w[k : k + COLUMNS] @ h.T, 0) @ mass.ravel()
        return cls(values.reshape(ROWS, COLUMNS))

    def __call__(self, w: Array) -> Array:
        """g (...), at unit local directions `w` (..., 3); below the horizon its value there."""
        xp, w = floats(w)
        elevation = xp.clip(xp.atan2(w[..., 2], xp.hypot(w[..., 0], w[..., 1])), 0.0, None)
        row = (ROWS - 1) * (1 - xp.sqrt(elevation / (0.5 * math.pi)))
        column = xp.atan2(w[..., 1], w[..., 0]) * (COLUMNS / (2 * math.pi))
        column = xp.where(column < 0, column + COLUMNS, column)
        r, c = xp.clip(xp.floor(row), 0, ROWS - 2), xp.floor(column)
        x, y = row - r, column - c
        r, c = xp.astype(r, xp.int64), xp.astype(c, xp.int64) % COLUMNS
        beside = (c + 1) % COLUMNS
        table = xp.reshape(like(self.values, w), (-1,))
        upper = (1 - y) * table[r * COLUMNS + c] + y * table[r * COLUMNS + beside]
        r = r + 1
        lower = (1 - y) * table[r * COLUMNS + c] + y * table[r * COLUMNS + beside]
        return (1 - x) * upper + x * lower


def _directions(theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
    theta, phi = np.meshgrid(theta, phi, indexing="ij")
    s = np.sin(theta)
    return np.stack((s * np.cos(phi), s * np.sin(phi), np.cos(theta)), axis=-1).reshape(-1, 3)
