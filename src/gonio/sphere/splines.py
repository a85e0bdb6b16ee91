"""Harmonic series at any directions, and of finer maps, by cubic B-splines on a lat-long grid in between.

    f(w) = sum over r, c of s_rc beta(row - r) beta(column - c),    (1, 4, 1)/6 * s = f at the grid's samples, both ways

The way from the series to scattered directions is `values`: synthesis on the grid, the filter that turns samples into
splines, a look-up of 4 x 4. Its transpose is `thinned_analysis`: a map's pixels, weighted, onto the splines of a
coarser grid, the filter, and the grid's own analysis, at a fraction of the cost of analysing the map itself. Along phi
the filter is a division of each order by (2 + cos(2 pi m / columns)) / 3; along theta it runs over the poles.

A wave of l to the half turn comes out wrong by about 2 (x / (2 - x))^4, x = l / rows: by the part of it that the
splines take for a higher one, and the part that is missing for it (Unser 1999). For NumPy.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from .._kernels import splines as kernels
from ..errors import ParameterError
from .grids import LatLong
from .harmonics import degree_of, degrees_and_orders
from .transform import analysis, synthesis

BORDER = kernels.GHOSTS  # rows and columns of a sheet on each side beyond the grid's own


def relative_error(l: np.ndarray, rows: int) -> np.ndarray:
    """What `values` and `thinned_analysis` lose or add at degree l, relative, with a grid of `rows` rows."""
    x = l / rows
    error: np.ndarray = 2 * (x / (2 - x)) ** 4
    return error


def values(coefficients: np.ndarray, rows: int, v: np.ndarray, u: np.ndarray) -> np.ndarray:
    """The series ((degree + 1)^2, C), C = 1 or 3, at theta = pi v, phi = 2 pi u, both (n,) -> (n, C), by `rows` rows.

    Raises `ParameterError` where so few rows do not carry the degree.
    """
    out = np.empty((v.size, coefficients.shape[1]), coefficients.dtype)
    kernels.look_up(sheet(coefficients, rows), 2 * rows, v, u, out)
    return out


def sheet(coefficients: np.ndarray, rows: int) -> np.ndarray:
    """The series ((degree + 1)^2, C), any C, as splines: (rows + 2 BORDER, (2 rows + 2 BORDER) C) as kernels take them.

    Raises `ParameterError` where so few rows do not carry the degree.
    """
    grid = LatLong(rows, 2 * rows)
    smaller = coefficients / _response(degree_of(coefficients), grid.columns, coefficients.dtype)
    samples = np.ascontiguousarray(synthesis(smaller, grid))
    kernels.sharpen(samples.reshape(rows, -1))
    return _bordered(samples)


def thinned_analysis(image: np.ndarray, degree: int, factor: int) -> np.ndarray:
    """Coefficients ((degree + 1)^2, C) of a lat-long map (rows, 2 rows, C), by a grid `factor` times as coarse.

    As the map's own analysis weighs its pixels, to `relative_error`. Raises `ParameterError` where factor is not even
    or no divisor of the rows, and where the coarser grid has 2 degree rows or fewer.
    """
    rows, columns, channels = image.shape
    if factor < 2 or factor % 2 or rows % factor or 2 * degree >= rows // factor:
        raise ParameterError(f"{rows} rows cannot be thinned {factor}-fold for degree {degree}.")
    fine, grid = LatLong(rows, columns), LatLong(rows // factor, columns // factor)
    taps = np.stack(kernels.splines((np.arange(factor) + 0.5) / factor), axis=-1).astype(image.dtype)
    bordered = np.empty((grid.rows + 2 * BORDER, grid.columns + 2 * BORDER, channels), image.dtype)
    flat = np.ascontiguousarray(image).reshape(rows, -1)
    kernels.thin(flat, fine.weights.astype(image.dtype), taps, bordered)
    sums = np.ascontiguousarray(_folded(bordered))
    kernels.sharpen(sums.reshape(grid.rows, -1))
    # The grid's analysis weighs its samples; these sums have their weights already.
    sums /= grid.weights.astype(image.dtype)[:, None, None]
    own = analysis(sums, grid, degree)
    coefficients: np.ndarray = own / _response(degree, grid.columns, image.dtype)
    return coefficients


@lru_cache(maxsize=16)
def _response(degree: int, columns: int, dtype: np.dtype) -> np.ndarray:
    """What splines through the samples of cos(m phi) are larger than it, ((degree + 1)^2, 1)."""
    _, m = degrees_and_orders(degree)
    response: np.ndarray = ((2 + np.cos(2 * math.pi * m / columns)) / 3)[:, None].astype(dtype)
    return response


def _bordered(samples: np.ndarray) -> np.ndarray:
    """(rows + 2 BORDER, (columns + 2 BORDER) C) from samples (rows, columns, C)."""
    rows, columns, channels = samples.shape
    sheet = np.empty((rows + 2 * BORDER, columns + 2 * BORDER, channels), samples.dtype)
    inner = sheet[:, BORDER:-BORDER]
    inner[BORDER:-BORDER] = samples
    for k in range(BORDER):
        inner[BORDER - 1 - k] = np.roll(samples[k], columns // 2, axis=0)
        inner[rows + BORDER + k] = np.roll(samples[-1 - k], columns // 2, axis=0)
    sheet[:, :BORDER], sheet[:, -BORDER:] = inner[:, -BORDER:], inner[:, :BORDER]
    return sheet.reshape(rows + 2 * BORDER, -1)


def _folded(sheet: np.ndarray) -> np.ndarray:
    """What stands in the border of (rows + 2 BORDER, columns + 2 BORDER, C) added where it belongs."""
    sheet[:, BORDER : 2 * BORDER] += sheet[:, -BORDER:]
    sheet[:, -2 * BORDER : -BORDER] += sheet[:, :BORDER]
    inner = sheet[:, BORDER:-BORDER]
    for k in range(BORDER):
        inner[2 * BORDER - 1 - k] += np.roll(inner[k], inner.shape[1] // 2, axis=0)
        inner[k - 2 * BORDER] += np.roll(inner[-1 - k], inner.shape[1] // 2, axis=0)
    return inner[BORDER:-BORDER]
