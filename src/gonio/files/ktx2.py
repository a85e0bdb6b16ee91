"""KTX 2.0 textures of floating-point RGBA: images and cube maps with their mip levels, and roughness chains in them.

    identifier   u32 vkFormat typeSize width height depth layers faces levels supercompression      little-endian
    u32 offset, length of the descriptor, then of the key/value data; u64 of what supercompression needs
    u64 offset, length, unpacked length of each level
    data format descriptor, key/value data, then the levels from smallest to largest, each at a multiple of a texel

"KTX File Format Specification 2.0" and "Khronos Data Format Specification 1.3" (Khronos). Half and single floats,
linear, primaries of Rec. 709. Faces are +X -X +Y -Y +Z -Z of OpenGL (Y up), row 0 at the top: `Orientation.OPENGL`.
Every number of a header is checked against the file's size before memory is taken. Not here: supercompression, blocks
of texels, integers, arrays and volumes, which are refused by name.
"""

from __future__ import annotations

import dataclasses
import json
import os
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from .. import __version__
from ..arrays import Array, frozen, to_numpy
from ..errors import ArrayError, FileError, ParameterError
from ..lights.orientation import Orientation
from ..rendering.chain import RoughnessChain
from .environments import is_pattern, write_environment
from .images import require_writable, write_image
from .whole import writable, writing

IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
MOST_OF_HALF = 65504.0  # the largest half float
_HEADER = struct.Struct("<12s9I4I2Q")
_LEVEL = struct.Struct("<3Q")
_FORMATS: dict[int, np.dtype] = {97: np.dtype("<f2"), 109: np.dtype("<f4")}
_OTHERS = {
    0: "UNDEFINED (Basis Universal or the like)", 37: "R8G8B8A8_UNORM", 43: "R8G8B8A8_SRGB", 76: "R16_SFLOAT",
    83: "R16G16_SFLOAT", 90: "R16G16B16_SFLOAT", 100: "R32_SFLOAT", 103: "R32G32_SFLOAT", 106: "R32G32B32_SFLOAT",
    122: "B10G11R11_UFLOAT_PACK32", 123: "E5B9G9R9_UFLOAT_PACK32", 143: "BC6H_UFLOAT_BLOCK", 144: "BC6H_SFLOAT_BLOCK",
}  # fmt: skip
_SCHEMES = {1: "BasisLZ", 2: "Zstandard", 3: "ZLIB"}
_LONGEST_TEXT = 1 << 20  # of a descriptor or of key/value data

# Basic descriptor block, KDF 5: vendor and type 0, version 2; RGBSDA, BT709, linear, straight alpha; one texel a block.
_LINEAR, _RGBSDA, _BT709 = 1, 1, 1
_CHANNELS = (0, 1, 2, 15)  # R G B A
_SIGNED_FLOAT = 0xC0
_BLOCK = struct.Struct("<IHH4B4B8B")
_SAMPLE = struct.Struct("<HBB4Bff")


@dataclasses.dataclass(frozen=True, eq=False)
class Texture:
    """levels: from large to small, images (rows, columns, 4) or cube maps (6, n, n, 4). text: key/value data by key."""

    levels: tuple[np.ndarray, ...]
    text: dict[str, str]


def write_ktx2(
    path: str | os.PathLike[str],
    levels: Sequence[Array],
    text: Mapping[str, str] | None = None,
) -> None:
    """Writes an image (rows, columns[, C]) or cube map (6, n, n, C) and its mip levels, from large to small.

    C is 1, 2, 3 or 4: gray becomes RGB, what lacks blue has 0 there, what lacks alpha 1. In half floats, or in single
    ones where a value is beyond 65,504. text: more key/value data. Raises `ArrayError` for other shapes, for levels
    that do not halve, and for NaN or infinity; `FileError` where the path cannot be written.
    """
    texels = [_texels(np.asarray(to_numpy(level)), k) for k, level in enumerate(levels)]
    if not texels:
        raise ArrayError(f"{path}: a texture has at least one level.")
    faces, rows, columns = texels[0].shape[:3]
    for k, level in enumerate(texels):
        expected = (faces, max(rows >> k, 1), max(columns >> k, 1))
        if level.shape[:3] != expected or max(rows, columns) >> k == 0:
            raise ArrayError(f"{path}: level {k} has {level.shape[:3]} faces, rows, columns; it follows as {expected}.")
    single = any(float(np.abs(level).max()) > MOST_OF_HALF for level in texels)
    code, kind = (109, _FORMATS[109]) if single else (97, _FORMATS[97])
    words = {"KTXwriter": f"gonio {__version__}", **(text or {})} | ({"KTXorientation": "rd"} if faces == 1 else {})
    descriptor, pairs = _descriptor(kind), _pairs(words)
    start = _HEADER.size + _LEVEL.size * len(texels)
    header = _HEADER.pack(
        IDENTIFIER, code, kind.itemsize, columns, rows, 0, 0, faces, len(texels), 0,
        start, len(descriptor), start + len(descriptor), len(pairs), 0, 0,
    )  # fmt: skip
    body, index = bytearray(descriptor + pairs), [b""] * len(texels)
    for k in reversed(range(len(texels))):
        body += bytes(-(start + len(body)) % (4 * kind.itemsize))
        content = texels[k].astype(kind).tobytes()
        index[k] = _LEVEL.pack(start + len(body), len(content), len(content))
        body += content
    with writing(path) as temporary:
        temporary.write_bytes(header + b"".join(index) + body)


def read_ktx2(path: str | os.PathLike[str]) -> Texture:
    """An image or cube map of half or single floats, with its mip levels and key/value data.

    Half floats become single. Raises `FileError` where the file is cut short, its numbers contradict each other, or
    it holds what gonio does not read: supercompressed or block formats, integers, arrays, volumes.
    """
    try:
        with Path(path).open("rb") as file:
            return _read(path, file, os.fstat(file.fileno()).st_size)
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error


def write_chain(path: str | os.PathLike[str], chain: RoughnessChain, orientation: Orientation | None = None) -> None:
    """Writes a roughness chain: one .ktx2, or six faces a level.

    path: a name that ends in .ktx2, for engines with OpenGL's cube maps; a folder, which gets m0_px.exr, m0_nx.exr and
    so on, m1_px.exr ...; or a pattern such as "room_{level}_{face}.hdr". orientation: the tool's that will read the
    faces, as `write_environment` takes it; a .ktx2 has `Orientation.OPENGL`. A .ktx2 appears whole or not at all, faces
    level by level. Raises `FileError` for other names, `ParameterError` for a .ktx2 in another orientation.
    """
    require_chain_writable(path, orientation)
    path = Path(path)
    if path.suffix.lower() == ".ktx2":
        text = {
            "gonio:alphas": json.dumps(chain.alphas.tolist()),
            "gonio:errors": json.dumps(chain.errors.tolist()),
            "gonio:degrees": json.dumps(chain.degrees),
            "gonio:lobe": chain.lobe,
        }
        write_ktx2(path, chain.faces, text)
        return
    for k, size in enumerate(chain.sizes):
        write_environment(_faces(path, k), chain.environment(k), orientation=orientation, rows=6 * size)


def require_chain_writable(path: str | os.PathLike[str], orientation: Orientation | None = None) -> None:
    """Raises where `write_chain` could not write to `path`: for asking before long work."""
    path = Path(path)
    if path.suffix.lower() != ".ktx2":
        require_writable(_faces(path, 0))
    elif orientation not in (None, Orientation.OPENGL):
        raise ParameterError(f"{path}: KTX 2.0 stands as OPENGL; faces can be had as {orientation.name}.")
    else:
        writable(path)


def write_split_sum(path: str | os.PathLike[str], table: Array) -> None:
    """Writes the table of `split_sum` (size, size, 2): .ktx2, or an image format of floats; blue is 0.

    Columns go by n.wo, rows by roughness from the top. Raises what `write_ktx2` and `write_image` raise.
    """
    if Path(path).suffix.lower() == ".ktx2":
        write_ktx2(path, [table], {"gonio:columns": "n.wo", "gonio:rows": "roughness"})
    else:
        write_image(path, np.pad(to_numpy(table), ((0, 0), (0, 0), (0, 1))))


def read_chain(path: str | os.PathLike[str]) -> RoughnessChain:
    """The chain in a .ktx2 that `write_chain` wrote. Raises `FileError` where it is none, beside `read_ktx2`'s."""
    texture = read_ktx2(path)
    try:
        alphas, errors, degrees = (json.loads(texture.text[f"gonio:{key}"]) for key in ("alphas", "errors", "degrees"))
        lobe = texture.text["gonio:lobe"]
        numbers = frozen(alphas), frozen(errors), tuple(int(degree) for degree in degrees)
    except (KeyError, ValueError, TypeError) as error:
        raise FileError(f"{path}: its keys gonio:alphas, errors, degrees and lobe do not describe a chain.") from error
    if texture.levels[0].ndim != 4 or any(np.shape(x) != (len(texture.levels),) for x in numbers):
        raise FileError(f"{path}: a chain is a cube map with one alpha, error and degree for each level.")
    return RoughnessChain(tuple(frozen(level[..., :3], level.dtype) for level in texture.levels), *numbers, lobe)


def _faces(path: Path, level: int) -> Path:
    """The pattern of a level's six faces, in a folder or by a pattern for all levels."""
    pattern = path / "m{level}_{face}.exr" if path.is_dir() else path
    if not is_pattern(pattern) or "{level}" not in pattern.name:
        raise FileError(
            f"{path}: name a .ktx2, a folder that exists, or six faces a level, as m{{level}}_{{face}}.exr."
        )
    return pattern.with_name(pattern.name.replace("{level}", str(level)))


def _texels(image: np.ndarray, level: int) -> np.ndarray:
    """(faces, rows, columns, 4) in single precision."""
    image = image[..., None] if image.ndim == 2 else image
    image = image[None] if image.ndim == 3 else image
    if image.ndim != 4 or image.shape[0] not in (1, 6) or not 1 <= image.shape[3] <= 4 or not image.size:
        raise ArrayError(f"level {level} has shape {image.shape}; it is (rows, columns, C) or (6, n, n, C), C <= 4.")
    if image.shape[0] == 6 and image.shape[1] != image.shape[2]:
        raise ArrayError(f"level {level} has shape {image.shape}; the faces of a cube map are square.")
    rgba = np.zeros((*image.shape[:3], 4), np.float32)
    rgba[..., 3] = 1
    channels = image.shape[3]
    rgba[..., : max(channels, 3 if channels == 1 else 0)] = image
    if not np.isfinite(rgba).all():
        raise ArrayError(f"level {level} holds NaN, infinity, or more than single precision can.")
    return rgba


def _descriptor(kind: np.dtype) -> bytes:
    """The data format descriptor of RGBA floats: its length, one basic block, a sample for each channel."""
    size = _BLOCK.size + _SAMPLE.size * len(_CHANNELS)
    plain = (_RGBSDA, _BT709, _LINEAR, 0, *(0,) * 4, 4 * kind.itemsize, *(0,) * 7)
    block = struct.pack("<I", 4 + size) + _BLOCK.pack(0, 2, size, *plain)
    bits = 8 * kind.itemsize
    for k, channel in enumerate(_CHANNELS):
        block += _SAMPLE.pack(k * bits, bits - 1, channel | _SIGNED_FLOAT, 0, 0, 0, 0, -1.0, 1.0)
    return block


def _pairs(text: Mapping[str, str]) -> bytes:
    """Key/value data, sorted by key as the format asks; each pair to a multiple of four bytes."""
    out = bytearray()
    for key in sorted(text):
        pair = key.encode() + b"\0" + text[key].encode() + b"\0"
        out += struct.pack("<I", len(pair)) + pair + bytes(-len(pair) % 4)
    return bytes(out)


def _read(path: str | os.PathLike[str], file: BinaryIO, size: int) -> Texture:
    head = file.read(_HEADER.size)
    if head[: len(IDENTIFIER)] != IDENTIFIER:
        raise FileError(f"{path} does not begin as a KTX 2.0 file does.")
    if len(head) < _HEADER.size:
        raise FileError(f"{path}: the header ends after {len(head)} bytes.")
    _, code, _, columns, rows, depth, layers, faces, count, scheme, *spans = _HEADER.unpack(head)
    if scheme:
        raise FileError(f"{path} is supercompressed ({_SCHEMES.get(scheme, scheme)}); gonio reads it without.")
    if code not in _FORMATS:
        known = "R16G16B16A16_SFLOAT and R32G32B32A32_SFLOAT"
        raise FileError(
            f"{path} has vkFormat {code}, {_OTHERS.get(code, 'which has no name here')}; gonio reads {known}."
        )
    if depth or layers or rows == 0 or columns == 0:
        raise FileError(
            f"{path}: {columns} x {rows} x {depth} texels in {layers} layers are no single 2D image or cube."
        )
    if faces not in (1, 6) or (faces == 6 and rows != columns):
        raise FileError(f"{path}: {faces} faces of {columns} x {rows} texels; an image has 1, a cube 6 square ones.")
    count = max(count, 1)
    if count > max(rows, columns).bit_length():
        raise FileError(f"{path}: {count} levels are more than {columns} x {rows} texels can be halved.")
    index = file.read(_LEVEL.size * count)
    if len(index) < _LEVEL.size * count:
        raise FileError(f"{path}: the index of levels ends after {len(index)} bytes.")
    kind = _FORMATS[code]
    _require_linear(path, _part(path, file, size, "data format descriptor", *spans[:2]), kind)
    text = _text(path, _part(path, file, size, "key/value data", *spans[2:4]))
    if faces == 1 and text.get("KTXorientation", "rd") != "rd":
        raise FileError(f"{path}: KTXorientation is {text['KTXorientation']!r}; gonio reads rd, row 0 at the top.")
    levels = []
    for k, (offset, length, unpacked) in enumerate(_LEVEL.iter_unpack(index)):
        shape = (faces, max(rows >> k, 1), max(columns >> k, 1), 4)
        expected = faces * shape[1] * shape[2] * 4 * kind.itemsize
        if length != expected or unpacked != expected:
            raise FileError(f"{path}: level {k} takes {length} bytes; {shape[2]} x {shape[1]} texels take {expected}.")
        if offset < _HEADER.size + len(index) or offset + length > size:
            raise FileError(f"{path}: level {k} lies at byte {offset} and takes {length}, but the file has {size}.")
        file.seek(offset)
        texels = np.frombuffer(file.read(length), kind).reshape(shape)
        levels.append(frozen(texels if faces == 6 else texels[0], np.float32))
    return Texture(tuple(levels), text)


def _part(path: str | os.PathLike[str], file: BinaryIO, size: int, name: str, offset: int, length: int) -> bytes:
    if length > _LONGEST_TEXT or offset + length > size:
        raise FileError(f"{path}: its {name} lies at byte {offset} and takes {length}, but the file has {size}.")
    file.seek(offset)
    return file.read(length)


def _require_linear(path: str | os.PathLike[str], descriptor: bytes, kind: np.dtype) -> None:
    """Refuses texels that are no linear RGBA by their descriptor."""
    if len(descriptor) < 4 + _BLOCK.size:
        raise FileError(f"{path}: its data format descriptor has {len(descriptor)} bytes, too few for a basic block.")
    vendor, _, _, model, _, transfer, _, *rest = _BLOCK.unpack_from(descriptor, 4)
    if vendor or model != _RGBSDA or transfer != _LINEAR or rest[4] != 4 * kind.itemsize:
        raise FileError(
            f"{path}: its data format descriptor says model {model}, transfer {transfer}, {rest[4]} bytes a texel; "
            f"linear RGBA is {_RGBSDA}, {_LINEAR}, {4 * kind.itemsize}."
        )


def _text(path: str | os.PathLike[str], pairs: bytes) -> dict[str, str]:
    """Key/value data by key; values end before their NUL, where they have one."""
    text: dict[str, str] = {}
    at = 0
    while at < len(pairs):
        if at + 4 > len(pairs):
            raise FileError(f"{path}: its key/value data end within a length.")
        (length,) = struct.unpack_from("<I", pairs, at)
        pair = pairs[at + 4 : at + 4 + length]
        key, nul, value = pair.partition(b"\0")
        if len(pair) < length or not nul or not key:
            raise FileError(f"{path}: the pair at byte {at} of its key/value data is cut short or has no key.")
        text[key.decode("utf-8", "replace")] = value.removesuffix(b"\0").decode("utf-8", "replace")
        at += 4 + length + -length % 4
    return text
