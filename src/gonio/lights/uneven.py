"""A light whose falloff over a flat sample was measured, whatever made it: a lens, a diffuser, the shape of an LED.

    E(x) = E_0(x) exp(a_0 + a_1 x + a_2 y + a_3 x^2 + a_4 x y + a_5 y^2)        E_0 of the light it stands for

x and y are the world's, in the plane of the sample; off that plane it is carried along z.
"""

from __future__ import annotations

import dataclasses

from ..arrays import Array, floats, frozen, like, require_finite
from ..errors import ArrayError, ParameterError
from .model import Beams, Light


@dataclasses.dataclass(frozen=True, eq=False)
class Uneven(Light):
    """`light` times the exponential of a polynomial with `falloff` (C, 6), C = 1 or 3, in the order above."""

    light: Light
    falloff: Array

    def __post_init__(self) -> None:
        if not isinstance(self.light, Light):
            raise ParameterError(f"Uneven: {type(self.light).__name__} is not a light.")
        falloff = frozen(self.falloff)
        if falloff.ndim != 2 or falloff.shape[0] not in (1, 3) or falloff.shape[1] != 6:
            raise ArrayError(f"Uneven: falloff has shape {tuple(falloff.shape)}; (1, 6) or (3, 6) is wanted.")
        require_finite(falloff, "Uneven: falloff")
        object.__setattr__(self, "falloff", falloff)

    @property
    def distant(self) -> bool:
        return False

    def beams(self, positions: Array | None = None, budget: int | None = None) -> Beams:
        """The light's beams at `positions` (..., 3), each with an axis of its own: (..., K, 3), (..., K, C), (..., K).

        Raises `ParameterError` without positions, `ArrayError` for other shapes.
        """
        if positions is None:
            raise ParameterError("Uneven: what falls off needs the positions it shines on.")
        xp, positions = floats(positions)
        if positions.ndim == 0 or positions.shape[-1] != 3:
            raise ArrayError(f"positions has shape {tuple(positions.shape)}; positions are (..., 3).")
        beams = self.light.beams(positions, budget)
        factor = xp.exp(quadratic(xp, positions) @ xp.permute_dims(like(self.falloff, positions), (1, 0)))
        lead = tuple(positions.shape[:-1])
        directions, E = (like(a, positions) for a in (beams.directions, beams.irradiance))
        return Beams(
            xp.broadcast_to(directions, (*lead, *directions.shape[-2:])),
            E * factor[..., None, :],
            xp.broadcast_to(like(beams.distance, positions), (*lead, directions.shape[-2])),
        )


def quadratic(xp: object, positions: Array) -> Array:
    """1, x, y, x^2, x y, y^2 of `positions` (..., 3): (..., 6)."""
    x, y = positions[..., 0], positions[..., 1]
    return xp.stack((xp.ones_like(x), x, y, x * x, x * y, y * y), axis=-1)  # type: ignore[attr-defined]
