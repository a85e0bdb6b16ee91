"""Samples of reflectance or radiance from a capture whose shape is known, streamed a photograph at a time.

    f(wi, wo) = I / (s n.wi)          I radiance, s the light's intensity; wi, wo in the frame of the site (frame(n))
    variance of f ~ 1 / (n.wi)^2      where all photographs are as noisy: so weight = (n.wi)^2

Sites are pixels of the mask, counted along its rows. Left out are lights below the horizon, clipped pixels, and, as MS
9 has it, what is darker than a part of the site's mean: noise or shadow, as likely as not. f is in 1/sr where
intensities are irradiances and photographs radiances, and otherwise known up to one factor: that of a white target.

The eye is straight above (an orthographic camera); near cameras and lights are not here.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from functools import cached_property

import numpy as np

from ..errors import MEMORY_LIMIT, ArrayError, MemoryLimitError, ParameterError
from ..frames import frame, to_local
from ..samples import RadianceSamples, ReflectanceSamples
from .model import Capture

_TO_EYE = np.array([0.0, 0.0, 1.0])


@dataclasses.dataclass(frozen=True, eq=False)
class Slices:
    """All lights at S sites (MS: slices of constant wo): wi (S, N, 3) and wo (S, 3), local; value (S, N, 3), NaN where
    it is not known; weight (S, N)."""

    wi: np.ndarray
    wo: np.ndarray
    value: np.ndarray
    weight: np.ndarray


@dataclasses.dataclass(frozen=True, eq=False)
class Reflectance:
    """The reflectance samples of a capture: iterate for a block a photograph, or ask for all lights `at` some sites.

    least: in [0, 1), the part of a site's mean below which a photograph is left out (MS 9: .05).
    """

    capture: Capture
    least: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.least < 1:
            raise ParameterError(f"least = {self.least}; a part of the mean lies in [0, 1).")
        if self.capture.directions is None:
            raise ArrayError("the capture's lights are unknown. Use radiance(), or give their directions.")
        _require_shape(self.capture)

    def __len__(self) -> int:
        """How many sites there are."""
        return int(np.count_nonzero(self.capture.mask))

    @cached_property
    def frames(self) -> np.ndarray:
        """The sites' frames, (sites, 3, 3)."""
        assert self.capture.normals is not None
        return np.asarray(frame(self.capture.normals[self.capture.mask].astype(np.float64)))

    @cached_property
    def _dark(self) -> np.ndarray:
        """Below which a site is left out, (sites,), of the mean of the channels."""
        total, count = np.zeros(len(self)), np.zeros(len(self))
        for k in range(len(self.capture.photographs)):
            values, known = self._photograph(k)
            total += np.where(known, values.mean(axis=1), 0)
            count += known
        return self.least * total / np.maximum(count, 1)

    def __iter__(self) -> Iterator[ReflectanceSamples]:
        """A block for each photograph that lights any site."""
        capture = self.capture
        assert capture.directions is not None
        wo = to_local(self.frames, _TO_EYE)
        for k in range(len(capture.photographs)):
            values, known = self._photograph(k)
            wi = to_local(self.frames, capture.directions[k])
            lit = self._lit(values, known, wi, wo)
            if lit.any():
                cosine = wi[lit, 2]
                f = values[lit] / cosine[:, None]
                yield ReflectanceSamples(np.flatnonzero(lit), wi[lit], wo[lit], f, cosine**2)

    def at(self, sites: np.ndarray) -> Slices:
        """All lights at `sites` (S,), whole numbers below the length: quick from a store (`gonio ingest`), while files
        are all decoded for it.

        Raises `MemoryLimitError` before more memory is taken than the limit.
        """
        capture = self.capture
        assert capture.directions is not None
        count = len(capture.photographs)
        if 80 * len(sites) * count > MEMORY_LIMIT:
            raise MemoryLimitError(f"{len(sites)} sites under {count} lights exceed the memory limit. Ask for fewer.")
        frames = self.frames[sites]
        wi = to_local(frames[:, None], capture.directions[None])
        wo = to_local(frames, _TO_EYE)
        value, weight = np.full((len(sites), count, 3), np.nan), np.zeros((len(sites), count))
        radiance, clipped = capture.photographs.pixels(np.flatnonzero(capture.mask)[sites])
        values = np.swapaxes(radiance / capture.intensities[:, None], 0, 1)
        known = ~clipped.T
        lit = known & (wi[..., 2] > 0) & (wo[:, None, 2] > 0)
        if self.least:
            bright = values.mean(axis=2)
            mean = np.sum(np.where(known, bright, 0), axis=1) / np.maximum(known.sum(axis=1), 1)
            lit &= bright >= self.least * mean[:, None]
        value[lit] = values[lit] / wi[lit][:, 2:]
        weight[lit] = wi[lit][:, 2] ** 2
        return Slices(wi, wo, value, weight)

    def _photograph(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Radiance over intensity (sites, 3), and where it is known."""
        radiance, clipped = self.capture.photographs.read(k)
        mask = self.capture.mask
        return radiance[mask].astype(np.float64) / self.capture.intensities[k], ~clipped[mask]

    def _lit(self, values: np.ndarray, known: np.ndarray, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        lit: np.ndarray = known & (wi[:, 2] > 0) & (wo[:, 2] > 0)
        if self.least:
            lit &= values.mean(axis=1) >= self._dark
        return lit


def radiance(capture: Capture) -> Iterator[RadianceSamples]:
    """The radiance samples of a capture with known normals, whatever the light, a block for each photograph.

    Clipped pixels are left out; all others weigh alike. Raises `ArrayError` where normals are unknown.
    """
    _require_shape(capture)
    assert capture.normals is not None
    normal = capture.normals[capture.mask].astype(np.float64)
    facing = normal[:, 2] > 0
    for k in range(len(capture.photographs)):
        image, clipped = capture.photographs.read(k)
        seen = facing & ~clipped[capture.mask]
        if seen.any():
            site = np.flatnonzero(seen)
            wo = np.broadcast_to(_TO_EYE, (site.size, 3))
            value = image[capture.mask][seen] / capture.intensities[k]
            yield RadianceSamples(site, normal[seen], wo, value, np.ones(site.size))


def _require_shape(capture: Capture) -> None:
    if capture.normals is None:
        raise ArrayError(
            "the capture's shape is unknown: give normals, as by dataclasses.replace(capture, normals=...) from "
            "photometric_stereo(capture).normals."
        )
