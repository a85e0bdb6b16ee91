"""How long a photograph was exposed, and at what aperture and ISO, as its EXIF says.

    ExposureTime 0x829A, FNumber 0x829D, PhotographicSensitivity 0x8827        CIPA DC-008 (Exif 2.32), 4.6.5
    exposure = t,  or  t (ISO / 100) / N^2  where aperture or ISO differ        exposures

EXIF is a TIFF directory: in JPEG behind "Exif" in an APP1 segment, in PNG in the chunk eXIf, in TIFF and the raw files
built on it (DNG, NEF, CR2, ARW, ...) the file itself. Its times are nominal: 1/60 may be 1/64 s, so that ratios of two
are a few percent off. Not here: other formats, makers' notes, and writing.
"""

from __future__ import annotations

import mmap
import os
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from ..errors import FileError
from .raster import require_file

_TIME, _APERTURE, _ISO, _EXIF = 0x829A, 0x829D, 0x8827, 0x8769
_ORDERS = {b"II*\0": "<", b"MM\0*": ">"}
_SHORT, _LONG, _RATIONAL = 3, 4, 5
_BEYOND = 65535  # an ISO that a short cannot hold


class ExposureSettings(NamedTuple):
    """seconds, the f-number N, and ISO of a photograph; None where its EXIF does not say."""

    seconds: float | None
    aperture: float | None
    iso: float | None


def exposure_settings(path: str | os.PathLike[str]) -> ExposureSettings:
    """What the EXIF of a JPEG, PNG, TIFF or TIFF-like raw file says; None for what it does not, damaged or not.

    Raises `FileError` where the file is missing or empty.
    """
    path = Path(path)
    require_file(path)
    try:
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            return _settings(data)
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error


def exposure_time(path: str | os.PathLike[str]) -> float:
    """Seconds, as the EXIF of a photograph says. Raises `FileError` where it does not."""
    seconds = exposure_settings(path).seconds
    if seconds is None:
        raise FileError(f"{path} says no exposure time: it has no EXIF that can be read, or none with it. Give times.")
    return seconds


def exposures(paths: Sequence[str | os.PathLike[str]]) -> tuple[tuple[float, ...], str]:
    """What photographs of one scene were exposed for, in seconds, and a note where that is not their times alone.

    Where aperture or ISO differ, seconds are those at f/1 and ISO 100 that expose alike: t (ISO / 100) / N^2. Noise and
    vignetting differ then, too, and depth of field. Raises `FileError` where a photograph says no time, or some say
    aperture or ISO and others not.
    """
    times = tuple(exposure_time(path) for path in paths)
    factors, differing = [1.0] * len(times), []
    found = [exposure_settings(path) for path in paths]
    for name, values in (("aperture", [s.aperture for s in found]), ("ISO", [s.iso for s in found])):
        if len(set(values)) < 2:
            continue
        if None in values:
            raise FileError(f"{paths[values.index(None)]} says no {name}, but others do. Give times.")
        differing.append(name)
    if differing:
        factors = [(iso or 100) / 100 / (aperture or 1) ** 2 for _, aperture, iso in found]
    differ = " and ".join(differing) + (" differ" if len(differing) > 1 else " differs")
    note = f"{differ}: times are those at f/1 and ISO 100" if differing else ""
    return tuple(t * factor for t, factor in zip(times, factors, strict=True)), note


def _settings(data: mmap.mmap) -> ExposureSettings:
    base = _tiff(data)
    order = _ORDERS.get(data[base : base + 4]) if base is not None else None
    if base is None or order is None:
        return ExposureSettings(None, None, None)
    tags: dict[int, float] = {}
    try:
        (first,) = struct.unpack_from(order + "I", data, base + 4)
        tags = _directory(data, base, order, first)
        if _EXIF in tags:
            tags |= _directory(data, base, order, int(tags[_EXIF]))
    except struct.error:  # what lies before the damage counts
        pass
    iso = tags.get(_ISO)
    return ExposureSettings(tags.get(_TIME), tags.get(_APERTURE), None if iso == _BEYOND else iso)


def _tiff(data: mmap.mmap) -> int | None:
    """Where the TIFF directory of a file begins; None where there is none."""
    head = data[:8]
    if head[:4] in _ORDERS:
        return 0
    try:
        if head[:3] == b"\xff\xd8\xff":
            return _in_jpeg(data)
        if head == b"\x89PNG\r\n\x1a\n":
            return _in_png(data)
    except struct.error:
        pass
    return None


def _in_jpeg(data: mmap.mmap) -> int | None:
    at = 2
    while data[at : at + 1] == b"\xff":
        marker, length = struct.unpack_from(">BH", data, at + 1)
        if marker == 0xFF:  # fill byte
            at += 1
            continue
        if marker == 0xE1 and data[at + 4 : at + 10] == b"Exif\0\0":
            return at + 10
        if marker in (0xDA, 0xD9) or length < 2:
            return None
        at += 2 + length
    return None


def _in_png(data: mmap.mmap) -> int | None:
    at = 8
    while True:
        length, name = struct.unpack_from(">I4s", data, at)
        if name == b"eXIf":
            return at + 8
        if name == b"IEND":
            return None
        at += 12 + int(length)


def _directory(data: mmap.mmap, base: int, order: str, at: int) -> dict[int, float]:
    """The positive numbers among the tags wanted here."""
    tags: dict[int, float] = {}
    (count,) = struct.unpack_from(order + "H", data, base + at)
    for k in range(count):
        entry = base + at + 2 + 12 * k
        tag, kind = struct.unpack_from(order + "HH", data, entry)
        value = 0.0
        if tag in (_TIME, _APERTURE) and kind == _RATIONAL:
            (place,) = struct.unpack_from(order + "I", data, entry + 8)
            over, under = struct.unpack_from(order + "II", data, base + place)
            value = over / under if under else 0.0
        elif tag in (_ISO, _EXIF) and kind in (_SHORT, _LONG):
            (value,) = struct.unpack_from(order + ("H" if kind == _SHORT else "I"), data, entry + 8)
        if value > 0:
            tags[tag] = float(value)
    return tags
