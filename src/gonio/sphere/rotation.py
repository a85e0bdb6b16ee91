"""Turning a function on the sphere by turning its coefficients: f(w) becomes f(R^T w), exactly, within each degree.

    f'_lm = sum over k of conj D^l_mk(alpha, beta, gamma) f_lk,       R = R_z(beta) R_y(alpha) R_z(gamma)

in complex harmonics. Real ones turn the same way: about z the two of an order m by an angle of m gamma, about y
cosines and sines each among themselves.
Light seen from a surface with local frame F (rows s, t, n) is rotate(light, F).
"""

from __future__ import annotations

import numpy as np

from .._kernels import wigner as kernel
from ..arrays import Array, floats, is_numpy, like, namespace, to_numpy
from ..errors import ArrayError, DirectionError
from ..frames import euler_angles, require_rotation
from .harmonics import complex_from_real, degree_of, real_from_complex
from .wigner import quarter_turns, require_degree_of_d

_FLOATS = (np.dtype(np.float32), np.dtype(np.float64))


def rotate(coefficients: Array, rotation: Array) -> Array:
    """Coefficients of f(R^T w), from real coefficients ((degree+1)^2,) or ((degree+1)^2, C) of f and R (3, 3).

    What f shows at w stands at R w afterwards. Exact in float64 whatever the dtype, which is kept. Raises
    `DirectionError` where `rotation` is no rotation, `ArrayError` where the coefficients are complex or their count
    is no square, `ParameterError` above degree 1500.
    """
    if not (isinstance(coefficients, np.ndarray) and coefficients.dtype in _FLOATS):  # `floats` asks for longer
        _, coefficients = floats(coefficients)
    degree = degree_of(coefficients)
    require_degree_of_d(degree)
    if coefficients.ndim > 2:
        raise ArrayError(f"coefficients have shape {tuple(coefficients.shape)}: ((degree+1)^2,) or ((degree+1)^2, C).")
    if not is_numpy(coefficients):
        xp = namespace(coefficients)
        precise = xp.astype(coefficients, xp.float64)
        return xp.astype(_by_quarter_turns(precise, degree, like(rotation, precise)), coefficients.dtype)
    R = np.ascontiguousarray(to_numpy(rotation), dtype=np.float64)
    if R.shape != (3, 3):
        raise DirectionError(f"rotation has shape {R.shape}; one is needed: (3, 3).")
    alpha, beta, gamma, error = kernel.angles(R)
    if not error < 1e-10:  # so written that NaN fails too
        require_rotation(R, "rotation")
    columns = np.ascontiguousarray(coefficients, dtype=np.float64).reshape(len(coefficients), -1)
    turned = np.empty_like(columns)
    kernel.rotate(columns, alpha, beta, gamma, turned)
    return turned.reshape(coefficients.shape).astype(coefficients.dtype, copy=False)


def _by_quarter_turns(coefficients: Array, degree: int, rotation: Array) -> Array:
    """d(alpha) = z(-pi/2) d(pi/2)^T z(alpha) d(pi/2) z(pi/2), z(a) the turn about z: products that carry gradients."""
    xp, rotation = floats(rotation)
    alpha, beta, gamma = euler_angles(rotation)
    complex_coefficients = complex_from_real(coefficients)
    parts = []
    for l, quarter in enumerate(quarter_turns(degree)):
        part = complex_coefficients[l * l : (l + 1) ** 2, ...]
        half_way = like(quarter, coefficients) + 0j

        def about_z(angle: Array, part: Array, l: int = l) -> Array:
            phase = like(np.arange(-l, l + 1.0), coefficients) * angle
            turn = xp.cos(phase) - 1j * xp.sin(phase)
            return turn.reshape((-1,) + (1,) * (part.ndim - 1)) * part

        part = half_way @ about_z(gamma + np.pi / 2, part)
        part = xp.matrix_transpose(half_way) @ about_z(alpha, part)
        parts.append(about_z(beta - np.pi / 2, part))
    return real_from_complex(xp.concat(parts, axis=0))
