"""Fibres under an environment: Kajiya and Kay's model by its tangent (RH 5.3.1, 5.7.1).

    B(t, wo) = integral over the whole sphere of f(theta_i, theta_o) L(w) d omega,     angles counted from the tangent t
             = sum over p of b_p(t) Y_p0(theta_o),     b_p = sum over l, m of Lambda_l rho_lp0 L_lm Y_lm(t)

A fibre has no normal: light reaches it from all around, and azimuth about it does not count, so that P + 1 maps hold
it. f is Kajiya and Kay's, without a surface's cosine. Counted from the tangent it is not about the mirror cone, and P
is large: 8 for 97 % of the energy at s = 32.
"""

from __future__ import annotations

import dataclasses
import math
import warnings

import numpy as np

from ..arrays import Array, floats, frozen, is_numpy, like, to_numpy
from ..brdf.harmonic import meridian
from ..brdf.kajiya_kay import KajiyaKay
from ..directions import dot, require_unit
from ..errors import AccuracyWarning
from ..lights.environment import Environment
from ..sphere.harmonics import degree_of, degrees_and_orders, harmonics, power_spectrum
from ..sphere.wigner import big_lambda
from .orders import on_grid, require_share

_DEGREE = 24  # the most, of light and of exits


@dataclasses.dataclass(frozen=True, eq=False)
class FibreMaps:
    """What fibres of every direction reflect towards every eye.

    coefficients: b_p in real harmonics of t, ((F+1)^2, P+1, C). error: relative rms that the series leave out.
    """

    coefficients: Array
    error: float

    def radiance(self, t: Array, wo: Array) -> Array:
        """B (N, C) of fibres along unit tangents t (N, 3), seen from unit wo (N, 3), by the series; cut at 0.

        Raises `DirectionError` where t or wo are not unit.
        """
        require_unit(t, "t")
        require_unit(wo, "wo")
        xp, t, wo = floats(t, wo)
        c = like(self.coefficients, t) if is_numpy(self.coefficients) else self.coefficients
        terms = (harmonics(degree_of(c), t) @ xp.reshape(c, (c.shape[0], -1))).reshape(-1, *c.shape[1:])
        cosine = xp.clip(dot(t, wo), -1.0, 1.0)
        around = xp.stack((xp.sqrt(1 - cosine * cosine), xp.zeros_like(cosine), cosine), axis=-1)
        around = around / xp.sqrt(dot(around, around))[..., None]
        p = np.arange(c.shape[1])
        zonal = xp.take(harmonics(c.shape[1] - 1, around), xp.asarray(p * (p + 1), device=t.device), axis=-1)
        B = xp.sum(zonal[..., None] * terms, axis=1)
        return xp.where(B > 0, B, xp.zeros_like(B))


def fibre_transfer(model: KajiyaKay, degree: int, exit_degree: int) -> tuple[np.ndarray, np.ndarray]:
    """rho_lp0 about the tangent, (degree+1, exit_degree+1, 1, C), and the energy (C,), the integral of f^2 over both
    spheres, of which the sum of rho_lp0^2 is the part carried."""
    nodes, weight = np.polynomial.legendre.leggauss(2 * max(degree, exit_degree) + 64)
    theta = np.arccos(nodes)
    w = np.stack((nodes, np.zeros_like(nodes), np.sin(theta)), axis=-1)  # the tangent is x of the local frame
    f = to_numpy(model._f(np, w[:, None], w[None]))
    at = meridian(max(degree, exit_degree), theta)[:, :, 0] * weight[:, None] * 2 * math.pi
    rho = np.einsum("il,jp,ijc->lpc", at[:, : degree + 1], at[:, : exit_degree + 1], f, optimize=True)
    energy = 4 * math.pi**2 * np.einsum("i,j,ijc->c", weight, weight, f * f)
    return rho[:, :, None], energy


def prefilter_fibres(light: Environment, model: KajiyaKay, error: float = 0.03) -> FibreMaps:
    """Maps of fibres under `light`, with the fewest terms that leave out no more than `error`, relative rms.

    Warns with `AccuracyWarning` where degree 24 does not reach it. Raises `ParameterError` for an error that is not
    between 0 and 1, and for lights that are no environments.
    """
    require_share(error)
    light = on_grid(light)
    degree = min(_DEGREE, light.rows - 1)
    coefficients = to_numpy(light.harmonics(degree))
    rho, energy = fibre_transfer(model, degree, _DEGREE)
    scale = big_lambda(degree)[:, None] ** 2 * power_spectrum(coefficients.astype(np.float64))
    carried = (scale[:, None] * rho[:, :, 0] ** 2).sum(axis=2)
    beyond = float(np.sum(np.maximum(energy - np.sum(rho[:, :, 0] ** 2, axis=(0, 1)), 0) * scale[-1]))
    total = float(carried.sum()) + beyond
    kept = carried.cumsum(axis=0).cumsum(axis=1)
    enough = np.argwhere(total - kept <= error**2 * total)
    if len(enough):
        F, P = min(enough.tolist(), key=lambda at: (at[1], at[0]))
    else:
        F, P = degree, _DEGREE
    left = math.sqrt(max(total - float(kept[F, P]), 0) / total) if total > 0 else 0.0
    if left > error:
        warnings.warn(
            f"the series leave out {left:.2g} of what fibres reflect, rms, where {error:g} was asked for.",
            AccuracyWarning,
            stacklevel=2,
        )
    l = degrees_and_orders(F)[0]
    c = coefficients[: (F + 1) ** 2, None] * (big_lambda(F)[:, None, None] * rho[: F + 1, : P + 1, 0])[l]
    return FibreMaps(frozen(c, coefficients.dtype), left)
