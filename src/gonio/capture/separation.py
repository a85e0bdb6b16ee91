"""Diffuse and specular reflection told apart: by polarisers, by the least of many lights, by colour.

    parallel = specular + diffuse / 2,   crossed = diffuse / 2          RS 8.1
    k_d = min over q of pi I_q / (n.l_q),   I_q > floor mean(I)         MS 9
    I_q = d_q b + s_q c,   d_q, s_q >= 0                                RS 8.1: the dichromatic model (Shafer 1985)

I_q is the radiance of a site under light q, c the light's colour, b the site's diffuse colour. All three work on linear
radiance, site by site; NaN is what is not known (clipped, not measured). Answers are NumPy's, in the precision that
came in. Not here: polarisers that leak or turn, interreflection, and neighbours' help (bilateral filters, specular-free
images).
"""

from __future__ import annotations

import dataclasses

import numpy as np

from ..arrays import Array, floats, require_finite, to_numpy
from ..errors import ArrayError, ParameterError

_AGREES = 0.1  # a light is explained by k_d alone when its radiance is within this part of it
_DARK = 0.05  # of a site's mean: colours of darker samples are noise (the rule of MS 9)
_COLOUR_PERCENTILE = 20.0  # of the samples' colours, the purest first: the purest itself is noise's choice
_GREY = 1e-3  # a confidence by colour below it leaves nothing to separate by


@dataclasses.dataclass(frozen=True, eq=False)
class Separated:
    """`diffuse` and `specular`, non-negative, and `confidence` in [0, 1]; what each is stands with the function."""

    diffuse: np.ndarray
    specular: np.ndarray
    confidence: np.ndarray


def by_polarisers(parallel: Array, crossed: Array) -> Separated:
    """Both parts of photographs through a polariser parallel to the light's and one crossed with it (RS 8.1).

    parallel, crossed: (..., 3), linear radiance of the same exposure. Mirror-like reflection keeps the polarisation,
    and the crossed polariser stops it; light from within the body has lost it, and half passes either polariser. Hence
    specular = parallel - crossed and diffuse = 2 crossed, which RS leaves at one half: both (..., 3) as a camera
    without a polariser sees them, so that they sum to parallel + crossed wherever parallel >= crossed. Values below 0
    count as 0.

    confidence (...): 1 where parallel >= crossed, as physics has it in every channel; else 1 less what parallel falls
    short of crossed, as a share of crossed, over the channels together. So on matte parts it is 1 less the relative
    noise, for the half of the pixels that noise darkens; 0 where crossed and parallel are black or not known.

    Raises `ArrayError` where the shapes are not the same (..., 3) or a value is infinite.
    """
    parallel, crossed = (_values(x, name, 1) for x, name in ((parallel, "parallel"), (crossed, "crossed")))
    if parallel.shape != crossed.shape:
        raise ArrayError(f"parallel has shape {parallel.shape} and crossed {crossed.shape}; they are of one picture.")
    _, parallel, crossed = floats(np.maximum(parallel, 0), np.maximum(crossed, 0))
    short = np.maximum(crossed - parallel, 0).sum(axis=-1)
    total = crossed.sum(axis=-1)
    bright = total + parallel.sum(axis=-1) > 0  # so written that NaN fails too
    confidence = np.where(bright, 1 - short / np.where(total > 0, total, 1), 0)
    return Separated(2 * crossed, np.maximum(parallel - crossed, 0), confidence)


def by_least_light(values: Array, cosines: Array, floor: float = 0.05, percentile: float = 20.0) -> Separated:
    """The diffuse albedo of each site, from the lights under which it shines least, and what remains (MS 9).

    values: (sites, N, 3), radiance over the irradiance that the light gives to a facing plane. cosines: (sites, N),
    n.l; lights at or below 0 do not shine on the site. Radiance, by the mean of its channels, that is not above `floor`
    times the mean of the site's lights counts as shadow. `percentile` 0 is the minimum of MS 9, which noise draws down,
    as do half-shadows above the floor; the default departs from it: that per cent of the lights that count lie below
    k_d. It supposes that as many make no highlight, and k_d is too high by what a broad highlight sends to them.

    diffuse: k_d (sites, 3), the albedo, NaN where no light counts. specular: (sites, N, 3), values - k_d n.l / pi where
    that is positive, so that both give back the values that are not darker than k_d alone would be; 0 for lights below
    the horizon; NaN where values or k_d are not known. confidence: (sites,), of the lights that count, less the one
    that decides, the share that k_d alone explains to 10 %: 1 for a clean matte site, near 0 where every light leaves a
    highlight (k_d is then too high), where noise or a shadow has decided, or where fewer than two lights count.

    Raises `ArrayError` for other shapes, infinite values, cosines that are NaN or beyond 1, `ParameterError` for a
    floor outside [0, 1) and a percentile outside [0, 100].
    """
    values = _values(values, "values", 3)
    _, values, cosines = floats(values, to_numpy(cosines))
    if cosines.shape != values.shape[:2]:
        raise ArrayError(f"cosines has shape {cosines.shape}; {values.shape[:2]}, (sites, N), is wanted.")
    require_finite(cosines, "cosines")
    if cosines.size and np.abs(cosines).max() > 1 + 1e-3:
        raise ArrayError(f"cosines reach {np.abs(cosines).max():g}; n.l of unit vectors lies within [-1, 1].")
    if not 0 <= floor < 1:
        raise ParameterError(f"floor = {floor:g} lies outside [0, 1).")
    if not 0 <= percentile <= 100:
        raise ParameterError(f"percentile = {percentile:g} lies outside [0, 100].")
    lit = cosines > 0
    counts = _bright(values, lit, floor)
    ratio = np.pi * values / np.where(lit, cosines, 1)[..., None]
    k_d = np.maximum(_percentile(ratio, counts, percentile), 0)
    matte = k_d[:, None] * (np.maximum(cosines, 0) / np.pi)[..., None]
    specular = np.where(lit[..., None] | np.isnan(values), np.maximum(values - matte, 0), 0)
    off = np.abs(values.sum(axis=2) - matte.sum(axis=2))
    agrees = counts & (off <= _AGREES * matte.sum(axis=2))
    return Separated(k_d, specular, _others(agrees, counts).astype(values.dtype))


def by_colour(values: Array, light_colour: Array) -> Separated:
    """Both parts of each site by colour: highlights of dielectrics have the light's (Shafer 1985; RS 8.1).

    values: (sites, N, 3), radiance under N lights or from N eyes. light_colour: (3,), positive, of any brightness: ones
    where values are divided by the lights' intensities. A site's samples lie in the plane of the light's colour and its
    own; the plane is that of least squares, and within it the diffuse colour is the farthest from the light's, at the
    twentieth percentile. That supposes that a fifth of the lights make no highlight. Samples darker than 5 % of the
    site's mean do not decide.

    diffuse, specular: (sites, N, 3), specular of the light's colour, and diffuse the rest, so that they sum to the
    values; values below 0 count as 0, and NaN in a channel makes all of the sample NaN. confidence: (sites,), the sine
    of the angle between the two colours in RGB, by whose inverse noise grows, times 1 less the share (squared) that the
    samples lie off the plane to that which they lie off the light's colour. It is near 0 for grey sites under white
    light, which no colour separates; below 0.001, or with fewer than two samples, it is 0 and all is called diffuse.

    Raises `ArrayError` for other shapes, infinite values, and a light's colour that is not three positive numbers.
    """
    values = _values(values, "values", 3)
    light = to_numpy(light_colour)
    if light.shape != (3,) or light.dtype.kind not in "fiu" or not np.all(np.isfinite(light) & (light > 0)):
        raise ArrayError(f"light_colour = {light_colour!r:.60} is not three positive numbers.")
    values = np.maximum(values, 0)
    values[np.isnan(values).any(axis=2)] = np.nan
    c = light / np.linalg.norm(light.astype(np.float64))
    # Two directions across c: in their plane highlights vanish, and the diffuse parts of a site lie on one ray.
    across = np.linalg.svd(c[None])[2][1:]
    counts = _bright(values, np.ones(values.shape[:2], bool), _DARK)
    p = np.where(counts[..., None], values, 0) @ across.T
    spread, axes = np.linalg.eigh(np.swapaxes(p, 1, 2) @ p)
    (least, most), ray = spread.T, axes[..., 1]
    ray = ray * np.where(np.einsum("snk,sk->s", p, ray) < 0, -1, 1)[:, None]
    x, y = np.einsum("snk,sk->sn", values @ across.T, ray), values @ c
    # The diffuse colour is the direction (1, slope) in the plane of (ray, c); highlights only raise y.
    ratio = np.where(x > 0, y / np.where(x > 0, x, 1), np.inf)
    slope = _percentile(ratio[..., None], counts & np.isfinite(ratio), _COLOUR_PERCENTILE)[:, 0]
    known = np.isfinite(slope) & (counts.sum(axis=1) > 1)
    slope = np.where(known, slope, 0)
    sine = 1 / np.hypot(1, slope)
    confidence = np.where(known, sine * (1 - least.clip(0) / np.where(most > 0, most, 1)), 0)
    confidence[confidence < _GREY] = 0
    # No more of the light's colour than the sample has in any channel: so the rest stays a colour.
    s = np.clip(y - slope[:, None] * np.maximum(x, 0), 0, (values / c).min(axis=2))
    specular = np.where(confidence[:, None, None] > 0, s[..., None] * c, 0 * values).astype(values.dtype)
    return Separated(np.maximum(values - specular, 0), specular, confidence.astype(values.dtype))


def _values(values: Array, name: str, axes: int) -> np.ndarray:
    """A copy of `values` as floats, checked: (..., 3) with at least `axes` axes, exactly three where that is three."""
    _, checked = floats(to_numpy(values))
    if checked.ndim < axes or (axes == 3 and checked.ndim != 3) or checked.shape[-1] != 3 or not checked.size:
        raise ArrayError(
            f"{name} has shape {checked.shape}; {'(sites, lights, 3)' if axes == 3 else '(..., 3)'} is wanted."
        )
    if np.isinf(checked).any():
        raise ArrayError(f"{name} has infinite entries. Set what is not known to NaN.")
    return np.array(checked)


def _bright(values: np.ndarray, lit: np.ndarray, floor: float) -> np.ndarray:
    """Which of the samples (sites, N) are known, lit, and above `floor` times the mean of those of the site."""
    mean = values.mean(axis=2)
    known = lit & np.isfinite(mean)
    total = np.where(known, mean, 0).sum(axis=1)
    threshold = floor * total / np.maximum(known.sum(axis=1), 1)
    return np.asarray(known & (np.where(known, mean, 0) > np.maximum(threshold, 0)[:, None]))


def _percentile(x: np.ndarray, counts: np.ndarray, percentile: float) -> np.ndarray:
    """The percentile over axis 1 of x (sites, N, C) where `counts` (sites, N), linear between samples; NaN of none."""
    rising = np.sort(np.where(counts[..., None], x, np.inf), axis=1)
    rising[~counts.any(axis=1)] = np.nan
    place = np.asarray(percentile / 100 * np.maximum(counts.sum(axis=1) - 1, 0))[:, None, None]
    low, high = np.floor(place).astype(np.intp), np.ceil(place).astype(np.intp)
    below, above = np.take_along_axis(rising, low, 1), np.take_along_axis(rising, high, 1)
    return np.asarray((below + (place - low) * (above - below))[:, 0], dtype=x.dtype)


def _others(agrees: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """The share of `agrees` among `counts`, (sites, N) -> (sites,), one left out of both; 0 of fewer than two."""
    return np.asarray(np.maximum(agrees.sum(axis=1) - 1, 0) / np.maximum(counts.sum(axis=1) - 1, 1))
