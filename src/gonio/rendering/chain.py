"""The roughness chain of real-time engines: the light, blurred more at each mip level of a cube map.

    B_k(R) = integral of L(w) k_k(R.w) d omega = sum_lm A_l L_lm Y_lm(R)         A_l of the lobe k_k, in `lobes.py`
    alpha_k = roughness_k^2,   roughness_k = k / (levels - 1),   faces of size / 2^k texels

An engine reads it at R = reflect(wo, n) and the level of the surface's roughness, and multiplies by the table of
`split_sum.py` (Karis 2013). Squared perceptual roughness is glTF's; other rules pass their alphas.

B is evaluated at the texels' centres, from one function on the sphere: faces agree along their edges, and brightness
does not depend on size. Level 0 (alpha = 0) is the light itself, averaged over each texel. One analysis of the map
serves all levels, on a thinner grid where that suffices (`sphere/splines.py`). Between its pixels the light is
bilinear, so a lobe that is sharper than the map's rows carry sees the map resampled to more of them. Where few texels
want a sharp lobe, the sum over the pixels within it is sooner had than the series (`angular.py`, RH 5.33).
"""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from .._kernels import cube_sums as kernels
from ..arrays import frozen, to_numpy
from ..directions import from_spherical, spherical
from ..errors import MEMORY_LIMIT, MemoryLimitError, NegativeWarning, ParameterError
from ..lights.cubes import CubeStrip
from ..lights.environment import Environment
from ..lights.mappings import LatLongMap
from ..lights.orientation import Orientation
from ..sphere import splines
from ..sphere.grids import LatLong
from ..sphere.transform import analysis
from ..sphere.zonal import convolve
from . import angular
from .lobes import Lobe, ggx, spectrum

# A level's error has three parts: the series' end, and the splines on the way in and out.
_OF_SERIES, _OF_SPLINES = 0.8, 0.4

_LAST = 8  # texels along the smallest face unless levels are asked for: .2 apart, a cosine errs by .2^2 / 8 between
_MOST_ROWS = 2048  # of a map resampled for sharp lobes: 100 MB of float32
_PARTS = 3  # of a pixel each way, by which pixels are shared among texels: to 1 % of one where light meets dark
_KEPT = 256  # texels along a face up to which the directions of a level are kept: 6 MB


@dataclasses.dataclass(frozen=True, eq=False)
class RoughnessChain:
    """A prefiltered environment: a cube map for each level, from sharp to rough.

    faces: an array a level, (6, n, n, C), n halved from level to level; the faces are OpenGL's +X -X +Y -Y +Z -Z, row
    0 at the top, in `Orientation.OPENGL` (Y up). alphas (levels,), ascending: the width of each level's lobe. errors
    (levels,): the rms error of each level, relative to its rms, under a lamp that is a point; broader lights err by
    less. degrees: to which degree each level's series goes; 0 where the lobe was summed over pixels instead. Both are 0
    where the light is not blurred but only averaged over texels. lobe: its name.
    """

    faces: tuple[np.ndarray, ...]
    alphas: np.ndarray
    errors: np.ndarray
    degrees: tuple[int, ...]
    lobe: str

    @property
    def sizes(self) -> tuple[int, ...]:
        """Texels along a face of each level."""
        return tuple(face.shape[1] for face in self.faces)

    @property
    def roughness(self) -> np.ndarray:
        """Perceptual roughness of each level, (levels,): glTF's, the root of alpha."""
        roughness: np.ndarray = np.sqrt(self.alphas)
        return roughness

    def environment(self, level: int) -> Environment:
        """A level as an environment, to look up, to write, or to turn to another tool's orientation."""
        faces = self.faces[level]
        return Environment(faces.reshape(-1, *faces.shape[2:]), CubeStrip(), Orientation.OPENGL)

    def picture(self, side: int = 96) -> np.ndarray:
        """All levels to look at, sharp ones on top, six faces of `side` pixels beside each other: (levels side, 6 side,
        C)."""
        rows = []
        for faces in self.faces:
            at = np.minimum((np.arange(side) + 0.5) * faces.shape[1] / side, faces.shape[1] - 1).astype(np.intp)
            rows.append(np.concatenate(list(faces[:, at][:, :, at]), axis=1))
        return np.concatenate(rows)


class _Plan(NamedTuple):
    """A level's A_l, its error so far, and the rows of the grid that its series is summed on."""

    A: np.ndarray
    error: float
    rows: int


def roughness_chain(
    light: Environment,
    size: int,
    levels: int | Sequence[float] | None = None,
    lobe: Lobe = ggx,
    error: float = 1e-3,
) -> RoughnessChain:
    """Cube maps of `light` blurred by `lobe`, of size, size/2, size/4, ... texels along a face.

    levels: how many, so that roughness is k / (levels - 1); or the alpha of each, ascending in [0, 1]; where None, as
    many as leave faces of 8 texels. lobe: `lobes.ggx`, `lobes.phong`, or a function like them that vanishes beyond 90
    degrees. error: see `RoughnessChain`; series are cut and grids chosen to stay below it. What rings below zero is cut
    to zero.

    Layouts other than lat-long are resampled to it first, which keeps energy to 1e-3. Raises `ParameterError` where a
    size is no power of two times the last level's, alphas fall or leave [0, 1], error is not in [1e-6, .5], or a lobe
    is too sharp for 2,048 rows, `MemoryLimitError` for faces that would not fit; warns `NegativeWarning` where what was
    cut exceeds `error`. For NumPy.
    """
    alphas = _alphas(size, levels)
    if 8 * size**2 * 3 * 8 > MEMORY_LIMIT:
        raise MemoryLimitError(f"faces of {size} x {size} texels exceed the memory limit. Ask for a smaller size.")
    if not 1e-6 <= error <= 0.5:
        raise ParameterError(f"error = {error}; it is relative and lies in [1e-6, .5].")
    source = _lat_long(light)
    rows = [_rows_for(lobe, alpha, error, source.rows) for alpha in alphas]
    made: dict[int, tuple[np.ndarray, float, int]] = {}
    for count in sorted(set(rows)):
        at = [k for k, r in enumerate(rows) if r == count]
        if count == 0:
            made |= {k: (_itself(light, size >> k), 0.0, 0) for k in at}
            continue
        finer = source.resampled(LatLongMap(), count)
        plans = {k: _plan(lobe, alphas[k], error, count - 1) for k in at}
        for k in [k for k, plan in plans.items() if _sooner_summed(lobe, alphas[k], error, plan, size >> k, count)]:
            made[k] = _summed(finer, lobe, alphas[k], error, size >> k, plans.pop(k))
        if not plans:
            continue
        coefficients, factor = _harmonics(to_numpy(finer.image), list(plans.values()), error)
        for k, plan in plans.items():
            total = math.hypot(plan.error, _spline_error(plan.A, count // factor) if factor > 1 else 0.0)
            made[k] = _cube(coefficients, plan, size >> k, finer.turn, max(total, error)), total, plan.A.size - 1
    faces, errors, degrees = zip(*(made[k] for k in range(len(rows))), strict=True)
    name = getattr(lobe, "__name__", type(lobe).__name__)
    return RoughnessChain(faces, frozen(alphas), frozen(errors), degrees, name)


def _alphas(size: int, levels: int | Sequence[float] | None) -> tuple[float, ...]:
    """Alphas of the levels, checked against the faces' size."""
    if not isinstance(size, int | np.integer) or isinstance(size, bool) or size < 1:
        raise ParameterError(f"size = {size!r} is no number of texels.")
    if levels is None:
        levels = 1
        while size % (1 << levels) == 0 and size >> levels >= _LAST:
            levels += 1
    if isinstance(levels, int | np.integer):
        if levels < 1:
            raise ParameterError(f"levels = {levels}; a chain has at least one.")
        alphas = tuple((k / max(levels - 1, 1)) ** 2 for k in range(levels))
    else:
        alphas = tuple(float(alpha) for alpha in levels)
    if size % (1 << max(len(alphas) - 1, 0)):
        raise ParameterError(f"size = {size} cannot be halved {len(alphas) - 1} times for {len(alphas)} levels.")
    if not alphas or not all(0 <= alpha <= 1 for alpha in alphas) or list(alphas) != sorted(alphas):
        raise ParameterError(f"levels = {levels}; alphas ascend in [0, 1].")
    return alphas


def _lat_long(light: Environment) -> Environment:
    """The light as a lat-long map of one or three channels, its pixels as fine as its own."""
    if isinstance(light.mapping, LatLongMap):
        return light
    solid = light.solid_angles[light.solid_angles > 0]
    return light.resampled(
        LatLongMap(), max(math.ceil(math.pi / math.sqrt(float(np.median(solid)))), 2), Orientation.GONIO
    )


def _rows_for(lobe: Lobe, alpha: float, error: float, rows: int) -> int:
    """Rows of the map that a level is made from: the map's own, or so many times two that they carry the lobe."""
    if alpha == 0:
        return 0
    most = max(rows, _MOST_ROWS)
    while rows <= most:
        if _plan(lobe, alpha, error, rows - 1).error <= error:
            return rows
        rows *= 2
    raise ParameterError(
        f"alpha = {alpha:.4g} is too narrow for {most} rows at an error of {error:g}; take 0, the light itself, or "
        "allow a larger error."
    )


@lru_cache(maxsize=64)
def _plan(lobe: Lobe, alpha: float, error: float, highest: int) -> _Plan:
    A, beyond = spectrum(lobe, alpha, _OF_SERIES * error, highest)
    rows = -(-max(A.size, 16) // 16) * 16
    while _spline_error(A, rows) > _OF_SPLINES * error:
        rows += 16
    return _Plan(A, math.hypot(beyond, _spline_error(A, rows)), rows)


def _spline_error(A: np.ndarray, rows: int) -> float:
    """What splines on so many rows do to the lobe's series, relative to its rms."""
    l = np.arange(A.size)
    power = (2 * l + 1) * A**2
    return math.sqrt(float(np.sum(power * splines.relative_error(l, rows) ** 2) / np.sum(power)))


def _harmonics(image: np.ndarray, plans: list[_Plan], error: float) -> tuple[np.ndarray, int]:
    """The map's coefficients to the highest degree that is needed, and by how much the map was thinned for them."""
    degree, rows = max(plan.A.size - 1 for plan in plans), image.shape[0]
    factor = 1
    for wider in (2, 4, 8, 16, 32):
        coarse = rows // wider
        if rows % wider == 0 and 2 * degree < coarse:
            worst = max(_spline_error(plan.A, coarse) for plan in plans)
            factor = wider if worst <= _OF_SPLINES * error else factor
    if factor > 1:
        return splines.thinned_analysis(image, degree, factor), factor
    return analysis(image, LatLong(*image.shape[:2]), degree), factor


def _sooner_summed(lobe: Lobe, alpha: float, error: float, plan: _Plan, size: int, rows: int) -> bool:
    """Whether the pixels within a lobe are sooner summed for each texel than the light's series is made for all.

    In nanoseconds as measured on one core; the series of degrees beyond half the rows wants a finer quadrature.
    """
    angle, _ = angular.reach(lobe, alpha, _OF_SERIES * error)
    texels, pixels, degree = 6 * size * size, 2 * rows * rows, plan.A.size - 1
    summed = texels * (7 * angular.within(rows, angle) + 60 * rows * angle)
    analysed = 12 if 4 * degree < rows else 25 if 2 * degree < rows else 200
    return bool(summed < pixels * analysed + 50 * plan.rows**2 + 40 * texels)


def _summed(
    light: Environment, lobe: Lobe, alpha: float, error: float, size: int, plan: _Plan
) -> tuple[np.ndarray, float, int]:
    """Faces (6, size, size, C) of a level by sums over pixels, their error, and no degree."""
    angle, beyond = angular.reach(lobe, alpha, _OF_SERIES * error)
    v, u = _places(size, tuple(light.turn.ravel().tolist()))
    texels = angular.blurred(to_numpy(light.image), lobe, alpha, angle, from_spherical(math.pi * v, 2 * math.pi * u))
    faces: np.ndarray = frozen(texels.reshape(6, size, size, -1), texels.dtype)
    return faces, math.hypot(beyond, plan.error), 0


def _itself(light: Environment, size: int) -> np.ndarray:
    """Faces (6, size, size, C) of the light that is not blurred, each texel the mean over its solid angle."""
    strip = CubeStrip()
    finest = math.sqrt(float(strip.sheet_solid_angles(size, size).min()))
    if isinstance(light.mapping, LatLongMap) and math.pi / light.rows <= finest:
        image = _means(to_numpy(light.image), Orientation.OPENGL.matrix(strip).T @ light.turn, size)
    else:
        image = to_numpy(light.resampled(strip, 6 * size, Orientation.OPENGL).image)
    faces: np.ndarray = frozen(image.reshape(6, size, size, -1), image.dtype)
    return faces


def _means(image: np.ndarray, turn: np.ndarray, size: int) -> np.ndarray:
    """Texels (6 size^2, C) as means of the pixels of a lat-long map that is as fine as they: `resampled`, sooner."""
    rows, columns, channels = image.shape
    theta = (np.arange(rows * _PARTS) + 0.5) * (math.pi / (rows * _PARTS))
    phi = (np.arange(columns * _PARTS) + 0.5) * (2 * math.pi / (columns * _PARTS))
    polar, around = (np.stack((np.cos(x), np.sin(x)), axis=-1).astype(np.float32) for x in (theta, phi))
    sums = np.zeros((6 * size * size, channels + 1))
    kernels.add(np.ascontiguousarray(image), around, polar, np.sin(theta), turn.astype(np.float32), size, sums)
    means: np.ndarray = (sums[:, :-1] / sums[:, -1:]).astype(image.dtype)
    return means


def _cube(coefficients: np.ndarray, plan: _Plan, size: int, turn: np.ndarray, error: float) -> np.ndarray:
    """Faces (6, size, size, C) of a level, of coefficients in the axes of a map that stands by `turn`."""
    own = convolve(coefficients[: plan.A.size**2], plan.A.astype(coefficients.dtype))
    places = _kept_places if size <= _KEPT else _places
    texels: np.ndarray = splines.values(own, plan.rows, *places(size, tuple(turn.ravel().tolist())))
    if texels.min() < 0:
        below = np.minimum(texels, 0)
        cut = math.sqrt(float(np.sum(below**2, dtype=np.float64) / np.sum(texels**2, dtype=np.float64)))
        if cut > error:
            warnings.warn(
                f"a level rang below zero by {cut:.1e} of its rms, more than the error of {error:.1e} it was made for.",
                NegativeWarning,
                stacklevel=3,
            )
        texels -= below
    texels.flags.writeable = False
    return texels.reshape(6, size, size, -1)


def _places(size: int, turn: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """theta / pi and phi / 2 pi, each (6 size^2,), of a level's texels in the axes of a map that stands by `turn`."""
    strip, axes = CubeStrip(), np.array(turn).reshape(3, 3)
    directions, _ = strip.directions(6 * size, size)
    theta, phi = spherical(directions.reshape(-1, 3) @ Orientation.OPENGL.matrix(strip).T @ axes)
    return frozen(theta / math.pi), frozen(phi / (2 * math.pi))


_kept_places = lru_cache(maxsize=16)(_places)
