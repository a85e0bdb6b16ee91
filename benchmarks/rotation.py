"""Turning RGB coefficients: gonio beside ducc0, one thread, process CPU time, medians of rounds taken in turn.

    python benchmarks/rotation.py

ducc0 takes m >= 0 of the complex coefficients, three sets in one call; `loop` calls it once a channel.
The error is the largest difference of the two answers, coefficients being of size one.
"""

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import statistics
import time

import ducc0
import numpy as np

import gonio as gn
from gonio.frames import euler
from gonio.sphere.harmonics import complex_from_real

ALPHA, BETA, GAMMA = 1.1, 0.3, -0.7
ROUNDS = 41


def main() -> None:
    rng = np.random.default_rng(0)
    R = euler(ALPHA, BETA, GAMMA)
    print(f"ducc0 {ducc0.__version__}, {ROUNDS} rounds; milliseconds of CPU: median (least)")
    for degree, repeats in ((30, 40), (200, 3), (512, 1)):
        values = rng.normal(size=((degree + 1) ** 2, 3))
        order = [l * (l + 1) + m for m in range(degree + 1) for l in range(m, degree + 1)]
        alm = np.ascontiguousarray(complex_from_real(values)[order].T)

        def ours(values=values):
            return gn.rotate(values, R)

        def theirs(alm=alm, degree=degree):
            return ducc0.sht.rotate_alm(alm, degree, GAMMA, ALPHA, BETA, nthreads=1)

        def loop(alm=alm, degree=degree):
            return [ducc0.sht.rotate_alm(a, degree, GAMMA, ALPHA, BETA, nthreads=1) for a in alm]

        error = np.abs(complex_from_real(ours())[order].T - theirs()).max()
        times = {f.__name__: [] for f in (ours, theirs, loop)}
        for _ in range(ROUNDS):
            for f in (ours, theirs, loop):
                start = time.process_time()
                for _ in range(repeats):
                    f()
                times[f.__name__].append((time.process_time() - start) / repeats * 1e3)
        report = ", ".join(f"{name} {statistics.median(t):.4f} ({min(t):.4f})" for name, t in times.items())
        print(f"degree {degree}: {report}; error {error:.1e}")


if __name__ == "__main__":
    main()
