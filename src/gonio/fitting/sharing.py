"""Reflectance sharing: a spatially varying BRDF from a handful of photographs, as one interpolant in space and angle.

    f(x, wi, wo) = a(x) exp(s(q)),   q = (x, y, u, |v|, w)       s radial basis functions and a linear polynomial, RS 13
    e = I |log f - log a - s|,   I ~ f cos theta_i               what is brought down: the error of radiance (RS 6)

Homogeneous without (x, y), RS 12; without w where one photograph shows a single theta_d, RS 15. a is 1, or the median
of each site's samples (RS 14, 8.1), for texture that is finer than sharing could tell.

RS interpolates f itself, over (u, v). Its logarithm is smoother and stays positive, and |v| adds the symmetry of
isotropic materials: for the same 600 centres the error of held-out samples falls from .076 to .0044 (`logarithm`,
`folded`; without both it is the paper's). RS interpolates at the centres; least squares of many samples more is what
photographs want, with their noise, edges and shadows (`smooth`); samples that are far off count little. At theta_d = 0
phi_d has no meaning: such samples enter at eight angles, folded at five.

Not here: the solve (`radial_basis`, `smoothing`), the choice of centres (`centres`), and of scales (`validation`).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from ..arrays import Array, require_finite, to_numpy
from ..brdf.combine import Scaled
from ..brdf.model import BRDF
from ..brdf.radial import Radial
from ..directions import uvw
from ..errors import ArrayError, ParameterError
from ..reflection import varied
from ..samples import ReflectanceSamples
from .centres import Choice, choose_centres
from .model import Fit
from .rules import Lookahead, Rule
from .smoothing import smoothed
from .validation import choose_scales

_MOST = 1_100_000  # samples that are looked at: more tell no more
_SINGLE = 1e-3  # range of w within which a photograph is of one theta_d
_BACK = 0.01  # theta_d, radians, below which phi_d has no meaning
_GRAZING = 0.15  # cosine of light below which noise is most of what f is
_LIT = 0.2  # sum of a site's squared cosines below which its colour may be noise
_STIFF = 0.03  # where nothing tells how noisy samples are
_AGAIN = 2  # fits with weights by the one before
_USUAL = 0.3  # log f that is off by less is no outlier
_DARKEST = 1e-3  # of the median reflectance that is above 0: below it noise is all there is
_LEAST_AND_MOST = 0.05, 4.0  # weights, of the median: no highlight is all there is, nor does any dark count for nothing


@dataclasses.dataclass(frozen=True)
class Scales:
    """The diagonal of M and the stiffness: `space` m_xy > 0, in the unit of places, of RS .2 to .4 where they run over
    [0, 1]; `difference` m_w > 0; `stiffness` rho >= 0."""

    space: float = 0.3
    difference: float = 0.5
    stiffness: float = 0.0

    def __post_init__(self) -> None:
        positive = 0 < self.space < math.inf and 0 < self.difference < math.inf
        if not (positive and 0 <= self.stiffness < math.inf):
            raise ParameterError(f"{self}: space and difference are positive, stiffness is not negative, all finite.")


@dataclasses.dataclass(frozen=True, eq=False)
class Shared:
    """`material`, whose parameters vary over S sites where it does; `scales` as they were given or found; `sites` that
    had samples (S,) bool."""

    material: BRDF
    scales: Scales
    sites: np.ndarray


def share_reflectance(
    samples: Iterable[ReflectanceSamples],
    places: Array | None = None,
    *,
    centres: int = 2000,
    error: float = 0.0,
    scales: Scales | None = None,
    texture: bool = False,
    logarithm: bool = True,
    folded: bool = True,
    smooth: bool = True,
    rule: Rule | None = None,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Fit[Shared]:
    """The BRDF at S sites from samples of a few photographs, a block of samples each.

    places: (S, 2), where each site lies on the surface, best in distances along it; None for one BRDF everywhere.
    centres: at most; fewer where the residual falls to `error`. scales: found by leaving photographs out where None.
    texture: give each site its own colour. logarithm, folded, smooth: as above; without all three it is the paper's.
    rule: how centres are chosen, `Lookahead()` where None. progress(done, total) hears of centres.

    Raises `ArrayError` where there are too few samples, none is positive, or places do not fit the sites.
    """
    table = _collected(samples, places, seed)
    albedo = _albedo(table, places) if texture else None
    values = table.value if albedo is None else table.value / albedo[table.site]
    q, at = _entered(table, folded)
    flat = float(np.ptp(q[:, -1])) < _SINGLE
    if flat:
        q = q[:, :-1]
    target, cosine = values[at], table.wi[at, 2]
    light = cosine
    weights = light
    if logarithm:
        target = np.log(np.maximum(target, _DARKEST * _ordinary(target)))
        light = light if albedo is None else light * albedo[table.site[at]].mean(axis=1)
        weights = _bright(light * np.exp(target).mean(axis=1))
    spatial = places is not None
    chosen = scales
    if chosen is None:
        chosen = _validated(q, target, weights, table.group[at], spatial, flat, seed)
    diagonal = _diagonal(chosen, spatial, flat)
    found: Choice = choose_centres(
        q, target, weights, diagonal, chosen.stiffness, rule or Lookahead(), centres, error, progress
    )
    interpolant = found.interpolant
    if smooth:
        interpolant = smoothed(interpolant, q, target, weights, chosen.stiffness, seed)
        for _ in range(_AGAIN if logarithm else 0):
            trusted = _trusted(interpolant(q), target, light)
            interpolant = smoothed(interpolant, q, target, trusted, chosen.stiffness, seed)
    # What grazing light makes of noise is no reflectance to end at.
    steep = cosine > _GRAZING
    some = target[steep] if steep.any() else target
    interpolant = dataclasses.replace(interpolant, limits=np.stack((some.min(axis=0), some.max(axis=0))))
    x, y = (None, None) if places is None else to_numpy(places).astype(np.float64).T
    material: BRDF = Radial(interpolant, logarithm=logarithm, folded=folded, flat=flat, x=x, y=y)
    if albedo is not None:
        material = Scaled(material, albedo)
    count = 1 if places is None else len(to_numpy(places))
    seen = np.zeros(count, bool)
    seen[table.site if spatial else 0] = True
    residual = _left(material, table, places)
    return Fit(Shared(material, chosen, seen), residual, found.converged, found.reason, found.history)


@dataclasses.dataclass(frozen=True, eq=False)
class _Table:
    """M samples: wi, wo, value (M, 3) or (M, C); site, group (M,), the photograph; place (M, 2) or None."""

    wi: np.ndarray
    wo: np.ndarray
    value: np.ndarray
    site: np.ndarray
    group: np.ndarray
    place: np.ndarray | None


def _collected(samples: Iterable[ReflectanceSamples], places: Array | None, seed: int) -> _Table:
    """All samples, or evenly chosen ones of them where they are more than `_MOST`; those that are negative as 0."""
    rng, kept, share, total = np.random.default_rng(seed), [], 1.0, 0
    for number, block in enumerate(samples):
        draw = rng.random(len(block))
        some = draw < share
        kept.append((draw[some], block.wi[some], block.wo[some], block.value[some], block.site[some], number))
        total += int(np.count_nonzero(some))
        while total > _MOST:
            share /= 2
            kept = [_thinned(part, share) for part in kept]
            total = sum(len(part[0]) for part in kept)
    if not total:
        raise ArrayError("there are no samples. Do the lights belong to these photographs, and do they face the shape?")
    wi, wo, value, site = (np.concatenate([part[k] for part in kept]) for k in range(1, 5))
    group = np.concatenate([np.full(len(part[0]), part[5]) for part in kept])
    if not (value > 0).any():
        raise ArrayError("no sample is above 0: the photographs are black where lights reach the shape.")
    place = None
    if places is not None:
        at = to_numpy(places).astype(np.float64)
        if at.ndim != 2 or at.shape[1] != 2 or len(at) <= site.max():
            raise ArrayError(f"places have shape {at.shape}; ({site.max() + 1} or more sites, 2) is wanted.")
        require_finite(at, "places")
        place = at[site]
    return _Table(wi, wo, np.maximum(value, 0), site, group, place)


def _thinned(part: tuple[Any, ...], share: float) -> tuple[Any, ...]:
    """Of a block's arrays, where the first, drawn for each sample, lies below `share`; its number."""
    keep = part[0] < share
    return (*(x[keep] for x in part[:5]), part[5])


def _albedo(table: _Table, places: Array | None) -> np.ndarray:
    """The median of each site's samples (S, 3), weighted by their cosine, squared: radiance is as noisy at all. Of all
    where a site has none, at most of all where light grazes it alone; where it is black, near it."""
    if places is None:
        raise ParameterError("texture gives each site its own colour: places are wanted, to tell the sites apart.")
    overall = _ordinary(table.value)
    albedo = np.tile(overall, (len(to_numpy(places)), 1))
    for c in range(albedo.shape[1]):
        order = np.lexsort((table.value[:, c], table.site))
        site, first, count = np.unique(table.site[order], return_index=True, return_counts=True)
        total = np.concatenate(([0.0], np.cumsum(table.wi[order, 2] ** 2)))
        half = (total[first] + total[first + count]) / 2
        at = np.clip(np.searchsorted(total, half) - 1, first, first + count - 1)
        lit = total[first + count] - total[first] > _LIT
        found = np.maximum(table.value[order[at], c], _DARKEST * overall[c])
        albedo[site, c] = np.where(lit, found, np.minimum(found, overall[c]))
    return albedo


def _ordinary(value: np.ndarray) -> np.ndarray:
    """The median of what is above 0 in each channel (C,) of values (M, C), some of which are; in all where none is."""
    every = np.median(value[value > 0])
    return np.array([np.median(channel[channel > 0]) if (channel > 0).any() else every for channel in value.T])


def _entered(table: _Table, folded: bool) -> tuple[np.ndarray, np.ndarray]:
    """q (M, d), and the sample that each is of (M,): those at theta_d = 0 come at all angles."""
    angles = uvw(table.wi, table.wo)
    back = np.flatnonzero(angles[:, 2] < _BACK * 2 / math.pi)
    s, w = np.hypot(angles[back, 0], angles[back, 1]), angles[back, 2]
    angles[back] = np.stack((s, 0 * s, w), axis=-1)
    parts, at = [angles], [np.arange(len(angles))]
    # By eighths of a circle; folded, half of it is all there is.
    for turn in range(1, 5 if folded else 8):
        phi = turn * math.pi / 4
        parts.append(np.stack((s * math.cos(phi), s * math.sin(phi), w), axis=-1))
        at.append(back)
    q, sample = np.concatenate(parts), np.concatenate(at)
    if folded:
        q[:, 1] = np.abs(q[:, 1])
    if table.place is not None:
        q = np.concatenate((table.place[sample], q), axis=1)
    return q, sample


def _bright(radiance: np.ndarray) -> np.ndarray:
    """Weights (M,) by radiance, of its median where it is above 0: errors of bright pixels are seen more."""
    return np.asarray(np.clip(radiance / np.median(radiance[radiance > 0]), *_LEAST_AND_MOST))


def _trusted(fitted: np.ndarray, target: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Weights (M,) by the radiance that was fitted, less where the sample is far from it (Cauchy): what is far too
    bright has no say in its own weight."""
    off = np.sqrt(np.mean((target - fitted) ** 2, axis=1))
    usual = max(3 * 1.4826 * float(np.median(off)), _USUAL)
    return np.asarray(_bright(light * np.exp(fitted).mean(axis=1)) / (1 + (off / usual) ** 2))


def _diagonal(scales: Scales, spatial: bool, flat: bool) -> np.ndarray:
    """The diagonal of M, for the coordinates there are."""
    return np.array([scales.space] * (2 * spatial) + [1.0, 1.0] + [scales.difference] * (not flat))


def _validated(
    q: np.ndarray, target: np.ndarray, weights: np.ndarray, group: np.ndarray, spatial: bool, flat: bool, seed: int
) -> Scales:
    """Scales by leaving photographs out; with one photograph, those that RS used."""
    if len(np.unique(group)) < 2:
        return Scales(stiffness=_STIFF)
    try:
        found = choose_scales(q, target, group, weights, seed=seed)
    except ArrayError:  # with a photograph less there is one theta_d: nothing tells how far to trust another
        return Scales(stiffness=_STIFF)
    space = found.scales[0] if spatial else Scales.space
    return Scales(float(space), Scales.difference if flat else float(found.scales[-1]), found.rho)


def _left(material: BRDF, table: _Table, places: Array | None) -> float:
    """rms of what is left of radiance over the rms of radiance."""
    here = material if places is None else varied(material, lambda value, axes: value[table.site])
    light, f = table.wi[:, 2:], here.f(table.wi, table.wo)
    return float(np.sqrt(np.mean((light * (f - table.value)) ** 2) / np.mean((light * table.value) ** 2)))
