"""Folders of photographs in the layouts that other programs leave them in, found by what lies there.

    *.lp                   RTI: photographs and where their lights stand (`lp.py`)
    light_directions.txt   DiLiGenT: light_intensities.txt, filenames.txt, mask.png, Normal_gt.mat; codes are linear
    transforms.json        cameras of many places (NeRF), or COLMAP's; a mesh beside them is the shape
    NAME.0.tga, ...        numbered photographs, NAME.mask.tga, lights.txt one folder up (University of Washington)
    images                 photographs in the order of their names, lights unknown

mask.png and normals.png beside photographs count in every layout of one place. Names in a list are looked up in its
folder and below, never outside. What is broken is told as a defect, and what is sound is kept.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ..cameras import Camera
from ..capture.exposure import Noise
from ..capture.lighting import distant_lights
from ..errors import FileError
from ..lights.model import Light
from ..shapes.view import Shape
from .camera_poses import read_cameras
from .lp import read_lp
from .raster import Encoding

IMAGES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".tga", ".exr", ".hdr", ".pfm")
MESHES = (".obj", ".ply", ".stl", ".off")
COMPANIONS = ("mask.png", "normals.png")
_CAMERAS = (".", "sparse/0", "sparse", "colmap/sparse/0")
_NUMBERED = re.compile(r"(.+)\.(\d+)\.(\w+)")


class Found:
    """What a layout says: photographs, lights, cameras, files beside; and what is wrong with it.

    names: of each photograph, the files of its exposures, of which there are as many as `times`. cameras: of each
    photograph, where they are many; otherwise `texel`, `camera` and `eye` tell of the only one.
    """

    def __init__(self, folder: Path, layout: str) -> None:
        self.folder, self.layout = folder, layout
        self.names: list[tuple[str, ...]] = []
        self.times: tuple[float, ...] | None = None
        self.lights: tuple[Light, ...] | None = None
        self.cameras: tuple[Camera, ...] | None = None
        self.camera: Camera | None = None
        self.texel: float = 1.0
        self.eye: tuple[float, ...] | None = None
        self.encoding: Encoding | None = None
        self.response: Path | None = None
        self.vignetting: Path | None = None
        self.noise: Noise | None = None
        self.mask: Path | None = None
        self.normals: Path | None = None
        self.shape: Path | Shape | None = None
        self.spacing: float | None = None
        self.form: str | None = None  # "flat" or "sphere", of closed form
        self.radius: float | None = None
        self.texels: tuple[int, int] | None = None
        self.notes: list[str] = []
        self.defects: list[str] = []

    def keep(self, good: np.ndarray) -> None:
        """Only these photographs, with their lights and cameras."""
        kept = np.flatnonzero(good)
        self.names = [self.names[k] for k in kept]
        if self.lights is not None:
            self.lights = tuple(self.lights[k] for k in kept)
        if self.cameras is not None:
            self.cameras = tuple(self.cameras[k] for k in kept)


def layout_of(path: Path) -> Found:
    """What stands in a folder, or in the list of lights or cameras at `path`. Raises `FileError` for anything else."""
    if path.suffix.lower() == ".lp":
        return _rti(path)
    if path.suffix.lower() == ".json":
        return _turntable(path.parent, path)
    if not path.is_dir():
        raise FileError(f"{path} is neither a folder of photographs, nor a capture.toml, an .lp or a transforms.json.")
    lists = sorted(entry for entry in path.iterdir() if entry.suffix.lower() == ".lp")
    if len(lists) > 1:
        raise FileError(f"{path} has several lists of lights ({', '.join(x.name for x in lists)}): give one of them.")
    if lists:
        return _rti(lists[0])
    if (path / "light_directions.txt").exists():
        return _diligent(path)
    for place in _CAMERAS:
        if any((path / place / name).exists() for name in ("transforms.json", "cameras.bin", "cameras.txt")):
            return _turntable(path, path / place)
    return _plain(path)


def _rti(path: Path) -> Found:
    lights, found = read_lp(path), Found(path.parent, "RTI")
    places = [place_of(path.parent, name) for name in lights.names]
    images = _images(path.parent)
    if not any(places) and len(images) == len(lights.names):
        places = list(images)
        found.notes.append(f"{path.name} names other files; its lights are taken in the order of the images")
    found.lights = distant_lights(lights.directions)
    _take(found, lights.names, places, path.name)
    if lights.stated != len(lights.names):
        found.defects.append(f"line 1 of {path.name} says {lights.stated} lights, {len(lights.names)} follow")
    names = [name for (name,) in found.names]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise FileError(f"{path}: {twice} has two lights.")
    unused = sorted(set(images) - set(names))
    if unused:
        found.notes.append(
            f"{len(unused)} images have no light: {', '.join(unused[:3])}{' ...' if len(unused) > 3 else ''}"
        )
    length = np.linalg.norm(lights.vectors, axis=1)
    if np.max(np.abs(length - 1)) > 1e-3:
        found.notes.append(f"vectors of {path.name} have lengths {length.min():.3g} to {length.max():.3g}: normalised")
    _beside(found)
    return found


def _diligent(folder: Path) -> Found:
    found = Found(folder, "DiLiGenT")
    directions = _table(folder / "light_directions.txt", 3)
    directions = _unit(folder / "light_directions.txt", directions)
    found.encoding, intensities = "linear", None
    if (folder / "light_intensities.txt").exists():
        intensities = _table(folder / "light_intensities.txt", 3)
        if not np.all(intensities > 0):
            raise FileError(f"{folder / 'light_intensities.txt'}: an intensity is not positive.")
    if (folder / "filenames.txt").exists():
        listed = [line.strip() for line in text_of(folder / "filenames.txt").splitlines() if line.strip()]
        places = [place_of(folder, name) for name in listed]
    else:
        listed = _images(folder)
        places = list(listed)
    count = len(directions)
    numbers = {"photographs": len(places), "intensities": count if intensities is None else len(intensities)}
    for what, number in numbers.items():
        if number != count:
            raise FileError(f"{folder} has {count} light directions and {number} {what}.")
    found.lights = distant_lights(directions, intensities)
    _take(found, listed, places, "filenames.txt")
    _beside(found)
    for name in ("Normal_gt.mat", "Normal_gt.png", "normal_gt.png"):
        if found.normals is None and (folder / name).exists():
            found.normals = folder / name
    return found


def _turntable(folder: Path, path: Path) -> Found:
    found = Found(folder, "turntable")
    nerf = path / "transforms.json"
    where = path.name if path.is_file() else nerf.name if nerf.exists() else "COLMAP's model"
    cameras = read_cameras(path)
    found.cameras = tuple(cameras.values())
    # COLMAP names photographs within images/; NeRF's first scenes leave the suffix away.
    forms = ("{}", "images/{}", "{}.png", "images/{}.png")
    places = [
        next((place for form in forms if (place := place_of(folder, form.format(name)))), None) for name in cameras
    ]
    _take(found, list(cameras), places, where)
    meshes = sorted(entry for entry in folder.iterdir() if entry.suffix.lower() in MESHES)
    if len(meshes) == 1:
        found.shape = meshes[0]
    elif meshes:
        found.notes.append(
            f"{len(meshes)} meshes ({', '.join(mesh.name for mesh in meshes[:3])}) lie in {folder}: none is used"
        )
    return found


def _plain(folder: Path) -> Found:
    names = _images(folder)
    numbered = [match for name in names if (match := _NUMBERED.fullmatch(name))]
    stems = {(match[1], match[3]) for match in numbered}
    masks = [name for name in names if re.fullmatch(r".+\.mask\.\w+", name)]
    found = Found(folder, "photographs")
    if len(stems) == 1 and len(numbered) > 1:
        found.layout = "numbered photographs"
        found.names = [(match[0],) for match in sorted(numbered, key=lambda match: int(match[2]))]
        if len(masks) == 1:
            found.mask = folder / masks[0]
        lights = folder.parent / "lights.txt"
        if lights.exists():
            rows = _table(lights, 3, header=True)
            if len(rows) == len(found.names):
                found.lights = distant_lights(_unit(lights, rows))
            else:
                found.notes.append(f"{lights} has {len(rows)} lights for {len(found.names)} photographs: not used")
    else:
        found.names = [(name,) for name in names if name not in masks]
    if not found.names:
        raise FileError(f"{folder} holds no photographs ({' '.join(IMAGES)}).")
    _beside(found)
    return found


def _take(found: Found, listed: list[str] | tuple[str, ...], places: list[str | None], where: str) -> None:
    """Those of the photographs a file lists that exist, with their lights; the others are a defect of it."""
    found.names = [(place or "",) for place in places]
    lost = [name for name, place in zip(listed, places, strict=True) if place is None]
    if lost:
        found.defects.append(f"{', '.join(lost[:5])}{' ...' if len(lost) > 5 else ''} of {where} does not exist")
    found.keep(np.array([place is not None for place in places]))


def place_of(folder: Path, name: str) -> str | None:
    """Where a listed file lies, relative to the folder: by its path, or by its name alone; None if nowhere."""
    inside = folder.resolve()
    try:
        place = (folder / name).resolve()
        if place.is_file() and place.is_relative_to(inside):
            return place.relative_to(inside).as_posix()
    except (OSError, ValueError):
        return None
    wanted = re.split(r"[/\\]", name)[-1].lower()
    for entry in _images(folder):
        if wanted in (entry.lower(), Path(entry).stem.lower()) and (folder / entry).resolve().is_relative_to(inside):
            return entry
    return None


def text_of(path: Path) -> str:
    """The text of a file. Raises `FileError` where it cannot be read, or is none."""
    try:
        return path.read_text("utf-8-sig")
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error
    except UnicodeDecodeError as error:
        raise FileError(f"{path}: byte {error.start} is no text.") from error


def _images(folder: Path) -> list[str]:
    """Images in a folder, in the order of their names, without those that stand for something else."""
    try:
        entries = sorted(folder.iterdir())
    except OSError as error:
        raise FileError(f"{folder} cannot be read: {error.strerror or error}.") from error
    return [
        entry.name
        for entry in entries
        if entry.suffix.lower() in IMAGES
        and entry.name.lower() not in (*COMPANIONS, "normal_gt.png")
        and entry.is_file()
    ]


def _beside(found: Found) -> None:
    """mask.png and normals.png where no other was named."""
    for name in ("mask", "normals"):
        if getattr(found, name) is None and (found.folder / f"{name}.png").exists():
            setattr(found, name, found.folder / f"{name}.png")


def _unit(path: Path, directions: np.ndarray) -> np.ndarray:
    """`directions` (N, 3) of a file at length 1. Raises `FileError` where one points nowhere."""
    length = np.linalg.norm(directions, axis=1, keepdims=True)
    if not np.all(length > 1e-4):
        raise FileError(f"{path}: a direction is 0.")
    unit: np.ndarray = directions / length
    return unit


def _table(path: Path, columns: int, header: bool = False) -> np.ndarray:
    """Numbers (rows, columns) of a text file, after a first line with their count where there is a header."""
    lines = [line.split() for line in text_of(path).splitlines() if line.strip()]
    try:
        rows = np.array([[float(word) for word in line] for line in lines[1 if header else 0 :]])
    except ValueError as error:
        raise FileError(f"{path}: {error}; rows of {columns} numbers are wanted.") from error
    if rows.ndim != 2 or rows.shape[1] != columns or not np.isfinite(rows).all():
        raise FileError(f"{path} is not rows of {columns} numbers.")
    return rows
