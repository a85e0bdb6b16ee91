"""Reflectance sharing beside the figures of its paper: RS figures 7 to 12, and 18.

    python reproductions/reflectance_sharing.py DATA FOLDER

DATA holds brdf/merl-fits (docs: CONTRIBUTING). FOLDER gets sharing.csv and sharing.png. Photographs are of a ball of
100 x 100 pixels by the forward model; RS had the measured metallic-blue of MERL, here it is its SGD fit. Errors are
relative rms of radiance over photographs that were not used: over all pixels of all of them, as RS has it, and the
median of the photographs' own, since grazing ones outshine the others by forty. RS read off its figures: converged
below 1,000 centres (7), below 2,000 (10), five photographs with sharing as good as 150 without (11). Of figures 12, new
views of what was photographed from one, and 18, all from one photograph, it has pictures alone: here the figures are
degrees of the eye, and of theta_d.
"""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

import gonio as gn
from gonio.brdf.model import BRDF
from gonio.fitting.sharing import Scales, share_reflectance
from gonio.reflection import varied
from gonio.samples import ReflectanceSamples

SIDE = 100
Photographs = list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]


def ball() -> np.ndarray:
    """Normals (S, 3) of the pixels that see the ball, from straight above."""
    at = (np.arange(SIDE) + 0.5 - SIDE / 2) / (SIDE / 2)
    x, y = np.meshgrid(at, -at)
    inside = x * x + y * y < 0.98
    return np.stack((x, y, np.sqrt(np.where(inside, 1 - x * x - y * y, 0))), axis=-1)[inside]


def photographed(material: BRDF, directions: np.ndarray, normals: np.ndarray, eye: float = 0.0) -> Photographs:
    """For each light: which sites it lights, wi, wo there (local), and f. The eye is `eye` radians from above."""
    frames, shots = gn.frame(normals), []
    wo = gn.to_local(frames, np.array([math.sin(eye), 0, math.cos(eye)]))
    for direction in directions:
        wi = gn.to_local(frames, direction)
        lit = np.flatnonzero((wi[:, 2] > 0.02) & (wo[:, 2] > 0.02))
        here = varied(material, lambda value, axes, lit=lit: value[lit])
        shots.append((lit, wi[lit], wo[lit], np.broadcast_to(here.f(wi[lit], wo[lit]), (len(lit), 3))))
    return shots


def samples(shots: Photographs) -> list[ReflectanceSamples]:
    return [ReflectanceSamples(site, wi, wo, f, wi[:, 2] ** 2) for site, wi, wo, f in shots]


def errors(model: BRDF, shots: Photographs) -> tuple[float, float]:
    """Relative rms of radiance over all photographs, and the median of each one's."""
    off, total, own = 0.0, 0.0, []
    for site, wi, wo, f in shots:
        here = varied(model, lambda value, axes, site=site: value[site])
        light = wi[:, 2:]
        a, b = ((here.f(wi, wo) - f) * light) ** 2, (f * light) ** 2
        off, total = off + a.sum(), total + b.sum()
        own.append(math.sqrt(a.sum() / b.sum()))
    return math.sqrt(off / total), float(np.median(own))


def slices(count: int) -> np.ndarray:
    """Lights with theta_d even in [0, 90) degrees, and azimuths by the golden angle (RS 6.1)."""
    k = np.arange(count)
    return np.asarray(gn.from_spherical(np.radians(180 * (k + 0.5) / (count + 0.5) * 0.95), 2.4 * k))


def upper(count: int, start: int = 0) -> np.ndarray:
    """Lights spread evenly over the hemisphere down to 75 degrees."""
    k = np.arange(count) + 0.5
    z = 1 - k / count * (1 - math.cos(math.radians(75)))
    return np.asarray(gn.from_spherical(np.arccos(z), 2.4 * k + start))


def fitted(model: object, start: list[float], shots: Photographs) -> BRDF:
    """Least squares of radiance over the parameters of `model(p)`: the parametric rivals, by a general solver."""
    wi, wo, f = (np.concatenate([shot[k] for shot in shots]) for k in (1, 2, 3))
    some = np.random.default_rng(0).permutation(len(f))[:8000]
    wi, wo, f = wi[some], wo[some], f[some].mean(axis=1, keepdims=True)

    def miss(p: np.ndarray) -> np.ndarray:
        return np.asarray(((model(p).f(wi, wo) - f) * wi[:, 2:]).ravel())  # type: ignore[operator]

    return model(least_squares(miss, start, max_nfev=300).x)  # type: ignore[operator, no-any-return]


def lafortune(lobes: int) -> tuple[object, list[float]]:
    """Lambert and isotropic Lafortune lobes, their exponents spread over two decades at first."""

    def model(p: np.ndarray) -> BRDF:
        total: BRDF = gn.Lambert(min(abs(p[0]), 1.0))
        for k in range(lobes):
            cx, cz = np.clip(p[1 + 3 * k : 3 + 3 * k], -1.02, 1.02)
            n = p[3 + 3 * k]
            total = total + gn.Lafortune(float(cx), float(cx), float(cz), float(np.clip(abs(n), 0.1, 300)))
        return total

    start = [0.1]
    for n in np.geomspace(2, 200, lobes):
        start += [-0.6, 0.6, float(n)]
    return model, start


def ward() -> tuple[object, list[float]]:
    def model(p: np.ndarray) -> BRDF:
        alpha = float(np.clip(abs(p[2]), 0.02, 1.0))
        return gn.Lambert(min(abs(p[0]), 1.0)) + gn.Ward(min(abs(p[1]), 10.0), alpha, alpha)

    return model, [0.1, 0.1, 0.2]


def main(data: Path, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    rows: list[tuple[str, str, int, int, float, float]] = []

    def tell(figure: str, model: str, photographs: int, size: int, found: tuple[float, float]) -> None:
        rows.append((figure, model, photographs, size, *found))
        print(
            f"{figure:4} {model:28} {photographs:4} photographs, {size:5}: {found[0]:.4f} all, {found[1]:.4f} median",
            flush=True,
        )

    normals = ball()
    metallic = gn.read_merl_fits(data / "brdf" / "merl-fits" / "sgd_params.json")["blue-metallic-paint"]
    rough = gn.OrenNayar(0.6, 0.6)
    held = slices(21)
    options = {"log f, |v|": {}, "f, v (RS)": {"logarithm": False, "folded": False, "smooth": False}}

    ten, kept = photographed(metallic, slices(10), normals), photographed(metallic, held, normals)
    for name, option in options.items():
        for centres in (50, 100, 200, 400, 600, 1000, 2000):
            fit = share_reflectance(samples(ten), centres=centres, scales=Scales(difference=0.3), **option)
            tell("7", f"sharing, {name}", 10, centres, errors(fit.value.material, kept))
    for lobes in (1, 2, 3, 6, 12, 25):
        model, start = lafortune(lobes)
        tell("7", "Lafortune", 10, lobes, errors(fitted(model, start, ten), kept))

    for figure, material in (("8", metallic), ("9", rough)):
        kept = photographed(material, held, normals)
        for count in (2, 4, 6, 8, 10, 12, 16, 20):
            shots = photographed(material, slices(count), normals)
            for name, option in options.items():
                fit = share_reflectance(samples(shots), centres=1000, scales=Scales(difference=0.3), **option)
                tell(figure, f"sharing, {name}", count, 1000, errors(fit.value.material, kept))
            model, start = ward()
            tell(figure, "Ward", count, 1, errors(fitted(model, start, shots), kept))
            model, start = lafortune(6)
            tell(figure, "Lafortune", count, 6, errors(fitted(model, start, shots), kept))
            tell(
                figure,
                "Lambert",
                count,
                1,
                errors(fitted(lambda p: gn.Lambert(min(abs(p[0]), 1.0)), [0.5], shots), kept),
            )

    # The hemisphere whose roughness grows from left to right, seen and lit from above (RS 7.1).
    alpha = 0.15 + 0.3 * (normals[:, 0] + 1) / 2
    graded = gn.Lambert(0.2) + gn.Microfacet(gn.Beckmann(alpha), gn.Fresnel(1.5))
    places = (normals[:, :2] + 1) / 2
    kept = photographed(graded, upper(40, 1), normals)
    for centres in (100, 300, 1000, 2000, 3000):
        fit = share_reflectance(
            samples(photographed(graded, upper(10), normals)), places, centres=centres, scales=Scales(0.1, 0.3)
        )
        tell("10", "sharing, m_xy = .1", 10, centres, errors(fit.value.material, kept))
    for count in (2, 5, 10):
        shots = photographed(graded, upper(count), normals)
        fit = share_reflectance(samples(shots), places, centres=2000, scales=Scales(0.1, 0.3))
        tell("11", "sharing", count, 2000, errors(fit.value.material, kept))
    for count in (5, 10, 50, 150):
        tell("11", "no sharing", count, 0, alone(photographed(graded, upper(count), normals), kept, len(normals)))

    # Light from where none of the five photographs had it, 30 degrees from above; the eye moves away from above.
    shots, light = photographed(graded, upper(5), normals), gn.from_spherical(np.radians([30.0]), 2.0)
    fit = share_reflectance(samples(shots), places, centres=2000, scales=Scales(0.1, 0.3))
    for degrees in (0, 15, 30, 45, 60):
        seen = photographed(graded, light, normals, math.radians(degrees))
        tell("12", "five photographs", degrees, 2000, errors(fit.value.material, seen))

    # One photograph, lit 45 degrees from the eye, tells f at theta_d = 22.5 degrees for all of theta_h.
    one = photographed(graded, slices(9)[2:3], normals)
    fits = {
        "one photograph, one BRDF": share_reflectance(samples(one), centres=1000),
        "one photograph, RS 15": share_reflectance(
            samples(one), places, centres=2000, scales=Scales(1.0, stiffness=0.01)
        ),
    }
    for degrees in (5, 10, 20, 30, 45, 60):
        light = gn.from_spherical(np.radians([2.0 * degrees]), np.pi)
        seen = photographed(graded, light, normals)
        for name, found in fits.items():
            tell("18", name, degrees, 2000, errors(found.value.material, seen))

    with (folder / "sharing.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("figure", "model", "photographs", "centres or lobes", "error over all", "median error"))
        writer.writerows(rows)
    picture(folder / "sharing.png", rows)


def alone(shots: Photographs, kept: Photographs, sites: int) -> tuple[float, float]:
    """Each pixel by itself: linear radial functions over (u, v, w) of its own samples, log f."""
    from gonio.fitting.radial_basis import RadialSystem

    own: list[list[tuple[np.ndarray, float]]] = [[] for _ in range(sites)]
    for site, wi, wo, f in shots:
        q = gn.uvw(wi, wo)
        for s, at, value in zip(site, q, f[:, 0], strict=True):
            own[s].append((at, value))
    off = np.zeros(len(kept))
    total = np.zeros(len(kept))
    wanted: list[list[tuple[int, np.ndarray, float, float]]] = [[] for _ in range(sites)]
    for k, (site, wi, wo, f) in enumerate(kept):
        for s, at, value, light in zip(site, gn.uvw(wi, wo), f[:, 0], wi[:, 2], strict=True):
            wanted[s].append((k, at, value, light))
    for known, asked in zip(own, wanted, strict=True):
        if not asked:
            continue
        k = np.array([a[0] for a in asked])
        q, f, light = (np.array([a[i] for a in asked]) for i in (1, 2, 3))
        fitted_values = np.zeros(len(f))
        if known:
            at, value = np.array([a[0] for a in known]), np.log([a[1] for a in known])
            s = None
            if len(known) > 4:
                try:
                    system = RadialSystem([1.0, 1.0, 0.3], most=len(known))
                    system.add(at, value[:, None])
                    s = system.solve()(q)[:, 0]
                except gn.GonioError:
                    s = None
            if s is None:  # too few for a polynomial: the nearest
                s = value[np.argmin(np.linalg.norm(at[None] - q[:, None], axis=2), axis=1)]
            fitted_values = np.exp(np.clip(s, value.min(), value.max()))
        np.add.at(off, k, ((fitted_values - f) * light) ** 2)
        np.add.at(total, k, (f * light) ** 2)
    return math.sqrt(off.sum() / total.sum()), float(np.median(np.sqrt(off / total)))


def picture(path: Path, rows: list[tuple[str, str, int, int, float, float]]) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(20, 7), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    titles = {
        "7": ("RS 7: metallic-blue, 10 photographs", 3, "centres or lobes"),
        "8": ("RS 8: metallic-blue", 2, "photographs"),
        "9": ("RS 9: Oren-Nayar", 2, "photographs"),
        "10": ("RS 10: graded roughness", 3, "centres"),
        "11": ("RS 11: sharing or not", 2, "photographs"),
        "12": ("RS 12: five photographs, other views", 2, "degrees of the eye from above"),
        "18": ("RS 18: one photograph, other lights", 2, "theta_d, degrees"),
    }
    for k, (number, (title, column, label)) in enumerate(titles.items()):
        axes = figure.add_subplot(2, 4, k + 1)
        for model in dict.fromkeys(row[1] for row in rows if row[0] == number):
            x, y = np.array([(row[column], row[5]) for row in rows if row[0] == number and row[1] == model]).T
            draw = axes.semilogy if number in ("12", "18") else axes.loglog
            draw(x, y, marker="o", markersize=3, label=model)
        axes.set_title(title, fontsize=10)
        axes.set_xlabel(label)
        axes.set_ylabel("median relative rms")
        axes.grid(alpha=0.3, which="both")
        axes.legend(fontsize=7)
    figure.savefig(path)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
