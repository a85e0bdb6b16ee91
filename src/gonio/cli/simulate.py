"""`gonio simulate`: a folder of photographs of something known, to try estimators on, with the truth beside."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from . import maps, parse
from .progress import bar
from .render import shape_of

if TYPE_CHECKING:
    import numpy as np

    from ..brdf.model import BRDF
    from ..capture.model import Capture
    from ..capture.simulation import Sensor, SimulatedPhotographs
    from ..capture.turntable import Turntable
    from ..lights.model import Light

_BRIGHT = 0.95  # the code of what is brightest: of flat samples, nearly all
_ELEVATION, _FIELD_OF_VIEW = 20.0, 40.0  # degrees, of the cameras that go round


def simulate(
    output: Path = typer.Option(..., "--output", "-o", help="A new folder."),
    shape: str = typer.Option("sphere", "--shape", help="sphere, vase, a mesh file, or an image of heights."),
    brdf: list[str] = typer.Option(["lambert:albedo=.6"], "--brdf", help="As for render. Repeat to add."),
    lights: Path | None = typer.Option(None, "--lights", help="An .lp; else a dome."),
    count: int = typer.Option(48, "--count", min=3, help="Lights of the dome."),
    near: float = typer.Option(0.0, "--near", min=0, help="How far lamps stand, in sizes of the shape; 0 is far away."),
    environment: Path | None = typer.Option(None, "--environment", help="A map of light in the place of lamps."),
    views: int = typer.Option(0, "--views", min=0, help="Photograph from so many places around, under a lamp each."),
    size: int = typer.Option(256, "--size", min=8, help="Pixels along the longer side."),
    shadows: bool = typer.Option(False, "--shadows", help="Trace shadow rays."),
    exposure: float = typer.Option(0.0, "--exposure", help="Code for radiance 1; 0 leaves 1 pixel in 1000 above .95."),
    brackets: str = typer.Option("", "--brackets", help="Several exposures of each, in the above: 1,4,16."),
    gain: float = typer.Option(0.0, "--gain", help="Shot noise: variance for each unit of code."),
    read: float = typer.Option(0.0, "--read", help="Read noise: its standard deviation, of the brightest code."),
    bits: int = typer.Option(16, "--bits", min=1, max=16, help="Of the codes, which are linear."),
    misaligned: float = typer.Option(0.0, "--misaligned", help="Degrees rms by which the lights told are off."),
    seed: int = typer.Option(0, "--seed", min=0, help="Of noise and misalignment."),
    relief: float = typer.Option(1.0, "--relief", help="What an image of heights is multiplied by, in pixels."),
) -> None:
    """Photograph a known shape and material under known lights, as a folder with a capture.toml and the truth."""
    import numpy as np

    import gonio as gn
    from gonio.capture.lighting import directions_of
    from gonio.errors import FileError, ParameterError

    if output.exists() and any(output.iterdir() if output.is_dir() else [output]):
        raise FileError(f"{output} exists and is not empty: give a new folder.")
    if environment and (lights or near):
        raise ParameterError("--environment goes in the place of --lights and --near.")
    multiples = parse.numbers(brackets) if brackets else (1.0,)
    solid, centre, radius = shape_of(shape, relief, False, False)
    material = parse.reflectance(brdf)
    if environment:
        arriving: list[Light] = [maps.read([environment], None, "")] * max(views, 1)
    else:
        directions = gn.read_lp(lights).directions if lights else _beside(views) if views else dome(count)
        arriving = _lamps(directions, near, np.array(centre), solid)
    if views and len(arriving) < views:
        raise FileError(f"{lights} has {len(arriving)} lights for {views} views.")
    arriving = arriving[: views or None]
    capture = _captured(solid, material, arriving, views, size, shadows, misaligned, seed, centre, radius)
    if exposure <= 0:
        exposure = _BRIGHT / _brightest(capture)
    sensor = gn.Sensor(exposure, gain, read, bits)
    sensors = [dataclasses.replace(sensor, exposure=exposure * m) for m in multiples]
    (output / "truth").mkdir(parents=True)
    names = _write(output, capture, sensors)
    made = {"shape": shape, "brdf": brdf, "sensor": dataclasses.asdict(sensor), "shadows": shadows, "seed": seed}
    if near:
        made["positions"] = [light.position.tolist() for light in arriving if isinstance(light, gn.Point)]
    (output / "truth" / "made.json").write_text(json.dumps(made, indent=1), "utf-8")
    if capture.directions is not None:
        gn.write_lp(output / "truth" / "dirs.lp", names, np.asarray(directions_of(arriving)))
        if not views:
            gn.write_lp(output / "dirs.lp", names, capture.directions)
    rows, columns = capture.photographs.size
    typer.echo(f"{len(capture.photographs)} photographs of {columns} x {rows} in {output}")


def dome(count: int) -> np.ndarray:
    """`count` directions spread evenly over the upper hemisphere down to 75 degrees, by the golden angle."""
    import numpy as np

    import gonio as gn

    k = np.arange(count) + 0.5
    z = 1 - k / count * (1 - np.cos(np.radians(75)))
    directions: np.ndarray = gn.from_spherical(np.arccos(z), k * np.pi * (3 - np.sqrt(5)))
    return directions


def _beside(views: int) -> np.ndarray:
    """A direction for each of the cameras that go round: up to 70 degrees to its side, 15 to 60 above the horizon."""
    import numpy as np

    import gonio as gn

    k = np.arange(views)
    aside = np.radians(70) * np.sin(2.4 * k)
    up = np.radians(15 + 45 * ((0.618 * k) % 1))
    directions: np.ndarray = gn.from_spherical(np.pi / 2 - up, 2 * np.pi * k / views + aside)
    return directions


def _lamps(directions: np.ndarray, near: float, centre: np.ndarray, solid: Any) -> list[Light]:
    """Lights that make white 1 at the middle of the shape, as far from it as `near` of its sizes, or far away."""
    import numpy as np

    import gonio as gn

    power = np.full(len(directions), np.pi)
    if not near:
        return list(gn.distant_lights(directions, power))
    low, high = solid.bounds
    distance = near * float(np.max(high - low))
    return list(gn.near_lights(centre + distance * directions, power * distance**2))


def _captured(
    solid: Any,
    material: BRDF,
    arriving: list[Light],
    views: int,
    size: int,
    shadows: bool,
    misaligned: float,
    seed: int,
    centre: list[float],
    radius: float,
) -> Capture | Turntable:
    import gonio as gn
    from gonio.capture.simulation import from_above
    from gonio.errors import ParameterError

    if not views:
        camera = from_above(solid, size)
        return gn.simulate(solid, material, arriving, camera, shadows=shadows, misaligned=misaligned, seed=seed)
    if not isinstance(solid, gn.Mesh):
        raise ParameterError("--views photographs a mesh: --shape vase, or a mesh file.")
    cameras = []
    for k in range(views):
        turn, up = 2 * math.pi * k / views, math.radians(_ELEVATION)
        away = (math.cos(up) * math.cos(turn), math.cos(up) * math.sin(turn), math.sin(up))
        distance = 1.05 * radius / math.sin(math.radians(_FIELD_OF_VIEW / 2))
        eye = [c + distance * a for c, a in zip(centre, away, strict=True)]
        cameras.append(gn.Pinhole.look_at(eye, centre, _FIELD_OF_VIEW, (size, size)))
    return gn.simulate_turntable(solid, material, arriving, cameras, shadows=shadows, misaligned=misaligned, seed=seed)


def _brightest(ideal: Capture | Turntable) -> float:
    """What one pixel of the object in a thousand exceeds, in some of the photographs."""
    import numpy as np

    photographs: SimulatedPhotographs = ideal.photographs  # type: ignore[assignment]
    some = range(0, len(photographs), max(1, len(photographs) // 8))
    bright = max(float(np.quantile(photographs.truth(k)[photographs.view(k).mask], 0.999)) for k in some)
    return bright if bright > 0 else 1.0


def _write(output: Path, capture: Capture | Turntable, sensors: list[Sensor]) -> tuple[str, ...]:
    """Photographs by each of the sensors, normals and mask where they are of one place, and what describes them.

    Answers the names of the photographs, of brackets their first.
    """
    import numpy as np

    import gonio as gn
    from gonio.capture.exposure import Noise
    from gonio.capture.lighting import scaled
    from gonio.files.brackets import BracketFiles
    from gonio.files.photographs import PhotographFiles

    photographs: SimulatedPhotographs = capture.photographs  # type: ignore[assignment]
    several = len(sensors) > 1
    groups = [
        [name.replace(".png", f"_{j}.png") if several else name for j in range(len(sensors))]
        for name in photographs.names
    ]
    with bar("simulate") as progress:
        for k, group in enumerate(groups):
            for name, sensor in zip(group, sensors, strict=True):
                code = photographs.exposed(k, sensor).radiance * sensor.exposure
                gn.write_image(output / name, code.clip(0, 1), "linear", bits=16)
            progress(k + 1, len(groups))
    if isinstance(capture, gn.Capture):
        codes = np.where(capture.mask[..., None], 0.5 * np.asarray(capture.normals) + 0.5, 0.0)
        gn.write_image(output / "normals.png", codes, "linear", bits=16, clip=True)
        gn.write_image(output / "mask.png", capture.mask.astype(float), "linear")
    lights = capture.lights
    if several:
        noise = Noise(max(sensors[0].gain, 1e-6), sensors[0].read)
        written: Any = BracketFiles(output, groups, [sensor.exposure for sensor in sensors], "linear", noise)
    else:
        written = PhotographFiles(output, [name for (name,) in groups], "linear")
        # Codes are radiance times exposure: so are the lights that go with them, and f comes out in 1/sr.
        lights = None if lights is None else tuple(scaled(light, sensors[0].exposure) for light in lights)
    gn.write_capture(output, dataclasses.replace(capture, photographs=written, lights=lights))
    return tuple(written.names)
