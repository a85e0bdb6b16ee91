"""The tour of `gonio demo`: what gonio does, on data that it makes itself, as one page of pictures and figures.

Each stop renders, measures its own error against an integral that uses none of its shortcuts, and says so.
"""

from __future__ import annotations

import functools
import math
import platform
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..brdf.diffuse import Lambert
from ..brdf.fresnel import Conductor, Fresnel, Schlick
from ..brdf.microfacet import Microfacet
from ..brdf.model import BRDF
from ..brdf.ndf import GGX
from ..brdf.ward import Ward
from ..cameras import Orthographic, Pinhole, look_at
from ..capture.integration import integrate_normals
from ..capture.lighting import distant_lights
from ..capture.photometric_stereo import photometric_stereo
from ..capture.simulation import Sensor, simulate
from ..directions import from_spherical, reflect
from ..errors import FileError
from ..files.images import write_image
from ..lights.environment import Environment
from ..lights.model import Beams
from ..lights.studio import studio
from ..reflection import radiance
from ..rendering.image import render
from ..rendering.irradiance import irradiance
from ..rendering.reflection_map import degree_needed, reflection_map
from ..rendering.shrm import prefilter
from ..rendering.tonemap import Filmic, tone_map
from ..shapes.analytic import Sphere
from ..shapes.heightfield import HeightField
from ..shapes.revolution import vase
from ..sphere.grids import LatLong
from ..sphere.zonal import phong
from .captures import contact_sheet, relief_picture
from .page import Page, Picture, Pictures, Section, Table, Text
from .plots import lobes

# Gold at 630, 532 and 465 nm, eta + i k of Johnson and Christy 1972.
GOLD = Conductor([0.18, 0.54, 1.33], [3.43, 2.23, 1.87])

MATERIALS: dict[str, BRDF] = {
    "Lambert, albedo .7 .65 .6": Lambert([0.70, 0.65, 0.60]),
    "lacquer: Lambert + GGX .14": Lambert([0.45, 0.06, 0.05]) + Microfacet(GGX(0.14), Fresnel(1.5)),
    "satin: Lambert + GGX .35": Lambert([0.08, 0.16, 0.36]) + Microfacet(GGX(0.35), Fresnel(1.5)),
    "gold, GGX .2": Microfacet(GGX(0.2), GOLD),
    "brushed gold, GGX .1 x .4": Microfacet(GGX(0.1, 0.4), GOLD),
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
    room = studio(128)
    stops = (_hero, _materials, _nine_numbers, _reflection_map, _light_field, _relief)
    sections = []
    for done, stop in enumerate(stops):
        if progress:
            progress(done, len(stops))
        sections.append(stop(folder, room))
    if progress:
        progress(len(stops), len(stops))
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
    camera = Pinhole.look_at(eye=(3.9, -4.6, 2.1), target=(0, 0, 0), field_of_view=22, size=(512, 512))
    material = MATERIALS["lacquer: Lambert + GGX .14"]
    image = render(vase(), material, room, camera, shadows=True, supersample=2)
    write_image(folder / "vase.exr", image)
    picture = _picture(folder, "vase", image, "Red lacquer, with shadows.", 1.0)
    command = (
        "gonio render --shape vase --shadows --brdf lambert:albedo=.45/.06/.05 --brdf ggx:alpha=.14,eta=1.5 -o vase.exr"
    )
    return Section(
        "A material under light",
        (
            Pictures((picture,), 480),
            Text(command, "command"),
        ),
    )


def _materials(folder: Path, room: Environment) -> Section:
    camera = Pinhole.look_at(eye=(3.2, -4.2, 1.4), target=(0, 0, 0), field_of_view=23, size=(180, 180))
    pictures = []
    for k, (name, material) in enumerate(MATERIALS.items()):
        image = render(Sphere(), material, room, camera, supersample=2)
        pictures.append(_picture(folder, f"material-{k}", image, name, 1.0))
    plot = Picture(lobes(folder / "lobes.png", MATERIALS), "Lobes of the six models, light from the left.")
    return Section(
        "Models of reflectance",
        (
            Text("A model is a value; models add. Each ball is lit by the same beams of the room, without noise."),
            Pictures(pictures, 150),
            Text("Their lobes in the plane of incidence, light at 45 degrees: f cos theta_o on a logarithmic scale."),
            Pictures((plot,), 600),
        ),
    )


def _nine_numbers(folder: Path, room: Environment) -> Section:
    light = room.harmonics(2)
    normals = LatLong(96, 192).directions()
    irradiance(light, normals)  # the first call compiles
    nine, quick = _timed(lambda: irradiance(light, normals))
    beams = room.beams()
    exact, slow = _timed(lambda: np.stack([_irradiance_integral(row, beams) for row in normals]))
    # RH 4.3.1 measures by the total intensity of the illumination: the integral of L over the sphere.
    error = np.abs(nine - exact) / beams.irradiance.sum(axis=0)
    mean = float(np.average(error.mean(axis=(1, 2)), weights=LatLong(96, 192).weights))
    shown = functools.partial(_picture, folder)
    scale = 1 / exact.max()
    return Section(
        "Irradiance from nine numbers",
        (
            Text(
                "Matte surfaces see light through a blur so wide that nine coefficients a channel say nearly all of it "
                f"(RH 4). Here they miss the full integral by {100 * mean:.2f} % of the light's total intensity on "
                f"average and {100 * error.max():.2f} % at most; the map below took {1000 * quick:.1f} ms, the "
                f"integral {1000 * slow:.0f} ms."
            ),
            Pictures(
                (
                    shown("room", room.image, "The room, all around: latitude and longitude."),
                    shown("irradiance-exact", exact * scale, "Irradiance for every normal: the full integral."),
                    shown("irradiance-nine", np.maximum(nine, 0) * scale, "The same from nine coefficients."),
                    shown("irradiance-error", 10 * np.abs(nine - exact) * scale, "Their difference, ten times."),
                ),
                420,
            ),
            Table(
                ("coefficient", "red", "green", "blue"),
                [(name, *(f"{value:.3f}" for value in row)) for name, row in zip(NAMES, light, strict=True)],
            ),
        ),
    )


def _reflection_map(folder: Path, room: Environment) -> Section:
    exponent, error = 64.0, 0.01
    A = phong(127, exponent)
    reflection_map(room, A, 128, error)  # the first call compiles
    blurred, quick = _timed(lambda: reflection_map(room, A, 128, error))
    camera = Orthographic(pixel=2.2 / 200, size=(200, 200), pose=look_at(eye=(2.7, -3.5, 1.2), target=(0, 0, 0)))
    view = Sphere().view(camera)
    R = reflect(view.wo[view.mask], view.normal[view.mask])
    mirror, looked_up, brute = (np.zeros((*view.mask.shape, 3)) for _ in range(3))
    mirror[view.mask] = room.radiance(R)
    looked_up[view.mask] = blurred.radiance(R)
    brute[view.mask], slow = _timed(lambda: _phong_integral(room, R))
    rms = float(np.sqrt(np.mean((looked_up - brute) ** 2) / np.mean(brute**2)))
    shown = functools.partial(_picture, folder)
    return Section(
        "A reflection map",
        (
            Text(
                f"A Phong lobe of exponent {exponent:g} blurs the room; in harmonics the blur is a product. For an "
                f"error of {100 * error:g} % degree {degree_needed(A, error)} is enough. The map took "
                f"{1000 * quick:.0f} ms and serves every point and view; integrating these pixels alone took "
                f"{slow:.1f} s. The relative rms difference is {100 * rms:.2f} %."
            ),
            Pictures(
                (
                    shown("reflection-mirror", mirror, "A mirror: the room itself."),
                    shown("reflection-map", looked_up, "The reflection map, looked up along R."),
                    shown("reflection-brute", brute, "The integral over the room, pixel by pixel."),
                    shown("reflection-error", 10 * np.abs(looked_up - brute), "Their difference, ten times."),
                ),
                220,
            ),
        ),
    )


def _light_field(folder: Path, room: Environment) -> Section:
    material = Lambert([0.08, 0.16, 0.36]) + 0.7 * Microfacet(GGX(0.35), Schlick([0.7, 0.6, 0.5]))
    maps = prefilter(room, material, 0.05)
    camera = Orthographic(pixel=2.2 / 200, size=(200, 200), pose=look_at(eye=(2.7, -3.5, 1.2), target=(0, 0, 0)))
    view = Sphere().view(camera)
    n, wo, frames = view.normal[view.mask], view.wo[view.mask], view.frames[view.mask]
    maps.radiance(n[:1], wo[:1])  # the first call compiles
    found, quick = _timed(lambda: maps.radiance(n, wo))
    summed, slow = _timed(lambda: radiance(material, room, frames, wo, budget=1024))
    rms = float(np.sqrt(np.mean((found - summed) ** 2) / np.mean(summed**2)))
    pictures = []
    for name, values, caption in (
        ("field-maps", found, "Looked up in the maps."),
        ("field-sum", summed, "The sum over 1,024 beams of the room, pixel by pixel."),
        ("field-error", 10 * np.abs(found - summed), "Their difference, ten times."),
    ):
        image = np.zeros((*view.mask.shape, 3))
        image[view.mask] = values
        pictures.append(_picture(folder, name, image, caption, 1.0))
    orders = " and ".join(f"F = {lobe.degree}, P = {lobe.exit_degree}" for lobe in maps.lobes)
    return Section(
        "Every normal, every view",
        (
            Text(
                "A spherical harmonic reflection map (RH 5.4) holds what a material makes of the room for all normals "
                f"and views at once, each of its lobes by itself: {orders}, chosen by the error asked for. Pictures of "
                f"a ball should miss {100 * maps.error:.1f} % on average over views; this one misses "
                f"{100 * rms:.1f} %, in {1000 * quick:.0f} ms where the sum took {slow:.1f} s."
            ),
            Pictures(pictures, 220),
        ),
    )


def _relief(folder: Path, _: Environment) -> Section:
    y, x = np.mgrid[-1:1:160j, -1:1:160j]
    heights = 9 * np.exp(-4 * ((x - 0.3) ** 2 + y**2)) + 2.5 * np.sin(6 * x) * np.cos(5 * y)
    relief = HeightField(heights)
    k = np.arange(20)
    lights = distant_lights(from_spherical(np.radians(15 + 2.5 * k), 2.4 * k), np.full(20, math.pi))
    material = Lambert([0.5, 0.35, 0.2]) + Microfacet(GGX(0.3), Fresnel(1.5))
    sensor = Sensor(exposure=1.2, gain=1e-4, read=1e-3, bits=8)
    capture = simulate(relief, material, lights, relief.camera(), sensor=sensor, shadows=True)
    found, taken = _timed(lambda: photometric_stereo(capture))
    known = np.isfinite(found.error)
    surface = integrate_normals(found.normals, known, 1 / found.error**2)
    cosine = np.sum(found.normals * np.asarray(capture.normals), axis=-1).clip(-1, 1)[known]
    off = float(np.degrees(np.median(np.arccos(cosine))))
    return Section(
        "A relief from its shading",
        (
            Text(
                f"A relief of glossy plastic, photographed from above under {len(k)} lights one after the other, with "
                "shadows, noise, and codes of 8 bits. Photometric stereo finds its normals, a median of "
                f"{off:.1f} degrees off where it foresaw {np.degrees(np.nanmedian(found.error)):.1f}, and from them "
                f"heights, {float(np.nanstd(surface.heights - heights)):.2f} pixels off of {np.ptp(heights):.0f}; it "
                f"took {taken:.1f} s."
            ),
            Pictures(
                (Picture(contact_sheet(folder / "relief-photographs.png", capture), "Photographs, and lights."),), 700
            ),
            Pictures((Picture(relief_picture(folder / "relief.png", found, surface.heights), "What was found."),), 700),
        ),
    )


def _timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """What `work` answers, and the seconds it took."""
    began = time.perf_counter()
    return work(), time.perf_counter() - began


def _irradiance_integral(n: np.ndarray, beams: Beams) -> np.ndarray:
    """The sum of max(n.w, 0) E over every texel of the room, for each normal (N, 3)."""
    cosine = np.maximum(n.astype(np.float32) @ beams.directions.astype(np.float32).T, 0)
    answer: np.ndarray = cosine @ beams.irradiance.astype(np.float32)
    return answer


def _phong_integral(room: Environment, R: np.ndarray) -> np.ndarray:
    """The integral of (s + 1)/(2 pi) max(R.w, 0)^s L(w), s = 64, over every texel of the room, for each R (N, 3)."""
    beams = room.beams()
    directions, irradiance = beams.directions.astype(np.float32), beams.irradiance.astype(np.float32)
    answer = np.empty((len(R), 3), np.float32)
    for k in range(0, len(R), 64):  # a block of cosines stays in the cache
        lobe = np.maximum(R[k : k + 64].astype(np.float32) @ directions.T, 0)
        for _ in range(6):
            lobe *= lobe
        answer[k : k + 64] = 65 / (2 * math.pi) * (lobe @ irradiance)
    return answer
