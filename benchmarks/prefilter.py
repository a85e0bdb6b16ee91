"""Reflection cubes and roughness chains beside a recipe on ducc0: CPU time of one thread and error, in one run.

    python benchmarks/prefilter.py [map.hdr] [repetitions]      # a 2:1 map; the demo's room where none is given

The map is brought to 2048 x 1024 RGB float32. The recipe does with ducc0 what a careful user would: `analysis_2d` to
the degree that the lobe needs, a product for each coefficient, `synthesis_general` at the texels, one channel at a
time, its planes laid out beforehand. Both take turns; medians are printed. Errors are against the sum over all pixels
of the map at 50 texels drawn at random: rms over the cube's rms, and over its brightest texel. Without ducc0 ours
stands alone.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import contextlib
import math
import sys
from functools import partial

import numpy as np
from sphere import times

import gonio as gn
from gonio.rendering.chain import RoughnessChain, roughness_chain
from gonio.rendering.lobes import ggx, spectrum

ROWS = 1024


class Recipe:
    """Harmonics by ducc0, evaluated at the texels of the cubes."""

    def __init__(self, light: gn.Environment, size: int, alphas: list[float], error: float) -> None:
        import ducc0

        self.sht, self.error = ducc0.sht, error
        self.planes = [np.ascontiguousarray(light.image[None, :, :, c]) for c in range(3)]
        self.spectra = [spectrum(ggx, alpha, error, ROWS - 1)[0] for alpha in alphas]
        strip = gn.CubeStrip()
        self.places = []
        for k in range(len(alphas)):
            texels = (size >> k) * 6
            w = strip.directions(texels, texels // 6)[0] @ (light.turn.T @ gn.Orientation.OPENGL.matrix(strip)).T
            self.places.append(np.stack(gn.spherical(w.reshape(-1, 3)), axis=-1))

    def __call__(self) -> list[np.ndarray]:
        degree = max(A.size for A in self.spectra) - 1
        options = {"spin": 0, "geometry": "F1", "phi0": math.pi / (2 * ROWS), "nthreads": 1}
        planes = [self.sht.analysis_2d(map=plane, lmax=degree, **options) for plane in self.planes]
        cubes = []
        for A, places in zip(self.spectra, self.places, strict=True):
            top = A.size - 1
            # ducc0 orders by m, then l.
            kept = np.concatenate([m * (2 * degree + 1 - m) // 2 + np.arange(m, top + 1) for m in range(top + 1)])
            factor = np.concatenate([A[m:] for m in range(top + 1)]).astype(np.float32)
            channels = [
                self.sht.synthesis_general(
                    alm=plane[:, kept] * factor,
                    spin=0,
                    lmax=top,
                    loc=places,
                    epsilon=max(self.error / 4, 1e-6),
                    nthreads=1,
                )[0]
                for plane in planes
            ]
            cubes.append(np.stack(channels, axis=-1))
        return cubes


def errors(light: gn.Environment, cube: np.ndarray, alpha: float, count: int) -> tuple[float, float]:
    """rms over rms and rms over peak, at `count` texels of a cube (texels, 3) as OpenGL has them."""
    size = math.isqrt(cube.shape[0] // 6)
    at = np.random.default_rng(1).integers(0, cube.shape[0], count)
    own = gn.Environment(np.zeros((6 * size, size)), gn.CubeStrip(), gn.Orientation.OPENGL)
    R = own.directions()[0].reshape(-1, 3)[at]
    w = light.directions()[0].reshape(-1, 3)
    weights = np.repeat(gn.LatLong(ROWS, 2 * ROWS).weights, 2 * ROWS)
    irradiance = (light.image.reshape(-1, 3) * weights[:, None]).astype(np.float64)
    truth = np.empty((count, 3))
    for k, r in enumerate(R):
        cosine = w @ r
        lobe = np.where(cosine > 0, ggx(alpha, np.arccos(cosine.clip(0, 1))), 0)
        truth[k] = lobe @ irradiance / (lobe @ weights)
    rms = float(np.sqrt(np.mean((cube[at] - truth) ** 2)))
    return rms / float(np.sqrt(np.mean(cube.astype(np.float64) ** 2))), rms / float(cube.max())


def compare(name: str, light: gn.Environment, size: int, alphas: list[float], error: float, repetitions: int) -> None:
    ours = partial(roughness_chain, light, size, alphas, error=error)
    works = {"gonio": ours}
    with contextlib.suppress(ImportError):
        works["ducc0"] = Recipe(light, size, alphas, error)
    taken = times(works, repetitions)
    print(f"\n{name}, error {error:g}: degrees {ours().degrees}")
    for who, work in works.items():
        made = work()
        cubes = [faces.reshape(-1, 3) for faces in made.faces] if isinstance(made, RoughnessChain) else made
        found = [errors(light, cube, alpha, 50) for cube, alpha in zip(cubes, alphas, strict=True)]
        print(f"  {who:6} {taken[who]:8.1f} ms ({taken[who] / taken['gonio']:.1f} of ours)")
        print("         rms / rms   " + " ".join(f"{rms:.1e}" for rms, _ in found))
        print("         rms / peak  " + " ".join(f"{peak:.1e}" for _, peak in found))


if __name__ == "__main__":
    room = gn.read_environment(sys.argv[1]) if len(sys.argv) > 1 else gn.studio(ROWS)
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 15
    image = room.resampled(gn.LatLongMap(), ROWS).image.astype(np.float32)
    light = gn.Environment(image, gn.LatLongMap(), room.orientation)
    sun = np.full((ROWS, 2 * ROWS, 3), 0.1, np.float32)
    sun[300:303, 500:504] = 30_000
    for name, sky in (("the map", light), ("a sun of 30,000 in a dim sky", gn.Environment(sun))):
        compare(f"{name}: one cube of 128, alpha .2", sky, 128, [0.2], 8e-5, count)
        levels = [(k / 7) ** 2 for k in range(1, 8)]
        compare(f"{name}: levels 1 to 7 of a chain of 256", sky, 128, levels, 1e-3, count)
    works = {
        "level 0 of a chain of 256": lambda: roughness_chain(light, 256, [0.0]),
        "Environment.resampled": lambda: light.resampled(gn.CubeStrip(), 6 * 256, gn.Orientation.OPENGL),
        "all eight levels": lambda: roughness_chain(light, 256, 8),
    }
    print("\nthe map averaged over 256 x 256 x 6 texels")
    for what, t in times(works, 3).items():
        print(f"  {what:26} {t:7.0f} ms")
