"""Reflection in flatland, the plane: convolution by Fourier series.

    F_k(theta) = exp(i k theta) / sqrt(2 pi)                                                            (RH 2.17)
    rho^(theta_i, theta_o) = sum of rho_lp conj F_l(theta_i) F_p(theta_o),    rho^ = rho cos theta_i    (RH 2.20)
    B(alpha, theta_o) = integral of L(alpha + theta_i) rho^(theta_i, theta_o) d theta_i                 (RH 2.6)
    B_lp = sqrt(2 pi) L_l rho_lp,    B_l(theta_o) = sqrt(2 pi) L_l rho_l(theta_o)                       (RH 2.24, 2.25)

Orders k = -degree..degree ascending, 2 degree + 1 of them. Angles in radians, local ones from the normal; a BRDF is
zero beyond pi/2 on either side. Space: `convolution.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..arrays import Array
from ..errors import ArrayError, ParameterError
from .convolution import Deconvolved
from .harmonics import require_degree


def analysis(values: Array, degree: int) -> np.ndarray:
    """f_k, (2 degree + 1,), from f at theta = -pi + 2 pi j / N, j = 0..N-1. Exact where N > 2 degree bounds f. RH 2.17.

    Raises `ArrayError` where N <= 2 degree: then orders could not be told apart.
    """
    require_degree(degree)
    values = np.asarray(values)
    if values.ndim != 1 or len(values) <= 2 * degree:
        raise ArrayError(f"values have shape {values.shape}; degree {degree} needs (N,), N > {2 * degree}.")
    theta = -math.pi + 2 * math.pi / len(values) * np.arange(len(values))
    coefficients: np.ndarray = np.conj(_waves(degree, theta)).T @ values * (2 * math.pi / len(values))
    return coefficients


def synthesis(coefficients: Array, theta: Array) -> np.ndarray:
    """f(theta), (...) complex, from f_k. RH 2.17."""
    coefficients = np.asarray(coefficients)
    values: np.ndarray = _waves(_degree_of(coefficients), np.asarray(theta)) @ coefficients
    return values


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


def reflect(light: Array, transfer: Array) -> np.ndarray:
    """B_lp from L_l (2F+1,) and rho_lp (2F+1, 2P+1), RH 2.24; or B_l(theta_o) from rho_l(theta_o) (2F+1, K), 2.25."""
    light, transfer = np.asarray(light), np.asarray(transfer)
    _require_pair(light, transfer, "transfer")
    field: np.ndarray = math.sqrt(2 * math.pi) * light[:, None] * transfer
    return field


def radiance(field: Array, alpha: Array, theta_o: Array) -> np.ndarray:
    """B(alpha, theta_o), (...) complex, of B_lp at normals alpha and exit angles theta_o, broadcast. RH 2.20."""
    field = np.asarray(field)
    alpha, theta_o = np.broadcast_arrays(alpha, theta_o)
    waves = _waves(_degree_of(field), alpha), _waves(_degree_of(field[0]), theta_o)
    values: np.ndarray = np.einsum("...l,lp,...p->...", waves[0], field, waves[1])
    return values


def brdf_from_light(field: Array, light: Array, level: float = 1e-6) -> Deconvolved:
    """rho_lp = B_lp / (sqrt(2 pi) L_l), masked at orders where abs(L_l) is below `level` of the largest."""
    field, light = np.asarray(field), np.asarray(light)
    _require_pair(light, field, "field")
    known = np.abs(light) > level * np.max(np.abs(light))
    divisor = math.sqrt(2 * math.pi) * np.where(known, light, 1)
    return Deconvolved(np.where(known[:, None], field / divisor[:, None], 0), known)


def light_from_brdf(field: Array, transfer: Array, level: float = 1e-6) -> Deconvolved:
    """L_l by least squares over p, masked at orders that the BRDF passes with less than `level` of the strongest."""
    field, transfer = np.asarray(field), np.asarray(transfer)
    if field.ndim != 2 or field.shape != transfer.shape:
        raise ArrayError(f"field {field.shape} and transfer {transfer.shape} differ in shape, or are not (2F+1, 2P+1).")
    energy = np.sum(np.abs(transfer) ** 2, axis=1)
    known = np.sqrt(energy) > level * np.sqrt(np.max(energy))
    divisor = math.sqrt(2 * math.pi) * np.where(known, energy, 1)
    return Deconvolved(np.where(known, np.sum(np.conj(transfer) * field, axis=1) / divisor, 0), known)


def _waves(degree: int, theta: np.ndarray) -> np.ndarray:
    """F_k(theta): (..., 2 degree + 1)."""
    waves: np.ndarray = np.exp(1j * theta[..., None] * np.arange(-degree, degree + 1)) / math.sqrt(2 * math.pi)
    return waves


def _degree_of(coefficients: np.ndarray) -> int:
    if coefficients.ndim == 0 or len(coefficients) % 2 == 0:
        raise ArrayError(f"coefficients have shape {coefficients.shape}; orders -degree..degree are an odd number.")
    return len(coefficients) // 2


def _require_pair(light: np.ndarray, other: np.ndarray, name: str) -> None:
    _degree_of(light)
    if light.ndim != 1 or other.ndim != 2 or len(light) != len(other):
        raise ArrayError(f"light {light.shape} and {name} {other.shape} do not meet: (2F+1,) and (2F+1, K).")
