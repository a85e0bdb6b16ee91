"""Plain twins of `_kernels/splines.py`."""

import numpy as np


def beta(x):
    """The cubic B-spline about 0."""
    x = np.abs(x)
    return np.where(x < 1, (4 - 6 * x**2 + 3 * x**3) / 6, np.where(x < 2, (2 - x) ** 3 / 6, 0.0))


def blurred(grid):
    """(1, 4, 1) / 6 down the columns of a grid (rows, columns, C), which goes on half a turn away beyond the poles."""
    half = grid.shape[1] // 2
    circle = np.concatenate((np.roll(grid[:1], half, 1), grid, np.roll(grid[-1:], half, 1)))
    return (circle[:-2] + 4 * circle[1:-1] + circle[2:]) / 6


def look_up(sheet, ghosts, columns, v, u):
    """Sums over all splines of a sheet (rows + 2 ghosts, columns + 2 ghosts, C)."""
    rows = sheet.shape[0] - 2 * ghosts
    down = beta((v * rows - 0.5)[:, None] - (np.arange(sheet.shape[0]) - ghosts))
    along = beta((u * columns - 0.5)[:, None] - (np.arange(sheet.shape[1]) - ghosts))
    return np.einsum("nr,nc,rck->nk", down, along, sheet)


def thin(image, weights, factor, ghosts):
    """Pixels (rows, columns, C) on the splines (rows / factor + 2 ghosts, columns / factor + 2 ghosts, C)."""
    taps = []
    for fine in image.shape[:2]:
        at = (np.arange(fine) + 0.5) / factor - 0.5
        taps.append(beta(at[:, None] - (np.arange(fine // factor + 2 * ghosts) - ghosts)))
    return np.einsum("rR,cC,r,rck->RCk", *taps, weights, image)
