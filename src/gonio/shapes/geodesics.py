"""Distances along a mesh: the length of the shortest way over its triangles.

    t_c = s + |c - o|,    |a - o| = t_a - s,  |b - o| = t_b - s          o beyond the edge ab, in the plane of abc
    t_c = t_a + |c - a|                                                  where no straight way leads through ab

A wave runs from the source, nearest vertices first (Kimmel and Sethian 1998). It is taken to come from a point o, not
from afar (Novotni and Klein 2002), so that on what can be rolled out flat it is exact; where it bends around a vertex,
at a hole or a saddle, that is its origin from there on, at the distance s. A vertex that a shorter way reaches later
starts anew, which obtuse triangles ask for.

Not here: ways that end inside triangles, and the ways themselves.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np

from .._kernels.geodesics import march
from ..arrays import Array, to_numpy
from ..errors import MEMORY_LIMIT, ArrayError, MemoryLimitError
from .mesh import Mesh

_BEND = 0.05  # radians that a vertex must have over the plane's: fewer turn a wave by too little to be told


@dataclasses.dataclass(frozen=True, eq=False)
class Metric:
    """Lengths on a mesh, made ready for many waves. `place` (V,), the point P that each vertex is at; `faces` (F, 3) of
    points; `lengths` (F, 3), of the edge across from each corner; `start` (P + 1,) and `corners` (3 F,), which of them
    meet at a point; `bends` (P,), whether shortest ways may bend there: at saddles, and at corners that jut in."""

    place: np.ndarray
    faces: np.ndarray
    lengths: np.ndarray
    start: np.ndarray
    corners: np.ndarray
    bends: np.ndarray

    @classmethod
    def of(cls, mesh: Mesh, welded: bool = True) -> Metric:
        """The mesh's own; `welded`, with vertices that share a place as one, so that seams of a texture are no gaps."""
        if welded:
            _, place = np.unique(mesh.vertices, axis=0, return_inverse=True)
            place = place.reshape(-1)
        else:
            place = np.arange(len(mesh.vertices))
        points = mesh.vertices[mesh.faces]
        lengths = np.ascontiguousarray(
            np.linalg.norm(np.roll(points, -2, axis=1) - np.roll(points, -1, axis=1), axis=-1)
        )
        faces = np.ascontiguousarray(place[mesh.faces])
        corners = np.argsort(faces.ravel(), kind="stable")
        start = np.concatenate(([0], np.cumsum(np.bincount(faces.ravel(), minlength=place.max() + 1))))
        count = len(start) - 1
        e, f, g = lengths.T
        cosines = [(f * f + g * g - e * e) / (2 * f * g), (g * g + e * e - f * f) / (2 * g * e)]
        angles = np.arccos(np.clip(cosines, -1, 1))
        angles = np.stack((*angles, np.pi - angles.sum(axis=0)), axis=-1)
        around = np.bincount(faces.ravel(), angles.ravel(), count)
        straight = np.where(_on_rim(faces, count), np.pi, 2 * np.pi)
        return cls(place, faces, lengths, start, corners, around > straight + _BEND)

    def __len__(self) -> int:
        """P."""
        return len(self.start) - 1

    @functools.cached_property
    def parts(self) -> np.ndarray:
        """The part (P,) of the surface that each point is of, numbered from 0; -1 for points of no face."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        a, b = self.faces.ravel(), np.roll(self.faces, 1, axis=1).ravel()
        joined = coo_array((np.ones(len(a), np.int8), (a, b)), shape=(len(self), len(self)))
        _, label = connected_components(joined.tocsr(), directed=False)
        used = np.diff(self.start) > 0
        parts = np.full(len(self), -1)
        parts[used] = np.unique(label[used], return_inverse=True)[1].reshape(-1)
        return parts

    def from_point(self, point: int) -> np.ndarray:
        """Distances (P,) from one point."""
        time = np.empty(len(self))
        origin, heap, slot = np.empty((3, len(self)), np.int64)
        march(int(point), self.faces, self.lengths, self.start, self.corners, self.bends, time, origin, heap, slot)
        return time


def geodesic_distances(mesh: Mesh, sources: Array, welded: bool = True) -> np.ndarray:
    """Distances (S, V) along the mesh from vertices `sources` (S,); infinite between parts that are not connected.

    `welded`: vertices that share a place are one, so that seams of a texture are no gaps. On smooth surfaces off by
    some first order of the edges' length; exact, to rounding, on flat ones and such as can be rolled out.

    Raises `ArrayError` for sources that are no vertices, `MemoryLimitError` for more than 4 GB of distances.
    """
    which = to_numpy(sources)
    if which.ndim != 1 or not len(which) or which.dtype.kind not in "iu":
        raise ArrayError(f"sources are {which.dtype} {which.shape}; numbers (S,) of vertices, S >= 1, are wanted.")
    bad = (which < 0) | (which >= len(mesh.vertices))
    if bad.any():
        k = int(bad.argmax())
        raise ArrayError(f"sources[{k}] = {which[k]} is none of the {len(mesh.vertices)} vertices, counted from 0.")
    if 8 * len(which) * len(mesh.vertices) > MEMORY_LIMIT:
        raise MemoryLimitError(
            f"distances of {len(which)} sources to {len(mesh.vertices)} vertices take more than "
            f"{MEMORY_LIMIT / 1e9:g} GB; ask for some sources at a time."
        )
    metric = Metric.of(mesh, welded)
    distances = np.empty((len(which), len(mesh.vertices)))
    for row, source in zip(distances, which, strict=True):
        row[:] = metric.from_point(metric.place[source])[metric.place]
    return distances


def _on_rim(faces: np.ndarray, count: int) -> np.ndarray:
    """Whether each of so many points (P,) is at an edge of one face alone."""
    edges = np.sort(np.stack((faces, np.roll(faces, -1, axis=1)), axis=-1).reshape(-1, 2), axis=1)
    code, uses = np.unique(edges[:, 0] * count + edges[:, 1], return_counts=True)
    rim = np.zeros(count, bool)
    rim[np.concatenate(np.divmod(code[uses == 1], count))] = True
    return rim
