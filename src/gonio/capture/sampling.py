"""Samples of reflectance or radiance from a capture whose shape is known, streamed a photograph at a time.

    f(wi, wo) = I / (E n.wi)          I radiance, E the light's irradiance at x on a plane that faces it (MS 8)
    variance of f ~ 1 / (E n.wi)^2    where all photographs are as noisy: so weight = (E n.wi)^2, E the channels' mean

wi, wo are in the frame of the site. Sites are those of the capture: pixels of the mask, counted along its rows, or
points of a shape that many cameras saw. Left out are lights below the horizon, clipped pixels, what the shape shades,
what is darker than `dark`, and, as MS 9 has it, what is darker than a part of the site's mean: noise or shadow, as
likely as not. f is in 1/sr where lights are in the units of the photographs, and otherwise known up to one factor: that
of a white target.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from functools import cached_property

import numpy as np

from .._kernels import reflectance as kernels
from ..errors import MEMORY_LIMIT, ArrayError, MemoryLimitError, ParameterError
from ..frames import to_local
from ..samples import RadianceSamples, ReflectanceSamples
from .lighting import arriving_from
from .sites import Observation, Observing, Sites


@dataclasses.dataclass(frozen=True, eq=False)
class Slices:
    """All lights at S sites (MS: slices of constant wo): wi (S, N, 3), and wo (S, 3), or (S, N, 3) where photographs
    are from many places, local; value (S, N, 3), NaN where it is not known; weight (S, N)."""

    wi: np.ndarray
    wo: np.ndarray
    value: np.ndarray
    weight: np.ndarray


@dataclasses.dataclass(frozen=True, eq=False)
class Reflectance:
    """The reflectance samples of a capture: iterate for a block a photograph, or ask for all lights `at` some sites.

    least: in [0, 1), the part of a site's mean below which a photograph is left out (MS 9: .05). dark: >= 0, the
    radiance below which it is. shadows: leave out what the shape shades, where there is one.
    """

    capture: Observing
    least: float = 0.0
    dark: float = 0.0
    shadows: bool = True

    def __post_init__(self) -> None:
        if not 0 <= self.least < 1:
            raise ParameterError(f"least = {self.least}; a part of the mean lies in [0, 1).")
        if not 0 <= self.dark < math.inf:
            raise ParameterError(f"dark = {self.dark}; a radiance >= 0 is wanted.")
        if self.capture.lights is None:
            raise ArrayError("the capture's lights are unknown. Use radiance(), or give them: distant_lights(...).")
        _ = self.capture.sites  # refuses what has no shape

    def __len__(self) -> int:
        """How many sites there are."""
        return len(self.capture.sites)

    def __iter__(self) -> Iterator[ReflectanceSamples]:
        """A block for each photograph that lights any site."""
        sites, eye, wo = self.capture.sites, np.empty(0), np.empty(0)
        floor = self._floor if self.least else np.zeros(len(sites))
        for k in range(len(self.capture.photographs)):
            seen = self.capture.observe(k)
            if seen.wo is not eye:  # where the camera stands still, wo is that of the photograph before
                eye, wo = seen.wo, np.asarray(to_local(sites.frames, seen.wo))
            one = Observation(seen.radiance[None], seen.known[None], wo)
            wi, value, weight = self._reflected(slice(k, k + 1), sites, one, floor, np.float64)
            count = np.count_nonzero(weight)
            if count:
                known = np.empty(count, np.intp), *(np.empty((count, 3)) for _ in range(3)), np.empty(count)
                kernels.gather(wi[:, 0], wo, value[:, 0], weight[:, 0], *known)
                yield ReflectanceSamples(*_sealed(*known))

    def at(self, some: np.ndarray) -> Slices:
        """All lights at sites `some` (S,), whole numbers below the length: quick from a store (`gonio ingest`), while
        files are all decoded for it.

        Raises `MemoryLimitError` before more memory is taken than the limit.
        """
        count = len(self.capture.photographs)
        if 100 * len(some) * count > MEMORY_LIMIT:
            raise MemoryLimitError(f"{len(some)} sites under {count} lights exceed the memory limit. Ask for fewer.")
        sites, every = self.capture.sites[some], slice(0, count)
        seen = self.capture.observe_all(some)
        floor = np.zeros(len(sites))
        if self.least:
            number = np.zeros(len(sites))
            kernels.brightness(seen.radiance, seen.known, self._arriving(every, sites)[1], floor, number)
            floor *= self.least / np.maximum(number, 1)
        frames = sites.frames[:, None] if seen.wo.ndim == 3 else sites.frames
        local = seen._replace(wo=np.asarray(to_local(frames, np.moveaxis(seen.wo, -2, 0))))
        wi, value, weight = self._reflected(every, sites, local, floor, np.float32)
        return Slices(wi, local.wo, value, weight)

    @property
    def sites(self) -> Sites:
        """Those of the capture."""
        return self.capture.sites

    def directions(self, positions: np.ndarray, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """wi (S, N, 3) and wo (S, 3), local in `frames` (S, 3, 3), of the lights and the eye from any `positions`
        (S, 3). Raises `ArrayError` where photographs are from many places."""
        towards = self._arriving(slice(0, len(self.capture.photographs)), Sites(positions, positions, frames))[0]
        towards = np.broadcast_to(towards, (len(towards), *positions.shape))
        wi = np.asarray(to_local(frames[:, None], np.moveaxis(towards, 0, 1)))
        return wi, np.asarray(to_local(frames, self.capture.towards_eye(positions)))

    @cached_property
    def _floor(self) -> np.ndarray:
        """Below which a site is left out, (sites,), of radiance over irradiance, the mean of the channels."""
        sites = self.capture.sites
        total, number = np.zeros(len(sites)), np.zeros(len(sites))
        for k in range(len(self.capture.photographs)):
            seen = self.capture.observe(k)
            irradiance = self._arriving(slice(k, k + 1), sites)[1]
            kernels.brightness(seen.radiance[None], seen.known[None], irradiance, total, number)
        return self.least * total / np.maximum(number, 1)

    def _arriving(self, some: slice, sites: Sites) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Directions and irradiances (N, 1 or S, 3) of lights `some`, and their distances (N, 1 or S)."""
        assert self.capture.lights is not None
        return arriving_from(self.capture.lights[some], sites.positions)

    def _reflected(
        self, some: slice, sites: Sites, seen: Observation, floor: np.ndarray, dtype: type[np.floating]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """wi, value, weight of `Slices`, of photographs `some`, wo of which is local, (S, 3) or (S, N, 3)."""
        direction, irradiance, distance = self._arriving(some, sites)
        facing = np.atleast_2d(seen.wo[..., 2].T > 0)
        shape = (len(sites), len(seen.radiance))
        wi, value, weight = (np.empty((*shape, *axes), dtype) for axes in ((3,), (3,), ()))
        kernels.reflect(
            seen.radiance, seen.known, facing, sites.frames, direction, irradiance, self.dark, floor, wi, value, weight
        )
        if self.shadows and self.capture.shape is not None:
            for k in range(shape[1]):
                lit = np.flatnonzero(weight[:, k])
                w, far = (np.broadcast_to(a[k], (len(sites), *a.shape[2:]))[lit] for a in (direction, distance))
                dark = lit[self.capture.shape.occluded(sites.lifted[lit], w, far)]
                value[dark, k], weight[dark, k] = np.nan, 0
        return wi, value, weight


def radiance(capture: Observing) -> Iterator[RadianceSamples]:
    """The radiance samples of a capture with known normals, whatever the light, a block for each photograph.

    Clipped pixels are left out; all others weigh alike. Raises `ArrayError` where normals are unknown.
    """
    normal, eye = capture.sites.frames[:, 2], np.empty(0)
    for k in range(len(capture.photographs)):
        seen = capture.observe(k)
        if seen.wo is not eye:  # as in `Reflectance`
            eye, facing = seen.wo, np.sum(normal * seen.wo, axis=1) > 0
        site = np.flatnonzero(seen.known & facing)
        if site.size:
            rows = (np.take(x, site, axis=0) for x in (normal, eye, seen.radiance))
            yield RadianceSamples(site, *_sealed(*rows, np.ones(site.size)))


def _sealed(*columns: np.ndarray) -> tuple[np.ndarray, ...]:
    """The same, read-only: so samples hold them without another copy."""
    for column in columns:
        column.flags.writeable = False
    return columns
