"""Layouts on discs: angular maps, mirror balls, and pairs of paraboloids.

    X right, Y up, Z to the picture's centre;  (a, b) the picture's right and up in [-1, 1],  r^2 = a^2 + b^2

    AngularMap       theta = pi r                                            (Debevec's light probes)
    MirrorBall       theta = 2 asin r                                        (distant camera)
                     theta = 2 i - alpha,  sin i = d sin alpha,  tan alpha = r tan(asin(1/d))   (camera at d radii)
    DualParaboloid   d = (2 s, 2 t, 1 - s^2 - t^2)/(1 + s^2 + t^2),  (s, t) = extent (a, b);  the second half shows -d

theta is the angle from +Z, and the direction leans towards the picture's (a, b). Solid angles come from Green's
theorem: with G(r) = 1 - cos theta(r), constant beyond the rim, that of any pixel is the integral of G d(azimuth)
around its edge; so pixels cut by the rim are exact, and neighbours share their edge's integral.
"""

from __future__ import annotations

import dataclasses
import math
from abc import abstractmethod
from typing import Any, ClassVar

import numpy as np

from .._kernels import environment as kernels
from ..arrays import Array
from ..errors import ParameterError
from .mappings import Mapping


class _Disc(Mapping):
    """One sheet or more, each a disc around the sheet's middle; outside it a sheet shows nothing."""

    # Radius of the disc where half the sheet's side is 1.
    rim: float = 1.0

    @abstractmethod
    def _cap(self, r: np.ndarray) -> np.ndarray:
        """G(r) = 1 - cos theta(r) for r in [0, rim]."""

    def sheet_shape(self, rows: int, columns: int) -> tuple[int, int]:
        if rows < 2 or columns != rows:
            raise self._refuse(rows, columns, "as many columns as rows, two at least")
        return rows, columns

    def shape(self, rows: int) -> tuple[int, int]:
        return self.sheet_shape(rows, rows)

    def sheet_solid_angles(self, height: int, width: int) -> np.ndarray:
        grid = np.linspace(-1.0, 1.0, width + 1)
        # A disc is symmetric: one quadrant of the edges says all.
        quadrant = self._edge_integrals(grid[: width // 2 + 1], grid[: width // 2 + 1 + width % 2])
        edges = np.concatenate((quadrant, -quadrant[::-1][1 - width % 2 :]), axis=0)
        edges = np.concatenate((edges, edges[:, ::-1][:, width % 2 :]), axis=1)
        # Right edge up and left edge down; the disc is symmetric, so top and bottom are the same numbers transposed.
        columns = edges[1:] - edges[:-1]
        nearest = np.maximum(np.maximum(grid[:-1], -grid[1:]), 0.0)
        shown = nearest[:, None] ** 2 + nearest**2 < self.rim**2
        # What lies outside is zero but for rounding.
        return np.where(shown, np.maximum(columns + columns.T, 0.0), 0.0)

    def _edge_integrals(self, across: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Integral of G d(azimuth) along x = across[e], from y = along[k] to along[k + 1], as [e, k]."""
        x, low, high = across[:, None], along[None, :-1], along[None, 1:]
        half = np.sqrt(np.maximum(self.rim**2 - x * x, 0.0))
        a, b = np.clip(low, -half, half), np.clip(high, -half, half)
        # Gauss's error falls with the tenth power of a pixel's side at five nodes: rounding from 32 pixels on.
        nodes, weights = np.polynomial.legendre.leggauss(5 if len(across) > 16 else 12)
        middle, reach = (a + b) / 2, (b - a) / 2
        y = middle[..., None] + reach[..., None] * nodes
        r2 = x[..., None] ** 2 + y * y
        # G is a smooth function of r^2 that vanishes at 0, and d(azimuth) = x dy / r^2.
        ratio = self._cap(np.minimum(np.sqrt(r2), self.rim)) / np.where(r2 > 0, r2, 1.0)
        inside = x * reach * (ratio @ weights)
        # Beyond the rim G stays: there the integral is G times the azimuth turned through.
        side, sign = np.abs(x), np.where(x < 0, -1.0, 1.0)
        turned = np.arctan2(high, side) - np.arctan2(low, side) - np.arctan2(b, side) + np.arctan2(a, side)
        edges: np.ndarray = inside + float(self._cap(np.array(self.rim))) * sign * turned
        return edges

    def ghosts(self, height: int, width: int) -> np.ndarray:
        index = np.arange(self.sheets * height * width).reshape(self.sheets, height, width)
        out = np.pad(index, ((0, 0), (1, 1), (1, 1)), mode="edge")
        # A texel beyond the rim stands for the direction on the other side: same radius short of it, half a turn away.
        step = 2.0 / width
        centre = (np.arange(-1, width + 1) + 0.5) * step - 1
        y, x = np.meshgrid(centre, centre, indexing="ij")
        r = np.hypot(x, y)
        shown = np.pad(self.sheet_solid_angles(height, width) > 0, 1)
        beyond = ~shown & (r < self.rim + 3 * step)
        other, factor = self._across(r[beyond])
        row = np.clip(((factor * y[beyond] + 1) / step).astype(np.int64), 0, height - 1)
        column = np.clip(((factor * x[beyond] + 1) / step).astype(np.int64), 0, width - 1)
        for sheet in range(self.sheets):
            out[sheet][beyond] = index[(sheet + other) % self.sheets, row, column]
        return out

    def _across(self, r: np.ndarray) -> tuple[int, np.ndarray]:
        """Which sheet, and by what factor of (a, b), shows what a texel at radius `r` beyond the rim would."""
        return 0, -np.maximum(2 * self.rim - r, 0.0) / r


class _Radial(_Disc):
    """One disc, on which theta depends on r alone."""

    @abstractmethod
    def _theta(self, r: np.ndarray) -> np.ndarray:
        """Angle from the centre's direction at radius r in [0, 1]."""

    @abstractmethod
    def _radius(self, xp: Any, theta: Array) -> Array:
        """The inverse of `_theta`."""

    def _cap(self, r: np.ndarray) -> np.ndarray:
        cap: np.ndarray = 2 * np.sin(self._theta(r) / 2) ** 2
        return cap

    def locate(self, xp: Any, w: Array) -> tuple[Array, Array, Array]:
        side = xp.hypot(w[..., 0], w[..., 1])
        one = xp.ones_like(side)
        r = 0.5 * self._radius(xp, xp.atan2(side, w[..., 2]))
        # At the centre and on the rim's back the azimuth has no meaning: it is 0.
        scale = r / xp.where(side > 0, side, one)
        u = 0.5 + xp.where(side > 0, scale * w[..., 0], r)
        return xp.zeros(r.shape, dtype=xp.int64), u, 0.5 - scale * w[..., 1]

    def direct(self, sheet: int, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        a, b = 2 * u - 1, 1 - 2 * v
        r = np.hypot(a, b)
        theta = self._theta(np.minimum(r, 1.0))
        s = np.sin(theta) / np.where(r > 0, r, 1.0)
        return np.stack((s * a, s * b, np.cos(theta)), axis=-1)

    def density(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        r = np.hypot(2 * u - 1, 1 - 2 * v)
        return np.where(r < 1, self._slope(np.minimum(r, 1.0)), 0.0)

    @abstractmethod
    def _slope(self, r: np.ndarray) -> np.ndarray:
        """G'(r) / r for r in [0, 1], but for a constant factor."""


@dataclasses.dataclass(frozen=True)
class AngularMap(_Radial):
    """Debevec's light probe: the angle from the centre grows evenly to pi at the rim of a square picture's disc."""

    kernel: ClassVar[int] = kernels.ANGULAR

    def _theta(self, r: np.ndarray) -> np.ndarray:
        return math.pi * r

    def _slope(self, r: np.ndarray) -> np.ndarray:
        slope: np.ndarray = np.sinc(r)
        return slope

    def _radius(self, xp: Any, theta: Array) -> Array:
        return theta / math.pi


@dataclasses.dataclass(frozen=True)
class MirrorBall(_Radial):
    """A photograph of a mirror ball that fills the square picture; Z points to the camera.

    `distance` is the camera's from the ball's centre in radii of the ball (more than 1), infinite where the camera is
    far. A near camera does not see what lies behind the ball, a cone of asin(1/distance) about -Z: such directions
    are answered with the rim, and solid angles sum to the rest. Pixels that the rim cuts are then good to .1 %.
    """

    distance: float = math.inf

    kernel: ClassVar[int] = kernels.BALL

    def __post_init__(self) -> None:
        if not self.distance > 1:
            raise ParameterError(
                f"MirrorBall: distance = {self.distance} is not above 1; it is counted in radii from the ball's centre."
            )

    @property
    def parameter(self) -> float:
        return 1 / self.distance

    def _theta(self, r: np.ndarray) -> np.ndarray:
        if math.isinf(self.distance):
            theta: np.ndarray = 2 * np.arcsin(r)
            return theta
        alpha = np.arctan(r * math.tan(math.asin(self.parameter)))
        theta = 2 * np.arcsin(np.minimum(self.distance * np.sin(alpha), 1.0)) - alpha
        return theta

    def _slope(self, r: np.ndarray) -> np.ndarray:
        if math.isinf(self.distance):
            return np.ones_like(r)
        r = np.maximum(r, 1e-9)
        tangent = math.tan(math.asin(self.parameter))
        alpha = np.arctan(r * tangent)
        sine = np.minimum(self.distance * np.sin(alpha), 1.0)
        # d theta / d alpha, kept finite where the ray grazes the ball.
        turning = 2 * self.distance * np.cos(alpha) / np.sqrt(np.maximum(1 - sine**2, 1e-12)) - 1
        slope: np.ndarray = np.sin(self._theta(r)) * turning / (1 + (r * tangent) ** 2) / r
        return slope

    def _radius(self, xp: Any, theta: Array) -> Array:
        if math.isinf(self.distance):
            return xp.sin(theta / 2)
        # The angle of incidence i solves 2 i - asin(sin i / distance) = theta; see the kernel.
        i = theta / 2
        for _ in range(6):
            s = self.parameter * xp.sin(i)
            slope = 2 - self.parameter * xp.cos(i) / xp.sqrt(1 - s * s)
            i = xp.clip(i - (2 * i - xp.asin(s) - theta) / slope, 0.0, math.pi / 2)
        return xp.tan(xp.asin(self.parameter * xp.sin(i))) / math.tan(math.asin(self.parameter))


@dataclasses.dataclass(frozen=True)
class DualParaboloid(_Disc):
    """Two halves side by side, the one around +Z on the left: a picture twice as wide as high.

    s and t run over [-extent, extent] on each half; what lies beyond s^2 + t^2 = 1 repeats the other half and is not
    used. The right half shows the direction opposite to the left half's at the same place.
    """

    extent: float = 1.2

    sheets: ClassVar[int] = 2
    kernel: ClassVar[int] = kernels.PARABOLOID

    def __post_init__(self) -> None:
        if not 1 <= self.extent < math.inf:
            raise ParameterError(f"DualParaboloid: extent = {self.extent} is below 1, which would cut the horizon off.")

    @property
    def parameter(self) -> float:
        return self.extent

    @property
    def rim(self) -> float:  # type: ignore[override]
        return 1 / self.extent

    def sheet_shape(self, rows: int, columns: int) -> tuple[int, int]:
        if rows < 2 or columns != 2 * rows:
            raise self._refuse(rows, columns, "two square halves side by side")
        return rows, rows

    def shape(self, rows: int) -> tuple[int, int]:
        return rows, 2 * self.sheet_shape(rows, 2 * rows)[0]

    def placement(self, rows: int, columns: int) -> np.ndarray:
        left = np.arange(rows)[:, None] * columns + np.arange(rows)
        return np.stack((left, left + rows))

    def locate(self, xp: Any, w: Array) -> tuple[Array, Array, Array]:
        front = w[..., 2] >= 0
        scale = 0.5 / (self.extent * (1 + xp.abs(w[..., 2])))
        scale = xp.where(front, scale, -scale)
        sheet = xp.where(front, xp.zeros(front.shape, dtype=xp.int64), xp.ones(front.shape, dtype=xp.int64))
        return sheet, 0.5 + scale * w[..., 0], 0.5 - scale * w[..., 1]

    def direct(self, sheet: int, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        s, t = self.extent * (2 * u - 1), self.extent * (1 - 2 * v)
        beyond = np.maximum(np.hypot(s, t), 1.0)
        s, t = s / beyond, t / beyond
        r2 = s * s + t * t
        d = np.stack((2 * s, 2 * t, 1 - r2), axis=-1) / (1 + r2)[..., None]
        return d if sheet == 0 else -d

    def density(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        r2 = self.extent**2 * ((2 * u - 1) ** 2 + (1 - 2 * v) ** 2)
        return np.where(r2 < 1, 1 / (1 + r2) ** 2, 0.0)

    def _cap(self, r: np.ndarray) -> np.ndarray:
        r2 = (self.extent * r) ** 2
        return 2 * r2 / (1 + r2)

    def _across(self, r: np.ndarray) -> tuple[int, np.ndarray]:
        # (s, t) / r^2 on the other half, negated since that half shows -d.
        return 1, -1 / (self.extent * r) ** 2
