"""gonio's own description of a capture: capture.toml beside the photographs.

    version = 1
    photographs = ["a.png", ...]          or [["a1.png", "a2.png"], ...], brackets of as many as exposures
    exposures = [0.004, 0.016]            seconds, of brackets
    encoding = "srgb" | "linear" | 2.2    or response = "response.toml"; else what the files state
    vignetting = "vignetting.exr"         noise = {gain = 5e-5, read = 1e-3}
    mask = "mask.png"                     normals = "normals.png"
    shape = "flat"                        or a mesh, an image of heights in units of the world, whose samples are
                                          `spacing` apart (else texel), {centre = [x, y, z], radius = r}, a ball, or
                                          "sphere", the one whose silhouette the mask is: of `radius` under perspective
    cameras = "transforms.json"           photographs from many places, or COLMAP's; texels = [rows, columns] of uv
    [camera]                              texel = 0.1 (straight above), with size and pose from elsewhere; or fx fy cx
                                          cy size pose distortion; eye = [x, y, z]
    [lights]                              directions or positions, intensities, axis, exponent, falloff

Tables are lists of rows, one for each photograph. `directions` are unit; `positions` are near lights, in the unit of
texel; `intensities` (R, G, B) are irradiances of the former, radiant intensities of the latter; `falloff` has the six
coefficients of `Uneven`; `axis` may be one for all. Files lie in the description's folder or below.
"""

from __future__ import annotations

import sys
import tomllib
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..cameras import Orthographic, Pinhole
from ..capture.exposure import Noise
from ..capture.lighting import distant_lights, near_lights
from ..errors import FileError, GonioError
from ..lights.model import Light
from ..lights.uneven import Uneven
from ..shapes.analytic import Sphere
from .camera_poses import read_cameras
from .layouts import Found, place_of, text_of

_COMPANIONS = ("mask", "normals")


class _Fields:
    """The fields of one table of a description, each taken once."""

    def __init__(self, path: Path, fields: dict[str, Any], prefix: str = "") -> None:
        self.path, self.fields, self.prefix = path, fields, prefix

    def take(self, name: str, good: Callable[[Any], bool], wanted: str) -> Any:
        """The value of a field, None where it is not there. Raises `FileError` where it is not `good`."""
        value = self.fields.pop(name, None)
        if value is not None and not good(value):
            raise FileError(f"{self.path}: {self.prefix}{name} = {value!r:.60}; {wanted} is wanted.")
        return value

    def file(self, name: str) -> Path | None:
        """A file of the description's folder that a field names."""
        value = self.take(name, lambda v: isinstance(v, str), "the name of a file")
        return None if value is None else self.place(name, value)

    def table(self, name: str) -> _Fields:
        value = self.take(name, lambda v: isinstance(v, dict), "a table") or {}
        return _Fields(self.path, value, f"{name}.")

    def rows(self, name: str, width: int, count: int | None) -> np.ndarray | None:
        """A list of rows of numbers, as many as photographs where a count is given."""
        value = self.take(name, lambda v: _is_rows(v, width), f"a list of rows of {width} numbers")
        if value is None:
            return None
        if count is not None and len(value) != count:
            raise FileError(f"{self.path}: {self.prefix}{name} has {len(value)} rows for {count} photographs.")
        return np.array(value, dtype=np.float64)

    def numbers(self, name: str, count: int | None = None) -> list[float] | None:
        """A list of numbers, of a given length where there is one."""
        wanted = "a list of numbers" if count is None else f"a list of {count} numbers"
        value: list[float] | None = self.take(name, lambda v: _is_numbers(v) and count in (None, len(v)), wanted)
        return value

    def number(self, name: str) -> float | None:
        value: float | None = self.take(name, _is_positive, "a positive number")
        return value

    def done(self) -> None:
        """Raises `FileError` where a field is left: it is not known."""
        for left in self.fields:
            raise FileError(f"{self.path}: the field {self.prefix}{left} is not known.")

    def place(self, name: str, value: str) -> Path:
        """Where the file that a field names lies."""
        place = place_of(self.path.parent, value)
        if place is None:
            raise FileError(f"{self.path}: {self.prefix}{name} = {value!r} does not exist in its folder.")
        return self.path.parent / place


def read_description(path: Path) -> Found:
    """What a capture.toml says. Raises `FileError` that names the field at fault."""
    try:
        fields = _Fields(path, tomllib.loads(text_of(path)))
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise FileError(f"{path} is no TOML: {error}.") from error
    found, given = Found(path.parent, "capture.toml"), frozenset(fields.fields)
    if fields.take("version", lambda v: v == 1, "1") is None:
        raise FileError(f"{path} has no version; version = 1 is wanted.")
    groups = fields.take("photographs", _is_names, "a list of names, or of brackets of names")
    if groups is None:
        raise FileError(f"{path} has no photographs.")
    _radiometry(fields, found, groups)
    for name in _COMPANIONS:
        setattr(found, name, fields.file(name))
    texels = fields.take("texels", _is_size, "[rows, columns]")
    found.texels = None if texels is None else tuple(texels)
    found.spacing = fields.number("spacing")
    cameras = fields.file("cameras")
    of_one = [name for name in (*_COMPANIONS, "camera") if name in given]
    if cameras is not None and of_one:
        raise FileError(f"{path}: {of_one[0]} goes with photographs from one place, not with cameras.")
    if cameras is None and found.texels is not None:
        raise FileError(f"{path}: texels go with cameras, photographs from many places.")
    try:
        _shape(fields, found)
        _camera(fields.table("camera"), found)
        found.lights = _lights(fields.table("lights"), len(groups))
    except FileError:
        raise
    except GonioError as error:
        raise FileError(f"{path}: {error}") from error
    fields.done()
    brackets = [[group] if isinstance(group, str) else group for group in groups]
    if cameras is not None:
        found.cameras = _cameras(path, cameras, [group[0] for group in brackets])
    places = [[place_of(path.parent, name) for name in group] for group in brackets]
    lost = [
        name for group, at in zip(brackets, places, strict=True) for name, p in zip(group, at, strict=True) if not p
    ]
    if lost:
        found.defects.append(f"{', '.join(lost[:5])}{' ...' if len(lost) > 5 else ''} does not exist in its folder")
    found.names = [tuple(place or "" for place in group) for group in places]
    found.keep(np.array([None not in group for group in places]))
    return found


def _radiometry(fields: _Fields, found: Found, groups: list[Any]) -> None:
    """exposures, encoding, response, vignetting, noise."""
    path = fields.path
    exposures = fields.numbers("exposures")
    sizes = {1 if isinstance(group, str) else len(group) for group in groups}
    wanted = 1 if exposures is None else len(exposures)
    if sizes != {wanted}:
        raise FileError(
            f"{path}: brackets have {' and '.join(map(str, sorted(sizes)))} photographs, exposures are {wanted}."
            if exposures is not None
            else f"{path}: photographs are brackets, but there are no exposures; seconds of each are wanted."
        )
    found.times = None if exposures is None else tuple(exposures)
    found.encoding = fields.take("encoding", _is_encoding, "'srgb', 'linear' or a power")
    found.response, found.vignetting = fields.file("response"), fields.file("vignetting")
    noise = fields.take("noise", lambda v: isinstance(v, dict), "a table")
    if found.response is not None and (found.encoding is not None or exposures is None):
        raise FileError(f"{path}: response goes with exposures, in the place of encoding.")
    if noise is not None:
        table = _Fields(path, noise, "noise.")
        gain, read = table.number("gain"), table.take("read", lambda v: v == 0 or _is_positive(v), "a number >= 0")
        table.done()
        if exposures is None or gain is None:
            raise FileError(f"{path}: noise goes with exposures, and has a gain.")
        found.noise = Noise(gain, read or 0.0)


def _shape(fields: _Fields, found: Found) -> None:
    shape = fields.take("shape", lambda v: isinstance(v, str | dict), "'flat', 'sphere', the name of a file or a ball")
    found.form = shape if shape in ("flat", "sphere") else None
    found.radius = fields.number("radius")
    if found.radius is not None and shape != "sphere":
        raise FileError(f"{fields.path}: radius goes with shape = 'sphere'.")
    if isinstance(shape, dict):
        ball = _Fields(fields.path, shape, "shape.")
        centre, radius = ball.numbers("centre", 3), ball.number("radius")
        ball.done()
        if centre is None or radius is None:
            raise FileError(f"{fields.path}: a ball as shape has a centre and a radius.")
        found.shape = Sphere(centre, radius)
    elif shape not in (None, found.form):
        found.shape = fields.place("shape", shape)


def _camera(camera: _Fields, found: Found) -> None:
    eye = camera.numbers("eye", 3)
    found.eye = None if eye is None else tuple(eye)
    texel = camera.number("texel")
    found.texel = 1.0 if texel is None else texel
    lens = {name: camera.number(name) for name in ("fx", "fy")}
    middle = {name: camera.take(name, _is_number, "a number") for name in ("cx", "cy")}
    size = camera.take("size", _is_size, "[rows, columns]")
    distortion, pose = camera.numbers("distortion", 5), camera.rows("pose", 4, None)
    camera.done()
    given = [*lens.values(), *middle.values(), size, pose]
    if texel is not None and size is not None and pose is not None and not any((*given[:4], distortion)):
        found.camera = Orthographic(pixel=texel, size=tuple(size), pose=pose)
    elif any(value is not None for value in (*given, distortion)):
        if texel is not None or any(value is None for value in given):
            raise FileError(
                f"{camera.path}: a camera is either texel, with size and pose where it is not straight above, or fx, "
                "fy, cx, cy, size and pose, and distortion where there is any."
            )
        if distortion is not None:
            lens["distortion"] = tuple(distortion)  # type: ignore[assignment]
        found.camera = Pinhole(size=tuple(size), pose=pose, **lens, **middle)  # type: ignore[arg-type]


def _lights(lights: _Fields, count: int) -> tuple[Light, ...] | None:
    directions, positions = lights.rows("directions", 3, count), lights.rows("positions", 3, count)
    intensities = lights.rows("intensities", 3, count)
    falloff = lights.take("falloff", _is_falloff, "a list of one or three rows of 6 numbers for each light")
    axis = lights.take("axis", _is_axis, "3 numbers, or a list of rows of 3 numbers")
    if axis is not None and isinstance(axis[0], list) and len(axis) != count:
        raise FileError(f"{lights.path}: lights.axis has {len(axis)} rows for {count} photographs.")
    exponent = lights.take("exponent", lambda v: v == 0 or _is_positive(v), "a number >= 0")
    lights.done()
    if directions is not None and positions is not None:
        raise FileError(f"{lights.path}: lights have directions or positions, not both.")
    if positions is None and (axis is not None or exponent is not None):
        raise FileError(f"{lights.path}: lights.axis and exponent go with positions.")
    if directions is not None:
        found = distant_lights(directions, intensities)
    elif positions is not None:
        found = near_lights(
            positions,
            intensities,
            None if axis is None else np.array(axis, dtype=np.float64),
            1.0 if exponent is None else exponent,
        )
    elif intensities is not None or falloff is not None:
        raise FileError(f"{lights.path}: lights have neither directions nor positions.")
    else:
        return None
    if falloff is None:
        return found
    if len(falloff) != count:
        raise FileError(f"{lights.path}: lights.falloff has {len(falloff)} rows for {count} photographs.")
    return tuple(Uneven(light, np.array(rows, dtype=np.float64)) for light, rows in zip(found, falloff, strict=True))


def _cameras(path: Path, file: Path, names: list[str]) -> tuple[Pinhole, ...]:
    """The camera of each photograph, by its path or its name alone."""
    cameras = read_cameras(file)
    stems = Counter(Path(name).stem for name in cameras)
    by_name = {Path(name).stem: camera for name, camera in cameras.items()}
    for name in names:
        if name not in cameras and stems[Path(name).stem] != 1:
            many = "several cameras" if Path(name).stem in stems else "no camera"
            raise FileError(f"{path}: {name} has {many} in {file.name}.")
    return tuple(cameras[name] if name in cameras else by_name[Path(name).stem] for name in names)


def _is_names(value: Any) -> bool:
    def is_group(x: Any) -> bool:
        return isinstance(x, str) or (isinstance(x, list) and bool(x) and all(isinstance(n, str) for n in x))

    return isinstance(value, list) and bool(value) and all(map(is_group, value))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _is_positive(value: Any) -> bool:
    return _is_number(value) and value > 0


def _is_encoding(value: Any) -> bool:
    return value in ("srgb", "linear") or _is_positive(value)


def _is_numbers(value: Any) -> bool:
    return isinstance(value, list) and all(map(_is_number, value))


def _is_rows(value: Any, width: int) -> bool:
    return isinstance(value, list) and all(_is_numbers(row) and len(row) == width for row in value)


def _is_axis(value: Any) -> bool:
    return (_is_numbers(value) and len(value) == 3) or (_is_rows(value, 3) and bool(value))


def _is_falloff(value: Any) -> bool:
    return isinstance(value, list) and all(_is_rows(rows, 6) and len(rows) in (1, 3) for rows in value)


def _is_size(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(isinstance(n, int) and n > 0 for n in value)
