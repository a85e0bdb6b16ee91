"""The command line: each verb parses, calls one public function, writes. The mathematics is imported inside the verbs.

Results on stdout (`--json` for machines), progress and warnings on stderr.
Exit 0 done, 1 did not converge, 2 bad use or input, 130 stopped by Ctrl-C. An error is one line, no traceback.
"""

from __future__ import annotations

import sys
import warnings
from typing import Any

import click
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
    if asked:
        from gonio import __version__

        typer.echo(f"gonio {__version__}")
        raise typer.Exit


@app.callback()
def gonio(
    _version: bool = typer.Option(False, "--version", callback=version, is_eager=True, help="Print the version."),
) -> None:
    """From photographs of a known shape to reflectance and light that you can render."""


for verb in (info.info, convert.convert, render.render, demo.demo):
    app.command(no_args_is_help=verb is not demo.demo)(verb)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its code."""
    warnings.showwarning = _one_line
    try:
        code = app(arguments, standalone_mode=False)
    except GonioError as error:
        code = _refuse(str(error))
    except click.ClickException as error:
        error.show(sys.stderr)
        code = 2
    except (click.Abort, KeyboardInterrupt):
        print("gonio: stopped", file=sys.stderr)
        code = 130
    except BrokenPipeError:  # the reader of our output has gone (gonio info ... | head)
        code = 0
    sys.exit(code or 0)


def _refuse(message: str) -> int:
    print(f"gonio: error: {message}", file=sys.stderr)
    return 2


def _one_line(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    print(f"gonio: warning: {message}", file=sys.stderr)
