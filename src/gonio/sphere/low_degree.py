"""Transforms of low degree in one pass over the image, for NumPy: rows first, then what is left of the columns.

    f_lm = sum over i of az_m(phi_i) sum over r of w_r Y_l|m|(theta_r, 0) f_ri

A lat-long map of 2,048 x 1,024 pixels is worth nine coefficients for diffuse light; a Fourier transform of every row
would cost ten times what reading them does. Only even columns: half a turn further az_m is the same or its negative.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from .._kernels import moments as kernels
from ..directions import from_spherical
from .grids import Grid
from .harmonics import degrees_and_orders, harmonics

HIGHEST = 8  # where the Fourier transform becomes as fast


def analyse(values: np.ndarray, grid: Grid, degree: int) -> np.ndarray:
    """((degree + 1)^2, C) from values (rows, columns, C)."""
    channels = values.shape[2]
    _, plane, azimuth, places = _tables(grid, degree, values.dtype)
    sums = np.empty((plane.size, grid.columns // 2 * channels), values.dtype)
    image = np.ascontiguousarray(values).reshape(grid.rows, -1)
    kernels.moments(image, _weighted(grid, degree, values.dtype), plane, sums)
    coefficients = np.empty(((degree + 1) ** 2, channels), values.dtype)
    # At m = 0 both places are the same; the cosine is written last.
    parts = azimuth @ sums.reshape(plane.size, -1, channels)
    coefficients[places[:, 1]] = parts[:, 1]
    coefficients[places[:, 0]] = parts[:, 0]
    return coefficients


def synthesise(coefficients: np.ndarray, grid: Grid, degree: int) -> np.ndarray:
    """Values (rows, columns, C) from coefficients ((degree + 1)^2, C)."""
    channels = coefficients.shape[1]
    functions, plane, azimuth, places = _tables(grid, degree, coefficients.dtype)
    waves = azimuth.mT @ coefficients[places]
    image = np.empty((grid.rows, grid.columns * channels), coefficients.dtype)
    kernels.spread(waves.reshape(plane.size, -1), functions, plane, image)
    return image.reshape(grid.rows, grid.columns, channels)


@lru_cache(maxsize=8)
def _tables(grid: Grid, degree: int, dtype: np.dtype) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Y_lm(theta, 0) of m >= 0 at the northern rows, their planes, (cos, sin)(m phi) (functions, 2, columns / 2), and
    the places (functions, 2) of the coefficients at m and -m."""
    l, m = degrees_and_orders(degree)
    l, m = l[m >= 0], m[m >= 0]
    theta = grid.theta[: (grid.rows + 1) // 2]
    functions = harmonics(degree, from_spherical(theta, 0.0)).T[l * (l + 1) + m]
    angle = m[:, None] * grid.phi[: grid.columns // 2]
    azimuth = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    places = l[:, None] * (l[:, None] + 1) + np.stack((m, -m), axis=1)
    return functions.astype(dtype), 2 * ((l - m) % 2) + m % 2, azimuth.astype(dtype), places


@lru_cache(maxsize=8)
def _weighted(grid: Grid, degree: int, dtype: np.dtype) -> np.ndarray:
    """The functions of `_tables` times the weights of their rows; the equator stands for itself alone."""
    functions, *_ = _tables(grid, degree, np.dtype(np.float64))
    weights = grid.weights[: functions.shape[1]].copy()
    if grid.rows % 2:
        weights[-1] /= 2
    weighted: np.ndarray = (functions * weights).astype(dtype)
    return weighted
