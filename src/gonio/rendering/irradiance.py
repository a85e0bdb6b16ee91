"""Irradiance from a few harmonic coefficients of the light (RH 4).

    E(n) = sum_lm A_l L_lm Y_lm(n)         A_l = pi, 2 pi/3, pi/4, 0, -pi/24, ...   (RH 4.10, 4.12)
    E(n) = [n; 1]^T M [n; 1]               M from the nine coefficients of degree 2  (RH 4.14, 4.15)

Nine coefficients give the irradiance of any distant light within 9 % of its total intensity, and on average within
3 % (RH 4.3.1). A directional source is better added exactly, as max(n.l, 0) times its irradiance.
"""

from __future__ import annotations

import math

from ..arrays import Array, floats
from ..directions import require_unit
from ..errors import ArrayError
from ..sphere.harmonics import degree_of, harmonics
from ..sphere.zonal import clamped_cosine, convolve


def irradiance_coefficients(light: Array) -> Array:
    """E_lm = A_l L_lm (RH 4.8): coefficients of the light ((degree + 1)^2, C) -> of the irradiance, same shape."""
    return convolve(light, clamped_cosine(degree_of(light)))


def irradiance(light: Array, n: Array) -> Array:
    """E(n) at unit normals (..., 3) from the light's coefficients ((degree + 1)^2, C): (..., C), RH 4.10.

    Cut at a low degree the sum rings, and may fall below zero where little light arrives; it is returned as it is.
    """
    require_unit(n, "n")
    xp, light, n = floats(light, n)
    E = irradiance_coefficients(light)
    return xp.tensordot(harmonics(degree_of(E), n), E, axes=1)


def irradiance_matrix(light: Array) -> Array:
    """The symmetric matrix M (C, 4, 4) of RH 4.15 with E(n) = [n; 1]^T M [n; 1], from nine coefficients (9, C).

    Raises `ArrayError` where there are not nine.
    """
    xp, L = floats(light)
    if L.ndim != 2 or L.shape[0] != 9:
        raise ArrayError(f"light has shape {tuple(L.shape)}; the matrix of RH 4.15 takes nine coefficients, (9, C).")
    # A_l times the norms of the harmonics of RH 4.5, off-diagonal terms halved: .429043, .511664, .743125, ...
    c1, c2 = math.sqrt(15 * math.pi) / 16, math.sqrt(math.pi / 3) / 2
    c3, c4, c5 = 3 * math.sqrt(5 * math.pi) / 16, math.sqrt(math.pi) / 2, math.sqrt(5 * math.pi) / 16
    L00, L1m1, L10, L11, L2m2, L2m1, L20, L21, L22 = (L[k, :] for k in range(9))
    rows = (
        (c1 * L22, c1 * L2m2, c1 * L21, c2 * L11),
        (c1 * L2m2, -c1 * L22, c1 * L2m1, c2 * L1m1),
        (c1 * L21, c1 * L2m1, c3 * L20, c2 * L10),
        (c2 * L11, c2 * L1m1, c2 * L10, c4 * L00 - c5 * L20),
    )
    return xp.stack(tuple(xp.stack(row, axis=-1) for row in rows), axis=-2)
