"""How well the confidence of a shared reflectance tells its error, beyond the photographs it was fitted to.

    python reproductions/confidence.py FOLDER

Ten photographs of a ball, seen from far away, end where theta_d is 45 degrees; lights beyond them are predicted. FOLDER
gets confidence.csv and confidence.png. The error is relative, rms of radiance; the confidence the mean of what makes
up the prediction.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

import gonio as gn
from gonio.brdf.model import BRDF
from gonio.fitting.sharing import Scales
from gonio.samples import ReflectanceSamples

MATERIALS = {
    "plastic": gn.Lambert([0.5, 0.3, 0.2]) + gn.Microfacet(gn.GGX(0.35), gn.Fresnel(1.5)),
    "gloss": gn.Lambert([0.2, 0.1, 0.05]) + gn.Microfacet(gn.GGX(0.15), gn.Fresnel(1.5)),
    "metal": gn.Microfacet(gn.GGX(0.25), gn.Schlick([0.9, 0.6, 0.3])),
}
KNOWN = np.linspace(5, 90, 10)  # degrees between light and eye
BEYOND = (45, 80, 95, 102, 110, 118, 130, 150, 165)
NORMALS = 4000
GRAZING = 0.05  # cosine


def photographed(material: BRDF, angle: float, turn: float) -> ReflectanceSamples:
    """Samples of the ball under a light `angle` degrees from the eye, which is straight above."""
    k = np.arange(NORMALS) + 0.5
    frames = gn.frame(gn.from_spherical(np.arccos(k / NORMALS), k * np.pi * (3 - np.sqrt(5))))
    light = gn.from_spherical(np.radians(angle), turn)
    wi, wo = gn.to_local(frames, light), gn.to_local(frames, np.array([0.0, 0, 1]))
    seen = np.flatnonzero((wi[:, 2] > GRAZING) & (wo[:, 2] > GRAZING))
    wi, wo = wi[seen], wo[seen]
    return ReflectanceSamples(seen, wi, wo, material.f(wi, wo) * np.ones(3), np.ones(seen.size))


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for name, material in MATERIALS.items():
        known = [photographed(material, angle, 2.1 * k) for k, angle in enumerate(KNOWN)]
        for m_w in (0.25, 0.5, 1.0):
            fitted = gn.share_reflectance(known, centres=600, scales=Scales(difference=m_w)).value.material
            for angle in BEYOND:
                shot = photographed(material, angle, 0.0)
                f = fitted.f(shot.wi, shot.wo)
                light = shot.wi[:, 2:]
                off = np.sqrt(np.sum((light * (f - shot.value)) ** 2) / np.sum((light * shot.value) ** 2))
                made = (light * f).mean(axis=1)
                trust = np.sum(made * fitted.confidence(shot.wi, shot.wo)) / np.sum(made)
                rows.append((name, m_w, angle / 2, float(off), float(trust)))
                print(f"{name:8} m_w {m_w:4}  theta_d {angle / 2:4.1f}  error {off:.2f}  confidence {trust:.2f}")
    with (folder / "confidence.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("material", "m_w", "theta_d", "error", "confidence"))
        writer.writerows(rows)
    picture(folder / "confidence.png", rows)


def picture(path: Path, rows: list[tuple[str, float, float, float, float]]) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 5), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for name, mark in zip(MATERIALS, "os^", strict=True):
        for m_w, colour in ((0.25, "C0"), (0.5, "C1"), (1.0, "C2")):
            mine = [(trust, off) for n, m, _, off, trust in rows if n == name and m == m_w]
            axes.plot(*np.transpose(mine), mark, color=colour, label=f"{name}, m_w = {m_w}")
    axes.plot((0, 1), (1, 0), color="#888888", linewidth=0.8)
    axes.set_xlabel("confidence")
    axes.set_ylabel("relative rms of radiance")
    axes.legend(fontsize=7)
    figure.savefig(path)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
