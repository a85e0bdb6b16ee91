"""Light directions from photographs of balls: mirror balls (chrome, black snooker balls), and matte ones to check them.

    n = ((x - x0) / r, -(y - y0) / r, sqrt(1 - ..)),   L = 2 (n.v) n - v       orthographic: v = (0, 0, 1)
    |t u - c| = 1,   n = t u - c,   L = u - 2 (n.u) n                          pinhole: u the pixel's ray, c the ball
    B = albedo max(n.l, 0)                                                     matte ball
    p_k = argmin over p of the sum over balls of |(I - L L^T) (p - o)|^2       lamps near several balls

Mudge et al. 2006 (RTI by highlights); the orthographic map is the `MirrorBall` of environment maps (Miller and Hoffman
1984). A circle in an image is found by the votes of gradients (Hough; Kimme, Ballard and Sklansky 1975) and refined by
Gauss-Newton steps whose weights fall off with distance (Geman and McClure 1987).

Frame: x right (columns), y up (against rows), z to the viewer. Image coordinates (row, column) are 0, 0 at the top left
corner; the centre of pixel (r, c) is (r + 1/2, c + 1/2). Photographs are linear radiance, (rows, columns) or (rows,
columns, C), whose channels are averaged. Answers are NumPy's, in double precision.

Not here: the radiance of the whole surroundings (a mirror ball as an environment map is in `lights`), lamps whose
strength falls off across the ball, and matte balls under perspective.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from scipy import ndimage

from ..arrays import Array, require_finite, to_numpy
from ..cameras import Pinhole
from ..directions import dot, normalise, reflect, require_unit
from ..errors import ArrayError, ParameterError

# The image is brought to about this many pixels a side before circles are sought: finer edges add only time.
_SEARCH_SIZE = 400
# Of the outline of a ball, at least this share must show as an edge: below it, chance finds circles anywhere.
_LEAST_OUTLINE = 0.35
# A highlight stands out by this factor, and covers no more of the ball than this (a lamp of 45 degrees' radius).
_LEAST_CONTRAST, _MOST_OF_BALL = 2.0, 0.15
# Rays whose rms angle from their mean is less (degrees) meet nowhere that highlights could tell: they are good to 0.2.
_PARALLEL = 0.5


@dataclasses.dataclass(frozen=True)
class Circle:
    """The outline of a ball: `centre` (row, column) and `radius` in pixels.

    `residual` is the rms distance of the outline's points from the circle, in pixels, points apart from it (a stand, a
    neighbour) left out; about 0.3 for a mask, whose points lie midway between pixels. Raises `ArrayError` where a
    number is not finite, `ParameterError` where the radius is not positive.
    """

    centre: tuple[float, float]
    radius: float
    residual: float = 0.0

    def __post_init__(self) -> None:
        values = np.asarray((*self.centre, self.radius, self.residual), dtype=np.float64)
        if values.shape != (4,):
            raise ArrayError(f"Circle: centre = {self.centre!r} is not (row, column).")
        require_finite(values, "Circle (row, column, radius, residual)")
        if not values[2] > 0:
            raise ParameterError(f"Circle: radius = {self.radius:g} is not a positive number of pixels.")
        object.__setattr__(self, "centre", (float(values[0]), float(values[1])))
        object.__setattr__(self, "radius", float(values[2]))
        object.__setattr__(self, "residual", float(values[3]))


@dataclasses.dataclass(frozen=True, eq=False)
class LightPositions:
    """Where N lamps stand, in the frame and unit of the balls.

    positions: (N, 3), infinite where the lamp is distant.
    residual: (N,), rms distance of the balls' rays from the position; NaN where the lamp is distant.
    distant: (N,) bool, True where the balls' rays are parallel within what highlights can tell.
    """

    positions: np.ndarray
    residual: np.ndarray
    distant: np.ndarray


def circle_of_mask(mask: Array) -> Circle:
    """The circle around a ball's `mask` (rows, columns), bool, True on the ball.

    Holes are filled, and the largest connected part is the ball. Where the frame cuts the ball, the rest of the outline
    decides; a stand or a neighbour in the mask is left out if it takes up less than a third of the outline.

    Raises `ArrayError` where the mask is no image of bools, has no outline, or is not round.
    """
    mask = to_numpy(mask)
    if mask.ndim != 2 or mask.dtype != np.bool_:
        raise ArrayError(
            f"mask has shape {mask.shape} and dtype {mask.dtype}; expected (rows, columns) of bool. "
            "Of an 8-bit mask pass mask > 127, one channel."
        )
    if not mask.any():
        raise ArrayError("mask is False everywhere: it shows no ball.")
    ball = ndimage.binary_fill_holes(_heaviest(mask, mask))
    # Midway between a pixel inside and its neighbour outside: off by less than half a pixel, and by nothing on average.
    row, column = np.nonzero(ball[1:] != ball[:-1])
    row_, column_ = np.nonzero(ball[:, 1:] != ball[:, :-1])
    points = np.concatenate(
        (np.stack((row + 1.0, column + 0.5), axis=-1), np.stack((row_ + 0.5, column_ + 1.0), axis=-1))
    )
    if len(points) < 12:
        raise ArrayError(f"mask has an outline of {len(points)} points within the image; a circle needs 12 or more.")
    circle, kept = _fit(points, _algebraic(points))
    if kept.mean() < 2 / 3 or circle.residual > 0.5 + 0.03 * circle.radius:
        raise ArrayError(
            f"mask is not round: {kept.mean():.0%} of its outline lie on one circle, {circle.residual:.1f} pixels from "
            "it (rms). Mask one ball, all of it."
        )
    return circle


def find_circle(image: Array) -> Circle:
    """The ball in `image`: the mean of all photographs of it serves best, since every light shows other edges.

    The circle sought has the most edge along it, in proportion and in number; its radius is between 1/12 and 1/2 of the
    image's shorter side. For a photograph of one ball before a background that differs from it along a good third of
    its outline. The radiance's logarithm is searched: a dark ball has edges as a bright one has.

    Raises `ArrayError` where no circle stands out, or `image` is not as above. Mask the ball and use `circle_of_mask`.
    """
    radiance = _radiance(image, "image")
    if min(radiance.shape) < 32:
        raise ArrayError(f"image has shape {radiance.shape}; a ball is sought in 32 x 32 pixels or more.")
    if not radiance.max() > 0:
        raise ArrayError("image is black: it shows no ball.")
    step = max(1, round(math.sqrt(radiance.size) / _SEARCH_SIZE))
    rows, columns = (n // step * step for n in radiance.shape)
    small = radiance[:rows, :columns].reshape(rows // step, step, columns // step, step).mean(axis=(1, 3))
    points, normals = _edges(_logarithm(small))
    best, found = 0.0, None
    for row, column, radius in _candidates(points, normals, small.shape):
        circle = Circle((row, column), radius)
        # Twice: the first from points that a vote's cell may miss by, the second from the outline's own.
        for width in (0.08, 0.03):
            near = _along(points, normals, circle, max(2.0, width * circle.radius))
            if near.sum() < 12:
                break
            circle, _ = _fit(points[near], np.array((*circle.centre, circle.radius)))
        else:
            share = _share(points[_along(points, normals, circle, 1.0)], circle)
            if circle.radius < min(small.shape) and share > _LEAST_OUTLINE and share * math.sqrt(circle.radius) > best:
                best, found = share * math.sqrt(circle.radius), circle
    if found is not None:
        start = Circle((found.centre[0] * step, found.centre[1] * step), found.radius * step)
        # Of radiance itself: the logarithm moves an edge that is not sharp to its darker side.
        circle, share = _refined(radiance, start, 2.0 + step)
        moved = math.dist(circle.centre, start.centre) + abs(circle.radius - start.radius)
        # Where chance or a round stain made the circle, its edge wavers; a ball's does by a fraction of a pixel.
        if share > _LEAST_OUTLINE and circle.residual < 0.3 + 0.005 * circle.radius and moved < 2 * (2.0 + step):
            return circle
    raise ArrayError("image shows no ball: no circle has an edge along a third of it. Mask it: circle_of_mask.")


def highlight(photograph: Array, circle: Circle) -> tuple[float, float]:
    """(row, column) of the centre of the brightest highlight within `circle`, in image coordinates.

    Of the pixels brighter than halfway from the ball's median to its maximum, the connected part with most radiance:
    its centroid with the pixels next to it, weighted by the radiance above the median. Of a clipped highlight (more
    than four pixels at the maximum) the clipped part, likewise: glare around it need not be centred.

    Raises `ArrayError` where the ball shows no highlight: it lies outside the image, is black, is less than twice as
    bright anywhere as at its median, or is bright over more of itself than a lamp could be.
    """
    radiance = _radiance(photograph, "photograph")
    row, column, off = _disc(radiance, circle)
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
    part = _heaviest(values > (most + median) / 2, excess)
    if part.sum() > max(_MOST_OF_BALL * inside.sum(), 9):  # nine pixels may be a small lamp on any ball
        raise ArrayError(
            "photograph has no highlight on the ball: its brightest part covers "
            f"{part.sum() / inside.sum():.0%} of it. Is the ball a mirror?"
        )
    if (clipped := part & (values == most)).sum() > 4:
        part = _heaviest(clipped, excess)
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


def light_positions(origins: Array, directions: Array) -> LightPositions:
    """Where N lamps stand that B balls show in `directions` (B, N, 3), unit: nearest to all rays, by least squares.

    origins: (B, 3), the balls' centres, or (B, N, 3), where on them the highlights lie (`highlight_points`). Centres
        leave the position off by up to a ball's radius. Any unit, in the frame of the directions.

    A lamp is distant where the rays, rms, are less than half a degree from their mean direction. Raises `ArrayError`
    for other shapes, fewer than two balls, or a lamp whose rays run apart; `DirectionError` where one is not unit.
    """
    o, d = (to_numpy(a).astype(np.float64) for a in (origins, directions))
    if d.ndim != 3 or d.shape[2] != 3 or d.shape[0] < 2:
        raise ArrayError(f"directions has shape {d.shape}; expected (balls, lights, 3), two balls or more.")
    if o.shape not in ((d.shape[0], 3), d.shape):
        raise ArrayError(f"origins has shape {o.shape}; expected {(d.shape[0], 3)} or {d.shape}, as directions has.")
    require_finite(o, "origins")
    require_unit(d, "directions")
    d = normalise(d)
    o = np.broadcast_to(o[:, None] if o.ndim == 2 else o, d.shape)
    across = np.eye(3) - d[..., :, None] * d[..., None, :]
    # The least eigenvalue is the sum of the squared sines of the rays' angles from the direction nearest to all.
    total = across.sum(axis=0)
    distant = np.sqrt(np.linalg.eigvalsh(total)[:, 0].clip(0) / len(d)) < math.sin(math.radians(_PARALLEL))
    safe = np.where(distant[:, None, None], np.eye(3), total)
    moment = np.einsum("bnij,bnj->ni", across, o)
    p = np.linalg.solve(safe, moment[..., None])[..., 0]
    ahead = dot(p - o, d)
    apart = ~distant & (ahead <= 0).any(axis=0)
    if apart.any():
        light = int(np.argmax(apart))
        raise ArrayError(
            f"the rays to light {light} run apart: they come nearest behind ball {int(np.argmin(ahead[:, light]))}. "
            "Is one of the highlights another lamp's, or are the balls in another order than their origins?"
        )
    miss = np.einsum("bnij,bnj->bni", across, p - o)
    residual = np.sqrt(dot(miss, miss).mean(axis=0))
    return LightPositions(
        positions=np.where(distant[:, None], np.inf, p), residual=np.where(distant, np.nan, residual), distant=distant
    )


def light_of_matte_ball(photograph: Array, circle: Circle) -> np.ndarray:
    """l (3,) of radiance = max(n.l, 0) on a gray matte ball, orthographic: the direction to a distant light, l / |l|.

    |l| is the radiance of a patch that faces the light, albedo times irradiance / pi. Least squares over the lit
    pixels, which are found by turns with l; pixels that fit badly (a glint, dirt, a stand) lose their weight.

    Raises `ArrayError` where the ball is black or outside the image, or no light from the viewer's side explains it.
    """
    radiance = _radiance(photograph, "photograph")
    row, column, off = _disc(radiance, circle)
    # Towards the rim pixels mix with the background, and an error of the circle turns the normal most.
    inside = off < 0.95 * circle.radius
    n = _normals(np.stack((row[inside] + 0.5, column[inside] + 0.5), axis=-1), circle)
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


def _reflected(highlights: Array, circle: Circle, camera: Pinhole | None) -> tuple[np.ndarray, np.ndarray]:
    """Points on the ball of radius 1 and the directions to the lamps, each (N, 3)."""
    places = to_numpy(highlights).astype(np.float64)
    if places.ndim != 2 or places.shape[1] != 2:
        raise ArrayError(f"highlights has shape {places.shape}; expected (N, 2), row and column.")
    require_finite(places, "highlights")
    if camera is None:
        offset = places - circle.centre
        _require_inside((offset * offset).sum(axis=1) < circle.radius**2, places, circle)
        n = _normals(places, circle)
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
        miss = target - _least_squares(outline, np.array((*axis, radius)), length)
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


def _normals(places: np.ndarray, circle: Circle) -> np.ndarray:
    """Normals (N, 3) of a ball seen orthographically, at (row, column) within its circle."""
    y, x = ((places - circle.centre) / circle.radius).T
    return np.stack((x, -y, np.sqrt(np.maximum(1 - x * x - y * y, 0.0))), axis=-1)


def _require_inside(inside: np.ndarray, places: np.ndarray, circle: Circle) -> None:
    if not inside.all():
        k = int(np.argmin(inside))
        raise ArrayError(
            f"highlights[{k}] = {_place(places[k])} lies outside the ball, the circle of radius {circle.radius:.1f} "
            f"around {_place(circle.centre)}. Highlights are (row, column)."
        )


def _place(place: Array) -> str:
    return f"({place[0]:.1f}, {place[1]:.1f})"


def _radiance(image: Array, name: str) -> np.ndarray:
    """`image` (rows, columns) or (rows, columns, C), checked, as the mean of its channels (rows, columns)."""
    values = to_numpy(image)
    if values.ndim not in (2, 3) or values.size == 0 or values.dtype.kind not in "fiu":
        raise ArrayError(
            f"{name} has shape {values.shape} and dtype {values.dtype}; expected numbers, (rows, columns) or "
            "(rows, columns, channels)."
        )
    require_finite(values, name)
    values = values.astype(np.float64)
    return values if values.ndim == 2 else np.asarray(values.mean(axis=2))


def _disc(image: np.ndarray, circle: Circle) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, columns and distances from the centre of the pixels in the square around `circle`, each (h, w)."""
    spans = [
        np.arange(max(0, math.floor(c - circle.radius)), max(0, min(n, math.ceil(c + circle.radius))))
        for c, n in zip(circle.centre, image.shape, strict=True)
    ]
    row, column = np.meshgrid(*spans, indexing="ij")
    return row, column, np.hypot(row + 0.5 - circle.centre[0], column + 0.5 - circle.centre[1])


def _heaviest(marked: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """The connected part of `marked` with the largest sum of `weight`, as bool of the same shape."""
    label, parts = ndimage.label(marked)
    return np.asarray(label == 1 + np.argmax(ndimage.sum_labels(weight, label, np.arange(1, parts + 1))))


def _algebraic(points: np.ndarray) -> np.ndarray:
    """(row, column, radius) of the circle p.p = 2 c.p + k nearest to `points` (N, 2) in k (Kasa 1976)."""
    middle = points.mean(axis=0)
    p = points - middle
    (row, column, k), *_ = np.linalg.lstsq(np.column_stack((2 * p, np.ones(len(p)))), (p * p).sum(axis=1), rcond=None)
    return np.array((row + middle[0], column + middle[1], math.sqrt(max(k + row * row + column * column, 0.0))))


def _least_squares(points: np.ndarray, start: np.ndarray, weight: np.ndarray, steps: int = 20) -> np.ndarray:
    """(row, column, radius) of the circle with least weighted squared distances from `points`: Gauss-Newton."""
    circle = start
    for _ in range(steps):
        to = points - circle[:2]
        distance = np.maximum(np.hypot(*to.T), 1e-12)
        slope = np.column_stack((to / distance[:, None], np.ones(len(to))))
        moments = slope.T @ (weight * (distance - circle[2]))
        step = np.linalg.lstsq((slope * weight[:, None]).T @ slope, moments, rcond=None)[0]
        circle = circle + step
        if np.abs(step).max() < 1e-10 * circle[2]:
            break
    return circle


def _fit(points: np.ndarray, start: np.ndarray) -> tuple[Circle, np.ndarray]:
    """The circle through most of `points` (N, 2), and which of them it was fitted to, (N,) bool."""
    circle = start
    for _ in range(20):
        off = np.abs(np.hypot(*(points - circle[:2]).T) - circle[2])
        # Points of a mask are known to half a pixel: below that the median says nothing.
        scale = max(2 * float(np.median(off)), 0.5)
        before = circle
        circle = _least_squares(points, circle, 1 / (1 + (off / scale) ** 2) ** 2, steps=1)
        if np.abs(circle - before).max() < 1e-3:
            break
    off = np.abs(np.hypot(*(points - circle[:2]).T) - circle[2])
    kept = off < 3 * max(1.4826 * float(np.median(off)), 0.3)
    row, column, radius = _least_squares(points[kept], circle, np.ones(int(kept.sum())))
    off = np.hypot(*(points[kept] - (row, column)).T) - radius
    if not radius > 0:
        raise ArrayError("the outline's points lie on no circle.")
    return Circle((row, column), radius, math.sqrt(float(np.mean(off * off)))), kept


def _logarithm(radiance: np.ndarray) -> np.ndarray:
    """log of `radiance` above a floor, 1/20 of its mean, under which photographs hold nothing but noise."""
    return np.asarray(np.log(np.maximum(radiance, 0.0) + 0.05 * radiance.mean()))


def _edges(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the gradient of `image` is largest along itself: points (N, 2) below a pixel, and unit normals (N, 2)."""
    sigma = 1.5
    gradient = np.stack([ndimage.gaussian_filter(image, sigma, order=k) for k in ((1, 0), (0, 1))])
    strength = np.hypot(*gradient)
    normal = gradient / np.maximum(strength, 1e-300)
    at = np.indices(image.shape, dtype=np.float64)
    above, below = (ndimage.map_coordinates(strength, at + s * normal, order=1, mode="nearest") for s in (1, -1))
    peak = (strength > above) & (strength >= below) & (strength > 1e-6)
    margin = math.ceil(2 * sigma)  # the filter mirrors the image at its frame
    peak[:margin] = peak[-margin:] = peak[:, :margin] = peak[:, -margin:] = False
    # The strongest, as many as six lines across the image have.
    limit = np.sort(strength[peak])[-6 * sum(image.shape) :]
    peak &= strength >= (limit[0] if len(limit) else np.inf)
    shift = 0.5 * (above - below)[peak] / np.maximum(2 * strength - above - below, 1e-300)[peak]
    n = normal[:, peak]
    return (at[:, peak] + 0.5 + shift.clip(-0.5, 0.5) * n).T, n.T


def _candidates(points: np.ndarray, normals: np.ndarray, shape: tuple[int, ...]) -> list[tuple[float, float, float]]:
    """(row, column, radius) of circles that many edges vote for, from both sides: the ball is darker or brighter."""
    side = min(shape)
    cell = max(side / 100, 1.0)
    rows, columns = (math.ceil(n / cell) for n in shape)
    found: list[tuple[float, tuple[float, float, float]]] = []
    for radius in np.geomspace(side / 12, side / 2, 45):
        centres = np.concatenate((points - radius * normals, points + radius * normals)) / cell
        row, column = np.floor(centres).astype(np.int64).T
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        at = row[inside] * columns + column[inside]
        votes = np.bincount(at, minlength=rows * columns).reshape(rows, columns).astype(np.float64)
        # A normal is good to some two degrees, so that votes spread as the radius grows.
        sigma = 0.025 * radius / cell + 0.5
        votes = ndimage.gaussian_filter(votes, sigma, mode="constant") * (sigma * sigma / math.sqrt(radius))
        tops = np.argwhere((votes == ndimage.maximum_filter(votes, 5)) & (votes > 0))
        tops = tops[np.argsort(votes[tuple(tops.T)])[-3:]]
        found += [(float(votes[r, c]), ((r + 0.5) * cell, (c + 0.5) * cell, float(radius))) for r, c in tops]
    return [circle for _, circle in sorted(found, reverse=True)[:40]]


def _along(points: np.ndarray, normals: np.ndarray, circle: Circle, width: float) -> np.ndarray:
    """Which edges lie within `width` of `circle` and run along it, (N,) bool."""
    to = points - circle.centre
    distance = np.hypot(*to.T)
    radial = np.abs((to * normals).sum(axis=1)) > math.cos(math.radians(20)) * distance
    return np.asarray(radial & (np.abs(distance - circle.radius) < width))


def _share(points: np.ndarray, circle: Circle) -> float:
    """The share of the circle's outline with one of `points` at each of its pixels."""
    bins = math.ceil(2 * math.pi * circle.radius / 1.5)
    angle = np.arctan2(*(points - circle.centre).T)
    return len(np.unique(np.floor((angle / (2 * math.pi) + 0.5) * bins))) / bins


def _refined(image: np.ndarray, circle: Circle, reach: float) -> tuple[Circle, float]:
    """`circle` fitted to the steepest places of `image` along its radii within `reach` pixels, and their share."""
    share = 0.0
    angle = np.arange(720) * (2 * math.pi / 720)
    radial = np.stack((np.sin(angle), np.cos(angle)), axis=-1)
    for _ in range(3):
        s = np.arange(-reach - 3, reach + 3.25, 0.5)
        at = circle.centre + (circle.radius + s)[:, None, None] * radial
        profile = ndimage.map_coordinates(image, at.transpose(2, 0, 1) - 0.5, order=1, mode="nearest")
        slope = np.abs(ndimage.gaussian_filter1d(profile, 2.0, axis=0, order=1))[6:-6]
        best = slope.argmax(axis=0)
        inner = (best > 0) & (best < len(slope) - 1)
        k, ray = best[inner], np.nonzero(inner)[0]
        below, peak, above = slope[k - 1, ray], slope[k, ray], slope[k + 1, ray]
        shift = 0.5 * (above - below) / np.maximum(2 * peak - above - below, 1e-300)
        # Where ball and background are alike there is no edge, and the radii say nothing.
        clear = peak > 0.25 * np.percentile(peak, 90)
        points = circle.centre + (circle.radius + s[6:-6][k] + 0.5 * shift)[clear, None] * radial[ray[clear]]
        if len(points) < 12:
            break
        circle, kept = _fit(points, np.array((*circle.centre, circle.radius)))
        share = int(kept.sum()) / len(angle)
    return circle, share
