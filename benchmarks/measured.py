"""Look-ups of measured and tabulated reflectance, in millions of pairs a second on one thread.

    python benchmarks/measured.py [folder with brdf/rgl and brdf/cornell]

Random pairs above the surface, the worst case for the cache. Mitsuba's scalar `measured` stands beside, where it is
installed: most of its time goes to the call from Python, so the figure says what a Python user gets, no more.
"""

import sys
import time
from pathlib import Path

import numpy as np

import gonio as gn
from gonio.directions import from_spherical

COUNT = 1_000_000


def report(name, call, count, repeats=4):
    call()
    best = np.inf
    for _ in range(repeats):
        start = time.process_time()
        call()
        best = min(best, time.process_time() - start)
    print(f"{name:<48} {count / best / 1e6:8.3f} M/s")


def main(data):
    rng = np.random.default_rng(0)

    def directions(n, dtype=np.float32):
        return from_spherical(np.arccos(rng.uniform(0.05, 1, n)), rng.uniform(-np.pi, np.pi, n)).astype(dtype)

    wi, wo, u = directions(COUNT), directions(COUNT), rng.uniform(size=(COUNT, 3)).astype(np.float32)
    table = gn.HalfDifferenceTable.of(gn.Lambert([0.2, 0.3, 0.4]))
    report("half/difference 90 x 90 x 180, float32", lambda: table.f(wi, wo), COUNT)
    report("half/difference 90 x 90 x 180, float64", lambda: table.f(wi.astype(float), wo.astype(float)), COUNT)
    facets = gn.TabulatedNDF.of(gn.GGX(0.1, 0.3))
    report("facets 96 x 256, D", lambda: facets.D(wi), COUNT)
    report("facets 96 x 256, sample", lambda: facets.sample(wo, u[:, :2]), COUNT)
    for path in sorted((data / "brdf" / "rgl").glob("*.bsdf"))[:1]:
        rgl = gn.read_rgl(path)
        report(f"{path.stem}, f float32", lambda rgl=rgl: rgl.f(wi, wo), COUNT)
        report(f"{path.stem}, pdf", lambda rgl=rgl: rgl.pdf(wi, wo), COUNT)
        report(f"{path.stem}, sample", lambda rgl=rgl: rgl.sample(wo, u), COUNT)
        try:
            import mitsuba as mi
        except ImportError:
            continue
        mi.set_variant("scalar_rgb")
        bsdf = mi.load_dict({"type": "measured", "filename": str(path)})
        context, si = mi.BSDFContext(), mi.SurfaceInteraction3f()

        def peer(bsdf=bsdf, context=context, si=si, mi=mi):
            for light, eye in zip(wi[:2000].tolist(), wo[:2000].tolist(), strict=True):
                si.wi = eye
                bsdf.eval(context, si, mi.Vector3f(light))

        report("    Mitsuba scalar_rgb, through Python", peer, 2000)
    for path in sorted((data / "brdf" / "cornell").glob("*.brdf"))[:1]:
        paint = gn.read_cornell(path)
        report(f"{path.stem}, scattered", lambda paint=paint: paint.f(wi[:20000], wo[:20000]), 20000)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "../shared/data"))
