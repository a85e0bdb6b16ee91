"""What every light is: something that reaches a surface as beams.

    B(x, wo) = sum_k f(wi_k, wo) E_k max(n.wi_k, 0) V_k

A beam is a direction towards the light and the irradiance it gives to a plane that faces it. A directional light is
one beam; an environment map is one for each texel (E = radiance x solid angle), or as many as a budget allows.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod

from ..arrays import Array


@dataclasses.dataclass(frozen=True, eq=False)
class Beams:
    """`directions` (..., K, 3), unit, world frame, towards the light; `irradiance` (..., K, C) on a facing plane;
    `distance` (..., K) to the light, infinite where it is distant: shadow rays end there.

    Distant lights have no leading axes: the same K beams reach every point.
    """

    directions: Array
    irradiance: Array
    distance: Array


class Light(ABC):
    """Light that reaches a surface from outside; lights add (`sun + sky`)."""

    @property
    @abstractmethod
    def distant(self) -> bool:
        """Whether all points receive the same beams."""

    @abstractmethod
    def beams(self, positions: Array | None = None, budget: int | None = None) -> Beams:
        """The beams at `positions` (..., 3) in the world frame (not needed, and ignored, where the light is distant).

        `budget` is the most beams that the caller will pay for; lights that are exact with fewer ignore it.
        """

    @property
    def parts(self) -> tuple[Light, ...]:
        """The lights of which it is the sum: itself, if it is one."""
        return (self,)

    def __add__(self, other: Light) -> Light:
        from .points import Lights

        return Lights((self, other))
