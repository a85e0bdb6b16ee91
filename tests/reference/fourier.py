"""Plain twin of `_kernels/fourier.py` and `_kernels/mending.py`: sums over cosines and sines as they are defined."""

import numpy as np


def waves(degree, columns):
    """cos and sin(m phi_c), each (orders, columns), phi_c = (c + 1/2) 2 pi / columns."""
    angle = np.arange(degree + 1)[:, None] * ((np.arange(columns) + 0.5) * (2 * np.pi / columns))
    return np.cos(angle), np.sin(angle)


def image(rings, cosines, rows, columns):
    """(rows, columns, C) of rings (orders, 2, 2, C, pairs): even and odd parts, cosines and sines."""
    cos, sin = waves(rings.shape[0] - 1, columns)
    even, odd = (
        np.einsum("mkp,mc->pck", rings[:, s, 0], cos) + np.einsum("mkp,mc->pck", rings[:, s, 1], sin) for s in (0, 1)
    )
    odd = odd * cosines[:, None, None]
    return np.concatenate((even + odd, (even - odd)[: rows // 2][::-1]))


def rings(image, weights, degree):
    """The transpose: (orders, 2, 2, C, pairs) of an image (rows, columns, C), its parts times weights (2, pairs)."""
    cos, sin = waves(degree, image.shape[1])
    pairs = weights.shape[1]
    north, south = image[:pairs], image[::-1][:pairs]
    return np.stack(
        [
            np.stack([np.einsum("pck,mc->mkp", part, wave) for wave in (cos, sin)], axis=1) * weight
            for part, weight in zip((north + south, north - south), weights, strict=True)
        ],
        axis=1,
    )


def mended(rings, waves, spread):
    """Rings (..., rings) and what `spread` (frequencies, rings) makes of their products with `waves`."""
    return rings + (rings @ waves.T) @ spread
