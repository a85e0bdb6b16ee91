"""Photographs read once, at the pixels of an object, and held: for work that asks for all lights of a few sites often.

Not here: photographs that do not fit into memory, which `gonio ingest` stores (`files/store.py`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .photographs import Photograph, Photographs


class ReadPhotographs(Photographs):
    """`photographs` at pixels `at` (P,), counted along rows, ascending; 13 bytes for each pixel of each photograph.

    Elsewhere nothing is known: black, and clipped. progress(done, total) hears of photographs.
    """

    def __init__(
        self, photographs: Photographs, at: np.ndarray, progress: Callable[[int, int], None] | None = None
    ) -> None:
        self.names, self.size, self.at = photographs.names, photographs.size, at
        self.radiance, self.clipped = photographs.pixels(at, progress)

    def read(self, k: int) -> Photograph:
        radiance, clipped = np.zeros((*self.size, 3), np.float32), np.ones(self.size, bool)
        radiance.reshape(-1, 3)[self.at], clipped.reshape(-1)[self.at] = self.radiance[k], self.clipped[k]
        return Photograph(radiance, clipped)

    def pixels(self, at: np.ndarray, progress: Callable[[int, int], None] | None = None) -> Photograph:
        place = np.minimum(np.searchsorted(self.at, at), len(self.at) - 1)
        radiance, clipped = self.radiance[:, place], self.clipped[:, place]
        other = self.at[place] != at
        radiance[:, other], clipped[:, other] = 0, True
        if progress is not None:
            progress(len(self), len(self))
        return Photograph(radiance, clipped)
