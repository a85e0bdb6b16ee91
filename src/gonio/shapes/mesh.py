"""Triangle meshes with smooth normals and texture coordinates.

    normal at a vertex     sum over its faces of angle x face normal (Thuermer and Wuethrich 1998)
    tangent at a vertex    sum over its faces of angle x (dp/du less its part along the normal)
    lifted point           P + sum_k b_k max(0, (V_k - P) . n_k) n_k

The lifted point is where shadow rays start: on the smooth surface that the shading normals promise, not on the flat
face beneath it, so that coarse meshes do not shadow themselves in steps (Hanika 2021, "Hacking the shadow
terminator"); a hair more along the geometric normal keeps single precision off the face itself.

Not here: reading files (files/), and finding texture coordinates.
"""

from __future__ import annotations

import dataclasses
import functools
import warnings

import numpy as np

from ..arrays import Array, frozen, require_finite, to_numpy
from ..directions import dot, normalise
from ..errors import ArrayError, GeometryWarning
from ..frames import frame
from .view import Shape, View
from .visibility import Scene


@dataclasses.dataclass(frozen=True, eq=False)
class Mesh(Shape):
    """Triangles `faces` (F, 3), counter-clockwise seen from outside, into `vertices` (V, 3).

    `uv` (V, 2) and unit `normals` (V, 3) may be given; without normals they are smooth, also across vertices that
    share a place (a seam of the texture). Faces without area are left out, with a `GeometryWarning`.

    Raises `ArrayError` for indices out of range, values that are not finite, and shapes that do not fit.
    """

    vertices: Array
    faces: Array
    uv: Array | None = None
    normals: Array | None = None

    def __post_init__(self) -> None:
        vertices = frozen(to_numpy(self.vertices))
        faces = to_numpy(self.faces)
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise ArrayError(f"Mesh: vertices has shape {vertices.shape}; (V, 3) is wanted.")
        if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu" or not len(faces):
            raise ArrayError(f"Mesh: faces is {faces.dtype} {faces.shape}; (F, 3) indices, F >= 1, are wanted.")
        require_finite(vertices, "Mesh: vertices")
        if faces.min() < 0 or faces.max() >= len(vertices):
            row = int(np.argwhere((faces < 0) | (faces >= len(vertices)))[0, 0])
            raise ArrayError(
                f"Mesh: faces[{row}] = {faces[row].tolist()} points outside the {len(vertices)} vertices. "
                "Indices count from 0 (OBJ files count from 1)."
            )
        for name, width in (("uv", 2), ("normals", 3)):
            given = getattr(self, name)
            if given is not None:
                given = frozen(to_numpy(given))
                if given.shape != (len(vertices), width):
                    raise ArrayError(f"Mesh: {name} has shape {given.shape}, {len(vertices)} vertices want ({width},).")
                require_finite(given, f"Mesh: {name}")
                object.__setattr__(self, name, given)
        area = np.linalg.norm(_twice_area(vertices, faces), axis=-1)
        flat = area <= 1e-14 * np.ptp(vertices, axis=0).max() ** 2
        if flat.any():
            if flat.all():
                raise ArrayError("Mesh: no face has any area.")
            warnings.warn(
                f"{flat.sum()} of {len(faces)} faces have no area and are left out, face {flat.argmax()} the first.",
                GeometryWarning,
                stacklevel=3,
            )
            faces = faces[~flat]
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", frozen(faces, dtype=np.int64))
        if self.normals is None:
            object.__setattr__(self, "normals", frozen(_smooth_normals(vertices, self.faces)))
        else:
            object.__setattr__(self, "normals", frozen(normalise(self.normals, "Mesh: normals")))

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        used = self.vertices[self.faces]
        return used.min(axis=(0, 1)), used.max(axis=(0, 1))

    @functools.cached_property
    def scene(self) -> Scene:
        """The mesh's ray tracer, built when first asked for."""
        return Scene(self.vertices, self.faces)

    @functools.cached_property
    def tangents(self) -> np.ndarray | None:
        """Unit tangents (V, 3) along growing u; None without uv. Zero where uv gives a vertex no direction."""
        if self.uv is None:
            return None
        corners, normals, uv = (to_numpy(x)[self.faces] for x in (self.vertices, self.normals, self.uv))
        e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        d1, d2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
        det = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
        along_u = np.sign(det)[:, None] * (d2[:, 1, None] * e1 - d1[:, 1, None] * e2)
        flat = along_u[:, None] - dot(along_u[:, None], normals)[..., None] * normals
        total = np.zeros_like(self.vertices)
        np.add.at(total, self.faces, _angles(self.vertices, self.faces)[..., None] * _unit_or_zero(flat))
        return _unit_or_zero(total)

    def flat(self) -> Mesh:
        """The same mesh with every face its own vertices and its own normal: facets in place of smoothness."""
        corners = self.vertices[self.faces]
        normal = normalise(_twice_area(self.vertices, self.faces))
        return Mesh(
            vertices=corners.reshape(-1, 3),
            faces=np.arange(3 * len(corners)).reshape(-1, 3),
            uv=None if self.uv is None else self.uv[self.faces].reshape(-1, 2),
            normals=np.repeat(normal, 3, axis=0),
        )

    def trace(self, origins: Array, directions: Array) -> View:
        hits = self.scene.intersect(origins, directions)
        mask = hits.face >= 0
        corner = self.faces[hits.face[mask]]
        weight = hits.barycentric[mask][..., None]
        corners, normals = self.vertices[corner], to_numpy(self.normals)[corner]
        position = (weight * corners).sum(axis=1)
        geometric = normalise(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        normal = _unit_or_zero((weight * normals).sum(axis=1))
        normal = np.where(dot(normal, normal)[:, None] > 0, normal, geometric)
        # Faces wound against their given normals lie on the normals' side too.
        geometric = np.where(dot(geometric, normal)[:, None] < 0, -geometric, geometric)
        below = np.maximum(dot(corners - position[:, None], normals), 0)[..., None]
        lifted = position + (weight * below * normals).sum(axis=1) + self.scene.clearance * geometric
        return View.of(
            mask,
            position=position,
            lifted=lifted,
            geometric=geometric,
            normal=normal,
            tangent=self._tangent(corner, weight, normal),
            uv=None if self.uv is None else (weight * self.uv[corner]).sum(axis=1),
            wo=np.broadcast_to(-to_numpy(directions), (*mask.shape, 3))[mask],
            distance=hits.distance[mask],
        )

    def occluded(self, origins: Array, directions: Array, distance: Array = np.inf) -> np.ndarray:
        return self.scene.occluded(origins, directions, distance)

    def _tangent(self, corner: np.ndarray, weight: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """Unit tangents perpendicular to `normal`; any perpendicular where uv gives none."""
        anyhow = frame(normal)[:, 0]
        if self.tangents is None:
            return np.asarray(anyhow)
        tangent = (weight * self.tangents[corner]).sum(axis=1)
        tangent = tangent - dot(tangent, normal)[:, None] * normal
        usable = dot(tangent, tangent)[:, None] > 1e-6
        return np.asarray(np.where(usable, _unit_or_zero(tangent), anyhow))


def _twice_area(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Normals (F, 3) of the faces, as long as twice their area."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _angles(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The faces' inner angles (F, 3) at their corners."""
    corners = vertices[faces]
    angles = np.empty(faces.shape)
    for k in range(3):
        e1 = corners[:, (k + 1) % 3] - corners[:, k]
        e2 = corners[:, (k + 2) % 3] - corners[:, k]
        # atan2 keeps slivers' digits, where acos of a dot product loses them.
        angles[:, k] = np.arctan2(np.linalg.norm(np.cross(e1, e2), axis=-1), dot(e1, e2))
    return angles


def _smooth_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    _, place = np.unique(vertices, axis=0, return_inverse=True)
    place = place.reshape(-1)
    weighted = _angles(vertices, faces)[..., None] * normalise(_twice_area(vertices, faces))[:, None]
    total = np.zeros((place.max() + 1, 3))
    np.add.at(total, place[faces], weighted)
    normals = _unit_or_zero(total)[place]
    # A vertex of no face, or between two faces back to back, has no normal; any one is as good.
    return np.where(dot(normals, normals)[:, None] > 0, normals, (0.0, 0.0, 1.0))


def _unit_or_zero(v: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.asarray(np.divide(v, length, out=np.zeros_like(v), where=length > 1e-300))
