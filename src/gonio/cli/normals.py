"""`gonio normals`: normals, albedo and heights of a matte object from photographs under known lights."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import typer

from . import captures
from .progress import bar


def normals(
    capture: Path = captures.FOLDER,
    output: Path = typer.Option(..., "--output", "-o", help="A folder for normals.png, relief.exr and relief.png."),
    lights: Path | None = typer.Option(None, "--lights", help="An .lp to use instead: its lights in the same order."),
    white: Path | None = typer.Option(None, "--white", help="A capture of a flat white target under the same lights."),
    falloff: bool = typer.Option(False, "--falloff", help="Of each light over the white target, LED by LED, too."),
    strengths: bool = typer.Option(False, "--strengths", help="How bright each light is is unknown: find it too."),
    encoding: str = captures.ENCODING,
    partial: bool = captures.PARTIAL,
    plain: bool = typer.Option(False, "--plain", help="Least squares of all photographs, shadows and highlights too."),
    as_json: bool = typer.Option(False, "--json", help="One JSON object."),
) -> None:
    """Photometric stereo: normals, albedo, how well they are known, and the heights that have these normals."""
    import numpy as np

    import gonio as gn
    from gonio.capture.near_stereo import heights_of, near_photometric_stereo
    from gonio.errors import ParameterError
    from gonio.files.whole import writable
    from gonio.viewer.captures import relief_picture

    if falloff and not white:
        raise ParameterError("--falloff is told from a white target: give --white.")
    scene = captures.read(capture, encoding, partial, lights)
    if white:
        from gonio.capture.white import lights_of_white

        target = dataclasses.replace(captures.read(white, encoding, partial), lights=scene.lights)
        scene = dataclasses.replace(scene, lights=lights_of_white(target, falloff=falloff))
    if strengths:
        from gonio.capture.semicalibrated import estimate_strengths

        told = estimate_strengths(scene)
        if told.converged:
            scene = dataclasses.replace(scene, lights=told.lights)
        else:
            typer.echo(f"{capture}: strengths of lights are left as they were told: {told.reason}", err=True)
    output.mkdir(parents=True, exist_ok=True)
    names = ("normals.png", "relief.exr", "relief.png")
    for name in names:
        writable(output / name)
    near = any(not light.distant for light in scene.lights or ())
    with bar("normals") as progress:
        if near:
            together = near_photometric_stereo(scene, not plain, progress)
            relief, surface = together.relief, together.surface
        else:
            relief = gn.photometric_stereo(scene, robust=not plain, progress=progress)
            surface = heights_of(relief)
    found = np.isfinite(surface.heights)
    codes = np.where(found[..., None], 0.5 * relief.normals + 0.5, 0.0)
    gn.write_image(output / "normals.png", codes, "linear", bits=16, clip=True)
    layers = {"normals": relief.normals, "albedo": relief.albedo, "residual": relief.residual, "error": relief.error}
    gn.write_layers(output / "relief.exr", {**layers, "heights": surface.heights})
    relief_picture(output / "relief.png", relief, surface.heights)
    facts = {
        "photographs": len(scene.photographs),
        "pixels": int(found.sum()),
        "residual": float(np.median(relief.residual[found])),
        "standard error, degrees": float(np.degrees(np.median(relief.error[found]))),
        "heights": surface.reason,
        **({"near lights": together.reason} if near else {}),
    }
    if scene.normals is not None:
        both = found & scene.mask
        cosine = np.sum(relief.normals[both] * scene.normals[both], axis=1).clip(-1, 1)
        off = np.degrees(np.arccos(cosine))
        facts["degrees from the given normals"] = float(np.median(off))
        facts["mean of them"] = float(off.mean())
    if as_json:
        typer.echo(json.dumps(facts))
    else:
        for name, value in facts.items():
            typer.echo(f"{name:>36}  {value:.4g}" if isinstance(value, float) else f"{name:>36}  {value}")
        typer.echo(f"{', '.join(names)} in {output}")
    if not surface.converged or (near and not together.converged):
        raise typer.Exit(1)
