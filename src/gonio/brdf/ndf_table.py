"""A distribution of facet normals tabulated on a polar grid: what microfacet synthesis measures (MS 3).

    integral of (n.h) D(h) d omega_h = 1

D is bilinear in (r, c) of a `PolarGrid`, periodic in c. Rows crowd towards the pole with `warp`, where facets are: at
32 x 96 knots it cuts the rms error of brushed metal (GGX .05 by .20) from 7 % to 2 %.
h is drawn in proportion to (n.h) D', D' the interpolant of the same knots that is bilinear in (sin^2 theta, phi), whose
distribution inverts in closed form. Not here: the fit of D to photographs.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import Any, ClassVar

import numpy as np

from ..arrays import Array, floats, like, to_numpy
from ..directions import from_spherical, spherical
from ..errors import ParameterError
from .model import Bounds
from .ndf import NDF
from .polar_grid import PolarGrid


@dataclasses.dataclass(frozen=True, eq=False)
class TabulatedNDF(NDF):
    """`values` (R, C) of D >= 0 in 1/sr at the knots, pole first and horizon last; `warp` in [1, 4].

    Nothing is rescaled when made: `mass` tells the integral, which is 1 for facets that cover the ground, and
    `normalised` divides by it. Raises `ParameterError` for fewer than 2 rows or 3 columns, negative values or NaN.
    """

    values: Array
    warp: float = 1.5

    bounds: ClassVar[dict[str, Bounds]] = {"values": Bounds(0.0, 1e30, own=2)}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.values.ndim != 2:
            raise ParameterError(
                f"TabulatedNDF: values has shape {tuple(self.values.shape)}; (rows, columns) is wanted."
            )
        self.grid  # noqa: B018  (refuses what is no grid)

    @functools.cached_property
    def grid(self) -> PolarGrid:
        """The knots."""
        rows, columns = self.values.shape
        return PolarGrid(int(rows), int(columns), float(self.warp))

    @classmethod
    def of(cls, ndf: NDF, shape: tuple[int, int] = (96, 256), warp: float = 1.5) -> TabulatedNDF:
        """`ndf` sampled at the knots of a table of `shape` (rows, columns), and normalised.

        Raises `ParameterError` where the parameters of `ndf` vary from site to site.
        """
        grid = PolarGrid(*shape, warp)
        theta = grid.theta.copy()
        theta[-1] -= 1e-9  # D of the models ends at the horizon, where the table wants the value that it tends to
        values = to_numpy(ndf.D(from_spherical(theta[:, None], grid.phi)))
        if values.shape != tuple(shape):
            raise ParameterError(f"D has shape {values.shape}; a table holds one distribution, not one for each site.")
        return cls(values, warp).normalised()

    @property
    def mass(self) -> Array:
        """The integral of (n.h) D of the interpolant: a 0-d array."""
        xp, values = floats(self.values)
        return xp.sum(xp.sum(values, axis=1) * like(self.grid.projected, values))

    def normalised(self) -> TabulatedNDF:
        """The table with `mass` 1. Raises `ParameterError` where all values are zero."""
        mass = self.mass
        if not bool(mass > 0):
            raise ParameterError("TabulatedNDF: values are zero throughout: there are no facets to normalise.")
        return dataclasses.replace(self, values=self.values / mass)

    def turned(self, angle: float) -> TabulatedNDF:
        """The facets turned about the normal by `angle` radians, from s towards t.

        A multiple of 2 pi/C shifts the columns and is exact; between two shifts the table is mixed linearly.
        """
        columns = self.values.shape[1]
        shift = angle * columns / (2 * math.pi)
        whole = math.floor(shift)
        part = shift - whole
        xp, values = floats(self.values)
        near, far = xp.roll(values, whole, axis=1), xp.roll(values, whole + 1, axis=1)
        return dataclasses.replace(self, values=(1 - part) * near + part * far)

    def D(self, h: Array) -> Array:
        xp, h = floats(h)
        theta, phi = spherical(h)
        rows, _ = self.values.shape
        row = (xp.clip(theta * (2 / math.pi), 0.0, 1.0) ** (1 / self.warp)) * (rows - 1)
        r = xp.clip(xp.floor(row), 0.0, rows - 2.0)
        value = self._mixed(xp, r, row - r, phi)
        return xp.where(h[..., 2] > 0, value, xp.zeros_like(value))

    def pdf(self, h: Array, wo: Array) -> Array:
        """The density of `sample` in 1/sr: (..., 3), (..., 3) -> (...); it does not depend on `wo`."""
        xp, h, wo = floats(h, wo)
        theta, phi = spherical(h)
        rows, _ = self.values.shape
        r = xp.floor(xp.clip(theta * (2 / math.pi), 0.0, 1.0) ** (1 / self.warp) * (rows - 1))
        r = xp.clip(r, 0.0, rows - 2.0)
        q = like(self._sampler.q, h)
        k = xp.astype(r, xp.int64)
        low, high = q[k], q[k + 1]
        part = xp.clip((xp.sin(theta) ** 2 - low) / (high - low), 0.0, 1.0)
        value = self._mixed(xp, r, part, phi) * xp.clip(h[..., 2], 0.0, None) / self._sampler.mass
        return value + xp.zeros_like(wo[..., 2])

    def sample(self, wo: Array, u: Array) -> Array:
        xp, wo, u = floats(wo, u)
        s, (_, columns) = self._sampler, self.values.shape
        running = like(s.marginal, u)
        goal = u[..., 0] * running[-1]
        r = _bracket(xp, lambda k: running[k], len(s.q) - 1, goal)
        means, q = like(s.means, u), like(s.q, u)
        width = q[r + 1] - q[r]
        part = _place(xp, (goal - running[r]) / width, means[r], means[r + 1])
        sums = xp.reshape(like(s.conditional, u), (-1,))

        def before(c: Array) -> Array:
            at = r * (columns + 1) + c
            return (1 - part) * sums[at] + part * sums[at + columns + 1]

        goal = u[..., 1] * before(xp.full_like(r, columns))
        c = _bracket(xp, before, columns, goal)
        values = xp.reshape(like(self.values, u), (-1,))

        def edge(c: Array) -> Array:
            at = r * columns + c % columns
            return (1 - part) * values[at] + part * values[at + columns]

        turn = (xp.astype(c, u.dtype) + _place(xp, goal - before(c), edge(c), edge(c + 1))) * (2 * math.pi / columns)
        square = q[r] + part * width
        sine = xp.sqrt(square)
        up = xp.sqrt(xp.clip(1 - square, 0.0, None))
        return xp.stack((sine * xp.cos(turn), sine * xp.sin(turn), up), axis=-1) + xp.zeros_like(wo)

    def _mixed(self, xp: Any, r: Array, part: Array, phi: Array) -> Array:
        """Between rows r and r + 1 at `part`, linear in phi."""
        _, columns = self.values.shape
        column = phi * (columns / (2 * math.pi))
        c = xp.clip(xp.floor(column), 0.0, columns - 1.0)
        fraction = column - c
        c = xp.astype(c, xp.int64)
        at, beside = xp.astype(r, xp.int64) * columns, (c + 1) % columns
        values = xp.reshape(like(self.values, phi), (-1,))
        upper = (1 - fraction) * values[at + c] + fraction * values[at + beside]
        lower = (1 - fraction) * values[at + columns + c] + fraction * values[at + columns + beside]
        return (1 - part) * upper + part * lower

    @functools.cached_property
    def _sampler(self) -> _Sampler:
        values = to_numpy(self.values).astype(np.float64)
        rows, _ = values.shape
        q = np.sin(self.grid.theta) ** 2
        means = values.mean(axis=1)
        marginal = np.append(0.0, np.cumsum(np.diff(q) * 0.5 * (means[1:] + means[:-1])))
        if not marginal[-1] > 0:
            raise ParameterError("TabulatedNDF: values are zero throughout: there are no facets to draw.")
        steps = 0.5 * (values + np.roll(values, -1, axis=1))
        conditional = np.concatenate((np.zeros((rows, 1)), np.cumsum(steps, axis=1)), axis=1)
        # d omega (n.h) = dq dphi / 2
        return _Sampler(q, means, marginal, conditional, math.pi * float(marginal[-1]))


@dataclasses.dataclass(frozen=True, eq=False)
class _Sampler:
    q: np.ndarray  # (R,) sin^2 theta of the rows
    means: np.ndarray  # (R,) of D along each row
    marginal: np.ndarray  # (R,) the integral over q up to each row
    conditional: np.ndarray  # (R, C + 1) the sum along each row up to each column
    mass: float  # the integral of (n.h) D'


def _bracket(xp: Any, running: Any, n: int, goal: Array) -> Array:
    """The largest k in [0, n - 1] with running(k) <= goal, for a rising function of whole numbers."""
    low = xp.zeros_like(goal, dtype=xp.int64)
    high = xp.full_like(low, n)
    for _ in range(max(n - 1, 1).bit_length()):
        middle = (low + high) // 2
        right = running(middle) <= goal
        low, high = xp.where(right, middle, low), xp.where(right, high, middle)
    return xp.clip(low, 0, n - 1)


def _place(xp: Any, area: Array, a: Array, b: Array) -> Array:
    """The f in [0, 1] at which the line from a to b over the unit interval has gathered `area`."""
    root = a + xp.sqrt(xp.clip(a * a + 2 * area * (b - a), 0.0, None))
    dark = root <= 0
    return xp.clip(xp.where(dark, 0.5, 2 * area / xp.where(dark, xp.ones_like(root), root)), 0.0, 1.0)
