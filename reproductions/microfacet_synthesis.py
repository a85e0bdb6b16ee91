"""MS on samples whose facets are known (`facet_samples.py`): what one view and 480 lights tell of other views.

    python reproductions/microfacet_synthesis.py [texels a side] [representatives ...]      64 and 41 163 400

Relative rms of radiance at three views that were never captured (theta 51, phi -15, MS figs. 9 and 10; the opposite
azimuth; grazing), of a brocade of two leaning lobes a material in frames of all azimuths, noise 1 %, under 480 lights
of the hemisphere and under an array of 20 x 24 LEDs 4 cm above 10 cm:

    ideal        the true D on the grid, k_d and k_s refitted       what the model and the table leave
    gonio        means of many (`completion`), eta found
    grown        one by one (`synthesis`): the paper's way, in gonio's order
    no others    D filled by symmetry and rings alone
    Ward         per texel (MS fig. 10), with and without Fresnel: `ward_fits.py`

and of gonio's, the errors of k_d (relative rms) and eta (rms).
"""

from __future__ import annotations

import dataclasses
import sys
import time

import facet_samples as fs
import numpy as np
from ward_fits import fit_ward

import gonio as gn
from gonio.fitting import microfacets
from gonio.fitting.completion import Partial, finished


@dataclasses.dataclass(frozen=True, eq=False)
class Measured:
    """A simulated capture as `fitting` wants it."""

    captured: fs.Captured

    @property
    def sites(self) -> Measured:
        return self

    @property
    def positions(self) -> np.ndarray:
        return self.captured.positions

    @property
    def frames(self) -> np.ndarray:
        return np.broadcast_to(np.eye(3), (len(self), 3, 3))

    def __len__(self) -> int:
        return len(self.captured)

    def at(self, some: np.ndarray) -> fs.Slices:
        return self.captured.at(some)

    def directions(self, positions: np.ndarray, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        wi, _ = self.captured.lights.arriving(positions)
        wo = np.asarray(gn.normalise(self.captured.eye - positions))
        return np.broadcast_to(wi, (len(positions), *wi.shape[1:])), wo


@dataclasses.dataclass(frozen=True, eq=False)
class Fitted:
    """A material of sites, asked as `fs.errors` asks."""

    material: gn.FacetMixture

    def f(self, wi: np.ndarray, wo: np.ndarray, sites: np.ndarray) -> np.ndarray:
        some = {name: getattr(self.material, name)[sites[:, 0]] for name in self.material.bounds}
        values = dataclasses.replace(self.material, **some).f(wi[:, None], wo)
        return np.moveaxis(np.broadcast_to(values, (len(wi), len(sites), 3)), 0, 1)


def said(name: str, model: fs.Reflecting, sample: fs.Sample, sites: np.ndarray, more: str = "") -> None:
    off = fs.errors(model, sample, fs.novel(), sites)
    print(f"  {name:28}" + "".join(f"{100 * off[view]:8.1f}" for view in (*off,)) + f"   {more}", flush=True)


def ideal(sample: fs.Sample, measured: Measured, sites: np.ndarray) -> fs.Reflecting:
    """The true D of `sites` on the grid; the others are given the first's."""
    grid = gn.PolarGrid()
    D = sample.D(grid.directions.reshape(-1, 3), sites[:, None]).reshape(-1, *grid.shape)
    of = np.zeros((len(sample), 1), int)
    of[sites, 0] = np.arange(len(sites))
    mixture = gn.FacetMixture(gn.FacetBasis.of(grid, D), of, np.ones(of.shape), eta=sample.eta.ravel())
    some = microfacets._sites(mixture, sites)
    k_d, k_s, *_ = microfacets._least_squares(measured.at(sites), some)
    colours = np.zeros((2, len(sample), 3))
    colours[0, sites], colours[1, sites] = k_d, k_s
    return Fitted(dataclasses.replace(mixture, k_d=colours[0], k_s=colours[1]))


def filled(tables: np.ndarray, confidence: np.ndarray, grid: gn.PolarGrid, *_: object) -> object:
    """No others: in the place of `complete_ndfs`."""
    partial = Partial.of(tables, confidence, grid)
    nothing = np.full_like(partial.D, np.nan)
    return finished(np.where(partial.known, partial.D, np.nan), partial.known, nothing, grid)


def compare(sample: fs.Sample, lights: fs.Lights, counts: list[int]) -> None:
    sites = np.sort(np.random.default_rng(0).choice(len(sample), min(1000, len(sample)), replace=False))
    measured, tolerance = Measured(fs.captured(sample, lights)), 0.06 if lights.near else 0.02
    k_d, eta = sample.k_d.reshape(-1, 3), sample.eta.ravel()
    said("ideal", ideal(sample, measured, sites), sample, sites)

    def fit(name: str, count: int, paper: bool = False) -> None:
        began = time.perf_counter()
        found = gn.synthesise_ndfs(measured, representatives=count, tolerance=tolerance, paper=paper).value.material
        took = time.perf_counter() - began
        off = np.sqrt(np.mean((found.k_d - k_d) ** 2) / np.mean(k_d**2))
        more = f"k_d {100 * off:.1f} %, eta {np.sqrt(np.mean((found.eta - eta) ** 2)):.3f}, {took:.0f} s"
        said(f"{name}, {count}", Fitted(found), sample, sites, more)

    for count in counts:
        fit("gonio", count)
    fit("grown", counts[-1], paper=True)
    ours = microfacets.complete_ndfs
    microfacets.complete_ndfs = filled
    fit("no others", counts[-1])
    microfacets.complete_ndfs = ours
    some, place = sites[:256], np.full(len(sample), -1)
    place[some] = np.arange(len(some))
    for name, how in WARDS.items():
        said(name, _Placed(fit_ward(_Some(measured, some), **how), place), sample, some)


WARDS = {
    "Ward, isotropic": {"anisotropic": False},
    "Ward, anisotropic": {},
    "Ward, anisotropic, Fresnel": {"fresnel": True},
    "the same, bounded": {"fresnel": True, "bounded": True},
}


def main(side: int, counts: list[int]) -> None:
    sample = fs.cloth(side)
    for lights in (fs.hemisphere(), fs.led_array()):
        print(f"{side} x {side} under {'LEDs' if lights.near else 'the hemisphere'}, % off", flush=True)
        print(" " * 30 + "".join(f"{name:>8}" for name in ("beside", "oppos.", "grazing", "all")))
        compare(sample, lights, counts)


@dataclasses.dataclass(frozen=True, eq=False)
class _Some:
    """Some sites of what was measured."""

    measured: Measured
    sites: np.ndarray

    def __len__(self) -> int:
        return len(self.sites)

    def at(self, some: np.ndarray) -> fs.Slices:
        return self.measured.at(self.sites[some])


@dataclasses.dataclass(frozen=True, eq=False)
class _Placed:
    model: fs.Reflecting
    place: np.ndarray

    def f(self, wi: np.ndarray, wo: np.ndarray, sites: np.ndarray) -> np.ndarray:
        return self.model.f(wi, wo, self.place[sites])


if __name__ == "__main__":
    numbers = [int(text) for text in sys.argv[1:]] or [64, 41, 163, 400]
    main(numbers[0], numbers[1:] or [max(2, numbers[0] ** 2 // 100)])
