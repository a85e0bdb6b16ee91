"""The command line: each verb parses, calls one public function, writes. The mathematics is imported inside the verbs.

Results on stdout (`--json` for machines), progress and warnings on stderr.
Exit 0 done, 1 did not converge, 2 bad use or input, 130 stopped by Ctrl-C. An error is one line, no traceback.
"""

from __future__ import annotations

import sys
import warnings
from typing import Any

import typer

from ..errors import GonioError
from . import (
    calibrate,
    convert,
    demo,
    flat,
    info,
    ingest,
    merge,
    ndf,
    normals,
    plan,
    precompute,
    prefilter,
    rectify,
    render,
    sh,
    share,
    simulate,
)

Usage: Any = typer.BadParameter.__base__  # click's error for whatever is mistyped, which typer does not name

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


for verb in (
    info.info,
    convert.convert,
    ingest.ingest,
    merge.merge,
    flat.flat,
    calibrate.calibrate,
    rectify.rectify,
    normals.normals,
    plan.plan,
    share.share,
    ndf.ndf,
    precompute.precompute,
    simulate.simulate,
    render.render,
    prefilter.prefilter,
    demo.demo,
):
    app.command(no_args_is_help=verb is not demo.demo)(verb)
app.add_typer(sh.app, name="sh")


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its code."""
    warnings.showwarning = _one_line
    try:
        code = app(arguments, standalone_mode=False) or 0
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    except Usage as error:
        code, message = error.exit_code, error.format_message()
        if message:  # none where nothing was typed: the help has been shown
            _say_error(message)
    except GonioError as error:
        code = 2
        _say_error(error)
    except MemoryError as error:
        code = 2
        _say_error(f"not enough memory: {error}. Ask for fewer pixels, rows or samples.")
    if code == 130:
        print("gonio: stopped", file=sys.stderr)
    sys.exit(code)


def _say_error(message: object) -> None:
    print(f"gonio: error: {message}", file=sys.stderr)


def _one_line(message: Warning | str, *_: Any, **__: Any) -> None:
    print(f"gonio: warning: {message}", file=sys.stderr)
