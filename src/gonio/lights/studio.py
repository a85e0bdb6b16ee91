"""A room that gonio makes itself: the environment of the demo, the examples and the tests, nobody's photograph.

A box room seen from its middle, z up: grey walls lit from above, a wooden floor, a tall window of six panes towards
+x (daylight), a warm softbox towards -y, a strip lamp overhead, and a small bright bulb behind (-x), which is
narrow enough to ring in a short harmonic series. Radiance is relative; the brightest is about 250 times the walls.
"""

from __future__ import annotations

import numpy as np

from .environment import Environment
from .mappings import LatLongMap

# Half the room's extent along x, y, z, in metres.
ROOM = np.array([2.4, 2.0, 1.3])


def studio(rows: int = 256) -> Environment:
    """The room as a lat-long environment of (rows, 2 rows) texels, RGB."""
    # Four by four samples a texel: the panes' bars are narrower than a texel at small sizes.
    fine = _radiance(LatLongMap().directions(4 * rows, 8 * rows)[0].astype(np.float32))
    image = fine.reshape(rows, 4, 2 * rows, 4, 3).mean(axis=(1, 3))
    return Environment(image, LatLongMap())


def _radiance(w: np.ndarray) -> np.ndarray:
    """Radiance (..., 3) seen along `w` (..., 3) from the middle of the room."""
    reach = ROOM / np.maximum(np.abs(w), 1e-9)
    wall = reach.argmin(axis=-1)
    x, y, z = np.moveaxis(w * reach.min(axis=-1, keepdims=True), -1, 0)

    height = (z / ROOM[2] + 1) / 2
    image = (0.10 + 0.16 * height)[..., None] * np.array([1.0, 0.96, 0.90])

    floor = (wall == 2) & (w[..., 2] < 0)
    board = 0.8 + 0.2 * np.sin(7.0 * np.floor(y * 6.0) + 0.6 * np.sin(3 * x))
    image = np.where(floor[..., None], (0.16 * board)[..., None] * np.array([1.0, 0.62, 0.36]), image)

    ceiling = (wall == 2) & (w[..., 2] > 0)
    image = np.where(ceiling[..., None], np.array([0.30, 0.29, 0.28]), image)
    lamp = ceiling & (np.abs(x) < 1.4) & (np.abs(y - 0.5) < 0.18)
    image = np.where(lamp[..., None], np.array([9.0, 8.6, 8.0]), image)

    window = (wall == 0) & (w[..., 0] > 0) & (np.abs(y) < 1.0) & (np.abs(z - 0.15) < 0.9)
    bars = (np.abs(np.mod(y + 1.0, 2.0 / 3) - 1.0 / 3) > 0.29) | (np.abs(np.mod(z + 0.75, 0.9) - 0.45) > 0.40)
    image = np.where((window & bars)[..., None], np.array([0.35, 0.33, 0.30]), image)
    sky = (6.0 + 5.0 * height)[..., None] * np.array([0.62, 0.80, 1.0])
    image = np.where((window & ~bars)[..., None], sky, image)

    softbox = (wall == 1) & (w[..., 1] < 0) & (np.abs(x + 0.6) < 0.7) & (np.abs(z - 0.2) < 0.6)
    image = np.where(softbox[..., None], np.array([5.5, 3.9, 2.3]), image)

    bulb = (wall == 0) & (w[..., 0] < 0) & ((y - 0.9) ** 2 + (z - 0.7) ** 2 < 0.12**2)
    return np.where(bulb[..., None], np.array([60.0, 52.0, 40.0]), image).astype(np.float32)
