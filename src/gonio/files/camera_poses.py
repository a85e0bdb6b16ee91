"""Cameras of several photographs of one scene, whichever file has them.

    transforms.json                       NeRF, instant-ngp, nerfstudio     `transforms`
    cameras.txt images.txt, or .bin       COLMAP                            `colmap`

Not here: the formats themselves.
"""

from __future__ import annotations

import os
from pathlib import Path

from ..cameras import Pinhole
from ..errors import FileError
from .colmap import read_model
from .transforms import read_transforms


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
    if path.name in ("cameras.bin", "images.bin", "cameras.txt", "images.txt"):
        cameras = read_model(path)
    elif path.suffix.lower() == ".json":
        cameras = read_transforms(path)
    else:
        raise FileError(f"{path} is neither a transforms.json, nor cameras or images of COLMAP (.txt or .bin).")
    if not cameras:
        raise FileError(f"{path} has no camera of any photograph.")
    return cameras
