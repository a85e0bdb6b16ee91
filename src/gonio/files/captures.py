"""A folder of photographs as a capture, in the layouts that people have.

    capture.toml           gonio's own: `CaptureFile` has its fields
    *.lp                   RTI: photographs and where their lights stand (`lp.py`)
    light_directions.txt   DiLiGenT: with light_intensities.txt, filenames.txt, mask.png; codes are linear
    NAME.0.tga, ...        numbered photographs, NAME.mask.tga, lights.txt one folder up (University of Washington)
    images                 photographs in the order of their names, lights unknown

mask.png and normals.png (a component c as (c + 1) / 2) beside photographs count in every layout. What is broken is
refused; with partial=True the sound rest is taken, and `findings` says what was left out. Names in a list are looked up
in its folder and below, never outside.
"""

from __future__ import annotations

import os
import re
import tomllib
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..capture.model import Capture
from ..errors import EncodingWarning, FileError, GonioError
from .images import read_raster
from .lp import read_lp
from .photographs import PhotographFiles
from .raster import Encoding
from .store import stored
from .whole import writing

IMAGES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".tga", ".exr", ".hdr", ".pfm")
_COMPANIONS = ("mask.png", "normals.png")
_NUMBERED = re.compile(r"(.+)\.(\d+)\.(\w+)")


class _Found:
    """What a layout says: names, lights, files beside; and what is wrong with it."""

    def __init__(self, folder: Path, layout: str) -> None:
        self.folder, self.layout = folder, layout
        self.names: list[str] = []
        self.directions: np.ndarray | None = None
        self.intensities: np.ndarray | None = None
        self.encoding: Encoding | None = None
        self.mask: Path | None = None
        self.normals: Path | None = None
        self.notes: list[str] = []
        self.defects: list[str] = []

    def keep(self, good: np.ndarray) -> None:
        """Only these photographs, with their lights."""
        self.names = [name for name, kept in zip(self.names, good, strict=True) if kept]
        if self.directions is not None:
            self.directions = self.directions[good]
        if self.intensities is not None:
            self.intensities = self.intensities[good]


def read_capture(path: str | os.PathLike[str], encoding: Encoding | None = None, *, partial: bool = False) -> Capture:
    """The capture in a folder, or the one that a capture.toml or an .lp names.

    encoding: how codes stand for light, as in `read_image`; None is what the layout or the files say, and otherwise
    sRGB with an `EncodingWarning`. partial: take what is sound where photographs or lines are missing.

    Raises `FileError` naming the file and what is wrong with it.
    """
    path = Path(path)
    found = _sound(path, partial)
    files = PhotographFiles(found.folder, found.names, encoding if encoding is not None else found.encoding)
    store, why = stored(files)
    if why:
        found.notes.append(why)
    photographs = files if store is None else store
    if photographs.assumed:
        warnings.warn(
            f"{path}: the photographs do not say how their codes stand for light; taken for sRGB. Say encoding='srgb' "
            "or what it is: a camera's own curve cannot be known from one exposure.",
            EncodingWarning,
            stacklevel=2,
        )
    normals, known = _normals(found.normals, photographs.size)
    mask = _mask(found.mask, photographs.size) if found.mask else known
    if found.mask and known is not None and not np.all(known[mask]):
        found.notes.append(f"{found.normals}: {np.count_nonzero(mask & ~known)} pixels of the mask have no normal")
        mask = mask & known
    try:
        return Capture(
            photographs,
            found.directions,
            found.intensities,
            mask,
            normals,
            found.layout,
            (*found.defects, *found.notes),
        )
    except GonioError as error:
        raise FileError(f"{path}: {error}") from error


def photograph_files(path: str | os.PathLike[str], *, partial: bool = False) -> PhotographFiles:
    """The photographs of the capture that `read_capture` finds, as files. Raises as it does."""
    found = _sound(Path(path), partial)
    return PhotographFiles(found.folder, found.names, found.encoding)


def write_capture(folder: str | os.PathLike[str], capture: Capture) -> Path:
    """Write capture.toml beside photographs that lie in `folder` already: their names and lights. Answers its path.

    Whole or not at all.
    """
    folder = Path(folder)
    lines = ["version = 1", "photographs = ["]
    lines += [f"    {_quoted(name)}," for name in capture.photographs.names]
    lines.append("]")
    encoding = getattr(capture.photographs, "encoding", None)
    if encoding is not None:
        lines.append(f"encoding = {_quoted(encoding) if isinstance(encoding, str) else float(encoding)}")
    for name in _COMPANIONS:
        if (folder / name).exists():
            lines.append(f"{name.removesuffix('.png')} = {_quoted(name)}")
    if capture.directions is not None:
        lines += ["", "[lights]", "directions = ["]
        lines += [f"    [{x:.9g}, {y:.9g}, {z:.9g}]," for x, y, z in capture.directions.tolist()]
        lines.append("]")
        if not np.all(capture.intensities == 1):
            lines.append("intensities = [")
            lines += [f"    [{r:.9g}, {g:.9g}, {b:.9g}]," for r, g, b in capture.intensities.tolist()]
            lines.append("]")
    path = folder / "capture.toml"
    with writing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", "utf-8")
    return path


def _sound(path: Path, partial: bool) -> _Found:
    """What the layout says, where it is sound or may be partial."""
    found = _layout(path)
    if found.defects and not partial:
        raise FileError(
            f"{path}: {'; '.join(found.defects)}. Pass partial=True (--partial) to take the {len(found.names)} that "
            "are sound."
        )
    if not found.names:
        raise FileError(f"{path} has no photograph that can be read.")
    return found


def _layout(path: Path) -> _Found:
    if path.suffix.lower() == ".toml":
        return _own(path)
    if path.suffix.lower() == ".lp":
        return _rti(path)
    if not path.is_dir():
        raise FileError(f"{path} is neither a folder of photographs, nor a capture.toml or an .lp.")
    if (path / "capture.toml").exists():
        return _own(path / "capture.toml")
    lists = sorted(entry for entry in path.iterdir() if entry.suffix.lower() == ".lp")
    if len(lists) > 1:
        raise FileError(f"{path} has several lists of lights ({', '.join(x.name for x in lists)}): give one of them.")
    if lists:
        return _rti(lists[0])
    if (path / "light_directions.txt").exists():
        return _diligent(path)
    return _plain(path)


def _rti(path: Path) -> _Found:
    lights, found = read_lp(path), _Found(path.parent, "RTI")
    places = [_place(path.parent, name) for name in lights.names]
    images = _images(path.parent)
    if not any(places) and len(images) == len(lights.names):
        places = list(images)
        found.notes.append(f"{path.name} names other files; its lights are taken in the order of the images")
    good = np.array([place is not None for place in places])
    found.names, found.directions = [place or "" for place in places], lights.directions
    lost = [name for name, place in zip(lights.names, places, strict=True) if place is None]
    if lost:
        found.defects.append(f"{', '.join(lost[:5])}{' ...' if len(lost) > 5 else ''} of {path.name} does not exist")
    if lights.stated != len(lights.names):
        found.defects.append(f"line 1 of {path.name} says {lights.stated} lights, {len(lights.names)} follow")
    found.keep(good)
    if len(set(found.names)) < len(found.names):
        twice = next(name for name in found.names if found.names.count(name) > 1)
        raise FileError(f"{path}: {twice} has two lights.")
    unused = sorted(set(images) - set(found.names))
    if unused:
        found.notes.append(
            f"{len(unused)} images have no light: {', '.join(unused[:3])}{' ...' if len(unused) > 3 else ''}"
        )
    length = np.linalg.norm(lights.vectors, axis=1)
    if np.max(np.abs(length - 1)) > 1e-3:
        found.notes.append(f"vectors of {path.name} have lengths {length.min():.3g} to {length.max():.3g}: normalised")
    _beside(found)
    return found


def _diligent(folder: Path) -> _Found:
    found = _Found(folder, "DiLiGenT")
    found.directions = _table(folder / "light_directions.txt", 3)
    length = np.linalg.norm(found.directions, axis=1, keepdims=True)
    if not np.all(length > 1e-4):
        raise FileError(f"{folder / 'light_directions.txt'}: a direction is 0.")
    found.directions = found.directions / length
    found.encoding = "linear"
    if (folder / "light_intensities.txt").exists():
        found.intensities = _table(folder / "light_intensities.txt", 3)
        if not np.all(found.intensities > 0):
            raise FileError(f"{folder / 'light_intensities.txt'}: an intensity is not positive.")
    if (folder / "filenames.txt").exists():
        listed = [line.strip() for line in _text(folder / "filenames.txt").splitlines() if line.strip()]
        places = [_place(folder, name) for name in listed]
    else:
        listed = _images(folder)
        places = list(listed)
    count = len(found.directions)
    numbers = {
        "photographs": len(places),
        "intensities": count if found.intensities is None else len(found.intensities),
    }
    for what, number in numbers.items():
        if number != count:
            raise FileError(f"{folder} has {count} light directions and {number} {what}.")
    found.names = [place or "" for place in places]
    lost = [name for name, place in zip(listed, places, strict=True) if place is None]
    if lost:
        found.defects.append(f"{', '.join(lost[:5])} of filenames.txt does not exist")
    found.keep(np.array([place is not None for place in places]))
    _beside(found)
    for name in ("Normal_gt.png", "normal_gt.png"):
        if found.normals is None and (folder / name).exists():
            found.normals = folder / name
    return found


def _plain(folder: Path) -> _Found:
    names = _images(folder)
    numbered = [match for name in names if (match := _NUMBERED.fullmatch(name))]
    stems = {(match[1], match[3]) for match in numbered}
    masks = [name for name in names if re.fullmatch(r".+\.mask\.\w+", name)]
    found = _Found(folder, "photographs")
    if len(stems) == 1 and len(numbered) > 1:
        found.layout = "numbered photographs"
        found.names = [match[0] for match in sorted(numbered, key=lambda match: int(match[2]))]
        if len(masks) == 1:
            found.mask = folder / masks[0]
        lights = folder.parent / "lights.txt"
        if lights.exists():
            rows = _table(lights, 3, header=True)
            if len(rows) == len(found.names):
                found.directions = rows / np.linalg.norm(rows, axis=1, keepdims=True)
            else:
                found.notes.append(f"{lights} has {len(rows)} lights for {len(found.names)} photographs: not used")
    else:
        found.names = [name for name in names if name not in masks]
    if not found.names:
        raise FileError(f"{folder} holds no photographs ({' '.join(IMAGES)}).")
    _beside(found)
    return found


def _own(path: Path) -> _Found:
    try:
        fields = tomllib.loads(_text(path))
    except tomllib.TOMLDecodeError as error:
        raise FileError(f"{path} is no TOML: {error}.") from error
    found = _Found(path.parent, "capture.toml")

    def take(name: str, good: Callable[[Any], bool], wanted: str, table: dict[str, Any] = fields) -> Any:
        value = table.pop(name, None)
        if value is not None and not good(value):
            raise FileError(f"{path}: {name} = {value!r:.60}; {wanted} is wanted.")
        return value

    if take("version", lambda v: v == 1, "1") is None:
        raise FileError(f"{path} has no version; version = 1 is wanted.")
    names = take("photographs", _is_names, "a list of names")
    if names is None:
        raise FileError(f"{path} has no photographs.")
    found.encoding = take("encoding", lambda v: v in ("srgb", "linear") or _is_number(v), "'srgb', 'linear' or a power")
    places = [_place(path.parent, name) for name in names]
    if None in places:
        lost = [name for name, place in zip(names, places, strict=True) if place is None]
        found.defects.append(f"{', '.join(lost[:5])} does not exist in its folder")
    for name in ("mask", "normals"):
        value = take(name, lambda v: isinstance(v, str), "the name of an image")
        if value is not None:
            place = _place(path.parent, value)
            if place is None:
                raise FileError(f"{path}: {name} = {value!r} does not exist in its folder.")
            setattr(found, name, path.parent / place)
    lights = take("lights", lambda v: isinstance(v, dict), "a table") or {}
    for name in ("directions", "intensities"):
        rows = take(f"{name}", _is_table, "a list of [x, y, z]", lights)
        if rows is not None:
            if len(rows) != len(names):
                raise FileError(f"{path}: lights.{name} has {len(rows)} rows for {len(names)} photographs.")
            setattr(found, name, np.array(rows, dtype=np.float64))
    for left in (*fields, *(f"lights.{name}" for name in lights)):
        raise FileError(f"{path}: the field {left} is not known.")
    found.names = [place or "" for place in places]
    found.keep(np.array([place is not None for place in places]))
    return found


def _is_names(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(x, str) for x in value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and value > 0


def _is_table(value: Any) -> bool:
    return isinstance(value, list) and all(
        isinstance(row, list) and len(row) == 3 and all(isinstance(x, int | float) for x in row) for row in value
    )


def _quoted(text: str) -> str:
    """A TOML string."""
    escaped = "".join(c if c.isprintable() and c not in '"\\' else f"\\u{ord(c):04x}" for c in text)
    return f'"{escaped}"'


def _place(folder: Path, name: str) -> str | None:
    """Where a listed photograph lies, relative to the folder: by its path, or by its name alone; None if nowhere."""
    inside = folder.resolve()
    try:
        place = (folder / name).resolve()
        if place.is_file() and place.is_relative_to(inside):
            return place.relative_to(inside).as_posix()
    except (OSError, ValueError):
        return None
    wanted = re.split(r"[/\\]", name)[-1].lower()
    for entry in _images(folder):
        if wanted in (entry.lower(), Path(entry).stem.lower()):
            return entry
    return None


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
        and entry.name.lower() not in (*_COMPANIONS, "normal_gt.png")
        and entry.is_file()
    ]


def _beside(found: _Found) -> None:
    """mask.png and normals.png where no other was named."""
    for name in ("mask", "normals"):
        if getattr(found, name) is None and (found.folder / f"{name}.png").exists():
            setattr(found, name, found.folder / f"{name}.png")


def _mask(path: Path, size: tuple[int, int]) -> np.ndarray:
    """(rows, columns): what is brighter than half."""
    samples = read_raster(path).samples
    if samples.shape[:2] != size:
        raise FileError(f"{path} has {samples.shape[:2]} pixels, the photographs {size}.")
    half = np.iinfo(samples.dtype).max / 2 if samples.dtype.kind == "u" else 0.5
    mask = np.asarray(samples.max(axis=2) > half)
    if not mask.any():
        raise FileError(f"{path} marks no pixel.")
    return mask


def _normals(path: Path | None, size: tuple[int, int]) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Unit normals (rows, columns, 3), and where they are known: where the image holds a vector of length 1, to 5 %."""
    if path is None:
        return None, None
    samples = read_raster(path).samples
    if samples.shape[:2] != size or samples.shape[2] != 3 or samples.dtype.kind != "u":
        raise FileError(f"{path} has shape {samples.shape}, {samples.dtype}; normals of {size} pixels are RGB codes.")
    normals = 2 * samples.astype(np.float64) / np.iinfo(samples.dtype).max - 1
    length = np.linalg.norm(normals, axis=2)
    known = np.abs(length - 1) < 0.05
    if not known.any():
        raise FileError(f"{path} holds no unit normal.")
    normals[known] /= length[known][:, None]
    return np.where(known[..., None], normals, 0.0), known


def _table(path: Path, columns: int, header: bool = False) -> np.ndarray:
    """Numbers (rows, columns) of a text file, after a first line with their count where there is a header."""
    lines = [line.split() for line in _text(path).splitlines() if line.strip()]
    try:
        rows = np.array([[float(word) for word in line] for line in lines[1 if header else 0 :]])
    except ValueError as error:
        raise FileError(f"{path}: {error}; rows of {columns} numbers are wanted.") from error
    if rows.ndim != 2 or rows.shape[1] != columns or not np.isfinite(rows).all():
        raise FileError(f"{path} is not rows of {columns} numbers.")
    return rows


def _text(path: Path) -> str:
    try:
        return path.read_text("utf-8-sig")
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error
    except UnicodeDecodeError as error:
        raise FileError(f"{path}: byte {error.start} is no text.") from error
