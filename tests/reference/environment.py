"""Plain twins of `_kernels/environment.py`: one direction at a time, without ghost texels."""

import math

import numpy as np


def radiance_of_lat_long(image, w):
    """Bilinear, straight from the layout: periodic in phi, and half a turn away beyond a pole."""
    rows, columns = image.shape[:2]
    y = math.acos(max(-1.0, min(1.0, w[2]))) * rows / math.pi - 0.5
    x = (math.atan2(w[1], w[0]) % (2 * math.pi)) * columns / (2 * math.pi) - 0.5

    def texel(r, c):
        if r < 0:
            r, c = -1 - r, c + columns // 2
        if r >= rows:
            r, c = 2 * rows - 1 - r, c + columns // 2
        return image[r, c % columns]

    i, j = math.floor(y), math.floor(x)
    f, g = y - i, x - j
    return (texel(i, j) * (1 - g) + texel(i, j + 1) * g) * (1 - f) + (
        texel(i + 1, j) * (1 - g) + texel(i + 1, j + 1) * g
    ) * f


def mean_over_texels(environment, mapping, rows, turn, samples):
    """Each texel of a lat-long map: the solid-angle weighted mean of samples x samples look-ups."""
    columns = 2 * rows
    out = np.zeros((rows, columns, environment.image.shape[-1]))
    for r in range(rows):
        for c in range(columns):
            weight = 0.0
            for a in range(samples):
                for b in range(samples):
                    theta = math.pi * (r + (a + 0.5) / samples) / rows
                    phi = 2 * math.pi * (c + (b + 0.5) / samples) / columns
                    s = math.sin(theta)
                    w = turn @ [s * math.cos(phi), s * math.sin(phi), math.cos(theta)]
                    out[r, c] += s * radiance_of_lat_long(environment.image, environment.turn.T @ w)
                    weight += s
            out[r, c] /= weight
    return out
