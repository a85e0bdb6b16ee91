"""Surfaces of revolution about z: vases, cylinders, cups.

    x(phi, k) = (r_k cos phi, r_k sin phi, z_k)        u = phi / 2 pi, v = arc length along the profile / its whole

The seam's vertices are doubled, so that u runs from 0 to 1.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..directions import normalise
from ..errors import ArrayError, ParameterError
from .mesh import Mesh


def revolve(profile: Array, segments: int = 128) -> Mesh:
    """The mesh of `profile` (K, 2), pairs of radius >= 0 and height, turned about z in `segments` steps.

    A profile that runs upwards on the outside gives outward normals. Raises `ArrayError` where the profile is no such
    list, `ParameterError` where there are fewer than three segments.
    """
    profile = np.asarray(profile, dtype=np.float64)
    if profile.ndim != 2 or profile.shape[1] != 2 or len(profile) < 2:
        raise ArrayError(f"profile has shape {profile.shape}; it is (K, 2), K >= 2, radius and height in each row.")
    if not np.all(np.isfinite(profile)) or np.any(profile[:, 0] < 0):
        raise ArrayError("profile has a radius below zero, or a number that is not finite.")
    if segments < 3:
        raise ParameterError(f"segments = {segments}; a surface of revolution needs three or more.")
    steps = np.diff(profile, axis=0)
    arc = np.concatenate(([0.0], np.cumsum(np.hypot(*steps.T))))
    phi = 2 * np.pi * np.arange(segments + 1) / segments
    phi[-1] = 0.0  # the doubled seam must meet itself to the last bit
    radius, height = profile.T
    around = (
        radius[:, None] * np.cos(phi),
        radius[:, None] * np.sin(phi),
        np.broadcast_to(height[:, None], (len(profile), segments + 1)),
    )
    vertices = np.stack(around, axis=-1).reshape(-1, 3)
    u, v = np.meshgrid(np.arange(segments + 1) / segments, arc / arc[-1])
    # The outward normal in the (radius, height) plane is the profile's direction turned right.
    slope = np.gradient(profile, arc, axis=0)
    normals = normalise(_turned(slope[:, 1], -slope[:, 0], phi))
    row, column = np.divmod(np.arange((len(profile) - 1) * segments), segments)
    a = row * (segments + 1) + column
    b, c, d = a + 1, a + segments + 2, a + segments + 1
    # Where the profile meets the axis a ring is a point, and one triangle of each quad has no area.
    wide = radius > 1e-9 * radius.max()
    lower, upper = np.stack((a, b, c), axis=-1)[wide[row]], np.stack((a, c, d), axis=-1)[wide[row + 1]]
    faces = np.concatenate((lower, upper))
    return Mesh(vertices, faces, uv=np.stack((u.ravel(), v.ravel()), axis=-1), normals=normals)


def _turned(radius: np.ndarray, height: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """The profile (K,), (K,) at each angle (S,): vectors (K S, 3)."""
    x, y, z = np.broadcast_arrays(radius[:, None] * np.cos(phi), radius[:, None] * np.sin(phi), height[:, None])
    return np.stack((x, y, z), axis=-1).reshape(-1, 3)


def cylinder(radius: float = 2 / np.pi, height: float = 2.0, segments: int = 256) -> Mesh:
    """An open cylinder about the origin, upright, seen from outside; u around, v up. Its own lengths make it twice as
    long around as it is high. Raises `ParameterError` for lengths that are not positive, or fewer than 3 segments."""
    if not (0 < radius < np.inf and 0 < height < np.inf):
        raise ParameterError(f"cylinder: radius = {radius:g}, height = {height:g}; positive lengths are wanted.")
    return revolve([(radius, -height / 2), (radius, height / 2)], segments)


def vase(segments: int = 256) -> Mesh:
    """The vase of the demo and the examples: about two units high, its foot at z = -1, made of a smooth profile."""
    from scipy.interpolate import PchipInterpolator

    # Radius at heights from foot to lip, then a little way down inside; chosen to please.
    height = np.array([-1.0, -0.97, -0.85, -0.5, -0.1, 0.3, 0.6, 0.78, 0.92, 1.0])
    radius = np.array([0.34, 0.36, 0.40, 0.62, 0.72, 0.56, 0.32, 0.25, 0.30, 0.38])
    z = np.linspace(-1.0, 1.0, 160)
    outside = np.stack((PchipInterpolator(height, radius)(z), z), axis=-1)
    lip = np.pi * np.linspace(0, 1, 9)[1:]
    rim = np.stack((0.365 + 0.015 * np.cos(lip), 1.0 + 0.015 * np.sin(lip)), axis=-1)
    inside = np.stack((outside[::-1, 0][1:60] - 0.03, z[::-1][1:60]), axis=-1)
    foot = np.stack((np.linspace(0.0, 0.34, 8)[:-1], np.full(7, -1.0)), axis=-1)
    return revolve(np.concatenate((foot, outside, rim, inside)), segments)
