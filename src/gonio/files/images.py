"""Image files: linear radiance in, linear radiance or display colours out.

    image = read_image("room.exr")                 # (rows, columns, 3) float32, linear, whatever the format
    write_image("view.png", tone_map(image))

    .exr .hdr .pfm .tif      floats, linear         read and written
    .png .tif                8 and 16 bits          read and written
    .jpg .tga, camera raw    8 bits, 8 bits, raw    read

The format is found from a file's content when reading (Targa and camera raw, from the suffix) and from the suffix when
writing. Integer codes stand for light by a curve: that which the file states or the caller gives, otherwise sRGB, with
a warning. Not here: what the formats look like inside (a module each), and light probes' geometry (`environments`).
"""

from __future__ import annotations

import contextlib
import functools
import os
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import ModuleType

import numpy as np

from ..arrays import Array, require_finite, to_numpy
from ..colour import srgb_decode, srgb_encode
from ..errors import (
    AlphaWarning,
    ArrayError,
    ClippedWarning,
    EncodingWarning,
    FileError,
    GonioWarning,
    NegativeWarning,
    ParameterError,
)
from . import exr, hdr, jpeg, pfm, png, raw, tga, tiff
from .raster import Encoding, ImageInfo, Raster, require_file
from .whole import writable, writing

CLIPPED_SHARE = 1e-3
"""The share of pixels at the brightest code from which a reader warns."""

_BY_CONTENT = (exr, hdr, jpeg, pfm, png, tiff)
_BITS = {".exr": (32, 16), ".hdr": (32,), ".pic": (32,), ".pfm": (32,), ".png": (8, 16), ".tif": (32, 16, 8)}
_BITS[".tiff"] = _BITS[".tif"]


def read_image(path: str | os.PathLike[str], encoding: Encoding | None = None) -> np.ndarray:
    """Linear colour (rows, columns, 3), float32; grey becomes three equal channels. Row 0 is the top of the picture.

    encoding: how samples stand for light, "srgb", "linear", or the g of light = sample^g. Where it is None, floats are
        linear, and integer codes are what the file states; if it states nothing, they are taken for sRGB with an
        `EncodingWarning`. Codes run from 0 to 1: the brightest of 8 or 16 bits is 1.

    Other warnings: `ClippedWarning` where the brightest code fills more than `CLIPPED_SHARE` of the pixels,
    `NegativeWarning`, and `AlphaWarning` where transparency is left out. Of OpenEXR files, the colours of the display
    window; `read_layers` reads the rest. Raises `FileError` where the file is missing, damaged, cut short, larger than
    `raster.MOST_SAMPLES`, or holds NaN or infinity; `MissingExtraError` for camera raw without the extra `gonio[raw]`.
    """
    path = Path(path)
    _require_encoding(encoding)
    raster = read_raster(path)
    chosen = encoding if encoding is not None else raster.encoding
    image = light(path, raster, "srgb" if chosen is None else chosen)
    for kind, message in _doubts(raster, image, chosen is None):
        warnings.warn(f"{path}: {message}", kind, stacklevel=2)
    return image


def light(path: Path, raster: Raster, encoding: Encoding) -> np.ndarray:
    """What a file's samples stand for: linear (rows, columns, 3), float32. Raises `FileError` for NaN and infinity."""
    image = _light(raster.samples, encoding)
    _require_finite(path, image)
    return np.repeat(image, 3, axis=2) if image.shape[2] == 1 else image


def read_raster(path: str | os.PathLike[str]) -> Raster:
    """Samples as stored, without curve or warning: for masks, normal maps and stacks of photographs."""
    path = Path(path)
    with _reading(path) as codec:
        raster: Raster = codec.read(path)
    return raster


def read_layers(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """All of an OpenEXR file, by name: `read_layers("render.exr")["diffuse"]`.

    (rows, columns, 3) for channels R, G and B of one layer, under the layer's name ("RGB" where they have none);
    (rows, columns) for every other channel, under its full name ("Z", "diffuse.A"). float16, float32 or uint32 as
    stored, NaN and all. Where an earlier part has taken a name, the part's own leads: "right.RGB".
    """
    path = Path(path)
    with _reading(path) as codec:
        if codec is not exr:
            raise FileError(f"{path} has no layers: it is no OpenEXR file. Use read_image.")
        return exr.read_layers(path)


def image_info(path: str | os.PathLike[str]) -> ImageInfo:
    """Format, size, channels, dtype, encoding and attributes, from the header alone."""
    path = Path(path)
    with _reading(path) as codec:
        facts: ImageInfo = codec.info(path)
    return facts


def write_image(
    path: str | os.PathLike[str],
    image: Array,
    encoding: Encoding | None = None,
    *,
    bits: int | None = None,
    clip: bool = False,
) -> None:
    """Writes linear `image`, (rows, columns), (rows, columns, 1) or (rows, columns, 3), in the format of the suffix.

    bits: a sample's. .exr 32 or 16, .tif 32, 16 or 8, .png 8 or 16; the first where None. 16 bits of .exr are half
        floats. .hdr shares its exponents: right to 1/256 of a pixel's largest channel.
    encoding: of the integer codes of .png and .tif, "srgb" where None; floats are linear.
    clip: brings values outside [0, 1] to its ends where codes are written. Without it they are refused: bring
        radiance to the display by `tone_map`.

    The file appears whole or not at all. Raises `ArrayError` where the image has NaN, infinite values or values that
    the format cannot hold; `ParameterError` for bits or an encoding that the format has not; `FileError` otherwise.
    """
    write_images({Path(path): image}, encoding, bits=bits, clip=clip)


def write_images(
    images: Mapping[Path, Array],
    encoding: Encoding | None = None,
    *,
    bits: int | None = None,
    clip: bool = False,
    attributes: Mapping[str, str] | None = None,
) -> None:
    """`write_image` for several files, of which all appear or none.

    attributes: text by name for the headers of .exr and .hdr; other formats hold none.
    """
    with contextlib.ExitStack() as stack:
        for path, image in images.items():
            samples, curve = _encoded(path, image, encoding, bits, clip)
            _save(stack.enter_context(writing(path)), samples, curve, attributes)


def _encoded(
    path: Path, image: Array, encoding: Encoding | None, bits: int | None, clip: bool
) -> tuple[np.ndarray, Encoding]:
    """Samples (rows, columns, 1 or 3) as the format of the suffix stores them, and how they stand for light."""
    suffix = path.suffix.lower()
    require_writable(path)
    bits = _BITS[suffix][0] if bits is None else bits
    if bits not in _BITS[suffix]:
        raise ParameterError(f"bits must be {' or '.join(map(str, _BITS[suffix]))} for {suffix}, got {bits}.")
    _require_encoding(encoding)
    pixels = _pixels(image)
    if bits == 32 or suffix == ".exr":
        if encoding not in (None, "linear"):
            raise ParameterError(f"encoding={encoding!r}: floats in {suffix} are linear. Leave it out.")
        samples = _floats(pixels, np.float16 if bits == 16 else np.float32)
        if suffix in (".hdr", ".pic"):
            _require_range(samples, 0, hdr.LARGEST, "Write .exr, which holds it.")
        return samples, "linear"
    curve = "srgb" if encoding is None else encoding
    return _codes(pixels, curve, np.uint8 if bits == 8 else np.uint16, clip), curve


def _save(path: Path, samples: np.ndarray, curve: Encoding, attributes: Mapping[str, str] | None) -> None:
    suffix = path.suffix.lower()
    if suffix == ".png":
        png.write(path, samples, curve)
    elif suffix in (".exr", ".hdr", ".pic"):
        (exr if suffix == ".exr" else hdr).write(path, samples, attributes)
    else:
        (pfm if suffix == ".pfm" else tiff).write(path, samples)


def require_writable(path: str | os.PathLike[str]) -> None:
    """Raises `FileError` where `write_image` could not write to `path`: for asking before long work."""
    suffix = Path(path).suffix.lower()
    if suffix not in _BITS:
        raise FileError(f"{path}: images are written as {' '.join(_BITS)}, not {suffix or 'without suffix'}.")
    writable(path)


def write_layers(path: str | os.PathLike[str], layers: Mapping[str, Array]) -> None:
    """Writes named images of one size into one OpenEXR file, which `read_layers` reads.

    (rows, columns, 3) becomes channels `name.R`, `name.G`, `name.B` ("RGB": without the name), (rows, columns) one
    channel `name`. float16 stays half, whole numbers become uint32, all else float32; NaN and infinity are let through.
    """
    path = Path(path)
    if path.suffix.lower() != ".exr":
        raise FileError(f"{path}: layers are written as .exr, not {path.suffix or 'without suffix'}.")
    if not layers:
        raise ArrayError("layers is empty. Give at least one image.")
    arrays = {name: _layer(name, to_numpy(image)) for name, image in layers.items()}
    for name, image in arrays.items():
        channels = [f"{name}.{c}" if name != "RGB" else c for c in "RGB"] if image.ndim == 3 else []
        if taken := set(channels) & set(arrays):
            raise ArrayError(
                f"layer {name!r} has channels of its own called {' and '.join(sorted(taken))}. Rename one."
            )
    sizes = {a.shape[:2] for a in arrays.values()}
    if len(sizes) > 1:
        raise ArrayError(f"layers have sizes {' and '.join(map(str, sorted(sizes)))}; one file holds one size.")
    with writing(path) as temporary:
        exr.write_layers(temporary, arrays)


def _codec(path: Path) -> ModuleType:
    suffix = path.suffix.lower()
    with path.open("rb") as file:
        head = file.read(16)
    if suffix in raw.SUFFIXES:
        return raw
    for codec in _BY_CONTENT:
        if head.startswith(codec.MAGIC):
            return raw if codec is tiff and tiff.is_raw(path) else codec
    if suffix in (".tga", ".icb", ".vda", ".vst"):
        return tga
    raise FileError(
        f"{path} is no image that gonio reads (OpenEXR, Radiance, PFM, PNG, TIFF, JPEG, Targa, camera raw); "
        f"it starts with {head[:8]!r}."
    )


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[ModuleType]:
    """The codec of the file at `path`, which has to be a file; what the system refuses becomes a `FileError`."""
    require_file(path)
    try:
        yield _codec(path)
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error


def _require_encoding(encoding: Encoding | None) -> None:
    if encoding is None or encoding in ("srgb", "linear"):
        return
    if isinstance(encoding, str) or not 0 < encoding < float("inf"):
        raise ParameterError(f"encoding must be 'srgb', 'linear' or a power above 0, got {encoding!r}.")


def _light(samples: np.ndarray, encoding: Encoding) -> np.ndarray:
    """Linear float32 of samples; codes through a table, since there are fewer of them than pixels."""
    if samples.dtype.kind == "u":
        return np.take(light_of_codes(samples.dtype, encoding), samples)
    with np.errstate(over="ignore"):  # what single precision cannot hold is found by the check for infinity
        light: np.ndarray = _decode(samples, encoding).astype(np.float32, copy=False)
    return light


@functools.lru_cache(maxsize=4)
def light_of_codes(dtype: np.dtype, encoding: Encoding) -> np.ndarray:
    """What each code of unsigned `dtype` stands for, float32, all of them."""
    top = np.iinfo(dtype).max
    table: np.ndarray = _decode(np.arange(top + 1) / top, encoding).astype(np.float32)
    table.flags.writeable = False
    return table


def _decode(samples: np.ndarray, encoding: Encoding) -> np.ndarray:
    if isinstance(encoding, str):
        return np.asarray(srgb_decode(samples)) if encoding == "srgb" else samples
    return np.asarray(np.sign(samples) * np.abs(samples) ** encoding)


def _encode(linear: np.ndarray, encoding: Encoding) -> np.ndarray:
    if isinstance(encoding, str):
        return np.asarray(srgb_encode(linear)) if encoding == "srgb" else linear
    return np.asarray(np.sign(linear) * np.abs(linear) ** (1 / encoding))


def _require_finite(path: Path, image: np.ndarray) -> None:
    good = np.isfinite(image)
    if not good.all():
        row, column, channel = (int(k) for k in np.argwhere(~good)[0])
        raise FileError(
            f"{path}: pixel [{row}, {column}], channel {channel}, is {image[row, column, channel]}; "
            f"{np.count_nonzero(~good)} samples are not finite. Mend the file (read_raster reads it as it is)."
        )


def _doubts(raster: Raster, image: np.ndarray, assumed: bool) -> Iterator[tuple[type[GonioWarning], str]]:
    """What can be used but not trusted whole."""
    samples = raster.samples
    if assumed:
        yield (
            EncodingWarning,
            f"the file does not say how its {samples.dtype} codes stand for light; taken for sRGB. "
            "Say encoding='srgb' or what it is.",
        )
    if raster.alpha is not None:
        yield AlphaWarning, "transparency was left out; colours of transparent pixels may mean nothing."
    brightest = {"uint8": 255, "uint16": 65535, "float16": 65504}.get(str(samples.dtype))
    if brightest and (clipped := _share(samples == brightest)) > CLIPPED_SHARE:
        yield ClippedWarning, f"{clipped:.2%} of the pixels are at {brightest}, the most that the file can hold."
    if (least := float(image.min())) < 0:
        yield (
            NegativeWarning,
            f"{_share(image < 0):.3%} of the pixels are negative, down to {least:.4g}; kept as they are.",
        )


def _share(marked: np.ndarray) -> float:
    """Of pixels with any marked channel; channel by channel, since reductions over three neighbours are slow."""
    return float(np.mean(functools.reduce(np.logical_or, np.moveaxis(marked, -1, 0))))


def _pixels(image: Array) -> np.ndarray:
    pixels = to_numpy(image)
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    if pixels.ndim != 3 or pixels.shape[2] not in (1, 3) or pixels.size == 0:
        raise ArrayError(f"image has shape {np.shape(image)}; expected (rows, columns) or (rows, columns, 1 or 3).")
    if pixels.dtype.kind not in "fiub":
        raise ArrayError(f"image has dtype {pixels.dtype}, expected real numbers.")
    require_finite(pixels, "image")
    return pixels


def _floats(pixels: np.ndarray, dtype: type[np.floating]) -> np.ndarray:
    _require_range(pixels, -float(np.finfo(dtype).max), float(np.finfo(dtype).max), "Write more bits, or scale it.")
    return pixels.astype(dtype)


def _codes(pixels: np.ndarray, encoding: Encoding, dtype: type[np.unsignedinteger], clip: bool) -> np.ndarray:
    top = np.iinfo(dtype).max
    codes: np.ndarray = np.rint(_encode(pixels.astype(np.float64), encoding) * top)
    if clip:
        codes = np.clip(codes, 0, top)
    elif codes.min() < 0 or codes.max() > top:
        # What rounds to an end counts as that end; only values beyond half a code are refused.
        _require_range(pixels, 0, 1, "Bring it to the display by tone_map, pass clip=True, or write .exr.")
    return codes.astype(dtype)


def _require_range(pixels: np.ndarray, least: float, most: float, way_out: str) -> None:
    for extreme, beyond in ((pixels.argmin(), pixels.min() < least), (pixels.argmax(), pixels.max() > most)):
        if beyond:
            at = ", ".join(str(int(k)) for k in np.unravel_index(extreme, pixels.shape))
            raise ArrayError(f"image[{at}] is {pixels.flat[extreme]:.6g}, outside {least:.6g} to {most:.6g}. {way_out}")


def _layer(name: str, image: np.ndarray) -> np.ndarray:
    if image.size == 0 or not (image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)):
        raise ArrayError(f"layer {name!r} has shape {image.shape}; expected (rows, columns) or (rows, columns, 3).")
    if not name or name.startswith(".") or name.endswith(".") or "\0" in name:
        raise ArrayError(f"{name!r} cannot be a layer's name. Give letters and digits, parts divided by dots.")
    if image.dtype.kind in "bui":
        if image.min() < 0 or image.max() > np.iinfo(np.uint32).max:
            raise ArrayError(f"layer {name!r} has whole numbers outside 0 to 2^32 - 1. Pass it as floats.")
        return image.astype(np.uint32)
    if image.dtype.kind != "f":
        raise ArrayError(f"layer {name!r} has dtype {image.dtype}, expected real numbers.")
    return image if image.dtype == np.float16 else image.astype(np.float32)
