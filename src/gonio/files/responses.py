"""The response of a camera as a text file, TOML: what `recover_response` found, kept for other photographs.

    version = 1
    step = 1                # codes that a level stands for: level k is codes step k to step (k + 1) - 1
    residual = 0.0042       # rms of ln X, where the response was recovered
    log_exposure = [        # a row for each level, darkest first: ln X of each channel, 0 where the sensor clips
        [-inf, -inf, -inf],
        [-7.6, -7.5, -7.7],
        ...
    ]

One number a row is a curve of all channels. Rows do not fall; -inf is no exposure.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..capture.exposure import Response
from ..errors import FileError, GonioError
from .raster import require_file
from .whole import writing

_LARGEST = 2**24  # bytes: 65536 levels of three channels take a quarter of it


def read_response(path: str | os.PathLike[str]) -> Response:
    """The response in a file that `write_response`, or a person, wrote. Raises `FileError` by field and row."""
    path = Path(path)
    fields = _fields(path)

    def take(name: str, good: Callable[[Any], bool], wanted: str, otherwise: Any = None) -> Any:
        value = fields.pop(name, otherwise)
        if value is None:
            raise FileError(f"{path} has no {name}; {wanted} is wanted.")
        if not good(value):
            raise FileError(f"{path}: {name} = {value!r:.60}; {wanted} is wanted.")
        return value

    take("version", lambda v: type(v) is int and v == 1, "1")
    step = take("step", lambda v: type(v) is int and 1 <= v <= 65536, "a number of codes", 1)
    residual = take("residual", lambda v: _is_number(v) and 0 <= v < np.inf, "a number, 0 or more,", 0.0)
    rows = take("log_exposure", lambda v: isinstance(v, list) and len(v) > 1, "a list of rows")
    if fields:
        raise FileError(f"{path}: the field {next(iter(fields))} is not known.")
    channels = len(rows[0]) if isinstance(rows[0], list) else 0
    if channels not in (1, 3):
        raise FileError(f"{path}: log_exposure, row 0, is {rows[0]!r:.60}; 1 or 3 numbers are wanted.")
    for k, row in enumerate(rows):
        if not (isinstance(row, list) and len(row) == channels and all(map(_is_number, row))):
            raise FileError(
                f"{path}: log_exposure, row {k}, is {row!r:.60}; {channels} numbers are wanted, as in row 0."
            )
    try:
        return Response(np.array(rows, dtype=np.float64), step, float(residual))
    except GonioError as error:
        raise FileError(f"{path}: {error}") from error


def write_response(path: str | os.PathLike[str], response: Response) -> None:
    """Writes what `read_response` reads, whole or not at all. Raises `FileError` where that cannot be."""
    lines = ["version = 1", f"step = {response.step}", f"residual = {response.residual:.6g}", "log_exposure = ["]
    lines += [f"    [{', '.join(f'{x:.9g}' for x in row)}]," for row in response.log_exposure.tolist()]
    with writing(path) as temporary:
        temporary.write_text("\n".join((*lines, "]")) + "\n", "utf-8")


def _fields(path: Path) -> dict[str, Any]:
    require_file(path)
    try:
        if path.stat().st_size > _LARGEST:
            raise FileError(f"{path} has {path.stat().st_size} bytes: too many for a response.")
        return tomllib.loads(path.read_text("utf-8-sig"))
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise FileError(f"{path} is no TOML: {error}.") from error


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
