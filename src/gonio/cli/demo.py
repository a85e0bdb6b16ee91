"""`gonio demo`: a tour of what gonio does, on data that it makes itself, ending in one page of pictures."""

from __future__ import annotations

from pathlib import Path

import typer

from .progress import bar


def demo(
    folder: Path = typer.Argument(Path("gonio-demo"), help="Where the pictures and the page go."),
) -> None:
    """Render, measure and prefilter with gonio's own data, and leave one page of pictures to look at."""
    from ..viewer.tour import tour

    with bar("demo") as progress:
        page = tour(folder, progress)
    typer.echo(f"Look at {page}")
