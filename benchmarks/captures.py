"""Captures: photometric stereo, ingest beside decoding, heights from normals. CPU time, medians.

    python benchmarks/captures.py [FOLDER] [repetitions]

FOLDER is a capture of files; it is copied aside and ingested there. Samples are dropped as they come; one is eleven
numbers of eight bytes. Photometric stereo is of 96 photographs of 612 x
512 held in memory, with noise; heights of a spherical cap in a disc of a million pixels' square.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import shutil
import sys
import tempfile
import warnings
from collections import deque
from pathlib import Path

import numpy as np
from sphere import times

import gonio as gn
from gonio.capture.photographs import Held
from gonio.files import store
from gonio.files.captures import photograph_files
from gonio.files.images import read_raster


def stereo(repetitions: int) -> None:
    rng = np.random.default_rng(1)
    lights = gn.normalise(rng.normal(size=(96, 3)) * np.array([0.6, 0.6, 0.3]) + np.array([0, 0, 1]))
    normals = gn.normalise(rng.normal(size=(612, 512, 3)) * np.array([0.3, 0.3, 0.2]) + np.array([0, 0, 1]))
    images = np.maximum(np.einsum("rci,ki->krc", normals, lights), 0) + rng.normal(size=(96, 612, 512)) * 0.01
    capture = gn.Capture(Held(np.repeat(images[..., None], 3, axis=3).astype(np.float32)), gn.distant_lights(lights))
    works = {
        "robust": lambda: gn.photometric_stereo(capture),
        "least squares": lambda: gn.photometric_stereo(capture, robust=False),
    }
    print("photometric stereo, 96 photographs of 612 x 512")
    for name, taken in times(works, repetitions).items():
        found = works[name]()
        off = np.degrees(np.arccos(np.sum(found.normals * normals, axis=-1).clip(-1, 1)))
        print(f"  {name:14} {taken / 1e3:5.2f} s   mean {off.mean():.3f} degrees off")


def heights(repetitions: int) -> None:
    y, x = np.mgrid[-1:1:1000j, -1:1:1000j]
    mask = x * x + y * y < 1
    z = np.sqrt(np.where(mask, 1.2 - x * x - y * y, 1))
    normals = np.stack((x, -y, z), axis=-1) / np.sqrt(x * x + y * y + z * z)[..., None]
    taken = times({"": lambda: gn.integrate_normals(normals, mask)}, repetitions)[""]
    found = gn.integrate_normals(normals, mask).heights[mask]
    expected = (z * 999 / 2)[mask]
    off = np.std(found - expected)
    print(f"heights of {mask.sum()} pixels: {taken / 1e3:.1f} s, {off:.1e} pixels off, rms")


def ingest(folder: Path, repetitions: int) -> None:
    warnings.simplefilter("ignore", gn.GonioWarning)
    with tempfile.TemporaryDirectory() as scratch:
        copy = Path(scratch) / "capture"
        shutil.copytree(folder, copy)
        files = photograph_files(copy, partial=True)
        rows, columns = files.size

        def ingested() -> None:
            shutil.rmtree(copy / store.STORE, ignore_errors=True)
            store.ingest(files, copy / store.STORE)

        works = {"decoding": lambda: [read_raster(copy / name) for name in files.names], "ingest": ingested}
        taken = times(works, repetitions)
        print(
            f"{len(files.names)} photographs of {columns} x {rows}: decoding {taken['decoding'] / 1e3:.2f} s, ", end=""
        )
        print(f"ingest {taken['ingest'] / 1e3:.2f} s, {taken['ingest'] / taken['decoding']:.1f} times")
        stored = gn.read_capture(copy, partial=True).photographs
        flat = np.broadcast_to((0.0, 0.0, 1.0), (rows, columns, 3))
        lights = gn.distant_lights(np.tile([[0.0, 0.6, 0.8]], (len(files.names), 1)))
        samples = gn.Capture(stored, lights, normals=flat).reflectance()
        parts = list(stored.parts(np.arange(rows * columns), 16384))

        def written() -> None:
            for _ in files.names:
                np.ones((rows * columns, 11))

        works = {
            "samples, all lights of a site": lambda: deque(map(samples.at, parts), 0),
            "samples by photograph": lambda: deque(samples, 0),
            "as many numbers as these, written": written,
        }
        for name, value in times(works, repetitions).items():
            print(f"  {name}: {value / taken['decoding']:.1f} times decoding")
        at = (np.arange(64)[:, None] * columns + np.arange(64)).ravel()
        for name, value in times({"store": lambda: stored.pixels(at), "files": lambda: files.pixels(at)}, 5).items():
            print(f"  all lights of 64 x 64 pixels from the {name}: {value / 1e3:.3f} s")


if __name__ == "__main__":
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 5
    stereo(count)
    heights(count)
    if len(sys.argv) > 1:
        ingest(Path(sys.argv[1]), count)
