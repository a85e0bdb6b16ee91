"""What part of the light a surface reflects.

    directional-hemispherical   a(wo) = integral of f(wi, wo) cos theta_i d omega_i
    bihemispherical (white)     1/pi integral of a(wo) cos theta_o d omega_o

By the model's own sampler: it maps the unit square to directions where f is large, and what is left, f cos / pdf, is
smooth there however narrow the lobe. Each lobe is integrated by itself over a Gauss-Legendre grid of the square, which
is doubled until nothing changes. For reciprocal models a(w) is also what light from w loses to none.
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np

from ..arrays import Array, floats, like
from ..directions import require_unit
from ..errors import AccuracyWarning, ParameterError
from .model import BRDF

COARSEST, FINEST = 16, 512  # nodes along each side of the square
BLOCK = 1 << 17  # pairs of directions at a time


def albedo(brdf: BRDF, wo: Array | None = None, tolerance: float = 1e-4) -> Array:
    """The reflectance (..., C) of `brdf` for unit local `wo` (..., 3); without `wo` the white albedo, under light from
    everywhere.

    The grid is refined until the albedo of every lobe changes by less than `tolerance`; where the finest grid does not
    get there, as for measured tables with narrow lobes, an `AccuracyWarning` says how far it came. By reciprocity
    a(w) is as well what is reflected, all told, of light from w.
    """
    if not tolerance > 0:
        raise ParameterError(f"tolerance = {tolerance} is not positive.")
    if wo is None:
        return _white(brdf, tolerance)
    require_unit(wo, "wo")
    xp, wo = floats(wo)
    total = sum(_converged(xp, lobe, wo, tolerance) for lobe in brdf.lobes())
    return xp.where(wo[..., 2:] > 0, total, xp.zeros_like(total))


def _white(brdf: BRDF, tolerance: float) -> Array:
    """The mean of the directional albedo over cos^2 theta_o and phi_o."""
    cosine, weight = _gauss(24)
    phi = 2 * np.pi * (np.arange(12) + 0.5) / 12
    s = np.sqrt(1 - cosine**2)[:, None]
    wo = np.stack((s * np.cos(phi), s * np.sin(phi), np.broadcast_to(cosine[:, None], (24, 12))), axis=-1)
    # Sites come last: one axis for the views, before all axes that parameters may have.
    rank = brdf.f(np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0])).ndim - 1
    views = wo.reshape(-1, *(1,) * rank, 3)
    weights = np.repeat(2 * cosine * weight / 12, 12)
    return np.tensordot(weights, albedo(brdf, views, tolerance), axes=(0, 0))


def _converged(xp: Any, lobe: BRDF, wo: Array, tolerance: float) -> Array:
    value, change, n = _integral(xp, lobe, wo, COARSEST), math.inf, COARSEST
    while n < FINEST:
        n *= 2
        finer = _integral(xp, lobe, wo, n)
        change = float(xp.max(xp.abs(finer - value)))
        value = finer
        if change <= tolerance:
            return value
    warnings.warn(
        f"the albedo of {type(lobe).__name__} still changes by {change:.1e} from {n // 2} to {n} nodes a side.",
        AccuracyWarning,
        stacklevel=3,
    )
    return value


def _integral(xp: Any, lobe: BRDF, wo: Array, n: int) -> Array:
    """The integral over an n x n grid of the unit square, in blocks of rows."""
    x, weight = _gauss(n)
    rows = max(1, BLOCK // (n * max(1, math.prod(wo.shape[:-1]))))
    total = 0.0
    for k in range(0, n, rows):
        u, v = (a.reshape(-1) for a in np.meshgrid(x[k : k + rows], x, indexing="ij"))
        cell = np.outer(weight[k : k + rows], weight).reshape(-1)
        lead = (-1,) + (1,) * (wo.ndim - 1)
        square = like(np.stack((np.full_like(u, 0.5), u, v), axis=-1).reshape(*lead, 3), wo)
        wi = lobe.sample(wo[None], square)
        density = lobe.pdf(wi, wo[None])
        drawn = (density > 0) & (wi[..., 2] > 0)
        share = xp.where(drawn, wi[..., 2], xp.zeros_like(density)) / xp.where(drawn, density, xp.ones_like(density))
        f = lobe.evaluate(xp, wi, wo[None])
        total = total + xp.sum(f * (share * like(cell.reshape(lead), wo))[..., None], axis=0)
    return total


def _gauss(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on [0, 1]."""
    x, weight = np.polynomial.legendre.leggauss(n)
    return 0.5 * (1 + x), 0.5 * weight
