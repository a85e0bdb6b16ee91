"""A capture's photographs of which each is a bracket: several exposures of one light, merged when they are asked for.

    files   codes, all of one size and of 8 or 16 bits        `PhotographFiles`, or a store of them (`over`)
    X       exposure, 1 at the brightest code                 `Response.linear`
    E       radiance per second, over the vignetting          `exposure.merge`

Weights are the inverse variances of the sensor's noise and of the rounding to codes. Codes cut off noise below black;
since exposures count by t^2 there, the dark is too bright by about half a standard deviation.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from ..arrays import Array
from ..capture.exposure import CodedNoise, Merged, Noise, Response, merge
from ..capture.photographs import Photograph, Photographs, checked_vignetting
from ..errors import ArrayError, FileError
from .images import image_info
from .photographs import PhotographFiles
from .raster import Encoding
from .store import StoredPhotographs

_LEVELS = {"uint8": 256, "uint16": 65536}
_PIXELS = 2**14  # merged at a time


class BracketFiles(Photographs):
    """Brackets in a folder, each merged into one photograph: radiance per second, clipped where all exposures are.

    groups: of each light, the files of its exposures. times: seconds of the files of a group, the same for all groups.
    encoding: as in `read_image`, what the files state or sRGB where None; or the camera's `Response`. noise: the
    sensor's, `Noise()` where None. vignetting (rows, columns, 1 or 3): what radiance is divided by, as of `flat_field`.

    `groups` are as given, `names` the first of each, `files` all files, group after group; `response` is what the codes
    mean, `given` that it came so, `assumed` that nothing states it. Raises `FileError` where groups and times do not
    fit, a file stands twice, is no image, is of floats, which have no known brightest code, or not like the others in
    size and bits.
    """

    def __init__(
        self,
        folder: Path,
        groups: Sequence[Sequence[str]],
        times: Sequence[float],
        encoding: Encoding | Response | None = None,
        noise: Noise | None = None,
        vignetting: Array | None = None,
    ) -> None:
        self.times = tuple(float(t) for t in times)
        self.groups = tuple(tuple(group) for group in groups)
        names = [name for group in groups for name in group]
        _require_brackets(folder, groups, names, self.times)
        given = encoding if isinstance(encoding, Response) else None
        self.given = given is not None
        self.encoding = None if isinstance(encoding, Response) else encoding
        self.files = PhotographFiles(folder, names, "linear" if given else self.encoding)
        self.names, self.size = tuple(group[0] for group in groups), self.files.size
        self.assumed = self.files.assumed
        self.response = _response(self.files, given, self.encoding)
        self.noise = noise or Noise()
        try:
            self.vignetting = None if vignetting is None else checked_vignetting(vignetting, self.size)
        except ArrayError as error:
            raise FileError(f"{folder}: {error}") from error
        self._store: StoredPhotographs | None = None

    def over(self, store: StoredPhotographs) -> BracketFiles:
        """These brackets with their codes from a store of `files`, as `store.stored` finds it."""
        if store.names != self.files.names:
            raise FileError(f"{store.path} is of other photographs than these brackets: run gonio ingest again.")
        other = object.__new__(BracketFiles)
        other.__dict__.update(self.__dict__, _store=store)
        return other

    def read(self, k: int) -> Photograph:
        merged = self.merged(k)
        return Photograph(merged.radiance, merged.saturated)

    def merged(self, k: int) -> Merged:
        """Light k whole, with the variance of its radiance."""
        source, count = self._store or self.files, len(self.times)
        codes = [source.raster(j).samples for j in range(k * count, (k + 1) * count)]
        return self._merged(self.files.folder / self.names[k], codes, self.vignetting)

    def pixels(self, at: np.ndarray, progress: Callable[[int, int], None] | None = None) -> Photograph:
        if self._store is None:
            return super().pixels(at, progress)
        codes, count = self._store.rasters(at, progress).samples, len(self.times)
        vignetting = None if self.vignetting is None else self.vignetting.reshape(-1, self.vignetting.shape[2])[at]
        merged = self._merged(self._store.path, [codes[j::count] for j in range(count)], vignetting)
        return Photograph(merged.radiance, merged.saturated)

    def parts(self, at: np.ndarray, most: int) -> Iterator[np.ndarray]:
        return super().parts(at, most) if self._store is None else self._store.parts(at, most)

    def _merged(self, path: Path, codes: list[np.ndarray], vignetting: np.ndarray | None) -> Merged:
        """Of exposures (rows, columns, 1 or 3), some rows at a time, which stay near the processor."""
        response = self.response
        last = response.step * len(response.log_exposure) - 1

        def linear(z: np.ndarray) -> np.ndarray:
            return np.broadcast_to(response.linear(z), (*z.shape[:2], 3))

        def clipped(z: np.ndarray) -> np.ndarray:
            return np.asarray(np.logical_or.reduce(np.moveaxis(z >= last, -1, 0)))

        noise = CodedNoise(self.noise.gain, self.noise.read, response=response)
        rows, columns = codes[0].shape[:2]
        shape = (rows, columns, 3)
        merged = Merged(np.empty(shape, np.float32), np.empty(shape, np.float32), np.empty(shape[:2], bool))
        several = max(1, _PIXELS // columns)
        for top in range(0, rows, several):
            here = slice(top, top + several)
            some = [z[here] for z in codes]
            try:
                part = merge(_Each(some, linear), np.array(self.times), _Each(some, clipped), noise)
            except ArrayError as error:
                raise FileError(f"{path}: {error}") from error
            merged.radiance[here], merged.variance[here] = part.radiance, part.variance
            merged.saturated[here] = part.saturated
        if vignetting is None:
            return merged
        return Merged(merged.radiance / vignetting, merged.variance / vignetting**2, merged.saturated)


@dataclasses.dataclass(frozen=True, eq=False)
class _Each:
    """What `of` makes of each of some codes, anew whenever it is gone through."""

    codes: list[np.ndarray]
    of: Callable[[np.ndarray], np.ndarray]

    def __iter__(self) -> Iterator[np.ndarray]:
        return map(self.of, self.codes)


def _require_brackets(
    folder: Path, groups: Sequence[Sequence[str]], names: list[str], times: tuple[float, ...]
) -> None:
    if not times or not all(0 < t < math.inf for t in times):
        raise FileError(
            f"{folder}: exposures of {times} s; positive numbers are wanted, one for each file of a bracket."
        )
    if not groups:
        raise FileError(f"{folder}: no bracket of photographs is named.")
    for k, group in enumerate(groups):
        if len(group) != len(times):
            raise FileError(
                f"{folder}: bracket {k} ({', '.join(group[:3])}{', ...' if len(group) > 3 else ''}) has {len(group)} "
                f"photographs for {len(times)} exposures."
            )
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise FileError(f"{folder}: {twice} stands twice among the brackets.")


def _response(files: PhotographFiles, given: Response | None, encoding: Encoding | None) -> Response:
    """What the codes of `files` mean. Raises `FileError` where they are not of one kind, or of other codes."""
    for name in files.names:
        if files.dtypes[0] not in _LEVELS or len(files.dtypes) > 1:
            dtype = image_info(files.folder / name).dtype
            if dtype not in _LEVELS:
                raise FileError(
                    f"{files.folder / name} has samples of {dtype}, which have no known brightest code: "
                    "brackets are of 8 or 16 bits. Merge it elsewhere, or give the photograph alone."
                )
    if len(files.dtypes) > 1:
        raise FileError(f"{files.folder} mixes samples of {' and '.join(files.dtypes)}: convert them to one.")
    levels = _LEVELS[files.dtypes[0]]
    if given:
        if given.step * len(given.log_exposure) > levels:
            raise FileError(
                f"{files.folder / files.names[0]} has codes up to {levels - 1}, but the response is of "
                f"{given.step * len(given.log_exposure)}: it is another camera's, or of other bits."
            )
        return given
    curve = encoding if encoding is not None else files.stated
    if curve is None and not files.assumed:
        raise FileError(f"{files.folder}: photographs state different encodings. Say which one it is.")
    if curve is None or curve == "srgb":
        return Response.srgb(levels)
    return Response.power(1.0 if isinstance(curve, str) else curve, levels)
