"""A square cloth that lies over a ball and hangs in folds.

    p(rho, phi) = (r cos phi, r sin phi, z(rho)),   r = r_0(rho) (1 + a(rho) w(phi)),   (x, y) = rho (cos phi, sin phi)
    (r_0, z) the profile of a ball to 80 degrees, straight on from there, rho its arc length
    a = s(rho) sqrt(2 ((rho / r_0)^2 - 1)) / 8      so that the folds take up what the ring is too long, nearly

z falls with rho and r > 0 is one of each (rho, phi): the cloth never meets itself. |w| <= 1 has eight folds around,
uneven; s rises smoothly from the ball's upper side on.
"""

from __future__ import annotations

import math

import numpy as np

from ..errors import ParameterError
from .mesh import Mesh

_BALL = 0.5  # radius
_LEAVES = math.radians(80)  # the polar angle at which the cloth leaves the ball
_FOLDS = 8
_SMOOTH = 0.3, 0.9  # rho at which folds begin, and are whole


def cloth(steps: int = 200) -> Mesh:
    """The cloth of the examples: (x, y) in [-1, 1]^2 on the table, uv = ((x, y) + 1) / 2, `steps` >= 4 quads along each
    side; z from -.62 to .5 as it hangs. Outside is up. Raises `ParameterError` for fewer steps."""
    if steps < 4:
        raise ParameterError(f"steps = {steps}; a cloth of four or more along each side can fold.")
    line = np.linspace(-1, 1, steps + 1)
    x, y = np.meshgrid(line, line)
    rho, phi = np.hypot(x, y), np.arctan2(y, x)
    bent = np.minimum(rho, _BALL * _LEAVES) / _BALL
    hanging = np.maximum(rho - _BALL * _LEAVES, 0)
    r = _BALL * np.sin(bent) + hanging * math.cos(_LEAVES)
    z = _BALL * np.cos(bent) - hanging * math.sin(_LEAVES)
    r *= 1 + _depth(rho, r) * _wave(phi)
    vertices = np.stack((r * np.cos(phi), r * np.sin(phi), z), axis=-1).reshape(-1, 3)
    row, column = np.divmod(np.arange(steps**2), steps)
    a = row * (steps + 1) + column
    b, c, d = a + 1, a + steps + 2, a + steps + 1
    faces = np.concatenate((np.stack((a, b, c), axis=-1), np.stack((a, c, d), axis=-1)))
    return Mesh(vertices, faces, uv=np.stack((x.ravel() + 1, y.ravel() + 1), axis=-1) / 2)


def _depth(rho: np.ndarray, r: np.ndarray) -> np.ndarray:
    """a of the folds, below 1."""
    excess = (rho / np.where(r > 0, r, 1)) ** 2 - 1
    t = np.clip((rho - _SMOOTH[0]) / (_SMOOTH[1] - _SMOOTH[0]), 0, 1)
    return np.asarray(t * t * (3 - 2 * t) * np.sqrt(2 * np.maximum(excess, 0)) / _FOLDS)


def _wave(phi: np.ndarray) -> np.ndarray:
    """w."""
    return np.asarray(np.cos(_FOLDS * phi + 0.7 * np.sin(3 * phi) + 0.5) + 0.35 * np.cos(5 * phi + 1)) / 1.35
