"""Circles in images: the outline of a ball, from its mask or sought in a photograph.

    c, r = argmin of the sum of w_i d_i^2,   d_i = |p_i - c| - r,   w_i = 1 / (1 + (d_i / s)^2)^2

A circle in an image is found by the votes of gradients (Hough; Kimme, Ballard and Sklansky 1975) and refined by
Gauss-Newton steps whose weights fall off with distance (Geman and McClure 1987); s is twice the median of |d_i|.

Image coordinates (row, column) are 0, 0 at the top left corner; the centre of pixel (r, c) is (r + 1/2, c + 1/2).
Photographs are linear radiance, (rows, columns) or (rows, columns, C), whose channels are averaged. Answers are
NumPy's, in double precision.

Not here: what the ball shows (`mirror_ball`, `matte_ball`), and where it stands in space (`silhouette`): through a lens
near by its outline is no circle.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from scipy import ndimage

from ..arrays import Array, require_finite, to_numpy
from ..errors import ArrayError, ParameterError

# The image is brought to about this many pixels a side before circles are sought: finer edges add only time.
_SEARCH_SIZE = 400
# Of the outline of a ball, at least this share must show as an edge: below it, chance finds circles anywhere.
_LEAST_OUTLINE = 0.35


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

    def normals(self, places: np.ndarray) -> np.ndarray:
        """Normals (N, 3) of the ball seen orthographically, at `places` (N, 2), (row, column), within the circle."""
        y, x = ((places - self.centre) / self.radius).T
        return np.stack((x, -y, np.sqrt(np.maximum(1 - x * x - y * y, 0.0))), axis=-1)

    def square(self, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows, columns and distances from the centre of the pixels in the square around it, each (h, w).

        shape: (rows, columns) of the image, which may cut the square.
        """
        spans = [
            np.arange(max(0, math.floor(c - self.radius)), max(0, min(n, math.ceil(c + self.radius))))
            for c, n in zip(self.centre, shape, strict=True)
        ]
        row, column = np.meshgrid(*spans, indexing="ij")
        return row, column, np.hypot(row + 0.5 - self.centre[0], column + 0.5 - self.centre[1])


def circle_of_mask(mask: Array) -> Circle:
    """The circle around a ball's `mask` (rows, columns), bool, True on the ball.

    Holes are filled, and the largest connected part is the ball. Where the frame cuts the ball, the rest of the outline
    decides; a stand or a neighbour in the mask is left out if it takes up less than a third of the outline.

    Raises `ArrayError` where the mask is no image of bools, has no outline, or is not round.
    """
    return circle_through(outline_of_mask(mask))[0]


def outline_of_mask(mask: Array) -> np.ndarray:
    """The points (N, 2), (row, column), that lie midway between a pixel on the ball and a neighbour off it, N >= 12.

    mask: (rows, columns), bool, True on the ball. Holes are filled, and the largest connected part is the ball. The
    frame is no outline. A point is off by up to half a pixel along its row or column, and by nothing on average.

    Raises `ArrayError` where the mask is no image of bools, or has no outline.
    """
    mask = to_numpy(mask)
    if mask.ndim != 2 or mask.dtype != np.bool_:
        raise ArrayError(
            f"mask has shape {mask.shape} and dtype {mask.dtype}; expected (rows, columns) of bool. "
            "Of an 8-bit mask pass mask > 127, one channel."
        )
    if not mask.any():
        raise ArrayError("mask is False everywhere: it shows no ball.")
    ball = ndimage.binary_fill_holes(heaviest(mask, mask))
    row, column = np.nonzero(ball[1:] != ball[:-1])
    row_, column_ = np.nonzero(ball[:, 1:] != ball[:, :-1])
    points: np.ndarray = np.concatenate(
        (np.stack((row + 1.0, column + 0.5), axis=-1), np.stack((row_ + 0.5, column_ + 1.0), axis=-1))
    )
    if len(points) < 12:
        raise ArrayError(f"mask has an outline of {len(points)} points within the image; a circle needs 12 or more.")
    return points


def circle_through(points: np.ndarray) -> tuple[Circle, float]:
    """The circle through most `points` (N, 2) of a mask's outline, and the share of them that lie on it.

    Raises `ArrayError` where they are not round.
    """
    circle, kept = _fit(points, _algebraic(points))
    share = float(kept.mean())
    require_round(share, circle.residual, circle.radius)
    return circle, share


def require_round(share: float, residual: float, radius: float) -> None:
    """Refuse a mask unless two thirds of its outline agree on a ball of `radius`, to a `residual`, both in pixels."""
    if share < 2 / 3 or residual > 0.5 + 0.03 * radius:
        raise ArrayError(
            f"mask is not round: {share:.0%} of its outline lie on one circle, {residual:.1f} pixels from it (rms). "
            "Mask one ball, all of it."
        )


def agreement(off: np.ndarray) -> np.ndarray:
    """Weights (N,) in (0, 1] of an outline's points by the pixels `off` (N,) >= 0 that they miss it by."""
    # Points of a mask are known to half a pixel: below that the median says nothing.
    scale = max(2 * float(np.median(off)), 0.5)
    return np.asarray(1 / (1 + (off / scale) ** 2) ** 2)


def agreeing(off: np.ndarray) -> np.ndarray:
    """Which points of an outline belong to it, (N,) bool, by the pixels `off` (N,) >= 0 that they miss it by."""
    return np.asarray(off < 3 * max(1.4826 * float(np.median(off)), 0.3))


def find_circle(image: Array) -> Circle:
    """The ball in `image`: the mean of all photographs of it serves best, since every light shows other edges.

    The circle sought has the most edge along it, in proportion and in number; its radius is between 1/12 and 1/2 of the
    image's shorter side. For a photograph of one ball before a background that differs from it along a good third of
    its outline. The radiance's logarithm is searched: a dark ball has edges as a bright one has.

    Raises `ArrayError` where no circle stands out, or `image` is not as above. Mask the ball and use `circle_of_mask`.
    """
    radiance = mean_channel(image, "image")
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


def mean_channel(image: Array, name: str) -> np.ndarray:
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


def heaviest(marked: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """The connected part of `marked` with the largest sum of `weight`, as bool of the same shape."""
    label, parts = ndimage.label(marked)
    return np.asarray(label == 1 + np.argmax(ndimage.sum_labels(weight, label, np.arange(1, parts + 1))))


def _algebraic(points: np.ndarray) -> np.ndarray:
    """(row, column, radius) of the circle p.p = 2 c.p + k nearest to `points` (N, 2) in k (Kasa 1976)."""
    middle = points.mean(axis=0)
    p = points - middle
    (row, column, k), *_ = np.linalg.lstsq(np.column_stack((2 * p, np.ones(len(p)))), (p * p).sum(axis=1), rcond=None)
    return np.array((row + middle[0], column + middle[1], math.sqrt(max(k + row * row + column * column, 0.0))))


def least_squares(points: np.ndarray, start: np.ndarray, weight: np.ndarray, steps: int = 20) -> np.ndarray:
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
        before = circle
        circle = least_squares(points, circle, agreement(off), steps=1)
        if np.abs(circle - before).max() < 1e-3:
            break
    off = np.abs(np.hypot(*(points - circle[:2]).T) - circle[2])
    kept = agreeing(off)
    row, column, radius = least_squares(points[kept], circle, np.ones(int(kept.sum())))
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
