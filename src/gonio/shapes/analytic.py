"""Shapes with closed forms: the sphere and the flat sample.

sphere   |o + t d - c| = r;  u = phi / 2 pi, v = 1 - theta / pi, tangent along e_phi
plane    n . (o + t d - c) = 0 within a rectangle; u along the tangent, v along n x tangent
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ..arrays import Array, frozen, require_finite, to_numpy
from ..directions import dot, normalise, require_unit, spherical
from ..errors import ArrayError, ParameterError
from ..frames import frame
from .view import Shape, View

# Rays that start on a surface meet it again within rounding, which grows to its root at grazing angles.
NEAR = 1e-6


@dataclasses.dataclass(frozen=True, eq=False)
class Sphere(Shape):
    """The sphere about `centre` (3,) of `radius` > 0."""

    centre: Array = (0.0, 0.0, 0.0)
    radius: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", _vector(self.centre, "Sphere: centre"))
        if not (math.isfinite(self.radius) and self.radius > 0):
            raise ParameterError(f"Sphere: radius = {self.radius:g} is not a positive number.")

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return self.centre - self.radius, self.centre + self.radius

    def trace(self, origins: Array, directions: Array) -> View:
        origins, directions = _rays(origins, directions)
        near, far = self._roots(origins, directions)
        t = np.where(near > 0, near, far)
        mask = t > 0
        t = t[mask]
        normal = normalise(origins[mask] + t[:, None] * directions[mask] - self.centre)
        theta, phi = spherical(normal)
        position = self.centre + self.radius * normal
        return View.of(
            mask,
            position=position,
            lifted=position,
            geometric=normal,
            normal=normal,
            tangent=np.stack((-np.sin(phi), np.cos(phi), np.zeros_like(phi)), axis=-1),
            uv=np.stack((phi / (2 * math.pi), 1 - theta / math.pi), axis=-1),
            wo=-directions[mask],
            distance=t,
        )

    def occluded(self, origins: Array, directions: Array, distance: Array = np.inf) -> np.ndarray:
        near, far = self._roots(*_rays(origins, directions))
        start = NEAR * self.radius
        first = np.where(near > start, near, far)
        return np.asarray((first > start) & (first < distance))

    def _roots(self, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Both t of the ray with the sphere, the nearer first; NaN where it passes by."""
        from_centre = o - self.centre
        middle = -dot(from_centre, d)
        # From the ray's nearest point to the centre, where the textbook b^2 - 4ac cancels for eyes far away.
        miss = from_centre + middle[..., None] * d
        room = self.radius**2 - dot(miss, miss)
        half = np.sqrt(np.where(room >= 0, room, np.nan))
        return middle - half, middle + half


@dataclasses.dataclass(frozen=True, eq=False)
class Plane(Shape):
    """A rectangle about `centre` (3,), `size` = (along `tangent`, across it), facing along `normal` (3,)."""

    size: tuple[float, float] = (2.0, 2.0)
    centre: Array = (0.0, 0.0, 0.0)
    normal: Array = (0.0, 0.0, 1.0)
    tangent: Array = (1.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if len(self.size) != 2 or not all(math.isfinite(s) and s > 0 for s in self.size):
            raise ParameterError(f"Plane: size = {self.size!r} is not two positive lengths.")
        for name in ("centre", "normal", "tangent"):
            object.__setattr__(self, name, _vector(getattr(self, name), f"Plane: {name}"))
        frame(self.normal, self.tangent)  # refuses a normal that is not unit, and a tangent along it

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        s, t, _ = frame(self.normal, self.tangent)
        reach = abs(s) * self.size[0] / 2 + abs(t) * self.size[1] / 2
        return self.centre - reach, self.centre + reach

    def trace(self, origins: Array, directions: Array) -> View:
        origins, directions = _rays(origins, directions)
        t, x, y = self._met(origins, directions)
        mask = t > 0
        s, _, n = frame(self.normal, self.tangent)
        position = origins[mask] + t[mask, None] * directions[mask]
        position -= dot(position - self.centre, n)[:, None] * n
        return View.of(
            mask,
            position=position,
            lifted=position,
            geometric=np.broadcast_to(n, position.shape),
            normal=np.broadcast_to(n, position.shape),
            tangent=np.broadcast_to(s, position.shape),
            uv=np.stack((x[mask] / self.size[0] + 0.5, y[mask] / self.size[1] + 0.5), axis=-1),
            wo=-directions[mask],
            distance=t[mask],
        )

    def occluded(self, origins: Array, directions: Array, distance: Array = np.inf) -> np.ndarray:
        t, _, _ = self._met(*_rays(origins, directions))
        return np.asarray((t > NEAR * max(self.size)) & (t < distance))

    def _met(self, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """t and the place (x, y) from the centre where the rays meet the rectangle; t is NaN where they do not."""
        s, across, n = frame(self.normal, self.tangent)
        slope = dot(d, n)
        t = -dot(o - self.centre, n) / np.where(slope == 0, np.nan, slope)
        met = o + t[..., None] * d - self.centre
        x, y = dot(met, s), dot(met, across)
        inside = (abs(x) <= self.size[0] / 2) & (abs(y) <= self.size[1] / 2)
        return np.where(inside, t, np.nan), x, y


def _vector(v: Array, name: str) -> Array:
    v = frozen(v)
    if v.shape != (3,):
        raise ArrayError(f"{name} has shape {tuple(v.shape)}; (3,) is wanted.")
    require_finite(v, name)
    return v


def _rays(origins: Array, directions: Array) -> tuple[np.ndarray, np.ndarray]:
    require_unit(directions, "directions")
    o, d = np.broadcast_arrays(to_numpy(origins), to_numpy(directions))
    return o.astype(np.float64, copy=False), d.astype(np.float64, copy=False)
