"""A mesh laid out over its texture: which surface point each texel of a map of uv shows.

    u = (column + 1/2) / columns,   v = 1 - (row + 1/2) / rows          texels' centres, row 0 at v = 1

The faces are laid into the plane of u and v, and a ray is cast onto each texel's centre. Where faces overlap in uv, one
of them has the texel.
"""

from __future__ import annotations

import numpy as np

from ..arrays import to_numpy
from ..errors import ArrayError, ParameterError
from .mesh import Mesh
from .view import View
from .visibility import Scene


def atlas(mesh: Mesh, size: tuple[int, int]) -> View:
    """The surface at the texels of a map of `size` (rows, columns): fields (rows, columns, ...), NaN where no face is.

    wo is the face's own normal: texels are seen from no place. Raises `ArrayError` where the mesh has no uv, or none of
    it lies in [0, 1], `ParameterError` for another size.
    """
    if mesh.uv is None:
        raise ArrayError("the mesh has no texture coordinates (uv). Unwrap it, as Blender's Smart UV Project does.")
    if len(size) != 2 or any(int(n) != n or n < 1 for n in size):
        raise ParameterError(f"size = {size!r} is not (rows, columns), both >= 1.")
    rows, columns = size
    uv = to_numpy(mesh.uv).astype(np.float64)
    plane = Scene(np.column_stack((uv, np.zeros(len(uv)))), mesh.faces)
    u, v = np.meshgrid((np.arange(columns) + 0.5) / columns, 1 - (np.arange(rows) + 0.5) / rows)
    hits = plane.intersect(np.stack((u, v, np.ones_like(u)), axis=-1), np.array([0.0, 0.0, -1.0]))
    mask = hits.face >= 0
    if not mask.any():
        raise ArrayError("no face of the mesh lies over [0, 1] of u and v.")
    face = hits.face[mask]
    corners = mesh.vertices[mesh.faces[face]]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outside = across / np.linalg.norm(across, axis=1, keepdims=True)
    return mesh.surface(mask, face, hits.barycentric[mask], outside, np.zeros(len(face)))
