"""The harmonic basis images of an object: what it looks like under each harmonic of the light (RH 4.3.3, figure 4.3).

    B_lm(x) = A_l / pi Y_lm(n(x)) albedo,      B(x) = sum over l, m of L_lm B_lm(x)

A matte object under any distant light is a sum of nine images, and light is designed by adding them up. Without
shadows; some of each image is negative, as harmonics are.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Array, floats
from ..cameras import Camera
from ..errors import ArrayError
from ..shapes.view import Shape
from ..sphere.harmonics import degrees_and_orders, harmonics, require_degree
from ..sphere.zonal import clamped_cosine


def basis_images(shape: Shape, camera: Camera, degree: int = 2) -> np.ndarray:
    """((degree + 1)^2, rows, columns) float32, of albedo 1, in `index` order; NaN where nothing is met.

    Raises `ParameterError` for a degree that is none.
    """
    require_degree(degree)
    view = shape.view(camera)
    images = np.full(((degree + 1) ** 2, *view.mask.shape), np.nan, np.float32)
    scale = clamped_cosine(degree)[degrees_and_orders(degree)[0]] / math.pi
    images[:, view.mask] = (harmonics(degree, view.normal[view.mask]) * scale).T
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
