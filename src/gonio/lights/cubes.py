"""Layouts on the faces of a cube: crosses and strips.

    X right, Y up, Z into the front face; each face as one sees it in the picture, (a, b) its right and up in [-1, 1]

    right  ( 1, b, -a)     up    (a,  1, -b)     front  ( a, b,  1)
    left   (-1, b,  a)     down  (a, -1,  b)     back   (-a, b, -1)         (before normalisation)

These are OpenGL's faces +X -X +Y -Y +Z -Z with their s and t. A texel of side 2/n around (a, b) has the solid angle
F(a1, b1) - F(a0, b1) - F(a1, b0) + F(a0, b0), F(a, b) = atan(a b / sqrt(1 + a^2 + b^2)).
"""

from __future__ import annotations

import dataclasses
from abc import abstractmethod
from typing import Any, ClassVar

import numpy as np

from .._kernels import environment as kernels
from ..arrays import Array
from ..errors import ParameterError
from .mappings import Mapping

FACES = ("right", "left", "up", "down", "front", "back")

# Where the faces of a cross lie in units of a face, (row, column); the faces around the front keep their edges.
_HORIZONTAL = {"up": (0, 1), "left": (1, 0), "front": (1, 1), "right": (1, 2), "back": (1, 3), "down": (2, 1)}
_VERTICAL = {"up": (0, 1), "left": (1, 0), "front": (1, 1), "right": (1, 2), "down": (2, 1), "back": (3, 1)}


class _Cube(Mapping):
    """Six square faces, in the order of `FACES` on the sheets, however the picture places them."""

    sheets: ClassVar[int] = 6
    kernel: ClassVar[int] = kernels.CUBE

    @abstractmethod
    def _side(self, rows: int, columns: int) -> int:
        """Pixels along a face. Raises `ArrayError` for another aspect."""

    def sheet_shape(self, rows: int, columns: int) -> tuple[int, int]:
        side = self._side(rows, columns)
        return side, side

    def locate(self, xp: Any, w: Array) -> tuple[Array, Array, Array]:
        x, y, z = w[..., 0], w[..., 1], w[..., 2]
        ax, ay, az = xp.abs(x), xp.abs(y), xp.abs(z)
        on_x = (ax >= ay) & (ax >= az)
        on_y = ~on_x & (ay >= az)
        largest = xp.where(on_x, ax, xp.where(on_y, ay, az))
        a = xp.where(on_x, xp.where(x > 0, -z, z), xp.where(on_y | (z > 0), x, -x)) / largest
        b = xp.where(on_y, xp.where(y > 0, -z, z), y) / largest
        signed = xp.where(on_x, x, xp.where(on_y, y, z))
        sheet = xp.astype(on_y, xp.int64) * 2 + xp.astype(~(on_x | on_y), xp.int64) * 4
        sheet = sheet + xp.astype(~(signed > 0), xp.int64)
        return sheet, 0.5 + 0.5 * a, 0.5 - 0.5 * b

    def direct(self, sheet: int, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        a, b, one = np.broadcast_arrays(2 * u - 1, 1 - 2 * v, 1.0)
        faces = ((one, b, -a), (-one, b, a), (a, one, -b), (a, -one, b), (a, b, one), (-a, b, -one))
        w: np.ndarray = np.stack(faces[sheet], axis=-1) / np.sqrt(1 + a * a + b * b)[..., None]
        return w

    def density(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        d2 = 1 + (2 * u - 1) ** 2 + (2 * v - 1) ** 2
        density: np.ndarray = 1 / (d2 * np.sqrt(d2))
        return density

    def sheet_solid_angles(self, height: int, width: int) -> np.ndarray:
        edge = np.linspace(-1.0, 1.0, width + 1)
        a, b = edge[:, None], edge[None, :]
        corner = np.arctan(a * b / np.sqrt(1 + a * a + b * b))
        solid: np.ndarray = np.diff(np.diff(corner, axis=0), axis=1)
        return solid

    def ghosts(self, height: int, width: int) -> np.ndarray:
        n = width
        out = np.pad(np.arange(6 * n * n).reshape(6, n, n), ((0, 0), (1, 1), (1, 1)), mode="edge")
        # Half a texel beyond an edge, at the place of the texel along it: on the neighbour that is its own edge texel.
        along = (np.arange(n) + 0.5) / n
        for face in range(6):
            for v, u, where in (
                (-0.5 / n, along, (0, slice(1, -1))),
                (1 + 0.5 / n, along, (n + 1, slice(1, -1))),
                (along, -0.5 / n, (slice(1, -1), 0)),
                (along, 1 + 0.5 / n, (slice(1, -1), n + 1)),
            ):
                out[face][where] = self._texel(self.direct(face, np.asarray(u), np.asarray(v)), n)
            for corner, (v, u) in {
                (0, 0): (0.0, 0.0), (0, n + 1): (0.0, 1.0), (n + 1, 0): (1.0, 0.0), (n + 1, n + 1): (1.0, 1.0),
            }.items():  # fmt: skip
                x, y, z = self.direct(face, np.asarray(u), np.asarray(v)) > 0
                out[face][corner] = 6 * n * n + 4 * int(x) + 2 * int(y) + int(z)
        return out

    def corners(self, height: int, width: int) -> np.ndarray:
        signs = np.array([[1.0 if k & bit else -1.0 for bit in (4, 2, 1)] for k in range(8)])
        # A little towards each of the corner's three faces, so little that no other texel is met.
        lean = signs[:, None, :] * (1 + np.eye(3) / (2 * width))
        return self._texel(lean, width)

    def _texel(self, w: np.ndarray, n: int) -> np.ndarray:
        """Flat sheet index of the texel that directions (any length) meet."""
        sheet, u, v = self.locate(np, w)
        row, column = (np.clip((x * n).astype(np.int64), 0, n - 1) for x in (v, u))
        index: np.ndarray = (sheet * n + row) * n + column
        return index


@dataclasses.dataclass(frozen=True)
class CubeCross(_Cube):
    """An unfolded cube: 3 x 4 faces (horizontal), or 4 x 3 (vertical), where the back stands upside down below."""

    vertical: bool = True

    def _side(self, rows: int, columns: int) -> int:
        high, wide = (4, 3) if self.vertical else (3, 4)
        if rows < high or rows % high or columns * high != rows * wide:
            raise self._refuse(rows, columns, f"{high} faces from top to bottom and {wide} from left to right")
        return rows // high

    def shape(self, rows: int) -> tuple[int, int]:
        columns = rows // 4 * 3 if self.vertical else rows // 3 * 4
        self._side(rows, columns)
        return rows, columns

    def placement(self, rows: int, columns: int) -> np.ndarray:
        n = self._side(rows, columns)
        pixels = np.arange(rows * columns).reshape(rows, columns)
        faces = []
        for name in FACES:
            r, c = (_VERTICAL if self.vertical else _HORIZONTAL)[name]
            face = pixels[r * n : (r + 1) * n, c * n : (c + 1) * n]
            faces.append(face[::-1, ::-1] if self.vertical and name == "back" else face)
        return np.stack(faces)


@dataclasses.dataclass(frozen=True)
class CubeStrip(_Cube):
    """Six faces from top to bottom, or from left to right, in the order `faces`.

    The default is OpenGL's +X -X +Y -Y +Z -Z. OpenEXR's cubes have the back before the front: `CubeStrip.openexr()`.
    """

    vertical: bool = True
    faces: tuple[str, ...] = FACES

    def __post_init__(self) -> None:
        if sorted(self.faces) != sorted(FACES):
            raise ParameterError(f"CubeStrip: faces = {self.faces} is no order of {', '.join(FACES)}.")
        object.__setattr__(self, "faces", tuple(self.faces))

    @classmethod
    def openexr(cls) -> CubeStrip:
        """The cube of OpenEXR's `envmap` attribute; its orientation is `orientation.OPENEXR`."""
        return cls(vertical=True, faces=("right", "left", "up", "down", "back", "front"))

    def _side(self, rows: int, columns: int) -> int:
        high, wide = (6, 1) if self.vertical else (1, 6)
        if rows < high or rows % high or columns * high != rows * wide:
            raise self._refuse(rows, columns, f"{high} faces from top to bottom and {wide} from left to right")
        return rows // high

    def shape(self, rows: int) -> tuple[int, int]:
        columns = rows // 6 if self.vertical else 6 * rows
        self._side(rows, columns)
        return rows, columns

    def placement(self, rows: int, columns: int) -> np.ndarray:
        self._side(rows, columns)
        pixels = np.arange(rows * columns).reshape(rows, columns)
        parts = np.split(pixels, 6, axis=0 if self.vertical else 1)
        return np.stack([parts[self.faces.index(name)] for name in FACES])
