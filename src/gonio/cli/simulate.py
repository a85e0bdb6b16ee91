"""`gonio simulate`: a folder of photographs of something known, to try estimators on, with the truth beside."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from . import parse
from .progress import bar
from .render import shape_of

if TYPE_CHECKING:
    import numpy as np


def simulate(
    output: Path = typer.Option(..., "--output", "-o", help="A new folder."),
    shape: str = typer.Option("sphere", "--shape", help="sphere, vase, a mesh file, or an image of heights."),
    brdf: list[str] = typer.Option(["lambert:albedo=.6"], "--brdf", help="As for render. Repeat to add."),
    lights: Path | None = typer.Option(None, "--lights", help="An .lp; else a dome."),
    count: int = typer.Option(48, "--count", min=3, help="Lights of the dome."),
    size: int = typer.Option(256, "--size", min=8, help="Pixels along the longer side."),
    shadows: bool = typer.Option(False, "--shadows", help="Trace shadow rays."),
    exposure: float = typer.Option(0.0, "--exposure", help="Code for radiance 1; 0 takes what clips 1 pixel in 1000."),
    gain: float = typer.Option(0.0, "--gain", help="Shot noise: variance for each unit of code."),
    read: float = typer.Option(0.0, "--read", help="Read noise: its standard deviation, of the brightest code."),
    bits: int = typer.Option(16, "--bits", min=1, max=16, help="Of the codes, which are linear."),
    misaligned: float = typer.Option(0.0, "--misaligned", help="Degrees rms by which dirs.lp is off the truth."),
    seed: int = typer.Option(0, "--seed", min=0, help="Of noise and misalignment."),
    relief: float = typer.Option(1.0, "--relief", help="What an image of heights is multiplied by, in pixels."),
) -> None:
    """Photograph a known shape and material under known lights, as an RTI folder with normals, mask and the truth."""
    import numpy as np

    import gonio as gn
    from gonio.capture.simulation import from_above
    from gonio.errors import FileError

    if output.exists() and any(output.iterdir() if output.is_dir() else [output]):
        raise FileError(f"{output} exists and is not empty: give a new folder.")
    solid, _, _ = shape_of(shape, relief, False, False)
    directions = gn.read_lp(lights).directions if lights else dome(count)
    material, camera = parse.reflectance(brdf), from_above(solid, size)
    if exposure <= 0:
        ideal = gn.simulate(solid, material, directions, camera, shadows=shadows)
        some = range(0, len(directions), max(1, len(directions) // 8))
        bright = max(float(np.quantile(ideal.photographs.read(k).radiance[ideal.mask], 0.999)) for k in some)
        exposure = 1 / bright if bright > 0 else 1.0
    sensor = gn.Sensor(exposure, gain, read, bits)
    capture = gn.simulate(
        solid, material, directions, camera, sensor=sensor, shadows=shadows,
        misaligned=misaligned, seed=seed,
    )  # fmt: skip
    photographs = capture.photographs
    (output / "truth").mkdir(parents=True)
    codes = np.where(capture.mask[..., None], 0.5 * np.asarray(capture.normals) + 0.5, 0.0)
    gn.write_image(output / "normals.png", codes, "linear", bits=16, clip=True)
    gn.write_image(output / "mask.png", capture.mask.astype(float), "linear")
    with bar("simulate") as progress:
        for k, name in enumerate(photographs.names):
            code = photographs.read(k).radiance * exposure
            gn.write_image(output / name, code.clip(0, 1), "linear", bits=16)
            progress(k + 1, len(photographs.names))
    gn.write_lp(output / "truth" / "dirs.lp", photographs.names, directions)
    made = {"shape": shape, "brdf": brdf, "sensor": dataclasses.asdict(sensor), "shadows": shadows, "seed": seed}
    (output / "truth" / "made.json").write_text(json.dumps(made, indent=1), "utf-8")
    gn.write_lp(output / "dirs.lp", photographs.names, np.asarray(capture.directions))
    # Codes are radiance times exposure: so are the irradiances that go with them, and f comes out in 1/sr.
    gn.write_capture(output, dataclasses.replace(capture, intensities=capture.intensities * exposure))
    typer.echo(f"{len(photographs.names)} photographs of {capture.mask.shape[1]} x {capture.mask.shape[0]} in {output}")


def dome(count: int) -> np.ndarray:
    """`count` directions spread evenly over the upper hemisphere down to 75 degrees, by the golden angle."""
    import numpy as np

    import gonio as gn

    k = np.arange(count) + 0.5
    z = 1 - k / count * (1 - np.cos(np.radians(75)))
    directions: np.ndarray = gn.from_spherical(np.arccos(z), k * np.pi * (3 - np.sqrt(5)))
    return directions
