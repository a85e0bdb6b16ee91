"""Irradiance from a few harmonic coefficients of the light (RH 4).

    E(n) = sum_lm A_l L_lm Y_lm(n)         A_l = pi, 2 pi/3, pi/4, 0, -pi/24, ...   (RH 4.10, 4.12)
    E(n) = [n; 1]^T M [n; 1]               M from the nine coefficients of degree 2  (RH 4.14, 4.15)

Nine coefficients give the irradiance of any distant light within 9 % of its total intensity, and on average within
3 % (RH 4.3.1; 9.4 and 3.06 % for one lamp, which is the worst that can be). A directional source is better added
exactly, as max(n.l, 0) times its irradiance: `irradiance_map` does. `irradiance_error` says what the series leaves.
"""

from __future__ import annotations

import dataclasses
import math
import warnings

import numpy as np

from ..arrays import Array, floats, like, to_numpy
from ..directions import require_unit
from ..errors import ArrayError, NegativeWarning, ParameterError
from ..lights.environment import Environment
from ..lights.mappings import LatLongMap, Mapping
from ..lights.model import Light
from ..lights.orientation import Orientation
from ..sphere.grids import LatLong
from ..sphere.harmonics import degree_of, harmonics, require_degree
from ..sphere.zonal import clamped_cosine, convolve
from .deringing import dering

_NORMALS = LatLong(32, 64)  # where the series is held against the integral
_PIXELS = 1 << 17  # of the pictures integrated over: larger ones are summed in blocks to about as many
_BLOCK = 4_000_000  # pairs of a normal and a texel, or values of harmonics, at a time


def irradiance_coefficients(light: Array) -> Array:
    """E_lm = A_l L_lm (RH 4.8): coefficients of the light ((degree + 1)^2, C) -> of the irradiance, same shape."""
    return convolve(light, clamped_cosine(degree_of(light)))


def irradiance(light: Array, n: Array) -> Array:
    """E(n) at unit normals (..., 3) from the light's coefficients ((degree + 1)^2, C): (..., C), RH 4.10.

    Cut at a low degree the sum rings, and may fall below zero where little light arrives; it is returned as it is.
    """
    require_unit(n, "n")
    xp, light, n = floats(light, n)
    E = irradiance_coefficients(light)
    return xp.tensordot(harmonics(degree_of(E), n), E, axes=1)


def irradiance_matrix(light: Array) -> Array:
    """The symmetric matrix M (C, 4, 4) of RH 4.15 with E(n) = [n; 1]^T M [n; 1], from nine coefficients (9, C).

    Raises `ArrayError` where there are not nine.
    """
    xp, L = floats(light)
    if L.ndim != 2 or L.shape[0] != 9:
        raise ArrayError(f"light has shape {tuple(L.shape)}; the matrix of RH 4.15 takes nine coefficients, (9, C).")
    # A_l times the norms of the harmonics of RH 4.5, off-diagonal terms halved: .429043, .511664, .743125, ...
    c1, c2 = math.sqrt(15 * math.pi) / 16, math.sqrt(math.pi / 3) / 2
    c3, c4, c5 = 3 * math.sqrt(5 * math.pi) / 16, math.sqrt(math.pi) / 2, math.sqrt(5 * math.pi) / 16
    L00, L1m1, L10, L11, L2m2, L2m1, L20, L21, L22 = (L[k, :] for k in range(9))
    rows = (
        (c1 * L22, c1 * L2m2, c1 * L21, c2 * L11),
        (c1 * L2m2, -c1 * L22, c1 * L2m1, c2 * L1m1),
        (c1 * L21, c1 * L2m1, c3 * L20, c2 * L10),
        (c2 * L11, c2 * L1m1, c2 * L10, c4 * L00 - c5 * L20),
    )
    return xp.stack(tuple(xp.stack(row, axis=-1) for row in rows), axis=-2)


@dataclasses.dataclass(frozen=True, eq=False)
class Deviation:
    """abs(series - integral) over the normals, in parts of the total intensity (the light's integral over the sphere).

    `mean` (C,), over all orientations, and `maximum` (C,), for each channel.
    """

    mean: np.ndarray
    maximum: np.ndarray


def irradiance_error(environment: Environment, degree: int = 2) -> Deviation:
    """What the series to `degree`, as it is and without a window, is off the irradiance of `environment`. RH 4.3.1.

    The irradiance is summed over all pixels, for 2,048 normals that cover the sphere (the maximum is over these), and
    owes nothing to harmonics. Pictures larger than 256 x 512 are summed in square blocks of pixels, by each block's sum
    of radiance x solid angle x direction: exact for blocks that lie wholly before or behind the surface.

    Raises `ParameterError` where the degree is none or the picture is black throughout in some channel.
    """
    require_degree(degree)
    w, _ = environment.directions()
    energy = to_numpy(environment.image).astype(np.float64) * environment.solid_angles[..., None]
    total = energy.sum(axis=(0, 1))
    if not np.all(total > 0):
        raise ParameterError("the environment is black in some channel: there is no intensity to compare errors with.")
    normals = _NORMALS.directions().reshape(-1, 3)
    # Blocks that tile every sheet of the layout, so that what lies in one lies together on the sphere.
    common = math.gcd(*environment.mapping.sheet_shape(environment.rows, environment.columns))
    side = max(d for d in range(1, common + 1) if common % d == 0 and (d == 1 or d * d * _PIXELS <= w[..., 0].size))
    channels = np.moveaxis(energy, -1, 0)
    integral = np.stack([_integral(normals, w * channel[..., None], side) for channel in channels], axis=-1)
    off = np.abs(irradiance(to_numpy(environment.harmonics(degree)), normals) - integral) / total
    weights = np.repeat(_NORMALS.weights, _NORMALS.columns) / (4 * math.pi)
    return Deviation(weights @ off, off.max(axis=0))


def irradiance_map(
    light: Light,
    rows: int,
    mapping: Mapping | None = None,
    degree: int = 2,
    window: Array | None = None,
    orientation: Orientation = Orientation.GONIO,
) -> Environment:
    """E(n) for the normal n of every pixel, as a picture of `rows` rows laid out by `mapping` (lat-long where None).

    light: environments, directional lights, or `Lights` of several. Environments go by their series to `degree`, added
    up; every other light by its beams, exactly, as the sum of max(n.l, 0) E. A directional light never passes through
    harmonics. What the map holds is irradiance in the place of radiance: a matte surface sends out albedo / pi of it.

    window: factors (degree + 1,) on the series, such as `lanczos(degree, 4)`, or ones; what they leave below zero is
    cut to zero, with a `NegativeWarning`. Where None, the weakest that leaves nothing negative: see `dering`.

    Raises `ParameterError` for near lights, whose irradiance has no one value for a normal, `ArrayError` for a window
    of other shape.
    """
    require_degree(degree)
    mapping = LatLongMap() if mapping is None else mapping
    parts = light.parts
    near = [type(part).__name__ for part in parts if not part.distant]
    if near:
        raise ParameterError(
            f"{near[0]} is a near light: its irradiance changes from place to place. Only distant lights have a map."
        )
    sheet = Environment(np.zeros((*mapping.shape(rows), 1)), mapping, orientation)
    n, shown = sheet.directions()
    normals, E = n.reshape(-1, 3), []
    environments = [part for part in parts if isinstance(part, Environment)]
    if environments:
        _, *coefficients = floats(*(part.harmonics(degree) for part in environments))
        E.append(_series(sum(coefficients[1:], coefficients[0]), normals, degree, window))
    for part in parts:
        if not isinstance(part, Environment):
            beams = part.beams()
            E.append(_of_beams(beams.directions, beams.irradiance, normals))
    xp, *E = floats(*E)
    image = sum(E[1:], E[0])
    image = xp.where(like(shown.reshape(-1, 1), image) > 0, image, xp.zeros_like(image))
    return Environment(xp.reshape(image, (*shown.shape, -1)), mapping, orientation)


def _series(light: Array, normals: np.ndarray, degree: int, window: Array | None) -> Array:
    """E (N, C) of the light's coefficients, windowed, nowhere negative."""
    xp, E = floats(irradiance_coefficients(light))
    if window is None:
        E = dering(E).coefficients
    else:
        _, window = floats(window)
        if tuple(window.shape) != (degree + 1,):
            raise ArrayError(f"window has shape {tuple(window.shape)}; at degree {degree} it is ({degree + 1},).")
        E = convolve(E, window)
    step = max(_BLOCK // (degree + 1) ** 2, 1)
    blocks = [harmonics(degree, like(normals[k : k + step], E)) @ E for k in range(0, len(normals), step)]
    values = xp.concat(blocks, axis=0)
    least, most = (float(of(to_numpy(values))) for of in (np.min, np.max))
    # A deringed series may stand below zero by the rounding of its sum.
    if least < -1e-5 * most:
        warnings.warn(
            f"the windowed irradiance falls to {least:.3g}, {-least / most:.1%} of its largest, and is cut to zero "
            "there; leave `window` out for one that keeps it positive.",
            NegativeWarning,
            stacklevel=3,
        )
    return xp.maximum(values, xp.zeros_like(values))


def _of_beams(directions: Array, irradiance: Array, normals: np.ndarray) -> Array:
    """The sum over K beams of max(n.l, 0) E, (N, C)."""
    xp, directions, irradiance = floats(directions, irradiance)
    step = max(_BLOCK // directions.shape[0], 1)
    blocks = []
    for k in range(0, len(normals), step):
        cosines = like(normals[k : k + step], directions) @ directions.T
        blocks.append(xp.maximum(cosines, xp.zeros_like(cosines)) @ irradiance)
    return xp.concat(blocks, axis=0)


def _integral(normals: np.ndarray, flux: np.ndarray, side: int) -> np.ndarray:
    """Sum over blocks of side x side pixels of max(n.v, 0), (N,), v the block's sum of `flux` (rows, columns, 3)."""
    rows, columns, _ = flux.shape
    blocks = flux.reshape(rows // side, side, columns // side, side, 3).sum(axis=(1, 3))
    v = np.ascontiguousarray(blocks.reshape(-1, 3).T, np.float32)
    step = max(_BLOCK // v.shape[1], 1)
    single = normals.astype(np.float32)
    sums = [np.maximum(single[k : k + step] @ v, 0).sum(axis=1, dtype=np.float64) for k in range(0, len(single), step)]
    return np.concatenate(sums)
