"""A mesh laid flat, so that distances in the plane are those along the surface, as nearly as its shape allows.

    least  sum over landmarks k and vertices j of  (|x_j - x_k| - d_jk)^2 / (d_jk^2 + r^2),     d along the surface

Reflectance sharing asks for it: its radial functions take |x1 - x2| for the geodesic distance (RS 7). Landmarks are
chosen each as far as can be from those before it; their places and then all others' come from the distances' double
centred squares (landmark MDS: de Silva and Tenenbaum 2004), and are led downhill from there by majorisation (SMACOF:
de Leeuw 1977), landmarks and others in turn. No vertex is farther than r / 2 from a landmark; without r the
landmarks would be kinks, for the nearest pairs would count most.

    distortion    rms of |x_i - x_j| / d_ij - 1 over pairs of vertices
    stretch       singular values of each face's map into the plane (Sander et al. 2001), 1 and 1 where all lengths stay

What can be rolled out lies flat without distortion if each shortest way on it is straight when rolled out (no holes,
no corners that jut in). Nothing else does, closed surfaces least of all: they fold, and the figures say by how much.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from .._kernels.geodesics import settle
from ..arrays import Array, require_finite, to_numpy
from ..errors import ArrayError, ParameterError
from .geodesics import Metric
from .mesh import Mesh

_SOURCES = 32  # from which pairs are measured
_SETTLING = 2000  # vertices that the landmarks settle among
_ROUNDS, _STEPS = 40, 5  # of landmarks and others in turn
_LAST_STEPS = 30


@dataclasses.dataclass(frozen=True, eq=False)
class Flattened:
    """`mesh` laid flat: `coordinates` (V, 2), in its units of length, NaN for vertices of no face; `stretch` (F, 2),
    the largest and the least singular value on each face, the least negative where the face came to lie upside down;
    `distortion`, of pairs that the fit did not see; `part` (V,), which connected part a vertex is of, -1 if of no
    face; `landmarks`, vertices; `welded`, whether vertices that share a place were one."""

    mesh: Mesh
    coordinates: np.ndarray
    stretch: np.ndarray
    distortion: float
    part: np.ndarray
    landmarks: np.ndarray
    welded: bool


def flatten(mesh: Mesh, landmarks: int = 48, welded: bool = True, seed: int = 0) -> Flattened:
    """Coordinates of the vertices that keep distances along the mesh as nearly as can be, and how nearly they do.

    landmarks: >= 3, in each part; welded: vertices that share a place are one, so that seams of a texture are no cuts.
    Parts that are not connected stand in a row along x, the greatest first, each as far from those before it as it is
    in space, where they are nearest.

    Raises `ParameterError` for fewer landmarks.
    """
    if landmarks < 3:
        raise ParameterError(f"landmarks = {landmarks}; three or more tell a place in the plane.")
    metric = Metric.of(mesh, welded)
    rng = np.random.default_rng(seed)
    flat = np.full((len(metric), 2), np.nan)
    space = np.empty((len(metric), 3))
    space[metric.place] = mesh.vertices
    chosen: list[np.ndarray] = []
    sizes = np.bincount(metric.parts[metric.parts >= 0])
    done = np.empty(0, np.int64)
    for part in np.argsort(-sizes, kind="stable"):
        points = np.flatnonzero(metric.parts == part)
        marks, distances = _landmarks(metric, points, landmarks)
        x = _upright(_settled(_placed(distances, marks), distances, marks, rng), metric, points)
        if len(done):
            x[:, 0] += flat[done, 0].max() - x[:, 0].min() + _gap(space[done], space[points])
        flat[points] = x
        done = np.concatenate((done, points))
        chosen.append(points[marks])
    coordinates = flat[metric.place]
    first = np.full(len(metric), -1)
    first[metric.place[::-1]] = np.arange(len(metric.place))[::-1]
    return Flattened(
        mesh,
        coordinates,
        stretch(mesh, coordinates),
        _distortion(metric, coordinates, rng, scaled=False),
        metric.parts[metric.place],
        first[np.concatenate(chosen)],
        welded,
    )


def stretch(mesh: Mesh, coordinates: Array) -> np.ndarray:
    """Singular values (F, 2), largest and least, of the faces' maps into the plane: what lengths on the face are
    multiplied by. The least is negative where a face comes to lie clockwise.

    Raises `ArrayError` where coordinates (V, 2) do not fit, or are not finite on a face.
    """
    x = _checked(mesh, coordinates)[mesh.faces]
    corners = mesh.vertices[mesh.faces]
    e, f = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    base = np.linalg.norm(e, axis=1)
    along = (e * f).sum(axis=1) / base
    height = np.linalg.norm(np.cross(e, f), axis=1) / base
    right = (x[:, 1] - x[:, 0]) / base[:, None]
    up = ((x[:, 2] - x[:, 0]) - along[:, None] * right) / height[:, None]
    # sigma1 + sigma2 and sigma1 - sigma2 of the matrix (right, up), from its conformal and anticonformal parts.
    total = np.hypot(right[:, 0] + up[:, 1], right[:, 1] - up[:, 0])
    difference = np.hypot(right[:, 0] - up[:, 1], right[:, 1] + up[:, 0])
    return np.stack((total + difference, total - difference), axis=-1) / 2


def distortion(mesh: Mesh, coordinates: Array, scaled: bool = True, welded: bool = True, seed: int = 0) -> float:
    """The rms of |x_i - x_j| / d_ij - 1 over pairs of vertices, i among some that `seed` draws, j all that a way
    leads to; `scaled`, with the coordinates multiplied by what makes it least. So uv or places in an image can be
    judged as coordinates of a surface.

    Raises `ArrayError` where coordinates (V, 2) do not fit, or are not finite on a face.
    """
    x = _checked(mesh, coordinates)
    return _distortion(Metric.of(mesh, welded), x, np.random.default_rng(seed), scaled)


def _checked(mesh: Mesh, coordinates: Array) -> np.ndarray:
    x = to_numpy(coordinates).astype(np.float64)
    if x.shape != (len(mesh.vertices), 2):
        raise ArrayError(
            f"coordinates have shape {x.shape}; {len(mesh.vertices)} vertices want ({len(mesh.vertices)}, 2)."
        )
    used = np.zeros(len(x), bool)
    used[mesh.faces] = True
    require_finite(np.where(used[:, None], x, 0), "coordinates")
    return x


def _distortion(metric: Metric, x: np.ndarray, rng: np.random.Generator, scaled: bool) -> float:
    used = np.flatnonzero(metric.parts[metric.place] >= 0)
    ratios = []
    for i in rng.choice(used, min(_SOURCES, len(used)), replace=False):
        d = metric.from_point(metric.place[i])[metric.place]
        pair = (d > 0) & np.isfinite(d)
        ratios.append(np.linalg.norm(x[pair] - x[i], axis=1) / d[pair])
    ratio = np.concatenate(ratios)
    if scaled:
        ratio *= ratio.sum() / max(float(ratio @ ratio), 1e-300)
    return float(np.sqrt(np.mean((ratio - 1) ** 2)))


def _landmarks(metric: Metric, points: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Landmarks (M,) among `points` (N,) of one part, each as far as can be from those before it, and their distances
    (N, M) to all points."""
    at = int(np.argmax(metric.from_point(points[0])[points]))
    marks, distances = [], np.empty((min(count, len(points)), len(points)))
    nearest = np.full(len(points), np.inf)
    for row in distances:
        marks.append(at)
        row[:] = metric.from_point(points[at])[points]
        nearest = np.minimum(nearest, row)
        at = int(np.argmax(nearest))
    return np.array(marks), np.ascontiguousarray(distances.T)


def _placed(distances: np.ndarray, marks: np.ndarray) -> np.ndarray:
    """Places (N, 2) by landmark MDS."""
    squares = distances[marks] ** 2
    squares = (squares + squares.T) / 2
    mean = squares.mean(axis=0)
    values, vectors = np.linalg.eigh(-(squares - mean - mean[:, None] + mean.mean()) / 2)
    values, vectors = values[:-3:-1], vectors[:, :-3:-1]
    # Three points in a row span no second axis: there it is left at 0.
    inverse = vectors / np.sqrt(np.where(values > 1e-9 * values[0], values, np.inf))
    return np.asarray((mean - distances**2) @ inverse / 2)


def _settled(x: np.ndarray, distances: np.ndarray, marks: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Places (N, 2) downhill from `x`: the landmarks among some of the others, in turn, and then all."""
    some = rng.choice(len(x), min(_SETTLING, len(x)), replace=False)
    others, anchors = x[some], x[marks]
    there = distances[some]
    back = np.ascontiguousarray(there.T)
    near = 2 * float(distances.min(axis=1).max()) or float(distances.max())  # of few vertices all are landmarks
    for _ in range(_ROUNDS):
        settle(others, anchors, there, near, _STEPS)
        settle(anchors, others, back, near, _STEPS)
    settle(x, anchors, distances, near, _LAST_STEPS)
    return x


def _upright(x: np.ndarray, metric: Metric, points: np.ndarray) -> np.ndarray:
    """`x` (N, 2) about its middle, its longest extent along the first axis, most of its area counter-clockwise."""
    x = x - x.mean(axis=0)
    x = x @ np.linalg.svd(x, full_matrices=False)[2].T
    index = np.full(len(metric), -1)
    index[points] = np.arange(len(points))
    a, b, c = x[index[metric.faces[metric.parts[metric.faces[:, 0]] == metric.parts[points[0]]]]].swapaxes(0, 1)
    e, f = b - a, c - a
    if (e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]).sum() < 0:
        x[:, 1] *= -1
    return np.asarray(x)


def _gap(before: np.ndarray, points: np.ndarray) -> float:
    """The least distance in space from `points` to those `before`."""
    from scipy.spatial import cKDTree

    return float(cKDTree(before).query(points)[0].min())
