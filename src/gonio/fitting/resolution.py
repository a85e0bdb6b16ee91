"""How fine in space and in angle a few photographs tell reflectance: the trade of RS 3, in flatland.

    flat       Omega_x < pi / dx,                 Omega_theta < 2 pi / dtheta             RS 1
    curved     Omega_alpha < pi / (2 dalpha),     Omega_theta < 2 pi / dtheta             RS 4, texture, no sharing
               Omega_alpha < 2 pi / dtheta,       Omega_theta < pi / (2 dalpha)           RS 5, sharing
               their product < pi^2 / (dalpha dtheta), whichever of the two               RS 6

dtheta is the angle between one light and the next, radians; a photograph samples the surface every dx, or where it is
curved every dalpha radians of its normal, k dx with curvature k. Photographs of a flat surface are lines of constant
half angle, and texture and highlights are each told by their own sampling alone; on a curved one the lines are slanted,
and pixels serve for angles. Bands are boxes |Omega_alpha| < A, |Omega_theta| < B, in radians per unit.
"""

from __future__ import annotations

import dataclasses
import math

from ..errors import ParameterError


@dataclasses.dataclass(frozen=True)
class Band:
    """The highest frequencies that samples tell: `space`, radians per unit of x or alpha; `angle`, per radian of half
    angle. A lobe exp(-theta_h^2 / (2 s^2)) is within 1 % of its spectrum below 2.6 / s."""

    space: float
    angle: float


def flat_band(pixel: float, lights: float) -> Band:
    """RS 1: what photographs of a flat surface tell, `pixel` apart, under lights `lights` radians apart."""
    _require(pixel=pixel, lights=lights)
    return Band(math.pi / pixel, 2 * math.pi / lights)


def textured_band(pixel: float, lights: float) -> Band:
    """RS 4: of a curved surface, each pixel by itself; `pixel` in radians of the normal."""
    _require(pixel=pixel, lights=lights)
    return Band(math.pi / (2 * pixel), 2 * math.pi / lights)


def shared_band(pixel: float, lights: float) -> Band:
    """RS 5: of a curved surface whose pixels share reflectance; one photograph (`lights` infinite) tells no change in
    space at all."""
    _require(pixel=pixel, lights=lights)
    return Band(2 * math.pi / lights, math.pi / (2 * pixel))


def _require(**values: float) -> None:
    for name, value in values.items():
        if not value > 0:
            raise ParameterError(f"{name} = {value:g} is not a positive distance.")
