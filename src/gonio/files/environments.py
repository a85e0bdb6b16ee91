"""Environment maps in files: which layout a picture has, and which way it stands.

    what                                          taken for
    header's gonio:environment (.exr, .hdr)       what it says: gonio writes it
    OpenEXR attribute envmap                      LatLongMap() or CubeStrip.openexr(), Orientation.OPENEXR
    2 : 1 (columns : rows)                        LatLongMap()
    3 : 4, 4 : 3                                  CubeCross(vertical=True), CubeCross(vertical=False)
    1 : 6, 6 : 1                                  CubeStrip(vertical=True), CubeStrip(vertical=False)
    two files, front and back                     DualParaboloid()
    six files, px nx py ny pz nz or the like      CubeStrip(); for Orientation.OPENEXR, CubeStrip.openexr()

"sky_{face}.exr" names six files by one pattern, in reading and in writing: sky_px.exr, sky_nx.exr and so on, the parts
of the strip from its first to its last.

A square picture may be an angular map or a mirror ball, and has to be named. Where nothing says which way a picture
stands, lat-long maps and cubes are taken for what one sees from inside (Orientation.PANORAMA: ahead is +y), discs and
paraboloids for Orientation.PROBE. `environment.orientation.name` says what was taken.

Pixels are areas here, as in most programs. OpenEXR's own tools and Mitsuba put the centres of the outermost pixels on
the picture's edge (Mitsuba the rows only): by at most half a pixel, their directions differ from these.
"""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from ..errors import ArrayError, FileError, ParameterError
from ..lights.cubes import CubeCross, CubeStrip
from ..lights.discs import AngularMap, DualParaboloid, MirrorBall
from ..lights.environment import Environment
from ..lights.mappings import LatLongMap, Mapping
from ..lights.orientation import PUBLISHED, Orientation
from .images import image_info, read_image, write_images

_STATEMENT = "gonio:environment"
_LAYOUTS: dict[str, Callable[..., Mapping]] = {
    kind.__name__: kind for kind in (LatLongMap, AngularMap, MirrorBall, DualParaboloid, CubeCross, CubeStrip)
}

# What the stem of a face's file ends with, by the part of a strip: names of OpenGL, of skyboxes, of `exrenvmap`.
_FACE_NAMES = (
    ("px", "posx", "+x", "right", "rt"),
    ("nx", "negx", "-x", "left", "lf"),
    ("py", "posy", "+y", "top", "up"),
    ("ny", "negy", "-y", "bottom", "down", "dn"),
    ("pz", "posz", "+z", "front", "ft"),
    ("nz", "negz", "-z", "back", "bk"),
)


def read_environment(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    mapping: Mapping | None = None,
    orientation: Orientation | None = None,
) -> Environment:
    """Reads one picture, a pair (front, back; paraboloids), or six faces; every format of `read_image`.

    path: one, a sequence of two or six, or a pattern such as "sky_{face}.exr". mapping: the layout, where neither the
    header nor the picture's shape tells (see above). orientation: the tool's that made it, such as
    `Orientation.MITSUBA`. Either, if given, overrides the header. Raises `FileError` where the layout cannot be told or
    the pictures do not fit it, besides what `read_image` raises.
    """
    paths = _expanded(path)
    stated = _stated(paths[0])
    if len(paths) == 1:
        mapping = mapping or (stated[0] if stated else _by_shape(paths[0]))
        image = read_image(paths[0])
    elif len(paths) == 2:
        image = np.concatenate(_alike(sorted(paths, key=lambda p: "back" in p.stem.lower())), axis=1)
        mapping = mapping or DualParaboloid()
    elif len(paths) == 6:
        image = np.concatenate(_alike(_faces(paths)), axis=0)
        mapping = mapping or (stated[0] if stated else strip_for(orientation))
    else:
        raise FileError(f"{len(paths)} files make no environment: pass one, a front and a back, or six faces.")
    # What a header says of another layout than that which is passed is no longer to be trusted.
    stands = stated[1] if stated and type(stated[0]) is type(mapping) else None
    try:
        return Environment(image, mapping, orientation or stands or _unsaid(mapping))
    except ArrayError as error:
        raise FileError(f"{paths[0]}: {error}") from error


def write_environment(
    path: str | os.PathLike[str],
    environment: Environment,
    mapping: Mapping | None = None,
    orientation: Orientation | None = None,
    rows: int | None = None,
) -> None:
    """Writes a picture, or six faces by a pattern such as "sky_{face}.exr", in the format of the suffix.

    mapping, orientation and rows as `as_picture` takes them; by a pattern, mapping is a `CubeStrip`. The headers of
    .exr and .hdr say what was written, so that `read_environment(path)` reads the same light; .exr also says it in
    OpenEXR's own words where it has such. Other formats are read back by naming the same mapping and orientation.
    All files appear, whole, or none. Raises what `write_image` raises, and `ParameterError` for faces of no strip.
    """
    path = Path(path)
    if not is_pattern(path):
        picture = as_picture(environment, mapping, orientation, rows)
        write_images({path: picture.image}, attributes=_statement(picture))
        return
    strip = mapping or strip_for(orientation)
    if not isinstance(strip, CubeStrip):
        raise ParameterError(f"{path} names six faces; they are of a CubeStrip, not of {type(strip).__name__}.")
    picture = as_picture(environment, strip, orientation, rows)
    parts = np.split(picture.image, 6, axis=0 if strip.vertical else 1)
    files = {_face(path, names[0]): part for names, part in zip(_FACE_NAMES, parts, strict=True)}
    # Faces are read as a strip from top to bottom.
    upright = dataclasses.replace(picture, image=np.concatenate(parts), mapping=CubeStrip(faces=strip.faces))
    write_images(files, attributes=_statement(upright))


def is_pattern(path: str | os.PathLike[str]) -> bool:
    """Whether the path stands for six files, one for each face of a cube."""
    return "{face}" in Path(path).name


def as_picture(
    environment: Environment,
    mapping: Mapping | None = None,
    orientation: Orientation | None = None,
    rows: int | None = None,
) -> Environment:
    """The environment as the picture that a file will hold.

    mapping: the layout, the environment's own where None. orientation: the tool's that will read it; where None, what
    is read without saying (PANORAMA, or PROBE for discs and paraboloids). rows: of the picture; where None, its own,
    or as many as keep the resolution in another layout. Pixels are only resampled where they must be.
    """
    mapping = mapping or environment.mapping
    return environment.resampled(mapping, rows or _rows(environment, mapping), orientation or _unsaid(mapping))


def layout_of(path: str | os.PathLike[str]) -> tuple[Mapping, Orientation]:
    """What `read_environment` takes a picture for, from its header. Raises `FileError` where that cannot be told."""
    path = Path(path)
    stated = _stated(path)
    if stated:
        return stated
    mapping = _by_shape(path)
    return mapping, _unsaid(mapping)


def _unsaid(mapping: Mapping) -> Orientation:
    """Which way a picture is taken to stand where nothing says so."""
    upright = isinstance(mapping, LatLongMap | CubeCross | CubeStrip)
    return Orientation.PANORAMA if upright else Orientation.PROBE


def _rows(environment: Environment, mapping: Mapping) -> int:
    """Rows that give `mapping` about as fine pixels at the coarsest place as the environment has."""
    if type(mapping) is type(environment.mapping) and mapping == environment.mapping:
        return environment.rows
    unit = mapping.shape(12)
    if mapping.sheets == environment.mapping.sheets == 6:
        side, _ = environment.mapping.sheet_shape(environment.rows, environment.columns)
        return 12 * side // mapping.sheet_shape(*unit)[0]
    coarse = float(mapping.solid_angles(*unit).max())
    wanted = 12 * (coarse / float(environment.solid_angles.max())) ** 0.5
    return 12 * max(int(wanted / 12 + 0.5), 1)


def strip_for(orientation: Orientation | None) -> CubeStrip:
    """The strip whose parts are +X -X +Y -Y +Z -Z to the tool."""
    return CubeStrip.openexr() if orientation is Orientation.OPENEXR else CubeStrip()


def _statement(picture: Environment) -> dict[str, str]:
    """Attributes for a header that name the picture's layout and orientation."""
    mapping, orientation = picture.mapping, picture.orientation
    stands = {"orientation": orientation.name}
    if PUBLISHED.get(orientation.name) is not orientation:
        frame = (picture.turn @ mapping.picture).T.tolist()
        stands |= dict(zip(("right", "up", "centre"), frame, strict=True))
    words = {"layout": type(mapping).__name__, **dataclasses.asdict(mapping), **stands}  # type: ignore[call-overload]
    attributes = {_STATEMENT: json.dumps(words)}
    if orientation is Orientation.OPENEXR and mapping in (LatLongMap(), CubeStrip.openexr()):
        attributes["envmap"] = "latlong" if isinstance(mapping, LatLongMap) else "cube"
    return attributes


def _stated(path: Path) -> tuple[Mapping, Orientation] | None:
    """Layout and orientation that the header states, None where it does not. Raises `FileError` for nonsense."""
    attributes = image_info(path).attributes
    if _STATEMENT not in attributes:
        known = {"latlong": LatLongMap(), "cube": CubeStrip.openexr()}
        mapping = known.get(attributes.get("envmap", ""))
        return (mapping, Orientation.OPENEXR) if mapping else None
    try:
        words = json.loads(attributes[_STATEMENT])
        kind, name = _LAYOUTS[words.pop("layout")], words.pop("orientation")
        frame = [words.pop(axis) for axis in ("right", "up", "centre") if axis in words]
        mapping = kind(**{key: tuple(value) if isinstance(value, list) else value for key, value in words.items()})
        return mapping, Orientation.of(name, mapping, np.array(frame, float).T) if frame else PUBLISHED[name]
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise FileError(
            f"{path}: the header's {_STATEMENT} is {str(attributes[_STATEMENT])[:80]!r}, which gonio does not write. "
            "Remove it, or pass mapping= and orientation= to read the picture with read_image."
        ) from error


def _by_shape(path: Path) -> Mapping:
    info = image_info(path)
    rows, columns = info.rows, info.columns
    for high, wide, mapping in (
        (1, 2, LatLongMap()),
        (4, 3, CubeCross(vertical=True)),
        (3, 4, CubeCross(vertical=False)),
        (6, 1, CubeStrip(vertical=True)),
        (1, 6, CubeStrip(vertical=False)),
    ):
        if rows * wide == columns * high and rows % high == 0:
            return mapping
    raise FileError(
        f"{path}: {columns} x {rows} pixels do not tell the layout. Name it: LatLongMap is 2:1, AngularMap and "
        "MirrorBall 1:1, DualParaboloid 2:1, CubeCross 3:4 or 4:3, CubeStrip 1:6 or 6:1."
    )


def _alike(paths: list[Path]) -> list[np.ndarray]:
    images = [read_image(p) for p in paths]
    for path, image in zip(paths, images, strict=True):
        if image.shape != images[0].shape or image.shape[0] != image.shape[1]:
            raise FileError(
                f"{path} has {image.shape[1]} x {image.shape[0]} pixels; the pictures are square and of one size."
            )
    return images


def _expanded(path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]]) -> list[Path]:
    """The files that are meant: of a pattern, the six that exist."""
    if not isinstance(path, str | os.PathLike):
        return [Path(p) for p in path]
    path = Path(path)
    if not is_pattern(path):
        return [path]
    return [
        next((p for p in (_face(path, name) for name in names) if p.exists()), _face(path, names[0]))
        for names in _FACE_NAMES
    ]


def _face(path: Path, name: str) -> Path:
    return path.with_name(path.name.replace("{face}", name))


def _faces(paths: list[Path]) -> list[Path]:
    """Six files in the order of a strip, known by the ends of their names."""
    found: dict[int, Path] = {}
    for path in paths:
        stem = path.stem.lower()
        # The longest ending: "left" ends in "ft" as well.
        named = max(((len(e), k) for k, ends in enumerate(_FACE_NAMES) for e in ends if stem.endswith(e)), default=None)
        if named is None or named[1] in found:
            raise FileError(
                f"{path}: which face is it? The names of six files end in px nx py ny pz nz, or right left up down "
                "front back, each once."
            )
        found[named[1]] = path
    return [found[k] for k in range(6)]
