"""A capture larger than memory: photographs written, ingested, and photometric stereo from the store, with peak memory.

    python benchmarks/large_capture.py FOLDER [photographs] [side]

FOLDER is new; by default 2,600 photographs of 800 x 800, 16-bit PNG: 10 GB of samples, some 12 GB on the disk with the
store. Each step runs in a process of its own. What was made is left in FOLDER, to be removed by hand.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import multiprocessing
import resource
import sys
import time
from pathlib import Path

import numpy as np

import gonio as gn
from gonio.files import store
from gonio.files.captures import photograph_files


def scene(side: int) -> tuple[np.ndarray, np.ndarray]:
    """Normals and albedo of a rippled sample."""
    y, x = np.mgrid[-1 : 1 : side * 1j, -1 : 1 : side * 1j]
    heights = side / 60 * np.sin(9 * x) * np.cos(7 * y)
    return gn.HeightField(heights).normals, 0.2 + 0.3 * np.stack((x * x, y * y, x * y + 1), axis=-1) / 2


def lights(count: int) -> np.ndarray:
    k = np.arange(count) + 0.5
    return np.asarray(gn.from_spherical(np.arccos(1 - 0.7 * k / count), k * np.pi * (3 - np.sqrt(5))))


def photograph(folder: Path, count: int, side: int) -> None:
    normals, albedo = scene(side)
    names = [f"photo{k:04d}.png" for k in range(count)]
    for k, light in enumerate(lights(count)):
        if not (folder / names[k]).exists():
            rng = np.random.default_rng(k)
            image = albedo * np.maximum(normals @ light, 0)[..., None]
            image += 2e-3 * rng.standard_normal((side, side, 1), dtype=np.float32)
            gn.write_image(folder / names[k], image.clip(0, 1), "linear", bits=16)
    gn.write_lp(folder / "dirs.lp", names, lights(count))


def ingest(folder: Path, count: int, side: int) -> None:
    store.ingest(photograph_files(folder), folder / store.STORE)


def stereo(folder: Path, count: int, side: int) -> None:
    relief = gn.photometric_stereo(gn.read_capture(folder, "linear"))
    off = np.degrees(np.arccos(np.sum(relief.normals * scene(side)[0], axis=-1).clip(-1, 1)))
    print(f"  normals: median {np.median(off):.3f} degrees off, worst {off.max():.3f}")


def samples(folder: Path, count: int, side: int) -> None:
    capture = gn.read_capture(folder, "linear")
    flat = np.broadcast_to((0.0, 0.0, 1.0), (side, side, 3))
    found = gn.Capture(capture.photographs, capture.lights, normals=flat).reflectance()
    total = 0
    for part in capture.photographs.parts(np.arange(side * side), 4096):
        total += int(np.count_nonzero(found.at(part).weight))
    print(f"  {total / 1e6:.0f} million samples, all lights of a site together")


def _run(step: str, *arguments: object) -> None:
    start, cpu = time.perf_counter(), time.process_time()
    globals()[step](*arguments)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform != "darwin" else 1e9)
    took, cpu = time.perf_counter() - start, time.process_time() - cpu
    print(f"{step:12} {took:7.1f} s, {cpu:7.1f} s of CPU, {peak:.2f} GB at most", flush=True)


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    count, side = (int(x) for x in (*sys.argv[2:], *("2600", "800")[len(sys.argv) - 2 :]))
    folder.mkdir(parents=True, exist_ok=True)
    for step in ("photograph", "ingest", "stereo", "samples"):
        process = multiprocessing.get_context("spawn").Process(target=_run, args=(step, folder, count, side))
        process.start()
        process.join()
        if process.exitcode:
            sys.exit(process.exitcode)
