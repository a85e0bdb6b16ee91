"""Cameras of several photographs of one scene, as structure from motion and radiance fields write them.

    transforms.json    NeRF, instant-ngp, nerfstudio: w h, fl_x fl_y or camera_angle_x (radians), cx cy, k1 k2 k3 p1 p2,
                       for all photographs or in a frame of its own;
                       frames[]: file_path, transform_matrix camera to world, OpenGL's axes (x right, y up, z back)
    cameras.txt        COLMAP: CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]
    images.txt         two lines each: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then X Y POINT3D_ID of its points;
                       world to camera, OpenCV's axes (x right, y down, z forward)
    cameras.bin        u64 count;  u32 id, i32 model, u64 width, height, f64 params[]              little-endian
    images.bin         u64 count;  u32 id, f64 q[4], t[3], u32 camera, name, 0, u64 points, (f64 x, y, i64 id)[points]

All of them put the centre of the first pixel at (1/2, 1/2), as gonio does. The world is the file's own: COLMAP's has no
agreed up and no scale, and nothing is turned here. Sources: colmap.github.io/format.html and cameras.html,
docs.nerf.studio's data conventions, instant-ngp's loader. Not here: points of the scene, fisheye lenses, rolling
shutters, the photographs themselves.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import re
import struct
from collections import ChainMap
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from ..cameras import Pinhole, from_colmap, from_opengl, to_opengl
from ..errors import FileError, GonioError, ParameterError
from .images import image_info
from .whole import writing

_LARGEST = 2**26  # bytes of a transforms.json: some hundred thousand photographs
_LONGEST = 2**24  # bytes of a line of images.txt: some hundred thousand points in one photograph
_LONGEST_NAME = 4096  # bytes
_TOLERANCE = 1e-3  # how far a matrix may be from a rotation: files written with few digits

_MODELS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
}
_FOCAL = ("fl_x", "fl_y", "camera_angle_x", "camera_angle_y")
_DISTORTION = ("k1", "k2", "p1", "p2", "k3")

# COLMAP's models by the number that its binary files give them; those that are not read are refused by these names.
_NUMBERED = (
    *_MODELS,
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

# Fields of transforms.json that mean another lens, or other axes, than those that are read.
_OTHER = ("is_fisheye", "ftheta_p0", "latlong", "equirectangular", "orthographic", "from_na")


def read_cameras(path: str | os.PathLike[str]) -> dict[str, Pinhole]:
    """The cameras of a scene's photographs by the photographs' names, as the file writes them.

    path: a transforms.json; a folder that holds it or COLMAP's model; or a file of that model, cameras or images, .txt
    or .bin. Of a model in both forms the binary one is taken, as COLMAP does. Where a transforms.json gives no w and h,
    they are those of the photographs, in its folder or below. Rotations are taken to the nearest exact one.

    Raises `FileError`, which names the file and the field or line, where a lens is none of SIMPLE_PINHOLE, PINHOLE,
    SIMPLE_RADIAL, RADIAL and OPENCV, a rotation is off by more than 1e-3, a number is missing or not finite, counts do
    not fit, or a file is cut short.
    """
    path = Path(path)
    if path.is_dir():
        found = [name for name in ("transforms.json", "cameras.bin", "cameras.txt") if (path / name).exists()]
        if not found:
            raise FileError(f"{path} holds no transforms.json, and no cameras.bin or cameras.txt of COLMAP.")
        if found[0] == "transforms.json" and len(found) > 1:
            raise FileError(f"{path} holds {' and '.join(found)}: give one of them.")
        path = path / found[0]
    if path.name in ("cameras.bin", "images.bin"):
        cameras = _binary_images(path.with_name("images.bin"), _binary_cameras(path.with_name("cameras.bin")))
    elif path.name in ("cameras.txt", "images.txt"):
        cameras = _text_images(path.with_name("images.txt"), _text_cameras(path.with_name("cameras.txt")))
    elif path.suffix.lower() == ".json":
        cameras = _transforms(path)
    else:
        raise FileError(f"{path} is neither a transforms.json, nor cameras or images of COLMAP (.txt or .bin).")
    if not cameras:
        raise FileError(f"{path} has no camera of any photograph.")
    return cameras


def write_transforms(path: str | os.PathLike[str], cameras: Mapping[str, Pinhole]) -> None:
    """Write cameras by their photographs' names as a transforms.json, whole or not at all.

    The lens stands once where all photographs share it, otherwise in every frame. `read_cameras` gives the cameras
    back, exact to rounding. instant-ngp knows no k3; nerfstudio reads it as gonio does.

    Raises `ParameterError` where there are no cameras or one is no `Pinhole`, `FileError` where `path` cannot be
    written.
    """
    if not cameras:
        raise ParameterError("cameras is empty; a transforms.json has one for each photograph.")
    for name, camera in cameras.items():
        if not isinstance(camera, Pinhole):
            raise ParameterError(f"cameras[{name!r}] is of {type(camera).__name__}; a transforms.json holds Pinhole.")
    lenses = [_lens(camera) for camera in cameras.values()]
    shared = all(lens == lenses[0] for lens in lenses)
    frames = [
        {"file_path": name, **({} if shared else lens), "transform_matrix": to_opengl(camera.pose).tolist()}
        for (name, camera), lens in zip(cameras.items(), lenses, strict=True)
    ]
    content = {"camera_model": "OPENCV", **(lenses[0] if shared else {}), "frames": frames}
    with writing(path) as temporary:
        temporary.write_text(json.dumps(content, indent=2) + "\n", "utf-8")


def _lens(camera: Pinhole) -> dict[str, float]:
    rows, columns = camera.size
    return {
        "w": columns,
        "h": rows,
        "fl_x": float(camera.fx),
        "fl_y": float(camera.fy),
        "cx": float(camera.cx),
        "cy": float(camera.cy),
        **dict(zip(_DISTORTION, camera.distortion, strict=True)),
        "camera_angle_x": 2 * math.atan2(columns, 2 * camera.fx),  # what the first NeRF's readers look for
    }


def _transforms(path: Path) -> dict[str, Pinhole]:
    try:
        if path.stat().st_size > _LARGEST:
            raise FileError(f"{path} has more than {_LARGEST} bytes: it is no transforms.json.")
        shared = json.loads(path.read_text("utf-8-sig"))
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error
    except FileError:
        raise
    except (ValueError, RecursionError) as error:
        raise FileError(f"{path} is no JSON, or is cut short: {error}.") from error
    if not isinstance(shared, dict) or not isinstance(shared.get("frames"), list):
        raise FileError(f"{path} has no list of frames: it is no transforms.json.")
    cameras: dict[str, Pinhole] = {}
    for k, frame in enumerate(shared["frames"]):
        where = f"{path}: frames[{k}]"
        if not isinstance(frame, dict):
            raise FileError(f"{where} is no object.")
        name = frame.get("file_path")
        if not isinstance(name, str) or not name:
            raise FileError(f"{where}: file_path = {name!r:.60} is no name of a photograph.")
        if name in cameras:
            raise FileError(f"{where}: file_path {name!r} has two cameras.")
        cameras[name] = _frame(path, where, name, shared, frame)
    return cameras


def _frame(path: Path, where: str, name: str, shared: dict[str, Any], frame: dict[str, Any]) -> Pinhole:
    fields = ChainMap(frame, shared)
    model = fields.get("camera_model", "OPENCV")
    if not isinstance(model, str) or model not in _MODELS:
        raise FileError(f"{where}: camera_model {model!r:.60} is not read; {', '.join(_MODELS)} are.")
    for other in _OTHER:
        if fields.get(other, False) is not False:
            raise FileError(f"{where}: {other} is not read; lenses are {', '.join(_MODELS)}, axes OpenGL's.")
    if "k4" in fields and _field(where, fields, "k4") != 0:
        raise FileError(f"{where}: k4 = {fields['k4']} is not read; distortion is {', '.join(_DISTORTION)}.")
    if "w" in fields and "h" in fields:
        columns, rows = _field(where, fields, "w"), _field(where, fields, "h")
    else:
        rows, columns = _photograph_size(path, where, name)
    # A frame's own focal lengths replace the shared ones together: fl_x without fl_y is of square pixels.
    focal = frame if any(name in frame for name in _FOCAL) else shared
    fx = _focal(where, focal, "x", columns)
    fy = _focal(where, focal, "y", rows)
    if fx is None:
        raise FileError(f"{where} has neither fl_x nor camera_angle_x.")
    cx = _field(where, fields, "cx") if "cx" in fields else columns / 2
    cy = _field(where, fields, "cy") if "cy" in fields else rows / 2
    k1, k2, p1, p2, k3 = (_field(where, fields, key) if key in fields else 0.0 for key in _DISTORTION)
    matrix = _matrix(where, frame)
    try:
        return Pinhole(
            size=(rows, columns),  # type: ignore[arg-type]  # whole numbers may be written as 640.0; Pinhole checks them
            pose=from_opengl(matrix),
            fx=fx,
            fy=fx if fy is None else fy,
            cx=cx,
            cy=cy,
            distortion=(k1, k2, p1, p2, k3),
        )
    except GonioError as error:
        raise FileError(f"{where}: {error}") from error


def _focal(where: str, fields: Mapping[str, Any], axis: str, extent: float) -> float | None:
    """The focal length in pixels along an axis of `extent` pixels, None where `fields` do not have it."""
    if f"fl_{axis}" in fields:
        return _field(where, fields, f"fl_{axis}")
    if f"camera_angle_{axis}" in fields:
        angle = _field(where, fields, f"camera_angle_{axis}")
        if not 0 < angle < math.pi:
            raise FileError(f"{where}: camera_angle_{axis} = {angle:g} lies outside (0, pi) radians.")
        return extent / (2 * math.tan(angle / 2))
    return None


def _field(where: str, fields: Mapping[str, Any], name: str) -> float:
    value = fields[name]
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise FileError(f"{where}: {name} = {value!r:.60} is no number.")
    return _finite(where, name, value)


def _finite(where: str, name: str, value: str | float) -> float:
    try:
        number = float(value)
    except (ValueError, OverflowError):
        raise FileError(f"{where}: {name} = {value!s:.60} is no number that fits.") from None
    if not math.isfinite(number):
        raise FileError(f"{where}: {name} = {number} is not finite.")
    return number


def _photograph_size(path: Path, where: str, name: str) -> tuple[int, int]:
    """(rows, columns) of the photograph of a frame without w and h; the first NeRF's names leave .png away."""
    inside = path.parent.resolve()
    for candidate in (name, f"{name}.png"):
        try:
            place = (inside / candidate).resolve()
            found = place.is_relative_to(inside) and place.is_file()
        except (OSError, ValueError):
            continue
        if found:
            info = image_info(place)
            return info.rows, info.columns
    raise FileError(f"{where} has no w and h, and {name!r:.200} does not lie in its folder. Write w and h into it.")


def _matrix(where: str, frame: dict[str, Any]) -> np.ndarray:
    """transform_matrix (4, 4) or (3, 4), its rotation made exact."""
    if "transform_matrix" not in frame:
        raise FileError(f"{where} has no transform_matrix.")
    try:
        matrix = np.array(frame["transform_matrix"], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise FileError(f"{where}: transform_matrix is no rows of numbers.") from None
    if matrix.shape not in ((4, 4), (3, 4)):
        raise FileError(f"{where}: transform_matrix has shape {matrix.shape}; it is 4 x 4.")
    if not np.isfinite(matrix).all():
        raise FileError(f"{where}: transform_matrix has numbers that are not finite.")
    rotation = matrix[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.abs(rotation @ rotation.T - np.eye(3)).max()
        determinant = np.linalg.det(rotation)
    if not (off <= _TOLERANCE and abs(determinant - 1) <= _TOLERANCE):
        raise FileError(
            f"{where}: transform_matrix does not rotate: its determinant is {determinant:.6g}, and R R^T differs from "
            f"the identity by {off:.3g}. Take scales and mirrors out of it."
        )
    u, _, vt = np.linalg.svd(rotation)
    matrix[:3, :3] = u @ vt
    return matrix


def _colmap_camera(where: str, model: str, columns: int, rows: int, parameters: list[Any]) -> Pinhole:
    """The camera of COLMAP's model, standing at the origin."""
    if model not in _MODELS:
        raise FileError(
            f"{where}: the camera model {model:.60} is not read; {', '.join(_MODELS)} are. "
            "COLMAP's image_undistorter makes PINHOLE of it."
        )
    names = _MODELS[model]
    if len(parameters) != len(names):
        raise FileError(f"{where}: {model} has {len(names)} parameters, {' '.join(names)}; {len(parameters)} came.")
    lens = {name: _finite(where, name, value) for name, value in zip(names, parameters, strict=True)}
    k1, k2, p1, p2, k3 = (lens.get(name, 0.0) for name in _DISTORTION)
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
    numbers = [_finite(where, name, value) for name, value in zip(_POSE, pose, strict=True)]
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
            parameters = records.take(f"<{len(_MODELS.get(model, ()))}d", what)
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
