"""The area that facets of any distribution show to a direction, tabulated.

    g(w) = integral of (w.h)_+ D(h) d omega_h          (the denominator of MS 5)

g is the distribution blurred by a clamped cosine, hence smooth: a table of 97 x 128 directions, read linearly, is good
to 4e-4 of g in the mean and 5e-3 towards the horizon, for slopes as narrow as .02. On rings of equal theta the integral
over azimuth is a circular correlation, done by FFT.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from ..arrays import Array, floats, like, to_numpy

# The table's rows run from the pole to the horizon, both included, and crowd towards the horizon, where g of narrow
# distributions bends within their width: theta = pi/2 (1 - (1 - r)^2).
ROWS, COLUMNS = 97, 128


@dataclasses.dataclass(frozen=True, eq=False)
class AreaTable:
    """`values` (ROWS, COLUMNS) of g; called with unit local directions (..., 3), it answers g (...)."""

    values: np.ndarray

    @classmethod
    def of(cls, D: Callable[[Array], Array], rings: int = 192) -> AreaTable:
        """The table of the density `D` by quadrature over `rings` x COLUMNS facet normals, crowded at the pole."""
        t, weight = np.polynomial.legendre.leggauss(rings)
        # theta = pi/2 ((1 + t) / 2)^3: the finest distributions have their facets within a few degrees of n.
        t = 0.5 * (1 + t)
        theta = 0.5 * np.pi * t**3
        solid = 0.5 * weight * 1.5 * np.pi * t**2 * np.sin(theta) * (2 * np.pi / COLUMNS)
        phi = 2 * np.pi * np.arange(COLUMNS) / COLUMNS
        s = np.sin(theta)[:, None]
        h = np.stack((s * np.cos(phi), s * np.sin(phi), np.broadcast_to(np.cos(theta)[:, None], (rings, COLUMNS))), -1)
        mass = np.fft.rfft(to_numpy(D(h)) * solid[:, None])
        values = np.empty((ROWS, COLUMNS))
        for k, r in enumerate(np.linspace(0, 1, ROWS)):
            view = 0.5 * np.pi * (1 - (1 - r) ** 2)
            facing = np.cos(view) * np.cos(theta)[:, None] + np.sin(view) * s * np.cos(phi)
            values[k] = np.fft.irfft((np.fft.rfft(np.maximum(facing, 0)) * mass).sum(axis=0), COLUMNS)
        return cls(values)

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
