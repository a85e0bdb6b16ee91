"""The direction of a light from the shading of a matte ball, to check what mirror balls tell.

    B = albedo max(n.l, 0),   n = ((x - x0) / r, -(y - y0) / r, sqrt(1 - ..))  orthographic

Lambert's law is linear in l where the ball is lit; weights fall off with the distance from it (Geman and McClure 1987).

Frame: x right (columns), y up (against rows), z to the viewer. Image coordinates and photographs are as in `circles`.

Not here: lamps whose strength falls off across the ball, and matte balls under perspective.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..errors import ArrayError
from .circles import Circle, mean_channel


def light_of_matte_ball(photograph: Array, circle: Circle) -> np.ndarray:
    """l (3,) of radiance = max(n.l, 0) on a gray matte ball, orthographic: the direction to a distant light, l / |l|.

    |l| is the radiance of a patch that faces the light, albedo times irradiance / pi. Least squares over the lit
    pixels, which are found by turns with l; pixels that fit badly (a glint, dirt, a stand) lose their weight.

    Raises `ArrayError` where the ball is black or outside the image, or no light from the viewer's side explains it.
    """
    radiance = mean_channel(photograph, "photograph")
    row, column, off = circle.square(radiance.shape)
    # Towards the rim pixels mix with the background, and an error of the circle turns the normal most.
    inside = off < 0.95 * circle.radius
    n = circle.normals(np.stack((row[inside] + 0.5, column[inside] + 0.5), axis=-1))
    values = radiance[row, column][inside]
    if len(values) < 50 or not values.max() > 0:
        raise ArrayError(f"photograph shows {len(values)} pixels of the ball, none of them lit; 50 are asked for.")
    lit, before = values > 0.25 * np.percentile(values, 99), np.zeros(3)
    weight = lit.astype(np.float64)
    for _ in range(50):
        if lit.sum() < 50 or np.linalg.matrix_rank(n[lit]) < 3:
            raise ArrayError("photograph shows no ball lit by one light: too few pixels agree. Is the ball matte?")
        l = np.linalg.solve((n * weight[:, None]).T @ n, n.T @ (weight * values))
        predicted = n @ l
        # Close to the terminator a light that is no point fades, and the matte law ends.
        now = predicted > 0.1 * np.linalg.norm(l)
        miss = values - predicted
        scale = max(1.4826 * float(np.median(np.abs(miss[now]))) if now.any() else 0.0, 1e-6 * values.max())
        weight = now / (1 + (miss / (5 * scale)) ** 2) ** 2
        if (now == lit).all() and np.linalg.norm(l - before) < 1e-9 * np.linalg.norm(l):
            break
        lit, before = now, l
    return l
