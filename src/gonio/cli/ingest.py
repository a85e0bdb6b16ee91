"""`gonio ingest`: a capture's photographs decoded once, so that all lights of a pixel stream from the disk."""

from __future__ import annotations

from pathlib import Path

import typer

from . import captures
from .progress import bar


def ingest(
    capture: Path = captures.FOLDER,
    partial: bool = captures.PARTIAL,
) -> None:
    """Decode the photographs of a capture into capture.zarr beside them; stopped, it goes on where it was."""
    from gonio.files.captures import photograph_files
    from gonio.files.store import STORE
    from gonio.files.store import ingest as store

    files = photograph_files(capture, partial=partial)
    path = files.folder / STORE
    with bar("ingest") as progress:
        store(files, path, progress)
    size = sum(part.stat().st_size for part in path.rglob("*") if part.is_file())
    typer.echo(f"{len(files.names)} photographs in {path}, {size / 1e6:.1f} MB")
