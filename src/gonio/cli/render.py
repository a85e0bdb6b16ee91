"""`gonio render`: a sphere, mesh or height field with any BRDF under any light, to EXR or tone-mapped PNG."""

from __future__ import annotations

import enum
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from . import parse
from .progress import bar

if TYPE_CHECKING:
    from ..lights.model import Light


class Curve(enum.StrEnum):
    """Tone curves by name."""

    FILMIC = "filmic"
    REINHARD = "reinhard"
    LINEAR = "linear"


def render(
    output: Path = typer.Option(..., "--output", "-o", help="image.exr (linear), or image.png (tone-mapped)."),
    brdf: list[str] = typer.Option(
        ["lambert:albedo=.6"],
        "--brdf",
        help="A model, name:key=value,...  (colours as r/g/b), or a measured file. Repeat to add terms.",
    ),
    shape: str = typer.Option("sphere", "--shape", help="sphere, vase, a mesh file, or an image of heights."),
    light: list[Path] = typer.Option([], "--light", help="An environment map. Without any light: a room of gonio's."),
    sun: list[str] = typer.Option([], "--sun", help="A directional light x,y,z[:irradiance], towards the light."),
    size: str = typer.Option("512", "--size", help="Pixels, as 640x480 or 512."),
    samples: int = typer.Option(1024, "--samples", min=1, help="Light samples a pixel, for environments."),
    shadows: bool = typer.Option(False, "--shadows", help="Trace shadow rays."),
    eye: str = typer.Option("2.6,-3.2,1.6", "--eye", help="The camera's place x,y,z, z up, in radii of the shape."),
    field_of_view: float = typer.Option(34.0, "--fov", help="Vertical field of view in degrees."),
    smooth: int = typer.Option(2, "--supersample", min=1, max=8, help="Rays a pixel along each side."),
    background: bool = typer.Option(True, "--background/--no-background", help="Show the environment behind."),
    relief: float = typer.Option(1.0, "--relief", help="What an image of heights is multiplied by, in pixels."),
    exposure: float = typer.Option(0.0, "--exposure", help="Stops, for PNG."),
    curve: Curve = typer.Option(Curve.FILMIC, "--curve", help="Tone curve, for PNG."),
) -> None:
    """Render a shape with a BRDF under environment maps and directional lights."""
    import gonio as gn

    columns, rows = parse.size(size)
    material = parse.reflectance(brdf)
    scene, centre, radius = _shape(shape, relief)
    camera = gn.Pinhole.look_at(
        eye=[c + radius * e for c, e in zip(centre, parse.vector(eye), strict=True)],
        target=centre,
        field_of_view=field_of_view,
        size=(rows, columns),
    )
    with bar("render") as progress:
        image = gn.render(
            scene,
            material,
            _light(light, sun),
            camera,
            shadows=shadows,
            samples=samples,
            supersample=smooth,
            background=background,
            progress=progress,
        )
    write(output, image, exposure, curve)
    typer.echo(str(output))


def write(output: Path, image: Any, exposure: float, curve: Curve) -> None:
    """Linear where the format holds radiance, tone-mapped where it holds what a screen shows."""
    import gonio as gn
    from gonio.rendering import tonemap

    if output.suffix.lower() == ".png":
        curves: dict[Curve, Callable[[Any], Any]] = {
            Curve.FILMIC: tonemap.Filmic(),
            Curve.REINHARD: tonemap.Reinhard(),
            Curve.LINEAR: tonemap.clipped,
        }
        image = gn.tone_map(image, curves[curve], exposure)
    gn.write_image(output, image)


def _shape(name: str, relief: float) -> tuple[Any, list[float], float]:
    """The shape, its centre and its radius."""
    import gonio as gn

    if name == "sphere":
        return gn.Sphere(), [0.0, 0.0, 0.0], 1.0
    shape: Any
    if name == "vase":
        from gonio.shapes.revolution import vase

        shape = vase()
    elif Path(name).suffix.lower() in (".exr", ".png", ".tif", ".tiff", ".pfm"):
        shape = gn.HeightField(relief * gn.read_image(name, encoding="linear")[..., 0])
    else:
        shape = gn.read_mesh(name)
    low, high = shape.bounds
    return shape, [float(c) for c in (low + high) / 2], float(((high - low) ** 2).sum() ** 0.5 / 2)


def _light(maps: list[Path], suns: list[str]) -> Light:
    import gonio as gn

    lights: list[Light] = [gn.read_environment(path) for path in maps]
    lights += [parse.directional(text) for text in suns]
    if not lights:
        from gonio.lights.studio import studio

        return studio()
    return lights[0] if len(lights) == 1 else gn.Lights(tuple(lights))
