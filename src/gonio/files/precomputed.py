"""A view for any distant light, in .gonio files (`archive.py`): kind "precomputed", for players of any kind.

gonio.json      error, made; block, pixels along a block's side; side, cells of light along an edge of the cube
mask.npy        (rows, columns) bool, the pixels that are shown
ranks.npy       (blocks,) int32, basis images of each block that has pixels, along the rows of blocks
images.npy      flat: (colours, rank, pixels) of each block, pixels of the mask along its rows; colours 1 or 3
mixtures.npy    (sum of ranks, R), block after block
lights.npy      (6 side^2, R): cells face by face, +x -x +z -z -y +y, rows from the top and columns from the left

To play it, with the light's mean radiance L (cells, 3): y = mixtures (lights^T L), (sum of ranks, 3); a pixel's colour
c is the sum over its block's images of images[c, r, pixel] y[r, c], and 0 where that is less. A face is seen from
inside as OpenGL's cube maps in GONIO's orientation are (`lights/cubes.py`, `lights/orientation.py`). Numbers are half
floats where those hold them as they are, else single.
"""

from __future__ import annotations

import os

import numpy as np

from ..errors import MEMORY_LIMIT, FileError, GonioError
from ..rendering.precomputed import Cells, Precomputed
from .archive import read_archive, write_archive

_KIND, _VERSION = "precomputed", 1
_FACTORS = ("images", "mixtures", "lights")
_ARRAYS = {"mask": "b", "ranks": "i", **dict.fromkeys(_FACTORS, "f")}
_WORDS = {float: "a number is", int: "a whole number is", str: "words are"}


def write_precomputed(path: str | os.PathLike[str], thing: Precomputed) -> None:
    """Write `thing` whole or not at all. Raises `FileError` where the system refuses."""
    fields = {"error": thing.error, "made": thing.made, "block": int(thing.block), "side": int(thing.cells.side)}
    arrays = {"mask": thing.mask, "ranks": thing.ranks.astype(np.int32)}
    write_archive(path, _KIND, _VERSION, fields, arrays | {name: _least(getattr(thing, name)) for name in _FACTORS})


def read_precomputed(path: str | os.PathLike[str]) -> Precomputed:
    """What `write_precomputed` wrote. Raises `FileError` naming the file and the field at fault."""
    # Halves take twice as much when they are read.
    fields, arrays = read_archive(path, _KIND, _VERSION, MEMORY_LIMIT // 2)
    for name, kinds in {"error": (int, float), "block": (int,), "side": (int,), "made": (str,)}.items():
        if type(fields.get(name)) not in kinds:
            raise FileError(f"{path}: the field {name!r} is {fields.get(name)!r:.80}; {_WORDS[kinds[-1]]} wanted.")
    for name, letter in _ARRAYS.items():
        if name not in arrays:
            raise FileError(f"{path}: {name}.npy is missing.")
        if arrays[name].dtype.kind != letter:
            raise FileError(f"{path}: {name}.npy is {arrays[name].dtype}; numpy's kind {letter!r} is wanted.")
    try:
        mask, ranks, images, mixtures, lights = (arrays[name] for name in _ARRAYS)
        cells = Cells(fields["side"])
        return Precomputed(
            mask, fields["block"], ranks, images, mixtures, lights, cells, float(fields["error"]), fields["made"]
        )
    except GonioError as error:
        raise FileError(f"{path}: {error}") from error


def _least(x: np.ndarray) -> np.ndarray:
    """x as half floats where they are the same."""
    with np.errstate(over="ignore"):
        half = x.astype(np.float16)
    return half if np.array_equal(half.astype(np.float32), x) else x
