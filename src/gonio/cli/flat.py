"""`gonio flat`: what a lens leaves of light towards the corners, from a photograph of an even white target."""

from __future__ import annotations

from pathlib import Path

import typer

from ..errors import FileError, ParameterError
from . import captures
from .merge import RESPONSE, warn_assumed


def flat(
    white: Path = typer.Argument(..., help="A photograph of an even white target, or its merged exposures (.exr)."),
    output: Path = typer.Option(..., "--output", "-o", help="vignetting.exr"),
    response: Path | None = RESPONSE,
    encoding: str = captures.ENCODING,
) -> None:
    """Fit a lens's vignetting, a map that photographs of the same lens, focus and aperture are divided by."""
    import gonio as gn
    from gonio.capture.exposure import flat_field
    from gonio.files.brackets import BracketFiles
    from gonio.files.images import CLIPPED_SHARE, require_writable
    from gonio.files.responses import read_response

    if output.suffix.lower() != ".exr":
        raise FileError(f"{output}: end its name in .exr.")
    require_writable(output)
    if response and encoding:
        raise ParameterError("--response and --encoding each say what codes mean: give one of them.")
    if gn.image_info(white).dtype.startswith("float"):
        if response:
            raise ParameterError(f"{white} is of floats, which have no codes: leave --response out.")
        image = gn.read_image(white, captures.curve(encoding))
    else:
        curve = read_response(response) if response else captures.curve(encoding)
        single = BracketFiles(Path(), [[str(white)]], [1.0], curve)
        warn_assumed(single, white)
        image, clipped = single.read(0)
        if clipped.mean() > CLIPPED_SHARE:
            raise FileError(f"{white}: {clipped.mean():.2%} of its pixels are clipped. Expose it less.")
    try:
        vignetting = flat_field(image)
    except gn.GonioError as error:
        raise FileError(f"{white}: {error}") from error
    gn.write_image(output, vignetting)
    corners = vignetting[:: len(vignetting) - 1, :: vignetting.shape[1] - 1].mean(axis=(0, 1))
    typer.echo(f"{output}: corners keep {' '.join(f'{c:.3f}' for c in corners)} of the light (R G B)")
