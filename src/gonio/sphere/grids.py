"""Grids on the sphere with quadrature weights: rows of equal theta, columns of equal phi.

    integral of f over the sphere = sum over rows r and columns c of weights[r] f(theta_r, phi_c)

    LatLong         theta_r = (r + 1/2) pi / rows: the pixel centres of a lat-long map; weights of Fejer's first rule,
                    w_r = 2 pi / columns * 2 / rows * (1 - 2 sum_{k=1}^{rows/2} cos(2 k theta_r) / (4 k^2 - 1)),
                    exact for polynomials of degree < rows
    GaussLegendre   cos theta_r the roots of P_rows: exact for polynomials of degree < 2 rows, from half the rows

On both row 0 is the one nearest +z and phi_c = (c + 1/2) 2 pi / columns. Layouts of environment maps other than
lat-long are no quadrature grids and stand with the lights.
"""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from functools import cached_property

import numpy as np

from ..directions import from_spherical
from ..errors import ParameterError


class Grid(ABC):
    """Samples at every pair of a row's theta and a column's phi; arrays are float64 and read-only."""

    rows: int
    columns: int

    @property
    @abstractmethod
    def theta(self) -> np.ndarray:
        """Polar angle of each row, (rows,), ascending in (0, pi), the same seen from either pole."""

    @property
    @abstractmethod
    def weights(self) -> np.ndarray:
        """Solid angle that one sample of each row stands for, (rows,), in sr; over all samples they sum to 4 pi."""

    @property
    @abstractmethod
    def highest_degree(self) -> int:
        """The highest degree to which `analysis` recovers every band-limited function exactly."""

    @cached_property
    def phi(self) -> np.ndarray:
        """Azimuth of each column, (columns,), in (0, 2 pi)."""
        return _read_only((np.arange(self.columns) + 0.5) * (2 * math.pi / self.columns))

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.rows, self.columns

    def directions(self) -> np.ndarray:
        """Unit directions of the samples, (rows, columns, 3)."""
        directions: np.ndarray = from_spherical(self.theta[:, None], self.phi[None, :])
        return directions


@dataclasses.dataclass(frozen=True)
class LatLong(Grid):
    """The pixel centres of a lat-long map with `rows` x `columns` pixels."""

    rows: int
    columns: int

    def __post_init__(self) -> None:
        _require_count(self, "rows", self.rows, 1)
        _require_count(self, "columns", self.columns, 1)

    @cached_property
    def theta(self) -> np.ndarray:
        """Polar angle of each row, (rows,): (r + 1/2) pi / rows."""
        return _read_only((np.arange(self.rows) + 0.5) * (math.pi / self.rows))

    @cached_property
    def weights(self) -> np.ndarray:
        """Fejer's weights, (rows,), in sr, all positive."""
        spectrum = np.zeros(self.rows)
        k = np.arange((self.rows + 1) // 2)
        spectrum[2 * k] = 2 / (1 - 4.0 * k * k)
        spectrum[0] = 1.0
        # The sum of cosines at the pixel centres is a discrete cosine transform; as an FFT it needs no extra import.
        twist = np.exp(0.5j * math.pi * np.arange(self.rows) / self.rows)
        series = np.fft.ifft(spectrum * twist, 2 * self.rows).real[: self.rows] * (2 * self.rows)
        return _read_only(series * (2 / self.rows) * (2 * math.pi / self.columns))

    @property
    def highest_degree(self) -> int:
        """min(rows - 1, (columns - 1) // 2): as many degrees as the samples can tell apart."""
        return min(self.rows - 1, (self.columns - 1) // 2)


@dataclasses.dataclass(frozen=True)
class GaussLegendre(Grid):
    """The smallest grid that carries `degree`: degree + 1 rows, 2 degree + 2 columns."""

    degree: int

    def __post_init__(self) -> None:
        _require_count(self, "degree", self.degree, 0)

    @property
    def rows(self) -> int:  # type: ignore[override]
        """degree + 1."""
        return self.degree + 1

    @property
    def columns(self) -> int:  # type: ignore[override]
        """2 degree + 2."""
        return 2 * self.degree + 2

    @cached_property
    def theta(self) -> np.ndarray:
        """Polar angle of each row, (rows,)."""
        n = self.rows
        theta = (np.arange(n) + 0.75) * (math.pi / (n + 0.5))
        for _ in range(4):  # Newton's steps from a guess good to 1 / n^2
            value, slope = _legendre(n, theta)
            theta = theta - value / slope
        return _read_only(theta)

    @cached_property
    def weights(self) -> np.ndarray:
        """Gauss's weights, (rows,), in sr, all positive."""
        _, slope = _legendre(self.rows, self.theta)
        return _read_only(2 / slope**2 * (2 * math.pi / self.columns))

    @property
    def highest_degree(self) -> int:
        """The degree the grid was made for."""
        return self.degree


def _legendre(n: int, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """P_n(cos theta) and its derivative by theta.

    Recursion on the differences P_{l+1} - P_l (Reinsch): with cos theta itself the digits that separate the rows near
    a pole would be lost, and the rule would be good to 1e-11 only.
    """
    mirrored = theta > math.pi / 2
    small = np.where(mirrored, math.pi - theta, theta)
    depth = 2 * np.sin(small / 2) ** 2
    before, value, step = np.ones_like(theta), np.ones_like(theta), np.zeros_like(theta)
    for l in range(n):
        step = (l * step - (2 * l + 1) * depth * value) / (l + 1)
        before, value = value, value + step
    slope = -n * (before - np.cos(small) * value) / np.sin(small)
    sign = np.where(mirrored, (-1) ** n, 1)
    return sign * value, np.where(mirrored, -sign, sign) * slope


def _read_only(x: np.ndarray) -> np.ndarray:
    x.flags.writeable = False
    return x


def _require_count(grid: Grid, name: str, count: int, low: int) -> None:
    if not isinstance(count, int | np.integer) or isinstance(count, bool) or count < low:
        raise ParameterError(f"{type(grid).__name__}: {name} = {count!r} is not an integer of {low} or more.")
