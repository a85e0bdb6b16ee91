"""The tools people use today on one map: nine coefficients, and roughness chains. CPU time and error, in one run.

    python benchmarks/peers.py MAP [repetitions]

MAP is brought to 2048 x 1024 RGB float32. Peers that are not there are left out: ducc0, healpy and torch-harmonics as
Python packages, Filament's cmgen on the PATH (Debian: libfilament-tools). cmgen is a program: its time holds start-up
and reading; its chains stop at faces of 16 texels.

Axes and signs differ from tool to tool, so errors are of what does not turn: for coefficients the power of each degree,
for a level of a chain its mean over the sphere, which a lobe leaves as it is. Both are relative, and the worst is told.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import contextlib
import math
import re
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from sphere import times

import gonio as gn
from gonio.rendering.chain import roughness_chain
from gonio.sphere.harmonics import harmonics

ROWS = 1024


def powers(c: np.ndarray) -> np.ndarray:
    """Power (3, C) of each degree of nine real coefficients (9, C)."""
    c = np.asarray(c, np.float64)
    return np.stack([(c[l * l : (l + 1) ** 2] ** 2).sum(axis=0) for l in range(3)])


def summed(image: np.ndarray) -> np.ndarray:
    """Nine coefficients as the sum over pixels of L Y_lm times solid angle, in double precision."""
    grid = gn.LatLong(ROWS, 2 * ROWS)
    edge = np.cos(np.linspace(0, math.pi, ROWS + 1))
    solid = (edge[:-1] - edge[1:]) * (2 * math.pi / (2 * ROWS))
    total = np.zeros((9, 3))
    for r, w in enumerate(np.asarray(grid.directions())):
        total += harmonics(2, w).T @ image[r].astype(np.float64) * solid[r]
    return total


def coefficients(image: np.ndarray) -> dict[str, Callable[[], np.ndarray]]:
    """Ways to nine coefficients, each answering powers (3, C)."""
    light = gn.Environment(image)
    works: dict[str, Callable[[], np.ndarray]] = {"gonio": lambda: light.harmonics(2), "one reading": image.sum}
    planes = np.ascontiguousarray(image.transpose(2, 0, 1))
    with contextlib.suppress(ImportError):
        import ducc0

        # Its analysis takes maps for band-limited, 2.4 % wrong here; its adjoint synthesis sums over all pixels.
        options = {"lmax": 2, "spin": 0, "geometry": "F1", "nthreads": 1}
        weights = gn.LatLong(ROWS, 2 * ROWS).weights[:, None].astype(np.float32)
        works["ducc0"] = lambda: [
            ducc0.sht.adjoint_synthesis_2d(map=(plane * weights)[None], **options) for plane in planes
        ]
    with contextlib.suppress(ImportError):
        import healpy

        n = 256  # 786,432 pixels; each takes the map's pixel that it lies in
        theta, phi = healpy.pix2ang(n, np.arange(healpy.nside2npix(n)))
        at = (theta / math.pi * ROWS).astype(int) * 2 * ROWS + (phi / (2 * math.pi) * 2 * ROWS).astype(int)
        works["healpy"] = lambda: [healpy.map2alm(plane.reshape(-1)[at], lmax=2, iter=0) for plane in planes]
    with contextlib.suppress(ImportError):
        import torch
        import torch_harmonics

        torch.set_num_threads(1)
        sht = torch_harmonics.RealSHT(ROWS, 2 * ROWS, lmax=3, mmax=3, grid="equiangular")
        stack = torch.from_numpy(planes)
        works["torch-harmonics"] = lambda: sht(stack)
    return works


def power_of(name: str, made: object) -> np.ndarray:
    """Powers (3, C) of what a way of `coefficients` answers."""
    if name == "gonio":
        return powers(np.asarray(made))
    if name == "torch-harmonics":
        a = np.abs(made.numpy()) ** 2  # type: ignore[attr-defined]
        return np.stack([a[:, l, 0] + 2 * a[:, l, 1 : l + 1].sum(axis=1) for l in range(3)])
    # libsharp's order: m = 0: l = 0, 1, 2; m = 1: l = 1, 2; m = 2: l = 2
    a = np.abs(np.stack([np.asarray(x).reshape(-1) for x in made]).T) ** 2  # type: ignore[attr-defined]
    return np.stack((a[0], a[1] + 2 * a[3], a[2] + 2 * a[4] + 2 * a[5]))


def program(*arguments: object) -> float:
    """CPU milliseconds of a program, all its threads together."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([str(a) for a in arguments], check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return 1e3 * (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def faces(folder: Path, level: int) -> np.ndarray:
    names = ("px", "nx", "py", "ny", "pz", "nz")
    return np.stack([gn.read_image(folder / f"m{level}_{name}.exr") for name in names])


def brightness(cube: np.ndarray, mean: np.ndarray) -> float:
    """How far the mean over the sphere of faces (6, n, n, C) is from the light's, relative, in the worst channel."""
    n = cube.shape[1]
    solid = gn.CubeStrip().sheet_solid_angles(n, n)
    found = np.einsum("fijc,ij->c", cube.astype(np.float64), solid) / (4 * math.pi)
    return float(np.max(np.abs(found / mean - 1)))


def main(path: str, repetitions: int) -> None:
    room = gn.read_environment(path)
    image = np.ascontiguousarray(room.resampled(gn.LatLongMap(), ROWS).image.astype(np.float32))
    truth, light = powers(summed(image)), gn.Environment(image)
    mean = summed(image)[0] / math.sqrt(4 * math.pi)
    works = coefficients(image)
    taken = times(works, repetitions)
    print("nine coefficients of 2048 x 1024 RGB float32, ms; error of power, worst of degrees and channels")
    for name, work in works.items():
        off = "" if name == "one reading" else f"{np.max(np.abs(power_of(name, work()) / truth - 1)):.1e}"
        print(f"  {name:24} {taken[name]:8.1f}   {off}")
    with tempfile.TemporaryDirectory() as scratch:
        folder, cmgen = Path(scratch), shutil.which("cmgen")
        gn.write_image(folder / "map.exr", image)
        if cmgen:
            out = folder / "sh.txt"
            command = cmgen, "-q", "--sh=3", "--sh-window=no", f"--sh-output={out}", folder / "map.exr"
            nine = statistics.median(program(*command) for _ in range(3))
            rows = re.findall(r"\(([^)]*)\)", out.read_text())
            c = np.array([[float(x) for x in row.split(",")] for row in rows])
            print(f"  {'cmgen, whole program':24} {nine:8.1f}   {np.max(np.abs(powers(c) / truth - 1)):.1e}")
        print("\nroughness chain, base 256, down to faces of 16, ms; error of brightness, worst of levels and channels")
        ours = {"gonio, error=1e-3": lambda: roughness_chain(light, 256, 5, error=1e-3)}
        taken = times(ours, max(repetitions // 3, 2))
        off = max(brightness(level, mean) for level in ours["gonio, error=1e-3"]().faces)
        print(f"  {'gonio, error=1e-3':24} {taken['gonio, error=1e-3']:8.1f}   {off:.1e}")
        if cmgen:
            for samples in (64, 1024):
                target = folder / f"ld{samples}"
                time = program(
                    cmgen, "-q", f"--ibl-ld={target}", "--size=256", "--format=exr", f"--ibl-samples={samples}",
                    folder / "map.exr",
                )  # fmt: skip
                off = max(brightness(faces(target / "map", k), mean) for k in range(5))
                print(f"  {f'cmgen, {samples} samples':24} {time:8.1f}   {off:.1e}")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 15)
