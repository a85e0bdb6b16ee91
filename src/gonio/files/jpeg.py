"""JPEG photographs: 8 bits, grey or colour, turned upright as their EXIF orientation says.

ITU-T T.81, annex B. The markers are followed to the end of the image, since decoders fill what is missing with grey
and say nothing. A camera's own response curve is in no header: the encoding is never stated.
"""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np

from ..errors import FileError
from .raster import ImageInfo, Raster, by_opencv, require_size, truncated

MAGIC = (b"\xff\xd8\xff",)
_SCAN_ENDS = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")  # a marker other than a stuffed byte or a restart
_FRAMES = {0xC0 + k for k in range(16)} - {0xC4, 0xC8, 0xCC}
_MOST_PIXELS = 512  # in one byte: a block of 8 x 8 takes a bit at least
_NAMES = {1: ("Y",), 3: ("R", "G", "B"), 4: ("C", "M", "Y", "K")}


def info(path: Path) -> ImageInfo:
    rows, columns, channels = _frame(path, path.read_bytes(), whole=False)
    return ImageInfo("JPEG", rows, columns, _NAMES[channels], "uint8", None)


def read(path: Path) -> Raster:
    import cv2

    data = path.read_bytes()
    rows, columns, channels = _frame(path, data, whole=True)
    if channels == 4:
        raise FileError(f"{path} is in CMYK, ink and not light. Save it as RGB.")
    samples, _ = by_opencv(path, np.frombuffer(data, np.uint8), cv2.IMREAD_ANYCOLOR, rows, columns)
    return Raster(samples)


def _frame(path: Path, data: bytes, whole: bool) -> tuple[int, int, int]:
    """Rows and columns of the upright picture, and channels; where `whole`, the markers are followed to the end."""
    frame = None
    turned = False
    at = 2
    while at + 4 <= len(data) or data[at : at + 2] == b"\xff\xd9":
        if data[at] != 0xFF:
            raise FileError(f"{path} is damaged: no JPEG marker at byte {at}. Copy or download it again.")
        marker = data[at + 1]
        if marker == 0xFF:  # fill byte
            at += 1
            continue
        if marker == 0xD9:
            break
        (length,) = struct.unpack_from(">H", data, at + 2)
        if length < 2 or at + 2 + length > len(data):
            break
        if marker == 0xE1:
            turned = turned or _orientation(data[at + 4 : at + 2 + length]) >= 5
        if marker in _FRAMES and length >= 8:
            bits, rows, columns, channels = struct.unpack_from(">BHHB", data, at + 4)
            if bits != 8 or channels not in _NAMES:
                raise FileError(
                    f"{path}: JPEG of {bits} bits and {channels} channels is not read, only of 8 and 1 or 3."
                )
            require_size(path, rows, columns, channels)
            if len(data) * _MOST_PIXELS < rows * columns:
                raise truncated(path, f"{len(data)} bytes cannot hold {rows} x {columns} pixels")
            frame = (columns, rows, channels) if turned else (rows, columns, channels)
            if not whole:
                return frame
        at += 2 + length
        if marker == 0xDA:
            end = _SCAN_ENDS.search(data, at)
            if end is None:
                break
            at = end.start()
    if frame is None or data[at : at + 2] != b"\xff\xd9":
        raise truncated(path, "there is no end-of-image marker")
    return frame


def _orientation(segment: bytes) -> int:
    """Of an EXIF segment, 1 to 8 as in TIFF 6.0: from 5 on, rows and columns change places when OpenCV turns them."""
    order = {b"Exif\0\0II": "<", b"Exif\0\0MM": ">"}.get(segment[:8])
    if order is None:
        return 1
    try:
        (directory,) = struct.unpack_from(order + "I", segment, 10)
        (count,) = struct.unpack_from(order + "H", segment, 6 + directory)
        for k in range(count):
            tag, kind, _, value = struct.unpack_from(order + "HHIH", segment, 8 + directory + 12 * k)
            if (tag, kind) == (274, 3):
                return int(value) if 1 <= value <= 8 else 1
    except struct.error:  # a damaged tag turns nothing
        pass
    return 1
