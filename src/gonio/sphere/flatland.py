"""Reflection in flatland, the plane: convolution by Fourier series.

    F_k(theta) = exp(i k theta) / sqrt(2 pi)                                                            (RH 2.17)
    rho^(theta_i, theta_o) = sum of rho_lp conj F_l(theta_i) F_p(theta_o),    rho^ = rho cos theta_i    (RH 2.20)
    B(alpha, theta_o) = integral of L(alpha + theta_i) rho^(theta_i, theta_o) d theta_i                 (RH 2.6)
    B_lp = sqrt(2 pi) L_l rho_lp,    B_l(theta_o) = sqrt(2 pi) L_l rho_l(theta_o)                       (RH 2.24, 2.25)

Orders k = -degree..degree ascending, 2 degree + 1 of them. Angles in radians, local ones from the normal; a BRDF is
zero beyond pi/2 on either side. Arrays of other libraries are answered in kind. Space: `convolution.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..arrays import Array, floats, is_numpy, like, namespace
from ..errors import ArrayError, ParameterError
from .convolution import Deconvolved
from .harmonics import require_degree


def analysis(values: Array, degree: int) -> Array:
    """f_k, (2 degree + 1,), from f at theta = -pi + 2 pi j / N, j = 0..N-1. Exact where N > 2 degree bounds f. RH 2.17.

    Raises `ArrayError` where N <= 2 degree: then orders could not be told apart.
    """
    require_degree(degree)
    xp = namespace(values)
    values = _complex(xp, values)
    count = values.shape[0] if values.ndim else 0
    if values.ndim != 1 or count <= 2 * degree:
        raise ArrayError(f"values have shape {tuple(values.shape)}; degree {degree} needs (N,), N > {2 * degree}.")
    theta = like(-math.pi + 2 * math.pi / count * np.arange(count), xp.real(values))
    return xp.conj(_waves(degree, theta)).T @ values * (2 * math.pi / count)


def synthesis(coefficients: Array, theta: Array) -> Array:
    """f(theta), (...) complex, from f_k. RH 2.17."""
    xp = namespace(coefficients, theta)
    coefficients = _complex(xp, coefficients)
    return _waves(_degree_of(coefficients), like(theta, xp.real(coefficients))) @ coefficients


def transfer(
    brdf: Callable[[np.ndarray, np.ndarray], np.ndarray], degree: int, exit_degree: int, samples: int = 256
) -> np.ndarray:
    """rho_lp, (2 degree + 1, 2 exit_degree + 1), of brdf(theta_i, theta_o) without its cosine. RH 2.20.

    Gauss's rule of `samples` a side over [-pi/2, pi/2], where `brdf` is called with arrays that broadcast.
    """
    require_degree(degree)
    require_degree(exit_degree, "exit_degree")
    if samples <= max(degree, exit_degree):
        raise ParameterError(
            f"samples = {samples} cannot carry degree {max(degree, exit_degree)}; give more than that."
        )
    nodes, weights = np.polynomial.legendre.leggauss(samples)
    theta, weights = nodes * (math.pi / 2), weights * (math.pi / 2)
    rho = np.asarray(brdf(theta[:, None], theta)) * np.cos(theta)[:, None] * np.outer(weights, weights)
    coefficients: np.ndarray = _waves(degree, theta).T @ rho @ np.conj(_waves(exit_degree, theta))
    return coefficients


def reflect(light: Array, transfer: Array) -> Array:
    """B_lp from L_l (2F+1,) and rho_lp (2F+1, 2P+1), RH 2.24; or B_l(theta_o) from rho_l(theta_o) (2F+1, K), 2.25."""
    _, light, transfer = _pair(light, transfer, "transfer")
    return math.sqrt(2 * math.pi) * light[:, None] * transfer


def radiance(field: Array, alpha: Array, theta_o: Array) -> Array:
    """B(alpha, theta_o), (...) complex, of B_lp at normals alpha and exit angles theta_o, broadcast. RH 2.20."""
    xp = namespace(field, alpha, theta_o)
    field = _complex(xp, field)
    if field.ndim != 2:
        raise ArrayError(f"field has shape {tuple(field.shape)}; it is (2F+1, 2P+1).")
    alpha, theta_o = xp.broadcast_arrays(*(like(angle, xp.real(field)) for angle in (alpha, theta_o)))
    at_normals = _waves(_degree_of(field), alpha) @ field
    return xp.sum(at_normals * _waves(_degree_of(field[0, :]), theta_o), axis=-1)


def brdf_from_light(field: Array, light: Array, level: float = 1e-6) -> Deconvolved:
    """rho_lp = B_lp / (sqrt(2 pi) L_l), masked at orders where abs(L_l) is below `level` of the largest."""
    xp, light, field = _pair(light, field, "field")
    known = xp.abs(light) > level * xp.max(xp.abs(light))
    divisor = math.sqrt(2 * math.pi) * xp.where(known, light, xp.ones_like(light))
    return Deconvolved(xp.where(known[:, None], field / divisor[:, None], xp.zeros_like(field)), known)


def light_from_brdf(field: Array, transfer: Array, level: float = 1e-6) -> Deconvolved:
    """L_l by least squares over p, masked at orders that the BRDF passes with less than `level` of the strongest."""
    xp = namespace(field, transfer)
    field, transfer = _complex(xp, field), _complex(xp, transfer)
    if field.ndim != 2 or field.shape != transfer.shape:
        raise ArrayError(
            f"field {tuple(field.shape)} and transfer {tuple(transfer.shape)} differ in shape, or are not (2F+1, 2P+1)."
        )
    energy = xp.sum(xp.abs(transfer) ** 2, axis=1)
    known = xp.sqrt(energy) > level * xp.sqrt(xp.max(energy))
    divisor = math.sqrt(2 * math.pi) * xp.where(known, energy, xp.ones_like(energy))
    value = xp.sum(xp.conj(transfer) * field, axis=1) / divisor
    return Deconvolved(xp.where(known, value, xp.zeros_like(value)), known)


def _waves(degree: int, theta: Array) -> Array:
    """F_k(theta): (..., 2 degree + 1)."""
    xp, theta = floats(theta)
    phase = theta[..., None] * like(np.arange(-degree, degree + 1.0), theta)
    return (xp.cos(phase) + 1j * xp.sin(phase)) / math.sqrt(2 * math.pi)


def _complex(xp: Array, x: Array) -> Array:
    """`x`, complex: products of real and complex arrays are not for every library."""
    x = xp.asarray(x) if is_numpy(x) else x
    single = x.dtype in (xp.float32, xp.complex64)
    return xp.astype(x, xp.complex64 if single else xp.complex128)


def _degree_of(coefficients: Array) -> int:
    if coefficients.ndim == 0 or coefficients.shape[0] % 2 == 0:
        shape = tuple(coefficients.shape)
        raise ArrayError(f"coefficients have shape {shape}; orders -degree..degree are an odd number.")
    return int(coefficients.shape[0]) // 2


def _pair(light: Array, other: Array, name: str) -> tuple[Array, Array, Array]:
    """The namespace, and both complex; refused where their orders do not meet."""
    xp = namespace(light, other)
    light, other = _complex(xp, light), _complex(xp, other)
    _degree_of(light)
    if light.ndim != 1 or other.ndim != 2 or light.shape[0] != other.shape[0]:
        shapes = f"light {tuple(light.shape)} and {name} {tuple(other.shape)}"
        raise ArrayError(f"{shapes} do not meet: (2F+1,) and (2F+1, K).")
    return xp, light, other
