"""`gonio prefilter`: an environment map blurred beforehand: for every roughness, or for one material and all views."""

from __future__ import annotations

import enum
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ..errors import FileError
from . import maps, parse

if TYPE_CHECKING:
    from ..rendering.lobes import Lobe

_TABLE = 128  # texels along the split-sum table


class Name(enum.StrEnum):
    """Lobes by name."""

    GGX = "ggx"
    PHONG = "phong"

    def lobe(self) -> Lobe:
        """The lobe itself."""
        from ..rendering import lobes

        return {Name.GGX: lobes.ggx, Name.PHONG: lobes.phong}[self]


def prefilter(
    source: list[Path] = typer.Argument(..., help="An environment map (or its two or six parts)."),
    output: Path = typer.Option(
        ..., "--output", "-o", help="chain.ktx2; or six faces a level: a folder, or m{level}_{face}.exr; or maps.gonio."
    ),
    brdf: list[str] = typer.Option(
        [], "--brdf", help="For maps.gonio: an SHRM of this material, written as for render. Repeat to add."
    ),
    size: int = typer.Option(256, "--size", min=1, help="Texels along a face of the sharpest level."),
    levels: int | None = typer.Option(None, "--levels", min=1, help="Levels; else down to faces of 8 texels."),
    lobe: Name = typer.Option(Name.GGX, "--lobe", help="What blurs the light."),
    error: float = typer.Option(0.01, "--error", help="Greatest rms error of a level, relative."),
    table: Path | None = typer.Option(None, "--table", help="Also the split-sum table of GGX: .ktx2 or .exr."),
    picture: Path | None = typer.Option(None, "--picture", help="A PNG to look at: all levels, or balls in the light."),
    layout: maps.Layout | None = typer.Option(
        None, "--layout", help="The map's layout, where its shape does not tell."
    ),
    orientation: str = typer.Option("", "--orientation", help="The tool whose convention the map follows."),
    to_orientation: str = typer.Option("", "--to-orientation", help="The tool that will read the faces."),
    as_json: bool = typer.Option(False, "--json", help="One JSON object a level, a line each."),
) -> None:
    """Blur an environment map for every roughness, for real-time engines; or for one material and all views."""
    if picture and picture.suffix.lower() != ".png":
        raise FileError(f"{picture}: the picture is a PNG; end its name in .png.")
    if brdf or output.suffix.lower() == ".gonio":
        _shrm(source, output, brdf, error, picture, layout, orientation, as_json)
        return
    from ..files.ktx2 import require_chain_writable, write_chain, write_split_sum
    from ..files.whole import writable
    from ..rendering.chain import roughness_chain
    from ..rendering.split_sum import split_sum

    reader = maps.named(to_orientation)
    require_chain_writable(output, reader)
    if table:
        if table.suffix.lower() not in (".ktx2", ".exr"):
            raise FileError(f"{table}: the table is written as .ktx2 or .exr.")
        writable(table)
    environment = maps.read(source, layout, orientation)
    typer.echo(f"{source[0]}: {maps.stands(environment)}", err=True)
    chain = roughness_chain(environment, size, levels, lobe.lobe(), error)
    write_chain(output, chain, reader)
    if table:
        write_split_sum(table, split_sum(_TABLE))
    if picture:
        _show(picture, chain.picture())
    rows = zip(chain.sizes, chain.roughness, chain.alphas, chain.degrees, chain.errors, strict=True)
    if not as_json:
        typer.echo("level   size  roughness   alpha  degree  error")
    for k, (texels, roughness, alpha, degree, off) in enumerate(rows):
        if as_json:
            facts = {"size": texels, "roughness": roughness, "alpha": alpha, "degree": degree, "error": off}
            typer.echo(json.dumps({"level": k, **facts}))
        else:
            typer.echo(f"{k:5} {texels:6} {roughness:10.3f} {alpha:7.4f} {degree:7} {off:.1e}")


def _shrm(
    source: list[Path],
    output: Path,
    brdf: list[str],
    error: float,
    picture: Path | None,
    layout: maps.Layout | None,
    orientation: str,
    as_json: bool,
) -> None:
    """An SHRM, RH 5.4, as a .gonio."""
    import dataclasses

    import gonio as gn
    from gonio.files.whole import writable

    if output.suffix.lower() != ".gonio":
        raise FileError(f"{output}: maps of a material are written as .gonio.")
    if not brdf:
        raise FileError(f"{output}: maps of a material want one: --brdf, as for gonio render.")
    writable(output)
    material = parse.reflectance(brdf)
    environment = maps.read(source, layout, orientation)
    typer.echo(f"{source[0]}: {maps.stands(environment)}", err=True)
    shrm = gn.prefilter(environment, material, error)
    made = f"gonio prefilter {source[0]} " + " ".join(f"--brdf {term}" for term in brdf) + f" --error {error:g}"
    gn.write_shrm(output, dataclasses.replace(shrm, made=f"{made} (gonio {gn.__version__})"))
    if picture:
        from gonio.rendering.prefiltered import balls

        _show(picture, balls(shrm, environment))
    lobes = [{"about": lobe.about.value, "F": lobe.degree, "P": lobe.exit_degree} for lobe in shrm.lobes]
    if as_json:
        typer.echo(json.dumps({"error": shrm.error, "lobes": lobes}))
    else:
        for lobe in lobes:
            typer.echo(f"about the {lobe['about']} direction: F = {lobe['F']}, P = {lobe['P']}")
        typer.echo(f"error {shrm.error:.2g}, rms of pictures of a ball")


def _show(path: Path, image: Any) -> None:
    """Write an image exposed for its own brightness."""
    import numpy as np

    import gonio as gn

    gn.write_image(path, gn.tone_map(np.broadcast_to(image, (*image.shape[:2], 3)), exposure=None))
