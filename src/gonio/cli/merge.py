"""`gonio merge`: the exposures of one bracket merged into radiance, and the camera's response that they tell."""

from __future__ import annotations

import json
import warnings
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ..errors import EncodingWarning, FileError, ParameterError
from . import captures, parse

if TYPE_CHECKING:
    from ..capture.exposure import Noise, Response
    from ..files.brackets import BracketFiles

RESPONSE = typer.Option(None, "--response", help="The camera's response, a file of gonio merge --recover.")


def merge(
    files: list[Path] = typer.Argument(..., help="Photographs of one still scene, exposed differently."),
    output: Path = typer.Option(..., "--output", "-o", help="radiance.exr"),
    times: str = typer.Option("", "--times", help="Seconds, as 1/250,1/60,0.3; else as their EXIF says."),
    response: Path | None = RESPONSE,
    encoding: str = captures.ENCODING,
    recover: Path | None = typer.Option(None, "--recover", help="Find the response and write it here, a .toml."),
    vignetting: Path | None = typer.Option(None, "--vignetting", help="A map of gonio flat that radiance is over."),
    noise: str = typer.Option("", "--noise", help="gain,read of the sensor, in full scales; else 5e-5,1e-3."),
    picture: Path | None = typer.Option(None, "--picture", help="A PNG: response, radiance, standard deviation."),
    as_json: bool = typer.Option(False, "--json", help="One JSON object."),
) -> None:
    """Merge exposures into radiance per second, with its standard deviation and what is saturated as layers."""
    import numpy as np

    import gonio as gn
    from gonio.files.brackets import BracketFiles
    from gonio.files.responses import read_response, write_response
    from gonio.files.whole import writable

    if sum(map(bool, (response, encoding, recover))) > 1:
        raise ParameterError("--response, --encoding and --recover each say what codes mean: give one of them.")
    for path, suffix in ((output, ".exr"), (recover, ".toml"), (picture, ".png")):
        if path:
            writable(path, suffix)
    seconds, note = _seconds(times, files)
    sensor = _noise(noise)
    divisor = gn.read_image(vignetting) if vignetting else None
    if recover:
        curve: Response | str | float | None = _recovered(files, seconds)
    else:
        curve = read_response(response) if response else captures.curve(encoding)
    brackets = BracketFiles(Path(), [[str(path) for path in files]], seconds, curve, sensor, divisor)
    warn_assumed(brackets, files[0])
    merged = brackets.merged(0)
    deviation = np.sqrt(merged.variance)
    layers = {"RGB": merged.radiance, "deviation": deviation, "saturated": merged.saturated}
    gn.write_layers(output, layers)
    if recover:
        write_response(recover, brackets.response)
    if picture:
        from gonio.viewer.exposures import merged_picture

        merged_picture(picture, merged, brackets.response)
    known = ~merged.saturated & (merged.radiance > 0).all(axis=2)
    facts: dict[str, object] = {
        "exposures": len(files),
        "times": list(seconds),
        "times from": "--times" if times else f"EXIF{'; ' + note if note else ''}",
        "saturated": float(merged.saturated.mean()),
        "relative deviation": float(np.median(deviation[known] / merged.radiance[known])) if known.any() else None,
    }
    if recover:
        facts["residual of the response"] = brackets.response.residual
    if as_json:
        typer.echo(json.dumps(facts))
        return
    typer.echo(f"{len(files)} exposures, {', '.join(f'{t:.4g}' for t in seconds)} s ({facts['times from']})")
    typer.echo(f"{merged.saturated.mean():.3%} of the pixels saturated in all of them")
    if known.any():
        typer.echo(f"{facts['relative deviation']:.2%} standard deviation of the radiance, in the median")
    if recover:
        typer.echo(f"{recover}: the response, {brackets.response.residual:.2%} rms off the exposures")
    typer.echo(f"{output}: layers RGB, deviation, saturated")


def warn_assumed(brackets: BracketFiles, path: Path) -> None:
    """Say that codes were taken for sRGB, where nothing states what they mean."""
    if brackets.assumed:
        warnings.warn(
            f"{path} does not say how its codes stand for light; taken for sRGB. Say --encoding or --response, or let "
            "gonio merge --recover find it from a bracket.",
            EncodingWarning,
            stacklevel=2,
        )


def _recovered(files: list[Path], seconds: tuple[float, ...]) -> Response:
    """The response that codes as stored tell."""
    import numpy as np

    import gonio as gn
    from gonio.capture.exposure import recover_response
    from gonio.files.images import read_raster

    codes = [read_raster(path).samples for path in files]
    for path, one in zip(files, codes, strict=True):
        if (one.shape, one.dtype) != (codes[0].shape, codes[0].dtype):
            raise FileError(
                f"{path} has shape {one.shape} and dtype {one.dtype}, {files[0]} {codes[0].shape} and "
                f"{codes[0].dtype}: photographs of a bracket are alike."
            )
    try:
        return recover_response(np.stack(codes), np.array(seconds))
    except gn.GonioError as error:
        raise FileError(f"{files[0]} ... {files[-1].name}: {error}") from error


def _seconds(text: str, files: list[Path]) -> tuple[tuple[float, ...], str]:
    """Seconds of each file as typed, or by EXIF, and what is to be said of them."""
    if not text:
        from gonio.files.exif import exposures

        return exposures(files)
    try:
        seconds = tuple(float(Fraction(part.strip())) for part in text.split(","))
    except (ValueError, ZeroDivisionError, OverflowError):
        raise ParameterError(f"--times {text}: seconds such as 1/250,1/60,0.3 are wanted.") from None
    if len(seconds) != len(files):
        raise ParameterError(f"--times {text} has {len(seconds)} times for {len(files)} photographs.")
    if not all(t > 0 for t in seconds):
        raise ParameterError(f"--times {text}: seconds above 0 are wanted.")
    return seconds, ""


def _noise(text: str) -> Noise | None:
    from gonio.capture.exposure import Noise

    if not text:
        return None
    values = parse.numbers(text)
    if len(values) != 2:
        raise ParameterError(f"--noise {text} has {len(values)} numbers; gain,read is wanted.")
    return Noise(*values)
