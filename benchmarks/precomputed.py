"""A view relit from images made beforehand, beside the full model: time an image, size of the file, and what is lost.

    OMP_NUM_THREADS=1 python benchmarks/precomputed.py [--large] [repetitions]

A ball of 256 x 256 pixels with a Radial of 2,000 centres, fitted to a paint whose colour varies with the place, in a
room of 256 x 512 texels, at 5, 2 and 1 %; `--large`: 612 x 512, at 2 % alone. Milliseconds of CPU, medians, one thread:
`light` averages the room over the cells (`small`: of 64 x 128 texels), `image` is what a frame costs beside it,
`relight` the full model with its own number of beams (256), `as cells` with as many as there are cells. `off` is the
relative rms of the compressed image against the full model with 2,048 beams. Making it is timed once, on all threads,
and the largest memory of the process is printed at the end.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from sharing import directions, fitted
from sphere import times

import gonio as gn
from gonio.brdf.radial import Interpolant
from gonio.files.precomputed import write_precomputed
from gonio.rendering.precomputing import precompute
from gonio.rendering.relight import Relightable, relight

CENTRES = 2000


def painted(rng: np.random.Generator) -> Interpolant:
    """log f of a paint over (x, y, u, |v|, w), three colours, through 2,000 values."""
    paint = gn.Lambert(0.3) + gn.Microfacet(gn.GGX(0.2), gn.Fresnel(1.5))
    wi, wo, place = directions(rng, CENTRES), directions(rng, CENTRES), rng.uniform(size=(CENTRES, 2))
    angles = gn.uvw(wi, wo)
    angles[:, 1] = np.abs(angles[:, 1])
    values = np.log(paint.f(wi, wo)) + 0.3 * np.sin(5 * place[:, :1] + np.arange(3))
    return fitted(np.concatenate((place, angles), axis=1), np.array([0.3, 0.3, 1.0, 1.0, 0.3]), values)


def ball(rows: int, columns: int) -> Relightable:
    """It fills the height of the picture."""
    camera = gn.Pinhole.look_at(
        eye=[0.0, 0, 4], target=[0.0, 0, 0], up=(0, 1, 0), field_of_view=29.5, size=(rows, columns)
    )
    view = gn.Sphere().view(camera)
    s = painted(np.random.default_rng(0))
    row, column = np.mgrid[:rows, :columns] / max(rows, columns)
    return Relightable(view, gn.Radial(s, x=row, y=column))


def main(rows: int, columns: int, errors: tuple[float, ...], repetitions: int) -> None:
    thing = ball(rows, columns)
    room, small = gn.studio(256), gn.studio(64)
    count = int(thing.view.mask.sum())
    start = time.process_time()
    truth = relight(thing, room, samples=2048)
    print(
        f"{rows} x {columns}, {count:,} pixels of it seen; full model, 2,048 beams {time.process_time() - start:.0f} s"
    )
    for error in errors:
        cpu, wall = time.process_time(), time.perf_counter()
        made = precompute(thing, error=error)
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "fast.gonio"
            write_precomputed(path, made)
            size = path.stat().st_size
        cells = made.cells.radiance(room)
        taken = times(
            {
                "light": lambda m=made: m.cells.radiance(room),
                "small": lambda m=made: m.cells.radiance(small),
                "image": lambda m=made, c=cells: m.shown(c),
            },
            repetitions,
        )
        off = np.sqrt(np.mean((made.shown(cells) - truth) ** 2) / np.mean(truth**2))
        print(
            f"  error {error:5} reached {made.error:.4f}  off {off:.4f}  made in {cpu:5.0f} s CPU, {wall:5.0f} s; "
            f"{made.lights.shape[1]:4} lights, {made.ranks.mean():5.1f} images a block; file {size / 1e6:6.2f} MB of "
            f"{6e-6 * count * len(made.cells):,.0f}; " + ", ".join(f"{name} {ms:.1f} ms" for name, ms in taken.items())
        )
    works = {"relight": lambda: relight(thing, room), "as cells": lambda: relight(thing, room, samples=len(made.cells))}
    for name, ms in times(works, 1).items():
        print(f"  {name:<10}{ms:10.0f} ms")
    print(f"  largest memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} GB")


if __name__ == "__main__":
    numbers = [int(word) for word in sys.argv[1:] if word.isdigit()]
    how = (512, 612, (0.02,)) if "--large" in sys.argv else (256, 256, (0.05, 0.02, 0.01))
    main(*how, numbers[0] if numbers else 9)
