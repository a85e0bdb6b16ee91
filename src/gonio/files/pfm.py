"""Portable float maps (.pfm): "PF" (colour) or "Pf" (grey), columns and rows, a scale, then float32, bottom row first.

A scale below 0 means little-endian samples. Its magnitude is a unit on which programs disagree (some multiply by it,
some divide): the samples are returned as stored and `info` reports it.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ..errors import FileError
from .raster import ImageInfo, Raster, require_size, truncated

MAGIC = (b"PF", b"Pf")
_HEADER = re.compile(rb"P([Ff])\s+(\d{1,10})\s+(\d{1,10})\s+([-+.0-9eE]{1,40})\s")


def info(path: Path) -> ImageInfo:
    with path.open("rb") as file:
        rows, columns, channels, scale, _ = _header(path, file.read(1024))
    names = ("R", "G", "B") if channels == 3 else ("Y",)
    return ImageInfo("PFM", rows, columns, names, "float32", "linear", {"scale": scale})


def read(path: Path) -> Raster:
    data = path.read_bytes()
    rows, columns, channels, scale, start = _header(path, data[:1024])
    expected = rows * columns * channels * 4
    if len(data) - start < expected:
        raise truncated(path, f"{rows} x {columns} pixels need {expected} bytes, there are {len(data) - start}")
    if len(data) - start > expected:
        raise FileError(f"{path}: {len(data) - start - expected} bytes follow the last pixel. The header is wrong.")
    samples = np.frombuffer(data, "<f4" if scale < 0 else ">f4", offset=start).reshape(rows, columns, channels)
    return Raster(samples[::-1].astype(np.float32), "linear")


def write(path: Path, image: np.ndarray) -> None:
    rows, columns, channels = image.shape
    head = f"{'PF' if channels == 3 else 'Pf'}\n{columns} {rows}\n-1.0\n"
    path.write_bytes(head.encode() + image[::-1].astype("<f4").tobytes())


def _header(path: Path, head: bytes) -> tuple[int, int, int, float, int]:
    found = _HEADER.match(head)
    if not found:
        raise FileError(f"{path}: not the header of a PFM: {head[:20]!r}, expected such as PF, 640 480, -1.0.")
    channels, columns, rows = 3 if found[1] == b"F" else 1, int(found[2]), int(found[3])
    try:
        scale = float(found[4])
    except ValueError:
        scale = 0.0
    if scale == 0 or not np.isfinite(scale):
        raise FileError(f"{path}: the scale is {found[4].decode()}, expected a number other than 0, such as -1.0.")
    require_size(path, rows, columns, channels)
    return rows, columns, channels, scale, found.end()
