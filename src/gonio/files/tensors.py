"""Tensor files: named arrays in one binary file, the container of RGL's materials and of Mitsuba's grids.

    "tensor_file\\0"   u8 major, u8 minor   u32 fields                                    little-endian throughout
    each field:  u16 length, name   u16 ndim   u8 dtype   u64 offset   u64 shape[ndim]
    then the arrays at their offsets, C order

Every number of the header is checked against the file's size before memory is taken; nothing in a file is run.
Not here: what the arrays mean (`rgl.py`).
"""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..errors import FileError
from .whole import writing

MAGIC = b"tensor_file\0"
_DTYPES = {1: "u1", 2: "i1", 3: "u2", 4: "i2", 5: "u4", 6: "i4", 7: "u8", 8: "i8", 9: "f2", 10: "f4", 11: "f8"}
_ALIGNMENT = 8


def read_tensors(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """The arrays of a tensor file by name, read-only views of one copy of the file.

    Raises `FileError` where the file is cut short, is no tensor file, or a field reaches beyond its end.
    """
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error
    if content[: len(MAGIC)] != MAGIC:
        raise FileError(f"{path} does not begin with 'tensor_file': it is no tensor file (.bsdf, .vol).")
    at = len(MAGIC)

    def take(form: str, what: str) -> tuple[int, ...]:
        nonlocal at
        width = struct.calcsize(form)
        if at + width > len(content):
            raise FileError(f"{path}: the header ends within {what}.")
        values = struct.unpack_from(form, content, at)
        at += width
        return values

    major, minor, count = take("<BBI", "the version and number of fields")
    if (major, minor) != (1, 0):
        raise FileError(f"{path}: version {major}.{minor} of the tensor format is not known; 1.0 is.")
    tensors: dict[str, np.ndarray] = {}
    for k in range(count):
        (length,) = take("<H", f"field {k} of {count}")
        name = content[at : at + length].decode("utf-8", "replace")
        at += length
        ndim, dtype, offset = take("<HBQ", f"field {name!r}")
        shape = take(f"<{ndim}Q", f"field {name!r}")
        if dtype not in _DTYPES:
            raise FileError(f"{path}: field {name!r} has dtype {dtype}; 1 to 11 are known.")
        if name in tensors:
            raise FileError(f"{path}: field {name!r} stands in the file twice.")
        if ndim > 16:
            raise FileError(f"{path}: field {name!r} has {ndim} dimensions; at most 16 make sense.")
        size = math.prod(shape)  # Python's integers: no header makes this overflow
        kind = np.dtype("<" + _DTYPES[dtype])
        if offset + size * kind.itemsize > len(content) or max(shape, default=0) > len(content):
            raise FileError(
                f"{path}: field {name!r} of shape {shape} begins at byte {offset} and takes {size * kind.itemsize}, "
                f"but the file has {len(content)}."
            )
        tensors[name] = np.frombuffer(content, kind, size, offset).reshape(shape)
    return tensors


def write_tensors(path: str | os.PathLike[str], tensors: Mapping[str, np.ndarray]) -> None:
    """Writes arrays by name as a tensor file, whole or not at all; `read_tensors` gives them back.

    Raises `FileError` where an array's dtype has no place in the format, or the path cannot be written.
    """
    codes = {np.dtype(form): code for code, form in _DTYPES.items()}
    arrays = {name: np.asarray(array) for name, array in tensors.items()}
    for name, array in arrays.items():
        if array.dtype.newbyteorder("=") not in codes:
            raise FileError(f"{path}: field {name!r} has dtype {array.dtype}, which tensor files cannot hold.")
    names = {name: name.encode() for name in arrays}
    at = len(MAGIC) + 6 + sum(13 + len(names[name]) + 8 * array.ndim for name, array in arrays.items())
    header = bytearray(MAGIC + struct.pack("<BBI", 1, 0, len(arrays)))
    body = bytearray()
    for name, array in arrays.items():
        padding = -(at + len(body)) % _ALIGNMENT
        body += bytes(padding)
        header += struct.pack("<H", len(names[name])) + names[name]
        code = codes[array.dtype.newbyteorder("=")]
        header += struct.pack(f"<HBQ{array.ndim}Q", array.ndim, code, at + len(body), *array.shape)
        body += array.astype(array.dtype.newbyteorder("<"), copy=False).tobytes()
    with writing(path) as temporary:
        temporary.write_bytes(header + body)
