"""A slice of reflectance, measured at scattered directions, on a grid over the hemisphere; and where it was measured.

    (x, y) = sqrt2 sin(theta / 2) (cos phi, sin phi)      equal areas for equal solid angles (Lambert's map)

The grid is n x n texels over [-1, 1]^2, x to the right and y up, of which those within the unit disc are directions
above the surface. Two ways to fill it:

    push_pull     Gortler et al. 1996, as MS has it: the grid is halved until all is filled, and what is missing at a
                  level is taken from the coarser one; it fills everything, far from any sample too
    interpolate   Clough and Tocher's surface through the samples, with continuous slopes, on Delaunay's triangles

Neither knows anything beyond the samples: `covered` says where they are near, and the rest is not to be taken for data.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ..arrays import Array, require_finite, to_numpy
from ..brdf.coverage import near_samples
from ..directions import from_spherical, lambert_map, require_unit
from ..errors import ArrayError, ParameterError


@dataclasses.dataclass(frozen=True, eq=False)
class Slice:
    """values (n, n, C), 0 outside the disc; covered (n, n) bool: within the disc and near the samples."""

    values: np.ndarray
    covered: np.ndarray


def grid_directions(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions (n, n, 3) of the texels' centres, and which lie above the surface, (n, n) bool.

    Those outside the disc are given the direction on its rim. Raises `ParameterError` where n is less than 2.
    """
    if n < 2:
        raise ParameterError(f"n = {n}; a grid has two texels or more each way.")
    at = (np.arange(n) + 0.5) * (2 / n) - 1
    x, y = np.meshgrid(at, -at)
    r = np.hypot(x, y)
    theta = 2 * np.arcsin(np.minimum(r, 1) / math.sqrt(2))  # 90 degrees on the rim
    directions: np.ndarray = np.asarray(from_spherical(theta, np.arctan2(y, x)))
    return directions, r <= 1


def push_pull(wi: Array, values: Array, n: int, weights: Array | None = None) -> Slice:
    """The slice of `values` (N, C) at unit `wi` (N, 3) above the surface, on n x n texels, by push and pull.

    weights (N,) >= 0: of the samples. Samples in one texel are averaged. n is a power of two. Raises `ArrayError` for
    shapes that do not fit, values that are not finite or weights that are all 0, `DirectionError` for directions that
    are not unit, `ParameterError` for another n.
    """
    w, v, k = _samples(wi, values, weights)
    if n < 2 or n & (n - 1):
        raise ParameterError(f"n = {n}; push and pull halve a grid whose side is a power of two.")
    column, row = np.clip(((lambert_map(w) * [1, -1] + 1) * (n / 2)).astype(int), 0, n - 1).T
    sums, total = np.zeros((n, n, v.shape[1])), np.zeros((n, n))
    np.add.at(sums, (row, column), k[:, None] * v)
    np.add.at(total, (row, column), k)
    mean = sums / np.where(total > 0, total, 1)[..., None]
    _, inside = grid_directions(n)
    return Slice(np.where(inside[..., None], _filled(mean, total / k.max()), 0), _covered(w, n))


def interpolate(wi: Array, values: Array, n: int) -> Slice:
    """The slice on n x n texels by the smooth surface through the samples; beyond their hull, the nearest one's value.

    Directions that occur twice are averaged. Raises as `push_pull` does, and `ArrayError` where fewer than three
    samples are apart, or all lie on a line.
    """
    from scipy.interpolate import CloughTocher2DInterpolator
    from scipy.spatial import QhullError, cKDTree

    w, v, _ = _samples(wi, values, None)
    places, index = np.unique(lambert_map(w).round(9), axis=0, return_inverse=True)
    index = index.reshape(-1)
    mean = np.zeros((len(places), v.shape[1]))
    np.add.at(mean, index, v)
    mean /= np.bincount(index)[:, None]
    try:
        surface = CloughTocher2DInterpolator(places, mean)
    except (QhullError, ValueError) as error:
        raise ArrayError(f"{len(places)} samples on a line, or fewer than three, make no surface.") from error
    directions, inside = grid_directions(n)
    at = lambert_map(directions[inside])
    found = surface(at)
    beyond = np.isnan(found[:, 0])
    if beyond.any():
        found[beyond] = mean[cKDTree(places).query(at[beyond])[1]]
    image = np.zeros((n, n, v.shape[1]))
    image[inside] = found
    return Slice(image, _covered(w, n))


def _filled(mean: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Means (m, m, C) of weight total (m, m), and where that is less than 1, so much of the coarser level's instead."""
    m = len(mean)
    if m == 1:
        return mean
    weight = np.minimum(total, 1)[..., None]  # a crowd of samples counts as one, and does not drown its neighbours
    fours = weight.reshape(m // 2, 2, m // 2, 2, 1).sum(axis=(1, 3))
    coarse = (weight * mean).reshape(m // 2, 2, m // 2, 2, -1).sum(axis=(1, 3)) / np.where(fours > 0, fours, 1)
    finer: np.ndarray = weight * mean + (1 - weight) * _doubled(_filled(coarse, fours[..., 0]))
    return finer


def _doubled(image: np.ndarray) -> np.ndarray:
    """Twice as many texels each way, bilinear."""
    for axis in (0, 1):
        image = np.moveaxis(image, axis, 0)
        before, after = np.concatenate((image[:1], image[:-1])), np.concatenate((image[1:], image[-1:]))
        both = np.stack((0.75 * image + 0.25 * before, 0.75 * image + 0.25 * after), axis=1)
        image = np.moveaxis(both.reshape(-1, *image.shape[1:]), 0, axis)
    return image


def _covered(w: np.ndarray, n: int) -> np.ndarray:
    """Texels within the disc that have a sample near."""
    directions, inside = grid_directions(n)
    covered = np.zeros((n, n), bool)
    # In a texel's own size at least: nearer samples fall into one.
    covered[inside] = near_samples(lambert_map(w), lambert_map(directions[inside]), 2 / n)
    return covered


def _samples(wi: Array, values: Array, weights: Array | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    w, v = (np.asarray(to_numpy(x), dtype=np.float64) for x in (wi, values))
    k = np.ones(len(w)) if weights is None else np.asarray(to_numpy(weights), dtype=np.float64)
    if w.ndim != 2 or w.shape[1] != 3 or v.ndim != 2 or len(v) != len(w) or k.shape != (len(w),) or not len(w):
        raise ArrayError(f"wi, values and weights have shapes {w.shape}, {v.shape}, {k.shape}; (N, 3), (N, C), (N,).")
    require_unit(w, "wi")
    require_finite(v, "values")
    if (w[:, 2] < 0).any():
        raise ArrayError("wi: some directions lie below the surface.")
    if not (np.isfinite(k).all() and (k >= 0).all() and k.max() > 0):
        raise ArrayError("weights are not all finite and >= 0, or all 0.")
    return w, v, k
