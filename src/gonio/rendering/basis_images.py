"""The harmonic basis images of an object: what it looks like under each harmonic of the light (RH 4.3.3, figure 4.3).

    B(x) = sum over l, m of L_lm B_lm(x),   B_lm = albedo / pi A_l Y_lm(n)                          without shadows
                                            B_lm = albedo / pi integral of V(x, w) (n.w)_+ Y_lm(w) d omega    (RH 6.10)

A matte object under any distant light is a sum of nine images, and light is designed by adding them up. Some of each
image is negative, as harmonics are. With shadows degrees above 2 count as well, as far as shadows have edges.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..arrays import Array, floats
from ..brdf.sampling import cosine_direction
from ..cameras import Camera
from ..errors import ArrayError, ParameterError
from ..shapes.view import Shape
from ..sphere.harmonics import degrees_and_orders, harmonics, require_degree
from ..sphere.zonal import clamped_cosine

_GOLDEN = (math.sqrt(5) - 1) / 2
_RAYS = 1 << 18  # at once


def basis_images(
    shape: Shape,
    camera: Camera,
    degree: int = 2,
    *,
    shadows: bool = False,
    samples: int = 512,
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """((degree + 1)^2, rows, columns) float32, of albedo 1, in `index` order; NaN where nothing is met.

    `shadows` traces `samples` rays from each pixel's point, spread by the cosine and the same for every point and run.
    `progress(done, total)` is called in pixels that meet the shape.
    Raises `ParameterError` for a degree that is none, and for samples that are no whole number from one up.
    """
    require_degree(degree)
    if not isinstance(samples, int | np.integer) or samples < 1:
        raise ParameterError(f"samples = {samples} is not a whole number >= 1.")
    view = shape.view(camera)
    m, l = view.mask, degrees_and_orders(degree)[0]
    images = np.full(((degree + 1) ** 2, *m.shape), np.nan, np.float32)
    if not shadows:
        images[:, m] = (harmonics(degree, view.normal[m]) * (clamped_cosine(degree)[l] / math.pi)).T
        return images
    k = np.arange(samples)
    local = cosine_direction(np.stack(((k + 0.5) / samples, (k * _GOLDEN) % 1.0), axis=-1))
    frames, lifted = view.frames[m], view.lifted[m]
    met = np.empty((len(lifted), l.size), np.float32)
    step = max(1, _RAYS // samples)
    for low in range(0, len(lifted), step):
        some = slice(low, low + step)
        w = local @ frames[some]  # (sites, samples, 3)
        arrives = ~shape.occluded(np.broadcast_to(lifted[some, None], w.shape), w)
        # Rays are as dense as the cosine over pi: their mean is the integral.
        met[some] = np.einsum("nk,nkj->nj", arrives.astype(np.float64), harmonics(degree, w)) / samples
        if progress is not None:
            progress(min(low + step, len(lifted)), len(lifted))
    images[:, m] = met.T
    return images


def relit(images: Array, light: Array) -> Array:
    """The image (rows, columns, C) under light of coefficients ((degree + 1)^2, C); NaN stays. Nothing is cut at 0.

    Raises `ArrayError` where there are not as many images as coefficients.
    """
    xp, images, light = floats(images, light)
    if images.ndim != 3 or light.ndim != 2 or images.shape[0] != light.shape[0]:
        raise ArrayError(
            f"images have shape {tuple(images.shape)}, light {tuple(light.shape)}: one image, (rows, columns), "
            "for each coefficient (C,)."
        )
    return xp.tensordot(xp.permute_dims(images, (1, 2, 0)), light, axes=1)


def signed_colours(images: np.ndarray) -> np.ndarray:
    """Pictures (K, rows, columns, 3) of images (K, rows, columns): orange above 0, blue below, black where NaN.

    Linear display colours in [0, 1]; one scale for all, so that they can be compared.
    """
    finite = np.nan_to_num(images)
    largest = max(float(np.abs(finite).max()), 1e-30)
    above, below = (np.clip(s * finite / largest, 0, 1)[..., None] for s in (1, -1))
    colours: np.ndarray = above * np.array([1.0, 0.45, 0.1]) + below * np.array([0.1, 0.4, 1.0])
    return colours
