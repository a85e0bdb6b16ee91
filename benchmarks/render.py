"""Pairs of a point and a beam per second of CPU: a sphere in an environment of 10,000 beams, without and with shadows.

    python benchmarks/render.py [--size 512] [--samples 10000]

Pairs count every pixel on the sphere times every beam, seen or not. One thread, so that the rate is a core's.
"""

import argparse
import resource
import time

import numpy as np

import gonio as gn
from gonio.lights.environment import Environment

MODELS = {
    "Lambert": gn.Lambert(0.5),
    "GGX": gn.Microfacet(gn.GGX(0.3), gn.Fresnel(1.5)),
    "Lambert + GGX, RGB": gn.Lambert((0.5, 0.4, 0.3)) + gn.Microfacet(gn.GGX(0.3), gn.Fresnel(1.5)),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--samples", type=int, default=10_000)
    args = parser.parse_args()
    w = gn.LatLong(128, 256).directions()
    room = Environment(1 + np.stack((w[..., 0], w[..., 1], w[..., 2]), axis=-1))
    camera = camera_of(args.size)
    pairs = int(gn.Sphere().view(camera).mask.sum()) * args.samples
    for shadows in (False, True):
        for name, model in MODELS.items():
            if shadows and name != "GGX":
                continue
            gn.render(gn.Sphere(), model, room, camera_of(8), samples=256)  # compiles the kernels
            wall, cpu = time.perf_counter(), time.process_time()
            gn.render(gn.Sphere(), model, room, camera, samples=args.samples, shadows=shadows, threads=1)
            wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
            print(
                f"{name:20} {'shadows' if shadows else 'no shadows':10} {args.size}^2 x {args.samples}: "
                f"{wall:7.1f} s wall, {cpu:7.1f} s CPU, {pairs / cpu:.2e} pairs/s"
            )
    print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")


def camera_of(size: int) -> gn.Orthographic:
    return gn.Orthographic(size=(size, size), pixel=2.4 / size, pose=gn.look_at((0, -5, 0), (0, 0, 0)))


if __name__ == "__main__":
    main()
