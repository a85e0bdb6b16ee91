"""Plain twin of `_kernels/moments.py`."""

import numpy as np

SIGNS = [(1, 1), (1, -1), (-1, 1), (-1, -1)]  # of the mirror row and of half a turn, plane by plane


def _waves(width, sign):
    return np.concatenate([np.eye(width), sign * np.eye(width)], axis=1)


def moments(image, functions, plane):
    """sums[p, i] = sum over northern r of functions[p, r] (image[r, i] +- half a turn on +- the mirror row)."""
    half, width = functions.shape[1], image.shape[1] // 2
    near, far = image[:half], image[::-1][:half]
    return np.stack(
        [
            functions[p] @ ((near + SIGNS[plane[p]][0] * far) @ _waves(width, SIGNS[plane[p]][1]).T)
            for p in range(len(plane))
        ]
    )


def spread(waves, functions, plane, rows):
    """The image whose row r is the sum over p of functions[p, r] waves[p], continued by the signs of each plane."""
    image = np.zeros((rows, 2 * waves.shape[1]))
    for p in range(len(plane)):
        mirror, turn = SIGNS[plane[p]]
        row = waves[p] @ _waves(waves.shape[1], turn)
        for r in range(functions.shape[1]):
            image[rows - 1 - r] += mirror * functions[p, r] * row
            if rows - 1 - r != r:
                image[r] += functions[p, r] * row
    return image
