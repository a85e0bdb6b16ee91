"""The table that goes with a roughness chain: what GGX facets reflect of uniform light, by Fresnel's F0 (Karis 2013).

    integral of f cos theta_i d omega_i = F0 scale + bias,      F = F0 + (1 - F0) c,   c = (1 - wi.h)^5   (Schlick 1994)
    scale = mean of (1 - c) G / G_1,   bias = mean of c G / G_1          over the facets that wo sees

A surface's specular radiance is then, nearly, the chain's at R and its roughness times (F0 scale + bias). alpha is
roughness^2, as in glTF; G is a `Smith`, G_1 = (n.wo) / g(wo), of which Karis has the one that is not correlated.

Stretched to alpha = 1 the facets are a half sphere, and wo sees each part of it by its projected area. About the axis
T that is level and across the view, h = sin a T + cos a (cos b T x V + sin b V), that area is cos^2 a sin b da db, and
wi stands above the surface where

    S + R cos(2 (b - b_0)) > 2 alpha^2 co tan^2 a         S, R, b_0 of the view alone

so that Gauss-Legendre rules within these bounds meet nothing but smooth functions.
"""

from __future__ import annotations

import math

import numpy as np

from ..brdf.shadowing import Smith
from ..errors import ParameterError

_NODES = 16  # along a and along b: 4e-5 at worst, towards grazing views; 24 leave 2e-5


def split_sum(size: int, smith: Smith | None = None) -> np.ndarray:
    """(scale, bias), (size, size, 2) float32: rows by roughness, columns by n.wo, each at (k + 1/2) / size.

    smith: `Smith()`, height-correlated, where None; `Smith(correlated=False)` is Karis's. Good to 1e-4. Raises
    `ParameterError` where size is no integer of 1 or more.
    """
    if not isinstance(size, int | np.integer) or isinstance(size, bool) or size < 1:
        raise ParameterError(f"size = {size!r} is no number of texels.")
    correlated = (smith or Smith()).correlated
    at = (np.arange(size) + 0.5) / size
    return np.stack([_row(at, roughness**2, correlated) for roughness in at.tolist()]).astype(np.float32)


def _row(cosine: np.ndarray, alpha: float, correlated: bool) -> np.ndarray:
    """(scale, bias) (n, 2) for views `cosine` (n,), from facets on one side of the plane of view."""
    x, weight = np.polynomial.legendre.leggauss(_NODES)
    co = cosine[:, None, None]
    so = np.sqrt(1 - co * co)
    # Stretched, the view is V = (vx, 0, vz), and T = (0, 1, 0).
    length = np.hypot(alpha * so, co)
    vx, vz = alpha * so / length, co / length
    # wi.n > 0 is 2 (wo.h) h_z > co h.h, a quadratic form in (cos b, sin b) and, by h_y, in tan a.
    p, q = np.array([alpha * vz, alpha * vx]), np.array([-vx, vz])  # h_x and h_z by (cos b, sin b)
    cos2, mixed, sin2 = (
        2 * so * hx_hz + co * (hz2 - hx2)
        for hx_hz, hz2, hx2 in (
            (p[0] * q[0], q[0] ** 2, p[0] ** 2),
            (p[0] * q[1] + p[1] * q[0], 2 * q[0] * q[1], 2 * p[0] * p[1]),
            (p[1] * q[1], q[1] ** 2, p[1] ** 2),
        )
    )
    S, R, middle = cos2 + sin2, np.hypot(cos2 - sin2, mixed), 0.5 * np.arctan2(mixed, cos2 - sin2) % math.pi
    highest = np.arctan(np.sqrt((S + R) / (2 * co)) / alpha)
    # The bounds of b close as a root of highest - a: a sine opens it.
    turn = (0.25 * math.pi * (x + 1))[:, None]
    a = highest * np.sin(turn)
    reach = 0.5 * np.arccos(np.clip((2 * alpha**2 * co * np.tan(a) ** 2 - S) / R, -1, 1))
    # By another sine for b nodes crowd where wi sets, since towards grazing views G falls there within a cosine of co.
    b = middle + reach * np.sin(0.5 * math.pi * x)
    steps = (0.25 * math.pi * weight)[:, None] * (0.5 * math.pi * weight * np.cos(0.5 * math.pi * x))
    da_db = highest * np.cos(turn) * reach * steps
    seen = np.cos(a) ** 2 * np.sin(b) * da_db / (0.25 * math.pi * (1 + vz))
    # Normals shrink along the surface where slopes are stretched.
    hx, hz = (np.cos(a) * (k[0] * np.cos(b) + k[1] * np.sin(b)) for k in (p, q))
    h2 = hx * hx + hz * hz + (alpha * np.sin(a)) ** 2
    wo_h = (hx * so + hz * co) / np.sqrt(h2)
    ci = 2 * (hx * so + hz * co) * hz / h2 - co
    gi, go = (0.5 * (c + np.sqrt(c * c + alpha * alpha * (1 - c * c))) for c in (ci, co))
    share = seen * ci * (go / (gi * co + go * ci - ci * co) if correlated else 1 / gi)
    bias = np.sum(share * (1 - wo_h) ** 5, axis=(1, 2))
    return np.stack((np.sum(share, axis=(1, 2)) - bias, bias), axis=-1)
