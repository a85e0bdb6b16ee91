"""The tour of `gonio demo`: what gonio does, on data that it makes itself, as one page of pictures and figures.

Each stop renders, measures its own error against an integral that uses none of its shortcuts, and says so.
"""

from __future__ import annotations

import math
import platform
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from .. import __version__
from ..brdf.diffuse import Lambert
from ..brdf.fresnel import Conductor, Fresnel
from ..brdf.microfacet import Microfacet
from ..brdf.model import BRDF
from ..brdf.ndf import GGX
from ..brdf.phong import Phong
from ..brdf.ward import Ward
from ..cameras import Orthographic, Pinhole, look_at
from ..directions import reflect
from ..errors import FileError
from ..files.images import write_image
from ..lights.environment import Environment
from ..lights.studio import studio
from ..rendering.image import render
from ..rendering.irradiance import irradiance
from ..rendering.prefilter import degree_needed, reflection_map
from ..rendering.tonemap import Filmic, tone_map
from ..shapes.analytic import Sphere
from ..shapes.revolution import vase
from ..sphere.zonal import phong
from .page import Page, Picture, Pictures, Section, Table, Text

# Gold at 630, 532 and 465 nm, eta + i k of Johnson and Christy 1972.
GOLD = Conductor([0.18, 0.54, 1.33], [3.43, 2.23, 1.87])

MATERIALS: dict[str, BRDF] = {
    "Lambert, albedo .7 .65 .6": Lambert([0.70, 0.65, 0.60]),
    "lacquer: Lambert + GGX .08": Lambert([0.45, 0.06, 0.05]) + Microfacet(GGX(0.08), Fresnel(1.5)),
    "satin: Lambert + GGX .35": Lambert([0.08, 0.16, 0.36]) + Microfacet(GGX(0.35), Fresnel(1.5)),
    "gold, GGX .12": Microfacet(GGX(0.12), GOLD),
    "brushed gold, GGX .08 x .4": Microfacet(GGX(0.08, 0.4), GOLD),
    "Ward, .3, alpha .1 x .3": Lambert([0.12, 0.22, 0.14]) + Ward(0.3, 0.1, 0.3),
}

NAMES = ("L00", "L1-1", "L10", "L11", "L2-2", "L2-1", "L20", "L21", "L22")


def tour(folder: str | Path, progress: Callable[[int, int], None] | None = None) -> Path:
    """Make the tour's pictures in `folder` and the page `index.html` that shows them; returns the page's path.

    Raises `FileError` where the folder cannot be made.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{folder}: cannot be made ({error.strerror}). Name another folder.") from error
    began = time.perf_counter()
    room = studio()
    sections = []
    for done, stop in enumerate((_hero, _materials, _nine_numbers, _reflection_map)):
        if progress:
            progress(done, 4)
        sections.append(stop(folder, room))
    if progress:
        progress(4, 4)
    page = Page(
        title="gonio: light and reflectance",
        lead="Everything below was made on this machine by one command, from data that gonio makes itself: "
        "a room for light, a vase for shape, and models of reflectance.",
        sections=sections,
        foot=f"gonio {__version__}, Python {platform.python_version()}, NumPy {np.__version__}, "
        f"{time.perf_counter() - began:.0f} s on this machine.",
    )
    return page.write(folder / "index.html")


def _picture(folder: Path, name: str, image: np.ndarray, caption: str, exposure: float = 0.0) -> Picture:
    path = folder / f"{name}.png"
    write_image(path, tone_map(image, Filmic(), exposure))
    return Picture(path, caption)


def _hero(folder: Path, room: Environment) -> Section:
    camera = Pinhole.look_at(eye=(3.9, -4.6, 2.1), target=(0, 0, 0), field_of_view=24, size=(720, 720))
    material = MATERIALS["lacquer: Lambert + GGX .08"]
    image = render(vase(), material, room, camera, shadows=True, samples=512, supersample=2)
    write_image(folder / "vase.exr", image)
    return Section(
        "A material under light",
        (
            Pictures((_picture(folder, "vase", image, "Red lacquer (Lambert + GGX) under the room, with shadows."),), 480),
            Text(
                'gonio render --shape vase --brdf lambert:albedo=.45/.06/.05 --brdf ggx:alpha=.08,eta=1.5 --shadows -o vase.exr',
                "command",
            ),
        ),
    )


def _materials(folder: Path, room: Environment) -> Section:
    camera = Pinhole.look_at(eye=(3.2, -4.2, 1.4), target=(0, 0, 0), field_of_view=23, size=(240, 240))
    pictures = []
    for k, (name, material) in enumerate(MATERIALS.items()):
        image = render(Sphere(), material, room, camera, samples=1024, supersample=2)
        pictures.append(_picture(folder, f"material-{k}", image, name))
    return Section(
        "Models of reflectance",
        (
            Text("A model is a value; models add. Each ball is integrated under the whole room, without noise."),
            Pictures(pictures, 150),
        ),
    )


def _nine_numbers(folder: Path, room: Environment) -> Section:
    light = room.harmonics(2)
    rows = 96
    normals = np.asarray(_latlong_directions(rows))
    began = time.perf_counter()
    nine = irradiance(light, normals)
    quick = time.perf_counter() - began
    began = time.perf_counter()
    beams = room.beams()
    exact = np.empty_like(nine)
    for r in range(rows):
        exact[r] = np.maximum(normals[r] @ np.asarray(beams.directions).T, 0) @ np.asarray(beams.irradiance)
    slow = time.perf_counter() - began
    # RH 4.3.1 measures by the total intensity of the illumination: the integral of L over the sphere.
    total = np.asarray(beams.irradiance).sum(axis=0)
    error = np.abs(nine - exact) / total
    area = np.sin((np.arange(rows) + 0.5) * np.pi / rows)[:, None, None]
    mean = float((error * area).mean() / area.mean())
    scale = 1 / exact.max()
    table = Table(
        ("coefficient", "red", "green", "blue"),
        [(name, *(f"{value:.3f}" for value in row)) for name, row in zip(NAMES, np.asarray(light), strict=True)],
    )
    return Section(
        "Irradiance from nine numbers",
        (
            Text(
                "Matte surfaces see light through a blur so wide that nine coefficients a channel say nearly all of it "
                f"(RH 4). Here they miss the full integral by {100 * mean:.2f} % of the light's total intensity on average "
                f"and {100 * error.max():.2f} % at most; the map below took {1000 * quick:.1f} ms, the integral "
                f"{1000 * slow:.0f} ms."
            ),
            Pictures(
                (
                    _picture(folder, "room", np.asarray(room.image), "The room, all around: latitude and longitude.", -1.0),
                    _picture(folder, "irradiance-exact", exact * scale, "Irradiance for every normal: the full integral."),
                    _picture(folder, "irradiance-nine", np.maximum(nine, 0) * scale, "The same from nine coefficients."),
                    _picture(
                        folder,
                        "irradiance-error",
                        10 * np.abs(nine - exact) * scale,
                        "Their difference, ten times as bright.",
                    ),
                ),
                330,
            ),
            table,
        ),
    )


def _reflection_map(folder: Path, room: Environment) -> Section:
    exponent, error = 60.0, 0.01
    A = phong(exponent, 128)
    degree = degree_needed(A, error)
    began = time.perf_counter()
    blurred = reflection_map(room, A, 128, error)
    quick = time.perf_counter() - began
    camera = Orthographic(pixel=2.2 / 240, size=(240, 240), pose=look_at(eye=(2.7, -3.5, 1.2), target=(0, 0, 0)))
    view = Sphere().view(camera)
    n, wo = view.normal[view.mask], view.wo[view.mask]
    R = reflect(wo, n)
    mirror, looked_up, brute = (np.zeros((*view.mask.shape, 3)) for _ in range(3))
    mirror[view.mask] = room.radiance(R)
    looked_up[view.mask] = blurred.radiance(R)
    began = time.perf_counter()
    brute[view.mask] = _phong_integral(room, R, exponent)
    slow = time.perf_counter() - began
    rms = float(np.sqrt(np.mean((looked_up - brute) ** 2) / np.mean(brute**2)))
    peak = Phong  # the lobe that is convolved is that of the model of this name
    return Section(
        "A reflection map",
        (
            Text(
                f"A {peak.__name__} lobe of exponent {exponent:g} blurs the room; in harmonics the blur is a product. For an error of "
                f"{100 * error:g} % degree {degree} is enough. The map took {1000 * quick:.0f} ms and serves every point "
                f"and view; integrating these pixels alone took {slow:.1f} s. The relative rms difference is {100 * rms:.2f} %."
            ),
            Pictures(
                (
                    _picture(folder, "reflection-mirror", mirror, "A mirror: the room itself."),
                    _picture(folder, "reflection-map", looked_up, "The reflection map, looked up along R."),
                    _picture(folder, "reflection-brute", brute, "The integral over the room, pixel by pixel."),
                    _picture(folder, "reflection-error", 10 * np.abs(looked_up - brute), "Difference, ten times as bright."),
                ),
                220,
            ),
        ),
    )


def _phong_integral(room: Environment, R: np.ndarray, exponent: float) -> np.ndarray:
    """The integral of (s + 1)/(2 pi) max(R.w, 0)^s L(w) over every texel of the room, for each R (N, 3)."""
    beams = room.beams()
    directions, weight = np.asarray(beams.directions, np.float32), np.asarray(beams.irradiance, np.float32)
    answer = np.empty((len(R), weight.shape[-1]), np.float32)
    for k in range(0, len(R), 256):
        cosine = np.maximum(np.asarray(R[k : k + 256], np.float32) @ directions.T, 0)
        answer[k : k + 256] = (exponent + 1) / (2 * math.pi) * (cosine**exponent @ weight)
    return answer


def _latlong_directions(rows: int) -> np.ndarray:
    from ..sphere.grids import LatLong

    return LatLong(rows, 2 * rows).directions()
