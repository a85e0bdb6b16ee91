"""Distributions of facet normals on the upper half of a cube, n x n and four times n/2 x n cells (MS 3), and on a
polar grid.

    top     (row, column): x = (2 column + 1)/n - 1,  y = 1 - (2 row + 1)/n,  z = 1         seen from above, y upwards
    side k  (row, column): z = 1 - (2 row + 1)/n, along = (2 column + 1)/n - 1              seen from outside, z upwards
            at x = 1 with y = along, y = 1 with x = -along, x = -1 with y = -along, y = -1 with x = along

A cell holds D at its centre. Between centres D is bilinear in the cells' own coordinates; beside an edge the first
cells of both faces stand opposite, so that it is continuous there; where three faces meet, their mean is the fourth
cell. Below the lowest centres it is constant.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ..arrays import Array, frozen, to_numpy
from ..directions import normalise, spherical
from ..errors import ArrayError, ParameterError
from .polar_grid import PolarGrid

_TURNS = 2 * math.pi / 4 * np.arange(4)  # of the sides, from x towards y


@dataclasses.dataclass(frozen=True, eq=False)
class Hemicube:
    """M distributions: `top` (M, n, n) and `sides` (M, 4, n/2, n) of D in 1/sr, n even.

    Raises `ArrayError` for other shapes, or values that are negative or not finite.
    """

    top: Array
    sides: Array

    def __post_init__(self) -> None:
        for name in ("top", "sides"):
            object.__setattr__(self, name, frozen(to_numpy(getattr(self, name)), np.float32))
        side = self.top.shape[-1] if self.top.ndim else 0
        count = len(self.top) if self.top.ndim else 0
        if side < 2 or side % 2 or self.top.shape != (count, side, side):
            raise ArrayError(f"Hemicube: top has shape {self.top.shape}; (M, n, n), n even, is wanted.")
        if self.sides.shape != (count, 4, side // 2, side):
            raise ArrayError(f"Hemicube: sides has shape {self.sides.shape}; {(count, 4, side // 2, side)} is wanted.")
        for name in ("top", "sides"):
            values = getattr(self, name)
            if not np.all((values >= 0) & np.isfinite(values)):
                raise ArrayError(f"Hemicube: {name} has values that are negative or not finite; D is neither.")

    @property
    def side(self) -> int:
        """n."""
        return int(self.top.shape[-1])


def cell_directions(side: int) -> tuple[np.ndarray, np.ndarray]:
    """The centres of the cells, unit: of the top (n, n, 3) and of the sides (4, n/2, n, 3)."""
    line = _centres(side)
    top = np.stack((*np.meshgrid(line, -line), np.ones((side, side))), axis=-1)
    along, z = np.meshgrid(line, -line[: side // 2])
    cosine, sine = np.cos(_TURNS)[:, None, None], np.sin(_TURNS)[:, None, None]
    sides = np.stack((cosine - sine * along, sine + cosine * along, np.broadcast_to(z, (4, *z.shape))), axis=-1)
    return normalise(top), normalise(sides)


def cell_solid_angles(side: int) -> tuple[np.ndarray, np.ndarray]:
    """Of the cells in sr, exactly: of the top (n, n) and of each side (n/2, n); all five faces sum to 2 pi."""
    edges = np.linspace(-1, 1, _checked(side) + 1)
    x, y = np.meshgrid(edges, edges)
    corner = np.arctan2(x * y, np.sqrt(1 + x * x + y * y))  # of the rectangle from the middle
    cells: np.ndarray = np.diff(np.diff(corner, axis=0), axis=1)
    return cells, cells[: side // 2]


def to_hemicube(tables: Array, grid: PolarGrid, side: int = 32) -> Hemicube:
    """Of `tables` (M, rows, columns) at the knots of `grid`, bilinear between them, the values at the cells' centres.

    Raises `ArrayError` for tables of another shape, `ParameterError` for a `side` that is odd.
    """
    tables = to_numpy(tables)
    if tables.ndim != 3 or tables.shape[1:] != grid.shape:
        raise ArrayError(f"tables have shape {tables.shape}; the grid wants (M, {grid.rows}, {grid.columns}).")
    faces = []
    for directions in cell_directions(_checked(side)):
        theta, phi = spherical(directions)
        row = np.clip(theta * (2 / math.pi), 0, 1) ** (1 / grid.warp) * (grid.rows - 1)
        faces.append(_bilinear(tables, row, phi * (grid.columns / (2 * math.pi)), around=True))
    return Hemicube(*faces)


def from_hemicube(hemicube: Hemicube, grid: PolarGrid) -> np.ndarray:
    """Tables (M, rows, columns), float32, at the knots of `grid`."""
    n, h = hemicube.side, grid.directions
    top, sides = _bordered(hemicube)
    tables = np.empty((len(top), *grid.shape), np.float32)
    x, y, z = np.moveaxis(h, -1, 0)
    outward = np.max(abs(h[..., :2]), axis=-1)
    above = z >= outward
    # Counted from the first cell's centre; the border is one cell more.
    tables[:, above] = _bilinear(top, *((1 + part[above] / z[above]) * n / 2 + 0.5 for part in (-y, x)))
    turn = np.argmax(np.stack((x, y, -x, -y)), axis=0)
    for k in range(4):
        cosine, sine = math.cos(_TURNS[k]), math.sin(_TURNS[k])
        here = ~above & (turn == k)
        along = cosine * y[here] - sine * x[here]
        place = ((1 + part / outward[here]) * n / 2 + 0.5 for part in (-z[here], along))
        tables[:, here] = _bilinear(sides[:, k], *place)
    return tables


def _bordered(hemicube: Hemicube) -> tuple[np.ndarray, np.ndarray]:
    """The faces with a cell more all around, of their neighbours: (M, n + 2, n + 2), (M, 4, n/2 + 2, n + 2)."""
    top, sides = hemicube.top, hemicube.sides
    whole = np.pad(top, ((0, 0), (1, 1), (1, 1)))
    # What stands opposite the sides' first rows, along them: the top's edges as the sides run.
    edges = np.stack((top[:, ::-1, -1], top[:, 0, ::-1], top[:, :, 0], top[:, -1, :]), axis=1)
    first = sides[:, :, 0]
    whole[:, -2:0:-1, -1], whole[:, 0, -2:0:-1] = first[:, 0], first[:, 1]
    whole[:, 1:-1, 0], whole[:, -1, 1:-1] = first[:, 2], first[:, 3]
    around = np.concatenate((np.roll(sides, 1, axis=1)[..., -1:], sides, np.roll(sides, -1, axis=1)[..., :1]), axis=-1)
    # At the end of side k: its last cell, the next side's first, and the top's.
    corners = (first[..., -1] + np.roll(first, -1, axis=1)[..., 0] + edges[..., -1]) / 3
    whole[:, 0, -1], whole[:, 0, 0], whole[:, -1, 0], whole[:, -1, -1] = corners.swapaxes(0, 1)
    upper = np.concatenate((np.roll(corners, 1, axis=1)[..., None], edges, corners[..., None]), axis=-1)
    return whole, np.concatenate((upper[:, :, None], around, around[:, :, -1:]), axis=2)


def _bilinear(values: np.ndarray, row: np.ndarray, column: np.ndarray, around: bool = False) -> np.ndarray:
    """Of `values` (M, rows, columns) at places (...): (M, ...); `around`, the first column follows the last."""
    _, rows, columns = values.shape
    r = np.clip(row.astype(np.int64), 0, rows - 2)
    c = column.astype(np.int64) % columns if around else np.clip(column.astype(np.int64), 0, columns - 2)
    v, u = np.clip(row - r, 0, 1), column % columns - c if around else column - c
    beside = (c + 1) % columns
    upper = (1 - u) * values[:, r, c] + u * values[:, r, beside]
    return np.asarray((1 - v) * upper + v * ((1 - u) * values[:, r + 1, c] + u * values[:, r + 1, beside]))


def _centres(side: int) -> np.ndarray:
    return (2 * np.arange(_checked(side)) + 1) / side - 1


def _checked(side: int) -> int:
    if side < 2 or side % 2:
        raise ParameterError(f"side = {side}; the faces have an even number >= 2 of cells along each side.")
    return side
