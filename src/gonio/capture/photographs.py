"""Photographs of one scene from one place, one for each light: read one at a time, since together they fill memory.

    photographs.read(k)    radiance (rows, columns, 3), linear float32, and which pixels are clipped

Files are behind it (`files/photographs.py`), or arrays (`Held`). Radiance is relative: what a sensor counts.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from ..arrays import frozen, require_finite, to_numpy
from ..errors import ArrayError


class Photograph(NamedTuple):
    """radiance (rows, columns, 3) float32, linear; clipped (rows, columns) bool: at the brightest code there is."""

    radiance: np.ndarray
    clipped: np.ndarray


class Photographs(ABC):
    """`names` (N,), and their common size, (rows, columns)."""

    names: tuple[str, ...]
    size: tuple[int, int]

    @abstractmethod
    def read(self, k: int) -> Photograph:
        """Photograph k, whole."""

    def pixels(self, at: np.ndarray) -> Photograph:
        """All photographs at pixels `at` (P,), counted along rows: radiance (N, P, 3) and clipped (N, P)."""
        every = (self.read(k) for k in range(len(self)))
        some = [(radiance.reshape(-1, 3)[at], clipped.reshape(-1)[at]) for radiance, clipped in every]
        return Photograph(*(np.stack(parts) for parts in zip(*some, strict=True)))

    def __len__(self) -> int:
        return len(self.names)


@dataclasses.dataclass(frozen=True, eq=False)
class Held(Photographs):
    """Photographs in memory: `radiance` (N, rows, columns, 3), finite; those at `white` or above count as clipped."""

    radiance: np.ndarray
    white: float = np.inf

    def __post_init__(self) -> None:
        radiance = frozen(to_numpy(self.radiance), np.dtype(np.float32))
        if radiance.ndim != 4 or radiance.shape[3] != 3 or 0 in radiance.shape:
            raise ArrayError(f"radiance has shape {radiance.shape}; (photographs, rows, columns, 3) is wanted.")
        require_finite(radiance, "radiance")
        object.__setattr__(self, "radiance", radiance)
        object.__setattr__(self, "names", tuple(str(k) for k in range(len(radiance))))
        object.__setattr__(self, "size", radiance.shape[1:3])

    def read(self, k: int) -> Photograph:
        red, green, blue = np.moveaxis(self.radiance[k], -1, 0)
        return Photograph(self.radiance[k], (red >= self.white) | (green >= self.white) | (blue >= self.white))
