"""Values on a grid <-> coefficients of spherical harmonics, real and spin-weighted, in O(rows degree^2) steps.

    synthesis   f(theta_r, phi_c) = sum over l, m of f_lm Y_lm(theta_r, phi_c)
    analysis    f_lm = integral of f conj(Y_lm) over the sphere, by the grid's quadrature

with the real harmonics of `harmonics.py`, or with the spin-weighted ones, whose convention is

    sY_lm(theta, phi) = (-1)^s sqrt((2l + 1) / (4 pi)) d^l_{m,-s}(theta) e^{i m phi},     0Y_lm = Y_lm of RH 2.26

(d of RH 2.34), so that RH's D^l_mq(alpha, beta) = (-1)^q sqrt(4 pi / (2l + 1)) {-q}Y_lm(alpha, beta).

analysis(synthesis(f)) = f to rounding for every degree <= grid.highest_degree. On a LatLong grid the coefficients to
degree L are exact, beside that, for functions of degree < rows - L.

First a Fourier sum over each row (`azimuth.py`), then for every order m a sum over the rows against the functions of
`legendre.py`. NumPy arrays take the kernels; arrays of other libraries take matrix products with the same functions.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ..arrays import Array, floats, is_numpy, like, namespace, require_finite
from ..errors import ArrayError, ParameterError
from . import fast, low_degree
from .azimuth import complex_from_waves, waves_of_complex
from .folding import fold, unfold
from .grids import Grid
from .harmonics import degree_of, require_degree
from .legendre import Recursion, folded_recursion, spin_recursion
from .packing import pack, pack_spin, unpack, unpack_spin
from .quadrature import weighted

_KEPT = 2**22  # numbers in the tables that a recursion keeps for arrays of one kind: 32 MiB of float64


def analysis(values: Array, grid: Grid, degree: int) -> Array:
    """Coefficients to `degree` in the real harmonics: (rows, columns[, C]) -> ((degree + 1)^2[, C]).

    Raises `ArrayError` where values do not lie on the grid, or are complex, NaN or infinite; `ParameterError` where
    the degree exceeds `grid.highest_degree`.
    """
    _require_carried(degree, grid)
    xp, values = floats(values)
    rows = _on_grid(values, grid)
    if is_numpy(rows):
        return _result(_numpy_way(grid, degree).analyse(rows, grid, degree), values)
    rings = fold(rows, grid, degree)
    half = rings.shape[1] // 2
    even = weighted(rings[:, :half, :], grid, degree, 0, 0)
    odd = weighted(rings[:, half:, :], grid, degree, 0, 1)
    packed = _projections(folded_recursion(grid, degree), xp.concat((even, odd), axis=1))
    return _result(unpack(packed, degree), values)


def synthesis(coefficients: Array, grid: Grid) -> Array:
    """Values on `grid` of coefficients in the real harmonics: ((degree + 1)^2[, C]) -> (rows, columns[, C]).

    Raises `ArrayError` where the coefficients are no square number, or complex, NaN or infinite; `ParameterError`
    where their degree exceeds `grid.highest_degree`.
    """
    xp, coefficients = floats(coefficients)
    degree = _carried(xp, coefficients, grid)
    flat = _channels(coefficients, 1)
    if is_numpy(flat):
        values = _numpy_way(grid, degree).synthesise(flat, grid, degree)
    else:
        values = unfold(_sums(folded_recursion(grid, degree), pack(flat, degree)), grid)
    return values if coefficients.ndim == 2 else values[..., 0]


def analysis_spin(values: Array, grid: Grid, degree: int, spin: int) -> Array:
    """Complex coefficients to `degree` in the harmonics of `spin`: (rows, columns[, C]) -> ((degree + 1)^2[, C]).

    Coefficients below degree abs(spin) are 0. Raises as `analysis` does, for complex values too; `ParameterError`
    where abs(spin) exceeds the degree.
    """
    _require_carried(degree, grid)
    _require_spin(spin, degree)
    xp, values = _complex(values)
    ahead, back = waves_of_complex(_on_grid(values, grid), degree)
    # The functions at -m are those at m seen from the other pole.
    back = xp.flip(back, axis=0)
    rings = xp.concat((xp.real(ahead), xp.imag(ahead), xp.real(back), xp.imag(back)), axis=-1)
    rings = weighted(xp.permute_dims(rings, (1, 2, 0)), grid, degree, spin)
    return _result(unpack_spin(_projections(spin_recursion(grid, degree, spin), rings), degree, spin), values)


def synthesis_spin(coefficients: Array, grid: Grid, spin: int) -> Array:
    """Complex values on `grid` of coefficients of `spin`: ((degree + 1)^2[, C]) -> (rows, columns[, C]).

    Coefficients below degree abs(spin) are ignored, since there are no such harmonics. Raises as `synthesis` does, and
    `ParameterError` where abs(spin) exceeds the degree.
    """
    xp, coefficients = _complex(coefficients)
    degree = _carried(xp, coefficients, grid)
    _require_spin(spin, degree)
    rings = _sums(spin_recursion(grid, degree, spin), pack_spin(_channels(coefficients, 1), degree, spin))
    real, imaginary, back_real, back_imaginary = _quarters(rings)
    ahead = xp.permute_dims(real + 1j * imaginary, (2, 0, 1))
    back = xp.permute_dims(xp.flip(back_real + 1j * back_imaginary, axis=-1), (2, 0, 1))
    values = complex_from_waves(ahead, back, grid.columns)
    return values if coefficients.ndim == 2 else values[..., 0]


def _numpy_way(grid: Grid, degree: int) -> Any:
    """The faster of the two ways by kernels: one pass over the image for a few degrees, where that is exact."""
    few = degree <= low_degree.HIGHEST and grid.columns % 2 == 0 and 2 * degree < grid.rows
    return low_degree if few else fast


def _quarters(rings: Array) -> list[Array]:
    """The four parts of the channels of rings (orders, 4 C, rows)."""
    channels = rings.shape[1] // 4
    return [rings[:, k * channels : (k + 1) * channels, :] for k in range(4)]


def _sums(recursion: Recursion, packed: Array) -> Array:
    """(orders, steps, channels) -> (orders, channels, rows)."""
    if is_numpy(packed):
        return recursion.synthesise(packed)
    xp = namespace(packed)
    return xp.stack(tuple(packed[m, ...].mT @ t for m, t in enumerate(_tables(recursion, packed))), axis=0)


def _projections(recursion: Recursion, rings: Array) -> Array:
    """(orders, channels, rows) -> (orders, steps, channels)."""
    if is_numpy(rings):
        return recursion.analyse(rings)
    xp = namespace(rings)
    return xp.stack(tuple(t @ rings[m, ...].mT for m, t in enumerate(_tables(recursion, rings))), axis=0)


def _tables(recursion: Recursion, reference: Array) -> Iterable[Array]:
    """The functions of every order, (steps, rings) each, as arrays beside `reference`; kept where not large."""
    orders, steps = recursion.a.shape
    if orders * steps * recursion.t.size > _KEPT:
        return (like(recursion.table(m), reference) for m in range(orders))
    kind = str(reference.dtype), str(reference.device)
    if kind in recursion.kept:
        return recursion.kept[kind]
    tables = [like(recursion.table(m), reference) for m in range(orders)]
    # What PyTorch makes in its inference mode may not meet gradients later.
    if not getattr(tables[0], "is_inference", bool)():
        recursion.kept[kind] = tables
    return tables


def _channels(x: Array, axes: int) -> Array:
    """`x` with channels after its first `axes` axes."""
    return x if x.ndim == axes + 1 else x[..., None]


def _on_grid(values: Array, grid: Grid) -> Array:
    """(rows, columns, C) from values on `grid` with or without channels."""
    shape = tuple(values.shape)
    if shape[:2] != grid.shape or len(shape) not in (2, 3):
        raise ArrayError(f"values have shape {shape}; on {grid} they are {grid.shape}, or {grid.shape} and channels.")
    return _channels(values, 2)


def _result(coefficients: Array, values: Array) -> Array:
    """`coefficients` as public functions return them. A NaN or infinity among the values has spread to all of them."""
    xp = namespace(coefficients)
    if not bool(xp.all(xp.isfinite(coefficients))):
        require_finite(xp.abs(values), "values")
        raise ArrayError("values are too large: their sums exceed the range of their dtype.")
    return coefficients if values.ndim == 3 else coefficients[:, 0]


def _complex(x: Array) -> tuple[Array, Array]:
    """(xp, x) with x complex, in the precision it came in."""
    xp = namespace(x)
    x = x if hasattr(x, "dtype") else xp.asarray(x)
    if xp.isdtype(x.dtype, "complex floating"):
        return xp, x
    xp, x = floats(x)
    return xp, x + 0j


def _carried(xp: Any, coefficients: Array, grid: Grid) -> int:
    """The degree of finite coefficients that `grid` carries."""
    degree = degree_of(coefficients)
    if coefficients.ndim > 2:
        raise ArrayError(f"coefficients have shape {tuple(coefficients.shape)}; expected ((degree + 1)^2[, channels]).")
    _require_carried(degree, grid)
    if not bool(xp.all(xp.isfinite(coefficients))):
        require_finite(xp.abs(coefficients), "coefficients")
    return degree


def _require_carried(degree: int, grid: Grid) -> None:
    require_degree(degree)
    if degree > grid.highest_degree:
        raise ParameterError(
            f"degree {degree} is more than {grid} can carry ({grid.highest_degree}). Lower it or use a finer grid."
        )


def _require_spin(spin: int, degree: int) -> None:
    if not isinstance(spin, int | np.integer) or isinstance(spin, bool) or abs(spin) > degree:
        raise ParameterError(f"spin = {spin!r} is not an integer between -degree and degree ({degree}).")
