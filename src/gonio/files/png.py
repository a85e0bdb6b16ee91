"""PNG images (W3C Recommendation, third edition): 8 and 16 bits whole, and the chunks that say how samples are encoded.

    sRGB chunk: the sRGB curve     gAMA chunk g: light = sample^(1/g), except 1/2.2, which stands for the sRGB curve

The chunks are checked here, sums and all, so that a damaged file is refused before OpenCV decodes it.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..errors import FileError
from .raster import Encoding, ImageInfo, Raster, by_opencv, opaque, require_size, truncated

MAGIC = (b"\x89PNG\r\n\x1a\n",)
_CHANNELS = {0: ("Y",), 2: ("R", "G", "B"), 3: ("R", "G", "B"), 4: ("Y", "A"), 6: ("R", "G", "B", "A")}
_SAMPLES = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # stored for each pixel, by colour type; 3 is an index
_MOST_DEFLATED = 1032  # deflate packs no more bytes into one


def info(path: Path) -> ImageInfo:
    rows, columns, bits, kind = _size(path, data := path.read_bytes())
    encoding: Encoding | None = None
    names = _CHANNELS[kind]
    for name, body in _chunks(path, data, check=False):
        encoding = _encoding(name, body, encoding)
        if name == b"tRNS":
            names = (*_CHANNELS[kind], "A")
        if name == b"IDAT":
            break
    return ImageInfo("PNG", rows, columns, names, "uint16" if bits == 16 else "uint8", encoding)


def read(path: Path) -> Raster:
    import cv2

    data = path.read_bytes()
    rows, columns, bits, kind = _size(path, data)
    encoding: Encoding | None = None
    packed = 0
    for name, body in _chunks(path, data, check=True):
        encoding = _encoding(name, body, encoding)
        packed += len(body) if name == b"IDAT" else 0
    if rows * columns * _SAMPLES[kind] * bits // 8 > packed * _MOST_DEFLATED:
        raise truncated(path, f"{packed} bytes cannot hold {rows} x {columns} pixels")
    samples, alpha = by_opencv(path, np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED, rows, columns)
    if samples.dtype != (np.uint16 if bits == 16 else np.uint8):
        raise FileError(f"{path}: {bits} bits were decoded as {samples.dtype}.")
    if kind in (0, 4) and samples.shape[2] == 3:
        samples = samples[..., :1]  # grey with alpha comes as colour
    return Raster(samples, encoding, None if alpha is None or opaque(alpha) else alpha)


def write(path: Path, codes: np.ndarray, encoding: Encoding) -> None:
    """Writes (rows, columns, 1 or 3), uint8 or uint16, and the chunk that states their encoding."""
    import cv2

    _, encoded = cv2.imencode(".png", codes[..., ::-1])
    if encoding == "srgb":
        name, body = b"sRGB", b"\0"  # rendering intent: perceptual
    else:
        name, body = b"gAMA", struct.pack(">I", round(1e5 / (1.0 if isinstance(encoding, str) else encoding)))
    data = encoded.tobytes()
    chunk = struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
    first = 8 + 25  # signature and IHDR, which must come first
    path.write_bytes(data[:first] + chunk + data[first:])


def _size(path: Path, data: bytes) -> tuple[int, int, int, int]:
    """Rows, columns, bits for each sample, colour type."""
    if len(data) < 33 or data[12:16] != b"IHDR":
        raise truncated(path, "a PNG starts with its IHDR chunk")
    columns, rows, bits, kind = struct.unpack_from(">IIBB", data, 16)
    if kind not in _CHANNELS or bits not in (1, 2, 4, 8, 16):
        raise FileError(f"{path}: the header says colour type {kind} of {bits} bits, which no PNG has.")
    require_size(path, rows, columns, len(_CHANNELS[kind]))
    return rows, columns, bits, kind


def _chunks(path: Path, data: bytes, check: bool) -> Iterator[tuple[bytes, memoryview]]:
    view = memoryview(data)
    at = 8
    while at + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, at)
        name = data[at + 4 : at + 8]
        if at + 12 + length > len(data):
            raise truncated(path, f"chunk {name!r} of {length} bytes runs past the end")
        if check and zlib.crc32(view[at + 4 : at + 8 + length]) != struct.unpack_from(">I", data, at + 8 + length)[0]:
            raise FileError(f"{path} is damaged: the check sum of chunk {name!r} is wrong. Copy or download it again.")
        yield name, view[at + 8 : at + 8 + length]
        if name == b"IEND":
            return
        at += 12 + length
    raise truncated(path, "there is no IEND chunk")


def _encoding(name: bytes, body: memoryview, before: Encoding | None) -> Encoding | None:
    if name == b"sRGB":
        return "srgb"
    if name == b"gAMA" and len(body) == 4 and before != "srgb":
        g = struct.unpack(">I", body)[0]
        if g in (45454, 45455):
            return "srgb"
        return "linear" if g == 100000 else 1e5 / g if g else None
    return before
