"""Rings in tiles: sixteen of them side by side, for every order and channel, as the kernels pass them on.

    rings    (orders, channels, rings)
    tiles    (tiles, orders, channels, LANES): ring r in lane r % LANES of tile r // LANES; lanes beyond the last are 0

What the Fourier sums of sixteen pairs of rows need of all orders lies together, and so does what the sums over theta
need of sixteen rings at once.
"""

from __future__ import annotations

import math
import threading

import numpy as np

from .._kernels import legendre as kernels

LANES = kernels.LANES


def empty_tiles(orders: int, channels: int, rings: int, dtype: np.dtype) -> np.ndarray:
    """Memory for `rings` rings."""
    return np.empty((-(-rings // LANES), orders, channels, LANES), dtype)


_KEPT = 2**24  # bytes


class _Scratch(threading.local):
    bytes = np.empty(0, np.uint8)


_scratch = _Scratch()


def scratch_tiles(orders: int, channels: int, rings: int, dtype: np.dtype) -> np.ndarray:
    """The same for work that ends before this thread next asks: up to some size, memory that it has had before.

    A system hands out fresh memory page by page, which can cost as long as the sums that fill it.
    """
    shape = -(-rings // LANES), orders, channels, LANES
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if size > _KEPT:
        return np.empty(shape, dtype)
    if size > _scratch.bytes.size:
        _scratch.bytes = np.empty(size, np.uint8)
    return _scratch.bytes[:size].view(dtype).reshape(shape)


def tiled(rings: np.ndarray) -> np.ndarray:
    """Tiles of rings."""
    orders, channels, count = rings.shape
    tiles = empty_tiles(orders, channels, count, rings.dtype)
    whole = count // LANES
    tiles[:whole] = rings[..., : whole * LANES].reshape(orders, channels, whole, LANES).transpose(2, 0, 1, 3)
    tiles[whole:] = 0
    tiles[whole:, ..., : count % LANES] = rings[..., whole * LANES :]
    return tiles


def untiled(tiles: np.ndarray, rings: int) -> np.ndarray:
    """The first `rings` rings of tiles, as a copy."""
    _, orders, channels, _ = tiles.shape
    return tiles.transpose(1, 2, 0, 3).reshape(orders, channels, -1)[..., :rings]
