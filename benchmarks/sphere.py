"""Harmonic transforms of RGB lat-long maps, beside ducc0 and pyshtools: CPU time of one thread and error, in one run.

    OMP_NUM_THREADS=1 python benchmarks/sphere.py [repetitions]

Ours and each peer take turns, so that a busy machine slows all of them; medians are printed. All recursions run in
float64. With float32 maps ours also adds up over theta in float32, where ducc0 is the more exact: see the errors. Peers
take one channel at a time, planar; ours takes the interleaved image as files hold it. pyshtools has float64 only,
and a grid of its own, 2 (degree + 1) rows: it takes part where that is the size asked for, within a hundredth.
The error is that of the coefficients after synthesis and analysis, relative rms; peers that are not installed are
left out.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import math
import statistics
import sys
import time
from collections.abc import Callable

import numpy as np

import gonio as gn
from gonio.sphere.harmonics import complex_from_real, degrees_and_orders, real_from_complex

Work = Callable[[], object]


def times(works: dict[str, Work], repetitions: int) -> dict[str, float]:
    """Median CPU milliseconds of each, taking turns after one run that compiles and plans."""
    for work in works.values():
        work()
    taken: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(repetitions):
        for name, work in works.items():
            start = time.process_time()
            work()
            taken[name].append((time.process_time() - start) * 1e3)
    return {name: statistics.median(t) for name, t in taken.items()}


class Ours:
    def __init__(self, coefficients: np.ndarray, degree: int, grid: gn.LatLong) -> None:
        self.degree, self.grid, self.coefficients = degree, grid, coefficients
        self.values = gn.synthesis(coefficients, grid)

    def synthesis(self) -> np.ndarray:
        return gn.synthesis(self.coefficients, self.grid)

    def analysis(self) -> np.ndarray:
        return gn.analysis(self.values, self.grid, self.degree)

    def back(self) -> np.ndarray:
        return self.analysis()


class Ducc:
    def __init__(self, coefficients: np.ndarray, degree: int, grid: gn.LatLong) -> None:
        import ducc0

        self.sht, self.degree, self.rows, self.columns = ducc0.sht, degree, grid.rows, grid.columns
        l, m = degrees_and_orders(degree)
        self.order = np.lexsort((l, m))[np.sort(m) >= 0]
        kind = np.complex64 if coefficients.dtype == np.float32 else np.complex128
        packed = complex_from_real(coefficients)[self.order].astype(kind)
        self.coefficients = [np.ascontiguousarray(packed[None, :, c]) for c in range(packed.shape[1])]
        self.values = self.synthesis()

    def _options(self) -> dict[str, object]:
        return {"spin": 0, "lmax": self.degree, "geometry": "F1", "phi0": math.pi / self.columns, "nthreads": 1}

    def synthesis(self) -> list[np.ndarray]:
        size = {"ntheta": self.rows, "nphi": self.columns}
        return [self.sht.synthesis_2d(alm=alm, **size, **self._options()) for alm in self.coefficients]

    def analysis(self) -> list[np.ndarray]:
        return [self.sht.analysis_2d(map=values, **self._options()) for values in self.values]

    def back(self) -> np.ndarray:
        alm = np.concatenate(self.analysis()).T
        l, m = degrees_and_orders(self.degree)
        c = np.zeros((l.size, alm.shape[1]), alm.dtype)
        c[self.order] = alm
        sign = ((-1.0) ** m)[:, None]
        c = np.where(m[:, None] < 0, sign * np.conj(c[l * (l + 1) - m]), c)
        return real_from_complex(c)


class PySHTools:
    """Its own grid of 2 (degree + 1) rows from the pole down, in float64: the nearest it has."""

    def __init__(self, coefficients: np.ndarray, degree: int, grid: gn.LatLong) -> None:
        import pyshtools

        self.expand, self.degree = pyshtools.expand, degree
        l, m = degrees_and_orders(degree)
        self.l, self.m = l, m
        self.coefficients = []
        for channel in coefficients.T:
            cilm = np.zeros((2, degree + 1, degree + 1))
            cilm[(m < 0).astype(int), l, np.abs(m)] = channel
            self.coefficients.append(cilm)
        self.values = self.synthesis()

    def synthesis(self) -> list[np.ndarray]:
        return [self.expand.MakeGridDH(cilm, sampling=2, norm=4, csphase=1) for cilm in self.coefficients]

    def analysis(self) -> list[np.ndarray]:
        return [self.expand.SHExpandDH(values, sampling=2, norm=4, csphase=1) for values in self.values]

    def back(self) -> np.ndarray:
        return np.stack([c[(self.m < 0).astype(int), self.l, np.abs(self.m)] for c in self.analysis()], axis=-1)


def compare(degree: int, grid: gn.LatLong, dtype: type, repetitions: int) -> None:
    coefficients = np.random.default_rng(1).normal(size=((degree + 1) ** 2, 3)).astype(dtype)
    contenders: dict[str, Ours | Ducc | PySHTools] = {"gonio": Ours(coefficients, degree, grid)}
    for name, peer in (("ducc0", Ducc), ("pyshtools", PySHTools)):
        if name == "pyshtools" and abs(2 * (degree + 1) - grid.rows) > grid.rows / 100:
            continue
        try:
            contenders[name] = peer(coefficients, degree, grid)
        except ImportError:
            continue
    print(f"\ndegree {degree}, {grid.rows} x {grid.columns} RGB {np.dtype(dtype).name}")
    synthesis = times({name: c.synthesis for name, c in contenders.items()}, repetitions)
    analysis = times({name: c.analysis for name, c in contenders.items()}, repetitions)
    for name, contender in contenders.items():
        error = np.sqrt(np.mean((contender.back() - coefficients) ** 2) / np.mean(coefficients.astype(float) ** 2))
        print(
            f"  {name:10} synthesis {synthesis[name]:8.2f} ms ({synthesis[name] / synthesis['gonio']:5.2f} of ours)"
            f"   analysis {analysis[name]:8.2f} ms ({analysis[name] / analysis['gonio']:5.2f})   error {error:.1e}"
        )
    size = grid.rows * grid.columns * 3 * np.dtype(dtype).itemsize
    # One product for each of (re, im) x channel and two for each step of the recursion, a step for two degrees;
    # for every pair of rings, l and m >= 0.
    triangle = (degree + 1) * (degree + 2) / 2 * ((grid.rows + 1) // 2)
    copying, products, recursion = copy_bandwidth(), product_rate(dtype), product_rate(np.float64)
    print(
        f"  limits: image {size / 1e6:.1f} MB, {size / copying * 1e3:.2f} ms at a copy's {copying / 1e9:.1f} GB/s; "
        f"sums over theta {triangle * 6 / products * 1e3 + triangle / recursion * 1e3:.2f} ms "
        f"at {products / 1e9:.0f} billion products a second; Fourier sums not counted"
    )


def copy_bandwidth() -> float:
    """Bytes a second that a copy beyond the caches reads."""
    source = np.ones(2**24)
    target = np.empty_like(source)
    return source.nbytes / (times({"copy": lambda: np.copyto(target, source)}, 5)["copy"] / 1e3)


def product_rate(dtype: type) -> float:
    """Products added a second in a large product of matrices, near the most that one core does."""
    x = np.ones((768, 768), dtype)
    out = np.empty_like(x)
    return float(768**3 / (times({"product": lambda: np.matmul(x, x, out=out)}, 5)["product"] / 1e3))


def spins(degree: int, grid: gn.LatLong, repetitions: int) -> None:
    """Synthesis of complex spin-weighted RGB, beside ducc0's of two real fields each (spin above 0)."""
    rng = np.random.default_rng(3)
    print(f"\nspin, degree {degree}, {grid.rows} x {grid.columns} RGB complex128")
    for spin in range(4):
        f = rng.normal(size=((degree + 1) ** 2, 3)) + 1j * rng.normal(size=((degree + 1) ** 2, 3))
        f[: spin * spin] = 0
        values = gn.synthesis_spin(f, grid, spin)
        works: dict[str, Work] = {
            "synthesis": lambda f=f, spin=spin: gn.synthesis_spin(f, grid, spin),
            "analysis": lambda values=values, spin=spin: gn.analysis_spin(values, grid, degree, spin),
        }
        try:
            import ducc0
        except ImportError:
            pass
        else:
            size = (degree + 1) * (degree + 2) // 2
            alm = rng.normal(size=(3, 2, size)) + 1j * rng.normal(size=(3, 2, size))
            options = {"lmax": degree, "geometry": "F1", "ntheta": grid.rows, "nphi": grid.columns, "nthreads": 1}
            parts = (
                [(alm[c], spin) for c in range(3)]
                if spin
                else [(alm[c, k : k + 1], 0) for c in range(3) for k in (0, 1)]
            )
            works["ducc0 synthesis"] = lambda parts=parts, options=options: [
                ducc0.sht.synthesis_2d(alm=part, spin=s, **options) for part, s in parts
            ]
        taken = times(works, repetitions)
        print(f"  spin {spin}   " + "   ".join(f"{name} {t:7.2f} ms" for name, t in taken.items()))


def nine_coefficients(repetitions: int) -> None:
    grid = gn.LatLong(1024, 2048)
    image = np.random.default_rng(2).random((*grid.shape, 3), dtype=np.float32)
    works: dict[str, Work] = {
        "reading it once (numpy.sum)": image.sum,
        "nine coefficients": lambda: gn.analysis(image, grid, 2),
    }
    try:
        import ducc0

        planar = [np.ascontiguousarray(image[None, :, :, c]) for c in range(3)]
        options = {"spin": 0, "lmax": 2, "geometry": "F1", "nthreads": 1}
        works["ducc0"] = lambda: [ducc0.sht.analysis_2d(map=channel, **options) for channel in planar]
    except ImportError:
        pass
    taken = times(works, repetitions)
    once = next(iter(taken.values()))
    print("\nnine coefficients of a 2048 x 1024 RGB float32 map (25 MB)")
    for name, t in taken.items():
        print(f"  {name:28} {t:7.2f} ms ({t / once:.1f} times reading)")


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 15
    nine_coefficients(count)
    for dtype in (np.float32, np.float64):
        compare(30, gn.LatLong(256, 512), dtype, 3 * count)
        compare(512, gn.LatLong(1024, 2048), dtype, count)
    spins(24, gn.LatLong(64, 128), count)
    spins(60, gn.LatLong(128, 256), count)
