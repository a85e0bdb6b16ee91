"""Height fields: a surface z(x, y) sampled as an image, seen from above.

    x = (column - (columns - 1) / 2) spacing      to the right
    y = ((rows - 1) / 2 - row) spacing            up, so that row 0 is the far (upper) edge
    n ~ (-dz/dx, -dz/dy, 1)                       central differences, one-sided of second order at the edges

Each sample is the middle of a square texel, so the surface reaches half a spacing beyond the outermost samples, and
the pixels of `camera()` are the texels. Not here: integrating normals to heights.
"""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np

from ..arrays import Array, frozen, require_finite, to_numpy
from ..cameras import Orthographic
from ..directions import normalise
from ..errors import ArrayError, ParameterError
from .mesh import Mesh
from .view import Shape, View


@dataclasses.dataclass(frozen=True, eq=False)
class HeightField(Shape):
    """`heights` (rows, columns), both >= 2, in world units; `spacing` > 0 between neighbouring samples."""

    heights: Array
    spacing: float = 1.0

    def __post_init__(self) -> None:
        heights = frozen(to_numpy(self.heights))
        if heights.ndim != 2 or min(heights.shape) < 2:
            raise ArrayError(f"HeightField: heights has shape {heights.shape}; (rows, columns), both >= 2, is wanted.")
        require_finite(heights, "HeightField: heights")
        if not (math.isfinite(self.spacing) and self.spacing > 0):
            raise ParameterError(f"HeightField: spacing = {self.spacing:g} is not a positive number.")
        object.__setattr__(self, "heights", heights)

    @functools.cached_property
    def normals(self) -> np.ndarray:
        """Unit normals (rows, columns, 3) at the samples."""
        heights: np.ndarray = self.heights
        down, right = np.gradient(heights, self.spacing, edge_order=2 if min(heights.shape) > 2 else 1)
        return np.asarray(normalise(np.stack((-right, down, np.ones_like(right)), axis=-1)))

    @functools.cached_property
    def mesh(self) -> Mesh:
        """The surface as triangles: the samples, and a ring half a spacing beyond them."""
        rows, columns = self.heights.shape
        r = np.concatenate(([0], np.arange(rows) + 0.5, [rows]))
        c = np.concatenate(([0], np.arange(columns) + 0.5, [columns]))
        x, y = np.meshgrid((c - columns / 2) * self.spacing, (rows / 2 - r) * self.spacing)
        z = np.pad(self.heights, 1, mode="edge")
        # The ring carries on the slope of the outermost samples for half a spacing.
        z[0], z[-1] = 1.5 * z[1] - 0.5 * z[2], 1.5 * z[-2] - 0.5 * z[-3]
        z[:, 0], z[:, -1] = 1.5 * z[:, 1] - 0.5 * z[:, 2], 1.5 * z[:, -2] - 0.5 * z[:, -3]
        u, v = np.meshgrid(c / columns, 1 - r / rows)
        at = np.arange(z.size).reshape(z.shape)
        nw, ne, sw, se = at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]
        faces = np.stack((np.stack((nw, sw, se), axis=-1), np.stack((nw, se, ne), axis=-1)), axis=2)
        normals = np.pad(self.normals, ((1, 1), (1, 1), (0, 0)), mode="edge").reshape(-1, 3)
        return Mesh(
            vertices=np.stack((x, y, z), axis=-1).reshape(-1, 3),
            faces=faces.reshape(-1, 3),
            uv=np.stack((u, v), axis=-1).reshape(-1, 2),
            normals=normals,
            tangents=np.stack((normals[:, 2], np.zeros(len(normals)), -normals[:, 0]), axis=-1),  # (1, 0, dz/dx)
        )

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return self.mesh.bounds

    def camera(self) -> Orthographic:
        """The camera straight above whose pixels are the samples."""
        rows, columns = self.heights.shape
        pose = np.diag([1.0, -1.0, -1.0, 1.0])
        pose[2, 3] = self.bounds[1][2] + self.spacing * max(rows, columns)
        return Orthographic(size=(rows, columns), pixel=self.spacing, pose=pose)

    def trace(self, origins: Array, directions: Array) -> View:
        return self.mesh.trace(origins, directions)

    def occluded(self, origins: Array, directions: Array, distance: Array = np.inf) -> np.ndarray:
        return self.mesh.occluded(origins, directions, distance)
