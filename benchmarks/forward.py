"""Prefiltering in the frequency domain against sums over the light, and SHRMs against ducc0's spin transforms.

    python benchmarks/forward.py MAP [repetitions]

MAP is an environment map (lat-long). One thread, process CPU time, medians; every figure with its error. The tables are
those of RH: 5.3 (growth of the work), 5.4 (Phong) and 5.5 (microfacets), 128 x 128 maps of a 128 x 128 light; the
angular side is a compiled loop that leaves out what lies beyond the lobe.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import dataclasses
import math
import statistics
import sys
import time
import warnings
from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numba import njit
from sphere import times

import gonio as gn
from gonio.brdf.harmonic import mirror_transfer
from gonio.brdf.model import BRDF
from gonio.sphere.harmonics import complex_from_real, degrees_and_orders, harmonics
from gonio.sphere.reflected import world_coefficients
from gonio.sphere.zonal import phong

S = 128  # RH's S_L and S_B


@dataclasses.dataclass(frozen=True, eq=False)
class HalfVectorLobe(BRDF):
    """RH 5.34, exp(-(theta_h / sigma)^2) / (4 pi sigma^2), which has both cosines in it, as a BRDF."""

    sigma: float
    bounds: ClassVar[dict] = {}

    def _f(self, xp, wi, wo):
        h = wi + wo
        theta = np.arccos(np.clip(h[..., 2] / np.linalg.norm(h, axis=-1), -1, 1))
        lobe = np.exp(-((theta / self.sigma) ** 2)) / (4 * math.pi * self.sigma**2)
        return (lobe / np.maximum(wi[..., 2] * wo[..., 2], 1e-30))[..., None]


@njit(cache=True, fastmath=True)
def phong_sum(w, E, R, s, cut, out):
    """Sum over the light of (s + 1) / (2 pi) (R.w)^s E, where R.w exceeds `cut`."""
    for i in range(R.shape[0]):
        a = b = c = 0.0
        for k in range(w.shape[0]):
            cosine = R[i, 0] * w[k, 0] + R[i, 1] * w[k, 1] + R[i, 2] * w[k, 2]
            if cosine > cut:
                lobe = cosine**s
                a += lobe * E[k, 0]
                b += lobe * E[k, 1]
                c += lobe * E[k, 2]
        scale = (s + 1) / (2 * math.pi)
        out[i, 0], out[i, 1], out[i, 2] = scale * a, scale * b, scale * c


@njit(cache=True, fastmath=True)
def microfacet_sum(w, E, R, wo, sigma, out):
    """Sum over the light above the surface of exp(-(theta_h / sigma)^2) / (4 pi sigma^2) E, out to 3 sigma."""
    least = math.cos(min(3 * sigma, 0.5 * math.pi))
    for i in range(R.shape[0]):
        x, y, z = R[i, 0] + wo[0], R[i, 1] + wo[1], R[i, 2] + wo[2]
        length = max(math.sqrt(x * x + y * y + z * z), 1e-12)
        x, y, z = x / length, y / length, z / length
        a = b = c = 0.0
        for k in range(w.shape[0]):
            if x * w[k, 0] + y * w[k, 1] + z * w[k, 2] > 0:
                p, q, r = w[k, 0] + wo[0], w[k, 1] + wo[1], w[k, 2] + wo[2]
                cosine = (x * p + y * q + z * r) / max(math.sqrt(p * p + q * q + r * r), 1e-12)
                if cosine > least:
                    t = math.acos(min(cosine, 1.0)) / sigma
                    lobe = math.exp(-t * t)
                    a += lobe * E[k, 0]
                    b += lobe * E[k, 1]
                    c += lobe * E[k, 2]
        scale = 1 / (4 * math.pi * sigma * sigma)
        out[i, 0], out[i, 1], out[i, 2] = scale * a, scale * b, scale * c


def square(light: gn.Environment) -> tuple[np.ndarray, np.ndarray]:
    """The light on S x S pixels, (S, S, 3) float32, and those pixels' directions (S^2, 3)."""
    small = light.resampled(gn.LatLongMap(), S).image
    image = small.reshape(S, S, 2, 3).mean(axis=2)
    return image.astype(np.float32), gn.LatLong(S, S).directions().reshape(-1, 3).astype(np.float32)


def relative(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(np.mean((a - b) ** 2) / np.mean(b**2)))


def once(work: Callable[[], object]) -> float:
    """CPU milliseconds of one run."""
    start = time.process_time()
    work()
    return (time.process_time() - start) * 1e3


def table_5_3(light: gn.Environment, repetitions: int) -> None:
    """Nanoseconds an output pixel: against RH's W S^2 (angular), F (one map) and F (each coefficient of an SHRM)."""
    rng = np.random.default_rng(1)

    def pixel(F: int, P: int, size: int) -> float:
        """Of a map of `size` x 2 `size` RGB pixels, for each coefficient of an SHRM."""
        grid, transfer = gn.LatLong(size, 2 * size), rng.normal(size=(F + 1, P + 1, P + 1, 3)).astype(np.float32)
        c = rng.normal(size=((F + 1) ** 2, 3)).astype(np.float32)
        taken = times({"": lambda: _maps(c, transfer, grid)}, repetitions)[""]
        return 1e6 * taken / (2 * size * size * (P + 1) ** 2)

    print("\nRH table 5.3: ns an output pixel and coefficient")
    rows = [("F = 24, P = 0; S", [(24, 0, size) for size in (64, 128, 256, 512, 1024)], 2)]
    rows += [("P = 0, S = 256; F", [(F, 0, 256) for F in (8, 16, 32, 64, 96)], 0)]
    rows += [("F = 24, S = 128; P", [(24, P, 128) for P in range(6)], 1)]
    for name, cases, varied in rows:
        print(f"  {name:20}" + "  ".join(f"{case[varied]:5}: {pixel(*case):6.1f}" for case in cases))
    for s in (8, 128):
        found = []
        for size in (32, 64, 128):
            grid = gn.LatLong(size, size)
            image = light.resampled(gn.LatLongMap(), size).image.reshape(size, size, 2, 3).mean(axis=2)
            w = grid.directions().reshape(-1, 3).astype(np.float32)
            E = (image * grid.weights[:, None, None]).astype(np.float32).reshape(-1, 3)
            out = np.empty((size * size, 3), np.float32)
            cut = 0.05 ** (1 / (s + 1))
            phong_sum(w, E, w[:1], float(s), cut, out[:1])
            slow = once(lambda w=w, E=E, cut=cut, out=out, s=s: phong_sum(w, E, w, float(s), cut, out))
            found.append(f"{size:5}: {1e6 * slow / size**2:6.0f}")
        print(f"  {f'angular, Phong {s}; S':20}" + "  ".join(found))


def _maps(c: np.ndarray, transfer: np.ndarray, grid: gn.LatLong) -> np.ndarray:
    """What an SHRM holds, or one map where it has a single coefficient."""
    if transfer.shape[1] > 1:
        c = world_coefficients(c, transfer)
        c = c.reshape(c.shape[0], -1)
    return gn.synthesis(c, grid)


def table_5_4(light: gn.Environment, repetitions: int) -> None:
    grid, out = gn.LatLong(S, S), np.empty((S * S, 3), np.float32)
    image, R = square(light)
    w, E = R, (image * grid.weights[:, None, None].astype(np.float32)).reshape(-1, 3)
    print("\nRH table 5.4: Phong, ms; RH's ratios 831, 334, 137, 53, 22, 7.7, 3.3")
    phong_sum(w, E, R[:1], 8.0, 0.0, out[:1])
    for s in (8, 16, 32, 64, 128, 256, 512):
        degree = math.ceil(1 + math.sqrt(6 * s))
        A = phong(degree, float(s)).astype(np.float32)[degrees_and_orders(degree)[0], None]
        frequency = lambda degree=degree, A=A: gn.synthesis(A * gn.analysis(image, grid, degree), grid)  # noqa: E731
        fast = times({"": frequency}, repetitions)[""]
        cut = 0.05 ** (1 / (s + 1))  # RH 5.30: 5 % of the energy lies beyond
        slow = once(lambda s=s, cut=cut: phong_sum(w, E, R, float(s), cut, out))
        exact = np.empty_like(out)
        phong_sum(w, E, R, float(s), 0.0, exact)
        print(
            f"  s {s:4}   angular {slow:8.1f} (error {relative(out, exact):.1e})   frequency {fast:6.2f} "
            f"(F {degree:2}, error {relative(frequency().reshape(-1, 3), exact):.1e})   ratio {slow / fast:7.1f}"
        )


def table_5_5(light: gn.Environment, repetitions: int) -> None:
    grid, out = gn.LatLong(S, S), np.empty((S * S, 3), np.float32)
    image, R = square(light)
    w, E = R, (image * grid.weights[:, None, None].astype(np.float32)).reshape(-1, 3)
    views = gn.LatLong(10, 10).directions().reshape(-1, 3)
    microfacet_sum(w, E, R[:1], views[0].astype(np.float32), 0.3, out[:1])
    print("\nRH table 5.5: microfacets, 100 reflection maps, ms; RH's ratios 342, 1770, 3846, 6146, 8676")
    for sigma, F, P in ((0.1, 23, 2), (0.2, 11, 2), (0.3, 7, 2), (0.4, 5, 2), (0.5, 4, 2)):

        def made(sigma: float = sigma, F: int = F, P: int = P) -> np.ndarray:
            rho, _ = mirror_transfer(HalfVectorLobe(sigma), F, P, reciprocal=True)
            return world_coefficients(gn.analysis(image, grid, F), rho.astype(np.float32))

        def maps(c: np.ndarray, P: int = P) -> np.ndarray:
            """(10, S, S, 3) at a time, 100 in all."""
            eyes = harmonics(P, views).astype(np.float32)
            flat = np.tensordot(eyes, c, axes=([1], [1])).transpose(1, 0, 2).reshape(c.shape[0], -1)
            return np.concatenate([gn.synthesis(flat[:, k : k + 30], grid) for k in range(0, 300, 30)], axis=2)

        total = times({"": lambda made=made, maps=maps: maps(made())}, max(repetitions // 3, 3))[""]
        c = made()
        alone = times({"": lambda c=c: gn.synthesis(c.reshape(c.shape[0], -1), grid)}, repetitions)[""]
        slow = once(lambda sigma=sigma: microfacet_sum(w, E, R, views[44].astype(np.float32), sigma, out))
        seen = maps(c)[:, :, 3 * 44 : 3 * 44 + 3].reshape(-1, 3)
        print(
            f"  sigma {sigma}   angular {slow:7.0f} a map   frequency {total:7.1f} for 100 (F, P {F}, {P}; SHRM alone "
            f"{alone:.2f}; error {relative(seen, out):.2f})   ratio {100 * slow / total:7.0f}"
        )


def shrm_maps(repetitions: int) -> None:
    rng, grid = np.random.default_rng(1), gn.LatLong(128, 256)
    for F, P in ((24, 3), (60, 5)):
        for dtype in (np.float32, np.float64):
            light = rng.normal(size=((F + 1) ** 2, 3)).astype(dtype)
            rho = rng.normal(size=(F + 1, P + 1, P + 1, 3)).astype(dtype)

            def ours(light: np.ndarray = light, rho: np.ndarray = rho) -> np.ndarray:
                return _maps(light, rho, grid)

            works = {"gonio, world maps": ours}
            try:
                import ducc0
            except ImportError:
                pass
            else:
                works["ducc0, local maps"] = _ducc(ducc0, light, F, P)
            taken = times(works, repetitions)
            print(
                f"\nSHRM F = {F}, P = {P}, RGB, 128 x 256, {np.dtype(dtype).name}: "
                + ", ".join(f"{name} {t:.2f} ms" for name, t in taken.items())
            )


def _ducc(ducc0, light: np.ndarray, F: int, P: int) -> Callable[[], object]:
    """B_pq for p <= P and q = 0..p of three channels: real maps for q = 0, complex ones of spin q as two fields."""
    l, m = degrees_and_orders(F)
    order = np.lexsort((l, m))[np.sort(m) >= 0]
    kind = np.complex64 if light.dtype == np.float32 else np.complex128
    alm = complex_from_real(light)[order].astype(kind)
    options = {"lmax": F, "geometry": "F1", "ntheta": 128, "nphi": 256, "nthreads": 1, "phi0": math.pi / 256}

    def work() -> list[np.ndarray]:
        maps = []
        for p in range(P + 1):
            for q in range(p + 1):
                for c in range(3):
                    one = np.ascontiguousarray(alm[None, :, c])
                    fields = one if q == 0 else np.concatenate((one, one))
                    maps.append(ducc0.sht.synthesis_2d(alm=fields, spin=q, **options))
        return maps

    return work


def pictures(room: gn.Environment) -> None:
    """1920 x 1080 pixels from an SHRM, wall seconds on all processors, median of three."""
    warnings.simplefilter("ignore", gn.GonioWarning)
    plastic = gn.Lambert([0.5, 0.3, 0.2]) + gn.Microfacet(gn.GGX(0.25), gn.Fresnel(1.5))
    start = time.perf_counter()
    maps = gn.prefilter(room, plastic, 0.02)
    print(f"\nSHRM of plastic: {time.perf_counter() - start:.2f} s, {[(m.degree, m.exit_degree) for m in maps.lobes]}")
    eye = {"eye": (3.9, -4.6, 2.1), "target": (0, 0, 0), "field_of_view": 22}
    camera = gn.Pinhole.look_at(**eye, size=(1080, 1920))
    for name, shape in (("sphere", gn.Sphere()), ("vase", gn.vase())):
        taken = []
        for _ in range(4):
            start = time.perf_counter()
            gn.render_prefiltered(shape, maps, camera, background=room)
            taken.append(time.perf_counter() - start)
        print(f"  a {name} at 1920 x 1080: {statistics.median(taken[1:]):.2f} s")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    room = gn.read_environment(sys.argv[1])
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 15
    shrm_maps(count)
    table_5_3(room, count)
    table_5_4(room, count)
    table_5_5(room, count)
    pictures(room)
