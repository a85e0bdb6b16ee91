"""How strong each light is, from photographs of a matte object of unknown shape, where lights stand being known.

    I_kp = s_k g_p.l_kp,   e_k = 1 / s_k:   sum over p of min over g of sum over k of (e_k I_kp - l_kp.g)^2 = e^T M e
    M = sum over p of D_p (W - W L (L^T W L)^-1 L^T W) D_p,   D_p = diag(I_kp),   W the lights that pixel p counts

Linear and homogeneous in e: the least eigenvector of M, relative to what the lights sent, sum of D_p W D_p (Cho,
Matsushita et al. 2018, "Semi-calibrated photometric stereo", whose pixels are lit by all lights). So that shadows and
highlights do not count, it takes turns with the robust normals of `photometric_stereo`, which choose W: a departure
from the paper, which has no shadows in its closed form.

With M's least eigenvalues a < b, as parts of what the lights sent: strengths that fit half as well as the best, 2 a,
are off by at most sqrt(a / (b - a)), and that is the doubt. A flat object leaves all open: e and e (c.l), whatever c,
explain the same photographs.

Not here: lights whose directions are unknown, and the strengths' unit, which only a white target tells (`white`).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from .._kernels import photometric_stereo as kernels
from ..errors import ArrayError
from ..lights.model import Light
from .lighting import arriving, directions_from, directions_of, scaled, span_space
from .model import Capture
from .white import weighted_median

_PIXELS = 4096  # that are looked at, at most
_PAIRS = 1 << 21  # of a pixel and a light, at most
_BLOCK = 1 << 18  # of them at once
_ROUNDS = 40  # of normals and strengths, at most
_ASTRAY = 0.1  # rms; strengths may leave the first ones so far, or as far as those are in doubt
_CLOSE = 1e-4  # a smaller change of all strengths ends the rounds, as does a third of the standard error
_DARK = 0.1  # of a pixel's bright photographs: at first, darker ones count as shadow
_BLACK = 0.05  # of bright pixels: darker ones are noise
_TELLING = 20  # pixels that each light needs
_OPEN = 1e-6  # an eigenvalue below it is none: rounding of the photographs
_DOUBT = 0.2  # more is told: on photographs of real objects with as much, normals turned by 5 to 10 degrees


@dataclasses.dataclass(frozen=True, eq=False)
class Strengths:
    """`lights` as told, with their strengths; `strengths` (N, 3), the factors on what was told, of geometric mean 1 in
    each channel: one factor a channel, a white balance, cannot be known.

    converged: whether they came to rest and may be trusted; `reason` says why not, and is empty otherwise. error: (N,),
    standard error of the logarithms as residuals scatter, were pixels independent; what counts is chosen by the same
    noise, so that they scatter up to twice as much. doubt: relative rms by which strengths may be off all the same,
    since objects are not quite matte: more, the flatter the object.
    """

    lights: tuple[Light, ...]
    strengths: np.ndarray
    converged: bool
    reason: str
    error: np.ndarray
    doubt: float


def estimate_strengths(capture: Capture, progress: Callable[[int, int], None] | None = None) -> Strengths:
    """How strong each light is, and of what colour, relative to the others, from the object itself.

    capture: of a matte object that is no plane, under four lights or more, near or distant, that lie neither in a plane
        nor, but for one, in one. 4096 pixels of its mask are looked at, always the same ones. `progress(done, total)`
        hears of photographs as they are read.

    `dataclasses.replace(capture, lights=estimate_strengths(capture).lights)` takes them over. Raises `ArrayError` where
    lights are unknown or fewer than four, a photograph is black or shows too little, or the object leaves strengths
    open.
    """
    told, names = capture.lights, capture.photographs.names
    if told is None:
        raise ArrayError(
            "the capture's lights are unknown: their directions or positions are wanted, and no strengths."
        )
    if len(told) < 4:
        raise ArrayError(f"{len(told)} lights came; four are wanted, since three fit any strengths.")
    if not span_space(directions_from(told, np.mean(capture.positions[capture.mask], axis=0))):
        raise ArrayError("all lights lie in a plane: strengths want lights that span space.")
    pixels = _Pixels.of(capture, progress)
    s = np.ones((len(told), 3))
    values = pixels.values(s)
    counted = _first_counted(values, pixels.clipped.T, names)
    fit = first_fit = _fit(values, counted, pixels.towards, names)
    s = first = _normalised(s / fit.e[:, None])
    reason, change, rounds = "", math.inf, 0
    try:
        while change >= max(_CLOSE, float(fit.error.max()) / 3):
            s, fit, change = _round(pixels, s, names)
            rounds += 1
            strayed = float(np.std(np.log(s.mean(axis=1) / first.mean(axis=1))))
            if rounds == _ROUNDS or strayed > max(_ASTRAY, first_fit.doubt):
                raise ArrayError(f"normals and strengths did not come to rest in {rounds} rounds.")
    except ArrayError as error:
        s, fit = first, first_fit
        reason = f"{error} The first guess stands. Is the object matte, and are the lights where they are told to be?"
    if not reason and fit.doubt > _DOUBT:
        reason = (
            f"strengths may be off by {fit.doubt:.0%}: the object is not matte enough, or too flat. Photograph a white "
            "target, or a ball."
        )
    lights = tuple(scaled(light, factor) for light, factor in zip(told, s, strict=True))
    return Strengths(lights, s, not reason, reason, fit.error, fit.doubt)


@dataclasses.dataclass(frozen=True, eq=False)
class _Pixels:
    """Of P pixels: radiance over told irradiance (N, P, 3), clipped or unlit (N, P), towards lights (1 or P, 3, N)."""

    radiance: np.ndarray
    clipped: np.ndarray
    towards: np.ndarray

    @staticmethod
    def of(capture: Capture, progress: Callable[[int, int], None] | None) -> _Pixels:
        lights = capture.lights
        assert lights is not None
        at = np.flatnonzero(capture.mask)
        most = min(_PIXELS, max(_PAIRS // len(lights), 1))
        at = np.sort(np.random.default_rng(0).permutation(at)[:most])
        radiance, clipped = capture.photographs.pixels(at, progress)
        places = capture.positions.reshape(-1, 3)[at]
        distant = directions_of(lights)
        towards = np.empty((at.size, 3, len(lights))) if distant is None else np.ascontiguousarray(distant.T[None])
        for k, light in enumerate(lights):
            direction, irradiance, _ = arriving(light, places)
            if distant is None:
                towards[..., k] = direction
            lit = np.asarray((irradiance > 0).all(axis=1))
            radiance[k] /= np.where(lit[:, None], irradiance, 1)
            clipped[k] |= ~lit
        return _Pixels(radiance, clipped, towards)

    def values(self, s: np.ndarray, clipped: np.ndarray | None = None) -> np.ndarray:
        """(P, N): the mean of the channels under lights of strength 1, NaN where `clipped`."""
        values = np.empty((self.radiance.shape[1], len(s)))
        none = np.zeros_like(self.clipped) if clipped is None else clipped
        kernels.gather(self.radiance, none, 0, 1 / (3 * s), values)
        return values


@dataclasses.dataclass(frozen=True, eq=False)
class _Fit:
    """e (N,), positive; its standard `error` (N,), relative; `doubt`."""

    e: np.ndarray
    error: np.ndarray
    doubt: float


def _first_counted(values: np.ndarray, clipped: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """Which photographs of pixels count (P, N), as long as no strength is known: neither shadows nor highlights.

    What a photograph's bright pixels show stands for its strength.
    """
    bright = np.quantile(values, 0.98, axis=0)
    if not (bright > 0).all():
        raise ArrayError(f"{names[int(np.argmin(bright))]} is black. Was the light on?")
    relative = values / bright
    n = values.shape[1]
    top = np.partition(relative, n - 1 - n // 10, axis=1)[:, n - 1 - n // 10, None]
    counted = (relative > _DARK * top) & (relative <= top) & ~clipped
    return np.asarray(counted & (top > _BLACK * np.quantile(top, 0.9)))


def _round(pixels: _Pixels, s: np.ndarray, names: tuple[str, ...]) -> tuple[np.ndarray, _Fit, float]:
    """Better strengths, from the normals and the colours that s give, their fit, and by how much they changed."""
    values = pixels.values(s, pixels.clipped)
    count = len(values)
    g, albedo = np.empty((count, 3)), np.empty((count, 3))
    counts, residual, error = np.empty(values.shape, np.uint8), np.empty(count), np.empty(count)
    kernels.solve(values, pixels.towards, True, g, counts, residual, error)
    kernels.colour(pixels.radiance, 0, 1 / s, pixels.towards, g, counts, albedo)
    counted = counts > 0
    fit = _fit(np.where(counted, values, 0), counted, pixels.towards, names)
    now = s / fit.e[:, None]
    n = g / np.linalg.norm(g, axis=1, keepdims=True)
    for k, name in enumerate(names):
        cosine = np.sum(n * pixels.towards[..., k], axis=1)
        at = counted[:, k] & (cosine > 0) & (albedo > 0).all(axis=1)
        foreseen, seen = albedo[at] * cosine[at, None], pixels.radiance[k, at] / s[k]
        colour = np.zeros(3)
        if at.any():
            colour[:] = [weighted_median(seen[:, c] / foreseen[:, c], foreseen[:, c]) for c in range(3)]
        if not (colour > 0).all():
            raise ArrayError(f"{name} lacks a colour that the others show.")
        # Channels relative to each other only: the fit knows their mean best.
        now[k] *= colour / colour.mean()
    now = _normalised(now)
    return now, fit, float(np.abs(np.log(now / s)).max())


def _fit(values: np.ndarray, counted: np.ndarray, towards: np.ndarray, names: tuple[str, ...]) -> _Fit:
    """e of `values` (P, N) where `counted`; each pixel weighs alike, however dark it is.

    Raises `ArrayError` where a light has too few pixels, or strengths are left open.
    """
    n = values.shape[1]
    sent, explained = np.zeros(n), np.zeros((n, n))
    telling, parts = np.zeros(n, np.intp), []
    step = max(_BLOCK // n, 1)
    for low in range(0, len(values), step):
        some = slice(low, low + step)
        w = counted[some].astype(np.float64)
        own = towards if len(towards) == 1 else towards[some]
        l = w[:, None] * own
        turning, axes = np.linalg.eigh(l @ np.swapaxes(l, 1, 2))
        good = (w.sum(axis=1) > 3) & (turning[:, 0] > 1e-3 * turning[:, 2])
        l, w, v = l[good], w[good], w[good] * values[some][good]
        v /= np.sqrt(np.sum(v * v, axis=1) / w.sum(axis=1))[:, None]
        across = np.swapaxes(axes[good], 1, 2) @ l * (v[:, None] / np.sqrt(turning[good])[..., None])
        flat = across.reshape(-1, n)
        explained += flat.T @ flat
        sent += np.sum(v * v, axis=0)
        telling += w.sum(axis=0).astype(np.intp)
        parts.append((v, across))
    if telling.min() < _TELLING:
        k = int(np.argmin(telling))
        raise ArrayError(
            f"{names[k]} lights only {telling[k]} of the pixels that tell strengths; {_TELLING} are asked for."
        )
    root = np.sqrt(sent)
    left, vectors = np.linalg.eigh(np.eye(n) - explained / np.outer(root, root))
    left = left.clip(0)
    least, gaps = left[0], left[1:] - left[0]
    gap = gaps[0]
    if not (left[1] > _OPEN and least < gap):
        raise ArrayError(
            "the object leaves the lights' strengths open: it is flat or not matte, or lights are not where they are "
            "told to be, or all but one lie in a plane. Photograph a white target under them."
        )
    e = vectors[:, 0] / root
    e = e * np.sign(e.sum())
    if not (e > 0).all():
        raise ArrayError(f"{names[int(np.argmin(e))]} does not fit the others: is its light where it is told to be?")
    # H = E (M - a D) E, log e off by H^+ times the sum over pixels of what each pulls it by: E (M_p - a D_p) e.
    pulls = np.zeros((n, n))
    for v, across in parts:
        pull = e * ((1 - least) * v * v * e - np.einsum("pin,pi->pn", across, across @ e))
        pulls += pull.T @ pull
    ends = vectors[:, 1:] / (root * e)[:, None]
    spread = ends / gaps @ ends.T
    spread -= spread.mean(axis=0)
    return _Fit(e, np.sqrt(np.diag(spread @ pulls @ spread.T)), math.sqrt(least / gap))


def _normalised(s: np.ndarray) -> np.ndarray:
    """s (N, 3) over the geometric mean of each channel."""
    return np.asarray(s / np.exp(np.log(s).mean(axis=0)))
