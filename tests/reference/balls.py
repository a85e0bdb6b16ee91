"""Photographs of mirror balls by the rays themselves, and the lamps they show; what tests of balls share."""

import math

import numpy as np

from gonio.capture.circles import Circle
from gonio.directions import normalise

SIZE, CIRCLE = (200, 240), Circle((97.3, 121.8), 80.6)
LAMPS = normalise([[0.0, 0.0, 1.0], [0.6, 0.2, 0.7], [-0.5, 0.6, 0.5], [0.1, -0.8, 0.4], [-0.9, -0.1, 0.1]])
# The camera's axes x right, y down, z forward against the frame of answers: x right, y up, z back.
TURN = np.array([1.0, -1.0, -1.0])


def angle(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(-1)))


def centres(size, fine):
    """(row, column) of `fine` x `fine` points in each pixel, (rows fine, columns fine, 2)."""
    row, column = ((np.arange(n * fine) + 0.5) / fine for n in size)
    return np.stack(np.meshgrid(row, column, indexing="ij"), axis=-1)


def binned(image, fine):
    rows, columns = image.shape
    return image.reshape(rows // fine, fine, columns // fine, fine).mean(axis=(1, 3))


def disc(circle=CIRCLE, size=SIZE):
    return np.hypot(*np.moveaxis(centres(size, 1) - circle.centre, -1, 0)) < circle.radius


def off(circle, other):
    return math.dist(circle.centre, other.centre), abs(circle.radius - other.radius)


def seen_from_far(lamp, circle=CIRCLE, size=SIZE, fine=4, radius=3.0, glow=0.02):
    """A mirror ball before a background of `glow`, under a distant disc-shaped lamp of `radius` degrees."""
    p = centres(size, fine)
    y, x = -(p[..., 0] - circle.centre[0]) / circle.radius, (p[..., 1] - circle.centre[1]) / circle.radius
    ball = x * x + y * y < 1
    z = np.sqrt(np.where(ball, 1 - x * x - y * y, 1.0))
    mirrored = np.stack((2 * z * x, 2 * z * y, 2 * z * z - 1), axis=-1)
    lit = mirrored @ lamp > math.cos(math.radians(radius))
    return binned(np.where(ball, np.where(lit, 1.0, 0.003), glow), fine)


def seen_near(camera, ball, lamp, radius=1.0, fine=4, lamp_radius=None, degrees=3.0):
    """(photograph, mask) of a mirror ball at `ball` (camera axes) by intersecting rays.

    The lamp is a disc of `degrees` far in the direction `lamp`, or a sphere of `lamp_radius` at the point `lamp`.
    """
    p = centres(camera.size, fine)
    u = np.stack(((p[..., 1] - camera.cx) / camera.fx, (p[..., 0] - camera.cy) / camera.fy, np.ones(p.shape[:2])), -1)
    u /= np.linalg.norm(u, axis=-1, keepdims=True)
    b = u @ ball
    depth = b * b - (ball @ ball - radius * radius)
    hit = depth > 0
    at = (b - np.sqrt(np.where(hit, depth, 0.0)))[..., None] * u
    n = (at - ball) / radius
    mirrored = u - 2 * (u * n).sum(-1, keepdims=True) * n
    if lamp_radius is None:
        lit = mirrored @ lamp > math.cos(math.radians(degrees))
    else:
        to = lamp - at
        along = (to * mirrored).sum(-1)
        lit = (along > 0) & ((to * to).sum(-1) - along**2 < lamp_radius**2)
    return binned(np.where(hit & lit, 1.0, np.where(hit, 0.003, 0.02)), fine), binned(hit.astype(float), fine) > 0.5
