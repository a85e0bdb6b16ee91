"""Normals and albedo of a matte object from photographs under known lights (Woodham 1980).

    I_k = albedo n.l_k E_k,  n.l_k > 0        I_k the mean of the channels, l_k, E_k direction and irradiance of light k

g = albedo n by least squares over the lights that a pixel faces. Shadows that others cast and highlights do not fit:
the robust fit, which is the default, first minimises the sum of absolute residuals, and then takes the least squares of
those photographs that lie within three standard deviations of it, by the median. Albedo is relative: what the pixel
sends for irradiance 1 head on. Not here: highlights that are modelled, lights that are unknown.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from .._kernels import photometric_stereo as kernels
from ..errors import ArrayError
from ..threads import processors
from .lighting import arriving, directions_from, directions_of, span_space
from .model import Capture

_PIXELS = 1024  # solved at once, while a cache holds them
_NEAR = 1 << 18  # pairs of a pixel and a near light, whose directions are all held
_MEMORY = 10**9  # bytes of the photographs that are held at once


@dataclasses.dataclass(frozen=True, eq=False)
class Relief:
    """What photometric stereo found, (rows, columns, ...); NaN where it found nothing.

    normals: unit, z towards the camera. albedo: RGB, relative. residual: rms over the photographs that count, relative
    to the albedo. error: the standard error of the normal, radians, as those residuals scatter. used: how many
    photographs count, (rows, columns).
    """

    normals: np.ndarray
    albedo: np.ndarray
    residual: np.ndarray
    error: np.ndarray
    used: np.ndarray


def photometric_stereo(
    capture: Capture, robust: bool = True, progress: Callable[[int, int], None] | None = None
) -> Relief:
    """Normals, albedo and how well they are known, on the mask of a capture whose lights are known.

    Lights may be near: then each pixel sees them from its own position, `capture.positions`. Clipped pixels do not
    count, nor do lamps that look away from one. Memory is a gigabyte and the answer's, whatever the number of
    photographs: where they are more, they are read a part of the pixels after the other, which is soon done from a
    store (`gonio ingest`) and slow from files.
    `progress(done, total)` hears of photographs in all parts, each when it is read and when it is worked through.
    Raises `ArrayError` where lights are unknown, fewer than three, or all in a plane.
    """
    lights = capture.lights
    if lights is None:
        raise ArrayError("the capture's lights are unknown. Calibrate them by a mirror ball, or give their directions.")
    at, n = np.flatnonzero(capture.mask), len(lights)
    if not span_space(directions_from(lights, np.mean(capture.positions[capture.mask], axis=0))):
        raise ArrayError(f"{n} lights, which do not span space: normals want three that are in no plane.")
    g, albedo = np.empty((at.size, 3)), np.empty((at.size, 3))
    residual, error, used = np.empty(at.size), np.empty(at.size), np.empty(at.size, np.intp)
    parts = list(capture.photographs.parts(at, max(1, _MEMORY // (13 * n))))
    for number, part in enumerate(parts):
        heard = _half(progress, n, 2 * number, 2 * len(parts))
        radiance, clipped = capture.photographs.pixels(at[part], heard)
        solved = _solve(capture, at[part], radiance, clipped, robust)
        g[part], albedo[part], residual[part], error[part], used[part] = solved
        if progress is not None:
            progress((2 * number + 2) * n, 2 * len(parts) * n)
    length = np.linalg.norm(g, axis=1)

    def spread(x: np.ndarray) -> np.ndarray:
        image = np.full((capture.mask.size, *x.shape[1:]), np.nan, np.float32)
        image[at] = x
        return image.reshape(*capture.mask.shape, *x.shape[1:])

    counted = np.zeros(capture.mask.size, np.intp)
    counted[at] = used
    return Relief(
        spread(g / length[:, None]),
        spread(albedo),
        spread(residual / length),
        spread(error),
        counted.reshape(capture.mask.shape),
    )


def _solve(
    capture: Capture, at: np.ndarray, radiance: np.ndarray, clipped: np.ndarray, robust: bool
) -> tuple[np.ndarray, ...]:
    """g, albedo, residual, error and how many photographs count, of pixels `at` (P,), all photographs of which came."""
    lights = capture.lights
    assert lights is not None
    n, pixels = len(lights), at.size
    g, albedo = np.empty((pixels, 3)), np.empty((pixels, 3))
    residual, error, used = np.empty(pixels), np.empty(pixels), np.empty(pixels, np.intp)
    distant = directions_of(lights)
    step = _PIXELS if distant is not None else max(1, min(_PIXELS, _NEAR // n))
    positions = capture.positions.reshape(-1, 3)

    def block(low: int) -> None:
        some = slice(low, min(low + step, pixels))
        count = some.stop - low
        if distant is not None:
            towards, irradiance = np.ascontiguousarray(distant.T[None]), common
        else:
            towards, irradiance = np.empty((count, 3, n)), ones
            for k, light in enumerate(lights):
                towards[..., k], E, _ = arriving(light, positions[at[some]])
                lit = np.asarray((E > 0).all(axis=1))
                radiance[k, some] /= np.where(lit[:, None], E, 1)
                clipped[k, some] |= ~lit
        scale = 1 / (3 * irradiance)
        values, counts = np.empty((count, n)), np.empty((count, n), np.uint8)
        kernels.gather(radiance, clipped, low, scale, values)
        kernels.solve(values, towards, robust, g[some], counts, residual[some], error[some])
        kernels.colour(radiance, low, 3 * scale, towards, g[some], counts, albedo[some])
        used[some] = counts.sum(axis=1)

    ones = np.ones((n, 3))
    common = ones if distant is None else np.concatenate([arriving(x, np.zeros((1, 3))).irradiance for x in lights])
    with ThreadPoolExecutor(processors()) as pool:
        for _ in pool.map(block, range(0, pixels, step)):
            pass
    return g, albedo, residual, error, used


def _half(
    progress: Callable[[int, int], None] | None, n: int, before: int, halves: int
) -> Callable[[int, int], None] | None:
    """Tells `progress` of n photographs more, after `before` of `halves` times as many."""
    if progress is None:
        return None
    return lambda done, total: progress(before * n + done * n // total, halves * n)
