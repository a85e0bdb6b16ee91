"""The areas that very many tabulated distributions show to the same directions, by spherical harmonics.

    g(k) = integral of (h.k)_+ D(h) d omega_h = sum over l, m of A_l D_lm Y_lm(k)                       (MS 5, RH 2.62)
    D_lm = integral over the upper hemisphere of D Y_lm d omega

A_l of the clamped cosine (RH 3.32) is 0 for odd l > 1 and falls as l^(-5/2): l = 0, 1 and the even l suffice, 48
numbers to degree 8 and 94 to degree 12. Below 80 degrees that leaves, relative rms,

    degree 8: .0003-.0009 for cloth (slopes of .3 and more), .005 for brushed metal (.05 by .20); 12: .0001-.0003, .002

and towards the horizon, where g of metal is as small as its slopes are narrow, up to .03 and .02 of what n sees. What
is left out may bring g of metal some hundredths below cos theta, which it is not: who divides by it takes the greater.
One distribution by direct quadrature: `projected_area.py`.
"""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np

from ..arrays import Array, floats, frozen, like, namespace, to_numpy
from ..directions import from_spherical
from ..errors import ArrayError, ParameterError
from ..sphere.harmonics import degrees_and_orders, harmonics, index, require_degree
from ..sphere.zonal import clamped_cosine
from .polar_grid import PolarGrid

# Of a ring: a parabola through the greatest of so many values meets the ring's greatest to 2e-4 of it for cloth and
# metal, 7e-4 for noise from knot to knot.
_AZIMUTHS = 24


@dataclasses.dataclass(frozen=True)
class FacetAreas:
    """Of distributions on `grid`, to an even `degree`: 8 for cloth and wood, 12 for metal.

    NumPy or what `arrays.py` knows; the floating dtype of the input is kept, and NaN stay with the table they are in.
    Raises `ParameterError` where the degree is odd or below 2, or too high for the grid's columns.
    """

    grid: PolarGrid
    degree: int = 8

    def __post_init__(self) -> None:
        require_degree(self.degree)
        if self.degree % 2 or self.degree < 2:
            raise ParameterError(f"FacetAreas: degree = {self.degree}; it is even, 2 or more: A_l of odd l > 1 is 0.")
        if self.grid.columns <= 2 * self.degree:
            raise ParameterError(
                f"FacetAreas: {self.grid.columns} columns do not tell the orders to degree {self.degree} apart; "
                f"take {2 * self.degree + 1} columns or more, or degree {(self.grid.columns - 1) // 4 * 2} at most."
            )

    @property
    def kept(self) -> np.ndarray:
        """(n,): where the coefficients stand among all those to `degree`, l(l + 1) + m ascending."""
        return _kept(self.degree)

    def coefficients(self, tables: Array) -> Array:
        """A_l D_lm (..., n) of D at the knots, `tables` (..., rows, columns), linear in r between.

        Linear in the tables; of real harmonics, those that `kept` names. Beside the tables (12 KiB each as 32 x 96
        float32) this takes rows (2 degree + 1) + n numbers a table: 2.3 KiB at degree 8, 3.5 KiB at 12. Blocks of 64
        to 4,096 tables serve. Raises `ArrayError` for tables of another shape than the grid's.
        """
        xp, tables = floats(tables)
        if tables.ndim < 2 or tuple(tables.shape[-2:]) != self.grid.shape:
            raise ArrayError(
                f"tables have shape {tuple(tables.shape)}; the grid's are (..., rows, columns) = (..., "
                f"{self.grid.rows}, {self.grid.columns}). Resample them, or take the grid that they are on."
            )
        azimuthal, polar = _analysis(self.grid, self.degree)
        # Orders first: half the products of one matrix from knots to coefficients, three quarters of its time.
        waves = xp.reshape(tables, (-1, self.grid.columns)) @ like(azimuthal, tables)
        found = xp.reshape(waves, (-1, polar.shape[0])) @ like(polar, tables)
        return xp.reshape(found, (*tables.shape[:-2], polar.shape[1]))

    @property
    def of_knots(self) -> np.ndarray:
        """(rows, columns, n), float32: what a table of 1 at one knot and 0 elsewhere has for `coefficients`."""
        return _of_knots(self.grid, self.degree)

    def areas(self, coefficients: Array, directions: Array) -> Array:
        """g (..., K) from `coefficients` (..., n) at unit local `directions` (K, 3), the same for all.

        Linear in the coefficients. Directions below the horizon are answered too; no gradient reaches them. Takes K
        numbers a table. Raises `ArrayError` for other shapes, `DirectionError` where a direction is not unit.
        """
        _, coefficients = floats(coefficients)
        if coefficients.ndim < 1 or coefficients.shape[-1] != self.kept.size:
            raise ArrayError(
                f"coefficients have shape {tuple(coefficients.shape)}; degree {self.degree} has (..., "
                f"{self.kept.size}) of them, as `coefficients` makes them."
            )
        w = np.ascontiguousarray(to_numpy(directions), dtype=np.float64)
        if w.ndim != 2 or w.shape[-1] != 3:
            raise ArrayError(f"directions have shape {w.shape}; (K, 3) is wanted, the same for all tables.")
        values: Array = coefficients @ like(_synthesis(self.degree, w.tobytes()), coefficients)
        return values

    def turned_least(self, coefficients: Array, cos_theta: Array) -> Array:
        """g (..., K) where the surface is turned so that shadowing S = cos theta / g is least, at `cos_theta` (K,).

        The greatest g of the ring at each theta, from `coefficients` (..., n): MS 5.1 takes it all around while D is
        known over a part only. A parabola through the greatest of 24 azimuths and its neighbours, good to 2e-4. Takes
        24 K numbers a table and some 5 K more; g is smooth, and few rings serve many directions. Raises
        `ParameterError` for a cosine outside [-1, 1], `ArrayError` for other shapes.
        """
        cosine = np.asarray(to_numpy(cos_theta), dtype=np.float64)
        if cosine.ndim != 1:
            raise ArrayError(f"cos_theta has shape {cosine.shape}; (K,) is wanted, the same rings for all tables.")
        if not np.all(np.abs(cosine) <= 1 + 1e-6):  # float32 rounds unit vectors so far
            raise ParameterError("cos_theta lies outside [-1, 1]; it is the cosine of the angle to the normal.")
        phi = 2 * math.pi / _AZIMUTHS * np.arange(_AZIMUTHS)
        rings = from_spherical(np.arccos(np.clip(cosine, -1, 1))[:, None], phi).reshape(-1, 3)
        g = self.areas(coefficients, rings)
        xp = namespace(g)
        g = xp.reshape(g, (*g.shape[:-1], cosine.size, _AZIMUTHS))
        at = xp.argmax(g, axis=-1, keepdims=True)
        before, peak, after = (xp.take_along_axis(g, (at + k) % _AZIMUTHS, axis=-1)[..., 0] for k in (-1, 0, 1))
        slope, bend = after - before, 2 * peak - before - after
        # bend >= abs(slope), so that nothing is blown up where the ring is flat.
        return peak + slope * slope / (8 * xp.where(bend > 0, bend, xp.ones_like(bend)))


@functools.lru_cache(maxsize=8)
def _kept(degree: int) -> np.ndarray:
    l, _ = degrees_and_orders(degree)
    places: np.ndarray = frozen(np.flatnonzero((l == 1) | (l % 2 == 0)), np.int64)
    return places


@functools.lru_cache(maxsize=2)
def _of_knots(grid: PolarGrid, degree: int) -> np.ndarray:
    azimuthal, polar = _analysis(grid, degree)
    of_orders = polar.reshape(grid.rows, azimuthal.shape[1], -1)
    knots: np.ndarray = frozen(np.einsum("cm,rmn->rcn", azimuthal, of_orders), np.dtype(np.float32))
    return knots


@functools.lru_cache(maxsize=8)
def _analysis(grid: PolarGrid, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """From columns to orders, (columns, 2 degree + 1), and from rows of orders to A_l D_lm, (rows (2 degree + 1), n).

    The first is sin(abs(m) phi), 1, cos(m phi), m ascending; the second integrates each row's hat against the theta
    factor of Y_lm. With the plain weights of the knots cloth at degree 12 would have three to four times the error.
    """
    m = np.arange(-degree, degree + 1)
    angle = grid.phi[:, None] * np.abs(m)
    azimuthal = np.where(m < 0, np.sin(angle), np.cos(angle))
    A = clamped_cosine(degree)
    l, m = (x[_kept(degree)] for x in degrees_and_orders(degree))
    polar = np.zeros((grid.rows, 2 * degree + 1, l.size))
    for n, (degree_n, order) in enumerate(zip(l.tolist(), m.tolist(), strict=True)):
        if order >= 0:
            row = A[degree_n] * _row_integrals(grid, degree_n, order)
            polar[:, degree + order, n] = polar[:, degree - order, n - 2 * order] = row
    return frozen(azimuthal), frozen(polar.reshape(-1, l.size))


def _row_integrals(grid: PolarGrid, l: int, m: int) -> np.ndarray:
    """Of each row's hat times Y_lm(theta, 0) d omega, (rows,), for one knot of the row; m >= 0."""
    place = index(l, m)
    return grid.integrals(lambda theta: np.sin(theta) * harmonics(l, from_spherical(theta, 0.0))[..., place])


@functools.lru_cache(maxsize=8)
def _synthesis(degree: int, directions: bytes) -> np.ndarray:
    """Y_lm (n, K) of those kept at `directions`, float64 (K, 3)."""
    w = np.frombuffer(directions).reshape(-1, 3)
    values: np.ndarray = frozen(harmonics(degree, w)[:, _kept(degree)].T)
    return values
