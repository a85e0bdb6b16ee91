"""Coefficients of lights that have them in closed form, in real harmonics: ((degree+1)^2,) or ((degree+1)^2, C).

    directional source   L_lm = E Y_lm(w)                   (RH 3.13)
    about an axis        L_lm = A_l Y_lm(axis)              (RH 3.18: m = 0 alone where the axis is +z)
    uniform light        L_00 = sqrt(4 pi) L                (RH 3.19 with L = 1 / sqrt(4 pi))

For the convolutions of `sphere/convolution.py` pass them through `complex_from_real`. Coefficients of measured
environments: `Environment.harmonics`.
"""

from __future__ import annotations

import math

from ..arrays import Array, floats
from ..directions import require_unit
from ..errors import ArrayError, ParameterError
from ..sphere.harmonics import harmonics, require_degree
from ..sphere.zonal import convolve


def directional(degree: int, direction: Array, irradiance: Array = 1.0) -> Array:
    """A distant source towards unit `direction` (3,) that gives `irradiance`, number or (C,), to a facing plane."""
    xp, direction, irradiance = floats(direction, irradiance)
    return _scaled(xp, _towards(degree, direction, "direction"), irradiance, "irradiance")


def axial(axis: Array, kernel: Array) -> Array:
    """L(w) = k(w . axis) about unit `axis` (3,), from the kernel's A_l (degree+1,) or (degree+1, C): see `zonal`.

    `zonal.coefficients` makes A_l of any profile (a cloudy sky, a round lamp).
    """
    _, axis, kernel = floats(axis, kernel)
    if kernel.ndim not in (1, 2) or kernel.shape[0] == 0:
        raise ArrayError(f"kernel has shape {tuple(kernel.shape)}; it is (degree+1,) or (degree+1, C).")
    return convolve(_towards(kernel.shape[0] - 1, axis, "axis"), kernel)


def uniform(degree: int, radiance: Array = 1.0) -> Array:
    """The same `radiance`, number or (C,), from everywhere."""
    require_degree(degree)
    xp, radiance = floats(radiance)
    first = math.sqrt(4 * math.pi) * xp.ones_like(radiance)[None, ...]
    rest = xp.zeros(((degree + 1) ** 2 - 1, *radiance.shape), dtype=radiance.dtype, device=radiance.device)
    shape = xp.concat((first, rest), axis=0)
    _require_not_negative(xp, radiance, "radiance")
    return shape * radiance


def _towards(degree: int, direction: Array, name: str) -> Array:
    require_unit(direction, name)
    if direction.ndim != 1:
        raise ArrayError(f"{name} has shape {tuple(direction.shape)}; one light has one: (3,).")
    return harmonics(degree, direction)


def _scaled(xp: Array, coefficients: Array, scale: Array, name: str) -> Array:
    _require_not_negative(xp, scale, name)
    return coefficients * scale if scale.ndim == 0 else coefficients[:, None] * scale


def _require_not_negative(xp: Array, value: Array, name: str) -> None:
    if value.ndim > 1 or not bool(xp.all((value >= 0) & xp.isfinite(value))):
        raise ParameterError(f"{name} is not a number or (C,) of 0 or more.")
