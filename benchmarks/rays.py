"""Rays per second of CPU: Embree called directly, through trimesh, and our own hierarchy, on the same rays in one run.

    python benchmarks/rays.py [--rays 200000]

The scene is a bumpy sphere of 81,920 triangles. `Scene` includes scaling, checking and the second solution in double
precision. trimesh answers the same questions with `intersects_first` and `intersects_any`.
"""

import argparse
import time
from collections.abc import Callable

import numpy as np
import trimesh

import gonio as gn
from gonio.shapes.visibility import Embree, Hierarchy


def rate(work: Callable[[], object], rays: int) -> str:
    best = np.inf
    for _ in range(3):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return f"{rays / best / 1e6:6.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rays", type=int, default=200_000)
    rays = parser.parse_args().rays
    ball = trimesh.creation.icosphere(subdivisions=6)
    v = np.asarray(ball.vertices)
    ball = trimesh.Trimesh(v * (1 + 0.05 * np.sin(9 * v).sum(axis=1, keepdims=True)), ball.faces, process=False)

    rng = np.random.default_rng(1)
    side = int(rays**0.5)
    camera = gn.Pinhole.look_at((0, -3, 0.5), (0, 0, 0), field_of_view=45, size=(side, side))
    coherent = tuple(np.ascontiguousarray(x.reshape(-1, 3)) for x in camera.rays())
    starts = 1.5 * gn.normalise(rng.normal(size=(rays, 3)))
    random = starts, gn.normalise(rng.uniform(-1, 1, size=(rays, 3)) - starts)

    corners = np.asarray(ball.vertices)[ball.faces]
    start = time.process_time()
    embree = Embree(corners)
    built = time.process_time() - start
    Hierarchy(corners[:8])  # compiles
    start = time.process_time()
    hierarchy = Hierarchy(corners)
    print(f"built: Embree {built:.2f} s, hierarchy {time.process_time() - start:.2f} s of CPU")
    scenes = {
        name: gn.Scene(ball.vertices, ball.faces, made) for name, made in (("Embree", Embree), ("hierarchy", Hierarchy))
    }
    wrapper = trimesh.ray.ray_pyembree.RayMeshIntersector(ball)

    print(f"{'M rays/s of CPU':34} {'camera, first':>14} {'random, first':>14} {'random, any':>12}")
    rows: dict[str, list[Callable[[], object]]] = {}
    for name, tracer in (("Embree", embree), ("hierarchy", hierarchy)):
        single = [tuple(x.astype(np.float32) for x in bundle) for bundle in (coherent, random)]
        far = np.full(rays, 1e37, dtype=np.float32)
        rows[f"{name}, called directly"] = [
            lambda t=tracer, r=single[0]: t.closest(*r),
            lambda t=tracer, r=single[1]: t.closest(*r),
            lambda t=tracer, r=single[1], f=far: t.blocked(*r, f),
        ]
        scene = scenes[name]
        rows[f"gonio.Scene on {name}"] = [
            lambda s=scene: s.intersect(*coherent),
            lambda s=scene: s.intersect(*random),
            lambda s=scene: s.occluded(*random),
        ]
    rows["trimesh on Embree"] = [
        lambda: wrapper.intersects_first(*coherent),
        lambda: wrapper.intersects_first(*random),
        lambda: wrapper.intersects_any(*random),
    ]
    for name, (first, second, third) in rows.items():
        for work in (first, second, third):
            work()
        print(f"{name:34} {rate(first, side * side):>14} {rate(second, rays):>14} {rate(third, rays):>12}")


if __name__ == "__main__":
    main()
