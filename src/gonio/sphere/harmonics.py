"""Spherical harmonics of any degree, real and complex, at directions.

    complex  Y_{l,m}  = (-1)^m N_lm P_lm(cos theta) e^{i m phi},  Y_{l,-m} = (-1)^m conj Y_{l,m}      (RH 2.26, 2.29)
    real     Y_{l,m}  = sqrt2 N_lm P_lm(cos theta) cos(m phi),    Y_{l,-m} the same with sin(m phi)   (RH 4.3, 4.4)

for m > 0, P_lm without the Condon-Shortley sign and N_lm so that they are orthonormal over the sphere. So the complex
harmonics carry that sign and the real ones do not: Y_{1,1} goes with +x, Y_{1,-1} with +y, Y_{1,0} with +z.

They are evaluated as polynomials in x, y, z, Y = Q_lm(z) (x + i y)^m, smooth at the poles as well:
    Q_lm = a_lm z Q_{l-1,m} - b_lm Q_{l-2,m}
Q stays below 1e200 up to degree 1,000, and (x + i y)^m vanishes only where Y does to more than 100 digits.

Coefficients lie along axis 0 in the order index(l, m) = l (l + 1) + m, channels after it. Fast sums over whole grids
stand in `transform.py`, rotations in `rotation.py`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..arrays import Array, floats, like, namespace
from ..directions import dot, require_unit
from ..errors import ArrayError, ParameterError


def index(l: int, m: int) -> int:
    """Where degree `l`, order `m` (-l..l) stands among the coefficients: l (l + 1) + m."""
    return l * (l + 1) + m


def degree_of(coefficients: Array) -> int:
    """The degree of `coefficients`, whose axis 0 has (degree + 1)^2 entries.

    Raises `ArrayError` where axis 0 is no such square.
    """
    shape = tuple(coefficients.shape)
    count = shape[0] if shape else 0
    degree = math.isqrt(count) - 1
    if count == 0 or (degree + 1) ** 2 != count:
        raise ArrayError(f"coefficients have shape {shape}; axis 0 must hold (degree + 1)^2 of them: 1, 4, 9, 16, ...")
    return degree


def degrees_and_orders(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """(l, m) of every coefficient up to `degree`, each ((degree + 1)^2,) integers in the order of `index`."""
    require_degree(degree)
    l = np.repeat(np.arange(degree + 1), 2 * np.arange(degree + 1) + 1)
    return l, np.arange(l.size) - l * (l + 1)


def harmonics(degree: int, directions: Array) -> Array:
    """Real harmonics to `degree` at unit `directions` (..., 3) -> (..., (degree + 1)^2). RH 4.3, 4.4.

    Raises `DirectionError` where a direction is not unit, `ParameterError` where the degree is none.
    """
    xp, polynomials, cosines, sines, dtype = _factors(degree, directions)
    root = math.sqrt(2)
    rows = []
    for l, q in enumerate(polynomials):
        sectoral = q[..., 1:] * root
        rows.append(xp.flip(sectoral * sines[..., 1 : l + 1], axis=-1))
        rows.append(q[..., :1])
        rows.append(sectoral * cosines[..., 1 : l + 1])
    return xp.astype(xp.concat(rows, axis=-1), dtype)


def complex_harmonics(degree: int, directions: Array) -> Array:
    """Complex harmonics to `degree` at unit `directions` (..., 3) -> (..., (degree + 1)^2). RH 2.26.

    complex64 for float32 directions, complex128 for float64. Raises as `harmonics` does.
    """
    xp, polynomials, cosines, sines, dtype = _factors(degree, directions)
    power = cosines + 1j * sines
    sign = like((-1.0) ** np.arange(degree + 1), cosines)
    rows = []
    for l, q in enumerate(polynomials):
        positive = q * sign[: l + 1] * power[..., : l + 1]
        rows.append(xp.flip(xp.conj(positive[..., 1:]) * sign[1 : l + 1], axis=-1))
        rows.append(positive)
    return xp.astype(xp.concat(rows, axis=-1), xp.complex64 if dtype == xp.float32 else xp.complex128)


def real_from_complex(coefficients: Array) -> Array:
    """Coefficients of a real function in the real harmonics, from those in the complex ones, ((degree + 1)^2, ...).

    Uses m >= 0 only; those at m < 0 follow where the function is real: f_{l,-m} = (-1)^m conj f_{l,m}.
    Raises `ArrayError` where they do not follow to 1e-3 of the largest.
    """
    xp = namespace(coefficients)
    degree = degree_of(coefficients)
    mirror, sign, _, order = _mirror(degree, coefficients)
    reflected = xp.conj(xp.take(coefficients, mirror, axis=0)) * sign
    if not bool(xp.max(xp.abs(coefficients - reflected)) <= 1e-3 * xp.max(xp.abs(coefficients))):
        raise ArrayError("coefficients are not those of a real function: f_{l,-m} differs from (-1)^m conj f_{l,m}.")
    # f = f_0 Y_0 + sum over m > 0 of 2 Re(f_m Y_m), and Y_m = (-1)^m (real Y_m + i real Y_-m) / sqrt2.
    scaled = coefficients * sign * math.sqrt(2)
    return xp.where(
        order > 0,
        xp.real(scaled),
        xp.where(order < 0, -xp.imag(xp.take(scaled, mirror, axis=0)), xp.real(coefficients)),
    )


def complex_from_real(coefficients: Array) -> Array:
    """Coefficients in the complex harmonics of the real function given in the real ones, ((degree + 1)^2, ...)."""
    xp, coefficients = floats(coefficients)
    degree = degree_of(coefficients)
    mirror, sign, _, order = _mirror(degree, coefficients)
    other = xp.take(coefficients, mirror, axis=0)
    half = math.sqrt(0.5)
    zero = xp.zeros_like(coefficients)
    real = xp.where(order > 0, sign * half * coefficients, xp.where(order < 0, half * other, coefficients))
    imaginary = xp.where(order > 0, -sign * half * other, xp.where(order < 0, half * coefficients, zero))
    return real + 1j * imaginary


def power_spectrum(coefficients: Array) -> Array:
    """Energy of each degree: the sum over m of abs(f_lm)^2, ((degree + 1)^2, ...) -> (degree + 1, ...).

    The same for real and complex coefficients and in every rotated frame; its sum is the integral of abs(f)^2.
    """
    xp = namespace(coefficients)
    degree = degree_of(coefficients)
    energy = xp.abs(coefficients) ** 2
    return xp.stack(tuple(xp.sum(energy[l * l : (l + 1) ** 2, ...], axis=0) for l in range(degree + 1)), axis=0)


def require_degree(degree: int, name: str = "degree") -> None:
    """Raises `ParameterError` where `degree` is not an integer of 0 or more."""
    if not isinstance(degree, int | np.integer) or isinstance(degree, bool) or degree < 0:
        raise ParameterError(f"{name} = {degree!r} is not an integer of 0 or more.")


def _factors(degree: int, directions: Array) -> tuple[Any, Any, Array, Array, Any]:
    """Namespace, the Q_lm of each l in turn (..., l + 1), Re and Im of (x + i y)^m (..., degree + 1), output dtype."""
    require_degree(degree)
    require_unit(directions, "directions")
    xp, w = floats(directions)
    dtype = w.dtype
    # The recursion loses about `degree` units of rounding: too many of float32's.
    w = xp.astype(w, xp.float64)
    w = w / xp.sqrt(dot(w, w))[..., None]
    x, y, z = w[..., 0], w[..., 1], w[..., 2]
    cosines, sines = [xp.ones_like(x)], [xp.zeros_like(x)]
    for _ in range(degree):
        c, s = cosines[-1], sines[-1]
        cosines.append(x * c - y * s)
        sines.append(x * s + y * c)
    return xp, _polynomials(xp, degree, z[..., None]), xp.stack(cosines, axis=-1), xp.stack(sines, axis=-1), dtype


def _polynomials(xp: Any, degree: int, z: Array) -> Any:
    """Q_lm(z), m = 0..l, for l = 0..degree in turn: (..., 1) -> (..., l + 1)."""
    before = None
    q = xp.zeros_like(z) + math.sqrt(0.25 / math.pi)
    yield q
    diagonal = math.sqrt(0.25 / math.pi)
    for l in range(1, degree + 1):
        m = np.arange(l)
        a = np.sqrt((4.0 * l * l - 1) / (l * l - m * m))
        new = like(a, z) * z * q
        if before is not None:
            b = np.sqrt((2 * l + 1) * ((l - 1.0) ** 2 - m * m) / ((2 * l - 3) * (l * l - m * m)))
            new = new - like(b, z) * xp.concat((before, xp.zeros_like(z)), axis=-1)
        diagonal *= math.sqrt((2 * l + 1) / (2 * l))
        before, q = q, xp.concat((new, xp.zeros_like(z) + diagonal), axis=-1)
        yield q


def _mirror(degree: int, coefficients: Array) -> tuple[Array, Array, Array, Array]:
    """For each coefficient the index of (l, -m), (-1)^m, l and m; the last three shaped to meet `coefficients`."""
    xp = namespace(coefficients)
    l, m = degrees_and_orders(degree)
    shape = (l.size,) + (1,) * (coefficients.ndim - 1)
    device = coefficients.device
    return (
        xp.asarray(l * (l + 1) - m, device=device),
        like((-1.0) ** m, xp.real(coefficients)).reshape(shape),
        xp.asarray(l.reshape(shape), device=device),
        xp.asarray(m.reshape(shape), device=device),
    )
