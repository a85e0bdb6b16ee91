"""Photographs of one scene from one place, one for each light: read one at a time, since together they fill memory.

    photographs.read(k)    radiance (rows, columns, 3), linear float32, and which pixels are clipped

Files are behind it (`files/photographs.py`), or arrays (`Held`). Radiance is relative: what a sensor counts.
"""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ..arrays import Array, frozen, require_finite, to_numpy
from ..errors import ArrayError


class Photograph(NamedTuple):
    """radiance (rows, columns, 3) float32, linear; clipped (rows, columns) bool: at the brightest code there is."""

    radiance: np.ndarray
    clipped: np.ndarray

    def pick(self, at: np.ndarray) -> Photograph:
        """The same at pixels `at` (P,), counted along rows: radiance (P, 3) and clipped (P,)."""
        return Photograph(np.take(self.radiance.reshape(-1, 3), at, axis=0), np.take(self.clipped, at))


class Photographs(ABC):
    """`names` (N,), and their common size, (rows, columns)."""

    names: tuple[str, ...]
    size: tuple[int, int]

    @abstractmethod
    def read(self, k: int) -> Photograph:
        """Photograph k, whole."""

    def pick(self, k: int, at: np.ndarray) -> Photograph:
        """Photograph k at pixels `at` (P,), counted along rows: radiance (P, 3) and clipped (P,)."""
        return self.read(k).pick(at)

    def pixels(self, at: np.ndarray, progress: Callable[[int, int], None] | None = None) -> Photograph:
        """All photographs at pixels `at` (P,), counted along rows: radiance (N, P, 3) and clipped (N, P).

        progress(done, total) hears of photographs.
        """
        radiance = np.empty((len(self), len(at), 3), np.float32)
        clipped = np.empty((len(self), len(at)), bool)
        for k in range(len(self)):
            radiance[k], clipped[k] = self.pick(k, at)
            if progress is not None:
                progress(k + 1, len(self))
        return Photograph(radiance, clipped)

    def parts(self, at: np.ndarray, most: int) -> Iterator[np.ndarray]:
        """`at` (P,) in parts of at most `most` pixels, as `pixels` reads them soonest: indices into it."""
        for low in range(0, len(at), most):
            yield np.arange(low, min(low + most, len(at)))

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
        radiance = self.radiance[k]
        if math.isinf(self.white):
            return Photograph(radiance, np.zeros(self.size, bool))
        red, green, blue = np.moveaxis(radiance >= self.white, -1, 0)
        return Photograph(radiance, red | green | blue)


class Chosen(Photographs):
    """Some of `photographs`, those numbered `which`, in that order."""

    def __init__(self, photographs: Photographs, which: Sequence[int]) -> None:
        self.photographs, self.which = photographs, [int(k) for k in which]
        self.names, self.size = tuple(photographs.names[k] for k in self.which), photographs.size

    def read(self, k: int) -> Photograph:
        return self.photographs.read(self.which[k])

    def pick(self, k: int, at: np.ndarray) -> Photograph:
        return self.photographs.pick(self.which[k], at)

    def pixels(self, at: np.ndarray, progress: Callable[[int, int], None] | None = None) -> Photograph:
        radiance, clipped = self.photographs.pixels(at, progress)
        return Photograph(radiance[self.which], clipped[self.which])

    def parts(self, at: np.ndarray, most: int) -> Iterator[np.ndarray]:
        return self.photographs.parts(at, most)


class Flattened(Photographs):
    """`photographs` divided by what the lens leaves of light: `vignetting` (rows, columns, C), as of `flat_field`.

    Raises `ArrayError` where it is of another size, or not positive.
    """

    def __init__(self, photographs: Photographs, vignetting: Array) -> None:
        self.photographs, self.vignetting = photographs, checked_vignetting(vignetting, photographs.size)
        self.names, self.size = photographs.names, photographs.size

    def read(self, k: int) -> Photograph:
        radiance, clipped = self.photographs.read(k)
        return Photograph(radiance / self.vignetting, clipped)

    def pick(self, k: int, at: np.ndarray) -> Photograph:
        radiance, clipped = self.photographs.pick(k, at)
        return Photograph(radiance / self._divisor(at), clipped)

    def pixels(self, at: np.ndarray, progress: Callable[[int, int], None] | None = None) -> Photograph:
        radiance, clipped = self.photographs.pixels(at, progress)
        return Photograph(radiance / self._divisor(at), clipped)

    def _divisor(self, at: np.ndarray) -> np.ndarray:
        return np.take(self.vignetting.reshape(-1, self.vignetting.shape[2]), at, axis=0)

    def parts(self, at: np.ndarray, most: int) -> Iterator[np.ndarray]:
        return self.photographs.parts(at, most)


def checked_vignetting(vignetting: Array, size: tuple[int, int]) -> np.ndarray:
    """`vignetting` (rows, columns, 1 or 3) as float32, read-only. Raises `ArrayError` as `Flattened` does."""
    divisor: np.ndarray = frozen(to_numpy(vignetting), np.dtype(np.float32))
    if divisor.ndim != 3 or divisor.shape[:2] != size or divisor.shape[2] not in (1, 3):
        raise ArrayError(f"vignetting has shape {divisor.shape}; {(*size, 3)} is wanted, the photographs' own size.")
    require_finite(divisor, "vignetting")
    if not (divisor > 0).all():
        row, column, channel = (int(k) for k in np.argwhere(~(divisor > 0))[0])
        raise ArrayError(
            f"vignetting[{row}, {column}, {channel}] is {divisor[row, column, channel]:g}; a share of the light above "
            "0 is wanted."
        )
    return divisor
