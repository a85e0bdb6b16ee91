"""Captures as the verbs take them: a folder, how its codes stand for light, whether some of it may be missing."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ..errors import FileError, ParameterError

if TYPE_CHECKING:
    from ..capture.model import Capture

FOLDER = typer.Argument(..., help="A folder of photographs: RTI (.lp), DiLiGenT, capture.toml, or numbered images.")
ENCODING = typer.Option("", "--encoding", help="How codes stand for light: srgb, linear, or a power; else as stated.")
PARTIAL = typer.Option(False, "--partial", help="Take what is sound where photographs or lines are missing.")


def read(folder: Path, encoding: str, partial: bool, lights: Path | None = None) -> Capture:
    """The capture, with the lights of an .lp in the place of its own; what was found amiss is said on stderr."""
    import gonio as gn

    capture = gn.read_capture(folder, _encoding(encoding), partial=partial)
    for finding in capture.findings:
        typer.echo(f"{folder}: {finding}", err=True)
    if lights is None:
        return capture
    given = gn.read_lp(lights)
    if len(given.names) != len(capture.photographs):
        raise FileError(f"{lights} has {len(given.names)} lights for {len(capture.photographs)} photographs.")
    return dataclasses.replace(capture, directions=given.directions)


def _encoding(text: str) -> str | float | None:
    if text in ("", "srgb", "linear"):
        return text or None
    try:
        return float(text)
    except ValueError:
        raise ParameterError(f"--encoding {text}: srgb, linear, or a power such as 2.2 is wanted.") from None
