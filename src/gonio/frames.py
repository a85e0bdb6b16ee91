"""Local frames of a surface, and the Euler rotations of RH 2.10.

    frame(n)[..., 0, :] = s,  [..., 1, :] = t,  [..., 2, :] = n        (right-handed: s x t = n)
    w_local = frame @ w_world,    w_world = frame^T @ w_local

Without a tangent the frame is the one of Duff et al. 2017 ("Building an Orthonormal Basis, Revisited"), which has no
singular direction; its s and t carry no meaning, so anisotropic models want a tangent.
"""

from __future__ import annotations

from .arrays import Array, floats, like, require_broadcast
from .directions import cross, dot, normalise, require_unit
from .errors import DirectionError


def frame(n: Array, tangent: Array | None = None) -> Array:
    """Rotation matrices (..., 3, 3) with rows s, t, n, from unit normals (..., 3) and, where given, tangents (..., 3).

    s is the part of the tangent that is perpendicular to n. Raises `DirectionError` where n is not a unit vector or
    a tangent is parallel to n.
    """
    require_unit(n, "n")
    if tangent is None:
        xp, n = floats(n)
        x, y, z = n[..., 0], n[..., 1], n[..., 2]
        sign = xp.where(z >= 0, xp.ones_like(z), -xp.ones_like(z))
        a = -1 / (sign + z)
        b = x * y * a
        s = xp.stack((1 + sign * x * x * a, sign * b, -sign * x), axis=-1)
        t = xp.stack((b, sign + y * y * a, -y), axis=-1)
        return xp.stack((s, t, n), axis=-2)
    xp, n, tangent = floats(n, tangent)
    require_broadcast(n=n, tangent=tangent)
    n, tangent = xp.broadcast_arrays(n, tangent)
    s = tangent - dot(n, tangent)[..., None] * n
    if not bool(xp.all(dot(s, s) > 1e-12 * dot(tangent, tangent))):
        raise DirectionError("a tangent is parallel to its normal (or zero); give one that leans away from it.")
    s = normalise(s)
    return xp.stack((s, cross(n, s), n), axis=-2)


def to_local(frames: Array, w: Array) -> Array:
    """Components (..., 3) of world directions `w` in `frames` (..., 3, 3)."""
    xp, frames, w = floats(frames, w)
    return xp.stack(tuple(dot(frames[..., k, :], w) for k in range(3)), axis=-1)


def to_world(frames: Array, w: Array) -> Array:
    """World directions (..., 3) of local directions `w` in `frames` (..., 3, 3)."""
    _, frames, w = floats(frames, w)
    return sum(w[..., k, None] * frames[..., k, :] for k in range(3))


def rotation_z(angle: Array) -> Array:
    """R_z: turns by `angle` (radians) about +z, x towards y: (...) -> (..., 3, 3)."""
    xp, angle = floats(angle)
    c, s, o, i = xp.cos(angle), xp.sin(angle), xp.zeros_like(angle), xp.ones_like(angle)
    return _rows(xp, ((c, -s, o), (s, c, o), (o, o, i)))


def rotation_y(angle: Array) -> Array:
    """R_y: turns by `angle` (radians) about +y, z towards x: (...) -> (..., 3, 3)."""
    xp, angle = floats(angle)
    c, s, o, i = xp.cos(angle), xp.sin(angle), xp.zeros_like(angle), xp.ones_like(angle)
    return _rows(xp, ((c, o, s), (o, i, o), (-s, o, c)))


def euler(alpha: Array, beta: Array, gamma: Array) -> Array:
    """R_z(beta) R_y(alpha) R_z(gamma) (..., 3, 3), angles in radians: local directions to global ones (RH 2.10).

    The normal (0, 0, 1) goes to spherical coordinates (alpha, beta); gamma turns the surface about it.
    """
    _, alpha, beta, gamma = floats(alpha, beta, gamma)
    return rotation_z(beta) @ rotation_y(alpha) @ rotation_z(gamma)


def euler_angles(rotation: Array) -> tuple[Array, Array, Array]:
    """(alpha, beta, gamma) of RH 2.10 for rotation matrices (..., 3, 3); beta = 0 where alpha is 0 or pi.

    Raises `DirectionError` where a matrix is not a rotation.
    """
    xp, R = floats(rotation)
    require_rotation(R, "rotation")
    sin_alpha = xp.hypot(R[..., 0, 2], R[..., 1, 2])
    alpha = xp.atan2(sin_alpha, R[..., 2, 2])
    regular = sin_alpha > 1e-7
    beta = xp.where(regular, xp.atan2(R[..., 1, 2], R[..., 0, 2]), xp.zeros_like(alpha))
    # With beta = 0 and sin alpha = 0 the matrix is [[c cos, -c sin, 0], [sin, cos, 0], ...], c = cos alpha.
    gamma = xp.where(regular, xp.atan2(R[..., 2, 1], -R[..., 2, 0]), xp.atan2(R[..., 1, 0], R[..., 1, 1]))
    return alpha, beta, gamma


def require_rotation(rotation: Array, name: str) -> None:
    """Raises `DirectionError` where (..., 3, 3) is not orthonormal to 1e-4 or mirrors (determinant -1)."""
    xp, R = floats(rotation)
    if R.ndim < 2 or tuple(R.shape[-2:]) != (3, 3):
        raise DirectionError(f"{name} has shape {tuple(R.shape)}; a rotation is (..., 3, 3).")
    identity = like([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]], R)
    off = xp.abs(R @ xp.matrix_transpose(R) - identity)
    if not bool(xp.all(off < 1e-4)):
        raise DirectionError(f"{name} is not orthonormal: R R^T differs from the identity.")
    if not bool(xp.all(dot(cross(R[..., 0, :], R[..., 1, :]), R[..., 2, :]) > 0)):
        raise DirectionError(f"{name} mirrors (determinant -1); a rotation has determinant +1.")


def _rows(xp: Array, rows: tuple[tuple[Array, ...], ...]) -> Array:
    return xp.stack(tuple(xp.stack(row, axis=-1) for row in rows), axis=-2)
