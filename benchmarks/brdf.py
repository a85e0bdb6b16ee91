"""How many pairs of directions a second each analytic BRDF takes, by `f` with its checks: CPU time of its one thread.

    python benchmarks/brdf.py [pairs]

Columns: pairs (N, 3) in double and in single precision, and the outer form, lights (1, K, 3) against views (P, 1, 3).
"""

from __future__ import annotations

import statistics
import sys
import time

import numpy as np

import gonio as gn
from gonio.brdf.model import BRDF

METAL = gn.Conductor([0.2, 0.92, 1.1], [3.9, 2.45, 2.14])
MODELS = {
    "Lambert": gn.Lambert(0.5),
    "OrenNayar": gn.OrenNayar(0.5, 0.4),
    "Phong": gn.Phong(0.4, 50.0),
    "ModifiedPhong": gn.ModifiedPhong(0.4, 50.0),
    "BlinnPhong": gn.BlinnPhong(0.4, 50.0),
    "Lafortune": gn.Lafortune(-0.95, -0.95, 0.9, 12.0),
    "Lafortune, RGB": gn.Lafortune([-0.9, -0.95, -1.0], -0.9, 0.9, [10.0, 12.0, 14.0]),
    "Ward": gn.Ward(0.4, 0.2),
    "Ward, anisotropic": gn.Ward(0.4, 0.1, 0.3),
    "Ward, bounded": gn.Ward(0.4, 0.1, 0.3, bounded=True),
    "TorranceSparrow": gn.TorranceSparrow(0.4, 0.3, 1.6, 0.2),
    "KajiyaKay": gn.KajiyaKay(0.3, 0.3, 30.0),
    "ABC, RGB": gn.ABC(0.1, [2.0, 3.0, 4.0], 120.0, 1.4, 1.5),
    "ShiftedGamma": gn.ShiftedGamma(0.22, 0.55, 0.45, 0.92, 3.6, 0.05, -0.02, 2.8, 0.0037, 9.7, 0.0),
    "GGX, dielectric": gn.Microfacet(gn.GGX(0.3), gn.Fresnel(1.5)),
    "GGX, anisotropic metal": gn.Microfacet(gn.GGX(0.1, 0.3), METAL),
    "Beckmann, dielectric": gn.Microfacet(gn.Beckmann(0.3), gn.Fresnel(1.5)),
    "Beckmann, V-groove": gn.Microfacet(gn.Beckmann(0.3), gn.Schlick(0.04), gn.VGroove()),
    "GGX, Ashikhmin": gn.Microfacet(gn.GGX(0.3), gn.Schlick(0.04), gn.Ashikhmin()),
    "Lambert RGB + GGX": gn.Lambert([0.5, 0.3, 0.2]) + gn.Microfacet(gn.GGX(0.3), gn.Fresnel(1.5)),
}


def directions(n: int, rng: np.random.Generator) -> np.ndarray:
    """n directions above the surface."""
    w = rng.normal(size=(n, 3))
    w[:, 2] = np.abs(w[:, 2])
    return gn.normalise(w)


def rate(model: BRDF, wi: np.ndarray, wo: np.ndarray, pairs: int, runs: int = 31) -> float:
    """Pairs a second: the median of `runs`, in CPU time of this process."""
    model.f(wi, wo)
    seconds = []
    for _ in range(runs):
        start = time.process_time()
        model.f(wi, wo)
        seconds.append(time.process_time() - start)
    return pairs / statistics.median(seconds)


def main() -> None:
    pairs = int(sys.argv[1]) if len(sys.argv) > 1 else 1 << 16
    rng = np.random.default_rng(0)
    wi, wo = directions(pairs, rng), directions(pairs, rng)
    side = int(pairs**0.5)
    print(f"{pairs} pairs; million pairs a second\n{'':24}{'float64':>10}{'float32':>10}{'outer':>10}")
    for name, model in MODELS.items():
        rates = (
            rate(model, wi, wo, pairs),
            rate(model, wi.astype(np.float32), wo.astype(np.float32), pairs),
            rate(model, wi[None, :side], wo[:side, None], side * side),
        )
        print(f"{name:24}" + "".join(f"{r / 1e6:10.1f}" for r in rates))


if __name__ == "__main__":
    main()
