"""What a ray meets first, and whether anything stands between a point and a light.

    V(x, w) = 0 where a triangle lies on x + t w, 0 < t < distance;  1 elsewhere

Rays are traced by Embree where its wheel exists, by our own hierarchy (`_kernels/bvh.py`) where not. Both see the
triangles scaled to the box [-1, 1]^3, where single precision has the same room for every scene, and rays that start
far away are first moved up to it. What is met is then solved again in double precision.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Protocol

import numpy as np

from .._kernels import bvh
from ..arrays import Array, require_finite, to_numpy
from ..directions import cross, dot, require_unit
from ..errors import MEMORY_LIMIT, ArrayError, MemoryLimitError

# In units of the scaled box. Single precision places points there to 6e-8; this is far above it, and unseen.
CLEARANCE = 1e-5
BLOCK = 1 << 14  # rays at once, so that their temporaries stay in the cache


@dataclasses.dataclass(frozen=True, eq=False)
class Hits:
    """`distance` (...) along each ray, infinite where nothing was met; `face` (...), -1 there; `barycentric` (..., 3)
    weights of the face's corners, NaN there.
    """

    distance: np.ndarray
    face: np.ndarray
    barycentric: np.ndarray


class Tracer(Protocol):
    """What `Scene` asks of a ray tracer, in the scaled box: float32 rays (N, 3)."""

    def closest(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """The first face (N,) that each ray meets, -1 where none."""

    def blocked(self, origins: np.ndarray, directions: np.ndarray, far: np.ndarray) -> np.ndarray:
        """Whether each ray meets a face before `far` (N,)."""


class Embree:
    """Intel's ray tracer, called directly."""

    def __init__(self, corners: np.ndarray) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._scene = EmbreeScene()
        TriangleMesh(self._scene, corners.astype(np.float32))
        nowhere = np.full((1, 3), 9.0, dtype=np.float32)
        self._scene.run(nowhere, nowhere)  # the first run builds, which two threads must not do at once

    def closest(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        return np.asarray(self._scene.run(origins, directions, query="INTERSECT"))

    def blocked(self, origins: np.ndarray, directions: np.ndarray, far: np.ndarray) -> np.ndarray:
        return np.asarray(self._scene.run(origins, directions, far, query="OCCLUDED")) >= 0


class Hierarchy:
    """Our own ray tracer, for where Embree has no wheel."""

    def __init__(self, corners: np.ndarray) -> None:
        count = len(corners)
        order = np.empty(count, dtype=np.int64)
        boxes = np.empty((2 * count, 2, 3))
        link, leaf = np.empty(2 * count, dtype=np.int64), np.empty(2 * count, dtype=np.int64)
        nodes = bvh.build(corners, boxes, link, leaf, order)
        self._tree = (boxes[:nodes].copy(), link[:nodes].copy(), leaf[:nodes].copy(), corners[order])
        self._order = order

    def closest(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        place = np.empty(len(origins), dtype=np.int64)
        bvh.closest(origins.astype(np.float64), directions.astype(np.float64), *self._tree, place)
        return np.where(place >= 0, self._order[place], -1)

    def blocked(self, origins: np.ndarray, directions: np.ndarray, far: np.ndarray) -> np.ndarray:
        hit = np.empty(len(origins), dtype=np.bool_)
        rays = origins.astype(np.float64), directions.astype(np.float64), far.astype(np.float64)
        bvh.blocked(*rays, *self._tree, hit)
        return hit


class Scene:
    """Triangles that rays can meet: `vertices` (V, 3) and `faces` (F, 3), indices into them.

    `tracer` makes the ray tracer from corners (F, 3, 3); by default Embree where it is installed, else `Hierarchy`.
    """

    def __init__(self, vertices: Array, faces: Array, tracer: Any = None) -> None:
        vertices = to_numpy(vertices).astype(np.float64)
        require_finite(vertices, "vertices")
        corners = vertices[to_numpy(faces)]
        if corners.ndim != 3 or corners.shape[1:] != (3, 3) or not len(corners):
            raise ArrayError(f"faces x corners x components has shape {corners.shape}; (F, 3, 3), F >= 1, is wanted.")
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        extent = float((high - low).max())
        if extent <= 0:
            raise ArrayError("the faces all lie in one point.")
        self.centre = (low + high) / 2
        self.scale = 2 / extent
        self.clearance = CLEARANCE / self.scale
        self.corners = corners
        self._tracer: Tracer = (tracer or default_tracer())((corners - self.centre) * self.scale)

    def intersect(self, origins: Array, directions: Array) -> Hits:
        """The first faces that the rays from `origins` (..., 3) along unit `directions` (..., 3) meet."""
        origins, directions, shape = _rays(origins, directions)
        face = np.empty(len(origins), dtype=np.int64)
        distance = np.full(len(face), np.inf)
        weights = np.full((len(face), 3), np.nan)
        for part in _blocks(len(face)):
            near, w, _ = self._scaled(origins[part], directions[part])
            face[part] = self._tracer.closest(near, w)
            hit = part.start + np.flatnonzero(face[part] >= 0)
            distance[hit], weights[hit] = _solve(origins[hit], directions[hit], self.corners[face[hit]])
        return Hits(distance.reshape(shape), face.reshape(shape), weights.reshape(*shape, 3))

    def occluded(self, origins: Array, directions: Array, distance: Array = np.inf) -> np.ndarray:
        """Whether anything stands on the rays before `distance` (...): bool (...).

        Rays must start off the surface, as a `View`'s `lifted` points do, or they meet the face they start on.
        """
        origins, directions, shape = _rays(origins, directions)
        far = np.broadcast_to(to_numpy(distance).astype(np.float64, copy=False), shape).reshape(-1)
        hit = np.empty(len(origins), dtype=np.bool_)
        for part in _blocks(len(hit)):
            near, w, moved = self._scaled(origins[part], directions[part])
            left = np.minimum(far[part] * self.scale - moved, 1e37).astype(np.float32)
            hit[part] = (left > 0) & self._tracer.blocked(near, w, left)
        return hit.reshape(shape)

    def visible(
        self, positions: Array, directions: Array, distance: Array = np.inf, memory_limit: int = MEMORY_LIMIT
    ) -> np.ndarray:
        """V (P, K): whether each of `positions` (P, 3) sees out along each of unit `directions` (K, 3) or (P, K, 3).

        Raises `MemoryLimitError` where P K bytes exceed `memory_limit`.
        """
        positions, directions = to_numpy(positions), to_numpy(directions)
        if positions.ndim != 2 or directions.ndim not in (2, 3):
            raise ArrayError(
                f"positions {positions.shape} and directions {directions.shape}: (P, 3) and (K, 3) or (P, K, 3)."
            )
        shape = (len(positions), directions.shape[-2])
        if shape[0] * shape[1] > memory_limit:
            raise MemoryLimitError(
                f"visibility of {shape[0]} points towards {shape[1]} directions takes {shape[0] * shape[1] / 1e9:.1f} "
                f"GB, the limit is {memory_limit / 1e9:.1f} GB. Ask for fewer points at a time."
            )
        far = np.broadcast_to(to_numpy(distance), shape)
        seen = np.empty(shape, dtype=np.bool_)
        for part in _blocks(shape[0], max(1, BLOCK // max(1, shape[1]))):
            towards = directions if directions.ndim == 2 else directions[part]
            seen[part] = ~self.occluded(positions[part, None], towards, far[part])
        return seen

    def _scaled(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The rays in the box, moved up to it, in single precision, and how far they were moved."""
        inside = (origins - self.centre) * self.scale
        along = dot(inside, directions)
        # The box lies within radius sqrt(3) of its centre: nothing can be met earlier than this.
        moved = np.where(dot(inside, inside) > 3.1, np.maximum(-along - 1.8, 0.0), 0.0)
        if moved.any():
            inside += moved[:, None] * directions
        return inside.astype(np.float32), np.ascontiguousarray(directions, dtype=np.float32), moved


def default_tracer() -> Any:
    """Embree where it is installed, `Hierarchy` elsewhere."""
    try:
        import embreex  # noqa: F401
    except ImportError:
        return Hierarchy
    return Embree


def _solve(o: np.ndarray, d: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance (N,) and barycentric weights (N, 3) of the ray's meeting with its triangle (Moeller, Trumbore 1997).

    Weights are kept within the triangle, which single precision may just have missed.
    """
    a, e1, e2 = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = cross(d, e2)
    det = dot(e1, p)
    det = np.where(det == 0, np.finfo(np.float64).tiny, det)
    s = o - a
    u = np.clip(np.nan_to_num(dot(s, p) / det), 0, 1)
    v = np.clip(np.nan_to_num(dot(d, cross(s, e1)) / det), 0, 1 - u)
    met = a + u[:, None] * e1 + v[:, None] * e2
    return dot(met - o, d), np.stack((1 - u - v, u, v), axis=-1)


def _rays(origins: Array, directions: Array) -> tuple[np.ndarray, np.ndarray, tuple[int, ...]]:
    """Both broadcast and flat, (N, 3), and the shape that the answer takes."""
    origins, directions = to_numpy(origins), to_numpy(directions)
    require_unit(directions, "directions")
    if origins.ndim == 0 or origins.shape[-1] != 3:
        raise ArrayError(f"origins has shape {origins.shape}; points are (..., 3), components last.")
    origins, directions = np.broadcast_arrays(origins, directions)
    o, d = (x.reshape(-1, 3).astype(np.float64, copy=False) for x in (origins, directions))
    return o, d, origins.shape[:-1]


def _blocks(count: int, size: int = BLOCK) -> list[slice]:
    return [slice(start, min(start + size, count)) for start in range(0, count, size)]
