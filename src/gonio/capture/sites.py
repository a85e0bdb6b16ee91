"""Surface points that photographs see, and what each photograph tells of them: what samples are made of.

A capture, from one place or from many, is something that has sites and observes them. Directions and places are the
world's here.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple, Protocol

import numpy as np

from ..lights.model import Light
from ..shapes.view import Shape
from .photographs import Photographs


@dataclasses.dataclass(frozen=True, eq=False)
class Sites:
    """S surface points: `positions` (S, 3); `lifted` (S, 3), where shadow rays start; `frames` (S, 3, 3), rows s, t,
    n."""

    positions: np.ndarray
    lifted: np.ndarray
    frames: np.ndarray

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, some: np.ndarray) -> Sites:
        return Sites(self.positions[some], self.lifted[some], self.frames[some])


class Observation(NamedTuple):
    """What photographs tell of S sites: `radiance` (..., S, 3); `known` (..., S) bool, seen and not clipped; `wo`
    (S, 3) or (..., S, 3), unit, to the eye."""

    radiance: np.ndarray
    known: np.ndarray
    wo: np.ndarray


class Observing(Protocol):
    """Photographs of a known shape."""

    @property
    def photographs(self) -> Photographs: ...

    @property
    def lights(self) -> tuple[Light, ...] | None: ...

    @property
    def shape(self) -> Shape | None: ...

    @property
    def sites(self) -> Sites:
        """All sites. Raises `ArrayError` where the shape is unknown."""

    def towards_eye(self, positions: np.ndarray) -> np.ndarray:
        """wo (S, 3), unit, from `positions` (S, 3). Raises `ArrayError` where photographs are from many places."""

    def observe(self, k: int) -> Observation:
        """What photograph k tells of every site."""

    def observe_all(self, some: np.ndarray) -> Observation:
        """What every photograph tells of some sites (S,): radiance (N, S, 3), known (N, S)."""
