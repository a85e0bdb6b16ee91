"""Light directions from photographs of mirror balls: chrome, black snooker balls.

    n = ((x - x0) / r, -(y - y0) / r, sqrt(1 - ..)),   L = 2 (n.v) n - v       orthographic: v = (0, 0, 1)
    |t u - c| = 1,   n = t u - c,   L = u - 2 (n.u) n                          pinhole: u the pixel's ray, c the ball

Mudge et al. 2006 (RTI by highlights); the orthographic map is the `MirrorBall` of environment maps (Miller and Hoffman
1984).

Frame: x right (columns), y up (against rows), z to the viewer. Image coordinates and photographs are as in `circles`.
Answers are NumPy's, in double precision.

Not here: the ball's outline (`circles`), where near lamps stand (`lamps`), and the radiance of the whole surroundings
(a mirror ball as an environment map is in `lights`).
"""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage

from ..arrays import Array, require_finite, to_numpy
from ..cameras import Pinhole
from ..directions import dot, normalise, reflect
from ..errors import ArrayError, ParameterError
from .circles import Circle, heaviest, least_squares, mean_channel

# A highlight stands out by this factor, and covers no more of the ball than this (a lamp of 45 degrees' radius).
_LEAST_CONTRAST, _MOST_OF_BALL = 2.0, 0.15


def highlight(photograph: Array, circle: Circle) -> tuple[float, float]:
    """(row, column) of the centre of the brightest highlight within `circle`, in image coordinates.

    Of the pixels brighter than halfway from the ball's median to its maximum, the connected part with most radiance:
    its centroid with the pixels next to it, weighted by the radiance above the median. Of a clipped highlight (more
    than four pixels at the maximum) the clipped part, likewise: glare around it need not be centred.

    Raises `ArrayError` where the ball shows no highlight: it lies outside the image, is black, is less than twice as
    bright anywhere as at its median, or is bright over more of itself than a lamp could be.
    """
    radiance = mean_channel(photograph, "photograph")
    row, column, off = circle.square(radiance.shape)
    values = radiance[row, column]
    inside = off < circle.radius
    if not inside.any():
        raise ArrayError(f"circle around {_place(circle.centre)} lies outside the photograph of {radiance.shape}.")
    values = np.where(inside, values, -np.inf)
    most, median = float(values.max()), max(float(np.median(values[inside])), 0.0)
    if not most > _LEAST_CONTRAST * median:
        raise ArrayError(
            f"photograph has no highlight on the ball: its brightest pixel, {most:.4g}, is not {_LEAST_CONTRAST:g} "
            f"times the median, {median:.4g}. Was the lamp on, and is the ball a mirror?"
        )
    excess = np.where(inside, np.maximum(values - median, 0.0), 0.0)
    part = heaviest(values > (most + median) / 2, excess)
    if part.sum() > max(_MOST_OF_BALL * inside.sum(), 9):  # nine pixels may be a small lamp on any ball
        raise ArrayError(
            "photograph has no highlight on the ball: its brightest part covers "
            f"{part.sum() / inside.sum():.0%} of it. Is the ball a mirror?"
        )
    if (clipped := part & (values == most)).sum() > 4:
        part = heaviest(clipped, excess)
    # The pixels next to it are those that the highlight's edge cuts.
    weight = excess * ndimage.binary_dilation(part, np.ones((3, 3)))
    weight /= weight.sum()
    return float((weight * (row + 0.5)).sum()), float((weight * (column + 0.5)).sum())


def light_directions(highlights: Array, circle: Circle, camera: Pinhole | None = None) -> np.ndarray:
    """Unit directions (N, 3) to the lamps whose highlights are at `highlights` (N, 2), (row, column), on a mirror ball.

    camera: through which the ball was seen. Without one the view is orthographic. With one, perspective is accounted
        for: the ball stands where its outline puts it, and each pixel's own ray is reflected. The frame is x right,
        y up, z back from the camera, whatever its pose; `to_opengl(camera.pose)[:3, :3] @ L` is in the world.

    Without the camera, a ball 13 degrees off the axis costs 6 to 15 degrees. A near lamp's direction is that from
    where its highlight lies, `highlight_points`. Raises `ArrayError` where a highlight lies outside the circle.
    """
    return _reflected(highlights, circle, camera)[1]


def highlight_points(highlights: Array, circle: Circle, camera: Pinhole | None = None) -> np.ndarray:
    """Where on the ball the highlights lie: (N, 3) in radii of the ball, in the frame of `light_directions`.

    From the camera where one is given, otherwise from the ball's centre, so that times the ball's radius (and with the
    centre added) they are where rays to a near lamp start. Arguments and errors are those of `light_directions`.
    """
    return _reflected(highlights, circle, camera)[0]


def _reflected(highlights: Array, circle: Circle, camera: Pinhole | None) -> tuple[np.ndarray, np.ndarray]:
    """Points on the ball of radius 1 and the directions to the lamps, each (N, 3)."""
    places = to_numpy(highlights).astype(np.float64)
    if places.ndim != 2 or places.shape[1] != 2:
        raise ArrayError(f"highlights has shape {places.shape}; expected (N, 2), row and column.")
    require_finite(places, "highlights")
    if camera is None:
        offset = places - circle.centre
        _require_inside((offset * offset).sum(axis=1) < circle.radius**2, places, circle)
        n = circle.normals(places)
        return n, np.asarray(reflect(np.array([0.0, 0.0, 1.0]), n))
    if not isinstance(camera, Pinhole):
        raise ParameterError(f"camera is {type(camera).__name__}; pass a Pinhole, or none for an orthographic view.")
    c = _ball(circle, camera)
    u = _rays(camera, places)
    along = u @ c
    across = c - along[:, None] * u
    depth = 1 - dot(across, across)
    _require_inside(depth > 0, places, circle)
    points = (along - np.sqrt(depth))[:, None] * u
    return points, np.asarray(reflect(-u, points - c))


def _ball(circle: Circle, camera: Pinhole) -> np.ndarray:
    """The centre (3,) of the ball of radius 1 whose outline through `camera` has `circle` as its nearest circle.

    The outline is where the cone around the ball meets the image: an ellipse, if there is no distortion, whose centre
    is not the image of the ball's. The cone is turned and widened by what its circle misses, until nothing is left.
    """
    target = np.array((*circle.centre, circle.radius))
    axis, radius = target[:2], circle.radius
    azimuth = np.arange(360) * (2 * math.pi / 360)
    for _ in range(100):
        # The half angle by the rays at both ends of a diameter.
        a, u, b = _rays(camera, axis + np.array([[0.0, -radius], [0.0, 0.0], [0.0, radius]]))
        half = math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b)) / 2
        s = normalise(np.cross(u, (0.0, 1.0, 0.0)))
        rim = np.cos(azimuth)[:, None] * s + np.sin(azimuth)[:, None] * np.cross(u, s)
        outline = _places(camera, math.cos(half) * u + math.sin(half) * rim)
        if not np.isfinite(outline).all():
            break
        # Points of an outline seen in a photograph lie evenly along it.
        length = np.linalg.norm(np.roll(outline, -1, axis=0) - np.roll(outline, 1, axis=0), axis=-1)
        miss = target - least_squares(outline, np.array((*axis, radius)), length)
        if np.abs(miss).max() < 1e-7 * circle.radius:
            return np.asarray(u / math.sin(half))
        axis, radius = axis + miss[:2], radius + float(miss[2])
    raise ParameterError(
        f"camera sees no ball with the outline {circle}: do the circle's pixels and the camera's focal length, "
        f"fx = {camera.fx:g}, belong to the same size of image?"
    )


def _rays(camera: Pinhole, places: np.ndarray) -> np.ndarray:
    """Unit directions (..., 3) of the rays at (row, column): x right, y up, z back."""
    u = camera.rays(places[..., ::-1])[1] @ camera.pose[:3, :3]
    return np.asarray(u * (1.0, -1.0, -1.0))


def _places(camera: Pinhole, directions: np.ndarray) -> np.ndarray:
    """(row, column), (..., 2), where `directions` (..., 3) are seen: the inverse of `_rays`."""
    world = camera.position + (directions * (1.0, -1.0, -1.0)) @ camera.pose[:3, :3].T
    return camera.project(world)[0][..., ::-1]


def _require_inside(inside: np.ndarray, places: np.ndarray, circle: Circle) -> None:
    if not inside.all():
        k = int(np.argmin(inside))
        raise ArrayError(
            f"highlights[{k}] = {_place(places[k])} lies outside the ball, the circle of radius {circle.radius:.1f} "
            f"around {_place(circle.centre)}. Highlights are (row, column)."
        )


def _place(place: Array) -> str:
    return f"({place[0]:.1f}, {place[1]:.1f})"
