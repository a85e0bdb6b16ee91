"""Plain twin of `_kernels/expansion.py`."""

import numpy as np


def bspline(x):
    """The cubic B-spline at distances x from its middle."""
    x = np.abs(x)
    near, far = (4 - 6 * x**2 + 3 * x**3) / 6, np.maximum(2 - x, 0) ** 3 / 6
    return np.where(x < 1, near, far)


def look_up(sheet, border, ghosts, columns, w, eye, gain):
    """(n, C): series `eye` (n, T) of the splines of a sheet (rows + 2 border, columns + 2 ghosts, T, C) towards w."""
    rows = sheet.shape[0] - 2 * border
    theta, phi = np.arccos(w[:, 2]), np.arctan2(w[:, 1], w[:, 0]) % (2 * np.pi)
    y = theta / np.pi * rows + border - 0.5
    x = phi / (2 * np.pi) * columns + ghosts - 0.5
    vertical = bspline(y[:, None] - np.arange(sheet.shape[0]))
    across = bspline(x[:, None] - np.arange(sheet.shape[1]))
    return gain[:, None] * np.einsum("nr,nc,rctk,nt->nk", vertical, across, sheet, eye)
