"""Environment maps in files: which layout a picture has, and which way it stands.

    what                                          taken for
    OpenEXR attribute envmap                      LatLongMap() or CubeStrip.openexr(), Orientation.OPENEXR
    2 : 1 (columns : rows)                        LatLongMap()
    3 : 4, 4 : 3                                  CubeCross(vertical=True), CubeCross(vertical=False)
    1 : 6, 6 : 1                                  CubeStrip(vertical=True), CubeStrip(vertical=False)
    two files, front and back                     DualParaboloid()
    six files, px nx py ny pz nz or the like      CubeStrip()

A square picture may be an angular map or a mirror ball, and has to be named. Where nothing says which way a picture
stands, lat-long maps and cubes are taken for what one sees from inside (Orientation.PANORAMA: ahead is +y), discs and
paraboloids for Orientation.PROBE. `environment.orientation.name` says what was taken.

Pixels are areas here, as in most programs. OpenEXR's own tools and Mitsuba put the centres of the outermost pixels on
the picture's edge (Mitsuba the rows only): by at most half a pixel, their directions differ from these.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import ArrayError, FileError
from ..lights.cubes import FACES, CubeCross, CubeStrip
from ..lights.discs import DualParaboloid
from ..lights.environment import Environment
from ..lights.mappings import LatLongMap, Mapping
from ..lights.orientation import Orientation
from .images import image_info, read_image, write_image

# What the stem of a face's file ends with, by face; the names of OpenGL, of skyboxes, and of `exrenvmap`.
_FACE_NAMES = {
    "right": ("px", "posx", "+x", "right", "rt"),
    "left": ("nx", "negx", "-x", "left", "lf"),
    "up": ("py", "posy", "+y", "top", "up"),
    "down": ("ny", "negy", "-y", "bottom", "down", "dn"),
    "front": ("pz", "posz", "+z", "front", "ft"),
    "back": ("nz", "negz", "-z", "back", "bk"),
}


def read_environment(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    mapping: Mapping | None = None,
    orientation: Orientation | None = None,
) -> Environment:
    """Reads one picture, a pair (front, back; paraboloids), or six faces; every format of `read_image`.

    mapping: the layout, where the picture's shape does not tell (see above). orientation: the tool's that made it,
    such as `Orientation.MITSUBA`. Raises `FileError` where the layout cannot be told or the pictures do not fit it,
    besides what `read_image` raises.
    """
    paths = [Path(path)] if isinstance(path, str | os.PathLike) else [Path(p) for p in path]
    if len(paths) == 1:
        said, stands = (mapping, None) if mapping is not None else _layout(paths[0])
        image = read_image(paths[0])
    elif len(paths) == 2:
        ordered = sorted(paths, key=lambda p: "back" in p.stem.lower())
        image = np.concatenate(_alike(ordered), axis=1)
        said, stands = mapping or DualParaboloid(), None
    elif len(paths) == 6:
        image = np.concatenate(_alike(_faces(paths)), axis=0)
        said, stands = mapping or CubeStrip(), None
    else:
        raise FileError(f"{len(paths)} files make no environment: pass one, a front and a back, or six faces.")
    try:
        return Environment(image, said, orientation or stands or _unsaid(said))
    except ArrayError as error:
        raise FileError(f"{paths[0]}: {error}") from error


def write_environment(
    path: str | os.PathLike[str],
    environment: Environment,
    mapping: Mapping | None = None,
    orientation: Orientation | None = None,
    rows: int | None = None,
) -> None:
    """Writes the picture that `read_environment(path, mapping, orientation)` reads back, in the format of the suffix.

    mapping, orientation and rows as `as_picture` takes them.
    """
    write_image(path, as_picture(environment, mapping, orientation, rows).image)


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
    mapping, orientation = _layout(Path(path))
    return mapping, orientation or _unsaid(mapping)


def _unsaid(mapping: Mapping) -> Orientation:
    """Which way a picture is taken to stand where nothing says so."""
    upright = isinstance(mapping, LatLongMap | CubeCross | CubeStrip)
    return Orientation.PANORAMA if upright else Orientation.PROBE


def _rows(environment: Environment, mapping: Mapping) -> int:
    """Rows that give `mapping` about as fine pixels at the coarsest place as the environment has."""
    if type(mapping) is type(environment.mapping) and mapping == environment.mapping:
        return environment.rows
    unit = mapping.shape(12)
    coarse = float(mapping.solid_angles(*unit).max())
    wanted = 12 * (coarse / float(environment.solid_angles.max())) ** 0.5
    return 12 * max(int(wanted / 12 + 0.5), 1)


def _layout(path: Path) -> tuple[Mapping, Orientation | None]:
    info = image_info(path)
    stated = info.attributes.get("envmap")
    if stated == "latlong":
        return LatLongMap(), Orientation.OPENEXR
    if stated == "cube":
        return CubeStrip.openexr(), Orientation.OPENEXR
    rows, columns = info.rows, info.columns
    for high, wide, mapping in (
        (1, 2, LatLongMap()),
        (4, 3, CubeCross(vertical=True)),
        (3, 4, CubeCross(vertical=False)),
        (6, 1, CubeStrip(vertical=True)),
        (1, 6, CubeStrip(vertical=False)),
    ):
        if rows * wide == columns * high and rows % high == 0:
            return mapping, None
    square = "; a square one is AngularMap() or MirrorBall()" if rows == columns else ""
    raise FileError(
        f"{path}: {columns} x {rows} pixels do not tell the layout{square}. Pass mapping=: LatLongMap() 2:1, "
        "AngularMap() and MirrorBall() 1:1, DualParaboloid() 2:1, CubeCross() 3:4 or 4:3, CubeStrip() 1:6 or 6:1."
    )


def _alike(paths: list[Path]) -> list[np.ndarray]:
    images = [read_image(p) for p in paths]
    for path, image in zip(paths, images, strict=True):
        if image.shape != images[0].shape or image.shape[0] != image.shape[1]:
            raise FileError(
                f"{path} has {image.shape[1]} x {image.shape[0]} pixels; the pictures are square and of one size."
            )
    return images


def _faces(paths: list[Path]) -> list[Path]:
    """Six files in the order of `FACES`, known by the ends of their names."""
    found: dict[str, Path] = {}
    for path in paths:
        stem = path.stem.lower()
        # The longest ending: "left" ends in "ft" as well.
        named = max(
            ((len(e), face) for face, ends in _FACE_NAMES.items() for e in ends if stem.endswith(e)), default=None
        )
        if named is None or named[1] in found:
            raise FileError(
                f"{path}: which face is it? The names of six files end in px nx py ny pz nz, or {' '.join(FACES)}, "
                "each once."
            )
        found[named[1]] = path
    return [found[face] for face in FACES]
