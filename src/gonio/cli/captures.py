"""Captures as the verbs take them: a folder, how its codes stand for light, whether some of it may be missing."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ..errors import FileError, ParameterError
from .progress import bar

if TYPE_CHECKING:
    from ..capture.model import Capture

FOLDER = typer.Argument(..., help="A folder of photographs: RTI (.lp), DiLiGenT, capture.toml, or numbered images.")
ENCODING = typer.Option("", "--encoding", help="How codes stand for light: srgb, linear, or a power; else as stated.")
PARTIAL = typer.Option(False, "--partial", help="Take what is sound where photographs or lines are missing.")


def read(folder: Path, encoding: str, partial: bool, lights: Path | None = None) -> Capture:
    """The capture, with the lights of an .lp in the place of its own; what was found amiss is said on stderr.

    Raises `FileError` where its photographs are from many places.
    """
    import gonio as gn

    capture = gn.read_capture(folder, curve(encoding), partial=partial)
    for finding in capture.findings:
        typer.echo(f"{folder}: {finding}", err=True)
    if not isinstance(capture, gn.Capture):
        raise FileError(f"{folder} is of photographs from many places; photographs from one place are wanted.")
    if lights is None:
        return capture
    given = gn.read_lp(lights)
    if len(given.names) != len(capture.photographs):
        raise FileError(f"{lights} has {len(given.names)} lights for {len(capture.photographs)} photographs.")
    return dataclasses.replace(capture, lights=gn.distant_lights(given.directions))


def shaped(scene: Capture, kept: list[int] | None = None) -> Capture:
    """The capture with normals by photometric stereo of the photographs `kept`, of all where those are too few."""
    import numpy as np

    import gonio as gn

    some = scene
    if kept is not None and len(kept) < len(scene.photographs):
        if len(kept) > 3:
            some = scene.select(kept)
        else:
            typer.echo("normals are of all photographs: those that are kept are too few", err=True)
    with bar("normals") as progress:
        relief = gn.photometric_stereo(some, progress=progress)
    found = np.isfinite(relief.error) & (relief.normals[..., 2] > 0.05)
    return dataclasses.replace(scene, normals=np.where(found[..., None], relief.normals, 0), mask=found)


def curve(text: str) -> str | float | None:
    """What `--encoding` says, None where it is not given."""
    if text in ("", "srgb", "linear"):
        return text or None
    try:
        return float(text)
    except ValueError:
        raise ParameterError(f"--encoding {text}: srgb, linear, or a power such as 2.2 is wanted.") from None
