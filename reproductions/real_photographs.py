"""Reflectance sharing on real photographs, beside what is made of one pixel at a time: three left out are predicted.

    python reproductions/real_photographs.py DATA FOLDER

DATA holds photometric/uw, photometric/xiong, rti/real and rti/synth (docs: CONTRIBUTING). FOLDER gets real.csv,
real.png and a picture of each object. Normals are photometric stereo's of the photographs that are kept: all but three,
or six of them. Errors are relative rms of radiance over the mask, clipped pixels aside. Encodings are those under which
photometric stereo of all photographs leaves least; Object2 has that of Object1. Lights are taken to be equally strong.
rti/synth is rendered: kept are 49 lights of its dome or six of them, predicted three of its test.

Rivals: Lambert; polynomial texture maps (Malzbender, Gelb and Wolters 2001); linear radial functions of (lx, ly) by
pixel; an albedo by pixel and one GGX lobe for all of them.
"""

from __future__ import annotations

import csv
import dataclasses
import math
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.optimize import least_squares

import gonio as gn
from gonio.capture import circles, mirror_ball
from gonio.capture.photographs import Held
from gonio.fitting.sharing import Scales, share_reflectance
from gonio.rendering.relight import Relightable

MOST = 20_000  # pixels
CENTRES = 600
CLIPPED = 10.0  # what stands for a clipped pixel
ITEMS = {"item1": "linear", "item3": "srgb", "item7": "linear", "item9": "linear"}
SYNTHETIC = {"Object1": "material1", "Object2": "material4"}
# (pixels of the mask, 3) under a light from a direction
Prediction = Callable[[np.ndarray], np.ndarray]


@dataclasses.dataclass(frozen=True)
class Thing:
    """A capture; which photographs may be kept, and which three are predicted."""

    name: str
    capture: gn.Capture
    known: list[int]
    held: list[int]


def things(data: Path) -> Iterator[Thing]:
    for name in ("cat", "owl"):
        yield parted(f"uw {name}", of_ball(data / "photometric/uw" / name, data / "photometric/uw/chrome"))
    for name in ("cat", "hippo", "lizard"):
        folder = data / "photometric/xiong" / name
        yield parted(f"xiong {name}", of_ball(folder / "Objects", folder / "LightProbe-1"))
    for name, encoding in ITEMS.items():
        yield parted(f"rti {name}", gn.read_capture(data / "rti/real" / name, encoding))
    for name, material in SYNTHETIC.items():
        dome, test = (
            gn.read_capture(data / "rti/synth/Single" / name / material / part, "srgb") for part in ("Dome", "Test")
        )
        held = across(test.directions)
        both = smaller([dataclasses.replace(x, normals=None) for x in (dome, test)])
        count = len(dome.photographs)
        yield Thing(f"synth {name}", both, list(range(count)), [count + k for k in held])


def of_ball(folder: Path, ball: Path) -> gn.Capture:
    """The capture with lights from a mirror ball's highlights."""
    scene = gn.read_capture(ball)
    outline = circles.circle_of_mask(scene.mask)
    places = [mirror_ball.highlight(scene.photographs.read(k).radiance, outline) for k in range(len(scene.photographs))]
    lights = gn.distant_lights(mirror_ball.light_directions(np.array(places), outline))
    return dataclasses.replace(gn.read_capture(folder, "linear"), lights=lights)


def parted(name: str, capture: gn.Capture) -> Thing:
    held = across(capture.directions)
    known = [k for k in range(len(capture.photographs)) if k not in held]
    return Thing(name, smaller([capture]), known, held)


def across(directions: np.ndarray) -> list[int]:
    """Three lights: those a fifth, a half and four fifths of the way from the steepest to the most grazing."""
    order = np.argsort(-directions[:, 2], kind="stable")
    return [int(order[round(part * (len(order) - 1))]) for part in (0.2, 0.5, 0.8)]


def spread(directions: np.ndarray, known: list[int], count: int) -> list[int]:
    """`count` of the lights, each as far as can be from those before, the steepest first."""
    chosen = [max(known, key=lambda k: directions[k, 2])]
    while len(chosen) < count:
        near = np.max(directions[known] @ directions[chosen].T, axis=1)
        chosen.append(known[int(np.argmin(near))])
    return chosen


def smaller(captures: list[gn.Capture]) -> gn.Capture:
    """The photographs of all of them, blocks of pixels averaged until the mask has `MOST` or fewer."""
    mask = captures[0].mask
    n = math.ceil(math.sqrt(np.count_nonzero(mask) / MOST))
    rows, columns = (side // n for side in mask.shape)

    def blocks(x: np.ndarray) -> np.ndarray:
        return x[: rows * n, : columns * n].reshape(rows, n, columns, n, *x.shape[2:])

    images, lights = [], []
    for capture in captures:
        lights += capture.lights
        for k in range(len(capture.photographs)):
            radiance, clipped = capture.photographs.read(k)
            image = blocks(radiance).mean(axis=(1, 3))
            image[blocks(clipped).any(axis=(1, 3))] = CLIPPED
            images.append(image)
    inside = blocks(mask).all(axis=(1, 3))
    return gn.Capture(Held(np.array(images), CLIPPED), lights=tuple(lights), mask=inside)


def shaped(scene: gn.Capture, kept: list[int]) -> tuple[gn.Capture, np.ndarray]:
    """The capture with normals of the photographs that are kept, and their albedo (S, 3), as `gonio share` has it."""
    relief = gn.photometric_stereo(scene.select(kept))
    found = np.isfinite(relief.error) & (relief.normals[..., 2] > 0.05)
    normals = np.where(found[..., None], relief.normals, 0)
    return dataclasses.replace(scene, normals=normals, mask=found), relief.albedo[found].astype(np.float64)


def places(scene: gn.Capture) -> np.ndarray:
    at = scene.sites.positions[:, :2]
    low, high = at.min(axis=0), at.max(axis=0)
    return np.asarray((at - low) / (high - low).max())


def sharing(scene: gn.Capture, kept: list[int], scales: Scales | None, smooth: bool) -> tuple[Relightable, Scales]:
    fit = share_reflectance(
        scene.select(kept).reflectance(), places(scene), centres=CENTRES, scales=scales, texture=True, smooth=smooth
    )
    return Relightable(scene.view, scene.textures(fit.value.material)), fit.value.scales


def relit(thing: Relightable) -> Prediction:
    return lambda light: gn.relight(thing, gn.distant_lights(light[None])[0])[thing.view.mask]


def lambert(scene: gn.Capture, albedo: np.ndarray) -> Prediction:
    n = scene.normals[scene.mask].astype(np.float64)
    return lambda light: albedo * np.maximum(n @ light, 0)[:, None]


def polynomial(L: np.ndarray, seen: np.ndarray, known: np.ndarray) -> Prediction:
    """Six terms by pixel and channel; least norm where fewer photographs are known."""

    def terms(d: np.ndarray) -> np.ndarray:
        x, y = d[..., 0], d[..., 1]
        return np.stack((x * x, y * y, x * y, x, y, np.ones_like(x)), axis=-1)

    A = terms(L)
    coefficients = np.einsum("kn,nsc->ksc", np.linalg.pinv(A), seen)
    some = np.flatnonzero(~known.all(axis=0))
    for s in some:
        coefficients[:, s] = np.linalg.lstsq(A[known[:, s]], seen[known[:, s], s], rcond=None)[0]
    return lambda light: np.maximum(np.tensordot(terms(light), coefficients, 1), 0)


def radial(L: np.ndarray, seen: np.ndarray) -> Prediction:
    """Linear radial functions and a linear polynomial of (lx, ly), through the photographs."""
    s = RBFInterpolator(L[:, :2], seen.reshape(len(L), -1), kernel="linear", degree=1)
    return lambda light: np.maximum(s(light[None, :2]).reshape(seen.shape[1:]), 0)


def one_lobe(scene: gn.Capture, L: np.ndarray, seen: np.ndarray, known: np.ndarray) -> Prediction:
    """An albedo by pixel and a gray GGX lobe for all: its width and strength by least squares, albedos within."""
    n = scene.normals[scene.mask].astype(np.float64)
    up = np.array([0.0, 0, 1])

    def lobe(p: np.ndarray, n: np.ndarray, directions: np.ndarray) -> np.ndarray:
        frames = gn.frame(n)
        wo = gn.to_local(frames, up)
        model = gn.Microfacet(gn.GGX(float(np.exp(p[0]))), gn.Schlick(0.04))
        f = [model.f(wi, wo)[:, 0] * np.maximum(wi[:, 2], 0) for wi in (gn.to_local(frames, d) for d in directions)]
        return np.exp(p[1]) * np.array(f)[..., None]

    def albedo(image: np.ndarray, n: np.ndarray, weight: np.ndarray) -> np.ndarray:
        shade = (np.maximum(L @ n.T, 0) * weight)[..., None]
        return np.maximum((shade * image).sum(axis=0) / np.maximum((shade * shade).sum(axis=0), 1e-9), 0)

    some = np.random.default_rng(0).permutation(len(n))[:1500]
    few, few_seen, weight = n[some], seen[:, some].mean(axis=2, keepdims=True), known[:, some].astype(float)
    shade = np.maximum(L @ few.T, 0)[..., None]

    def miss(p: np.ndarray) -> np.ndarray:
        shine = lobe(p, few, L)
        left = shine + albedo(few_seen - shine, few, weight) * shade - few_seen
        return np.asarray((left * weight[..., None]).ravel())

    level = math.log(float(few_seen.mean()) * math.pi)
    bounds = ([math.log(0.03), level - 12], [0, level + 8])
    starts = [[math.log(a), level] for a in (0.1, 0.4)]
    best = min(
        (least_squares(miss, p, bounds=bounds, max_nfev=25, diff_step=1e-3) for p in starts), key=lambda r: r.cost
    )
    matte = albedo(seen - lobe(best.x, n, L), n, known.astype(float))
    return lambda light: matte * np.maximum(n @ light, 0)[:, None] + lobe(best.x, n, light[None])[0]


def off(image: np.ndarray, photograph: np.ndarray, known: np.ndarray) -> float:
    a, b = image[known], photograph[known].astype(np.float64)
    return math.sqrt(np.mean((a - b) ** 2) / np.mean(b**2))


def main(data: Path, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    rows: list[tuple[object, ...]] = []
    for thing in things(data):
        directions = thing.capture.directions
        strips = []
        for kept in (thing.known, spread(directions, thing.known, 6)):
            start = time.perf_counter()
            scene, diffuse = shaped(thing.capture, kept)
            seen, clipped = scene.photographs.pixels(np.flatnonzero(scene.mask))
            L, mine, known = directions[kept], seen[kept].astype(np.float64), ~clipped[kept]
            shared, scales = sharing(scene, kept, None, True)
            lights, photographs = [scene.lights[k] for k in kept], (scene.photographs.read(k) for k in kept)
            models: dict[str, Prediction] = {
                "sharing": relit(shared),
                "sharing, residuals kept": relit(gn.with_residuals(shared, lights, photographs)),
                "sharing, interpolated": relit(sharing(scene, kept, scales, False)[0]),
                "one GGX lobe": one_lobe(scene, L, mine, known),
                "Lambert": lambert(scene, diffuse),
                "polynomial texture map": polynomial(L, mine, known),
                "radial, by pixel": radial(L, np.minimum(mine, 1)),
            }
            images = {name: [model(directions[k]) for k in thing.held] for name, model in models.items()}
            print(f"{thing.name}: {len(kept)} photographs, {len(diffuse)} pixels, {scales}, ", end="")
            print(f"{time.perf_counter() - start:.0f} s")
            for name, made in images.items():
                each = [off(x, seen[k], ~clipped[k]) for x, k in zip(made, thing.held, strict=True)]
                rows.append((thing.name, len(kept), name, float(np.median(each)), *each))
                print(f"    {name:24} {np.median(each):.3f}  ({', '.join(f'{x:.3f}' for x in each)})", flush=True)
            strips.append((len(kept), scene.mask, [np.minimum(seen[thing.held[1]], 1)], images))
        strip(folder / f"{thing.name.replace(' ', '-')}.png", strips)
        with (folder / "real.csv").open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(("object", "photographs", "model", "median error", "steep light", "middle", "grazing"))
            writer.writerows(rows)
    picture(folder / "real.png", rows)


def strip(path: Path, strips: list[tuple[int, np.ndarray, list[np.ndarray], dict[str, list[np.ndarray]]]]) -> None:
    """The photograph of the middle light beside what is made of it, a row for each number of photographs."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = ("sharing", "sharing, residuals kept", "one GGX lobe", "polynomial texture map", "radial, by pixel")
    rows, columns = (np.flatnonzero(strips[0][1].any(axis=axis)) for axis in (1, 0))
    crop = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    tall, wide = strips[0][1][crop].shape
    figure = Figure(figsize=(18, 2 * (18 / 6) * tall / wide + 0.6), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    for row, (count, mask, photograph, images) in enumerate(strips):
        white = np.percentile(photograph[0], 99.5)
        panels = {"photograph": photograph[0]} | {name: images[name][1] for name in shown}
        for column, (name, values) in enumerate(panels.items()):
            image = np.zeros((*mask.shape, 3))
            image[mask] = np.clip(values / white, 0, 1) ** (1 / 2.2)
            axes = figure.add_subplot(2, 6, 6 * row + column + 1)
            axes.imshow(image[crop])
            axes.set_title(f"{name}, {count}", fontsize=9)
            axes.axis("off")
    figure.savefig(path)


def picture(path: Path, rows: list[tuple[object, ...]]) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(16, 6), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    names = list(dict.fromkeys(row[0] for row in rows))
    for k, title in enumerate(("all photographs but three", "six photographs")):
        axes = figure.add_subplot(1, 2, k + 1)
        for j, model in enumerate(dict.fromkeys(row[2] for row in rows)):
            mine = [row for row in rows if row[2] == model and (row[1] == 6) == (k == 1)]
            x = [names.index(row[0]) + (j - 3) * 0.11 for row in mine]
            axes.plot(x, [row[3] for row in mine], "o*Xsv^D"[j], markersize=7, label=model)
        axes.set_xticks(range(len(names)), names, rotation=40, ha="right")
        axes.set_yscale("log")
        axes.set_ylabel("relative rms of radiance, median of three lights")
        axes.set_title(title, fontsize=10)
        axes.grid(alpha=0.3, which="both")
        axes.legend(fontsize=8)
    figure.savefig(path)


if __name__ == "__main__":
    warnings.simplefilter("ignore", gn.GonioWarning)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
