"""Radiance pictures (.hdr, .pic): three mantissas and one exponent, 8 bits each.

    colour = mantissa 2^(exponent - 136) / EXPOSURE,   black where the exponent is 0

Ward 1991 ("Real Pixels") and the Radiance reference manual, "Picture file format". Mantissas are rounded to the nearest
when written and taken as they are when read, as most programs do (Ward's own cut them and add a half).
The scanlines may be stored in any of the eight orders that the resolution line can name, and by any of three codes.
Not here: XYZE pictures.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import FileError
from .raster import ImageInfo, Raster, require_size, truncated

MAGIC = (b"#?RADIANCE", b"#?RGBE")
_RESOLUTION = re.compile(rb"([+-])([XY]) +(\d{1,9}) +([+-])([XY]) +(\d{1,9})\s*\Z")
_LONGEST_HEADER = 1 << 16
LARGEST = 255 * 2.0**119


class _Header(NamedTuple):
    fields: dict[str, Any]
    order: str  # of the scanlines: "-Y+X" is top to bottom, each from left to right
    rows: int
    columns: int
    multiplier: np.ndarray  # that the header says was applied to each channel
    size: int


def info(path: Path) -> ImageInfo:
    with path.open("rb") as file:
        header = _header(path, file.read(_LONGEST_HEADER))
    attributes = header.fields | {"orientation": header.order}
    names, dtype = ("R", "G", "B"), "8-bit mantissas with a common exponent"
    return ImageInfo("Radiance", header.rows, header.columns, names, dtype, "linear", attributes)


def read(path: Path) -> Raster:
    """Colours divided by the header's EXPOSURE and COLORCORR: the light in the scene, as the format has it."""
    from .._kernels.runs import decode_radiance

    data = path.read_bytes()
    header = _header(path, data[:_LONGEST_HEADER])
    order, rows, columns = header.order, header.rows, header.columns
    rgbe = np.empty((rows, columns, 4) if order[1] == "Y" else (columns, rows, 4), np.uint8)
    if decode_radiance(np.frombuffer(data, np.uint8)[header.size :], rgbe) < 0:
        raise truncated(path, f"its pixels end before {rows} x {columns} are read, or their code is damaged")

    if order[1] == "X":
        rgbe = rgbe.swapaxes(0, 1)
    rgbe = rgbe[:: -1 if "+Y" in order else 1, :: -1 if "-X" in order else 1]
    # Exact in single precision: eight bits times a power of two, not below its smallest number.
    scale = np.ldexp(np.float32(1), rgbe[..., 3].astype(np.int16) - 136)
    scale[rgbe[..., 3] == 0] = 0
    colour: np.ndarray = rgbe[..., :3] * scale[..., None]
    if np.any(header.multiplier != 1):
        colour = colour / header.multiplier.astype(np.float32)
    return Raster(colour, "linear")


def write(path: Path, image: np.ndarray, attributes: Mapping[str, str] | None = None) -> None:
    """Writes (rows, columns, 1 or 3), 0 to `LARGEST`, without run-length code, which every reader understands.

    Each channel is right to 1/256 of the pixel's largest one; what is below 2^-128 becomes black.
    attributes: lines name=text of the header.
    """
    largest = functools.reduce(np.maximum, np.moveaxis(image, -1, 0))  # quicker than image.max(axis=-1)
    exponent = np.frexp(largest)[1]
    # A mantissa of 255.5 and more rounds to 256, which takes the next exponent.
    exponent += np.rint(np.ldexp(largest, 8 - exponent)) > 255
    rgbe = np.empty((*largest.shape, 4), np.uint8)
    rgbe[..., :3] = np.rint(np.ldexp(image, (8 - exponent)[..., None]))
    rgbe[..., 3] = exponent + 128
    rgbe[(exponent < -127) | (largest == 0)] = 0
    rows, columns = largest.shape
    lines = "".join(f"{name}={text}\n" for name, text in (attributes or {}).items())
    head = f"#?RADIANCE\n# Written by gonio\n{lines}FORMAT=32-bit_rle_rgbe\n\n-Y {rows} +X {columns}\n"
    path.write_bytes(head.encode() + rgbe.tobytes())


def _header(path: Path, head: bytes) -> _Header:
    end = head.find(b"\n\n")
    stop = head.find(b"\n", end + 2) if end >= 0 else -1
    if stop < 0:
        raise truncated(path, "the Radiance header has no end")
    line = head[end + 2 : stop]
    found = _RESOLUTION.match(line)
    if not found or found[2] == found[5]:
        raise FileError(f"{path}: the resolution line is {line[:40]!r}, expected one such as -Y 512 +X 1024.")
    order = (found[1] + found[2] + found[4] + found[5]).decode()
    rows, columns = (int(found[3]), int(found[6])) if order[1] == "Y" else (int(found[6]), int(found[3]))
    require_size(path, rows, columns)

    fields: dict[str, Any] = {}
    multiplier = np.ones(3)
    for text in head[:end].decode("latin-1").splitlines():
        name, equals, value = text.partition("=")
        if text.startswith("#") or not equals:
            continue
        fields[name] = value.strip()
        if name == "EXPOSURE":
            # Each program that scales the picture adds a line; FreeImage writes 0 where it knows none.
            multiplier *= _numbers(path, text, value, 1)[0] or 1.0
        elif name == "COLORCORR":
            multiplier *= _numbers(path, text, value, 3)
        elif name == "FORMAT" and fields[name] != "32-bit_rle_rgbe":
            raise FileError(f"{path}: {text:.60} is not read. Convert it to 32-bit_rle_rgbe (ra_xyze -r).")
        elif name == "GAMMA" and _numbers(path, text, value, 1)[0] != 1:
            raise FileError(f"{path}: {text:.60}, but Radiance pictures are linear. Remove the line if it is wrong.")
    if not np.all(multiplier > 0):
        raise FileError(f"{path}: COLORCORR={fields['COLORCORR']:.60} in the header takes a channel away.")
    return _Header(fields, order, rows, columns, multiplier, stop + 1)


def _numbers(path: Path, line: str, text: str, count: int) -> list[float]:
    try:
        numbers = [float(t) for t in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(0 <= n < np.inf for n in numbers):
        raise FileError(f"{path}: {line:.60} in the header, expected {count} number(s), at least 0.")
    return numbers
