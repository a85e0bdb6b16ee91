"""The command line: each verb parses, calls one public function, writes. The mathematics is imported inside the verbs.

Results on stdout (`--json` for machines), progress and warnings on stderr.
Exit 0 done, 1 did not converge, 2 bad use or input, 130 stopped by Ctrl-C. An error is one line, no traceback.
"""

from __future__ import annotations

import functools
import sys
import warnings
from collections.abc import Callable
from typing import Any

import typer

from ..errors import GonioError
from . import convert, demo, info, render

app = typer.Typer(
    help="From photographs of a known shape to reflectance and light that you can render.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def version(asked: bool) -> None:
    """Print the version and leave, where asked."""
    if asked:
        from gonio import __version__

        typer.echo(f"gonio {__version__}")
        raise typer.Exit


@app.callback()
def gonio(
    _version: bool = typer.Option(False, "--version", callback=version, is_eager=True, help="Print the version."),
) -> None:
    """From photographs of a known shape to reflectance and light that you can render."""


def guarded(verb: Callable[..., None]) -> Callable[..., None]:
    """`verb`, with its refusals turned into one line and an exit code."""

    @functools.wraps(verb)
    def run(**arguments: Any) -> None:
        try:
            verb(**arguments)
        except GonioError as error:
            print(f"gonio: error: {error}", file=sys.stderr)
            raise typer.Exit(2) from None
        except KeyboardInterrupt:
            print("gonio: stopped", file=sys.stderr)
            raise typer.Exit(130) from None

    return run


for verb in (info.info, convert.convert, render.render, demo.demo):
    app.command(no_args_is_help=verb is not demo.demo)(guarded(verb))


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its code."""
    warnings.showwarning = _one_line
    app(arguments)


def _one_line(message: Warning | str, *_: Any, **__: Any) -> None:
    print(f"gonio: warning: {message}", file=sys.stderr)
