"""Where near lamps stand, from the directions in which several balls show them.

    p_k = argmin over p of the sum over balls of |(I - L L^T) (p - o)|^2       o on the ball, L towards lamp k

The point nearest to all rays, by least squares in closed form. The directions are `mirror_ball`'s, in its frame.

Not here: how bright they are (`white`), and lamps too wide for one place: each ball shows its own middle of them.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ..arrays import Array, require_finite, to_numpy
from ..directions import dot, normalise, require_unit
from ..errors import ArrayError

# Rays whose rms angle from their mean is less (degrees) meet nowhere that highlights could tell: they are good to 0.2.
_PARALLEL = 0.5


@dataclasses.dataclass(frozen=True, eq=False)
class LightPositions:
    """Where N lamps stand, in the frame and unit of the balls.

    positions: (N, 3), infinite where the lamp is distant.
    residual: (N,), rms distance of the balls' rays from the position; NaN where the lamp is distant.
    distant: (N,) bool, True where the balls' rays are parallel within what highlights can tell.
    """

    positions: np.ndarray
    residual: np.ndarray
    distant: np.ndarray


def light_positions(origins: Array, directions: Array) -> LightPositions:
    """Where N lamps stand that B balls show in `directions` (B, N, 3), unit: nearest to all rays, by least squares.

    origins: (B, 3), the balls' centres, or (B, N, 3), where on them the highlights lie (`highlight_points`). Centres
        leave the position off by up to a ball's radius. Any unit, in the frame of the directions.

    A lamp is distant where the rays, rms, are less than half a degree from their mean direction. Raises `ArrayError`
    for other shapes, fewer than two balls, or a lamp whose rays run apart; `DirectionError` where one is not unit.
    """
    o, d = (to_numpy(a).astype(np.float64) for a in (origins, directions))
    if d.ndim != 3 or d.shape[2] != 3 or d.shape[0] < 2:
        raise ArrayError(f"directions has shape {d.shape}; expected (balls, lights, 3), two balls or more.")
    if o.shape not in ((d.shape[0], 3), d.shape):
        raise ArrayError(f"origins has shape {o.shape}; expected {(d.shape[0], 3)} or {d.shape}, as directions has.")
    require_finite(o, "origins")
    require_unit(d, "directions")
    d = normalise(d)
    o = np.broadcast_to(o[:, None] if o.ndim == 2 else o, d.shape)
    across = np.eye(3) - d[..., :, None] * d[..., None, :]
    # The least eigenvalue is the sum of the squared sines of the rays' angles from the direction nearest to all.
    total = across.sum(axis=0)
    distant = np.sqrt(np.linalg.eigvalsh(total)[:, 0].clip(0) / len(d)) < math.sin(math.radians(_PARALLEL))
    safe = np.where(distant[:, None, None], np.eye(3), total)
    moment = np.einsum("bnij,bnj->ni", across, o)
    p = np.linalg.solve(safe, moment[..., None])[..., 0]
    ahead = dot(p - o, d)
    apart = ~distant & (ahead <= 0).any(axis=0)
    if apart.any():
        light = int(np.argmax(apart))
        raise ArrayError(
            f"the rays to light {light} run apart: they come nearest behind ball {int(np.argmin(ahead[:, light]))}. "
            "Is one of the highlights another lamp's, or are the balls in another order than their origins?"
        )
    miss = np.einsum("bnij,bnj->bni", across, p - o)
    residual = np.sqrt(dot(miss, miss).mean(axis=0))
    return LightPositions(
        positions=np.where(distant[:, None], np.inf, p), residual=np.where(distant, np.nan, residual), distant=distant
    )
