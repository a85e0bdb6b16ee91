"""`gonio sh`: the light's nine harmonic coefficients, in the numbers of renderers."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from . import maps

if TYPE_CHECKING:
    from ..files.engine_harmonics import Engine

app = typer.Typer(help="Nine harmonic coefficients of the light, as renderers store them.", no_args_is_help=True)


class Name(enum.StrEnum):
    """Renderers by name."""

    GONIO = "gonio"
    THREE_JS = "three.js"
    FILAMENT = "filament"
    UNITY = "unity"
    UNREAL = "unreal"
    GODOT = "godot"

    def engine(self) -> Engine:
        """The renderer's convention."""
        from ..files.engine_harmonics import ENGINES

        return ENGINES[self.value]


@app.command(no_args_is_help=True)
def convert(
    source: Path = typer.Argument(..., help="A .json of nine rows (r, g, b), or Filament's sh.txt."),
    to: Name = typer.Option(..., "--to", help="Who will read the numbers."),
    output: Path = typer.Option(..., "--output", "-o", help=".json, or .txt for Filament."),
    origin: Name | None = typer.Option(None, "--from", help="Whose numbers they are, where the file does not tell."),
) -> None:
    """Convert coefficients from one renderer's order, signs, axes and scale to another's."""
    from ..files.engine_harmonics import read_sh, write_sh

    write_sh(output, read_sh(source, origin.engine() if origin else None), to.engine())
    typer.echo(str(output))


@app.command(no_args_is_help=True)
def project(
    source: list[Path] = typer.Argument(..., help="An environment map (or its two or six parts)."),
    to: Name = typer.Option(Name.GONIO, "--to", help="Who will read the numbers."),
    output: Path | None = typer.Option(None, "--output", "-o", help=".json, or .txt for Filament; else stdout."),
    layout: maps.Layout | None = typer.Option(None, "--layout", help="Its layout, where its shape does not tell."),
    orientation: str = typer.Option("", "--orientation", help="The tool whose convention it follows."),
    as_json: bool = typer.Option(False, "--json", help="On stdout, the JSON that a file would hold."),
) -> None:
    """Nine coefficients of an environment map."""
    from ..files import engine_harmonics

    environment = maps.read(source, layout, orientation)
    typer.echo(f"{source[0]}: {maps.stands(environment)}", err=True)
    light = environment.harmonics(2)
    if output:
        engine_harmonics.write_sh(output, light, to.engine())
    if as_json:
        typer.echo(engine_harmonics.as_json(light, to.engine()), nl=False)
    elif output:
        typer.echo(str(output))
    else:
        numbers = engine_harmonics.to_engine(light, to.engine())
        for name, row in zip(engine_harmonics.NAMES, numbers, strict=True):
            typer.echo(f"{name:<5} " + " ".join(f"{number:12.6g}" for number in row))
