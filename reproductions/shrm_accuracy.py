"""How many harmonics BRDFs want: RH 5.7.1, 5.7.2, figure 5.7, and what pictures of a ball miss, figures 5.8 and 5.9.

    python reproductions/shrm_accuracy.py DATA FOLDER

DATA holds probes/, hdri/ and brdf/ (docs: CONTRIBUTING). FOLDER gets accuracy.csv, accuracy.png and, for each BRDF, a
picture: the integral over the light, the SHRM, ten times their difference. Energies are RH 5.18 about the mirror
direction, F = 30, of f cos theta_i; errors are rms against an integral over every texel, over three views.
"""

from __future__ import annotations

import csv
import math
import sys
import warnings
from pathlib import Path

import numpy as np

import gonio as gn
from gonio.brdf.harmonic import mirror_transfer
from gonio.brdf.model import BRDF
from gonio.rendering import explicit

ORDERS = range(6)
FITS = {
    "sgd": ("alum-bronze", "blue-acrylic", "teflon", "white-fabric"),
    "abc": ("nickel", "red-plastic", "teflon", "white-paint"),
}
EYES = ((2.7, -3.5, 1.2), (-1.0, 3.0, -2.0), (-3.0, -1.0, 4.0))


def brdfs(data: Path) -> dict[str, BRDF]:
    """RH's analytic models as gonio has them, and measured ones."""
    found: dict[str, BRDF] = {
        "Lambert": gn.Lambert(0.5),
        "Oren-Nayar .5": gn.OrenNayar(0.5, 0.5),
        "Torrance-Sparrow .2": gn.TorranceSparrow(0.0, 1.0, 1.5, 0.2),
        "Beckmann .3, conductor": gn.Microfacet(gn.Beckmann(0.3), gn.Schlick([0.95, 0.64, 0.54])),
        "GGX .2, conductor": gn.Microfacet(gn.GGX(0.2), gn.Schlick([0.95, 0.64, 0.54])),
        "GGX .4, dielectric": gn.Microfacet(gn.GGX(0.4), gn.Fresnel(1.5)),
        "plastic": gn.Lambert([0.4, 0.1, 0.1]) + gn.Microfacet(gn.GGX(0.2), gn.Fresnel(1.5)),
        "Ward .2": gn.Ward(0.3, 0.2, 0.2),
        "Phong 30": gn.Phong(0.5, 30.0),
    }
    for kind, materials in FITS.items():
        fits = gn.read_merl_fits(data / "brdf" / "merl-fits" / f"{kind}_params.json")
        found |= {f"MERL {name}, {kind.upper()}": fits[name] for name in materials}
    for path in sorted((data / "brdf" / "cornell").glob("*.brdf")):
        found[f"Cornell {path.stem}"] = gn.HalfDifferenceTable.of(gn.read_cornell(path))
    for path in sorted((data / "brdf" / "rgl").glob("*.bsdf")):
        found[f"RGL {path.stem.removesuffix('_rgb')}"] = gn.read_rgl(path)
    return found


def ball() -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Normals and eyes of three views' pixels (N, 3), and the views' masks."""
    normals, eyes, masks = [], [], []
    for eye in EYES:
        camera = gn.Orthographic(pixel=2.2 / 48, size=(48, 48), pose=gn.look_at(eye=eye, target=(0, 0, 0)))
        view = gn.Sphere().view(camera)
        normals.append(view.normal[view.mask])
        eyes.append(view.wo[view.mask])
        masks.append(view.mask)
    return np.concatenate(normals), np.concatenate(eyes), masks


def relative(a: np.ndarray, b: np.ndarray) -> float:
    return math.sqrt(np.mean((a - b) ** 2) / np.mean(b**2))


def accuracy(brdf: BRDF) -> list[float]:
    """Shares of energy for P = 0..5 at F = 30."""
    rho, energy = mirror_transfer(brdf, 30, max(ORDERS))
    squares = (rho**2).sum(axis=-1)
    squares[:, :, 1:] *= 2
    return [float(squares[:, : p + 1].sum() / energy.sum()) for p in ORDERS]


def cabral(brdf: BRDF, light: gn.Environment, n: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """Cabral's interpolation between integrals over every texel: twelve eyes, each seeing the same mirror direction."""
    weights, R = explicit.cabral_weights(wo), gn.reflect(wo, n)
    total = 0.0
    for k, corner in enumerate(explicit.icosahedron()[0]):
        used = weights[:, k] > 0
        normal, eye = gn.normalise(R + corner + 1e-9 * wo), np.broadcast_to(corner, wo.shape)
        part = np.zeros((len(n), 3))
        part[used] = gn.radiance(brdf, light, gn.frame(normal[used]), eye[used])
        total = total + weights[:, k, None] * part
    return total


def picture(path: Path, images: list[np.ndarray], masks: list[np.ndarray], scale: float) -> None:
    rows = []
    for image in images:
        start, tiles = 0, []
        for mask in masks:
            tile = np.zeros((*mask.shape, 3))
            count = int(mask.sum())
            tile[mask] = image[start : start + count]
            start += count
            tiles.append(tile)
        rows.append(np.concatenate(tiles, axis=1))
    gn.write_image(path, gn.tone_map(np.concatenate(rows) * scale))


def bars(path: Path, table: dict[str, list[float]]) -> None:
    """RH figure 5.7: a diamond for each order, a dot for the highest."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 0.34 * len(table) + 1), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for k, values in enumerate(table.values()):
        axes.plot([100 * v for v in values[:-1]], [k] * (len(values) - 1), "D", color="#bbbbbb", markersize=5)
        axes.plot(100 * values[-1], k, "o", color="#222222")
    axes.set_yticks(range(len(table)), list(table))
    axes.set_xlabel("energy carried, %, P = 0 ... 5, F = 30")
    axes.invert_yaxis()
    axes.grid(axis="x", alpha=0.3)
    figure.savefig(path, dpi=120)


def main(data: Path, folder: Path) -> None:
    warnings.simplefilter("ignore", gn.GonioWarning)
    folder.mkdir(parents=True, exist_ok=True)
    rooms = {
        name: gn.read_environment(data / path).resampled(gn.LatLongMap(), 64)
        for name, path in (("grace", "probes/grace_probe_latlong.hdr"), ("market", "hdri/leadenhall_market_1k.hdr"))
    }
    n, wo, masks = ball()
    frames, shares, rows = gn.frame(n), {}, []
    for name, brdf in brdfs(data).items():
        shares[name] = accuracy(brdf)
        row: dict[str, object] = {"BRDF": name} | {
            f"P={p}": f"{100 * v:.1f}" for p, v in zip(ORDERS, shares[name], strict=True)
        }
        for room, light in rooms.items():
            maps = gn.prefilter(light, brdf, 0.02)
            exact = gn.radiance(brdf, light, frames, wo)
            row |= {
                f"{room}: F, P": " + ".join(f"{lobe.degree}, {lobe.exit_degree}" for lobe in maps.lobes),
                f"{room}: foreseen": f"{maps.error:.3f}",
                f"{room}: SHRM": f"{relative(maps.radiance(n, wo), exact):.3f}",
            }
            for label, method in (
                ("Kautz-McCool", explicit.kautz_mccool_radiance),
                ("Cabral", explicit.cabral_radiance),
            ):
                field = sum(method(lobe, n, wo) for lobe in maps.lobes)
                row[f"{room}: {label}"] = f"{relative(np.maximum(field, 0), exact):.3f}"
            row[f"{room}: Cabral, from integrals"] = f"{relative(cabral(brdf, light, n, wo), exact):.3f}"
            file = folder / f"{room}-{name.lower().replace(' ', '-').replace(',', '').replace('.', '')}.png"
            quick = maps.radiance(n, wo)
            picture(file, [exact, quick, 10 * np.abs(quick - exact)], masks, 0.5 / float(np.quantile(exact, 0.9)))
        rows.append(row)
        print("   ".join(f"{key} {value}" for key, value in row.items()), flush=True)
    with (folder / "accuracy.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    bars(folder / "accuracy.png", shares)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
