"""Example-based microfacet synthesis: from one view under many lights to a distribution of facets at every site.

    photographs -> slices (MS 8) less diffuse light (MS 9) -> partial D (MS 11) -> a few that stand for all (MS 5.3)
    -> eta (MS 19, 20) -> each of the few made whole from the others, turned (MS 13-17)
    -> mixtures of them (MS 18), k_d and k_s by linear least squares

In this order gonio departs from the paper, which finds eta last and k_s with D: F(h.o) rises two- to sixfold over a
slice, and D that took it for facets agrees with nothing when turned. Each step is a function of its own
(`facet_slices`, `partial_ndf`, `representatives`, `facet_index`, `completion`); here they are one after another, in
blocks of sites: what is kept of each is half floats of its partial D. Not here: relief and light from texel to texel.
"""

from __future__ import annotations

import dataclasses
import math
import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from ..arrays import frozen
from ..brdf.facet_areas import FacetAreas
from ..brdf.facet_mixture import FacetBasis, FacetMixture
from ..brdf.polar_grid import PolarGrid
from ..directions import normalise
from ..errors import MEMORY_LIMIT, AccuracyWarning, ArrayError, MemoryLimitError, ParameterError
from ..threads import one_blas_thread, processors
from .completion import CompletedNDFs, complete_ndfs, filled
from .facet_cells import Cells, Joined, Measured, Slices
from .facet_domain import Domain
from .facet_index import estimate_index, facing
from .facet_slices import FacetSlices, blended_slices
from .model import Fit
from .partial_ndf import Symmetric, fit_partial_ndfs
from .representatives import Representatives, choose_representatives
from .synthesis import grow_ndfs
from .turnable import Turnable
from .turned import nearest_turns

_PERCENTILE = 5.0  # of lights that count, from below, k_d (MS 9: the least, which noise draws down)
_FLOOR = 0.05  # of a site's mean radiance: darker lights are noise or shadow (MS 9)
_GRAZING = 0.1  # cosine of light below which k_d is not looked for
_INDEX = 1.5  # where the search for eta begins
_BLOCK = 256
_OPERATORS = 300  # at once
_COMMON = 0.7  # of what one site shows, shown by all: it is enough to tell sites apart
_LOOKED_AT = 200  # sites, first of all
_UNLIKE = 0.02  # relative squares: 14 % of D; .003 where facets recur, .05 to .5 where they do not

# (step, done, total)
Progress = Callable[[str, int, int], None]


@dataclasses.dataclass(frozen=True, eq=False)
class SynthesisedNDFs:
    """`material`, whose parameters vary over the sites; `representatives`, which of them stand for all; `completed`,
    how those were made whole; `residual` (S,), what is left of each site's radiance, relative, rms."""

    material: FacetMixture
    representatives: Representatives
    completed: CompletedNDFs
    residual: np.ndarray


@one_blas_thread()
def synthesise_ndfs(
    measured: Measured | Sequence[Measured],
    *,
    grid: PolarGrid | None = None,
    representatives: int | None = None,
    eta: float | None = None,
    paper: bool = False,
    tolerance: float = 0.04,
    seed: int = 0,
    threads: int | None = None,
    folder: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> Fit[SynthesisedNDFs]:
    """The facets of all sites of `measured`: `capture.reflectance()` of a flat sample under many lights. Several join
    as one (MS 4), as of a sample that was turned under the camera: their sites follow one another.

    grid: of D, 32 x 96 where None, which serves cloth; `PolarGrid(96, 256)` brushed metal. representatives: 1 % of the
    sites where None, which are made whole; some two and a half times as many bring the error down by a fourth.
    eta: the refractive index, found where None. paper: grow distributions (MS 14-17; `synthesis`) where gonio takes
    means of many (`completion`). tolerance: radians by which half vectors may differ between the nodes at which
    operators are made. threads: all processors where None. folder: where partial distributions are kept, 3 KB a site; a
    run that was stopped goes on from them. progress(step, done, total).

    Raises `ArrayError` where lights are too few, `ParameterError` for settings that are out of range,
    `MemoryLimitError` before more memory is taken than the limit. Warns (`AccuracyWarning`) where facets are unlike
    when turned, since all threads run one way.
    """
    sample = Joined(tuple(measured) if isinstance(measured, Sequence) else (measured,))
    grid = PolarGrid() if grid is None else grid
    if eta is not None and not 1 < eta <= 10:
        raise ParameterError(f"eta = {eta:g}; an index in (1, 10] is wanted, or None to find it.")

    def hear(step: str) -> Callable[[int, int], None]:
        return lambda done, total: progress(step, done, total) if progress is not None else None

    workers = processors() if threads is None else threads
    partial = _Partial(sample, grid, tolerance, _INDEX if eta is None else eta, workers)
    _tell_if_unlike(partial, grid)
    values = partial.values(None if folder is None else Path(folder), hear("partial distributions"))
    chosen = choose_representatives(
        lambda low, high: values[low:high] * partial.weights,
        len(sample),
        representatives,
        seed,
        hear("representatives"),
    )
    few = partial.of(values, chosen.texels)
    if eta is None:
        few = few.indexed(estimate_index(few.tables, few.confidence, few.cosines, grid, _INDEX))
    if paper:
        completed = grow_ndfs(few.tables, few.confidence, grid, progress=hear("synthesis"))
        whole = completed.tables
    else:
        completed = complete_ndfs(few.tables, few.confidence, grid, workers, hear("completion"))
        whole = completed.blended(few.refitted(completed.tables), few.confidence > 0)
    basis = FacetBasis.of(grid, whole, _trust(few.confidence, completed))
    mixture = FacetMixture(
        basis,
        chosen.indices,
        chosen.weights / chosen.weights.sum(axis=1, keepdims=True),
        eta=np.clip(np.sum(chosen.weights * few.eta[chosen.indices], axis=1), 1.01, 10),
    )
    material, residual, total = _coloured(sample, mixture, workers, hear("colours"))
    return Fit(
        SynthesisedNDFs(material, chosen, completed, residual),
        residual=total,
        converged=True,
        reason=f"{len(chosen.texels)} distributions made whole, {100 * completed.told.mean():.1f} % of facets told",
    )


def _tell_if_unlike(partial: _Partial, grid: PolarGrid) -> None:
    """Looks at a few sites before hours are spent: whether their facets recur at other turns."""
    some = np.unique(np.linspace(0, len(partial.measured) - 1, _LOOKED_AT).astype(int))
    few = partial.looked_at(some)
    turnable = Turnable.of(few.tables, few.confidence, grid, np.float32)
    # An eighth to three eighths of a turn, either way: less shows nothing new, more has little in common.
    eighth = grid.columns // 8
    ranges = ((eighth, 3 * eighth + 1), (5 * eighth, 7 * eighth + 1))
    near = nearest_turns(turnable, turnable, 1, ranges, (0.4, 1.0), relative=True)
    off = np.median(np.min([x.distance[:, 0] for x in near], axis=0))
    if _UNLIKE < off < np.inf:
        warnings.warn(
            f"facets of other sites, turned, are {100 * math.sqrt(off):.0f} % off at best: threads run one way, and "
            "what the eye did not see there is guessed. Photograph the sample turned under the camera, too, and fit "
            "both as one.",
            AccuracyWarning,
            stacklevel=4,
        )


def _trust(confidence: np.ndarray, completed: CompletedNDFs) -> np.ndarray:
    """255 where data are a distribution's own, 128 where they are others', 0 where they were filled in."""
    return np.where(confidence > 0, 255, np.where(completed.known, 128, 0)).astype(np.uint8)


@dataclasses.dataclass(frozen=True, eq=False)
class _Few:
    """Partial distributions of n sites: `fitted` (n, rows, columns) with one index, `tables` the same with `eta` (n,),
    their `confidence`, and wo (n, 3)."""

    grid: PolarGrid
    fitted: np.ndarray
    tables: np.ndarray
    confidence: np.ndarray
    wo: np.ndarray
    eta: np.ndarray

    @property
    def cosines(self) -> np.ndarray:
        """h.o (n, rows, columns)."""
        cosines: np.ndarray = np.clip(np.einsum("rcd,nd->nrc", self.grid.directions, self.wo), 0, 1).astype(np.float32)
        return cosines

    def indexed(self, eta: np.ndarray) -> _Few:
        """The same with another eta (n,): D is divided by what F rises."""
        before, now = (facing(x[:, None, None], self.cosines) for x in (self.eta, eta))
        return dataclasses.replace(self, tables=(self.tables * (before / now)).astype(np.float32), eta=eta)

    def refitted(self, whole: np.ndarray) -> np.ndarray:
        """`whole` tables with a site's own data as MS 11 finds them with the areas of what is whole (MS 5), in the
        place of those of D completed by its turn (`partial_ndf`)."""
        areas = FacetAreas(self.grid, _degree(self.grid))
        found, mass = whole.astype(np.float32), np.broadcast_to(self.grid.projected[:, None], self.grid.shape)
        for k, confidence in enumerate(self.confidence):
            own = confidence > 0
            first = np.append(0, self.fitted[k].ravel())[Symmetric().sources(own) + 1]
            domain = Domain(self.grid, self.wo[k], own)
            i = domain.lights[own]
            g = [
                np.maximum(areas.areas(areas.coefficients(D / np.sum(D * mass)), i), i[:, 2]) for D in (first, whole[k])
            ]
            D = self.tables[k][own] * g[1] / g[0]
            total = float(np.sum(mass[own] * D))
            if total > 0:
                found[k][own] = D * (float(np.sum(mass[own] * whole[k][own])) / total)
        return found


def _degree(grid: PolarGrid) -> int:
    """Of harmonics: cloth's tables want 8, metal's finer ones 12."""
    return 8 if grid.rows <= 32 else 12


class _Partial:
    """Partial distributions cell by cell; operators are made as cells ask for them, and the latest kept."""

    def __init__(self, measured: Joined, grid: PolarGrid, tolerance: float, eta: float, workers: int) -> None:
        self.measured, self.grid, self.eta, self.workers = measured, grid, eta, workers
        self.cells = Cells.of(measured, tolerance)
        self.domains = [Domain.under(grid, wo, wi) for wi, wo in zip(self.cells.wi, self.cells.wo, strict=True)]
        self.lit = [np.logical_and.reduce([self.domains[k].confidence > 0 for k in c.nodes]) for c in self.cells.cells]
        self.somewhere = np.logical_or.reduce(self.lit)
        shares = np.array([len(cell.sites) for cell in self.cells.cells]) / len(measured)
        seen = sum(share * lit for share, lit in zip(shares, self.lit, strict=True))
        solid, common = grid.solid_angles[:, None], np.logical_and.reduce(self.lit)
        if np.sum(solid * common) > _COMMON * np.sum(solid * seen):
            seen = common
        # MS 15 weighs squares by W and solid angle. What not all sites show does not count, or where that is much, as
        # on relief, as much as the part of them that does.
        W = np.mean([domain.confidence for domain in self.domains], axis=0)
        self.weights = np.sqrt(W * seen * solid)[self.somewhere].astype(np.float32)
        self._operators: dict[int, FacetSlices] = {}

    def values(self, folder: Path | None, hear: Callable[[int, int], None]) -> np.ndarray:
        """D (S, K), half floats, at the knots that any site shows; in a file of `folder` where one is given. Where a
        site shows nothing, what is likely: that sites are alike is told by all that any shows."""
        shape = len(self.measured), int(np.count_nonzero(self.somewhere))
        need = 2 * shape[0] * shape[1]
        if folder is None:
            if need > MEMORY_LIMIT:
                raise MemoryLimitError(
                    f"partial distributions of {shape[0]:,} sites need {1e-9 * need:.1f} GB of at most "
                    f"{MEMORY_LIMIT / 1e9:g}: name a folder to keep them in, or take a part of the sample."
                )
            values, begun = np.empty(shape, np.float16), np.zeros(len(self.cells.cells), bool)
        else:
            values, begun = _kept(folder, shape, len(self.cells.cells))
        left = [k for k in range(len(begun)) if not begun[k]]
        done = len(self.measured) - sum(len(self.cells.cells[k].sites) for k in left)
        for k, tables in zip(left, self._fitted(left), strict=True):
            sites = self.cells.cells[k].sites
            values[sites] = filled(tables, self.lit[k])[:, self.somewhere]
            begun[k] = True
            done += len(sites)
            hear(done, len(self.measured))
        return values

    def looked_at(self, some: np.ndarray) -> _Few:
        """Those of some sites, ascending, fitted for this alone."""
        cells, values = self.cells.cells, np.empty((len(some), len(self.weights)), np.float32)
        parts = [(k, cell.sites[np.isin(cell.sites, some)]) for k, cell in enumerate(cells)]
        for k, sites in parts:
            if len(sites):
                self._make(sorted({int(n) for n in cells[k].nodes} - set(self._operators)))
                values[np.searchsorted(some, sites)] = self._fit(k, sites)[:, self.somewhere]
        return self._few(values, some)

    def of(self, values: np.ndarray, sites: np.ndarray) -> _Few:
        """Those of some sites, in their order."""
        return self._few(values[sites], sites)

    def _few(self, values: np.ndarray, sites: np.ndarray) -> _Few:
        place = np.empty(len(self.measured), int)
        for k, cell in enumerate(self.cells.cells):
            place[cell.sites] = k
        confidence, wo = np.zeros((len(sites), *self.grid.shape), np.float32), np.empty((len(sites), 3))
        for k in np.unique(place[sites]):
            mine = place[sites] == k
            domain = self._domain(k)
            confidence[mine], wo[mine] = domain.confidence, domain.wo
        tables = np.zeros(confidence.shape, np.float32)
        tables[:, self.somewhere] = values
        tables = np.where(confidence > 0, tables, 0)
        return _Few(self.grid, tables, tables, confidence, wo, np.full(len(sites), self.eta))

    def _domain(self, k: int) -> Domain:
        """Of all sites of cell k: seen as from amidst its nodes."""
        cell = self.cells.cells[k]
        wo = np.asarray(normalise(cell.shares.mean(axis=0) @ self.cells.wo[cell.nodes], "the mean of wo"))
        return Domain(self.grid, wo, self.lit[k])

    def _fitted(self, cells: list[int]) -> Iterator[np.ndarray]:
        """Tables (sites, rows, columns) of each of the cells numbered so, a few at a time."""
        with ThreadPoolExecutor(self.workers) as pool:
            for low in range(0, len(cells), 8 * self.workers):
                some = cells[low : low + 8 * self.workers]
                nodes = {int(n) for k in some for n in self.cells.cells[k].nodes}
                for number in [n for n in self._operators if n not in nodes][:-_OPERATORS]:
                    self._operators.pop(number)
                self._make(sorted(nodes - set(self._operators)), pool)
                yield from pool.map(self._fit, some)

    def _make(self, numbers: list[int], pool: ThreadPoolExecutor | None = None) -> None:
        made = (map if pool is None else pool.map)(self._made, numbers)
        self._operators |= dict(zip(numbers, made, strict=True))

    def _made(self, number: int) -> FacetSlices:
        slices = FacetSlices(self.domains[number], self.cells.wi[number])
        _ = slices.weights
        return slices

    def _fit(self, k: int, sites: np.ndarray | None = None) -> np.ndarray:
        """Tables of all sites of cell k, or some of them."""
        cell, domain = self.cells.cells[k], self._domain(k)
        sites = cell.sites if sites is None else sites
        shares = cell.shares[np.isin(cell.sites, sites)]
        measured = self.measured.at(sites)
        rho = measured.value.mean(axis=-1)
        known = np.isfinite(rho)
        shine = np.maximum(np.where(known, rho, 0) - diffuse(measured).mean(axis=1, keepdims=True) / np.pi, 0)
        nodes = [self._operators[int(number)] for number in cell.nodes]
        slices = blended_slices(nodes, shares, shine, known)
        return fit_partial_ndfs(slices, domain, self.eta, degree=_degree(self.grid)).tables


def _kept(folder: Path, shape: tuple[int, int], cells: int) -> tuple[np.ndarray, np.ndarray]:
    """What an earlier run left in `folder` of as many sites, knots and cells, or nothing yet."""
    folder.mkdir(parents=True, exist_ok=True)
    arrays = []
    for name, size, dtype in (("partial.npy", shape, np.float16), ("done.npy", (cells,), np.bool_)):
        path = folder / name
        if path.exists():
            array = np.load(path, mmap_mode="r+", allow_pickle=False)
            if array.shape != size or array.dtype != dtype:
                raise ArrayError(
                    f"{path} is of another sample: {array.dtype} {array.shape}, not {size}. Remove {folder}, or name "
                    "another folder."
                )
        else:
            array = np.lib.format.open_memmap(path, "w+", dtype, size)
        arrays.append(array)
    return arrays[0], arrays[1]


def diffuse(measured: Slices, percentile: float = _PERCENTILE) -> np.ndarray:
    """k_d (S, 3): pi times the reflectance below which `percentile` of the lights lie that count (MS 9)."""
    radiance = measured.value.mean(axis=-1) * measured.wi[..., 2]
    with np.errstate(invalid="ignore"):
        bright = radiance > _FLOOR * np.nanmean(radiance, axis=1, keepdims=True)
    counts = bright & (measured.wi[..., 2] > _GRAZING)
    counts |= ~counts.any(axis=1, keepdims=True) & np.isfinite(radiance)
    least = np.nanpercentile(np.where(counts[..., None], measured.value, np.nan), percentile, axis=1)
    return np.asarray(np.pi * np.maximum(least, 0))


def _coloured(
    measured: Joined, mixture: FacetMixture, workers: int, hear: Callable[[int, int], None]
) -> tuple[FacetMixture, np.ndarray, float]:
    """`mixture` with k_d and k_s (S, 3) >= 0 by least squares of radiance, what is left of each site's, and of all."""
    count = len(measured)
    k_d, k_s = np.zeros((2, count, 3))
    off, whole = np.zeros((2, count))
    blocks = measured.blocks(_BLOCK)

    def solved(some: np.ndarray) -> tuple[np.ndarray, ...]:
        return _least_squares(measured.at(some), _sites(mixture, some))

    with ThreadPoolExecutor(workers) as pool:
        for some, (a, b, left, total) in zip(blocks, pool.map(solved, blocks), strict=True):
            k_d[some], k_s[some], off[some], whole[some] = a, b, left, total
            hear(int(some[-1]) + 1, count)
    residual = np.sqrt(off / np.where(whole > 0, whole, 1))
    everything = float(np.sqrt(off.sum() / whole.sum())) if whole.any() else 0.0
    return dataclasses.replace(mixture, k_d=k_d, k_s=k_s), frozen(residual), everything


def _sites(mixture: FacetMixture, some: np.ndarray) -> FacetMixture:
    return dataclasses.replace(
        mixture, indices=mixture.indices[some], weights=mixture.weights[some], k_d=0.0, k_s=1.0, eta=mixture.eta[some]
    )


def _least_squares(slices: Slices, lobes: FacetMixture) -> tuple[np.ndarray, ...]:
    """k_d, k_s (S, 3), and the sums of squares of what is left and of all, (S,), each light by its weight."""
    wi, wo = np.ascontiguousarray(np.moveaxis(slices.wi, 1, 0)), slices.wo
    lobe = np.asarray(lobes.f(wi, wo.astype(wi.dtype)))[..., 0].T.astype(np.float64)
    known = np.isfinite(slices.value).all(axis=-1)
    w = np.where(known, slices.weight, 0).astype(np.float64)
    y = np.where(known[..., None], slices.value, 0).astype(np.float64)
    w /= np.maximum(w.sum(axis=1, keepdims=True), 1e-300)
    # [a b; b c] (k_d/pi, k_s) = (p, q), each channel
    a, b, c = w.sum(axis=1)[:, None], np.sum(w * lobe, axis=1)[:, None], np.sum(w * lobe**2, axis=1)[:, None]
    p, q = np.einsum("sn,snc->sc", w, y), np.einsum("sn,snc->sc", w * lobe, y)
    scale = np.where(c > 0, c, 1)
    det = a * c - b * b
    solvable = det > 1e-9 * a * c
    det = np.where(solvable, det, 1)
    base, shine = np.where(solvable, (c * p - b * q) / det, p), np.where(solvable, (a * q - b * p) / det, 0)
    shine = np.where(base < 0, q / scale, shine)
    base = np.maximum(base, 0)
    base = np.where(shine < 0, np.maximum(p, 0), base)
    shine = np.maximum(shine, 0)
    left = y - base[:, None] - shine[:, None] * lobe[..., None]
    return np.pi * base, shine, np.einsum("sn,snc->s", w, left**2), np.einsum("sn,snc->s", w, y**2)
