"""Triangle meshes with smooth normals and texture coordinates.

    normal at a vertex     sum over its faces of angle x face normal (Thuermer and Wuethrich 1998)
    tangent at a vertex    sum over its faces of angle x direction of dp/du, less its part along the normal
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
from ..directions import cross, dot, normalise
from ..errors import ArrayError, GeometryWarning
from ..frames import frame
from .view import Shape, View
from .visibility import Scene

# The least cosine between a shading normal and the eye, where the face itself is seen from its outside.
GRAZING = 0.01


@dataclasses.dataclass(frozen=True, eq=False)
class Mesh(Shape):
    """Triangles `faces` (F, 3), counter-clockwise seen from outside, into `vertices` (V, 3).

    `uv` (V, 2), `normals` (V, 3) and `tangents` (V, 3) may be given. Normals are otherwise smooth, also across
    vertices that share a place (a seam of the texture); tangents otherwise follow growing u, and are zero where uv
    gives a vertex no direction. Faces without area are left out, with a `GeometryWarning`.

    Raises `ArrayError` for indices out of range, values that are not finite, and shapes that do not fit.
    """

    vertices: Array
    faces: Array
    uv: Array | None = None
    normals: Array | None = None
    tangents: Array | None = None

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
        for name, width in (("uv", 2), ("normals", 3), ("tangents", 3)):
            given = getattr(self, name)
            if given is not None:
                given = frozen(to_numpy(given))
                if given.shape != (len(vertices), width):
                    raise ArrayError(f"Mesh: {name} has shape {given.shape}, {len(vertices)} vertices want ({width},).")
                require_finite(given, f"Mesh: {name}")
                object.__setattr__(self, name, given)
        twice_area = np.linalg.norm(_across(vertices[faces]), axis=-1)
        flat = twice_area <= 1e-14 * np.ptp(vertices, axis=0).max() ** 2
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
        corners = vertices[self.faces]
        angles = _angles(corners, twice_area[~flat])
        if self.normals is None:
            object.__setattr__(self, "normals", frozen(_smooth_normals(vertices, self.faces, angles)))
        else:
            object.__setattr__(self, "normals", frozen(normalise(self.normals, "Mesh: normals")))
        if self.tangents is None and self.uv is not None:
            along = angles[..., None] * _unit_or_zero(_along_u(corners, self.uv[self.faces]))[:, None]
            along = _at_vertices(self.faces, along, len(vertices))
            along -= dot(along, self.normals)[:, None] * self.normals
            object.__setattr__(self, "tangents", frozen(_unit_or_zero(along)))

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        used = self.vertices[self.faces]
        return used.min(axis=(0, 1)), used.max(axis=(0, 1))

    @functools.cached_property
    def scene(self) -> Scene:
        """The mesh's ray tracer, built when first asked for."""
        return Scene(self.vertices, self.faces)

    def flat(self) -> Mesh:
        """The same mesh with every face its own vertices and its own normal: facets in place of smoothness."""
        corners = self.vertices[self.faces]
        normal = normalise(_across(corners))
        return Mesh(
            vertices=corners.reshape(-1, 3),
            faces=np.arange(3 * len(corners)).reshape(-1, 3),
            uv=None if self.uv is None else self.uv[self.faces].reshape(-1, 2),
            normals=np.repeat(normal, 3, axis=0),
        )

    def trace(self, origins: Array, directions: Array) -> View:
        hits = self.scene.intersect(origins, directions)
        mask = hits.face >= 0
        wo = np.broadcast_to(-to_numpy(directions), (*mask.shape, 3))[mask]
        return self.surface(mask, hits.face[mask], hits.barycentric[mask], wo, hits.distance[mask])

    def surface(
        self, mask: np.ndarray, face: np.ndarray, barycentric: np.ndarray, wo: np.ndarray, distance: np.ndarray
    ) -> View:
        """What lies on faces `face` (N,) at weights `barycentric` (N, 3), one for each True of `mask` (...), seen from
        `wo` (N, 3) at `distance` (N,): normals that look just away from there are bent."""
        corner, weight = self.faces[face], barycentric[..., None]
        corners, normals = self.vertices[corner], to_numpy(self.normals)[corner]
        position = (weight * corners).sum(axis=1)
        geometric = normalise(_across(corners))
        normal = _unit_or_zero((weight * normals).sum(axis=1))
        normal = np.where(dot(normal, normal)[:, None] > 0, normal, geometric)
        # Faces wound against their given normals lie on the normals' side too.
        geometric = np.where(dot(geometric, normal)[:, None] < 0, -geometric, geometric)
        normal = _towards(normal, geometric, wo)
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
            wo=wo,
            distance=distance,
        )

    def occluded(self, origins: Array, directions: Array, distance: Array = np.inf) -> np.ndarray:
        return self.scene.occluded(origins, directions, distance)

    def _tangent(self, corner: np.ndarray, weight: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """Unit tangents perpendicular to `normal`; any perpendicular where uv gives none."""
        anyhow = frame(normal)[:, 0]
        if self.tangents is None:
            return np.asarray(anyhow)
        tangent = (weight * to_numpy(self.tangents)[corner]).sum(axis=1)
        tangent = tangent - dot(tangent, normal)[:, None] * normal
        usable = dot(tangent, tangent)[:, None] > 1e-6
        return np.asarray(np.where(usable, _unit_or_zero(tangent), anyhow))


def _towards(normal: np.ndarray, geometric: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """Shading normals (N, 3), bent just towards the eye where they look away from it and the faces do not.

    Smooth normals turn away at the outline before the faces do, which would leave black dots there.
    """
    away = (dot(normal, wo) < GRAZING) & (dot(geometric, wo) > 0)
    bent = normal + (GRAZING - dot(normal, wo))[:, None] * wo
    return np.asarray(np.where(away[:, None], _unit_or_zero(bent), normal))


def _across(corners: np.ndarray) -> np.ndarray:
    """Normals (F, 3) of the faces, as long as twice their area."""
    return np.asarray(cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def _angles(corners: np.ndarray, twice_area: np.ndarray) -> np.ndarray:
    """The faces' inner angles (F, 3) at their corners."""
    edges = np.roll(corners, -1, axis=1) - corners  # from each corner to the next
    # atan2 keeps slivers' digits, where acos of a dot product loses them; |e x e'| is one and the same at each corner.
    return np.stack([np.arctan2(twice_area, -dot(edges[:, k], edges[:, k - 1])) for k in range(3)], axis=-1)


def _along_u(corners: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Vectors (F, 3) in the faces along which u grows and v does not; zero where a face has no area in uv."""
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    d1, d2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    sign = np.sign(d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0])
    return np.asarray((sign * d2[:, 1])[:, None] * e1 - (sign * d1[:, 1])[:, None] * e2)


def _smooth_normals(vertices: np.ndarray, faces: np.ndarray, angles: np.ndarray) -> np.ndarray:
    _, place = np.unique(vertices, axis=0, return_inverse=True)
    place = place.reshape(-1)
    weighted = angles[..., None] * normalise(_across(vertices[faces]))[:, None]
    normals = _unit_or_zero(_at_vertices(place[faces], weighted, place.max() + 1))[place]
    # A vertex of no face, or between two faces back to back, has no normal; any one is as good.
    return np.where(dot(normals, normals)[:, None] > 0, normals, (0.0, 0.0, 1.0))


def _at_vertices(faces: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """The sums (V, 3) at the vertices of `values` (F, 3, 3) at the faces' corners."""
    sums = [np.bincount(faces.ravel(), values[..., k].ravel(), minlength=count) for k in range(3)]
    return np.stack(sums, axis=-1)


def _unit_or_zero(v: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.asarray(np.divide(v, length, out=np.zeros_like(v), where=length > 1e-300))
