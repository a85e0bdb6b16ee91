"""`gonio convert`: images from format to format, and environment maps from layout to layout."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import typer

from . import maps
from .render import Curve, shown, write


def convert(
    source: list[Path] = typer.Argument(..., help="An image or environment map (or its two or six parts)."),
    output: Path = typer.Option(..., "--output", "-o", help="Where to; sky_{face}.exr writes the six faces of a cube."),
    to: maps.Layout | None = typer.Option(None, "--to", help="Layout of the map that is written."),
    layout: maps.Layout | None = typer.Option(
        None, "--from", help="Layout of the map read, where its shape does not tell."
    ),
    orientation: str = typer.Option("", "--orientation", help="The tool whose convention the map read follows."),
    to_orientation: str = typer.Option("", "--to-orientation", help="The tool that will read the map written."),
    rows: int | None = typer.Option(None, "--rows", min=1, help="Rows of the map written; else as fine as the source."),
    exposure: float = typer.Option(0.0, "--exposure", help="Stops, where the output is PNG."),
    curve: Curve = typer.Option(Curve.FILMIC, "--curve", help="Tone curve, where the output is PNG."),
) -> None:
    """Convert an image's format, or (with --to) an environment map's layout and orientation."""
    import gonio as gn
    from gonio.files.environments import as_picture, is_pattern, strip_for
    from gonio.files.images import require_writable

    if not (faces := is_pattern(output)):
        require_writable(output)
    plain = len(source) == 1 and not faces and not is_pattern(source[0])
    if plain and to is None and layout is None and not orientation and not to_orientation and rows is None:
        write(output, gn.read_image(source[0]), exposure, curve)
        typer.echo(str(output))
        return
    environment = maps.read(source, layout, orientation)
    reader = maps.named(to_orientation)
    mapping = to.mapping() if to else strip_for(reader) if faces else None
    written = as_picture(environment, mapping, reader, rows)
    picture = dataclasses.replace(written, image=shown(output, written.image, exposure, curve))
    gn.write_environment(output, picture, picture.mapping, picture.orientation)
    typer.echo(f"{output}  {maps.stands(environment)} -> {maps.stands(written)}")
