"""Light positions of an RTI capture, `.lp`: the number of photographs, then `name x y z` for each.

x right, y up, z towards the camera. Names may hold spaces and folders. Vectors are directions, or places in some unit:
what counts here is where they point. Decimal commas are refused, since they could be two numbers.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import FileError
from .whole import writing

_LARGEST = 2**24  # bytes: some hundred thousand lights


@dataclasses.dataclass(frozen=True, eq=False)
class LightList:
    """names (N,) as written; vectors (N, 3), finite and not 0; stated: the first line's count."""

    names: tuple[str, ...]
    vectors: np.ndarray
    stated: int

    @property
    def directions(self) -> np.ndarray:
        """Unit vectors, (N, 3)."""
        directions: np.ndarray = self.vectors / np.linalg.norm(self.vectors, axis=1, keepdims=True)
        return directions


def read_lp(path: str | os.PathLike[str]) -> LightList:
    """The lights of an `.lp` file. Raises `FileError` naming the line at fault."""
    try:
        if Path(path).stat().st_size > _LARGEST:
            raise FileError(f"{path} has more than {_LARGEST} bytes: it is no list of lights.")
        lines = Path(path).read_text("utf-8-sig").splitlines()
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error
    except UnicodeDecodeError as error:
        raise FileError(f"{path}: byte {error.start} is no text.") from error
    try:
        stated = int(lines[0])
    except (IndexError, ValueError):
        raise FileError(
            f"{path}: line 1 is {lines[0]!r:.40}, no number of lights." if lines else f"{path} is empty."
        ) from None
    names, vectors = [], []
    for number, line in enumerate(lines[1:], 2):
        words = line.split()
        if not words:
            continue
        if len(words) < 4:
            raise FileError(f"{path}: line {number} is {line!r:.60}; expected a name and x y z.")
        try:
            vector = [float(word) for word in words[-3:]]
        except ValueError:
            hint = " Write decimals with a point." if any("," in word for word in words[-3:]) else ""
            raise FileError(
                f"{path}: line {number} ends in {' '.join(words[-3:])!r:.60}, no three numbers.{hint}"
            ) from None
        if not np.isfinite(vector).all() or np.linalg.norm(vector) < 1e-4:
            raise FileError(f"{path}: line {number}: the vector {vector} points nowhere.")
        # Names may hold runs of spaces: what stands before the last three words.
        names.append(line.rsplit(None, 3)[0].strip())
        vectors.append(vector)
    if not names:
        raise FileError(f"{path} names no photograph.")
    return LightList(tuple(names), np.array(vectors), stated)


def write_lp(path: str | os.PathLike[str], names: Sequence[str], directions: np.ndarray) -> None:
    """Write photographs' names and unit directions (N, 3), whole or not at all."""
    rows = (f"{name} {x:.9g} {y:.9g} {z:.9g}" for name, (x, y, z) in zip(names, directions, strict=True))
    with writing(Path(path)) as temporary:
        temporary.write_text("\n".join([str(len(names)), *rows]) + "\n", "utf-8")
