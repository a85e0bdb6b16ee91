"""Fourier sums over the columns of a grid, phi_c = (c + 1/2) 2 pi / columns, for orders m = 0..degree.

    real values      waves_m = sum_c f_c e^{-i m phi_c},      f_c = Re sum_m waves_m e^{i m phi_c}
    complex values   the same for m and for -m

Values are (rows, columns, channels), waves (rows, degree + 1, channels).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from ..arrays import Array, is_numpy, like, namespace


def waves_of_real(values: Array, degree: int) -> Array:
    """waves_m of real values."""
    waves = _fft(values).rfft(values, axis=1)[:, : degree + 1, :]
    return waves * _turns(degree, values.shape[1], waves, -1)


def real_from_waves(waves: Array, columns: int) -> Array:
    """Re sum_m waves_m e^{i m phi_c}."""
    degree = waves.shape[1] - 1
    # irfft counts every m > 0 twice.
    turns = _turns(degree, columns, waves, 1) * _halves(degree, waves)
    return _fft(waves).irfft(waves * turns, n=columns, axis=1, norm="forward")


def waves_of_complex(values: Array, degree: int) -> tuple[Array, Array]:
    """(waves_m, waves_{-m}) of complex values; m = 0 stands in both."""
    xp = namespace(values)
    waves = _fft(values).fft(values, axis=1)
    turns = _turns(degree, values.shape[1], waves, -1)
    back = xp.concat((waves[:, :1, :], xp.flip(waves[:, values.shape[1] - degree :, :], axis=1)), axis=1)
    return waves[:, : degree + 1, :] * turns, back * xp.conj(turns)


def complex_from_waves(ahead: Array, back: Array, columns: int) -> Array:
    """sum over m >= 0 of ahead_m e^{i m phi_c} and over m > 0 of back_m e^{-i m phi_c}."""
    xp = namespace(ahead)
    degree = ahead.shape[1] - 1
    turns = _turns(degree, columns, ahead, 1)
    back = xp.flip((back * xp.conj(turns))[:, 1:, :], axis=1)
    shape = (ahead.shape[0], columns - 2 * degree - 1, ahead.shape[2])
    gap = xp.zeros(shape, dtype=ahead.dtype, device=ahead.device)
    return _fft(ahead).ifft(xp.concat((ahead * turns, gap, back), axis=1), axis=1, norm="forward")


def _fft(x: Array) -> Any:
    """SciPy's transforms for NumPy arrays, since they are vectorised in float32 too; the library's own for others."""
    if is_numpy(x):
        import scipy.fft

        return scipy.fft
    return namespace(x).fft


@lru_cache(maxsize=16)
def turns(degree: int, columns: int, sign: int) -> np.ndarray:
    """e^{sign i m phi_0}, (degree + 1,): column 0 stands half a step from phi = 0."""
    turn: np.ndarray = np.exp(1j * sign * np.arange(degree + 1) * (math.pi / columns))
    return turn


def _turns(degree: int, columns: int, waves: Array, sign: int) -> Array:
    """`turns` as (degree + 1, 1) beside `waves`."""
    real = namespace(waves).real(waves)
    turn = turns(degree, columns, sign)[:, None]
    return like(turn.real, real) + 1j * like(turn.imag, real)


def _halves(degree: int, waves: Array) -> Array:
    halves = np.full((degree + 1, 1), 0.5)
    halves[0] = 1
    return like(halves, namespace(waves).real(waves))
