"""Targa images (.tga): grey or true colour, 8, 24 or 32 bits, with or without run-length code.

Truevision TGA file format specification, version 2.0 (1991). The descriptor byte names the corner where pixels start,
by default the lower left. Not here: colour maps and 15- or 16-bit pixels.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from ..errors import FileError
from .raster import ImageInfo, Raster, require_size, truncated


def info(path: Path) -> ImageInfo:
    with path.open("rb") as file:
        rows, columns, width, alpha_bits, _, _, _ = _header(path, file.read(18))
    names = ("Y",) if width == 1 else ("R", "G", "B") + (("A",) if alpha_bits else ())
    return ImageInfo("Targa", rows, columns, names, "uint8", None)


def read(path: Path) -> Raster:
    from .._kernels.runs import decode_targa

    data = path.read_bytes()
    rows, columns, width, alpha_bits, packed, flips, start = _header(path, data)
    body = np.frombuffer(data, np.uint8)[start:]
    if packed:
        pixels = np.empty((rows * columns, width), np.uint8)
        complete = decode_targa(body, pixels) >= 0
    else:
        complete = len(body) >= rows * columns * width
        pixels = body[: rows * columns * width]
    if not complete:
        raise truncated(path, f"its pixels end before {rows} x {columns} are read, or their code is damaged")
    pixels = pixels.reshape(rows, columns, width)[flips]
    samples = np.ascontiguousarray(pixels[..., 2::-1] if width > 1 else pixels)
    # Without alpha bits in the descriptor the fourth byte means nothing, and often is 0.
    return Raster(samples, None, pixels[..., 3] if alpha_bits else None)


def _header(path: Path, head: bytes) -> tuple[int, int, int, int, bool, tuple[slice, slice], int]:
    if len(head) < 18:
        raise truncated(path, "a Targa header has 18 bytes")
    skip, mapped, kind, map_length, map_bits = struct.unpack_from("<BBB2xHB", head)
    columns, rows, bits, descriptor = struct.unpack_from("<HHBB", head, 12)
    if kind not in (2, 3, 10, 11) or bits not in ((8,) if kind in (3, 11) else (24, 32)) or mapped > 1:
        raise FileError(
            f"{path}: Targa image type {kind} of {bits} bits is not read, only grey of 8 and true colour of 24 and 32. "
            "Save it as PNG."
        )
    require_size(path, rows, columns, bits // 8)
    # Bit 5: rows run down; bit 4: columns run leftwards.
    flips = slice(None, None, 1 if descriptor & 32 else -1), slice(None, None, -1 if descriptor & 16 else 1)
    start = 18 + skip + (map_length * ((map_bits + 7) // 8) if mapped else 0)
    return rows, columns, bits // 8, descriptor & 15 if bits == 32 else 0, kind >= 10, flips, start
