"""Environment maps: look-ups, resampling, harmonics and beams, in one run on one thread.

python benchmarks/environment.py [map.hdr]       # a 2:1 map; the demo's room where none is given
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np

import gonio as gn
from gonio.lights.studio import studio


def seconds(work: Callable[[], object], repeats: int = 3) -> float:
    work()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def look_ups(room: gn.Environment) -> None:
    rng = np.random.default_rng(1)
    w = gn.normalise(rng.normal(size=(1_000_000, 3))).astype(np.float32)
    layouts = (
        (gn.LatLongMap(), 512), (gn.CubeCross(), 1024), (gn.AngularMap(), 768), (gn.DualParaboloid(), 512),
        (gn.MirrorBall(), 768), (gn.MirrorBall(4.0), 768),
    )  # fmt: skip
    for mapping, rows in layouts:
        other = room.resampled(mapping, rows, gn.Orientation.PANORAMA)
        kernel, plain = seconds(lambda o=other: o.radiance(w)), seconds(lambda o=other: o._radiance(w), 1)
        nearest = seconds(lambda o=other: o.nearest(w))
        print(
            f"look-up, {mapping!s:32s} {1 / kernel:6.1f} million/s, nearest {1 / nearest:6.1f}"
            f"   (array code {1 / plain:.1f})"
        )


def resampling() -> None:
    rng = np.random.default_rng(2)
    large = gn.Environment(rng.random((1024, 2048, 3), dtype=np.float32))
    for mapping, rows in ((gn.LatLongMap(), 1024), (gn.CubeStrip(), 6 * 512), (gn.LatLongMap(), 128)):
        elapsed = seconds(lambda m=mapping, r=rows: large.resampled(m, r, gn.Orientation.PANORAMA.rotated(TILT)), 1)
        print(f"resample 2048 x 1024 to {type(mapping).__name__} of {rows} rows: {elapsed:.2f} s")
    print(f"harmonics of 2048 x 1024 to degree 2: {seconds(lambda: large.harmonics(2), 1):.3f} s")


def budgets(room: gn.Environment) -> None:
    """Errors of cosine and glossy sums at 200 normals, relative rms, against all texels."""
    rng = np.random.default_rng(3)
    normals = gn.normalise(rng.normal(size=(200, 3)))
    small = room.resampled(gn.LatLongMap(), 256)
    every = small.beams()

    def errors(directions: np.ndarray, irradiance: np.ndarray) -> tuple[float, ...]:
        out = []
        for power in (1, 10, 100):

            def lit(d: np.ndarray, e: np.ndarray, power: int = power) -> np.ndarray:
                total: np.ndarray = np.maximum(normals @ d.T, 0) ** power @ e
                return total

            truth = lit(every.directions, every.irradiance)
            out.append(float(np.linalg.norm(lit(directions, irradiance) - truth) / np.linalg.norm(truth)))
        return tuple(out)

    print("beams   method       cos     cos^10  cos^100   seconds")
    for budget in (16, 64, 256, 1024):
        start = time.process_time()
        beams = small.beams(budget=budget)
        elapsed = time.process_time() - start
        row = errors(beams.directions, beams.irradiance)
        print(f"{budget:5d}   clusters   {row[0]:.5f} {row[1]:.5f} {row[2]:.5f}   {elapsed:.3f}")
        side = int(budget**0.5)
        u = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), -1) + rng.random((side, side, 2))
        w = small.sample(u.reshape(-1, 2) / side)
        row = errors(w, small.radiance(w) / small.pdf(w)[:, None] / side**2)
        print(f"{side * side:5d}   stratified {row[0]:.5f} {row[1]:.5f} {row[2]:.5f}")
        row = errors(*median_cut(*small_parts(small), budget))
        print(f"{budget:5d}   median cut {row[0]:.5f} {row[1]:.5f} {row[2]:.5f}")


def small_parts(room: gn.Environment) -> tuple[np.ndarray, np.ndarray]:
    return room.directions()[0], room.image * room.solid_angles[..., None]


def median_cut(w: np.ndarray, energy: np.ndarray, budget: int) -> tuple[np.ndarray, np.ndarray]:
    """Debevec 2005: regions cut into halves of equal energy along their longer side, a light at each centroid."""
    light = energy.sum(axis=-1)
    regions = [(0, light.shape[0], 0, light.shape[1])]
    while len(regions) * 2 <= budget:
        halves = []
        for r0, r1, c0, c1 in regions:
            part = light[r0:r1, c0:c1]
            wide = (c1 - c0) * np.sin(np.pi * (r0 + r1) / 2 / light.shape[0])
            along = np.cumsum(part.sum(axis=0 if wide >= r1 - r0 else 1))
            k = int(np.clip(np.searchsorted(along, along[-1] / 2) + 1, 1, max(len(along) - 1, 1)))
            if wide >= r1 - r0 and c1 - c0 > 1:
                halves += [(r0, r1, c0, c0 + k), (r0, r1, c0 + k, c1)]
            elif r1 - r0 > 1:
                halves += [(r0, r0 + k, c0, c1), (r0 + k, r1, c0, c1)]
            else:
                halves.append((r0, r1, c0, c1))
        if len(halves) == len(regions):
            break
        regions = halves
    directions = [np.tensordot(light[a:b, c:d], w[a:b, c:d], 2) for a, b, c, d in regions]
    return gn.normalise(np.array(directions)), np.array([energy[a:b, c:d].sum((0, 1)) for a, b, c, d in regions])


TILT = np.array([[1.0, 0.0, 0.0], [0.0, 0.8, -0.6], [0.0, 0.6, 0.8]])

if __name__ == "__main__":
    picture = gn.read_environment(sys.argv[1]) if len(sys.argv) > 1 else studio()
    look_ups(picture)
    resampling()
    budgets(picture)
