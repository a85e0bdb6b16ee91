"""MERL's BRDF files (Matusik et al. 2003): `.binary`, half/difference tables of measured isotropic materials.

    int32 90, 90, 180; then float64 red[90][90][180], green, blue over (theta_h, theta_d, phi_d), little-endian
    f = value * (1, 1.15, 1.66)/1500

A negative value marks a cell that was not measured. Not here: the look-ups (`brdf/table.py`).
"""

from __future__ import annotations

import os
import struct
import warnings
from pathlib import Path

import numpy as np

from ..brdf.table import MERL_SHAPE, HalfDifferenceTable, above_surface
from ..errors import FileError, NegativeWarning
from .whole import writing

_SCALES = np.array([1.0, 1.15, 1.66]) / 1500
_HEADER = struct.Struct("<3i")
_CELLS = MERL_SHAPE[0] * MERL_SHAPE[1] * MERL_SHAPE[2]
_SIZE = _HEADER.size + 3 * 8 * _CELLS


def read_merl(path: str | os.PathLike[str]) -> HalfDifferenceTable:
    """The BRDF of a MERL `.binary` file, RGB in 1/sr, held in single precision.

    A cell with a negative value in any channel was not measured: `valid` tells which, and look-ups there take the
    nearest measured cell along theta_h. Cells below the surface are negative in every file; where there are others,
    `NegativeWarning` says how many. Raises `FileError` where the size, the dimensions or a value is not MERL's.
    """
    try:
        with Path(path).open("rb") as stream:
            size = os.fstat(stream.fileno()).st_size
            header = stream.read(_HEADER.size)
            if len(header) < _HEADER.size:
                raise FileError(f"{path}: the header is cut short ({len(header)} of {_HEADER.size} bytes).")
            shape = _HEADER.unpack(header)
            if shape != MERL_SHAPE:
                raise FileError(f"{path}: dimensions are {shape}; MERL's are {MERL_SHAPE}. Is it another format?")
            if size != _SIZE:
                raise FileError(f"{path}: values take {size - _HEADER.size} bytes; MERL's take {_SIZE - _HEADER.size}.")
            planes = np.fromfile(stream, "<f8", 3 * _CELLS).reshape(3, *shape)
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error
    if not np.abs(planes).max() < 1e30:  # so written that NaN fails too
        channel, *cell = (int(k) for k in np.argwhere(~(np.abs(planes) < 1e30))[0])
        raise FileError(f"{path}: {('red', 'green', 'blue')[channel]}{cell} is {planes[(channel, *cell)]:g}.")

    valid = np.all(planes >= 0, axis=0)
    if not valid.any():
        raise FileError(f"{path}: every value is negative: nothing was measured.")
    above = above_surface(MERL_SHAPE)
    missing = int(np.count_nonzero(above & ~valid))
    if missing:
        warnings.warn(
            f"{path}: {missing:,} of the {int(above.sum()):,} cells above the surface are negative (not measured); "
            "look-ups there take the nearest measured cell along theta_h.",
            NegativeWarning,
            stacklevel=2,
        )
    return HalfDifferenceTable(np.moveaxis(planes, 0, -1) * _SCALES, valid)


def write_merl(path: str | os.PathLike[str], table: HalfDifferenceTable) -> None:
    """Writes `table` as a MERL `.binary` file, whole or not at all; `read_merl` gives back the same values and mask.

    Cells that are not valid become -1; a gray table is written three times. Tabulate a model with
    `HalfDifferenceTable.of`. Raises `FileError` where the table is not 90 x 90 x 180, or the path cannot be written.
    """
    shape = table.values.shape[:3]
    if shape != MERL_SHAPE:
        raise FileError(f"{path}: the table has {shape} cells, MERL's files {MERL_SHAPE}. Tabulate it anew.")
    planes = np.where(table.valid[..., None], table.values.astype(np.float64) / _SCALES, -1.0)
    with writing(path) as temporary, temporary.open("wb") as stream:
        stream.write(_HEADER.pack(*MERL_SHAPE))
        np.ascontiguousarray(np.moveaxis(planes, -1, 0)).astype("<f8").tofile(stream)
