"""Where a sphere stands, from its silhouette in one photograph.

    u . a = cos alpha,   sin alpha = R / |c|,   c = |c| a       rays u from the camera that touch the sphere about c
    u . q = 1,           q = a / cos alpha                      the same, linear in q
    q = argmin of the sum of w_i d_i^2,   d_i = (u_i . q - 1) / |grad (u . q)|,   c = R a / sin alpha      pinhole
    c = the middle of the outline's circle, R = its radius                                            orthographic

"We used image silhouettes to find the geometric location of the centre of the sphere and its radius" (RH 6.4.1). The
outline is where a cone meets the image: off the axis an ellipse, whose middle is not the image of the centre, and no
conic at all where the lens distorts; in rays it is always a circle. d is a distance in pixels to first order (Sampson
1982), whose gradient is taken in pixels; the weights w are those of `circles`, so that a stand or a neighbour is left
out.

A mask says of each pixel whether its centre sees the sphere. Points of the outline lie midway between the centres of a
pixel on it and a neighbour off it: taken at the pixels that are on it, the radius would be half a pixel too small.

Not here: making the mask, spheres of unknown radius seen by several cameras, and other shapes.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ..arrays import Array, to_numpy
from ..cameras import Camera, Orthographic, Pinhole
from ..errors import ArrayError, ParameterError
from ..shapes.analytic import Sphere
from .circles import agreeing, agreement, circle_through, outline_of_mask, require_round


@dataclasses.dataclass(frozen=True, eq=False)
class Silhouette:
    """A `sphere` in the world of its camera, and how well it explains the outline.

    residual: rms distance of the outline's points from the sphere's outline, in pixels; about 0.25 for a clean mask.
    share: the part of the outline, in [2/3, 1], that the sphere was fitted to; the rest is a stand or a neighbour.
    """

    sphere: Sphere
    residual: float
    share: float


def sphere_of_silhouette(mask: Array, camera: Camera, radius: float | None = None) -> Silhouette:
    """The sphere that `camera` sees as `mask` (rows, columns), bool, True on the sphere.

    radius: of the sphere, in units of the world. A `Pinhole` needs it, since a small ball nearby looks as a large one
        far away does; 1 places the sphere in its own radii. An `Orthographic` camera tells it by itself, but not how
        far the sphere is: the centre is put two radii ahead of the camera, where all of the sphere can be seen.

    Holes are filled, and the largest connected part is the sphere; where the frame cuts it, the rest decides. With all
    of an outline of r pixels, N = 8 r points, the image of the centre is known to about 0.6 / sqrt(N) pixels and the
    distance to 0.3 / (r sqrt(N)) of itself: 0.03 pixels and 3e-4 for r = 50.

    Raises `ArrayError` where the mask is no image of bools of the camera's size, has no outline or is not round;
    `ParameterError` for a radius that is missing, not positive, or given with an `Orthographic` camera.
    """
    if not isinstance(camera, Orthographic | Pinhole):
        raise ParameterError(f"camera is {type(camera).__name__}; pass a Pinhole or an Orthographic one.")
    mask = to_numpy(mask)
    points = outline_of_mask(mask)
    if mask.shape != camera.size:
        raise ArrayError(f"mask has shape {mask.shape}, camera.size is {camera.size}; they are of one image.")
    if isinstance(camera, Orthographic):
        if radius is not None:
            raise ParameterError(f"radius = {radius!r}: under an Orthographic camera the mask tells it. Leave it out.")
        return _orthographic(points, camera)
    if radius is None:
        raise ParameterError(
            "radius is missing: a Pinhole camera sees a small ball nearby as a large one far away. "
            "Pass the ball's radius, or 1 to have its place in radii."
        )
    if not (math.isfinite(radius) and radius > 0):
        raise ParameterError(f"radius = {radius:g} is not a positive number.")
    return _pinhole(points, camera, float(radius))


def _orthographic(points: np.ndarray, camera: Orthographic) -> Silhouette:
    circle, share = circle_through(points)
    radius = circle.radius * camera.pixel
    origin, forward = camera.rays(np.array(circle.centre[::-1]))
    return Silhouette(Sphere(origin + 2 * radius * forward, radius), circle.residual, share)


def _pinhole(points: np.ndarray, camera: Pinhole, radius: float) -> Silhouette:
    pixels = points[:, ::-1]
    u = camera.rays(pixels)[1]
    # How the rays turn from pixel to pixel, (2, N, 3): an outline's points lie half a pixel and more within the image.
    half = 0.5 * np.eye(2)[:, None]
    slope = camera.rays(pixels + half)[1] - camera.rays(pixels - half)[1]

    def misses(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """u . q - 1 in pixels, and the pixels in one of its units, each (N,)."""
        scale = 1 / np.maximum(np.linalg.norm(slope @ q, axis=0), 1e-300)
        return (u @ q - 1) * scale, scale

    def nearest(weight: np.ndarray) -> np.ndarray:
        return np.asarray(np.linalg.lstsq(u * weight[:, None], weight, rcond=None)[0])

    q = nearest(np.ones(len(u)))
    for _ in range(50):
        off, scale = misses(q)
        q = nearest(np.sqrt(agreement(np.abs(off))) * scale)
        if np.abs(misses(q)[0] - off).max() < 1e-4:
            break
    off, scale = misses(q)
    kept = agreeing(np.abs(off))
    q = nearest(kept * scale)
    off = misses(q)[0][kept]
    share, residual = float(kept.mean()), math.sqrt(float(np.mean(off * off)))
    spread = points[kept] - points[kept].mean(axis=0)
    require_round(share, residual, math.sqrt(float((spread * spread).sum(axis=1).mean())))
    tangent = float(q @ q) - 1  # squared
    if not tangent > 0:
        raise ArrayError("mask is not round: the rays of its outline touch no cone. Mask one ball, all of it.")
    # a / sin alpha, from a = q cos alpha and tan alpha.
    return Silhouette(Sphere(camera.position + radius * q / math.sqrt(tangent), radius), residual, share)
