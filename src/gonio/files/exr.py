"""OpenEXR images: half, float and integer channels, layers, parts, tiles, and windows.

A channel is called after its layer, `diffuse.R`; channels R, G, B of one layer are one image here, every other channel
stands alone under its full name. Pixels are those of the display window: what a part's data window does not cover is
0, what lies beyond the display is cut away. Colours in the format are already multiplied by alpha.

"The OpenEXR file layout" (openexr.com). Headers are read here, since the library decodes them only with the pixels,
drops parts that it cannot decode, and reports on stdout. Not here: deep images, subsampled chroma, mip levels.
"""

from __future__ import annotations

import contextlib
import io
import os
import struct
import threading
from collections.abc import Container, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import FileError
from .raster import ImageInfo, Raster, decoding, require_size, truncated

MAGIC = (b"\x76\x2f\x31\x01",)
_LONGEST_HEADER = 1 << 22  # previews and the metadata of whole productions stay far below
_DTYPES = ("uint32", "float16", "float32")
_COMPRESSIONS = ("none", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB", "HTJ2K256", "HTJ2K32")
_quiet = threading.Lock()


class _Channel(NamedTuple):
    name: str
    dtype: str
    subsampled: bool


class _Part(NamedTuple):
    name: str
    channels: tuple[_Channel, ...]
    data: tuple[int, int, int, int]  # first column, first row, last column, last row
    attributes: dict[str, Any]


def info(path: Path) -> ImageInfo:
    parts, (left, top, right, bottom) = _header(path)
    names: list[str] = []
    for part in parts:
        names += [_unique(path, part, c.name, names) for c in part.channels]
    dtypes = sorted({c.dtype for part in parts for c in part.channels})
    attributes = parts[0].attributes | ({"parts": [part.name for part in parts]} if len(parts) > 1 else {})
    return ImageInfo(
        "OpenEXR", bottom - top + 1, right - left + 1, tuple(names), "/".join(dtypes), "linear", attributes
    )


def read(path: Path) -> Raster:
    """The colours of the first part that has R, G, B or Y without a layer's name, or of the only layer."""
    layers = read_layers(path)
    colours = {name: image for name, image in layers.items() if image.ndim == 3}
    for name in ("RGB", "Y", *(colours if len(colours) == 1 else ())):
        if name in layers and not {"RY", "BY"} & set(layers):
            image = layers[name].reshape(*layers[name].shape[:2], -1)
            if image.dtype == np.uint32:
                raise FileError(f"{path}: {name} holds integers, no radiance. Use read_layers.")
            return Raster(image, "linear")
    raise FileError(f"{path} has no single colour image: it holds {', '.join(layers)}. Use read_layers.")


def read_layers(path: Path) -> dict[str, np.ndarray]:
    """(rows, columns, 3) for each layer with channels R, G, B, under its name ("RGB" where it has none), and
    (rows, columns) for every other channel; float16, float32 or uint32 as stored. Where a name is taken by an earlier
    part, that of the part leads: "right.RGB"."""
    import OpenEXR

    parts, (left, top, right, bottom) = _header(path)
    with decoding(path), _silence():
        file = OpenEXR.File(str(path), separate_channels=True)
        decoded = [{name: c.pixels for name, c in part.channels.items()} for part in file.parts]
    if [sorted(d) for d in decoded] != [sorted(c.name for c in part.channels) for part in parts]:
        raise FileError(f"{path}: pixels are missing or damaged. Copy or download it again.")

    layers: dict[str, np.ndarray] = {}
    for part, pixels in zip(parts, decoded, strict=True):
        x0, y0, x1, y1 = part.data
        into = (
            slice(max(y0, top) - top, min(y1, bottom) - top + 1),
            slice(max(x0, left) - left, min(x1, right) - left + 1),
        )
        out = slice(max(y0, top) - y0, min(y1, bottom) - y0 + 1), slice(max(x0, left) - x0, min(x1, right) - x0 + 1)
        for name, members in _images(pixels).items():
            shape = (bottom - top + 1, right - left + 1, *((3,) if len(members) == 3 else ()))
            image = np.zeros(shape, np.result_type(*(pixels[m].dtype for m in members)))
            if y0 <= bottom and y1 >= top and x0 <= right and x1 >= left:
                for k, member in enumerate(members):
                    image[(*into, k) if len(members) == 3 else into] = pixels[member][out]
            layers[_unique(path, part, name, layers)] = image
    return layers


def write(path: Path, image: np.ndarray, attributes: Mapping[str, str] | None = None) -> None:
    """Writes (rows, columns, 1 or 3), float16 or float32, as Y or as R, G, B."""
    write_layers(path, {"RGB": image} if image.shape[2] == 3 else {"Y": image[..., 0]}, attributes)


def write_layers(path: Path, layers: Mapping[str, np.ndarray], attributes: Mapping[str, str] | None = None) -> None:
    """Writes what `read_layers` reads: float16, float32 or uint32, (rows, columns) or (rows, columns, 3), all alike.

    attributes: text by name for the header; "envmap", "latlong" or "cube", is OpenEXR's own.
    """
    import OpenEXR

    channels = {}
    for name, image in layers.items():
        if image.ndim == 2:
            channels[name] = np.ascontiguousarray(image)
        else:
            prefix = "" if name == "RGB" else f"{name}."
            channels |= {f"{prefix}{c}": np.ascontiguousarray(image[..., k]) for k, c in enumerate("RGB")}
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, **(attributes or {})}
    if "envmap" in header:
        header["envmap"] = {"latlong": OpenEXR.ENVMAP_LATLONG, "cube": OpenEXR.ENVMAP_CUBE}[header["envmap"]]
    with _silence():
        OpenEXR.File(header, channels).write(str(path))


def _images(channels: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """Channels by the image they belong to: three for a layer's colours, one otherwise."""
    images: dict[str, tuple[str, ...]] = {}
    for channel in channels:
        layer, _, last = channel.rpartition(".")
        members = tuple(f"{layer}.{c}" if layer else c for c in "RGB")
        if last in ("R", "G", "B") and all(m in channels for m in members):
            images[layer or "RGB"] = members
        else:
            images[channel] = (channel,)
    return images


def _unique(path: Path, part: _Part, name: str, taken: Container[str]) -> str:
    full = f"{part.name}.{name}" if name in taken else name
    if full in taken:
        raise FileError(f"{path}: two images are called {full!r}.")
    return full


def _header(path: Path) -> tuple[list[_Part], tuple[int, int, int, int]]:
    """The parts, and the display window that they share; sizes are checked."""
    with path.open("rb") as file:
        head = file.read(_LONGEST_HEADER)
    try:
        (version,) = struct.unpack_from("<I", head, 4)
        parts, at = [], 8
        while True:
            attributes, at = _attributes(head, at)
            if not attributes:
                break
            if version & 0x800 or str(attributes.get("type", "")).startswith("deep"):
                raise FileError(f"{path} is a deep image, with many samples in a pixel. Flatten it first.")
            channels = attributes.pop("channels")
            parts.append(_Part(str(attributes.get("name", "")), channels, attributes["dataWindow"], attributes))
            if not version & 0x1000:
                break
        left, top, right, bottom = parts[0].attributes["displayWindow"]
    except (struct.error, IndexError, KeyError, ValueError, TypeError) as error:
        if isinstance(error, FileError):
            raise
        raise truncated(path, "the OpenEXR header is incomplete or damaged") from error
    require_size(path, bottom - top + 1, right - left + 1, sum(len(part.channels) for part in parts))
    for part in parts:
        x0, y0, x1, y1 = part.data
        require_size(path, y1 - y0 + 1, x1 - x0 + 1, len(part.channels))
        for channel in part.channels:
            if channel.subsampled:
                raise FileError(f"{path}: channel {channel.name} is subsampled (luminance and chroma). Save it as RGB.")
    return parts, (left, top, right, bottom)


def _attributes(head: bytes, at: int) -> tuple[dict[str, Any], int]:
    """Attributes from `at` to the empty name that ends a header, and where that is."""
    found: dict[str, Any] = {}
    while True:
        end = head.index(b"\0", at)
        name, at = head[at:end].decode("latin-1"), end + 1
        if not name:
            return found, at
        end = head.index(b"\0", at)
        kind, at = head[at:end].decode("latin-1"), end + 1
        (size,) = struct.unpack_from("<I", head, at)
        body = head[at + 4 : at + 4 + size]
        if len(body) < size:
            raise IndexError
        at += 4 + size
        value = _value(kind, body)
        if value is not None:
            found[name] = value


def _value(kind: str, body: bytes) -> Any:
    numbers = {"box2i": "<4i", "box2f": "<4f", "v2i": "<2i", "v2f": "<2f", "v3i": "<3i", "v3f": "<3f", "int": "<i"}
    numbers |= {"float": "<f", "double": "<d", "rational": "<iI", "chromaticities": "<8f"}
    if kind in numbers:
        values = struct.unpack(numbers[kind], body)
        return values if len(values) > 1 else values[0]
    if kind == "string":
        return body.decode("utf-8", "replace")
    if kind == "compression":
        return _COMPRESSIONS[body[0]] if body[0] < len(_COMPRESSIONS) else f"number {body[0]}"
    if kind == "envmap":
        return ("latlong", "cube")[body[0]]
    if kind == "chlist":
        channels, at = [], 0
        while body[at] != 0:
            end = body.index(b"\0", at)
            dtype, _, columns, rows = struct.unpack_from("<4I", body, end + 1)
            channels.append(_Channel(body[at:end].decode("latin-1"), _DTYPES[dtype], (columns, rows) != (1, 1)))
            at = end + 17
        return tuple(channels)
    return None


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Keeps the library's reports of damage, which it writes itself, off the program's output; the error says it.

    The descriptor is the process's: for the moment of the call, other threads' stderr is lost as well.
    """
    with _quiet, contextlib.redirect_stdout(io.StringIO()):
        try:
            kept = os.dup(2)
        except OSError:  # no stderr at all, as under a service
            yield
            return
        try:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, 2)
            os.close(nowhere)
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)
