"""`gonio calibrate`: directions of lights from photographs of a mirror ball."""

from __future__ import annotations

import functools
import json
from pathlib import Path

import typer

from . import captures, parse


def calibrate(
    ball: Path = captures.FOLDER,
    output: Path = typer.Option(..., "--output", "-o", help="lights.lp"),
    of: Path | None = typer.Option(None, "--for", help="A capture under the same lights, whose photographs are named."),
    circle: str = typer.Option("", "--circle", help="The ball's outline, row,column,radius in pixels."),
    encoding: str = captures.ENCODING,
    partial: bool = captures.PARTIAL,
    picture: Path | None = typer.Option(None, "--picture", help="A PNG: ball, circle, highlights and lights."),
    as_json: bool = typer.Option(False, "--json", help="One JSON object a light, a line each."),
) -> None:
    """Find the direction of each light from its highlight on a mirror ball that is far from the camera."""
    import numpy as np

    import gonio as gn
    from gonio.capture import circles, mirror_ball
    from gonio.errors import ArrayError, FileError
    from gonio.files.whole import writable

    for path, suffix in ((output, ".lp"), (picture, ".png")):
        if path:
            writable(path, suffix)
    scene = captures.read(ball, encoding, partial)
    names = scene.photographs.names
    if of is not None:
        names = gn.read_capture(of, "linear", partial=partial).photographs.names
        if len(names) != len(scene.photographs):
            raise FileError(f"{of} has {len(names)} photographs, {ball} has {len(scene.photographs)}.")
    mean = functools.cache(scene.mean)  # reads every photograph: once, and only where it is wanted
    if circle:
        row, column, radius = parse.vector(circle)
        outline = circles.Circle((row, column), radius)
    elif not scene.mask.all():
        outline = circles.circle_of_mask(scene.mask)
    else:
        outline = circles.find_circle(mean())
    places = []
    for k, name in enumerate(scene.photographs.names):
        try:
            places.append(mirror_ball.highlight(scene.photographs.read(k).radiance, outline))
        except ArrayError as error:
            raise ArrayError(f"{ball}: {name}: {error}") from error
    highlights = np.array(places)
    directions = mirror_ball.light_directions(highlights, outline)
    gn.write_lp(output, names, directions)
    if picture:
        from gonio.viewer.captures import ball_picture

        ball_picture(picture, mean(), outline, highlights, directions)
    if as_json:
        for name, direction in zip(names, directions.tolist(), strict=True):
            typer.echo(json.dumps({"photograph": name, "direction": direction}))
        return
    row, column = outline.centre
    typer.echo(
        f"ball at row {row:.1f}, column {column:.1f}, radius {outline.radius:.1f} pixels, outline to "
        f"{outline.residual:.2f} pixels"
    )
    for name, (x, y, z) in zip(names, directions, strict=True):
        typer.echo(f"{name:>24}  {x:8.4f} {y:8.4f} {z:8.4f}   {np.degrees(np.arccos(z)):5.1f} degrees off the camera")
    typer.echo(str(output))
