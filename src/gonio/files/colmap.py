"""Cameras of photographs as structure from motion writes them: COLMAP's sparse models, text and binary.

    cameras.txt        CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]
    images.txt         two lines each: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then X Y POINT3D_ID of its points;
                       world to camera, OpenCV's axes (x right, y down, z forward)
    cameras.bin        u64 count;  u32 id, i32 model, u64 width, height, f64 params[]              little-endian
    images.bin         u64 count;  u32 id, f64 q[4], t[3], u32 camera, name, 0, u64 points, (f64 x, y, i64 id)[points]

The centre of the first pixel is at (1/2, 1/2), as in gonio. The world has no agreed up and no scale, and nothing is
turned here. Sources: colmap.github.io/format.html and cameras.html. Not here: points of the scene, fisheye lenses,
rigs, the photographs themselves.
"""

from __future__ import annotations

import dataclasses
import math
import os
import re
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from ..cameras import Pinhole, from_colmap
from ..errors import FileError, GonioError

_LONGEST = 2**24  # bytes of a line of images.txt: some hundred thousand points in one photograph
_LONGEST_NAME = 4096  # bytes

# The lens models that are read, with their parameters in COLMAP's order. transforms.json has the same names for them.
MODELS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
}
DISTORTION = ("k1", "k2", "p1", "p2", "k3")  # in the order of `Pinhole.distortion`

# COLMAP's models by the number that its binary files give them; those that are not read are refused by these names.
_NUMBERED = (
    *MODELS,
    "OPENCV_FISHEYE",
    "FULL_OPENCV",
    "FOV",
    "SIMPLE_RADIAL_FISHEYE",
    "RADIAL_FISHEYE",
    "THIN_PRISM_FISHEYE",
    "RAD_TAN_THIN_PRISM_FISHEYE",
    "SIMPLE_DIVISION",
    "DIVISION",
    "SIMPLE_FISHEYE",
    "FISHEYE",
    "EUCM",
    "EQUIRECTANGULAR",
)
_POSE = ("QW", "QX", "QY", "QZ", "TX", "TY", "TZ")


def read_model(path: Path) -> dict[str, Pinhole]:
    """The cameras of COLMAP's model that `path`, cameras or images, .txt or .bin, is of, by their photographs' names.

    Errors are those of `read_cameras`.
    """
    if path.suffix == ".bin":
        return _binary_images(path.with_name("images.bin"), _binary_cameras(path.with_name("cameras.bin")))
    return _text_images(path.with_name("images.txt"), _text_cameras(path.with_name("cameras.txt")))


def finite(where: str, name: str, value: str | float) -> float:
    """`value` as a finite number; otherwise a `FileError` that begins with `where` and names it."""
    try:
        number = float(value)
    except (ValueError, OverflowError):
        raise FileError(f"{where}: {name} = {value!s:.60} is no number that fits.") from None
    if not math.isfinite(number):
        raise FileError(f"{where}: {name} = {number} is not finite.")
    return number


def _colmap_camera(where: str, model: str, columns: int, rows: int, parameters: list[Any]) -> Pinhole:
    """The camera of COLMAP's model, standing at the origin."""
    if model not in MODELS:
        raise FileError(
            f"{where}: the camera model {model:.60} is not read; {', '.join(MODELS)} are. "
            "COLMAP's image_undistorter makes PINHOLE of it."
        )
    names = MODELS[model]
    if len(parameters) != len(names):
        raise FileError(f"{where}: {model} has {len(names)} parameters, {' '.join(names)}; {len(parameters)} came.")
    lens = {name: finite(where, name, value) for name, value in zip(names, parameters, strict=True)}
    k1, k2, p1, p2, k3 = (lens.get(name, 0.0) for name in DISTORTION)
    try:
        return Pinhole(
            size=(rows, columns),
            fx=lens["f" if "f" in lens else "fx"],
            fy=lens["f" if "f" in lens else "fy"],
            cx=lens["cx"],
            cy=lens["cy"],
            distortion=(k1, k2, p1, p2, k3),
        )
    except GonioError as error:
        raise FileError(f"{where}: {error}") from error


def _placed(where: str, cameras: Mapping[int, Pinhole], camera: int, pose: list[Any]) -> Pinhole:
    """The camera of that number at COLMAP's `pose`, QW to TZ."""
    if camera not in cameras:
        raise FileError(f"{where}: CAMERA_ID {camera} does not stand among the cameras.")
    numbers = [finite(where, name, value) for name, value in zip(_POSE, pose, strict=True)]
    try:
        return dataclasses.replace(cameras[camera], pose=from_colmap(numbers[:4], numbers[4:]))
    except GonioError as error:
        raise FileError(f"{where}: {error}") from error


def _text_cameras(path: Path) -> dict[int, Pinhole]:
    cameras: dict[int, Pinhole] = {}
    stated = None
    for number, line in _lines(path):
        where = f"{path}: line {number}"
        words = line.split()
        if not words or words[0].startswith("#"):
            stated = _stated(line, "cameras", stated)
            continue
        if len(words) < 4:
            raise FileError(f"{where} is {line.strip()!r:.60}; CAMERA_ID MODEL WIDTH HEIGHT PARAMS[] is wanted.")
        camera = _whole(where, "CAMERA_ID", words[0])
        if camera in cameras:
            raise FileError(f"{where}: CAMERA_ID {camera} stands in the file twice.")
        size = _whole(where, "WIDTH", words[2]), _whole(where, "HEIGHT", words[3])
        cameras[camera] = _colmap_camera(where, words[1], *size, words[4:])
    _require_count(path, "cameras", stated, len(cameras))
    return cameras


def _text_images(path: Path, cameras: Mapping[int, Pinhole]) -> dict[str, Pinhole]:
    images: dict[str, Pinhole] = {}
    stated = None
    lines = _lines(path)
    for number, line in lines:
        where = f"{path}: line {number}"
        words = line.split(maxsplit=9)  # a name may hold spaces
        if not words or words[0].startswith("#"):
            stated = _stated(line, "images", stated)
            continue
        if len(words) != 10:
            raise FileError(f"{where} is {line.strip()!r:.60}; IMAGE_ID {' '.join(_POSE)} CAMERA_ID NAME is wanted.")
        name = words[9].strip()
        if name in images:
            raise FileError(f"{where}: NAME {name!r} has two cameras.")
        images[name] = _placed(where, cameras, _whole(where, "CAMERA_ID", words[8]), words[1:8])
        number, line = next(lines, (number + 1, ""))
        if not line:
            raise FileError(f"{path} is cut short: line {number}, the points of {name!r}, is wanted; it may be empty.")
        # Without its line of points, an image would swallow the next one.
        points = line.split()
        if len(points) % 3 or not all(_is_id(word) for word in points[2::3]):
            raise FileError(f"{path}: line {number} is no points X Y POINT3D_ID of {name!r}, or is cut short.")
    _require_count(path, "images", stated, len(images))
    return images


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Lines with their numbers from 1; no more than one is held, since COLMAP's images.txt can be very large."""
    number = 1
    try:
        with path.open("rb") as stream:
            while line := stream.readline(_LONGEST + 1):
                if len(line) > _LONGEST:
                    raise FileError(f"{path}: line {number} has more than {_LONGEST} bytes.")
                yield number, line.decode("utf-8-sig")
                number += 1
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error
    except UnicodeDecodeError as error:
        raise FileError(f"{path}: line {number} is no text.") from error


def _stated(line: str, what: str, before: int | None) -> int | None:
    """How many there are by the comment that COLMAP writes."""
    match = re.match(rf"\s*#\s*Number of {what}:\s*(\d{{1,18}})\b", line)
    return int(match[1]) if match else before


def _require_count(path: Path, what: str, stated: int | None, count: int) -> None:
    if stated not in (None, count):
        raise FileError(
            f"{path}: its comment says {stated} {what}, {count} follow. It is cut short, or the comment is out of date."
        )


def _whole(where: str, name: str, word: str) -> int:
    if not re.fullmatch(r"[0-9]{1,18}", word):
        raise FileError(f"{where}: {name} = {word:.60} is no whole number.")
    return int(word)


def _is_id(word: str) -> bool:
    return word.removeprefix("-").isdecimal()


def _binary_cameras(path: Path) -> dict[int, Pinhole]:
    cameras: dict[int, Pinhole] = {}
    with _Records(path) as records:
        count = records.count("cameras", 24)
        for k in range(count):
            what = f"camera {k + 1} of {count}"
            where = f"{path}: {what}"
            camera, number, columns, rows = records.take("<IiQQ", what)
            model = _NUMBERED[number] if 0 <= number < len(_NUMBERED) else f"number {number}"
            parameters = records.take(f"<{len(MODELS.get(model, ()))}d", what)
            if camera in cameras:
                raise FileError(f"{where}: CAMERA_ID {camera} stands in the file twice.")
            cameras[camera] = _colmap_camera(where, model, columns, rows, list(parameters))
        records.require_end()
    return cameras


def _binary_images(path: Path, cameras: Mapping[int, Pinhole]) -> dict[str, Pinhole]:
    images: dict[str, Pinhole] = {}
    with _Records(path) as records:
        count = records.count("images", 73)
        for k in range(count):
            what = f"image {k + 1} of {count}"
            where = f"{path}: {what}"
            _, *pose, camera = records.take("<I7dI", what)
            name = records.name(what)
            if name in images:
                raise FileError(f"{where}: NAME {name!r} has two cameras.")
            images[name] = _placed(where, cameras, camera, pose)
            (points,) = records.take("<Q", what)
            records.skip(24 * points, f"the {points} points of {what}")
        records.require_end()
    return images


class _Records:
    """A binary file read from front to back, never past its end: every size is held against what is left."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self.left = path.stat().st_size
            self.stream = path.open("rb")
        except OSError as error:
            raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error

    def __enter__(self) -> _Records:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.stream.close()

    def take(self, form: str, what: str) -> tuple[Any, ...]:
        size = struct.calcsize(form)
        content = self.stream.read(size) if size <= self.left else b""
        if len(content) != size:
            raise FileError(f"{self.path} is cut short: it ends within {what}.")
        self.left -= size
        return struct.unpack(form, content)

    def count(self, what: str, least: int) -> int:
        """How many records there are, each of at `least` so many bytes."""
        (count,) = self.take("<Q", f"the number of {what}")
        if count * least > self.left:
            raise FileError(f"{self.path}: {count} {what} cannot stand in the {self.left} bytes that follow.")
        return int(count)

    def name(self, what: str) -> str:
        """Text up to the byte 0."""
        content = self.stream.read(min(self.left, _LONGEST_NAME))
        end = content.find(0)
        if end < 0:
            raise FileError(f"{self.path}: the NAME of {what} does not end; the file is cut short or damaged.")
        self.stream.seek(end + 1 - len(content), os.SEEK_CUR)
        self.left -= end + 1
        try:
            return content[:end].decode("utf-8")
        except UnicodeDecodeError as error:
            raise FileError(f"{self.path}: the NAME of {what} is no text.") from error

    def skip(self, size: int, what: str) -> None:
        if size > self.left:
            raise FileError(f"{self.path} is cut short: it ends within {what}.")
        self.stream.seek(size, os.SEEK_CUR)
        self.left -= size

    def require_end(self) -> None:
        if self.left:
            raise FileError(f"{self.path} has {self.left} bytes after its last record.")
