"""`gonio convert`: images from format to format, and environment maps from layout to layout."""

from __future__ import annotations

import dataclasses
import enum
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ..errors import ParameterError
from .render import Curve, shown, write

if TYPE_CHECKING:
    from ..lights.environment import Environment
    from ..lights.mappings import Mapping
    from ..lights.orientation import Orientation


class Layout(enum.StrEnum):
    """Layouts of environment maps by name."""

    LATLONG = "latlong"
    ANGULAR = "angular"
    BALL = "ball"
    PARABOLOID = "paraboloid"
    CROSS = "cross"
    CROSS_WIDE = "cross-wide"
    STRIP = "strip"
    STRIP_WIDE = "strip-wide"

    def mapping(self) -> Mapping:
        """The layout itself."""
        import gonio as gn

        return {
            Layout.LATLONG: gn.LatLongMap(),
            Layout.ANGULAR: gn.AngularMap(),
            Layout.BALL: gn.MirrorBall(),
            Layout.PARABOLOID: gn.DualParaboloid(),
            Layout.CROSS: gn.CubeCross(vertical=True),
            Layout.CROSS_WIDE: gn.CubeCross(vertical=False),
            Layout.STRIP: gn.CubeStrip(vertical=True),
            Layout.STRIP_WIDE: gn.CubeStrip(vertical=False),
        }[self]


def convert(
    source: list[Path] = typer.Argument(..., help="An image or environment map (or its two or six parts)."),
    output: Path = typer.Option(..., "--output", "-o", help="Where to; sky_{face}.exr writes the six faces of a cube."),
    to: Layout | None = typer.Option(None, "--to", help="Layout of the map that is written."),
    layout: Layout | None = typer.Option(None, "--from", help="Layout of the map read, where its shape does not tell."),
    orientation: str = typer.Option("", "--orientation", help="The tool whose convention the map read follows."),
    to_orientation: str = typer.Option("", "--to-orientation", help="The tool that will read the map written."),
    rows: int | None = typer.Option(None, "--rows", min=1, help="Rows of the map written; else as fine as the source."),
    exposure: float = typer.Option(0.0, "--exposure", help="Stops, where the output is PNG."),
    curve: Curve = typer.Option(Curve.FILMIC, "--curve", help="Tone curve, where the output is PNG."),
) -> None:
    """Convert an image's format, or (with --to) an environment map's layout and orientation."""
    import gonio as gn
    from gonio.files.environments import as_picture, is_pattern, strip_for

    faces = is_pattern(output)
    plain = len(source) == 1 and not faces and not is_pattern(source[0])
    if plain and to is None and layout is None and not orientation and not to_orientation and rows is None:
        write(output, gn.read_image(source[0]), exposure, curve)
        typer.echo(str(output))
        return
    environment = gn.read_environment(
        source[0] if len(source) == 1 else source, layout.mapping() if layout else None, named(orientation)
    )
    stands = named(to_orientation)
    mapping = to.mapping() if to else strip_for(stands) if faces else None
    written = as_picture(environment, mapping, stands, rows)
    picture = dataclasses.replace(written, image=shown(output, written.image, exposure, curve))
    gn.write_environment(output, picture, picture.mapping, picture.orientation)
    typer.echo(f"{output}  {_stands(environment)} -> {_stands(written)}")


def _stands(environment: Environment) -> str:
    return f"{type(environment.mapping).__name__} {environment.orientation.name}"


def named(orientation: str) -> Orientation | None:
    """The published orientation of that name; None for none."""
    if not orientation:
        return None
    from gonio.lights.orientation import PUBLISHED

    key = orientation.upper().replace("-", "_").replace(".", "_")
    if key not in PUBLISHED:
        known = ", ".join(name.lower().replace("_", "-") for name in PUBLISHED)
        raise ParameterError(f"'{orientation}' is no published orientation; those are {known}.")
    return PUBLISHED[key]
