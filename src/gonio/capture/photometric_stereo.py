"""Normals and albedo of a matte object from photographs under known distant lights (Woodham 1980).

    I_k = albedo n.l_k s_k,  n.l_k > 0         I_k the mean of the channels, l_k, s_k direction and intensity of light k

g = albedo n by least squares over the lights that a pixel faces. Shadows that others cast and highlights do not fit:
the robust fit, which is the default, first minimises the sum of absolute residuals, and then takes the least squares of
those photographs that lie within three standard deviations of it, by the median. Albedo is relative: what the pixel
sends for intensity 1 head on. Not here: lights nearby, highlights that are modelled, lights that are unknown.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from .._kernels import photometric_stereo as kernels
from ..errors import MEMORY_LIMIT, ArrayError, MemoryLimitError
from ..reflection import processors
from .model import Capture

_PIXELS = 4096  # solved at once


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

    Clipped pixels do not count. `progress(done, total)` hears of photographs, which are read twice. Raises `ArrayError`
    where lights are unknown, fewer than three, or all in a plane, `MemoryLimitError` before memory is taken for too
    many pixels.
    """
    lights = capture.directions
    if lights is None:
        raise ArrayError("the capture's lights are unknown. Calibrate them by a mirror ball, or give their directions.")
    if len(lights) < 3 or np.linalg.svd(lights, compute_uv=False)[2] < 1e-3:
        raise ArrayError(f"{len(lights)} lights, which do not span space: normals want three that are in no plane.")
    at = np.flatnonzero(capture.mask)
    n, pixels = len(lights), at.size
    if 5 * n * pixels > MEMORY_LIMIT:
        raise MemoryLimitError(f"{n} photographs of {pixels} pixels exceed the memory limit. Mask what is wanted.")
    values = np.empty((n, pixels), np.float32)
    for k in range(n):
        radiance, clipped = capture.photographs.read(k)
        kernels.gather(radiance.reshape(-1, 3), clipped.reshape(-1), at, 1 / (3 * capture.intensities[k]), values[k])
        _say(progress, k + 1, 2 * n)
    planes = np.ascontiguousarray(lights.T)
    g, residual, error = np.empty((pixels, 3)), np.empty(pixels), np.empty(pixels)
    counts = np.empty((pixels, n), np.uint8)

    def block(low: int) -> None:
        some = slice(low, low + _PIXELS)
        by_pixel = np.ascontiguousarray(values[:, some].T, dtype=np.float64)
        kernels.solve(by_pixel, planes, robust, g[some], counts[some], residual[some], error[some])

    with ThreadPoolExecutor(processors()) as pool:
        for _ in pool.map(block, range(0, pixels, _PIXELS)):
            pass
    length = np.linalg.norm(g, axis=1)
    # The albedo of each channel, by least squares over the photographs that count.
    top, bottom = np.zeros((pixels, 3)), np.zeros(pixels)
    for k in range(n):
        radiance = capture.photographs.read(k).radiance.reshape(-1, 3)
        kernels.accumulate(radiance, at, 1 / capture.intensities[k], g, lights[k], counts[:, k], top, bottom)
        _say(progress, n + k + 1, 2 * n)
    albedo = top * (length / np.where(bottom > 0, bottom, np.nan))[:, None]

    def spread(x: np.ndarray) -> np.ndarray:
        image = np.full((capture.mask.size, *x.shape[1:]), np.nan, np.float32)
        image[at] = x
        return image.reshape(*capture.mask.shape, *x.shape[1:])

    used = np.zeros(capture.mask.size, np.intp)
    used[at] = counts.sum(axis=1)
    used = used.reshape(capture.mask.shape)
    return Relief(spread(g / length[:, None]), spread(albedo), spread(residual / length), spread(error), used)


def _say(progress: Callable[[int, int], None] | None, done: int, total: int) -> None:
    if progress is not None:
        progress(done, total)
