"""Cameras of photographs as radiance fields write them: transforms.json.

    w h                          size in pixels; where they are missing, the photograph's own
    fl_x fl_y                    focal lengths in pixels, or camera_angle_x, camera_angle_y: views in radians
    cx cy  k1 k2 k3 p1 p2        principal point, and OpenCV's distortion
    frames[]                     file_path, transform_matrix camera to world, OpenGL's axes (x right, y up, z back);
                                 its own fields of the above go before those that all share

NeRF's, instant-ngp's and nerfstudio's, which put the centre of the first pixel at (1/2, 1/2), as gonio does. The world
is the file's own. Sources: docs.nerf.studio's data conventions, instant-ngp's loader. Not here: fisheye lenses, rolling
shutters, the photographs themselves.
"""

from __future__ import annotations

import json
import math
import os
from collections import ChainMap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..cameras import Pinhole, from_opengl, to_opengl
from ..errors import FileError, GonioError, ParameterError
from .colmap import DISTORTION, MODELS, finite
from .images import image_info
from .whole import writing

_LARGEST = 2**26  # bytes of a transforms.json: some hundred thousand photographs
_TOLERANCE = 1e-3  # how far a matrix may be from a rotation: files written with few digits

_FOCAL = ("fl_x", "fl_y", "camera_angle_x", "camera_angle_y")

# Fields that mean another lens, or other axes, than those that are read.
_OTHER = ("is_fisheye", "ftheta_p0", "latlong", "equirectangular", "orthographic", "from_na")


def read_transforms(path: Path) -> dict[str, Pinhole]:
    """The cameras of the transforms.json at `path` by their photographs' names. Errors are those of `read_cameras`."""
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
        **dict(zip(DISTORTION, camera.distortion, strict=True)),
        "camera_angle_x": 2 * math.atan2(columns, 2 * camera.fx),  # what the first NeRF's readers look for
    }


def _frame(path: Path, where: str, name: str, shared: dict[str, Any], frame: dict[str, Any]) -> Pinhole:
    fields = ChainMap(frame, shared)
    model = fields.get("camera_model", "OPENCV")
    if not isinstance(model, str) or model not in MODELS:
        raise FileError(f"{where}: camera_model {model!r:.60} is not read; {', '.join(MODELS)} are.")
    for other in _OTHER:
        if fields.get(other, False) is not False:
            raise FileError(f"{where}: {other} is not read; lenses are {', '.join(MODELS)}, axes OpenGL's.")
    if "k4" in fields and _field(where, fields, "k4") != 0:
        raise FileError(f"{where}: k4 = {fields['k4']} is not read; distortion is {', '.join(DISTORTION)}.")
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
    k1, k2, p1, p2, k3 = (_field(where, fields, key) if key in fields else 0.0 for key in DISTORTION)
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
    return finite(where, name, value)


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
