"""Layouts of environment maps: pixel <-> direction, both ways, and the solid angle of every pixel.

    LatLongMap   w = (sin theta cos phi, sin theta sin phi, cos theta), theta = pi row/rows, phi = 2 pi column/columns
    others       angular maps, mirror balls and paraboloids in `discs.py`, cubes in `cubes.py`

Positions are in pixels: (row, column) = (0, 0) is the upper left corner of the picture, and the centre of pixel (r, c)
lies at (r + 1/2, c + 1/2). Directions are in the layout's own axes: for a lat-long map gonio's world (row 0 at +z,
column 0 at phi = 0), for every other layout X right, Y up and Z towards the picture's centre. What those axes are in
the world is for `orientation.py` to say.

A layout is made of sheets (one, two for a paraboloid pair, six for a cube) with coordinates u, v in [0, 1], right
and down, placed somewhere in the picture. Look-ups run on an atlas of the sheets with one ghost texel around each,
whose neighbour across the edge it is.
"""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np

from .._kernels import environment as kernels
from ..arrays import Array, floats
from ..directions import from_spherical, require_unit, spherical
from ..errors import ArrayError


class Mapping(ABC):
    """A layout: a value without an image, so that one serves maps of every size."""

    sheets: ClassVar[int] = 1
    kernel: ClassVar[int]  # the layout's number in _kernels.environment
    # Columns: where the picture's right, its up and its centre point, in the layout's own axes.
    picture: ClassVar[np.ndarray] = np.eye(3)

    @property
    def parameter(self) -> float:
        """The one number that the kernels need beside the layout's own; 0 where there is none."""
        return 0.0

    @abstractmethod
    def sheet_shape(self, rows: int, columns: int) -> tuple[int, int]:
        """(h, w) of a sheet in a picture of (rows, columns). Raises `ArrayError` where its aspect is another."""

    @abstractmethod
    def shape(self, rows: int) -> tuple[int, int]:
        """(rows, columns) of a picture with `rows` rows. Raises `ArrayError` where there is none of that height."""

    @abstractmethod
    def locate(self, xp: Any, w: Array) -> tuple[Array, Array, Array]:
        """(sheet, u, v) of own directions (..., 3): the sheet as integers, u and v in [0, 1]."""

    @abstractmethod
    def direct(self, sheet: int, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Own unit directions (..., 3) at (u, v) of a sheet: the inverse of `locate`. Outside a disc, its rim's."""

    @abstractmethod
    def density(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Solid angle per area of a sheet at (u, v), but for a constant factor; 0 outside a disc."""

    @abstractmethod
    def sheet_solid_angles(self, height: int, width: int) -> np.ndarray:
        """Solid angle of each texel of one sheet, (height, width), in sr; 0 where a texel shows nothing."""

    @abstractmethod
    def ghosts(self, height: int, width: int) -> np.ndarray:
        """Texels of the atlas as indices (sheets, height + 2, width + 2) into the flat sheets.

        Indices from `sheets * height * width` on name the eight corners of a cube (see `corners`).
        """

    def corners(self, height: int, width: int) -> np.ndarray:
        """Flat sheet indices (n, 3) of the texels that meet where only three do; their mean is the ghost there."""
        return np.zeros((0, 3), dtype=np.int64)

    def placement(self, rows: int, columns: int) -> np.ndarray:
        """Flat pixel index (sheets, h, w) of each sheet's texel in the picture."""
        height, width = self.sheet_shape(rows, columns)
        return np.arange(rows * columns).reshape(1, height, width)

    def directions(self, rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
        """Own unit directions (rows, columns, 3) at the pixel centres, and which pixels show any direction at all.

        A pixel cut by a disc's rim counts if any of it lies inside; its direction is then the rim's. Pixels that show
        nothing hold (0, 0, 1).
        """
        height, width = self.sheet_shape(rows, columns)
        v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij")
        w = np.zeros((rows * columns, 3))
        w[:, 2] = 1.0
        shown = self.sheet_solid_angles(height, width) > 0
        mask = np.zeros(rows * columns, dtype=bool)
        for sheet, at in enumerate(self.placement(rows, columns)):
            w[at[shown]] = self.direct(sheet, u[shown], v[shown])
            mask[at[shown]] = True
        return w.reshape(rows, columns, 3), mask.reshape(rows, columns)

    def solid_angles(self, rows: int, columns: int) -> np.ndarray:
        """Solid angle of each pixel, (rows, columns), in sr; 0 where a pixel shows nothing.

        Exact to rounding, pixels cut by a disc's rim included: they sum to 4 pi (less what a ball hides).
        """
        height, width = self.sheet_shape(rows, columns)
        solid = np.zeros(rows * columns)
        solid[self.placement(rows, columns)] = self.sheet_solid_angles(height, width)
        return solid.reshape(rows, columns)

    def pixels(self, w: Array, rows: int, columns: int) -> tuple[Array, Array]:
        """(row, column), real-valued, of own unit directions (..., 3) in a picture of (rows, columns).

        Raises `DirectionError` where w is not unit, `ArrayError` where the aspect is not the layout's.
        """
        height, width = self.sheet_shape(rows, columns)
        require_unit(w, "w")
        xp, w = floats(w)
        sheet, u, v = self.locate(xp, w)
        # Every sheet is placed by whole-pixel steps, perhaps turned about: three corners say how.
        at = self.placement(rows, columns)
        origin = np.stack(np.divmod(at[:, 0, 0], columns), axis=-1)
        right = np.stack(np.divmod(at[:, 0, -1], columns), axis=-1) >= origin
        down = np.stack(np.divmod(at[:, -1, 0], columns), axis=-1) >= origin
        row = column = xp.zeros_like(u)
        for k in range(self.sheets):
            here = sheet == k
            y = v * height if down[k, 0] else 1 - v * height
            x = u * width if right[k, 1] else 1 - u * width
            row = xp.where(here, float(origin[k, 0]) + y, row)
            column = xp.where(here, float(origin[k, 1]) + x, column)
        return row, column

    def _refuse(self, rows: int, columns: int, rule: str) -> ArrayError:
        return ArrayError(
            f"{type(self).__name__}: a picture of {rows} x {columns} (rows x columns) does not fit; it has {rule}. "
            "Name another mapping, or crop or resize the picture."
        )


@dataclasses.dataclass(frozen=True)
class LatLongMap(Mapping):
    """Latitude-longitude (equirectangular) map, twice as wide as high; `sphere.LatLong` is its grid of centres."""

    kernel: ClassVar[int] = kernels.LATLONG
    # The picture's middle column is phi = pi, and phi grows to the right.
    picture: ClassVar[np.ndarray] = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])

    def sheet_shape(self, rows: int, columns: int) -> tuple[int, int]:
        if rows < 1 or columns != 2 * rows:
            raise self._refuse(rows, columns, "twice as many columns as rows")
        return rows, columns

    def shape(self, rows: int) -> tuple[int, int]:
        return self.sheet_shape(rows, 2 * rows)

    def locate(self, xp: Any, w: Array) -> tuple[Array, Array, Array]:
        theta, phi = spherical(w)
        return xp.zeros(phi.shape, dtype=xp.int64), phi / (2 * math.pi), theta / math.pi

    def direct(self, sheet: int, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        w: np.ndarray = from_spherical(math.pi * v, 2 * math.pi * u)
        return w

    def density(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        density: np.ndarray = np.sin(math.pi * v) * np.ones_like(u)
        return density

    def sheet_solid_angles(self, height: int, width: int) -> np.ndarray:
        edge = np.arange(height) * (math.pi / height)
        # cos a - cos b as a product, which keeps its digits at the poles.
        band = 2 * np.sin(edge + math.pi / (2 * height)) * math.sin(math.pi / (2 * height))
        return np.repeat(band[:, None] * (2 * math.pi / width), width, axis=1)

    def ghosts(self, height: int, width: int) -> np.ndarray:
        index = np.arange(height * width).reshape(height, width)
        # Beyond a pole the map goes on half a turn away.
        index = np.concatenate((np.roll(index[:1], width // 2, 1), index, np.roll(index[-1:], width // 2, 1)))
        return np.concatenate((index[:, -1:], index, index[:, :1]), axis=1)[None]
