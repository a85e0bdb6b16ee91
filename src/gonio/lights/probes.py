"""The mirror ball in a photograph: from the frame of the camera to a `MirrorBall` picture.

    probe = Environment(cut_ball(photograph, centre, radius), MirrorBall(distance), Orientation.PROBE)

The outline of a ball is a circle where the camera looks at its centre; off the axis of a wide lens it is an ellipse,
and then the picture has to be rectified first. Not here: finding the ball.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Array, floats, to_numpy
from ..errors import ArrayError, ParameterError


def cut_ball(photograph: Array, centre: tuple[float, float], radius: float) -> np.ndarray:
    """The square around a ball, (n, n, C), n = 2 radius rounded up: bilinear, with the ball's outline at its edges.

    photograph: (rows, columns, C), linear. centre: (row, column) of the ball's centre, and radius of its outline, in
    pixels, where (0, 0) is the photograph's upper left corner and the first pixel's centre lies at (1/2, 1/2).
    Raises `ParameterError` where the ball does not lie within the photograph, `ArrayError` for other shapes.
    """
    _, image = floats(to_numpy(photograph))
    if image.ndim != 3:
        raise ArrayError(f"photograph has shape {image.shape}; it is (rows, columns, C).")
    rows, columns = image.shape[:2]
    if not (radius >= 1 and radius <= min(centre[0], rows - centre[0], centre[1], columns - centre[1])):
        raise ParameterError(
            f"a ball of radius {radius} around {centre} does not lie within a photograph of {rows} x {columns}."
        )
    n = math.ceil(2 * radius)
    offset = ((np.arange(n) + 0.5) * (2 / n) - 1) * radius

    def between(middle: float, count: int) -> tuple[np.ndarray, np.ndarray]:
        at = np.clip(middle + offset - 0.5, 0, count - 1)
        low = np.minimum(at.astype(np.int64), max(count - 2, 0))
        return low, (at - low).astype(image.dtype)

    i, f = between(centre[0], rows)
    j, g = between(centre[1], columns)
    f, g = f[:, None, None], g[None, :, None]
    top = image[i][:, j] * (1 - g) + image[i][:, j + 1] * g
    bottom = image[i + 1][:, j] * (1 - g) + image[i + 1][:, j + 1] * g
    ball: np.ndarray = top * (1 - f) + bottom * f
    return ball
