"""What a shape is to a renderer, and what a camera sees of it.

A shape meets rays (`trace`) and stands in the way of light (`occluded`); everything else follows. Surfaces reflect on
the side of their normal only, and block light from either side.

uv has u to the right and v up: texture row 0 lies at v = 1.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod

import numpy as np

from ..arrays import Array
from ..cameras import Camera
from ..frames import frame


@dataclasses.dataclass(frozen=True, eq=False)
class View:
    """What a bundle of rays meets. Leading axes are the rays': (rows, columns) for the pixels of a camera.

    `mask` (...) says where a surface was met; all other fields are NaN elsewhere. World frame, unit directions:
    `position` (..., 3) on the surface; `lifted` (..., 3) where shadow rays may start; `geometric` normal (..., 3) of
    the surface as it stands, `normal` (..., 3) as it is shaded, `tangent` (..., 3) along growing u; `uv` (..., 2), or
    None where the shape has none; `wo` (..., 3) to the eye; `distance` (...) along the ray.
    """

    mask: np.ndarray
    position: np.ndarray
    lifted: np.ndarray
    geometric: np.ndarray
    normal: np.ndarray
    tangent: np.ndarray
    uv: np.ndarray | None
    wo: np.ndarray
    distance: np.ndarray

    @classmethod
    def of(cls, mask: np.ndarray, **met: np.ndarray | None) -> View:
        """A view of which `met` gives the fields at the rays of `mask` only, in order."""
        fields: dict[str, np.ndarray | None] = {}
        for name, values in met.items():
            fields[name] = None
            if values is not None:
                full = np.full((*mask.shape, *values.shape[1:]), np.nan)
                full[mask] = values
                fields[name] = full
        return cls(mask=mask, **fields)  # type: ignore[arg-type]

    @property
    def frames(self) -> np.ndarray:
        """Local frames (..., 3, 3), rows s, t, n about the shading normal; NaN off the surface."""
        frames = np.full((*self.mask.shape, 3, 3), np.nan)
        frames[self.mask] = frame(self.normal[self.mask], self.tangent[self.mask])
        return frames


class Shape(ABC):
    """A surface in the world. Subclasses say what rays meet; `view` follows."""

    @property
    @abstractmethod
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """The corners (3,), (3,) of the least box about the shape: low and high."""

    @abstractmethod
    def trace(self, origins: Array, directions: Array) -> View:
        """What the rays from `origins` (..., 3) along unit `directions` (..., 3) meet first."""

    @abstractmethod
    def occluded(self, origins: Array, directions: Array, distance: Array = np.inf) -> np.ndarray:
        """Whether the shape stands on the rays (..., 3), (..., 3) before `distance` (...): bool (...)."""

    def view(self, camera: Camera) -> View:
        """What `camera` sees at its pixels' centres: fields (rows, columns, ...)."""
        return self.trace(*camera.rays())
