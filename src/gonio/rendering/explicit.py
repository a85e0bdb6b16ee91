"""An SHRM as the tables that came before it, and what those leave out (RH 5.6.2, 5.7.3).

    Cabral et al. 1999            twelve reflection maps, seen from the corners of an icosahedron; between three corners
                                  B is interpolated
    Kautz and McCool 2000         a 3D texture B(a, exit angle), without azimuth: of wo only its angle to a counts

Both are linear in the light field: they put other numbers in the place of Y_ps(wo), sum_k w_k Y_ps(corner_k) and the
mean over the azimuth about a, P_p(a . wo) Y_ps(a). So tables and their errors are made of the lobe's coefficients.
"""

from __future__ import annotations

import math

import numpy as np

from ..directions import from_spherical
from ..errors import ParameterError
from ..sphere.grids import LatLong
from ..sphere.harmonics import harmonics
from .shrm import ReflectedLobe


def icosahedron() -> tuple[np.ndarray, np.ndarray]:
    """Corners (12, 3), unit, and faces (20, 3) of corners, counterclockwise from outside."""
    golden = (1 + math.sqrt(5)) / 2
    corners = []
    for a in (-1.0, 1.0):
        for b in (-golden, golden):
            corners += [(0.0, a, b), (a, b, 0.0), (b, 0.0, a)]
    points = np.array(corners) / math.hypot(1, golden)
    near = points @ points.T > 0.4  # neighbours stand at cos = 1 / sqrt5
    faces = []
    for i in range(12):
        for j in range(i + 1, 12):
            for k in range(j + 1, 12):
                if near[i, j] and near[j, k] and near[i, k]:
                    outward = np.linalg.det(points[[i, j, k]]) > 0
                    faces.append((i, j, k) if outward else (i, k, j))
    return points, np.array(faces)


def cabral_maps(lobe: ReflectedLobe, rows: int) -> np.ndarray:
    """What is seen from the corners of `icosahedron()`: (12, rows, 2 rows, C), by the lobe's direction a, without g."""
    return np.stack([lobe.seen_from(corner, rows) for corner in icosahedron()[0]])


def cabral_weights(wo: np.ndarray) -> np.ndarray:
    """What each of the twelve maps counts for eyes at unit `wo` (N, 3): (N, 12), barycentric in the face around wo."""
    corners, faces = icosahedron()
    inverse = np.linalg.inv(corners[faces])  # wo = weights @ corners of the face, all weights of one sign
    shares = np.einsum("nj,fjk->nfk", wo, inverse)
    face = np.argmax(shares.min(axis=2), axis=1)
    met = np.maximum(np.take_along_axis(shares, face[:, None, None], axis=1)[:, 0], 0)
    weights = np.zeros((len(wo), 12))
    np.put_along_axis(weights, faces[face], met / met.sum(axis=1, keepdims=True), axis=1)
    return weights


def cabral_radiance(lobe: ReflectedLobe, n: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """What the twelve maps give at unit normals and directions to the eye (N, 3): (N, C)."""
    field: np.ndarray = lobe.series(n, wo, cabral_weights(wo) @ harmonics(lobe.exit_degree, icosahedron()[0]))
    return field


def kautz_mccool_texture(lobe: ReflectedLobe, rows: int, exits: int) -> tuple[np.ndarray, np.ndarray]:
    """The texture (rows, 2 rows, exits, C) by a and by the exit angle, without g; and those angles (exits,), radians.

    Raises `ParameterError` for fewer than two exits.
    """
    if exits < 2:
        raise ParameterError(f"exits = {exits}; a texture has two or more of them.")
    grid, P = LatLong(rows, 2 * rows), lobe.exit_degree
    maps = lobe.maps(rows)
    around = harmonics(P, grid.directions())
    by_degree = np.stack(
        [
            np.einsum("rct,rctk->rck", around[..., p * p : (p + 1) ** 2], maps[:, :, p * p : (p + 1) ** 2])
            for p in range(P + 1)
        ],
        axis=2,
    )
    angle = np.linspace(0, math.pi, exits)
    return np.einsum("ep,rcpk->rcek", _zonal(P, np.cos(angle)), by_degree), angle


def kautz_mccool_radiance(lobe: ReflectedLobe, n: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """What the 3D texture gives at unit normals and directions to the eye (N, 3): (N, C)."""
    a = lobe.axis(n, wo)
    zonal = _zonal(lobe.exit_degree, np.sum(a * wo, axis=1))
    degree = np.repeat(np.arange(lobe.exit_degree + 1), 2 * np.arange(lobe.exit_degree + 1) + 1)
    field: np.ndarray = lobe.series(n, wo, zonal[:, degree] * harmonics(lobe.exit_degree, a))
    return field


def _zonal(degree: int, cosine: np.ndarray) -> np.ndarray:
    """P_p(cosine), (N, degree + 1): zonal harmonics over those at the pole."""
    w = from_spherical(np.arccos(np.clip(cosine, -1, 1)), 0.0)
    p = np.arange(degree + 1)
    zonal: np.ndarray = harmonics(degree, w)[:, p * (p + 1)] * np.sqrt(4 * math.pi / (2 * p + 1))
    return zonal
