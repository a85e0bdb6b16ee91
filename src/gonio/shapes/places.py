"""Places on the surface that pixels see, in lengths along it: coordinates for sharing reflectance between pixels.

    x(p) = sum_k w_k (x_k + J_k (p - p_k)) / sum_k w_k,    w_k = 1 / |p - p_k|^2       over the four nearest vertices

A mesh of some of the pixels (`pixels.py`) is laid flat (`flattening.py`), and every pixel follows the vertices that are
nearest in space, each with its map's derivative J (2, 3).
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array, to_numpy
from .flattening import Flattened, flatten
from .geodesics import Metric
from .mesh import Mesh
from .pixels import LEAP, pixel_mesh

MOST = 20_000  # vertices that are laid flat
_NEAREST = 4  # vertices that a pixel follows
_SMALL = 0.01  # of all vertices: parts with fewer follow the others


def surface_places(positions: Array, mask: Array, most: int = MOST, leap: float = LEAP) -> tuple[np.ndarray, Flattened]:
    """Coordinates (S, 2) of the pixels of `mask` (rows, columns), along its rows, in the units of `positions` (rows,
    columns, 3); and the mesh of them, laid flat, with its distortion.

    Arguments and errors are those of `pixel_mesh`. Parts of the surface between leaps stand side by side, as `flatten`
    has them; crumbs go with what is nearest.
    """
    mesh = _large_parts(pixel_mesh(positions, mask, most=most, leap=leap))
    flat = flatten(mesh, welded=False)
    return _followed(to_numpy(positions)[to_numpy(mask)].astype(np.float64), flat), flat


def _large_parts(mesh: Mesh) -> Mesh:
    part = Metric.of(mesh, welded=False).parts
    size = np.bincount(part)
    large = size >= min(_SMALL * len(part), size.max())
    return Mesh(mesh.vertices, mesh.faces[large[part[mesh.faces[:, 0]]]])


def _followed(p: np.ndarray, flat: Flattened) -> np.ndarray:
    """Places (S, 2) of points `p` (S, 3) by the vertices that are nearest in space."""
    from scipy.spatial import cKDTree

    used = np.flatnonzero(flat.part >= 0)
    vertices, derivatives = flat.mesh.vertices[used], _derivatives(flat)[used]
    far, near = cKDTree(vertices).query(p, k=min(_NEAREST, len(used)))
    weights = 1 / np.maximum(far, 1e-9 * np.ptp(vertices, axis=0).max()) ** 2
    weights /= weights.sum(axis=1, keepdims=True)
    places = np.zeros((len(p), 2))
    for w, k in zip(weights.T, near.T, strict=True):
        offset = p - vertices[k]
        places += w[:, None] * (flat.coordinates[used[k]] + np.einsum("sij,sj->si", derivatives[k], offset))
    return places


def _derivatives(flat: Flattened) -> np.ndarray:
    """At the vertices, the mean (V, 2, 3) of what the maps of their faces make of vectors in space."""
    faces = flat.mesh.faces
    corners, x = flat.mesh.vertices[faces], flat.coordinates[faces]
    edges = corners[:, 1:] - corners[:, :1]
    across = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    maps = (x[:, 1:] - x[:, :1]).swapaxes(1, 2) @ np.linalg.inv(edges @ edges.swapaxes(1, 2)) @ edges
    total = np.bincount(faces.ravel(), np.repeat(across, 3), len(flat.coordinates))
    weighted = np.repeat((maps * across[:, None, None]).reshape(-1, 6), 3, axis=0)
    sums = [np.bincount(faces.ravel(), w, len(flat.coordinates)) for w in weighted.T]
    return np.asarray(np.stack(sums, axis=-1) / np.maximum(total, 1e-300)[:, None]).reshape(-1, 2, 3)
