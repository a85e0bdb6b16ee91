"""A capture's photographs in image files of one size, decoded when they are asked for."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .._kernels.photographs import decode
from ..capture.photographs import Photograph, Photographs
from ..errors import FileError
from .images import image_info, light, light_of_codes, read_raster
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

    def pick(self, k: int, at: np.ndarray) -> Photograph:
        return picked(self.folder / self.names[k], self.raster(k), self.encoding, at)

    def raster(self, k: int) -> Raster:
        """The samples of photograph k as its file has them."""
        return read_raster(self.folder / self.names[k])


def photograph(path: Path, raster: Raster, encoding: Encoding | None) -> Photograph:
    """What the samples (rows, columns, C) of a file tell, encoded as `curve` has it."""
    samples = raster.samples
    radiance = light(path, raster, curve(raster, encoding))
    if samples.dtype.kind != "u":  # infinity, the brightest there is, has been refused
        return Photograph(radiance, np.zeros(samples.shape[:2], bool))
    brightest = samples == np.iinfo(samples.dtype).max
    return Photograph(radiance, functools.reduce(np.logical_or, np.moveaxis(brightest, -1, 0)))


def picked(path: Path, raster: Raster, encoding: Encoding | None, at: np.ndarray) -> Photograph:
    """`photograph` at pixels `at` (P,), counted along rows; of codes, no others are looked at."""
    samples = raster.samples
    if samples.dtype.kind != "u":
        return photograph(path, raster, encoding).pick(at)
    radiance, clipped = np.empty((1, len(at), 3), np.float32), np.empty((1, len(at)), bool)
    table = light_of_codes(samples.dtype, curve(raster, encoding))
    decode(samples.reshape(1, -1, samples.shape[2]), at, table, np.arange(len(at)), radiance, clipped)
    return Photograph(radiance[0], clipped[0])


def curve(raster: Raster, encoding: Encoding | None) -> Encoding:
    """`encoding`, or where it is None that of the file, or the sRGB curve."""
    stated = raster.encoding if encoding is None else encoding
    return "srgb" if stated is None else stated
