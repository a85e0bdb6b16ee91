"""What every image format shares: samples as stored, facts of the header, and the first refusals.

Each format is one module with `read(path) -> Raster` and `info(path) -> ImageInfo`. A Raster keeps the samples as the
file has them, 8-bit codes as 8-bit codes; `images` makes linear radiance of them.
"""

from __future__ import annotations

import contextlib
import dataclasses
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError, GonioError

MOST_SAMPLES = 2**30
"""Pixels times channels that gonio reads from one image: 4 GiB as float32. A header that claims more is refused."""

Encoding = str | float
"""How samples stand for light: "linear", "srgb", or the number g of a power law, light = sample^g."""


# What tifffile logs of damaged files, the error says; without a handler it would go to stderr.
logging.getLogger("tifffile").addHandler(logging.NullHandler())


@dataclasses.dataclass(frozen=True, eq=False)
class Raster:
    """One image as stored, its first row at the top.

    samples: (rows, columns, 1 or 3), grey or red, green, blue; uint8, uint16, uint32 or floating.
    encoding: as the file states it, None where it does not; floating samples are linear.
    alpha: (rows, columns) of the samples' dtype, None where all is opaque or colours are already multiplied by it.
    """

    samples: np.ndarray
    encoding: Encoding | None = None
    alpha: np.ndarray | None = None


@dataclasses.dataclass(frozen=True)
class ImageInfo:
    """What an image's header says, its pixels not decoded. `encoding` is None where the file does not state it."""

    format: str
    rows: int
    columns: int
    channels: tuple[str, ...]
    dtype: str
    encoding: Encoding | None
    attributes: dict[str, Any] = dataclasses.field(default_factory=dict)


def require_file(path: Path) -> None:
    """Raises `FileError` where `path` is not a readable file with something in it."""
    try:
        if path.is_dir():
            raise FileError(f"{path} is a folder. Give the name of an image.")
        if not path.exists():
            raise FileError(f"{path} does not exist.")
        if not path.is_file():
            raise FileError(f"{path} is not a regular file.")
        with path.open("rb") as file:
            if not file.read(1):
                raise FileError(f"{path} is empty (0 bytes).")
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error


def require_size(path: Path, rows: int, columns: int, channels: int = 3) -> None:
    """Raises `FileError` where a header's size is nothing or too much, before memory is taken for it."""
    if rows < 1 or columns < 1 or channels < 1:
        raise FileError(f"{path}: the header says {rows} rows, {columns} columns and {channels} channels.")
    if rows * columns * channels > MOST_SAMPLES:
        raise FileError(
            f"{path}: the header says {rows} x {columns} pixels of {channels} channels, more than "
            f"{MOST_SAMPLES} samples. Either the file is broken or it must be cut into tiles."
        )


def truncated(path: Path, what: str) -> FileError:
    return FileError(f"{path} is cut short: {what}. Copy or download it again.")


def by_opencv(
    path: Path, data: np.ndarray, flags: int, rows: int, columns: int
) -> tuple[np.ndarray, np.ndarray | None]:
    """OpenCV's decoding of a file's bytes, in red, green, blue: samples (rows, columns, 1 or 3), and alpha or None."""
    import cv2

    with decoding(path):
        pixels = cv2.imdecode(data, flags)
    if pixels is None:
        raise FileError(f"{path} cannot be decoded: its pixels are damaged.")
    pixels = pixels.reshape(*pixels.shape[:2], -1)
    if pixels.shape[:2] != (rows, columns):
        raise FileError(f"{path}: the header says {rows} x {columns} pixels, {pixels.shape[:2]} were decoded.")
    if pixels.shape[2] == 1:
        return pixels, None
    if pixels.shape[2] == 3:
        return cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB), None
    return cv2.cvtColor(pixels, cv2.COLOR_BGRA2RGB), pixels[..., 3]


def opaque(alpha: np.ndarray) -> bool:
    return bool(np.all(alpha == (np.iinfo(alpha.dtype).max if alpha.dtype.kind == "u" else 1)))


@contextlib.contextmanager
def decoding(path: Path) -> Iterator[None]:
    """Turns whatever a codec raises at a damaged file into a `FileError`."""
    try:
        yield
    except (GonioError, MemoryError):
        raise
    except Exception as error:  # codecs raise what they please: RuntimeError, KeyError, struct.error, ...
        reason = " ".join(str(error).split()) or type(error).__name__
        raise FileError(f"{path} cannot be decoded: {reason:.200}") from error
