"""Photographs of a checkerboard by the rays themselves; what tests of calibration and of planes share."""

import dataclasses
import functools

import numpy as np

import gonio as gn
from gonio.capture.checkerboard import Board

BOARD, SIZE = Board((6, 9), 10.0), (240, 320)
LENS = gn.Pinhole(
    fx=330.0, fy=325.0, cx=163.2, cy=117.4, distortion=(-0.12, 0.05, 1e-3, -8e-4, 0.0), size=SIZE
)  # fmt: skip
# Where the camera stands and looks, y up: tilted to all sides, the board out to the sides of the image by turns.
_VIEWS = (
    ((45, -50, 112), (6, -4)),
    ((-60, 15, 112), (-10, -3)),
    ((10, 70, 110), (0, 5)),
    ((-40, -45, 115), (-8, -5)),
    ((60, 35, 105), (8, 5)),
    ((2, 3, 105), (0, 0)),
)
POSES = np.stack([gn.look_at(eye, (*target, 0), (0, 1, 0)) for eye, target in _VIEWS])
CAMERAS = [dataclasses.replace(LENS, pose=pose) for pose in POSES]


def squares(x, y, board=BOARD):
    """Radiance of the board, its black square at the top left, its white rim and the gray table at x, y."""
    rows, columns = board.corners
    u, v = x / board.square + (columns + 1) / 2, (rows + 1) / 2 - y / board.square
    j, i = np.floor(u), np.floor(v)
    on = (j >= 0) & (j <= columns) & (i >= 0) & (i <= rows)
    rim = (abs(u - (columns + 1) / 2) < (columns + 3) / 2) & (abs(v - (rows + 1) / 2) < (rows + 3) / 2)
    return np.where(on, np.where((i + j) % 2 == 0, 0.05, 0.8), np.where(rim, 0.8, 0.25))


def photograph(camera, radiance=squares, fine=3):
    """(rows, columns) of `radiance`(x, y) in the plane z = 0, the mean of fine x fine rays for each pixel."""
    rows, columns = camera.size
    lens = camera.fx, camera.fy, camera.cx, camera.cy, camera.distortion, camera.size
    ray = _rays(*lens, fine) @ camera.pose[:3, :3].T
    place = camera.position - ray * (camera.position[2] / ray[..., 2])[..., None]
    return radiance(place[..., 0], place[..., 1]).reshape(rows, fine, columns, fine).mean(axis=(1, 3))


@functools.cache
def _rays(fx, fy, cx, cy, distortion, size, fine):
    """Rays of a lens at the origin, (rows fine, columns fine, 3): alike for all poses, and slow where it distorts."""
    rows, columns = size
    x, y = np.meshgrid((np.arange(columns * fine) + 0.5) / fine, (np.arange(rows * fine) + 0.5) / fine)
    lens = gn.Pinhole(fx=fx, fy=fy, cx=cx, cy=cy, distortion=distortion, size=size)
    return lens.rays(np.stack((x, y), axis=-1))[1]
