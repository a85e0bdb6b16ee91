"""A fixed view under any distant light in real time, from images made beforehand (RS 8.2), compressed by two PCAs.

    B(p, c) = sum_k T(p, c, k) L_c(k)           k over cells of the sphere; T_b of a block of pixels ~ U_b A_b D^T

L(k) is the mean radiance of a cell, T what a pixel sends of it: the mean over the cell of f max(n.w, 0) V, times its
solid angle. A block has basis images U_b of its own and all share the lights D (Nayar, Belhumeur and Boult 2004,
"Lighting sensitive display", section 5): relighting is y = A (D^T L), then B = U_b y_b in each block, in each colour.

Cells are the pixels of a cube, six faces of `side` x `side`, each face's rows from the top, in the order of
`CubeStrip()` as it stands in gonio's world: a texture that a graphics card knows. Making them is in `precomputing.py`.
"""

from __future__ import annotations

import dataclasses
import math
from functools import cached_property

import numpy as np

from ..arrays import frozen, require_finite, to_numpy
from ..errors import ArrayError, ParameterError
from ..lights.cubes import CubeStrip
from ..lights.environment import Environment
from ..lights.model import Light
from ..lights.orientation import Orientation

_CUBE = CubeStrip()


@dataclasses.dataclass(frozen=True)
class Cells:
    """6 side^2 cells of the sphere, 90/side degrees across: 115/side in the middle of a face, half at its edges."""

    side: int

    def __post_init__(self) -> None:
        if not isinstance(self.side, int | np.integer) or not 1 <= self.side <= 128:
            raise ParameterError(f"Cells: side = {self.side!r} is not a whole number from 1 to 128.")

    def __len__(self) -> int:
        return 6 * int(self.side) ** 2

    @cached_property
    def solid_angles(self) -> np.ndarray:
        """(K,) in sr."""
        solid: np.ndarray = frozen(_CUBE.solid_angles(6 * self.side, self.side).reshape(-1))
        return solid

    def directions(self, samples: int) -> tuple[np.ndarray, np.ndarray]:
        """(samples^2, K, 3), unit, world, on a grid in each cell, and the solid angle (samples^2, K) of each."""
        fine = self.side * samples
        own = _CUBE.directions(6 * fine, fine)[0] @ Orientation.GONIO.matrix(_CUBE).T
        parts = 6 * self.side, samples, self.side, samples
        solid = _CUBE.solid_angles(6 * fine, fine).reshape(parts)
        of_cells = own.reshape(*parts, 3).transpose(1, 3, 0, 2, 4)
        return of_cells.reshape(samples**2, -1, 3), solid.transpose(1, 3, 0, 2).reshape(samples**2, -1)

    def radiance(self, light: Light) -> np.ndarray:
        """Mean radiance (K, 3) of each cell. An environment is averaged over it; a light without extent shines from
        all of the cell it lies in.

        Raises `ParameterError` where the light is near.
        """
        if not light.distant:
            raise ParameterError("a near light shines otherwise on every pixel: gn.relight takes it, this does not.")
        total = np.zeros((len(self), 3))
        for part in light.parts:
            if isinstance(part, Environment):
                cube = part.resampled(_CUBE, 6 * int(self.side), Orientation.GONIO)
                total += to_numpy(cube.image).reshape(len(self), -1)
                continue
            beams = part.beams()
            own = to_numpy(beams.directions) @ Orientation.GONIO.matrix(_CUBE)
            row, column = (np.floor(x).astype(int) for x in _CUBE.pixels(own, 6 * self.side, self.side))
            at = np.minimum(row, 6 * self.side - 1) * self.side + np.minimum(column, self.side - 1)
            np.add.at(total, at, to_numpy(beams.irradiance) / self.solid_angles[at, None])
        return total


@dataclasses.dataclass(frozen=True, eq=False)
class Precomputed:
    """`mask` (rows, columns) of the pixels that are shown, in square blocks with `block` of them along a side.

    Blocks go along their rows, and the pixels of the mask in a block along its rows; blocks without any are left out.
    `ranks` (blocks,): basis images of each. `images`: U_b as (colours, rank, pixels), flat, block after block.
    `mixtures` (sum of ranks, R): A_b, block after block. `lights` (K, R): D, over `cells`. `error`: the images' rms
    error over that of the images, both averaged over white noise for light. All float32.

    Raises `ArrayError` where shapes do not fit or values are not finite, `ParameterError` for other numbers.
    """

    mask: np.ndarray
    block: int
    ranks: np.ndarray
    images: np.ndarray
    mixtures: np.ndarray
    lights: np.ndarray
    cells: Cells
    error: float
    made: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.block, int | np.integer) or self.block < 1:
            raise ParameterError(f"Precomputed: block = {self.block!r} is not a whole number >= 1.")
        if not 0 <= self.error < math.inf:
            raise ParameterError(f"Precomputed: error = {self.error!r} is not a number >= 0.")
        if self.mask.ndim != 2 or self.mask.dtype != np.bool_ or not self.mask.any():
            raise ArrayError(
                f"mask is {self.mask.dtype} {self.mask.shape}; bool (rows, columns), some true, is wanted."
            )
        for name in ("images", "mixtures", "lights"):
            array = np.ascontiguousarray(getattr(self, name), np.float32)
            require_finite(array, name)
            object.__setattr__(self, name, array)
        counts, ranks = self.pixels[1], self.ranks
        if ranks.shape != counts.shape or ranks.dtype.kind not in "iu" or (ranks < 0).any():
            raise ArrayError(f"ranks is {ranks.dtype} {ranks.shape}; {counts.size} whole numbers >= 0 are wanted.")
        values = int((ranks.astype(np.int64) * counts).sum())
        if self.images.ndim != 1 or self.images.size not in (values, 3 * values):
            raise ArrayError(f"images has shape {self.images.shape}; ranks and mask want {values}, or 3 x {values}.")
        wanted = int(ranks.sum(dtype=np.int64)), self.lights.shape[-1]
        if self.lights.shape != (len(self.cells), wanted[1]) or self.mixtures.shape != wanted:
            raise ArrayError(
                f"mixtures has shape {self.mixtures.shape}, lights {self.lights.shape}; ({wanted[0]}, R) and "
                f"({len(self.cells)}, R) are wanted."
            )

    @cached_property
    def pixels(self) -> tuple[np.ndarray, np.ndarray]:
        """Flat indices of the mask's pixels, block after block, and how many each block has."""
        return blocks(self.mask, self.block)

    @property
    def colours(self) -> int:
        """1 for a gray material, else 3."""
        return 3 if self.images.size == 3 * int((self.ranks.astype(np.int64) * self.pixels[1]).sum()) else 1

    def relight(self, light: Light) -> np.ndarray:
        """The radiance (rows, columns, 3), float32, under any distant light, 0 off the mask; nothing below 0.

        What is narrower than a cell is spread over it: a directional light as if it were some 90/side degrees wide,
        which widens shadows' edges and highlights by as much. The two steps are `shown(cells.radiance(light))`; for an
        environment that turns the first is quick where its texels are no finer than half a cell (`resampled`).
        Raises `ParameterError` where the light is near.
        """
        return self.shown(self.cells.radiance(light))

    def shown(self, radiance: np.ndarray) -> np.ndarray:
        """`relight`, of the cells' mean radiance (K, 3)."""
        if radiance.shape != (len(self.cells), 3):
            raise ArrayError(f"radiance has shape {radiance.shape}; {(len(self.cells), 3)} is wanted.")
        y = self.mixtures @ (self.lights.T @ radiance.astype(np.float32))
        image = np.zeros((self.mask.size, 3), np.float32)
        for at, rows, images in self._alike:
            found = y[rows].swapaxes(1, 2)[:, :, None] @ images
            image[at] = np.maximum(found[:, :, 0].swapaxes(1, 2), 0)
        return image.reshape(*self.mask.shape, 3)

    @cached_property
    def _alike(self) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Blocks of as many images r and pixels n together: pixels (B, n), rows of A (B, r), U_b (B, C, r, n)."""
        at, counts = self.pixels
        ranks = self.ranks.astype(np.int64)
        sizes = self.colours * ranks * counts
        firsts = [np.cumsum(k) - k for k in (counts, ranks, sizes)]
        found = []
        for rank, count in np.unique(np.stack((ranks, counts), axis=1), axis=0).tolist():
            some = (ranks == rank) & (counts == count)
            pixels, rows, values = (
                first[some, None] + np.arange(n)
                for first, n in zip(firsts, (count, rank, self.colours * rank * count), strict=True)
            )
            images = self.images[values].reshape(len(values), self.colours, rank, count)
            found.append((at[pixels], rows, images))
        return found


def blocks(mask: np.ndarray, block: int) -> tuple[np.ndarray, np.ndarray]:
    """Flat indices of the pixels of `mask`, block after block, and how many lie in each block that has any."""
    row, column = np.nonzero(mask)
    of = (row // block) * -(-mask.shape[1] // block) + column // block
    at = np.argsort(of, kind="stable")
    return (row * mask.shape[1] + column)[at], np.unique(of, return_counts=True)[1]
