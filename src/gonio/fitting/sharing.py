"""Reflectance sharing: a spatially varying BRDF from a handful of photographs, as one interpolant in space and angle.

    f(x, wi, wo) = a(x) exp(s(q)),   q = (x, y, u, |v|, w)       s radial basis functions and a linear polynomial, RS 13
    e = I |log f - log a - s|,   I ~ f cos theta_i               what is brought down: the error of radiance (RS 6)

Homogeneous without (x, y), RS 12; without w where one photograph shows a single theta_d, RS 15. a is 1, or a colour of
each site (RS 14), for texture that is finer than sharing could tell (`albedo`). Regions have an s each (RS 8).

RS interpolates f itself, over (u, v). Its logarithm is smoother and stays positive, and |v| adds the symmetry of
isotropic materials: for the same 600 centres the error of held-out samples falls from .076 to .0044 (`logarithm`,
`folded`; without both it is the paper's). RS interpolates at the centres; least squares of many samples more is what
photographs want, with their noise, edges and shadows (`smooth`); samples that are far off count little.

Not here: the solve (`radial_basis`, `smoothing`), the choice of centres (`centres`), and of scales (`validation`).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import Array, to_numpy
from ..brdf.combine import Scaled, Sum
from ..brdf.coverage import Coverage
from ..brdf.model import BRDF
from ..brdf.radial import Interpolant, Radial
from ..errors import ArrayError, ParameterError
from ..samples import ReflectanceSamples
from .albedo import DARKEST, albedo_of, ordinary
from .centres import Choice, choose_centres
from .collecting import SINGLE, Table, collected, entered
from .model import Fit
from .rules import Lookahead, Rule
from .smoothing import smoothed
from .validation import choose_scales

_GRAZING = 0.15  # cosine of light below which noise is most of what f is
_ASTRAY = 0.7  # what w weighs where it is asked how far from samples a fit can be trusted
_STIFF = 0.03  # where nothing tells how noisy samples are
_AGAIN = 2  # fits with weights by the one before
_USUAL = 0.3  # log f that is off by less is no outlier
_SAME = 1e-9  # as far apart, a centre is a sample: it went through its scales and back
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


@dataclasses.dataclass(frozen=True)
class _How:
    """What is the same for all regions."""

    logarithm: bool
    folded: bool
    smooth: bool
    rule: Rule
    error: float
    seed: int
    until: Callable[[], bool] | None


def share_reflectance(
    samples: Iterable[ReflectanceSamples],
    places: Array | None = None,
    *,
    regions: Array | None = None,
    centres: int = 2000,
    error: float = 0.0,
    scales: Scales | None = None,
    texture: bool = False,
    gray: bool = False,
    logarithm: bool = True,
    folded: bool = True,
    smooth: bool = True,
    rule: Rule | None = None,
    seed: int = 0,
    start: BRDF | None = None,
    progress: Callable[[int, int], None] | None = None,
    until: Callable[[], bool] | None = None,
) -> Fit[Shared]:
    """The BRDF at S sites from samples of a few photographs, a block of samples each.

    places: (S, 2), where each site lies on the surface, best in distances along it; None for one BRDF everywhere.
    regions: (S,) whole numbers. Sites of different ones share nothing, so that reflectance may jump between them.
    centres: at most, divided among regions by their samples; fewer where the residual falls to `error`. scales: found
    by leaving photographs out where None, in the largest region. texture: give each site its own colour. gray: fit the
    mean of the channels. logarithm, folded, smooth: as above; without all three it is the paper's. rule: how centres
    are chosen, `Lookahead()` where None. start: the material of an earlier fit of these samples, which goes on from its
    centres and scales as if it had not ended. progress(done, total) hears of centres; until() is asked between rounds
    of them, and True ends the fit with those there are. The fit's history counts centres from one region to the next.

    Raises `ArrayError` where there are too few samples, of a region too, none is positive, places or regions do not
    fit the sites, or centres of `start` are none of the samples; `ParameterError` where `start` was fitted otherwise.
    """
    apart = places is not None or regions is not None
    if texture and not apart:
        raise ParameterError(
            "texture gives each site its own colour: places are wanted, to tell the sites apart, or regions."
        )
    table = collected(samples, places, seed)
    if gray:
        table = dataclasses.replace(table, value=table.value.mean(axis=1, keepdims=True))
    if not apart:
        table = dataclasses.replace(table, site=np.zeros(len(table), np.intp))
    labels = _labels(table, places, regions)
    albedo = albedo_of(table, len(labels)) if texture else None
    of = labels[table.site]
    names, sizes = np.unique(of, return_counts=True)
    if len(alone := np.setdiff1d(labels, names)):
        raise ArrayError(f"region {alone[0]} has no sample. Give its sites to another, or take them out of the mask.")
    how = _How(logarithm, folded, smooth, rule or Lookahead(), error, seed, until)
    earlier = [None] * names.size if start is None else _earlier(start, names.size, how)
    regional: dict[int, Radial] = {}
    history: list[tuple[int, float]] = []
    ends, squares = [], 0.0
    for k, first in zip(np.argsort(-sizes, kind="stable"), earlier, strict=True):
        own, before = table[of == names[k]], history[-1][0] if history else 0
        most = round(centres * sizes[k] / len(table))

        def hear(done: int, _: int, before: int = before) -> None:
            if progress is not None:
                progress(before + done, centres)

        try:
            model, found, scales = _shared(own, albedo, most, scales, first, how, hear)
        except (ArrayError, ParameterError) as bad:
            raise type(bad)(f"region {names[k]}: {bad}" if names.size > 1 else str(bad)) from bad
        d = model.f(own.wi, own.wo)
        if albedo is not None:
            some = np.unique(own.site)
            albedo[some] = albedo_of(own, len(albedo), d)[some]
            d = d * albedo[own.site]
        squares += float(np.sum((own.wi[:, 2:] * (d - own.value)) ** 2))
        history += [(before + count, left) for count, left in found.history]
        ends.append((found.converged, found.reason))
        regional[int(names[k])] = model
    assert scales is not None
    seen = np.zeros(len(labels), bool)
    seen[table.site] = True
    residual = math.sqrt(squares / float(np.sum((table.wi[:, 2:] * table.value) ** 2)))
    converged, reason = min(ends, key=lambda end: end[0])  # the first that did not converge tells why
    material = _over_sites(regional, labels, albedo, places)
    return Fit(Shared(material, scales, seen), residual, converged, reason, tuple(history))


def _labels(table: Table, places: Array | None, regions: Array | None) -> np.ndarray:
    """The region of each site (S,), 0 where they are not told."""
    wanted = table.site.max() + 1 if places is None else len(to_numpy(places))
    if regions is None:
        return np.zeros(wanted, np.intp)
    labels = np.asarray(to_numpy(regions))
    if labels.ndim != 1 or labels.dtype.kind not in "iu" or (places is not None and len(labels) != wanted):
        raise ArrayError(f"regions are {labels.dtype} {labels.shape}; a whole number for each of {wanted} sites.")
    if len(labels) < wanted:
        raise ArrayError(f"regions are of {len(labels)} sites; samples are of {wanted} or more.")
    return labels.astype(np.intp)


def _shared(
    table: Table,
    albedo: np.ndarray | None,
    most: int,
    scales: Scales | None,
    earlier: Interpolant | None,
    how: _How,
    progress: Callable[[int, int], None],
) -> tuple[Radial, Choice, Scales]:
    """d of one region, at the places of its samples; the choice of its centres; and scales, found where None."""
    q, at = entered(table, how.folded)
    flat = float(np.ptp(q[:, -1])) < SINGLE
    if flat:
        q = q[:, :-1]
    target, cosine = table.value[at], table.wi[at, 2]
    weights = light = cosine
    if albedo is not None:
        colour = albedo[table.site[at]]
        target, light = target / colour, light * colour.mean(axis=1)
    if how.logarithm:
        target = np.log(np.maximum(target, DARKEST * ordinary(target)))
        weights = _bright(light * np.exp(target).mean(axis=1))
    spatial = table.place is not None
    given = None
    if earlier is not None:
        given = _found(earlier, q)
        scales = _scales_of(earlier, spatial, flat)
    elif scales is None:
        scales = _validated(q, target, weights, table.group[at], spatial, flat, how.seed)
    M = _diagonal(scales, spatial, flat)
    found = choose_centres(
        q, target, weights, M, scales.stiffness, how.rule, most, how.error, progress, given, how.until
    )
    interpolant = found.interpolant
    if how.smooth:
        interpolant = smoothed(interpolant, q, target, weights, how.seed)
        for _ in range(_AGAIN if how.logarithm else 0):
            trusted = _trusted(interpolant(q), target, light)
            interpolant = smoothed(interpolant, q, target, trusted, how.seed)
    # What grazing light makes of noise is no reflectance to end at.
    steep = cosine > _GRAZING
    some = target[steep] if steep.any() else target
    interpolant = dataclasses.replace(interpolant, limits=np.stack((some.min(axis=0), some.max(axis=0))))
    x, y = (None, None) if table.place is None else table.place.T
    coverage = Coverage.of(q, _diagonal(dataclasses.replace(scales, difference=_ASTRAY), spatial, flat), how.seed)
    model = Radial(interpolant, logarithm=how.logarithm, folded=how.folded, flat=flat, x=x, y=y, coverage=coverage)
    return model, found, scales


def _earlier(start: BRDF, regions: int, how: _How) -> list[Interpolant]:
    """The interpolants of an earlier fit, that of the largest region first."""
    terms = [term.model if isinstance(term, Scaled) else term for term in start.lobes()]
    if len(terms) != regions:
        raise ParameterError(f"start has {len(terms)} parts; one for each of {regions} regions is wanted.")
    found = []
    for term in terms:
        if not isinstance(term, Radial) or (term.logarithm, term.folded) != (how.logarithm, how.folded):
            raise ParameterError(f"start was not fitted with logarithm={how.logarithm} and folded={how.folded}.")
        found.append(term.interpolant)
    return found


def _found(earlier: Interpolant, q: np.ndarray) -> np.ndarray:
    """Which of the samples q (M, d) the centres are."""
    centres = to_numpy(earlier.centres)
    if centres.shape[1] != q.shape[1]:
        raise ParameterError(f"start has {centres.shape[1]} coordinates, these samples have {q.shape[1]}.")
    off, which = cKDTree(centres).query(q, distance_upper_bound=_SAME)
    hits = np.flatnonzero(np.isfinite(off))[::-1]
    at = np.full(len(centres), -1)
    at[which[hits]] = hits
    if lost := int(np.count_nonzero(at < 0)):
        raise ArrayError(
            f"{lost} of {len(at)} centres of start are none of these samples: it was fitted to others, or elsewhere."
        )
    return at


def _scales_of(earlier: Interpolant, spatial: bool, flat: bool) -> Scales:
    M = to_numpy(earlier.scales)
    space = float(M[0]) if spatial else Scales.space
    return Scales(space, Scales.difference if flat else float(M[-1]), earlier.rho)


def _over_sites(
    regional: dict[int, Radial], labels: np.ndarray, albedo: np.ndarray | None, places: Array | None
) -> BRDF:
    """The models of regions at all sites: one, times its colours; or their sum, each 0 outside its own."""
    if places is not None:
        x, y = to_numpy(places).astype(np.float64).T
        regional = {name: dataclasses.replace(model, x=x, y=y) for name, model in regional.items()}
    if len(regional) == 1:
        (model,) = regional.values()
        return model if albedo is None else Scaled(model, albedo)
    colour = 1.0 if albedo is None else albedo
    return Sum(tuple(Scaled(model, colour * (labels == name)[:, None]) for name, model in regional.items()))


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
