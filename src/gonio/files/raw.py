"""Camera raw files (DNG, NEF, CR2, CR3, ARW, ...), by LibRaw through the extra `gonio[raw]`.

Linear in the light at the sensor: demosaicked without curve, automatic brightness or highlight repair, white balance
and matrix to linear sRGB as the camera wrote them. 1 is the sensor's saturation.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MissingExtraError
from .raster import ImageInfo, Raster, decoding, require_size

# fmt: off
SUFFIXES = frozenset((
    ".3fr", ".arw", ".cr2", ".cr3", ".crw", ".dcr", ".dng", ".erf", ".fff", ".iiq", ".kdc", ".mef", ".mos", ".mrw",
    ".nef", ".nrw", ".orf", ".pef", ".raf", ".raw", ".rw2", ".rwl", ".sr2", ".srf", ".srw", ".x3f",
))
# fmt: on


def info(path: Path) -> ImageInfo:
    with decoding(path), _library(path).imread(str(path)) as raw:
        sizes = raw.sizes
        attributes = {"black": list(raw.black_level_per_channel), "white": raw.white_level}
        names = tuple(raw.color_desc.decode())
        return ImageInfo("camera raw", sizes.height, sizes.width, names, "uint16", "linear", attributes)


def read(path: Path) -> Raster:
    """uint16 codes, of which the highest is the sensor's saturation."""
    library = _library(path)
    with decoding(path), library.imread(str(path)) as raw:
        require_size(path, raw.sizes.raw_height, raw.sizes.raw_width)
        pixels = raw.postprocess(
            gamma=(1, 1),
            no_auto_bright=True,
            output_bps=16,
            use_camera_wb=True,
            output_color=library.ColorSpace.sRGB,
            demosaic_algorithm=library.DemosaicAlgorithm.LINEAR,
            highlight_mode=library.HighlightMode.Clip,
        )
    return Raster(np.ascontiguousarray(pixels), "linear")


def _library(path: Path) -> Any:
    try:
        import rawpy
    except ImportError as error:
        raise MissingExtraError(
            f"{path} is a camera's raw file, which needs rawpy: pip install 'gonio[raw]'"
        ) from error
    return rawpy
