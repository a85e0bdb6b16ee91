"""What was photographed, and what is known about it: the value that all that follows starts from.

One place of the camera, far away or not, and one light for each photograph. The frame is the image's: x right, y up, z
towards the camera, so that a sample lying flat faces +z; pixel (row, column) has x = column, y = -row in its spacing.
Not here: reading one (`files/captures.py`), several cameras.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array, frozen, to_numpy
from ..directions import require_unit
from ..errors import ArrayError
from .photographs import Photographs

if TYPE_CHECKING:
    from ..samples import RadianceSamples
    from .sampling import Reflectance


@dataclasses.dataclass(frozen=True, eq=False)
class Capture:
    """`photographs`, N of (rows, columns).

    directions: (N, 3), unit, towards each light; None where unknown. intensities: (N, 3) > 0, the irradiance of each
    light on a plane that faces it, relative; ones where not told. mask: (rows, columns) bool, where the object is.
    normals: (rows, columns, 3), unit on the mask where the shape is known, else None. layout: how it was found.
    findings: what was not as it should be, and what was done about it.
    """

    photographs: Photographs
    directions: np.ndarray | None = None
    intensities: Array = None
    mask: Array = None
    normals: np.ndarray | None = None
    layout: str = ""
    findings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n, size = len(self.photographs), tuple(self.photographs.size)
        if self.directions is not None:
            directions = frozen(to_numpy(self.directions), np.dtype(np.float64))
            _require_shape("directions", directions, (n, 3))
            require_unit(directions, "directions")
            object.__setattr__(self, "directions", directions)
        intensities = np.ones((n, 3)) if self.intensities is None else to_numpy(self.intensities)
        intensities = frozen(intensities, np.dtype(np.float64))
        _require_shape("intensities", intensities, (n, 3))
        if not np.all(np.isfinite(intensities) & (intensities > 0)):
            raise ArrayError("intensities are not all positive numbers.")
        object.__setattr__(self, "intensities", intensities)
        mask = np.ones(size, bool) if self.mask is None else frozen(to_numpy(self.mask), np.dtype(bool))
        _require_shape("mask", mask, size)
        if not mask.any():
            raise ArrayError("mask is empty: no pixel is on the object.")
        object.__setattr__(self, "mask", mask)
        if self.normals is not None:
            normals = frozen(to_numpy(self.normals), np.dtype(np.float32))
            _require_shape("normals", normals, (*size, 3))
            require_unit(normals[mask], "normals on the mask")
            object.__setattr__(self, "normals", normals)

    def reflectance(self, least: float = 0.0) -> Reflectance:
        """f(wi, wo) at every pixel of the mask under every light, streamed: `sampling.Reflectance`.

        least: in [0, 1), the part of a pixel's mean below which a photograph is left out (MS 9: .05).
        Raises `ArrayError` where lights or normals are unknown, `ParameterError` for another `least`.
        """
        from .sampling import Reflectance

        return Reflectance(self, least)

    def radiance(self) -> Iterator[RadianceSamples]:
        """B(n, wo) at every pixel of the mask, whatever the light, a block for each photograph: `sampling.radiance`.

        Raises `ArrayError` where normals are unknown.
        """
        from .sampling import radiance

        return radiance(self)

    def mean(self) -> np.ndarray:
        """The mean of all photographs over their lights' intensities, (rows, columns, 3)."""
        total = np.zeros((*self.photographs.size, 3))
        for k, intensity in enumerate(self.intensities):
            total += self.photographs.read(k).radiance / intensity
        return (total / len(self.photographs)).astype(np.float32)


def _require_shape(name: str, array: np.ndarray, shape: tuple[int, ...]) -> None:
    if array.shape != shape:
        raise ArrayError(f"{name} has shape {array.shape}; {shape} is wanted.")
