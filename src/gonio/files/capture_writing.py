"""A capture's description, capture.toml, written beside its photographs: what `capture_toml.py` reads.

Beside it come the files that it names. Not here: photographs, and how grazing a turntable's views may be.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import to_numpy
from ..cameras import Orthographic, Pinhole
from ..capture.model import Capture, above
from ..capture.photographs import Flattened, Photographs
from ..capture.turntable import Turntable
from ..errors import FileError
from ..lights.model import Light
from ..lights.points import Directional, Point
from ..lights.uneven import Uneven
from ..shapes.analytic import Sphere
from ..shapes.heightfield import HeightField
from ..shapes.mesh import Mesh
from .brackets import BracketFiles
from .images import write_image
from .layouts import place_of
from .meshes import write_mesh
from .responses import write_response
from .transforms import write_transforms
from .whole import writing


def write_capture(folder: str | os.PathLike[str], capture: Capture | Turntable) -> Path:
    """Write capture.toml beside photographs that lie in `folder` already. Answers its path.

    Beside it come the files that it names: shape.obj or heights.exr, transforms.json of many cameras, response.toml and
    vignetting.exr. mask.png and normals.png are named where they lie there, and otherwise written where nothing else
    tells them. Raises `FileError` for photographs that do not lie there, lights of several kinds, and shapes other than
    meshes, heights and spheres.
    """
    folder = Path(folder)
    for name in capture.photographs.names:
        if place_of(folder, name) is None:
            raise FileError(f"{folder} has no photograph {name}: a capture is written beside its photographs.")
    lines = ["version = 1", *_photograph_lines(folder, capture.photographs)]
    if isinstance(capture, Turntable):
        if not all(isinstance(camera, Pinhole) for camera in capture.cameras):
            raise FileError(f"{folder}: cameras without perspective are not written.")
        write_transforms(folder / "transforms.json", dict(zip(capture.photographs.names, capture.cameras, strict=True)))  # type: ignore[arg-type]
        lines.append('cameras = "transforms.json"')
        lines += [f"texels = {list(capture.texels)}"] if capture.texels else []
    else:
        _write_companions(folder, capture)
        lines += [f'{name} = "{name}.png"' for name in ("mask", "normals") if (folder / f"{name}.png").exists()]
    lines += _shape_lines(folder, capture)
    if isinstance(capture, Capture):
        lines += _camera_lines(capture)
    if capture.lights is not None:
        lines += _light_lines(folder, capture.lights)
    path = folder / "capture.toml"
    with writing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", "utf-8")
    return path


def _photograph_lines(folder: Path, photographs: Photographs) -> list[str]:
    """Names, and what their codes mean."""
    vignetting = None
    if isinstance(photographs, Flattened):
        vignetting, photographs = photographs.vignetting, photographs.photographs
    if not isinstance(photographs, BracketFiles):
        lines = ["photographs = [", *(f"    {_quoted(name)}," for name in photographs.names), "]"]
    else:
        lines = ["photographs = [", *(f"    [{', '.join(map(_quoted, group))}]," for group in photographs.groups), "]"]
        noise, vignetting = photographs.noise, photographs.vignetting
        lines.append(f"exposures = {_row(photographs.times)}")
        lines.append(f"noise = {{gain = {noise.gain:.9g}, read = {noise.read:.9g}}}")
        if photographs.given:
            write_response(folder / "response.toml", photographs.response)
            lines.append('response = "response.toml"')
    encoding = getattr(photographs, "encoding", None)
    if encoding is not None:
        lines.append(f"encoding = {_quoted(encoding) if isinstance(encoding, str) else float(encoding)}")
    if vignetting is not None:
        write_image(folder / "vignetting.exr", np.broadcast_to(vignetting, (*vignetting.shape[:2], 3)))
        lines.append('vignetting = "vignetting.exr"')
    return lines


def _write_companions(folder: Path, capture: Capture) -> None:
    """The mask and the normals that nothing else in the description would tell, where no others lie there."""
    mask, normals = capture.mask, capture.normals
    if not (folder / "mask.png").exists() and not np.all(mask):
        write_image(folder / "mask.png", mask.astype(np.float64), "linear")
    if (folder / "normals.png").exists() or normals is None or capture.shape is not None:
        return
    if not _is_flat(capture):
        codes = np.where(mask[..., None], 0.5 * normals + 0.5, 0.0)
        write_image(folder / "normals.png", codes, "linear", bits=16, clip=True)


def _shape_lines(folder: Path, capture: Capture | Turntable) -> list[str]:
    shape = capture.shape
    if isinstance(shape, Mesh):
        write_mesh(folder / "shape.obj", shape)
        return ['shape = "shape.obj"']
    if isinstance(shape, HeightField):
        write_image(folder / "heights.exr", np.repeat(np.asarray(shape.heights)[..., None], 3, axis=2))
        return ['shape = "heights.exr"', f"spacing = {shape.spacing:.12g}"]
    if isinstance(shape, Sphere):
        return [f"shape = {{centre = {_row(to_numpy(shape.centre).tolist())}, radius = {shape.radius:.9g}}}"]
    if shape is not None:
        raise FileError(f"{folder}: a {type(shape).__name__} is not written; meshes, heights and spheres are.")
    if isinstance(capture, Capture) and _is_flat(capture) and not (folder / "normals.png").exists():
        return ['shape = "flat"']
    return []


def _is_flat(capture: Capture) -> bool:
    normals = capture.normals
    return normals is not None and bool(np.all(normals[capture.mask] == (0, 0, 1)))


def _camera_lines(capture: Capture) -> list[str]:
    camera, lines = capture.camera, []
    if isinstance(camera, Orthographic) and (camera.pixel != 1 or not _is_above(capture)):
        lines.append(f"texel = {camera.pixel:.12g}")
    if isinstance(camera, Pinhole):
        lines += [f"{name} = {getattr(camera, name):.12g}" for name in ("fx", "fy", "cx", "cy")]
        lines.append(f"distortion = {_row(camera.distortion)}")
    if not _is_above(capture):
        lines += [f"size = {list(camera.size)}", *_table("pose", camera.pose)]
    if capture.eye is not None:
        lines.append(f"eye = {_row(capture.eye.tolist())}")
    return ["", "[camera]", *lines] if lines else []


def _is_above(capture: Capture) -> bool:
    """Whether the camera is the one that stands above where nothing else is said."""
    camera = capture.camera
    if not isinstance(camera, Orthographic):
        return False
    usual = above(camera.size, camera.pixel)
    # How high it stands matters only to what reaches higher.
    low = capture.shape is None or capture.shape.bounds[1][2] < usual.position[2]
    return low and np.allclose(camera.pose[:2], usual.pose[:2], atol=1e-12) and camera.pose[2, 2] < 0


def _light_lines(folder: Path, lights: tuple[Light, ...]) -> list[str]:
    lines = ["", "[lights]"]
    bare = [light.light if isinstance(light, Uneven) else light for light in lights]
    distant = [light for light in bare if isinstance(light, Directional)]
    near = [light for light in bare if isinstance(light, Point)]
    if len(distant) == len(lights):
        lines += _table("directions", [light.direction for light in distant])
        strengths = [light.irradiance for light in distant]
    elif len(near) == len(lights):
        lines += _table("positions", [light.position for light in near])
        strengths = [light.intensity for light in near]
        axes = [to_numpy(light.axis) for light in near if light.axis is not None]
        exponents = {light.exponent for light in near if light.axis is not None}
        if len(axes) not in (0, len(near)) or len(exponents) > 1:
            raise FileError(f"{folder}: lights of which some have no axis, or with several exponents, are not written.")
        if axes:
            one = all(np.array_equal(axis, axes[0]) for axis in axes)
            lines += [f"axis = {_row(axes[0].tolist())}"] if one else _table("axis", axes)
            lines.append(f"exponent = {exponents.pop():.12g}")
    else:
        raise FileError(f"{folder}: distant and near lights in one capture are not written.")
    colours = np.array([np.broadcast_to(to_numpy(strength), 3) for strength in strengths])
    if not np.all(colours == 1):
        lines += _table("intensities", colours)
    uneven = [light for light in lights if isinstance(light, Uneven)]
    if uneven and len(uneven) < len(lights):
        raise FileError(f"{folder}: some lights have a measured falloff and others have none.")
    if uneven:
        lines.append("falloff = [")
        lines += [f"    [{', '.join(_row(row) for row in to_numpy(light.falloff).tolist())}]," for light in uneven]
        lines.append("]")
    return lines


def _table(name: str, rows: Any) -> list[str]:
    return [f"{name} = [", *(f"    {_row(to_numpy(row).tolist())}," for row in rows), "]"]


def _row(numbers: Any) -> str:
    return f"[{', '.join(f'{x:.12g}' for x in numbers)}]"


def _quoted(text: str) -> str:
    """A TOML string."""
    escaped = "".join(c if c.isprintable() and c not in '"\\' else f"\\U{ord(c):08x}" for c in text)
    return f'"{escaped}"'
