"""A capture's photographs decoded once, into a chunked and compressed Zarr store beside them: `capture.zarr`.

    codes   (N, rows, columns, 3), as the files have them, in chunks of 32 photographs by 128 x 128 pixels: so both a
            photograph and all lights of a few pixels are near each other. Zstandard, and a checksum for each chunk
    attributes of codes: names, sizes and times of the files, encoding, done: how many photographs are whole

Writing goes on where it was stopped. Memory is that of one chunk's photographs, whatever their number.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from .._kernels.photographs import decode
from ..capture.photographs import Photograph, Photographs
from ..errors import FileError
from .images import light_of_codes, read_raster
from .photographs import PhotographFiles, curve, photograph, picked
from .raster import Encoding, Raster, require_size

if TYPE_CHECKING:
    import zarr

STORE = "capture.zarr"

_GROUP = 32  # photographs in a chunk
_TILE = 128  # pixels each way
_LARGEST = 2**24  # bytes of metadata: some hundred thousand names


class StoredPhotographs(Photographs):
    """Photographs in a whole store. encoding: as in `read_image`; where None, what the files stated, or sRGB.

    Raises `FileError` where the store is not whole, or not one of gonio's.
    """

    def __init__(self, path: Path, encoding: Encoding | None = None) -> None:
        self.path, self.codes = path, _opened(path)
        facts = dict(self.codes.attrs)
        count, rows, columns, channels = self.codes.shape
        names = facts.get("names")
        if channels != 3 or not isinstance(names, list) or len(names) != count or facts.get("done") != count:
            raise FileError(f"{path} is not whole: run gonio ingest again, which goes on where it was stopped.")
        self.names, self.size = tuple(str(name) for name in names), (rows, columns)
        stated: Any = facts.get("encoding")
        self.assumed = encoding is None and stated is None
        self.encoding = encoding if encoding is not None else stated
        self._held: tuple[int, np.ndarray] | None = None

    def read(self, k: int) -> Photograph:
        return photograph(self.path, self.raster(k), self.encoding)

    def pick(self, k: int, at: np.ndarray) -> Photograph:
        return picked(self.path, self.raster(k), self.encoding, at)

    def raster(self, k: int) -> Raster:
        """The samples of photograph k as its file had them."""
        group = k // _GROUP
        if self._held is None or self._held[0] != group:
            self._held = group, self._read((slice(group * _GROUP, (group + 1) * _GROUP), slice(None), slice(None)))
        return Raster(self._held[1][k - group * _GROUP])

    def pixels(self, at: np.ndarray, progress: Callable[[int, int], None] | None = None) -> Photograph:
        radiance = np.empty((len(self.names), len(at), 3), np.float32)
        clipped = np.empty((len(self.names), len(at)), bool)
        for some, here, place, codes in self._chunks(np.asarray(at), progress):
            if codes.dtype.kind == "u":
                table = light_of_codes(codes.dtype, curve(Raster(codes), self.encoding))
                decode(codes, place, table, here, radiance[some], clipped[some])
            else:
                radiance[some, here], clipped[some, here] = photograph(
                    self.path, Raster(codes[:, place]), self.encoding
                )
        return Photograph(radiance, clipped)

    def rasters(self, at: np.ndarray, progress: Callable[[int, int], None] | None = None) -> Raster:
        """The samples of all photographs at pixels `at` (P,), (N, P, 3), as their files had them."""
        samples = np.empty((len(self.names), len(at), 3), self.codes.dtype)
        for some, here, place, codes in self._chunks(np.asarray(at), progress):
            samples[some, here] = codes[:, place]
        return Raster(samples)

    def _chunks(
        self, at: np.ndarray, progress: Callable[[int, int], None] | None
    ) -> Iterator[tuple[slice, np.ndarray, np.ndarray, np.ndarray]]:
        """A chunk after the other: which photographs, which of `at`, their places in it, its codes (n, all, 3)."""
        count, tiles = len(self.names), self._tiles(at)
        rows, columns = np.divmod(at, self.size[1])
        wanted = np.unique(tiles)
        for done, tile in enumerate(wanted):
            here = np.flatnonzero(tiles == tile)
            top, left = rows[here[0]] // _TILE * _TILE, columns[here[0]] // _TILE * _TILE
            bounds = slice(top, top + _TILE), slice(left, left + _TILE)
            place = (rows[here] - top) * min(_TILE, self.size[1] - left) + columns[here] - left
            for low in range(0, count, _GROUP):
                some = slice(low, low + _GROUP)
                codes = self._read((some, *bounds))
                yield some, here, place, codes.reshape(len(codes), -1, 3)
                if progress is not None:
                    progress(done * count + min(low + _GROUP, count), len(wanted) * count)

    def parts(self, at: np.ndarray, most: int) -> Iterator[np.ndarray]:
        at = np.asarray(at)
        tiles = self._tiles(at)
        order = np.argsort(tiles, kind="stable")
        ends = np.flatnonzero(np.diff(tiles[order], append=-1)) + 1
        low = 0
        while low < len(at):
            # As many whole tiles as fit, or where none does, a part of one.
            fit = ends[(ends > low) & (ends <= low + most)]
            high = int(fit[-1]) if fit.size else low + most
            yield order[low:high]
            low = high

    def _tiles(self, at: np.ndarray) -> np.ndarray:
        """Which tile each pixel lies in, (P,)."""
        rows, columns = np.divmod(at, self.size[1])
        tiles: np.ndarray = (rows // _TILE) * (self.size[1] // _TILE + 1) + columns // _TILE
        return tiles

    def _read(self, where: tuple[slice, slice, slice]) -> np.ndarray:
        try:
            return np.asarray(self.codes[where])
        except Exception as error:  # a codec's or a checksum's, of whatever kind
            reason = " ".join(str(error).split())
            raise FileError(f"{self.path} is damaged ({reason:.120}): delete it and run gonio ingest again.") from error


def ingest(files: PhotographFiles, path: Path, progress: Callable[[int, int], None] | None = None) -> None:
    """Decode photographs into the store at `path`, or go on with one that was begun for the same files.

    progress(done, total) hears of photographs. Raises `FileError` where another capture's store stands there, or files
    have changed since it was begun.
    """
    codes = _begun(files, path)
    count = len(files.names)
    done = int(str(codes.attrs["done"]))
    while done < count:
        group = [read_raster(files.folder / name).samples for name in files.names[done : done + _GROUP]]
        codes[done : done + len(group)] = np.stack([np.broadcast_to(samples, (*files.size, 3)) for samples in group])
        done += len(group)
        codes.attrs["done"] = done
        if progress is not None:
            progress(done, count)


def stored(files: PhotographFiles) -> tuple[StoredPhotographs | None, str]:
    """The store beside photographs where there is a whole one of them as they are now; otherwise None, and why."""
    path = files.folder / STORE
    if not path.is_dir():
        return None, ""
    try:
        photographs = StoredPhotographs(path, files.encoding)
    except FileError as error:
        return None, str(error)
    if dict(photographs.codes.attrs)["files"] != _stamps(files):
        return None, f"{path} is of other photographs than stand beside it: not used. Run gonio ingest again."
    return photographs, ""


def _begun(files: PhotographFiles, path: Path) -> zarr.Array[Any]:
    """The array to write to: a new one, or one that was begun for the same files."""
    import zarr
    from zarr.codecs import Crc32cCodec, ZstdCodec

    if path.exists():
        codes = _opened(path, "r+")
        if codes.attrs.get("files") != _stamps(files):
            raise FileError(f"{path} was begun for other photographs, or they have changed: move it away.")
        return codes
    first = read_raster(files.folder / files.names[0]).samples
    rows, columns = files.size
    count = len(files.names)
    if len(files.dtypes) > 1:
        raise FileError(f"{files.folder} mixes samples of {' and '.join(files.dtypes)}: convert them to one.")
    try:
        return zarr.create_array(
            str(path),
            shape=(count, rows, columns, 3),
            dtype=first.dtype,
            chunks=(min(_GROUP, count), min(_TILE, rows), min(_TILE, columns), 3),
            compressors=[ZstdCodec(level=-1), Crc32cCodec()],
            config={"write_empty_chunks": True},  # else each is compared with zeros, which takes as long as packing it
            attributes={
                "kind": "gonio photographs",
                "version": 1,
                "names": list(files.names),
                "files": _stamps(files),
                "encoding": files.stated,
                "done": 0,
            },
        )
    except OSError as error:
        raise FileError(f"{path} cannot be written: {error.strerror or error}.") from error


def _opened(path: Path, mode: Literal["r", "r+"] = "r") -> zarr.Array[Any]:
    import zarr

    _require_plain(path)
    try:
        codes = zarr.open_array(str(path), mode=mode, zarr_format=3)
    except Exception as error:
        raise FileError(f"{path} is no store of photographs: {' '.join(str(error).split()):.120}.") from error
    require_size(path, *codes.shape[1:])
    return codes


def _require_plain(path: Path) -> None:
    """Raises `FileError` where metadata name anything but numbers and the codecs used here: some of Zarr's unpickle."""
    try:
        text = (path / "zarr.json").read_bytes()
        facts = json.loads(text[:_LARGEST])
        plain = (
            facts["zarr_format"] == 3
            and facts["node_type"] == "array"
            and facts["attributes"]["kind"] == "gonio photographs"
            and facts["attributes"]["version"] == 1
            and facts["data_type"] in ("uint8", "uint16", "uint32", "float16", "float32")
            and [codec["name"] for codec in facts["codecs"]] == ["bytes", "zstd", "crc32c"]
            and len(facts["shape"]) == 4
        )
    except (OSError, ValueError, KeyError, TypeError):
        plain = False
    if not plain:
        raise FileError(f"{path} is no store of photographs that this version of gonio made.")


def _stamps(files: PhotographFiles) -> list[list[int]]:
    """Size and time of each file, by which a change is told."""
    return [[stat.st_size, stat.st_mtime_ns] for stat in ((files.folder / name).stat() for name in files.names)]
