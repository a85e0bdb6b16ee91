"""A capture's photographs in image files of one size, decoded when they are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..capture.photographs import Photograph, Photographs
from ..errors import FileError
from .images import image_info, light, read_raster
from .raster import Encoding, Raster


class PhotographFiles(Photographs):
    """Photographs at folder / names. encoding: as in `read_image`; where it is None, what a file states, or sRGB.

    `stated`: what all files state of that; `assumed`: nothing does. `dtypes`: those of their samples. Raises
    `FileError` where a file is no image, or they are not of one size.
    """

    def __init__(self, folder: Path, names: Sequence[str], encoding: Encoding | None = None) -> None:
        self.folder, self.names, self.encoding = folder, tuple(names), encoding
        infos = [image_info(folder / name) for name in self.names]
        self.size = infos[0].rows, infos[0].columns
        self.dtypes = sorted({info.dtype for info in infos})
        encodings = {info.encoding for info in infos}
        self.stated = encodings.pop() if len(encodings) == 1 else None
        self.assumed = encoding is None and any(info.encoding is None for info in infos)
        for name, info in zip(self.names, infos, strict=True):
            if (info.rows, info.columns) != self.size:
                raise FileError(
                    f"{folder / name} has {info.rows} x {info.columns} pixels, {self.names[0]} has "
                    f"{self.size[0]} x {self.size[1]}: photographs of a capture are of one size."
                )

    def read(self, k: int) -> Photograph:
        return photograph(self.folder / self.names[k], self.raster(k), self.encoding)

    def raster(self, k: int) -> Raster:
        """The samples of photograph k as its file has them."""
        return read_raster(self.folder / self.names[k])


def photograph(path: Path, raster: Raster, encoding: Encoding | None) -> Photograph:
    """What the samples (..., C) of a file tell. Encoded as `encoding` says, or as the file does, or in sRGB."""
    chosen = encoding if encoding is not None else raster.encoding
    radiance = light(path, raster, "srgb" if chosen is None else chosen)
    dtype = raster.samples.dtype
    clipped = raster.samples == (np.iinfo(dtype).max if dtype.kind == "u" else np.inf)
    return Photograph(radiance, np.logical_or.reduce(np.moveaxis(clipped, -1, 0)))
