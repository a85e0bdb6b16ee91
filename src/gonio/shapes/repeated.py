"""A shape whose texture is tiled.

uv' = times uv mod 1
"""

from __future__ import annotations

import dataclasses

import numpy as np

from ..arrays import Array
from ..errors import ParameterError
from .view import Shape, View


@dataclasses.dataclass(frozen=True, eq=False)
class Repeated(Shape):
    """`shape` with its texture `times` >= 1 along u and along v. A shape without uv stays without."""

    shape: Shape
    times: int

    def __post_init__(self) -> None:
        if not isinstance(self.times, int | np.integer) or self.times < 1:
            raise ParameterError(f"Repeated: times = {self.times}; a texture is repeated a whole number >= 1 of times.")

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return self.shape.bounds

    def trace(self, origins: Array, directions: Array) -> View:
        view = self.shape.trace(origins, directions)
        return view if view.uv is None else dataclasses.replace(view, uv=self.times * view.uv % 1.0)

    def occluded(self, origins: Array, directions: Array, distance: Array = np.inf) -> np.ndarray:
        return self.shape.occluded(origins, directions, distance)
