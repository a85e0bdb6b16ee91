"""Radiance from bracketed exposures: the response of a camera, merging, noise, and vignetting.

    X = E t = exp g(Z)                                                    Z code, X exposure, E radiance, t seconds
    min over g, ln E of  sum w(Z)^2 (g(Z) - ln E - ln t)^2 + lambda sum_z w(z)^2 g''(z)^2        recover_response
    E = sum_k E_k / v_k  /  sum_k 1 / v_k,   E_k = X_k / t_k,   v_k = (gain X + read^2) / t_k^2  merge
    variance of X = gain X + read^2                                       noise_of; CodedNoise adds (dX/dZ)^2 / 12
    white = exp(a_0 + a_1 r^2 + a_2 r^4 + a_3 r^6) (1 + b.x)             flat_field

The response is Debevec and Malik's (1997), with their hat w, 1 at the middle of the codes and 0 at both ends, and the
photon transfer curve Janesick's (2007); the weights of the merge are the inverse variances of shot and read noise
(Granados et al. 2010), under which the mean is the most likely radiance. Exposure is in units of full scale: 1 is where
the sensor clips. Radiance is exposure per second, hence relative. Answers are NumPy's.

Not here: reading photographs (`files`), aligning them, objects that move between exposures, the dark current of long
ones, noise that differs from pixel to pixel, and vignetting that is not round about the centre of the image.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterable, Iterator

import numpy as np
from scipy.linalg import solve
from scipy.optimize import isotonic_regression
from scipy.special import gammainc, gammaincinv

from ..arrays import Array, frozen, require_finite, to_numpy
from ..colour import srgb_decode
from ..errors import ArrayError, ParameterError

_PIXELS = 200_000  # as many tell a curve or a noise as well as all
_LEVELS = 1024  # of a response that is recovered: codes of more bits are taken together
_EACH = 8  # pixels that each level of each photograph brings to the fit
# lambda above, for 256 levels. Less lets noise and waves through, more bends the dark end of a gamma curve.
_SMOOTHNESS = 3000.0
# Codes that fall by this share of their range while the exposure grows are no noise; so many of them no dust.
_FALL, _FALLING = 0.05, 0.02
# The share of the range of codes that pixels known in two exposures must cover: the rest is smoothness alone.
_COVERED = 0.75
# rms of ln X beyond which the photographs are not of one scene; noise makes 0.05.
_RESIDUAL = 0.15


@dataclasses.dataclass(frozen=True, eq=False)
class Response:
    """What codes mean: `log_exposure` (levels, C), g(Z) = ln X of each level, not falling; C = 1 is for all channels.

    -inf is no exposure. Each level stands for `step` codes that follow each other: codes run from 0 to step levels - 1.
    residual: rms of g(Z) - ln E - ln t where a response was recovered, weighted by w^2; 0 for one that is given.

    Raises `ArrayError` where g is no table or falls, is NaN or infinite above, `ParameterError` for step < 1.
    """

    log_exposure: np.ndarray
    step: int = 1
    residual: float = 0.0

    def __post_init__(self) -> None:
        g = frozen(to_numpy(self.log_exposure), np.dtype(np.float64))
        if g.ndim != 2 or g.shape[0] < 2 or g.shape[1] < 1:
            raise ArrayError(f"log_exposure has shape {g.shape}; (levels, channels) is wanted, of two levels or more.")
        if np.isnan(g).any() or not np.isfinite(g[-1]).all():
            raise ArrayError("log_exposure has NaN or is infinite at its last level.")
        if (g[1:] < g[:-1]).any():
            level, channel = (int(k) for k in np.argwhere(g[1:] < g[:-1])[0])
            raise ArrayError(f"log_exposure falls from level {level} to {level + 1} of channel {channel}.")
        if self.step < 1:
            raise ParameterError(f"Response: step = {self.step} is not a positive number of codes.")
        object.__setattr__(self, "log_exposure", g)

    @classmethod
    def power(cls, gamma: float, levels: int = 256) -> Response:
        """X = (Z / (levels - 1))^gamma, gamma > 0; gamma = 1 is a sensor's own. 256 levels are 8 bits, 65536 are 16."""
        if not 0 < gamma < math.inf:
            raise ParameterError(f"gamma = {gamma:g} is not a positive number.")
        return cls._of(_codes(levels) ** gamma)

    @classmethod
    def srgb(cls, levels: int = 256) -> Response:
        """The sRGB curve of IEC 61966-2-1, as `colour.srgb_decode` has it."""
        return cls._of(srgb_decode(_codes(levels)))

    @classmethod
    def _of(cls, exposure: np.ndarray) -> Response:
        with np.errstate(divide="ignore"):
            return cls(np.log(exposure)[:, None])

    def linear(self, codes: Array) -> np.ndarray:
        """Exposure (rows, columns, C) float32 of integer `codes` (rows, columns, C): linear, 1 at the brightest code.

        Where a level stands for several codes, exposure runs straight between the middles of levels. The brightest code
        is a lower bound: it belongs to the clipped ones.

        Raises `ArrayError` where codes are no integers, of other channels, or beyond the levels.
        """
        z, count = to_numpy(codes), self.step * len(self.log_exposure)
        channels = self.log_exposure.shape[1]
        if z.ndim != 3 or z.size == 0 or z.dtype.kind not in "iu" or channels not in (1, z.shape[2]):
            raise ArrayError(
                f"codes have shape {z.shape} and dtype {z.dtype}; integers (rows, columns, "
                f"{'channels' if channels == 1 else channels}) are wanted."
            )
        if z.min() < 0 or z.max() >= count:
            raise ArrayError(f"codes run from {z.min()} to {z.max()}; the response knows 0 to {count - 1}.")
        exposure = np.exp(self.log_exposure)
        if self.step > 1:
            at = (np.arange(count) + 0.5) / self.step - 0.5
            exposure = np.stack([np.interp(at, np.arange(len(x)), x) for x in exposure.T], axis=-1)
        table = exposure.astype(np.float32)
        return np.stack([table[z[..., c], c % channels] for c in range(z.shape[2])], axis=-1)


@dataclasses.dataclass(frozen=True)
class Noise:
    """Variance of an exposure X: gain X + read^2, all in units of full scale, 1 where the sensor clips.

    gain > 0: 1 / electrons at full scale. 1/20000 is a small pixel at its lowest sensitivity; it doubles with ISO.
    read >= 0: standard deviation in the dark; rounding to n linear codes adds 0.29 / n to it, by squares.

    Raises `ParameterError` where they lie outside.
    """

    gain: float = 1 / 20000
    read: float = 1e-3

    def __post_init__(self) -> None:
        if not (0 < self.gain < math.inf and 0 <= self.read < math.inf):
            raise ParameterError(f"{self} is none: gain must be positive, read not negative, both finite.")

    def variance(self, exposure: np.ndarray) -> np.ndarray:
        """Variance of what is counted where `exposure` is expected, any shape."""
        # Never less than that of one electron: an exposure of zero or below would weigh infinitely without read noise.
        return np.asarray(self.gain * np.maximum(exposure, self.gain) + self.read**2)


@dataclasses.dataclass(frozen=True, eq=False)
class CodedNoise(Noise):
    """`Noise` of codes (rows, columns, C): rounding adds a twelfth of the square of what a code spans by `response`."""

    response: Response = dataclasses.field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        g, step = self.response.log_exposure, self.response.step
        thin = max(1, len(g) // _LEVELS)
        x = np.exp(g[::thin])
        span = np.gradient(x, axis=0) / (thin * step)
        at = np.linspace(0, 1, _LEVELS) ** 2  # exposures of the table: curves of cameras are near a square root
        table = [np.interp(at, *curve) for curve in zip(x.T, (span**2 / 12).T, strict=True)]
        object.__setattr__(self, "_rounding", np.stack(table, axis=-1))

    def variance(self, exposure: np.ndarray) -> np.ndarray:
        table: np.ndarray = self.__dict__["_rounding"]
        place = np.minimum(np.sqrt(np.maximum(exposure, 0)) * (_LEVELS - 1) + 0.5, _LEVELS - 1).astype(np.intp)
        variance = super().variance(exposure)
        for c in range(exposure.shape[-1]):
            variance[..., c] += table[place[..., c], c % table.shape[1]]
        return variance


@dataclasses.dataclass(frozen=True, eq=False)
class Merged:
    """What `merge` answers.

    radiance: (rows, columns, 3) float32, full scales per second; a lower bound where saturated.
    variance: (rows, columns, 3) float32, of the radiance; infinite where saturated.
    saturated: (rows, columns) bool, clipped in every exposure.
    """

    radiance: np.ndarray
    variance: np.ndarray
    saturated: np.ndarray


def recover_response(codes: Array, times: Array) -> Response:
    """The response of a camera from `codes` (N, rows, columns, C) of one still scene, exposed for `times` (N,) seconds.

    uint8, or uint16, whose highest code tells the bits and of which at most 1024 levels are kept. Each channel is found
    up to one factor; the brightest code is put at exposure 1, so that what is white in the photographs stays white.
    Five exposures about two stops apart of a scene with black and white in it are plenty, best with uneven ratios of
    their times: where all are alike, a wave of that period in ln X fits as well, and smoothness alone decides. Codes
    that no two exposures share with others, as a rule the darkest and brightest few, are continued smoothly.

    Raises `ArrayError` where shapes or dtype are wrong, codes fall as the time grows or do not fit one curve (a scene
    that moves, times of other photographs), or well exposed codes cover less than 3/4 of the range; `ParameterError`
    where times are not positive or fewer than two differ.
    """
    z, t = to_numpy(codes), _times(times)
    if z.ndim != 4 or z.size == 0 or z.dtype not in (np.uint8, np.uint16):
        raise ArrayError(
            f"codes have shape {z.shape} and dtype {z.dtype}; uint8 or uint16 (photographs, rows, columns, channels) "
            "is wanted."
        )
    if len(z) != len(t):
        raise ArrayError(f"{len(z)} photographs, but {len(t)} times.")
    if len(np.unique(t)) < 2:
        raise ParameterError(f"times are all {t[0]:g} s. Two or more different ones tell a response.")
    count = 256 if z.dtype == np.uint8 else max(256, 2 ** int(z.max()).bit_length())
    levels = min(count, _LEVELS)
    step = count // levels
    z = (_thinned(z, 1) // step).reshape(len(t), -1, z.shape[3])[np.argsort(t)].astype(np.intp)
    log_time = np.log(np.sort(t))
    w = 1 - np.abs(2 * np.arange(levels) / (levels - 1) - 1)
    g, squares, weights = np.empty((levels, z.shape[2])), 0.0, 0.0
    for c in range(z.shape[2]):
        chosen = _chosen(z[..., c], log_time, levels, f"channel {c}")
        # The least squares know nothing of order: where noise makes them fall, the nearest curve that does not.
        g[:, c] = isotonic_regression(_debevec_malik(chosen, log_time, w)).x
        weight = w[chosen] ** 2
        log_radiance = g[chosen, c] - log_time[:, None]
        off = log_radiance - (weight * log_radiance).sum(axis=0) / weight.sum(axis=0)
        squares, weights = squares + float((weight * off**2).sum()), weights + float(weight.sum())
    residual = math.sqrt(squares / weights)
    if residual > _RESIDUAL:
        raise ArrayError(
            f"exposures are {residual:.0%} rms off what their times tell. The scene, its light or the camera "
            "moved, or the times are wrong."
        )
    return Response(g - g[-1], step, residual)


def merge(
    exposures: Array | Iterable[Array], times: Array, clipped: Array | Iterable[Array], noise: Noise | None = None
) -> Merged:
    """Radiance from linear photographs `exposures` (N, rows, columns, 3), 1 where the sensor clips, of `times` (N,) s.

    clipped: (N, rows, columns) bool, what does not count. noise: that of the camera, `Noise()` where None. exposures
    and clipped may be iterables of photographs, which are gone through twice and not held. A first mean, by t^2, tells
    the exposure that each photograph should have, and so its weight. Where every exposure is clipped, that of the
    shortest one stands; in the dark, where read noise is all, exposures count by t^2. Noise below black must not have
    been cut off, or the dark comes out too bright. Within a standard deviation of the clip, radiance is low by up to
    that deviation: there noise chooses what counts.

    Raises `ArrayError` where shapes or numbers of photographs differ, an exposure is not finite, or an iterable can be
    gone through only once; `ParameterError` where times are not positive.
    """
    t, noise = _times(times), noise or Noise()
    for name, given in (("exposures", exposures), ("clipped", clipped)):
        if isinstance(given, Iterator):
            raise ArrayError(
                f"{name} can be gone through once only, and twice is wanted. Pass an array, a list, or an object whose "
                "__iter__ reads anew."
            )
    first, weight, shortest = _sums(exposures, clipped, t, lambda k: np.asarray(t[k] ** 2))
    saturated = weight[..., 0] == 0
    first /= np.where(weight > 0, weight, 1)
    total, weight, _ = _sums(exposures, clipped, t, lambda k: t[k] ** 2 / noise.variance(first * t[k]))
    weight[saturated] = 1
    radiance, variance = total / weight, 1 / weight
    radiance[saturated], variance[saturated] = shortest[saturated], np.inf
    return Merged(radiance.astype(np.float32), variance.astype(np.float32), saturated)


def noise_of(photographs: Array) -> Noise:
    """The noise of a camera from linear `photographs` (N >= 2, rows, columns, C) alike but for noise, 1 is clipped.

    The photon transfer curve: variances over the photographs against means, at each pixel; the common one of those of
    like mean, and a line through these. Pixels that move or flicker do not count, nor do those above 0.9, which clip at
    times. The scene should reach from black to white, and noise below black must not have been cut off. All
    channels have one noise: pass one at a time where they were multiplied (white balance).

    Raises `ArrayError` where the shape is wrong, a number is not finite, means cover less than 0.1, or the variance
    does not grow with the mean.
    """
    x = to_numpy(photographs)
    if x.ndim != 4 or x.size == 0 or x.dtype.kind != "f" or len(x) < 2:
        raise ArrayError(
            f"photographs have shape {x.shape} and dtype {x.dtype}; two or more of floats, "
            "(photographs, rows, columns, channels), are wanted."
        )
    x = _thinned(x, 1).reshape(len(x), -1)
    require_finite(x, "photographs")
    mean, variance = x.mean(axis=0, dtype=np.float64), x.var(axis=0, ddof=1, dtype=np.float64)
    mean, variance = mean[mean < 0.9], variance[mean < 0.9]
    bins = [b for b in np.array_split(np.argsort(mean), max(1, min(100, len(mean) // 100))) if len(b)]
    m = np.array([np.median(mean[b]) for b in bins])
    v = np.array([_variance(variance[b], len(x) - 1) for b in bins])
    if len(m) < 2 or np.ptp(m) < 0.1:
        reach = f"from {m[0]:.3g} to {m[-1]:.3g}" if len(m) else "nowhere"
        raise ArrayError(
            f"means below 0.9 run {reach}: too little to tell gain from read noise. Photograph black and white, in "
            "units of full scale."
        )
    m, v = m[v > 0], v[v > 0]
    # Relative to the variance, as estimates of it scatter.
    gain, dark = _robust(np.stack((m / v, 1 / v), axis=-1), np.ones(len(v))) if len(v) > 1 else (0.0, 0.0)
    if not gain > 0:
        raise ArrayError("variance does not grow with the mean: the photographs are copies, denoised or not linear.")
    return Noise(float(gain), math.sqrt(max(float(dark), 0.0)))


def flat_field(white: Array) -> np.ndarray:
    """What a lens leaves of light, (rows, columns, C) float32, of a photograph `white` of an even target: to divide by.

    white: (rows, columns, C) linear, in any unit, not clipped. The map is 1 in each channel where it is brightest. A
    light that falls off to one side (b above) is told apart and left out; dust, or what else differs from its
    surroundings on a quarter of the image at most, does not count. The polynomial is one of logarithms, which a cosine
    to the fourth fits far better and which stay positive.

    Raises `ArrayError` where the shape is wrong, a number is not finite, or the target is not even: half its pixels are
    more than 10 % off the fit.
    """
    image = to_numpy(white)
    if image.ndim != 3 or image.size == 0 or image.dtype.kind not in "fiu" or min(image.shape[:2]) < 8:
        raise ArrayError(
            f"white has shape {image.shape} and dtype {image.dtype}; numbers, (rows, columns, channels), of 8 "
            "pixels or more a side are wanted."
        )
    require_finite(image, "white")
    rows, columns, channels = image.shape
    reach = math.hypot(rows, columns) / 2
    y, x = ((np.arange(n) + 0.5 - n / 2) / reach for n in (rows, columns))
    y, x = np.meshgrid(y, x, indexing="ij")
    r2 = x * x + y * y
    terms = np.stack([_thinned(term).ravel() for term in (np.ones_like(r2), r2, r2**2, r2**3, x, y)], axis=-1)
    gain = np.empty(image.shape, np.float32)
    for c in range(channels):
        some = _thinned(image[..., c]).ravel().astype(np.float64)
        middle = float(np.median(some))
        if not middle > 0:
            raise ArrayError(f"channel {c} of white is not positive on half its pixels or more.")
        level = np.log(np.maximum(some / middle, 1e-3))  # dead pixels are outliers, not infinities
        a, bend = np.zeros(6), np.zeros(len(some))
        for _ in range(3):  # ln(1 + b.x) is even in its second order, which would count as vignetting
            a = _robust(terms, level - bend)
            tilt = terms[:, 4:] @ a[4:]
            bend = np.log(np.maximum(1 + tilt, 0.1)) - tilt
        off = float(np.median(np.abs(terms @ a + bend - level)))
        if off > 0.1:
            raise ArrayError(f"channel {c} of white is {off:.0%} off a smooth curve: no photograph of an even target.")
        falloff = r2 * (a[1] + r2 * (a[2] + r2 * a[3]))
        gain[..., c] = np.exp(falloff - falloff.max())
    return gain


def _times(times: Array) -> np.ndarray:
    t = to_numpy(times).astype(np.float64)
    if t.ndim != 1 or t.size == 0:
        raise ArrayError(f"times have shape {t.shape}; (photographs,) seconds are wanted.")
    if not np.all(np.isfinite(t) & (t > 0)):
        raise ParameterError("times are not all positive numbers of seconds.")
    return t


def _codes(levels: int) -> np.ndarray:
    """Codes from 0 to 1, (levels,)."""
    if not 2 <= levels <= 65536:
        raise ParameterError(f"levels = {levels} lies outside [2, 65536].")
    return np.linspace(0, 1, levels)


def _thinned(images: np.ndarray, axis: int = 0) -> np.ndarray:
    """Every s-th row and column (`axis` and the next) of `images`, so that about _PIXELS are left."""
    s = math.ceil(math.sqrt(images.shape[axis] * images.shape[axis + 1] / _PIXELS))
    return images[(slice(None),) * axis + (slice(None, None, s), slice(None, None, s))]


def _robust(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """x (n,) of a x = b, (m, n) and (m,), by least squares whose weights fall off (Geman and McClure 1987)."""
    x = np.linalg.lstsq(a, b)[0]
    for _ in range(50):
        off = b - a @ x
        scale = max(3 * 1.4826 * float(np.median(np.abs(off))), 1e-9 * float(np.abs(b).max()))
        if scale == 0:
            break
        root = 1 / (1 + (off / scale) ** 2)
        before, x = x, np.linalg.lstsq(a * root[:, None], b * root)[0]
        if np.abs(a @ (x - before)).max() < 1e-3 * scale:
            break
    return np.asarray(x)


def _variance(sample: np.ndarray, freedom: int) -> float:
    """The variance of which `sample` (n,) are estimates with `freedom` degrees of freedom, but for those too large."""
    limit = 2 * float(gammaincinv(freedom / 2, 0.999))
    kept = float(gammainc(freedom / 2 + 1, limit / 2)) / 0.999  # what the mean of chi^2 below the limit lacks
    v = float(np.median(sample)) * freedom / (2 * float(gammaincinv(freedom / 2, 0.5)))
    for _ in range(10):
        below = sample[sample * freedom <= limit * v]
        v = float(below.mean()) / kept
    return v


def _chosen(z: np.ndarray, log_time: np.ndarray, levels: int, name: str) -> np.ndarray:
    """Levels (N, p) of pixels that two times tell of, chosen from `z` (N, P), rising in time, to cover the range."""
    later = np.diff(log_time) > 0
    falls = (z[:-1] - z[1:] > _FALL * levels)[later].any(axis=0).mean()
    if falls > _FALLING:
        raise ArrayError(
            f"{name}: codes fall as the time grows at {falls:.0%} of the pixels. The scene or the camera moved, or the "
            "times are those of other photographs."
        )
    # The brightest level that occurs is where a sensor clips that does not reach its last code.
    known = (z > 0) & (z < min(z.max(), levels - 1))
    first, last = known.argmax(axis=0), len(z) - 1 - known[::-1].argmax(axis=0)
    telling = known.any(axis=0) & (log_time[last] > log_time[first])
    z, known = z[:, telling], known[:, telling]
    covered = np.unique(z[known] * 32 // levels).size / 32
    if covered < _COVERED:
        raise ArrayError(
            f"{name}: pixels that are neither black nor clipped in two exposures cover {covered:.0%} of the codes. "
            "Bring the exposures closer together, and have black and white in the scene."
        )
    picks = [np.unique(row[k::_EACH], return_index=True)[1] * _EACH + k for row in z for k in range(_EACH)]
    return np.asarray(z[:, np.unique(np.concatenate(picks))])


def _debevec_malik(z: np.ndarray, log_time: np.ndarray, w: np.ndarray) -> np.ndarray:
    """g (levels,), 0 at the middle, from levels `z` (N, p) and weights `w` (levels,); equation 3 of the paper.

    ln E of each pixel is eliminated, it stands in two rows only: what is left are equations in g alone.
    """
    levels = len(w)
    weight = w[z] ** 2
    total = weight.sum(axis=0)
    to = weight * (log_time[:, None] - (weight * log_time[:, None]).sum(axis=0) / total)
    normal = np.zeros((levels, levels))
    for row, own in zip(z, weight, strict=True):
        pairs = np.bincount((row * levels + z).ravel(), (own * weight / total).ravel(), levels * levels)
        normal -= pairs.reshape(levels, levels)
    normal[np.diag_indices(levels)] += np.bincount(z.ravel(), weight.ravel(), levels)
    bend = np.diff(np.eye(levels), 2, axis=0) * w[1:-1, None]
    normal += _SMOOTHNESS * (levels / 256) ** 3 * bend.T @ bend  # of g by exposure, not by level
    normal[levels // 2, levels // 2] += 1  # g is free up to a constant: whatever weighs here is met exactly
    return np.asarray(solve(normal, np.bincount(z.ravel(), to.ravel(), levels), assume_a="pos"))


def _sums(
    exposures: Array | Iterable[Array],
    clipped: Array | Iterable[Array],
    t: np.ndarray,
    weight_of: Callable[[int], np.ndarray],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sums over the photographs k of w_k E_k and of w_k, 0 where clipped; E_k of the shortest: (rows, columns, C)."""
    total = weight = shortest = np.empty(0)
    k = -1
    for k, (photograph, out) in enumerate(itertools.zip_longest(exposures, clipped)):
        if k == len(t) or photograph is None or out is None:
            raise ArrayError(f"exposures, clipped and the {len(t)} times are not of the same number of photographs.")
        x, out = to_numpy(photograph), to_numpy(out)
        if k == 0:
            if x.ndim != 3 or x.size == 0:
                raise ArrayError(f"exposures[0] has shape {x.shape}; (rows, columns, channels) is wanted.")
            total, weight = np.zeros(x.shape), np.zeros(x.shape)
        if x.shape != total.shape or x.dtype.kind != "f":
            raise ArrayError(
                f"exposures[{k}] has shape {x.shape} and dtype {x.dtype}; floats {total.shape} are wanted."
            )
        if out.shape != x.shape[:2] or out.dtype != np.bool_:
            raise ArrayError(f"clipped[{k}] has shape {out.shape} and dtype {out.dtype}; bool {x.shape[:2]} is wanted.")
        require_finite(x, f"exposures[{k}]")
        w = np.where(out[..., None], 0.0, weight_of(k))
        total += w * (x / t[k])
        weight += w
        if k == np.argmin(t):
            shortest = x / t[k]
    if k + 1 != len(t):
        raise ArrayError(f"{len(t)} times, but {k + 1} photographs.")
    return total, weight, shortest
