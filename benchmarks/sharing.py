"""Evaluation of radial functions about thousands of centres: CPU time of one thread, beside others and what can be had.

    OMP_NUM_THREADS=1 python benchmarks/sharing.py [repetitions]

    s(q) = p(q) + sum_i lambda_i |q - q_i|               262,144 points, d = 3 and 5, one channel and three

Ours and each peer take turns, so that a busy machine slows all of them; medians are printed, the ratio to ours, and the
error against double precision over the range of s. `root` is the time that the square roots alone take on this core,
in the first cache: no exact evaluation in single precision is faster. `f` is the BRDF from directions, angles and
exponential included. Coefficients are those of a fit to log f at as many samples, but no solve is timed there. The
choice of centres is, once, at the end.
SciPy's RBFInterpolator (kernel linear, degree 1; double precision), pykeops, PyTorch's cdist, NumPy with BLAS: all but
NumPy are left out where they are not installed. What takes long gets a 16th of the points, and its time times 16.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import time
from collections.abc import Callable

import numpy as np
from numba import njit
from scipy.interpolate import RBFInterpolator
from scipy.linalg import lu_factor, lu_solve
from scipy.spatial.distance import cdist
from sphere import times

import gonio as gn
from gonio._kernels import radial as kernels
from gonio.brdf.radial import Interpolant
from gonio.fitting.centres import choose_centres
from gonio.fitting.rules import Greedy, Lookahead, Spread

POINTS = 1 << 18
PART = 16


@njit(fastmath={"reassoc", "nsz"}, error_model="numpy")
def roots(x: np.ndarray, turns: int) -> float:
    """`turns` times the square roots of x (n,) float32, which lies in the first cache."""
    total = 0.0
    for k in range(turns):
        part = np.float32(0)
        shift = np.float32(k)
        for i in range(x.size):
            part += np.sqrt(x[i] + shift)
        total += part
    return total


def directions(rng: np.random.Generator, n: int) -> np.ndarray:
    theta, phi = np.arccos(rng.uniform(0.1, 1, n)), rng.uniform(0, 2 * np.pi, n)
    return gn.from_spherical(theta, phi)


def samples(rng: np.random.Generator, n: int, d: int, channels: int) -> tuple[np.ndarray, np.ndarray]:
    """n coordinates (u, |v|, w), after (x, y) where d = 5, and log f of a paint whose colour varies with the place."""
    paint = gn.Lambert(0.3) + gn.Microfacet(gn.GGX(0.2), gn.Fresnel(1.5))
    wi, wo = directions(rng, n), directions(rng, n)
    q, place = gn.uvw(wi, wo), rng.uniform(size=(n, 2))
    q[:, 1] = np.abs(q[:, 1])
    values = np.log(paint.f(wi, wo)) + 0.1 * np.arange(channels)
    return (q, values) if d == 3 else (np.concatenate((place, q), axis=1), values + np.sin(5 * place[:, :1]))


def fitted(q: np.ndarray, scales: np.ndarray, values: np.ndarray) -> Interpolant:
    """RS 10 by one dense solve."""
    n, d = q.shape
    scaled = q * scales
    matrix = np.zeros((n + d + 1, n + d + 1))
    matrix[:n, :n] = cdist(scaled, scaled)
    matrix[:n, n] = matrix[n, :n] = 1
    matrix[:n, n + 1 :], matrix[n + 1 :, :n] = scaled, scaled.T
    found = lu_solve(lu_factor(matrix), np.concatenate((values, np.zeros((d + 1, values.shape[1])))))
    return Interpolant(q, scales, found[:n], found[n:])


def by_numpy(q: np.ndarray, centres: np.ndarray, coefficients: np.ndarray, polynomial: np.ndarray) -> np.ndarray:
    out = q @ polynomial[1:] + polynomial[0]
    for k in range(0, len(q), 1024):
        square = np.zeros((len(q[k : k + 1024]), len(centres)), q.dtype)
        for a in range(q.shape[1]):
            e = q[k : k + 1024, a, None] - centres[:, a]
            square += np.multiply(e, e, out=e)
        out[k : k + 1024] += np.sqrt(square, out=square) @ coefficients
    return out


def by_torch(parts: list[np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
    import torch

    torch.set_num_threads(1)
    centres, coefficients, polynomial = (torch.asarray(x) for x in parts)

    def call(q: np.ndarray) -> np.ndarray:
        points = torch.asarray(q)
        out = points @ polynomial[1:] + polynomial[0]
        for k in range(0, len(q), 1024):
            r = torch.cdist(points[k : k + 1024], centres, compute_mode="donot_use_mm_for_euclid_dist")
            out[k : k + 1024] += r @ coefficients
        return out.numpy()

    return call


def by_keops(parts: list[np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
    from pykeops.numpy import LazyTensor

    centres, coefficients, polynomial = parts
    y, b = LazyTensor(centres[None, :, :]), LazyTensor(coefficients[None, :, :])

    def call(q: np.ndarray) -> np.ndarray:
        x = LazyTensor(np.ascontiguousarray(q)[:, None, :])
        return (((x - y) ** 2).sum(-1).sqrt() * b).sum(1, backend="CPU") + q @ polynomial[1:] + polynomial[0]

    return call


def compared(d: int, count: int, channels: int, repetitions: int) -> None:
    rng = np.random.default_rng(0)
    scales = np.array([0.3, 0.3, 1.0, 1.0, 0.3][5 - d :])
    q, values = samples(rng, count, d, channels)
    s = fitted(q, scales, values)
    points, _ = samples(rng, POINTS, d, channels)
    q32, some = (points * scales).astype(np.float32), slice(0, POINTS // PART)
    parts = [np.ascontiguousarray(x, np.float32) for x in (s.centres * scales, s.coefficients, s.polynomial)]
    place = {} if d == 3 else {"x": points[:, 0], "y": points[:, 1]}
    material = gn.Radial(s, **place)
    wi, wo = (directions(rng, POINTS).astype(np.float32) for _ in range(2))
    out = np.empty((POINTS, channels), np.float32)

    def ours() -> np.ndarray:
        kernels.evaluate(q32, *parts, out)
        return out

    scipys = RBFInterpolator(q * scales, values, kernel="linear", degree=1)
    peers: dict[str, tuple[int, Callable[[], object]]] = {
        "gonio": (1, ours),
        "root": (1, lambda: roots(np.linspace(1, 2, 2048, dtype=np.float32), POINTS * count // 2048)),
        "f": (1, lambda: material.f(wi, wo)),
        "NumPy": (PART, lambda: by_numpy(q32[some], *parts)),
        "SciPy": (PART, lambda: scipys(points[some] * scales)),
    }
    for name, make in (("torch.cdist", by_torch), ("pykeops", by_keops)):
        try:
            call = make(parts)
        except ImportError:
            continue
        peers[name] = (PART, lambda call=call: call(q32[some]))
    taken = times({name: work for name, (_, work) in peers.items()}, repetitions)
    exact = by_numpy((points * scales)[:2000], s.centres * scales, s.coefficients, s.polynomial)
    print(f"\n{count:,} centres, d = {d}, C = {channels}")
    for name, (part, work) in peers.items():
        ms = taken[name] * part
        error = ""
        if name not in ("root", "f"):
            error = f"{np.abs(np.asarray(work())[:2000] - exact).max() / np.ptp(exact):10.1e}"
        print(f"  {name:<14}{ms:10.0f} ms{ms / taken['gonio']:8.2f}{error}")


def fit() -> None:
    """Choice of centres among 1,100,000 samples, and the rules' errors beside one at a time among 100,000.

    CPU time of all threads; the error is the rms over the samples, of log f.
    """
    rng = np.random.default_rng(1)
    scales = np.array([1.0, 1.0, 0.5])
    some, many = samples(rng, 100_000, 3, 1), samples(rng, 1_100_000, 3, 1)
    choose_centres(*some, None, scales, most=100)  # compiles
    tried = [(some, rule, 500) for rule in (Greedy(1, start=0), Greedy(50), Lookahead(), Spread())]
    tried += [(many, rule, most) for most in (1000, 2000, 5000) for rule in (Lookahead(), Spread())]
    print("\nchoice of centres")
    for data, rule, most in tried:
        start = time.process_time()
        choice = choose_centres(*data, None, scales, rule=rule, most=most)
        taken, name = time.process_time() - start, f"{type(rule).__name__} {getattr(rule, 'batch_size', '')}"
        print(
            f"  {name:<14}{len(data[0]):>10,} samples {most:>6,} centres {taken:6.2f} s   {choice.history[-1][1]:.4f}"
        )


if __name__ == "__main__":
    for count in (2000, 5000):
        for d in (3, 5):
            for channels in (1, 3):
                compared(d, count, channels, int(sys.argv[1]) if len(sys.argv) > 1 else 5)
    fit()
