"""A polar grid over the hemisphere: where distributions of facet normals are tabulated (MS 3).

    theta_r = pi/2 (r/(R - 1))^warp,  r = 0 .. R - 1,     phi_c = 2 pi c/C                 the knots (R rows, C columns)
    integral of f d omega ~ sum over knots of w_r f_rc,   w_r = 2 pi/C times the integral of the row's hat in r

exact for what is bilinear in (r, c). Rows crowd towards the pole with `warp`; the pole stands C times. A turn about
the normal is a shift of the columns.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable

import numpy as np

from ..arrays import frozen
from ..directions import from_spherical
from ..errors import ParameterError


@dataclasses.dataclass(frozen=True)
class PolarGrid:
    """`rows` >= 2 of theta, pole first and horizon last, `columns` >= 3 of phi; `warp` in [1, 4].

    32 x 96 serves cloth and wood, 96 x 256 brushed metal.
    """

    rows: int = 32
    columns: int = 96
    warp: float = 1.5

    def __post_init__(self) -> None:
        if self.rows < 2 or self.columns < 3:
            raise ParameterError(
                f"PolarGrid: {self.rows} x {self.columns}; 2 or more rows of theta and 3 or more columns of phi."
            )
        if not 1 <= self.warp <= 4:
            raise ParameterError(f"PolarGrid: warp = {self.warp:g} lies outside [1, 4].")

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.rows, self.columns

    @functools.cached_property
    def theta(self) -> np.ndarray:
        """(rows,), radians."""
        theta: np.ndarray = frozen(math.pi / 2 * np.linspace(0, 1, self.rows) ** self.warp)
        return theta

    @functools.cached_property
    def phi(self) -> np.ndarray:
        """(columns,), radians."""
        phi: np.ndarray = frozen(2 * math.pi * np.arange(self.columns) / self.columns)
        return phi

    @functools.cached_property
    def directions(self) -> np.ndarray:
        """(rows, columns, 3), unit, local; those of the last row lie in the plane."""
        directions: np.ndarray = frozen(from_spherical(self.theta[:, None], self.phi))
        return directions

    @functools.cached_property
    def solid_angles(self) -> np.ndarray:
        """w (rows,) of each knot of a row, in sr."""
        solid: np.ndarray = frozen(self.integrals(np.sin))
        return solid

    @functools.cached_property
    def projected(self) -> np.ndarray:
        """The same of (n.h): what D is integrated with (rows,)."""
        projected: np.ndarray = frozen(self.integrals(lambda theta: np.sin(2 * theta) / 2))
        return projected

    def integrals(self, density: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """(rows,): each row's hat times density(theta) d theta, times 2 pi/columns, by Gauss quadrature of 16 points
        between two rows."""
        x, w = np.polynomial.legendre.leggauss(16)
        part, w = 0.5 * (1 + x), 0.5 * w
        s = (np.arange(self.rows - 1)[:, None] + part) / (self.rows - 1)
        # d theta = pi/2 warp s^(warp - 1) ds
        slope = math.pi / 2 * self.warp / (self.rows - 1) * s ** (self.warp - 1)
        values = density(math.pi / 2 * s**self.warp) * slope * w * (2 * math.pi / self.columns)
        weights = np.zeros(self.rows)
        weights[:-1] += (values * (1 - part)).sum(axis=1)
        weights[1:] += (values * part).sum(axis=1)
        return weights
