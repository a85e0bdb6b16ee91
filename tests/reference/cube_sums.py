"""Plain twin of `_kernels/cube_sums.py`."""

import numpy as np

import gonio as gn


def cube_sums(image, directions, weights, size):
    """Radiance times weight, then weight, of every part of a pixel, in the texel where `directions` has it."""
    parts = directions.shape[0] // image.shape[0]
    fine = np.repeat(np.repeat(image, parts, axis=0), parts, axis=1).astype(float)
    row, column = (np.floor(x).astype(int) for x in gn.CubeStrip().pixels(directions, 6 * size, size))
    sums = np.zeros((6 * size * size, image.shape[2] + 1))
    values = np.concatenate((fine, np.ones_like(fine[..., :1])), axis=-1) * weights[:, None, None]
    np.add.at(sums, row * size + column, values)
    return sums
