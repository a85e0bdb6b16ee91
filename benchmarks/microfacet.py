"""Steps of microfacet synthesis: areas by harmonics beside direct quadrature, and partial distributions.

    OMP_NUM_THREADS=1 python benchmarks/microfacet.py [repetitions]
    python benchmarks/microfacet.py --whole [texels a side ...]      64 128 256

4,096 tables of 32 x 96 knots in float32, 512 directions, MS 5.1's greatest of 16 rings; CPU microseconds a table on one
thread, medians, taking turns. Direct quadrature is one dense product from knots to directions. The limit of a step is
the larger of its bytes (read and written once, at a copy's speed) and its products (at a large product's speed); what a
structure spares is not counted against it: the products are those of the matrices that are used. The error is that of
g below 80 degrees for brushed metal (GGX .05 by .20), relative rms. Partial distributions are of 4,096 slices of a
cloth (Beckmann .4 by .2) seen at 50 degrees.

--whole: a simulated brocade of so many texels (`reproductions/facet_samples.py`) under 480 lights of the hemisphere,
its reflectance made beforehand and held, 1 % of the texels representatives: seconds of each step on all processors, in
all, CPU, and the growth of the memory at its peak.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pathlib
import resource
import sys
import time

import numpy as np
from sphere import Work, copy_bandwidth, product_rate, times

import gonio as gn
from gonio.brdf.facet_areas import FacetAreas
from gonio.brdf.ndf_table import TabulatedNDF
from gonio.brdf.polar_grid import PolarGrid
from gonio.directions import from_spherical
from gonio.fitting.facet_domain import Domain
from gonio.fitting.partial_ndf import Bare, Ringed, Symmetric, fit_partial_ndfs

TABLES = 4096
METAL = gn.GGX(0.05, 0.2)


def facet_areas(repetitions: int) -> None:
    grid, rings = PolarGrid(), np.linspace(1, 0.05, 16)
    tables = np.random.default_rng(1).random((TABLES, *grid.shape), dtype=np.float32)
    theta = np.radians(np.linspace(0, 80, 16))
    views = from_spherical(theta[:, None], 2 * np.pi * np.arange(32) / 32).reshape(-1, 3)
    facing = (
        np.maximum(grid.directions.reshape(-1, 3) @ views.T, 0) * np.repeat(grid.solid_angles, grid.columns)[:, None]
    )
    dense = facing.astype(np.float32)
    works: dict[str, Work] = {"direct": lambda: tables.reshape(TABLES, -1) @ dense}
    knots, n_views, n_rings = grid.rows * grid.columns, len(views), 24 * len(rings)
    # Numbers moved and products, a table.
    limits = {"direct": (knots + n_views, knots * n_views)}
    for degree in (8, 12):
        areas = FacetAreas(grid, degree)
        c = areas.coefficients(tables)
        n, waves = areas.kept.size, grid.rows * (2 * degree + 1)
        works |= {
            f"coefficients, {degree}": lambda areas=areas: areas.coefficients(tables),
            f"areas, {degree}": lambda areas=areas, c=c: areas.areas(c, views),
            f"turned_least, {degree}": lambda areas=areas, c=c: areas.turned_least(c, rings),
        }
        limits |= {
            f"coefficients, {degree}": (knots + n, waves * grid.columns + waves * n),
            f"areas, {degree}": (n + n_views, n * n_views),
            f"turned_least, {degree}": (n + len(rings), n * n_rings),
        }
    taken = times(works, repetitions)
    copying, products = copy_bandwidth(), product_rate(np.float32)
    print(f"{TABLES} tables of {grid.rows} x {grid.columns}, {len(views)} directions, {len(rings)} rings; one core:")
    print(f"a copy reads {copying / 1e9:.1f} GB/s, {products / 1e9:.0f} billion products a second")
    print("us a table             taken    bytes products   taken / limit")
    for name, ms in taken.items():
        moved, multiplied = limits[name]
        us, by_bytes, by_products = ms * 1e3 / TABLES, moved * 4e6 / copying, multiplied * 1e6 / products
        print(f"  {name:18} {us:7.2f}  {by_bytes:7.2f}  {by_products:7.2f}   {us / max(by_bytes, by_products):7.1f}")
    metal = TabulatedNDF.of(METAL, grid.shape).values
    truth, weight = METAL.projected_area(views), np.sin(np.repeat(theta, 32))
    found = {"direct": metal.reshape(-1) @ facing}
    for degree in (8, 12):
        areas = FacetAreas(grid, degree)
        found[f"degree {degree}"] = areas.areas(areas.coefficients(metal), views)
    errors = {k: np.sqrt((weight * (g - truth) ** 2).sum() / (weight * truth**2).sum()) for k, g in found.items()}
    print("  error for metal: " + ", ".join(f"{name} {e:.1e}" for name, e in errors.items()))


def partial(repetitions: int) -> None:
    domain = Domain(PolarGrid(), from_spherical(np.radians(50), 0.3))
    known = domain.confidence > 0
    model = gn.Microfacet(gn.Beckmann(0.4, 0.2), gn.Fresnel(1.5), gn.Ashikhmin())
    rho = np.zeros(domain.grid.shape, np.float32)
    rho[known] = model.f(domain.lights[known], np.broadcast_to(domain.wo, domain.lights[known].shape))[:, 0]
    slices = np.repeat(rho[None], TABLES, axis=0)
    works: dict[str, Work] = {
        type(completion).__name__: lambda completion=completion: fit_partial_ndfs(slices, domain, completion=completion)
        for completion in (Symmetric(), Ringed(), Bare())
    }
    print("partial distributions, six turns, us a slice:")
    for name, ms in times(works, repetitions).items():
        print(f"  {name:18} {ms * 1e3 / TABLES:7.1f}")


def whole(side: int) -> None:
    sys.path.append(str(pathlib.Path(__file__).parents[1] / "reproductions"))
    import facet_samples as fs
    from microfacet_synthesis import Measured

    simulated = Measured(fs.captured(fs.cloth(side), fs.hemisphere()))
    value, weight = np.empty((len(simulated), 480, 3), np.float32), np.empty((len(simulated), 480), np.float32)
    for some in fs.blocks(len(simulated)):
        held = simulated.at(some)
        value[some], weight[some] = held.value, held.weight

    class Held(Measured):
        def at(self, some: np.ndarray) -> fs.Slices:
            wi, wo = self.directions(self.positions[some], self.frames[some])
            return fs.Slices(wi.astype(np.float32), wo, value[some], weight[some])

    steps: dict[str, list[float]] = {}

    def heard(step: str, *_: int) -> None:
        steps.setdefault(step, []).append(time.perf_counter())

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    wall, cpu = time.perf_counter(), time.process_time()
    gn.synthesise_ndfs(Held(simulated.captured), progress=heard)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1e6
    took = "  ".join(f"{step} {times[-1] - times[0]:.1f}" for step, times in steps.items())
    print(f"{side} x {side}: {took};  in all {wall:.1f} s, {cpu:.1f} of CPU, {grown:.2f} GB", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--whole"]:
        for side in [int(text) for text in sys.argv[2:]] or [64, 128, 256]:
            whole(side)
        sys.exit()
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 9
    facet_areas(count)
    partial(count)
