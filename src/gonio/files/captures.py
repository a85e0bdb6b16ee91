"""A folder of photographs as a capture: described by a capture.toml (`capture_toml.py`), or in one of the layouts that
people have (`layouts.py`).

What is broken is refused; with partial=True the sound rest is taken, and `findings` says what was left out.
"""

from __future__ import annotations

import dataclasses
import os
import warnings
from pathlib import Path

import numpy as np

from ..cameras import Orthographic
from ..capture.model import Capture, above
from ..capture.photographs import Flattened, Photographs
from ..capture.silhouette import sphere_of_silhouette
from ..capture.turntable import Turntable
from ..errors import EncodingWarning, FileError, GonioError
from ..shapes.heightfield import HeightField
from ..shapes.mesh import Mesh
from ..shapes.view import Shape
from .brackets import BracketFiles
from .capture_toml import read_description
from .images import light, read_image, read_raster
from .layouts import MESHES, Found, layout_of
from .meshes import read_mesh
from .photographs import PhotographFiles
from .raster import Encoding
from .responses import read_response
from .store import stored


def read_capture(
    path: str | os.PathLike[str], encoding: Encoding | None = None, *, partial: bool = False
) -> Capture | Turntable:
    """The capture in a folder, or the one that a capture.toml, an .lp or a transforms.json names.

    A `Capture` is of photographs from one place, a `Turntable` of those from many. encoding: how codes stand for light,
    as in `read_image`; None is what the layout or the files say, and otherwise sRGB with an `EncodingWarning`. partial:
    take what is sound where photographs or lines are missing.

    Raises `FileError` naming the file and what is wrong with it.
    """
    path = Path(path)
    found = _sound(path, partial)
    files = _files(found, encoding)
    store, why = stored(files.files if isinstance(files, BracketFiles) else files)
    if why:
        found.notes.append(why)
    photographs: Photographs = (
        files if store is None else files.over(store) if isinstance(files, BracketFiles) else store
    )
    if files.assumed:
        warnings.warn(
            f"{path}: the photographs do not say how their codes stand for light; taken for sRGB. Say encoding='srgb' "
            "or what it is: a camera's own curve cannot be known from one exposure.",
            EncodingWarning,
            stacklevel=2,
        )
    try:
        if found.vignetting is not None and found.times is None:
            photographs = Flattened(photographs, read_image(found.vignetting))
        if found.cameras is not None:
            return _turntable(found, photographs)
        return _capture(found, photographs)
    except FileError:
        raise
    except GonioError as error:
        raise FileError(f"{path}: {error}") from error


def photograph_files(path: str | os.PathLike[str], *, partial: bool = False) -> PhotographFiles:
    """The photographs of the capture that `read_capture` finds, as files: of brackets, all exposures one after the
    other. Raises as it does."""
    found = _sound(Path(path), partial)
    return PhotographFiles(found.folder, [name for group in found.names for name in group], found.encoding)


def _sound(path: Path, partial: bool) -> Found:
    """What the layout says, where it is sound or may be partial."""
    description = path if path.suffix.lower() == ".toml" else path / "capture.toml"
    found = read_description(description) if description.exists() or description == path else layout_of(path)
    if found.defects and not partial:
        way = f" Pass partial=True (--partial) to take the {len(found.names)} that are sound." if found.names else ""
        raise FileError(f"{path}: {'; '.join(found.defects)}.{way}")
    if not found.names:
        raise FileError(f"{path} has no photograph that can be read.")
    return found


def _files(found: Found, encoding: Encoding | None) -> PhotographFiles | BracketFiles:
    chosen = encoding if encoding is not None else found.encoding
    if found.times is None:
        return PhotographFiles(found.folder, [name for (name,) in found.names], chosen)
    response = None if found.response is None or encoding is not None else read_response(found.response)
    vignetting = None if found.vignetting is None else read_image(found.vignetting)
    return BracketFiles(found.folder, found.names, found.times, response or chosen, found.noise, vignetting)


def _capture(found: Found, photographs: Photographs) -> Capture:
    size = photographs.size
    normals, known = _normals(found.normals, size)
    mask = _mask(found.mask, size) if found.mask else known
    if found.mask and known is not None and not np.all(known[mask]):
        found.notes.append(f"{found.normals}: {np.count_nonzero(mask & ~known)} pixels of the mask have no normal")
        mask = mask & known
    camera = found.camera or above(size, found.texel)
    shape = _shape(found)
    if found.form == "flat" and normals is None:
        normals = np.broadcast_to((0.0, 0.0, 1.0), (*size, 3))
    if found.form == "sphere":
        if mask is None:
            raise FileError(f"{found.folder}: a sphere is found by its silhouette: give a mask.")
        shape = sphere_of_silhouette(mask, camera, found.radius).sphere
        if isinstance(camera, Orthographic):
            # Its distance is unknown, and does not matter: the world's plane goes through its middle.
            shape = dataclasses.replace(shape, centre=shape.centre * (1, 1, 0))
    return Capture(
        photographs,
        found.lights,
        mask,
        normals,
        shape,
        camera,
        None if found.eye is None else np.array(found.eye),
        found.layout,
        (*found.defects, *found.notes),
    )


def _turntable(found: Found, photographs: Photographs) -> Turntable:
    shape = _shape(found)
    if found.form or (shape is not None and not isinstance(shape, Mesh)):
        where = found.shape if isinstance(found.shape, Path) else found.folder
        raise FileError(f"{where}: the shape of photographs from many places is a mesh.")
    assert found.cameras is not None
    return Turntable(
        photographs,
        found.cameras,
        shape,
        found.lights,
        found.texels,
        layout=found.layout,
        findings=(*found.defects, *found.notes),
    )


def _shape(found: Found) -> Shape | None:
    """A mesh, or an image of heights."""
    path = found.shape
    if not isinstance(path, Path):
        return path
    if path.suffix.lower() in MESHES:
        return read_mesh(path)
    heights = light(path, read_raster(path), "linear")[..., 0].astype(np.float64)
    return HeightField(heights, found.texel if found.spacing is None else found.spacing)


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
    """Unit normals (rows, columns, 3), and where they are known: where the file holds a vector of length 1, to 5 %."""
    if path is None:
        return None, None
    normals = _matrix(path) if path.suffix == ".mat" else _coded(path)
    if normals.shape != (*size, 3):
        raise FileError(f"{path} has shape {normals.shape}; normals of {size} pixels are wanted.")
    length = np.linalg.norm(normals, axis=2)
    known = np.abs(length - 1) < 0.05
    if not known.any():
        raise FileError(f"{path} holds no unit normal.")
    normals[known] /= length[known][:, None]
    return np.where(known[..., None], normals, 0.0), known


def _coded(path: Path) -> np.ndarray:
    """Normals of RGB codes: a component c as (c + 1) / 2."""
    samples = read_raster(path).samples
    if samples.shape[2] != 3 or samples.dtype.kind != "u":
        raise FileError(f"{path} has shape {samples.shape}, {samples.dtype}; normals are RGB codes.")
    return 2 * samples.astype(np.float64) / np.iinfo(samples.dtype).max - 1


def _matrix(path: Path) -> np.ndarray:
    """Normals of DiLiGenT's MATLAB file."""
    from scipy.io import loadmat

    try:
        normals = np.asarray(loadmat(path, variable_names=["Normal_gt"])["Normal_gt"])
        if normals.dtype.kind != "f":
            raise ValueError(f"Normal_gt is {normals.dtype}")
        return normals.astype(np.float64)
    except Exception as error:  # of whatever kind SciPy meets
        reason = "it has no Normal_gt" if isinstance(error, KeyError) else " ".join(str(error).split())[:120]
        raise FileError(f"{path} holds no normals of DiLiGenT: {reason}. Take it away to do without.") from error
