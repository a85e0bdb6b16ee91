"""Lights without extent, and sums of lights.

Directional   E on a facing plane, the same everywhere
Point         E = I / d^2 on a facing plane at distance d; where it has an axis, I = I_0 max(-axis.w, 0)^exponent with w
              the direction to it: exponent 1 is the cosine law of a flat lamp, LEDs with lenses have up to 50
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ..arrays import Array, floats, frozen, like, namespace, require_finite
from ..directions import dot, require_unit
from ..errors import ArrayError, ParameterError
from .model import Beams, Light


@dataclasses.dataclass(frozen=True, eq=False)
class Directional(Light):
    """`direction` (3,), unit, towards the light, world frame; `irradiance` on a plane that faces it, number or (C,)."""

    direction: Array
    irradiance: Array = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "direction", _vector(self.direction, "Directional: direction"))
        require_unit(self.direction, "Directional: direction")
        object.__setattr__(self, "irradiance", _strength(self.irradiance, "Directional: irradiance"))

    @property
    def distant(self) -> bool:
        return True

    def beams(self, positions: Array | None = None, budget: int | None = None) -> Beams:
        """One beam: directions (1, 3), irradiance (1, C), distance (1,). `positions` and `budget` change nothing."""
        xp, direction, irradiance = floats(self.direction, self.irradiance)
        return Beams(direction[None, :], irradiance[None, :], xp.full_like(direction[:1], np.inf))


@dataclasses.dataclass(frozen=True, eq=False)
class Point(Light):
    """`position` (3,) in the world frame; `intensity` (W/sr, or relative), a number or (C,): in every direction, or
    along `axis` (3,), unit, from which it falls off as the cosine to the power `exponent` >= 0."""

    position: Array
    intensity: Array = 1.0
    axis: Array | None = None
    exponent: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", _vector(self.position, "Point: position"))
        object.__setattr__(self, "intensity", _strength(self.intensity, "Point: intensity"))
        if self.axis is not None:
            object.__setattr__(self, "axis", _vector(self.axis, "Point: axis"))
            require_unit(self.axis, "Point: axis")
        if not 0 <= self.exponent < math.inf:
            raise ParameterError(f"Point: exponent = {self.exponent:g} is not a number >= 0.")

    @property
    def distant(self) -> bool:
        return False

    def beams(self, positions: Array | None = None, budget: int | None = None) -> Beams:
        """One beam at each of `positions` (..., 3): directions (..., 1, 3), irradiance (..., 1, C), distance (..., 1).

        Raises `ParameterError` without positions or where one lies in the light, `ArrayError` for other shapes.
        """
        if positions is None:
            raise ParameterError("Point: a near light needs the positions it shines on.")
        xp, positions = floats(positions)
        if positions.ndim == 0 or positions.shape[-1] != 3:
            raise ArrayError(f"positions has shape {tuple(positions.shape)}; positions are (..., 3).")
        way = like(self.position, positions) - positions
        distance = xp.sqrt(dot(way, way))
        if not bool(xp.all(distance > 0)):
            raise ParameterError("Point: a position lies in the light, where its irradiance is infinite.")
        direction = way / distance[..., None]
        irradiance = like(self.intensity, positions) / (distance * distance)[..., None]
        if self.axis is not None:
            cosine = -dot(direction, like(self.axis, positions))
            irradiance = irradiance * (xp.clip(cosine, 0.0, None) ** self.exponent)[..., None]
        return Beams(direction[..., None, :], irradiance[..., None, :], distance[..., None])


@dataclasses.dataclass(frozen=True, eq=False)
class Lights(Light):
    """A sum of lights; sums within it are taken apart."""

    lights: tuple[Light, ...]

    def __post_init__(self) -> None:
        parts: list[Light] = []
        for light in self.lights:
            if not isinstance(light, Light):
                raise ParameterError(f"Lights: {type(light).__name__} is not a light.")
            parts.extend(light.parts)
        if not parts:
            raise ParameterError("Lights: no light was given.")
        object.__setattr__(self, "lights", tuple(parts))

    @property
    def parts(self) -> tuple[Light, ...]:
        return self.lights

    @property
    def distant(self) -> bool:
        return all(light.distant for light in self.lights)

    def beams(self, positions: Array | None = None, budget: int | None = None) -> Beams:
        """The beams of all lights, one after the other; gray ones take the colour count of the others.

        Directional and point lights take one beam each, and the others share what is left of `budget` evenly.
        """
        simple = sum(isinstance(light, Directional | Point) for light in self.lights)
        if budget is not None and len(self.lights) > simple:
            budget = max((budget - simple) // (len(self.lights) - simple), 1)
        parts = [light.beams(positions, budget) for light in self.lights]
        xp, *flat = floats(*(a for p in parts for a in (p.directions, p.irradiance, p.distance)))
        directions, irradiance, distance = flat[0::3], flat[1::3], flat[2::3]
        lead: tuple[int, ...] = () if positions is None or self.distant else tuple(np.shape(positions)[:-1])
        colours = max(e.shape[-1] for e in irradiance)

        def joined(arrays: list[Array], tail: tuple[int, ...]) -> Array:
            count = len(tail)
            wide = [xp.broadcast_to(a, (*lead, a.shape[-1 - count], *tail)) for a in arrays]
            return xp.concat(wide, axis=-1 - count)

        return Beams(joined(directions, (3,)), joined(irradiance, (colours,)), joined(distance, ()))


def _vector(x: Array, name: str) -> Array:
    x = frozen(x)
    if tuple(x.shape) != (3,):
        raise ArrayError(f"{name} has shape {tuple(x.shape)}; it is (3,).")
    require_finite(x, name)
    return x


def _strength(x: Array, name: str) -> Array:
    """A number or (C,) as (C,), C = 1 or 3, finite and not negative."""
    x = frozen(x)
    x = x[None] if x.ndim == 0 else x
    if x.ndim != 1 or x.shape[0] not in (1, 3):
        raise ArrayError(f"{name} has shape {tuple(x.shape)}; it is a number, (1,) or (3,).")
    require_finite(x, name)
    if not bool(namespace(x).all(x >= 0)):
        raise ParameterError(f"{name} is negative; light is only added.")
    return x
