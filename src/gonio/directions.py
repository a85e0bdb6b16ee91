"""Directions of the unit sphere and their coordinates.

    w = (sin theta cos phi, sin theta sin phi, cos theta)

theta in [0, pi] from +z, phi in [0, 2 pi) from +x towards +y. `wi` points to the light, `wo` to the eye; both point
away from the surface. In a local frame the normal is (0, 0, 1), so cos_theta(w) = w[..., 2].
Half/difference coordinates: Rusinkiewicz 1998. (u, v, w): RS 7. Local frames stand in `frames.py`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .arrays import Array, floats, is_numpy, like, require_broadcast, to_numpy
from .errors import ArrayError, DirectionError

# Unit vectors stored in float32, or written with four digits, are taken for unit vectors; slips of scale are not.
UNIT_TOLERANCE = 1e-3


def dot(a: Array, b: Array) -> Array:
    """a . b over the last axis: (..., 3), (..., 3) -> (...)."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def cross(a: Array, b: Array) -> Array:
    """a x b over the last axis, with broadcasting: (..., 3), (..., 3) -> (..., 3)."""
    xp, a, b = floats(a, b)
    _require_pair(a=a, b=b)
    x = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    y = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    z = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return xp.stack((x, y, z), axis=-1)


def normalise(v: Array, name: str = "v") -> Array:
    """v / |v|: (..., 3) -> (..., 3). Raises `DirectionError` where a vector has no length."""
    xp, v = floats(v)
    _require_components(v, name)
    # Scaled first, so that squares neither overflow nor vanish.
    scale = xp.max(xp.abs(v), axis=-1, keepdims=True)
    if not bool(xp.all(scale > 0)) or not bool(xp.all(xp.isfinite(scale))):
        at = _first(~(to_numpy(scale)[..., 0] > 0) | ~np.isfinite(to_numpy(scale)[..., 0]))
        raise DirectionError(f"{name}{at} has no direction: its length is zero, infinite or NaN.")
    v = v / scale
    return v / xp.sqrt(dot(v, v))[..., None]


def require_unit(w: Array, name: str) -> None:
    """Raises `DirectionError` naming the first of `w` (..., 3) whose length is not 1 within `UNIT_TOLERANCE`."""
    xp, w = floats(w)
    _require_components(w, name)
    if is_numpy(w) and w.size > 3000 and w.flags.c_contiguous:  # below, NumPy answers sooner than a loop is loaded
        from ._kernels.unit import are_unit

        flat = w.reshape(-1, 3)
        flat.flags.writeable = False  # of the view only: one loop for all input
        if are_unit(flat, 2 * UNIT_TOLERANCE):
            return
    off = xp.abs(dot(w, w) - 1)
    if not bool(xp.all(off <= 2 * UNIT_TOLERANCE)):  # so written that NaN fails too
        at = _first(~(to_numpy(off) <= 2 * UNIT_TOLERANCE))
        length = float(np.linalg.norm(to_numpy(w)[at.index]))
        raise DirectionError(
            f"{name}{at} has length {length:.6g}. Pass normalise({name}) if only the direction matters."
        )


def cos_theta(w: Array) -> Array:
    """cos theta of local directions (..., 3) -> (...)."""
    return w[..., 2]


def spherical(w: Array) -> tuple[Array, Array]:
    """(theta, phi) of unit directions (..., 3); theta in [0, pi], phi in [0, 2 pi), phi = 0 at the poles."""
    xp, w = floats(w)
    _require_components(w, "w")
    # atan2 keeps its digits near the poles, where acos loses half of them.
    theta = xp.atan2(xp.hypot(w[..., 0], w[..., 1]), w[..., 2])
    return theta, _turn(xp, xp.atan2(w[..., 1], w[..., 0]), 2 * math.pi)


def from_spherical(theta: Array, phi: Array) -> Array:
    """Unit directions (..., 3) at `theta` from +z and `phi` from +x towards +y, both in radians, broadcast."""
    xp, theta, phi = floats(theta, phi)
    require_broadcast(theta=theta, phi=phi)
    s = xp.sin(theta)
    return xp.stack(xp.broadcast_arrays(s * xp.cos(phi), s * xp.sin(phi), xp.cos(theta)), axis=-1)


def reflect(w: Array, n: Array | None = None) -> Array:
    """The mirror direction 2 (n.w) n - w of `w` (..., 3) about the normal `n` ((0, 0, 1) where none is given)."""
    if n is None:
        xp, w = floats(w)
        _require_components(w, "w")
        return xp.stack((-w[..., 0], -w[..., 1], w[..., 2]), axis=-1)
    xp, w, n = floats(w, n)
    _require_pair(w=w, n=n)
    return 2 * dot(n, w)[..., None] * n - w


def lambert_map(w: Array) -> Array:
    """Places (..., 2) in the unit disc of directions (..., 3) above the surface, equal areas for equal solid angles:
    sqrt2 sin(theta / 2) (cos phi, sin phi) = (x, y) / sqrt(1 + z)."""
    xp, w = floats(w)
    return w[..., :2] / xp.sqrt(1 + w[..., 2:])


def half_vector(wi: Array, wo: Array) -> Array:
    """h = (wi + wo) / |wi + wo|, (..., 3). Opposite directions have none; they are answered with the local normal."""
    xp, wi, wo = floats(wi, wo)
    _require_pair(wi=wi, wo=wo)
    h = wi + wo
    length = xp.sqrt(dot(h, h))[..., None]
    normal = like([0.0, 0.0, 1.0], h)
    return xp.where(length > 0, h / xp.where(length > 0, length, xp.ones_like(length)), normal)


def half_difference(wi: Array, wo: Array) -> tuple[Array, Array, Array, Array]:
    """(theta_h, phi_h, theta_d, phi_d) of local directions (Rusinkiewicz 1998), angles in radians.

    The difference vector is wi seen from a frame whose pole is h: d = R_y(-theta_h) R_z(-phi_h) wi.
    theta_h, theta_d in [0, pi/2] for directions above the surface; phi_h, phi_d in [0, 2 pi). Swapping wi and wo
    adds pi to phi_d. At theta_d = 0 (light behind the eye) phi_d has no meaning and is 0.
    """
    xp, wi, wo = floats(wi, wo)
    h = half_vector(wi, wo)
    theta_h, phi_h = spherical(h)
    c, s = xp.cos(phi_h), xp.sin(phi_h)
    x = c * wi[..., 0] + s * wi[..., 1]
    y = c * wi[..., 1] - s * wi[..., 0]
    c, s = xp.cos(theta_h), xp.sin(theta_h)
    d = xp.stack((c * x - s * wi[..., 2], y + 0 * c, s * x + c * wi[..., 2]), axis=-1)
    theta_d, phi_d = spherical(d)
    return theta_h, phi_h, theta_d, phi_d


def from_half_difference(theta_h: Array, phi_h: Array, theta_d: Array, phi_d: Array) -> tuple[Array, Array]:
    """(wi, wo), each (..., 3), with the given half/difference coordinates in radians: the inverse of `half_difference`.

    Not every quadruple lies above the surface: check `cos_theta` of both before measuring a BRDF there.
    """
    xp, theta_h, phi_h, theta_d, phi_d = floats(theta_h, phi_h, theta_d, phi_d)
    d = from_spherical(theta_d, phi_d)
    ch, sh, cp, sp = xp.cos(theta_h), xp.sin(theta_h), xp.cos(phi_h), xp.sin(phi_h)

    def turned(v: Array) -> Array:
        x = ch * v[..., 0] + sh * v[..., 2]
        y = v[..., 1]
        return xp.stack((cp * x - sp * y, sp * x + cp * y, ch * v[..., 2] - sh * v[..., 0]), axis=-1)

    mirrored = xp.stack((-d[..., 0], -d[..., 1], d[..., 2]), axis=-1)
    return turned(d), turned(mirrored)


def uvw(wi: Array, wo: Array) -> Array:
    """(u, v, w) of RS 7, (..., 3): (sin theta_h cos 2 phi_d, sin theta_h sin 2 phi_d, 2 theta_d / pi).

    The coordinates in which RS interpolates isotropic BRDFs: reciprocal by construction, smooth at theta_h = 0.
    At theta_d = 0 phi_d has no meaning; u and v then take phi_d = 0.
    """
    theta_h, _, theta_d, phi_d = half_difference(wi, wo)
    xp, theta_h = floats(theta_h)
    s = xp.sin(theta_h)
    return xp.stack((s * xp.cos(2 * phi_d), s * xp.sin(2 * phi_d), theta_d * (2 / math.pi)), axis=-1)


def from_uvw(q: Array) -> tuple[Array, Array]:
    """(wi, wo) with the coordinates `q` (..., 3) of RS 7, in the half plane phi_h = 0. Inverse of `uvw` up to phi_h.

    Raises `ArrayError` outside u^2 + v^2 <= 1, 0 <= w <= 1.
    """
    xp, q = floats(q)
    _require_components(q, "q")
    r = xp.hypot(q[..., 0], q[..., 1])
    if not bool(xp.all((r <= 1 + 1e-6) & (q[..., 2] >= 0) & (q[..., 2] <= 1 + 1e-6))):
        raise ArrayError("(u, v, w) lies outside the domain of RS 7: u^2 + v^2 <= 1 and 0 <= w <= 1.")
    theta_h = xp.asin(xp.minimum(r, xp.ones_like(r)))
    phi_d = 0.5 * _turn(xp, xp.atan2(q[..., 1], q[..., 0]), 2 * math.pi)
    return from_half_difference(theta_h, xp.zeros_like(r), q[..., 2] * (math.pi / 2), phi_d)


def _turn(xp: Any, angle: Array, period: float) -> Array:
    """`angle` in (-period, period) brought to [0, period)."""
    angle = xp.where(angle < 0, angle + period, angle)
    # A tiny negative angle plus the period rounds to the period itself, which is 0 again.
    return xp.where(angle >= period, xp.zeros_like(angle), angle)


def _require_components(w: Array, name: str) -> None:
    if w.ndim == 0 or w.shape[-1] != 3:
        raise ArrayError(f"{name} has shape {tuple(w.shape)}; directions are (..., 3), components last.")


def _require_pair(**vectors: Array) -> None:
    for name, w in vectors.items():
        _require_components(w, name)
    require_broadcast(**vectors)


class _Index:
    def __init__(self, index: tuple[int, ...]) -> None:
        self.index = index

    def __str__(self) -> str:
        return f"[{', '.join(map(str, self.index))}]" if self.index else ""


def _first(bad: np.ndarray) -> _Index:
    return _Index(tuple(int(k) for k in np.argwhere(bad)[0]))
