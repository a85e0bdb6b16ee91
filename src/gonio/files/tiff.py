"""TIFF images: 8- and 16-bit codes and floats, whole; turned upright as the Orientation tag says.

TIFF 6.0 (Adobe 1992) and its supplements. tifffile reads the header and what it decodes alone, OpenCV the rest (LZW).
Floats are linear; no tag in use states the curve of integer codes. Not here: several pages, palettes, CMYK, 1-bit fax.
"""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError
from .raster import ImageInfo, Raster, by_opencv, decoding, opaque, require_size, truncated

MAGIC = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_quiet = threading.Lock()
_DTYPES = ("uint8", "uint16", "float16", "float32", "float64")
_DNG_VERSION, _ORIENTATION = 50706, 274
_ASSOCIATED = 1  # extra samples that colours are multiplied by
_MOST_PACKED = 4096  # LZW and deflate pack no more bytes into one


def is_raw(path: Path) -> bool:
    """Whether a TIFF is a camera's raw file (DNG) under another name."""
    import tifffile

    with decoding(path), tifffile.TiffFile(path) as tif:
        return _DNG_VERSION in tif.pages[0].tags


def info(path: Path) -> ImageInfo:
    import tifffile

    with decoding(path), tifffile.TiffFile(path) as tif:
        page = _page(path, tif)
        channels = page.samplesperpixel
        names = ("R", "G", "B", "A")[:channels] if channels > 2 else ("Y", "A")[:channels]
        encoding = "linear" if page.dtype.kind == "f" else None
        turned = _orientation(page) >= 5
        rows, columns = (page.imagewidth, page.imagelength) if turned else (page.imagelength, page.imagewidth)
        attributes = {"compression": page.compression.name}
        return ImageInfo("TIFF", rows, columns, names, str(page.dtype), encoding, attributes)


def read(path: Path) -> Raster:
    import tifffile

    with decoding(path), tifffile.TiffFile(path) as tif:
        page = _page(path, tif)
        # tifffile fills missing strips with zeros.
        end = max((o + n for o, n in zip(page.dataoffsets, page.databytecounts, strict=True)), default=0)
        if end > tif.filehandle.size or not all(page.databytecounts) or not page.dataoffsets:
            raise truncated(path, f"pixels should end at byte {end}, the file at {tif.filehandle.size}")
        rows, columns, channels, dtype = page.imagelength, page.imagewidth, page.samplesperpixel, page.dtype
        packed = sum(page.databytecounts) * (1 if page.compression == 1 else _MOST_PACKED)
        if packed < rows * columns * channels * dtype.itemsize:
            raise truncated(path, f"{sum(page.databytecounts)} bytes cannot hold {rows} x {columns} pixels")
        extra = [int(e) for e in page.extrasamples]
        orientation = _orientation(page)
        try:
            pixels = page.asarray()
            planes = page.planarconfig == 2 and channels > 1
            pixels = np.moveaxis(pixels, 0, -1) if planes else pixels.reshape(rows, columns, channels)
            alpha = pixels[..., -1] if channels in (2, 4) else None
            samples = pixels[..., : channels - (alpha is not None)]
        except (ValueError, KeyError, ImportError) as error:
            if "imagecodecs" not in str(error) and not isinstance(error, ImportError):
                raise
            if extra:
                raise FileError(
                    f"{path}: alpha is not read from {page.compression.name} TIFF. Save it deflated."
                ) from None
            samples, alpha = _packed(path, page, tif.byteorder), None
    if extra[:1] == [_ASSOCIATED] and alpha is not None:
        if samples.dtype.kind == "u" and not opaque(alpha):
            raise FileError(f"{path}: its colours are multiplied by alpha before encoding. Save it without alpha.")
        alpha = None
    samples = np.ascontiguousarray(_upright(samples, orientation))
    encoding = "linear" if samples.dtype.kind == "f" else None
    return Raster(samples, encoding, None if alpha is None or opaque(alpha) else _upright(alpha, orientation))


def write(path: Path, samples: np.ndarray) -> None:
    """Writes (rows, columns, 1 or 3), uint8, uint16 or floating, deflated."""
    import tifffile

    photometric = "rgb" if samples.shape[2] == 3 else "minisblack"
    pixels = samples if samples.shape[2] == 3 else samples[..., 0]
    tifffile.imwrite(path, pixels, photometric=photometric, compression="zlib", metadata=None, software="gonio")


def _page(path: Path, tif: Any) -> Any:
    page = tif.pages[0]
    if any(not other.is_reduced for other in list(tif.pages)[1:]):
        raise FileError(f"{path} has {len(tif.pages)} pages. Save each image as a file of its own.")
    channels, dtype = page.samplesperpixel, page.dtype
    require_size(path, page.imagelength, page.imagewidth, channels)
    expected: tuple[int, ...] = {"MINISBLACK": (1, 2), "RGB": (3, 4)}.get(page.photometric.name, ())
    if page.photometric.name == "YCBCR" and page.compression.name == "JPEG":
        expected = (3,)
    if channels not in expected or str(dtype) not in _DTYPES or page.imagedepth != 1 or page.bitspersample % 8:
        raise FileError(
            f"{path}: {channels} channels of {page.bitspersample} bits ({dtype}) as {page.photometric.name} are not "
            "read, only grey and RGB of 8 or 16 bits or floats, with or without alpha."
        )
    return page


def _packed(path: Path, page: Any, byteorder: str) -> np.ndarray:
    import cv2

    data = np.fromfile(path, np.uint8)
    tag = page.tags.get(_ORIENTATION)
    if tag is not None:  # OpenCV would turn the pixels
        data[tag.valueoffset : tag.valueoffset + 2] = np.array([1], f"{byteorder}u2").view(np.uint8)
    with _quiet:  # libtiff speaks through OpenCV's log, which has one level for all threads
        log = cv2.utils.logging
        level = log.setLogLevel(log.LOG_LEVEL_SILENT)
        try:
            samples, _ = by_opencv(path, data, cv2.IMREAD_UNCHANGED, page.imagelength, page.imagewidth)
        finally:
            log.setLogLevel(level)
    if samples.dtype != page.dtype or samples.shape[2] != page.samplesperpixel:
        raise FileError(
            f"{path}: {page.samplesperpixel} x {page.dtype} were decoded as {samples.dtype}{samples.shape}."
        )
    return samples


def _orientation(page: Any) -> int:
    tag = page.tags.get(_ORIENTATION)
    return int(tag.value) if tag is not None and int(tag.value) in range(1, 9) else 1


def _upright(image: np.ndarray, orientation: int) -> np.ndarray:
    """Rows from the top, columns from the left; `orientation` is where the stored row 0 and column 0 are (TIFF 6.0)."""
    if orientation >= 5:
        image = image.swapaxes(0, 1)
    return image[:: -1 if orientation in (3, 4, 7, 8) else 1, :: -1 if orientation in (2, 3, 6, 7) else 1]
