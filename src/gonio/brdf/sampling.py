"""Maps from the unit square to directions: what every sampler of a BRDF is made of.

    cosine:   p(w) = cos theta / pi                          z^2 = 1 - u_0,  phi = 2 pi u_1
    lobe:     p(w) = (s + 1) / (2 pi) (a.w)^s, a.w > 0       (a.w)^(s+1) = 1 - u_0
    mirror:   wi = 2 (wo.h) h - wo                           p(wi) = p(h) / (4 abs(wo.h))

All are differentiable in u and in their parameters.
"""

from __future__ import annotations

import math

from ..arrays import Array, floats
from ..directions import dot, half_vector
from ..frames import frame, to_world


def cosine_direction(u: Array) -> Array:
    """Directions (..., 3) above the surface with density cos theta / pi, from uniform numbers `u` (..., 2)."""
    xp, u = floats(u)
    return _polar(xp, xp.sqrt(1 - u[..., 0]), xp.sqrt(u[..., 0]), u[..., 1])


def lobe_direction(axis: Array, exponent: Array, u: Array) -> Array:
    """Directions (..., 3) about unit `axis` (..., 3) with density (s + 1) / (2 pi) (axis.w)^s, s = `exponent` (...)."""
    xp, axis, exponent, u = floats(axis, exponent, u)
    cosine = (1 - u[..., 0]) ** (1 / (exponent + 1))
    sine = xp.sqrt(xp.clip(1 - cosine * cosine, 0.0, None))
    phi = u[..., 1] + xp.zeros_like(cosine)
    return to_world(frame(axis), _polar(xp, cosine, sine, phi))


def lobe_density(axis: Array, exponent: Array, w: Array) -> Array:
    """The density (...) in 1/sr of `lobe_direction` at unit directions `w` (..., 3)."""
    xp, axis, exponent, w = floats(axis, exponent, w)
    return (exponent + 1) / (2 * math.pi) * power(xp, dot(axis, w), exponent)


def mirrored(wo: Array, h: Array) -> Array:
    """`wo` mirrored at facets whose normal is `h`: wi (..., 3)."""
    _, wo, h = floats(wo, h)
    return 2 * dot(wo, h)[..., None] * h - wo


def facet_between(wi: Array, wo: Array) -> Array:
    """The normal (..., 3) of the facet that mirrors wo to wi, on its upper side: the half vector or its opposite."""
    xp, wi, wo = floats(wi, wo)
    h = half_vector(wi, wo)
    return xp.where((h[..., 2] < 0)[..., None], -h, h)


def power(xp: Array, base: Array, exponent: Array) -> Array:
    """max(base, 0)^exponent with 0^0 = 0: a lobe ends where its cosine does. Gradients are finite at zero."""
    lit = base > 0
    return xp.where(lit, xp.where(lit, base, xp.ones_like(base)) ** exponent, xp.zeros_like(base * exponent))


def _polar(xp: Array, z: Array, r: Array, turn: Array) -> Array:
    phi = 2 * math.pi * turn
    return xp.stack((r * xp.cos(phi), r * xp.sin(phi), z), axis=-1)
