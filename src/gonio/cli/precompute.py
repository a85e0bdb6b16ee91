"""`gonio precompute`: what `gonio share` found, as a file that is relit in real time under any distant light."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from . import maps, parse
from .progress import bar

if TYPE_CHECKING:
    import numpy as np

    from ..lights.model import Light
    from ..rendering.precomputed import Precomputed
    from ..rendering.relight import Relightable


def precompute(
    thing: Path = typer.Argument(..., help="A .gonio of gonio share."),
    output: Path = typer.Option(..., "--output", "-o", help="fast.gonio, which gonio render relights."),
    error: float = typer.Option(0.02, "--error", help="Of the images, rms over theirs, under white noise for light."),
    side: int = typer.Option(16, "--side", help="Cells of light along the edge of a cube: 90/side degrees each."),
    block: int = typer.Option(8, "--block", help="Pixels along the side of a block."),
    shadows: bool = typer.Option(True, "--shadows/--no-shadows", help="Those the shape casts, where it is known."),
    samples: int | None = typer.Option(
        None, "--samples", help="Directions along a cell's side; else as the material's lobes need."
    ),
    light: list[Path] = typer.Option([], "--light", help="An environment map for the picture; repeat for more rows."),
    layout: maps.Layout | None = typer.Option(None, "--layout", help="Its layout, where its shape does not tell."),
    orientation: str = typer.Option("", "--orientation", help="The tool whose convention it follows."),
    sun: list[str] = typer.Option([], "--sun", help="A directional light x,y,z[:irradiance] for the picture."),
    picture: Path | None = typer.Option(
        None, "--picture", help="A PNG: the full model, what the file shows, ten times the difference; a row a light."
    ),
    as_json: bool = typer.Option(False, "--json", help="One JSON object."),
) -> None:
    """Make the images of a view under all distant light, compressed to the error asked for."""
    import gonio as gn
    from gonio.files.precomputed import write_precomputed
    from gonio.files.whole import writable
    from gonio.rendering.precomputing import precompute as compressed

    for path, suffix in ((output, ".gonio"), (picture, ".png")):
        if path:
            writable(path, suffix)
    seen = gn.read_relightable(thing)
    lights = _lights(light, layout, orientation, sun)
    with bar("precompute") as progress:
        made = compressed(
            seen, error=error, side=side, block=block, shadows=shadows, samples=samples, progress=progress
        )
    words = f"gonio precompute {thing.name} --error {error:g} --side {side} (gonio {gn.__version__})"
    made = dataclasses.replace(made, made=words)
    write_precomputed(output, made)
    facts: dict[str, Any] = {
        "error": made.error,
        "lights": made.lights.shape[1],
        "images of a block": float(made.ranks.mean()),
        "bytes": output.stat().st_size,
    }
    if picture:
        image, off = _compared(seen, made, lights or {"studio": gn.studio(64)}, shadows)
        gn.write_image(picture, image)
        facts |= {f"off under {name}": value for name, value in off.items()}
    if as_json:
        typer.echo(json.dumps(facts))
        return
    for name, value in facts.items():
        typer.echo(f"{value:12.4g}  {name}" if isinstance(value, float) else f"{value:12}  {name}")
    typer.echo(str(output))


def _lights(files: list[Path], layout: maps.Layout | None, orientation: str, suns: list[str]) -> dict[str, Light]:
    found: dict[str, Light] = {path.name: maps.read([path], layout, orientation) for path in files}
    return found | {text: parse.directional(text) for text in suns}


def _compared(
    seen: Relightable, made: Precomputed, lights: dict[str, Light], shadows: bool
) -> tuple[np.ndarray, dict[str, float]]:
    """A row for each light, in display colours, and the relative rms difference under it."""
    import numpy as np

    import gonio as gn
    from gonio.rendering.tonemap import clipped

    rows, off = [], {}
    with bar("full model") as progress:
        for k, (name, light) in enumerate(lights.items()):
            truth, image = gn.relight(seen, light, 4 * len(made.cells), shadows=shadows), made.relight(light)
            square = float(np.mean(truth**2))
            off[name] = float(np.sqrt(np.mean((image - truth) ** 2) / square)) if square > 0 else 0.0
            lit = truth[truth > 0]
            scale = 0.8 / float(np.quantile(lit, 0.98)) if lit.size else 1.0
            panels = np.concatenate((truth, image, 10 * np.abs(image - truth)), axis=1)
            rows.append(gn.tone_map(panels * scale, clipped))
            progress(k + 1, len(lights))
    return np.concatenate(rows), off
