""".gonio files: a ZIP of numbers and words, for what has no format of its own.

    gonio.json      {"gonio": kind, "version": 1, ...fields}
    NAME.npy        arrays, as NumPy writes them, without objects

Nothing in it is ever run: arrays are read without pickle, and no larger than the file says and the memory limit allows.
Each kind has its own file beside this one (`shrm.py`).
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MEMORY_LIMIT, FileError
from .raster import require_file
from .whole import writing

_MANIFEST = "gonio.json"
_LONGEST_MANIFEST = 1 << 20
_DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError, KeyError, RuntimeError)


def write_archive(
    path: str | os.PathLike[str], kind: str, version: int, fields: dict[str, Any], arrays: dict[str, np.ndarray]
) -> None:
    """Write `fields`, which JSON can hold, and `arrays`, whole or not at all. Raises `FileError` as `writing` does."""
    manifest = json.dumps({"gonio": kind, "version": version, **fields}, indent=1, ensure_ascii=False, allow_nan=False)
    with writing(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(_entry(_MANIFEST), manifest)
        for name, array in arrays.items():
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.asarray(array, order="C"), allow_pickle=False)
            archive.writestr(_entry(f"{name}.npy"), buffer.getvalue())


def read_archive(
    path: str | os.PathLike[str], kind: str, version: int, memory_limit: int = MEMORY_LIMIT
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The fields and arrays of a `kind` of file, of this version or an older one.

    Raises `FileError` where the file is none, of another kind, newer, damaged, or its arrays exceed `memory_limit`.
    """
    with _opened(path) as (archive, entries, fields):
        _require_kind(path, fields, kind, version)
        arrays, left = {}, memory_limit
        for name, entry in entries.items():
            if name.endswith(".npy"):
                arrays[name.removesuffix(".npy")] = array = _array(path, archive, entry, left)
                left -= array.nbytes
    return fields, arrays


def required(path: str | os.PathLike[str], arrays: dict[str, np.ndarray], name: str) -> np.ndarray:
    """One of a file's arrays. Raises `FileError` where it has none of that name."""
    if name not in arrays:
        raise FileError(f"{path}: {name}.npy is missing.")
    return arrays[name]


def kind_of(path: str | os.PathLike[str]) -> str:
    """The kind of a .gonio file. Raises `FileError` where it is none."""
    with _opened(path) as (_, _, fields):
        return str(fields.get("gonio")) if isinstance(fields, dict) else ""


@contextlib.contextmanager
def _opened(path: str | os.PathLike[str]) -> Iterator[tuple[zipfile.ZipFile, dict[str, zipfile.ZipInfo], Any]]:
    """The archive, its entries by name, and what its manifest says; damage met while it is read is a `FileError`."""
    require_file(Path(path))
    try:
        with zipfile.ZipFile(path) as archive:
            entries = {entry.filename: entry for entry in archive.infolist()}
            if _MANIFEST not in entries or entries[_MANIFEST].file_size > _LONGEST_MANIFEST:
                raise FileError(f"{path} is no .gonio file: it has no {_MANIFEST}.")
            yield archive, entries, json.loads(archive.read(_MANIFEST))
    except FileError:
        raise
    except _DAMAGE as error:
        raise FileError(f"{path} is damaged, or no .gonio file ({error}). Fetch or write it again.") from error


def _require_kind(path: str | os.PathLike[str], fields: Any, kind: str, version: int) -> None:
    found = fields.get("gonio") if isinstance(fields, dict) else None
    if found != kind:
        raise FileError(f"{path}: the field 'gonio' is {found!r}; a file with {kind!r} is wanted.")
    if not isinstance(fields.get("version"), int) or not 1 <= fields["version"] <= version:
        raise FileError(f"{path}: the field 'version' is {fields.get('version')!r}; this gonio reads 1 to {version}.")


def _array(path: str | os.PathLike[str], archive: zipfile.ZipFile, entry: zipfile.ZipInfo, limit: int) -> np.ndarray:
    with archive.open(entry) as stream:
        version = np.lib.format.read_magic(stream)
        if version != (1, 0):
            raise FileError(f"{path}: {entry.filename} is an array of format {version}; (1, 0) is wanted.")
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream)
        size = math.prod(shape) * dtype.itemsize
        if dtype.kind not in "fiub" or fortran:
            raise FileError(f"{path}: {entry.filename} is {dtype}, or in Fortran's order; plain numbers are wanted.")
        if size != entry.file_size - stream.tell():
            raise FileError(f"{path}: {entry.filename} says it holds {size} bytes of numbers, and has not as many.")
        if size > limit:
            raise FileError(f"{path}: {entry.filename} takes {size / 1e9:.1f} GB, the limit is {limit / 1e9:.1f} GB.")
        return np.frombuffer(stream.read(size), dtype).reshape(shape)


def _entry(name: str) -> zipfile.ZipInfo:
    """An entry without a time: the same contents make the same file."""
    entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
    entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
    return entry
