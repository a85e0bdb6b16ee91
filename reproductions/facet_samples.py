"""Flat samples whose facets are known, and what one eye sees of them under many lights (MS 4, 6).

    f = k_d / pi + k_s D(h) F(h.o) / (4 F(1) g(i) g(o)),    D = sum_a p_a D_a,    g = sum_a p_a g_a
    D_a(h) = P_a(slope of h) / (n.h)^4,      g_a(w) = m Phi(m / s) + s phi(m / s)
    P_a normal: mean mu, standard deviations alpha / sqrt(2);  m = w_z - w_xy.mu,  s^2 = variance of w_xy.slope

Slopes are normally distributed (Beckmann) about a mean: where that is not 0, a lobe leans, as threads of satin do, and
g is still in closed form. All is written out here, so that `gonio.brdf` is not tested against itself. Texels lie on
z = 0, their frames are the world's. Not here: light that facets pass on to each other, shadows of one texel on another.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import Protocol

import numpy as np
from scipy.special import ndtr

import gonio as gn
from gonio.capture.sampling import Slices
from gonio.directions import dot

EYE = 1.17 * np.asarray(gn.from_spherical(math.radians(60), 0.0))  # metres
BLOCK = 256  # sites: their samples fit the cache


@dataclasses.dataclass(frozen=True, eq=False)
class Sample:
    """Texels of a flat square: p (rows, columns, lobes), sums of 1; alpha and lean (rows, columns, lobes, 2), slope
    widths and mean slopes in a frame that is turned by `turn` (rows, columns) about the normal; k_d, k_s
    (rows, columns, 3); eta (rows, columns); size of a side, metres."""

    p: np.ndarray
    alpha: np.ndarray
    lean: np.ndarray
    turn: np.ndarray
    k_d: np.ndarray
    k_s: np.ndarray
    eta: np.ndarray
    size: float = 0.10

    def __len__(self) -> int:
        """How many texels there are."""
        return self.turn.size

    @property
    def positions(self) -> np.ndarray:
        """(S, 3), along the rows: columns go with x, rows against y."""
        rows, columns = self.turn.shape
        x = ((np.arange(columns) + 0.5) / columns - 0.5) * self.size
        y = (0.5 - (np.arange(rows) + 0.5) / rows) * self.size
        return np.stack((*(a.ravel() for a in np.meshgrid(x, y)), np.zeros(len(self))), axis=-1)

    def D(self, h: np.ndarray, sites: np.ndarray) -> np.ndarray:
        """1/sr at unit h (..., 3), of texels `sites` (...), broadcast: to all h (N, 3) of some, sites[:, None]."""
        up = h[..., 2] > 0
        z = np.where(up, h[..., 2], 1)
        x, y = self._turned(h, sites)
        total = np.zeros(np.broadcast_shapes(up.shape, sites.shape))
        for p, (ax, ay), (mx, my) in self._lobes(sites):
            e = ((x / z + mx) / ax) ** 2 + ((y / z + my) / ay) ** 2  # the slope of h is -(x, y) / z
            total += p / (np.pi * ax * ay) * np.exp(-e)
        return np.where(up, total / z**4, 0)

    def g(self, w: np.ndarray, sites: np.ndarray) -> np.ndarray:
        """Area seen from w (..., 3) on unit ground, integral of (w.h)_+ D(h), of texels `sites` (...), broadcast."""
        x, y = self._turned(w, sites)
        total = np.zeros(np.broadcast_shapes(w.shape[:-1], sites.shape))
        for p, (ax, ay), (mx, my) in self._lobes(sites):
            m = w[..., 2] - x * mx - y * my
            s = np.sqrt(np.maximum(0.5 * ((ax * x) ** 2 + (ay * y) ** 2), 1e-20))
            t = m / s
            total += p * (m * ndtr(t) + s / math.sqrt(2 * np.pi) * np.exp(-0.5 * t * t))
        return total

    def f(self, wi: np.ndarray, wo: np.ndarray, sites: np.ndarray) -> np.ndarray:
        """1/sr, (..., 3), of texels `sites` (...), for unit wi, wo (..., 3) above the surface, broadcast."""
        h = wi + wo
        h /= np.sqrt(dot(h, h))[..., None]
        eta = self.eta.ravel()[sites]
        lobe = self.D(h, sites) * dielectric(eta, dot(h, wo)) / (dielectric(eta, np.ones(1)) * 4)
        lobe /= self.g(wi, sites) * self.g(wo, sites)
        k_d, k_s = (k.reshape(-1, 3)[sites] for k in (self.k_d, self.k_s))
        return np.asarray(k_d / np.pi + k_s * lobe[..., None])

    def _lobes(self, sites: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """p (...), alpha and lean (2, ...) of each lobe."""
        for a in range(self.p.shape[2]):
            alpha, lean = (np.moveaxis(v[:, :, a].reshape(-1, 2)[sites], -1, 0) for v in (self.alpha, self.lean))
            yield self.p[:, :, a].ravel()[sites], alpha, lean

    def _turned(self, w: np.ndarray, sites: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """x and y of w in the texels' own frames."""
        turn = self.turn.ravel()[sites]
        c, s = np.cos(turn), np.sin(turn)
        return c * w[..., 0] + s * w[..., 1], c * w[..., 1] - s * w[..., 0]


def dielectric(eta: np.ndarray, c: np.ndarray) -> np.ndarray:
    """F = (r_s^2 + r_p^2) / 2 of a clear dielectric at cosines c, cos' that of the refracted ray (Fresnel, Snell)."""
    refracted = np.sqrt(1 - (1 - c * c) / eta**2)
    r_s = (c - eta * refracted) / (c + eta * refracted)
    r_p = (eta * c - refracted) / (eta * c + refracted)
    return np.asarray(0.5 * (r_s**2 + r_p**2))


def cloth(n: int, seed: int = 0, lean: float = 1.0) -> Sample:
    """Brocade of three materials, n x n: two lobes that lean against each other, by `lean` times up to 17 degrees, in
    frames of all azimuths."""
    x, y = np.meshgrid(*2 * [(np.arange(n) + 0.5) / n])
    rng = np.random.default_rng(seed)

    def between(low: float, high: float, waves: float = 3.0) -> np.ndarray:
        return low + (high - low) * _smooth(x, y, waves, rng)

    mask = np.stack([between(0, 24) for _ in range(3)])  # steep: most texels are of one material
    mask = np.exp(mask - mask.max(axis=0))
    mask /= mask.sum(axis=0)

    def by_material(values: list[float]) -> np.ndarray:
        return np.tensordot(np.asarray(values), mask, axes=(0, 0))

    p = np.clip(by_material([0.65, 0.5, 0.3]) + between(-0.08, 0.08), 0.15, 0.85)
    along = np.stack((by_material([0.16, 0.22, 0.30]), by_material([0.20, 0.30, 0.18])), axis=-1)
    across = np.stack((by_material([0.38, 0.30, 0.42]), by_material([0.28, 0.42, 0.36])), axis=-1)
    alpha = np.stack((along * between(0.92, 1.08)[..., None], across * between(0.92, 1.08)[..., None]), axis=-1)
    leans = np.zeros((n, n, 2, 2))
    for a, degrees in enumerate(([12.0, 5.0, 8.0], [-8.0, -12.0, -14.0])):
        leans[:, :, a, 0] = lean * np.tan(np.radians(by_material(degrees) * between(0.9, 1.05)))
        leans[:, :, a, 1] = lean * np.tan(np.radians(by_material([2.0, -3.0, 4.0]) * between(0.5, 1.0)))
    p = np.stack((p, 1 - p), axis=-1)
    leans -= np.sum(p[..., None] * leans, axis=2, keepdims=True)  # flat on the whole, and so is each texel
    weave = (np.floor(16 * x) + np.floor(16 * y)) % 2
    turn = between(-2 * np.pi, 2 * np.pi, 1.5) + 0.5 * np.pi * weave
    dyes = [[0.35, 0.08, 0.15], [0.07, 0.16, 0.25], [0.06, 0.30, 0.12]]
    k_d = np.stack([by_material(dye) * between(0.85, 1.1, 6) for dye in dyes], axis=-1)
    k_s = np.stack([by_material(c) for c in ([0.16, 0.06, 0.25], [0.12, 0.06, 0.2], [0.08, 0.07, 0.1])], axis=-1)
    k_s *= between(0.8, 1.15, 6)[..., None]
    eta = by_material([1.38, 1.48, 1.58]) + between(-0.02, 0.02)
    return Sample(p, alpha, leans, turn, k_d, k_s, eta)


def metal(n: int, seed: int = 0) -> Sample:
    """Brushed metal, n x n: one lobe of .05 by .20 in frames that turn, nearly without diffuse light."""
    x, y = np.meshgrid(*2 * [(np.arange(n) + 0.5) / n])
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * (2 * _smooth(x, y, 1.5, rng) - 1)
    k_d, k_s = (np.ones((n, n, 3)) * c for c in ([0.02, 0.02, 0.025], [0.30, 0.26, 0.20]))
    k_s *= 0.8 + 0.3 * _smooth(x, y, 4, rng)[..., None]
    alpha = np.broadcast_to([0.05, 0.20], (n, n, 1, 2))
    return Sample(np.ones((n, n, 1)), alpha, np.zeros((n, n, 1, 2)), turn, k_d, k_s, np.full((n, n), 1.5))


def _smooth(x: np.ndarray, y: np.ndarray, waves: float, rng: np.random.Generator) -> np.ndarray:
    """In [0, 1]: five plane waves of up to `waves` periods a side, the same at any resolution."""
    k, phase = rng.uniform(-waves, waves, (5, 2)), rng.uniform(0, 2 * np.pi, 5)
    total = sum(np.sin(2 * np.pi * (a * x + b * y) + c) for (a, b), c in zip(k, phase, strict=True))
    return np.asarray(ndtr(total / math.sqrt(2.5)))  # variance 5 / 2


@dataclasses.dataclass(frozen=True, eq=False)
class Lights:
    """Where N lights are: `at` (N, 3), places in metres of unit intensity if `near`, directions of unit irradiance
    otherwise."""

    at: np.ndarray
    near: bool = False

    def arriving(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """wi (S or 1, N, 3) and E (S or 1, N), 1 / d^2 of near lights, at `positions` (S, 3)."""
        if not self.near:
            return self.at[None], np.ones((1, len(self.at)))
        to = self.at - positions[:, None]
        d2 = dot(to, to)
        return to / np.sqrt(d2)[..., None], 1 / d2


def hemisphere(count: int = 480, steepest: float = 85.0) -> Lights:
    """Distant lights spread evenly over the hemisphere down to `steepest` degrees, azimuths by the golden angle."""
    return Lights(_spiral(count, steepest))


def led_array(rows: int = 20, columns: int = 24, height: float = 0.04, side: float = 0.24) -> Lights:
    """Near lights in a square of `side`, `height` above the sample (MS 4: LEDs)."""
    x, y = ((np.arange(k) + 0.5) / k * side - side / 2 for k in (columns, rows))
    return Lights(np.stack((*(a.ravel() for a in np.meshgrid(x, y)), np.full(rows * columns, height)), axis=-1), True)


def _spiral(count: int, steepest: float) -> np.ndarray:
    k = np.arange(count) + 0.5
    z = 1 - k / count * (1 - math.cos(math.radians(steepest)))
    return np.asarray(gn.from_spherical(np.arccos(z), math.pi * (3 - math.sqrt(5)) * k))


@dataclasses.dataclass(frozen=True, eq=False)
class Captured:
    """Reflectance of `sample` under `lights` from `eye` (3,), computed for the sites asked: `at`, as that of
    `capture.sampling.Reflectance`. Noise is `noise` of a sample's radiance and a tenth of that of the mean radiance,
    and a site's own whatever else is asked; values below 0 stand."""

    sample: Sample
    lights: Lights
    eye: np.ndarray
    noise: float
    seed: int
    mean: float

    def __len__(self) -> int:
        """How many sites there are."""
        return len(self.sample)

    @property
    def positions(self) -> np.ndarray:
        return self.sample.positions

    def at(self, some: np.ndarray) -> Slices:
        """All lights at sites `some` (S,); BLOCK of them at a time are quickest."""
        wi, E, wo, f = self._seen(some)
        lit = np.maximum(E * wi[..., 2], 0)
        with np.errstate(divide="ignore"):
            off = self.noise * np.hypot(f, 0.1 * self.mean / lit[..., None])
        shape = f.shape[1:]
        for row, site in enumerate(some):
            rng = np.random.Generator(np.random.Philox(key=np.array([self.seed, site], np.uint64)))
            f[row] += off[row] * rng.standard_normal(shape, np.float32)
        dark = np.broadcast_to(lit == 0, f.shape[:2])
        f[dark] = np.nan
        arrays = (np.broadcast_to(wi, f.shape), f, np.broadcast_to(lit**2, f.shape[:2]))
        wi, value, weight = (np.array(a, np.float32) for a in arrays)
        return Slices(wi, wo, value, weight)

    def _seen(self, some: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """wi, E, wo and f without noise."""
        positions = self.positions[some]
        wi, E = self.lights.arriving(positions)
        wo = np.asarray(gn.normalise(self.eye - positions))
        return wi, E, wo, self.sample.f(wi, wo[:, None], some[:, None])


def captured(sample: Sample, lights: Lights, eye: np.ndarray = EYE, noise: float = 0.01, seed: int = 0) -> Captured:
    """`Captured`, its mean radiance that of a few texels spread over the sample."""
    some = np.linspace(0, len(sample) - 1, min(97, len(sample))).astype(np.intp)
    wi, E, _, f = Captured(sample, lights, eye, 0.0, 0, 0.0)._seen(some)
    return Captured(sample, lights, eye, noise, seed, float(np.mean(f * (E * wi[..., 2])[..., None])))


def blocks(count: int, size: int = BLOCK) -> Iterator[np.ndarray]:
    """Sites 0 to count - 1, `size` at a time."""
    for first in range(0, count, size):
        yield np.arange(first, min(first + size, count))


Novel = list[tuple[str, np.ndarray, np.ndarray]]


def novel(eye: np.ndarray = EYE, lights: int = 60) -> Novel:
    """(name, wo (3,), wi (lights, 3)): distant eyes that were not captured, azimuths counted from that of `eye`, and
    lights down to 75 degrees."""
    azimuth = math.atan2(eye[1], eye[0])
    wi = _spiral(lights, 75.0)
    views = {"beside": (51, -15), "opposite": (60, 180), "grazing": (70, 40)}
    return [
        (name, np.asarray(gn.from_spherical(math.radians(theta), azimuth + math.radians(phi))), wi)
        for name, (theta, phi) in views.items()
    ]


class Reflecting(Protocol):
    """A sample, or what was fitted to one: f (..., 3) of texels `sites` (...) for directions (..., 3), broadcast."""

    def f(self, wi: np.ndarray, wo: np.ndarray, sites: np.ndarray) -> np.ndarray: ...


def relative_rms(predicted: np.ndarray, truth: np.ndarray, wi: np.ndarray) -> float:
    """sqrt(sum ((f' - f) n.wi)^2 / sum (f n.wi)^2), of f' and f (..., 3) under wi (..., 3)."""
    light = wi[..., 2:]
    return float(np.sqrt(np.sum(((predicted - truth) * light) ** 2) / np.sum((truth * light) ** 2)))


def errors(model: Reflecting, sample: Sample, views: Novel, sites: np.ndarray | None = None) -> dict[str, float]:
    """`relative_rms` of `model` in each of the views, and in all of them, over `sites` (by default all)."""
    sums, every = {}, np.arange(len(sample)) if sites is None else sites
    for name, wo, wi in views:
        total = np.zeros(2)
        for block in blocks(len(every), 4 * BLOCK):
            some = every[block, None]
            truth = sample.f(wi, wo, some)
            for k, x in enumerate((model.f(wi, wo, some) - truth, truth)):
                total[k] += np.sum((x * wi[:, 2:]) ** 2)
        sums[name] = total
    sums["all"] = np.sum(list(sums.values()), axis=0)
    return {name: math.sqrt(off / whole) for name, (off, whole) in sums.items()}
