"""The diffuse and the specular part of a capture, each a capture of its own: what a dichromatic fit takes (RS 14, 8.1).

    parallel - crossed,  2 crossed         of two captures, through polarisers
    by colour, by the least of lights      of one, site by site: E divides radiance first, so that highlights are white

Not here: the separation itself (`separation`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..errors import MEMORY_LIMIT, ArrayError, MemoryLimitError
from .lighting import arriving_from
from .model import Capture
from .photographs import Photograph, Photographs
from .separation import Separated, by_colour, by_least_light, by_polarisers

_SITES = 1 << 14


class Parts(NamedTuple):
    """Photographs of the same lights, that add up to what came in."""

    diffuse: Capture
    specular: Capture


def parts_by_polarisers(parallel: Capture, crossed: Capture) -> Parts:
    """Of photographs through a polariser parallel to the light's, and of the same lights through one crossed with it.

    Lights, shape and mask are those of `parallel`. Pairs are separated as they are read.
    Raises `ArrayError` where they are not as many photographs of one size.
    """
    a, b = parallel.photographs, crossed.photographs
    if len(a) != len(b) or a.size != b.size:
        raise ArrayError(
            f"the parallel polariser has {len(a)} photographs of {a.size}, the crossed one {len(b)} of {b.size}; "
            "pairs of the same light are wanted, in the same order."
        )
    return Parts(*(dataclasses.replace(parallel, photographs=_Polarised(a, b, part)) for part in Parts._fields))


def parts_by_colour(capture: Capture, progress: Callable[[int, int], None] | None = None) -> Parts:
    """By the colours of highlights, which have the light's (`by_colour`): for dielectrics that are not grey.

    Both parts are held in memory. progress(done, total) hears of sites. Raises `ArrayError` where lights or normals are
    unknown, `MemoryLimitError` for more photographs than fit.
    """
    return _parted(capture, lambda values, _: by_colour(values, np.ones(3)), progress)


def parts_by_least_light(capture: Capture, progress: Callable[[int, int], None] | None = None) -> Parts:
    """By the least that a site sends to the eye under any of many lights (`by_least_light`): diffuse is Lambert's.

    As `parts_by_colour` otherwise.
    """

    def separate(values: np.ndarray, cosines: np.ndarray) -> Separated:
        found = by_least_light(values, cosines)
        specular = np.where(np.isnan(found.diffuse)[:, None], 0, found.specular)
        return Separated(values - specular, specular, found.confidence)

    return _parted(capture, separate, progress)


class _Polarised(Photographs):
    """One part, "diffuse" or "specular", of pairs of photographs."""

    def __init__(self, parallel: Photographs, crossed: Photographs, part: str) -> None:
        self.parallel, self.crossed, self.part = parallel, crossed, part
        self.names, self.size = parallel.names, parallel.size

    def read(self, k: int) -> Photograph:
        return self._of(self.parallel.read(k), self.crossed.read(k))

    def pixels(self, at: np.ndarray, progress: Callable[[int, int], None] | None = None) -> Photograph:
        return self._of(self.parallel.pixels(at, progress), self.crossed.pixels(at))

    def _of(self, parallel: Photograph, crossed: Photograph) -> Photograph:
        both = by_polarisers(parallel.radiance, crossed.radiance)
        return Photograph(getattr(both, self.part), parallel.clipped | crossed.clipped)


@dataclasses.dataclass(frozen=True, eq=False)
class _OnMask(Photographs):
    """Photographs known where `mask` (rows, columns) is: radiance (N, S, 3), known (N, S); black and clipped beyond."""

    names: tuple[str, ...]
    mask: np.ndarray
    radiance: np.ndarray
    known: np.ndarray

    @property
    def size(self) -> tuple[int, int]:  # type: ignore[override]
        rows, columns = self.mask.shape
        return rows, columns

    def read(self, k: int) -> Photograph:
        radiance, clipped = np.zeros((*self.mask.shape, 3), np.float32), np.ones(self.mask.shape, bool)
        radiance[self.mask], clipped[self.mask] = self.radiance[k], ~self.known[k]
        return Photograph(radiance, clipped)


def _parted(
    capture: Capture,
    separate: Callable[[np.ndarray, np.ndarray], Separated],
    progress: Callable[[int, int], None] | None,
) -> Parts:
    """separate: values (P, N, 3), radiance over irradiance, NaN where not known, and cosines (P, N) -> its parts."""
    if capture.lights is None:
        raise ArrayError("the capture's lights are unknown: give them, as by distant_lights(...).")
    sites, lights = capture.sites, capture.lights
    shape = (len(lights), len(sites), 3)
    if 2 * 4 * np.prod(shape, dtype=np.float64) > MEMORY_LIMIT:
        raise MemoryLimitError(f"the parts of {shape[0]} photographs exceed the memory limit. Select fewer.")
    diffuse, specular = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    known = np.zeros(shape[:2], bool)
    at = np.flatnonzero(capture.mask)
    done = 0
    for part in capture.photographs.parts(at, _SITES):
        some = sites[part]
        seen = capture.observe_all(part)
        direction, E, _ = arriving_from(lights, some.positions)
        cosines = np.sum(direction * some.frames[:, 2], axis=-1)
        whole = seen.known & (seen.radiance >= 0).all(axis=2) & (E > 0).all(axis=2)
        values = np.where(whole[..., None], seen.radiance / np.where(E > 0, E, 1), np.nan)
        found = separate(np.moveaxis(values, 0, 1), np.clip(cosines, -1, 1).T)
        known[:, part] = whole
        for of, out in ((found.diffuse, diffuse), (found.specular, specular)):
            out[:, part] = np.where(whole[..., None], np.moveaxis(of, 0, 1) * E, 0)
        done += len(part)
        if progress is not None:
            progress(done, len(sites))
    names, mask = capture.photographs.names, capture.mask
    return Parts(
        *(
            dataclasses.replace(capture, photographs=_OnMask(names, mask, x, known), normals=capture.normals)
            for x in (diffuse, specular)
        )
    )
