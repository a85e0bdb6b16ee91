"""`gonio share`: the reflectance of an object from a handful of photographs, tried on those that are left out."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from . import captures, parse
from .progress import bar

if TYPE_CHECKING:
    import numpy as np

    from ..capture.model import Capture
    from ..fitting.sharing import Scales
    from ..rendering.relight import Relightable


def share(
    capture: Path = captures.FOLDER,
    output: Path = typer.Option(..., "--output", "-o", help="thing.gonio, which gonio render relights."),
    centres: int = typer.Option(2000, "--centres", min=8, help="Of the radial functions, at most."),
    error: float = typer.Option(
        0.0, "--error", min=0, help="Stop when log f is fitted to this, rms; exit 1 if it never is."
    ),
    leave: str = typer.Option("", "--leave", help="Photographs to leave out and predict: 0,5,9."),
    homogeneous: bool = typer.Option(False, "--homogeneous", help="One BRDF everywhere."),
    texture: bool = typer.Option(False, "--texture", help="A colour for each pixel, times what is shared."),
    scales: str = typer.Option("", "--scales", help="m_xy,m_w[,rho]; else found by leaving photographs out."),
    paper: bool = typer.Option(
        False, "--paper", help="As the paper: interpolate f itself over v, not fit log f over |v|."
    ),
    least: float = typer.Option(0.0, "--least", help="Leave out what is darker than this part of a pixel's mean."),
    lights: Path | None = typer.Option(None, "--lights", help="An .lp to use instead: its lights in the same order."),
    encoding: str = captures.ENCODING,
    partial: bool = captures.PARTIAL,
    picture: Path | None = typer.Option(None, "--picture", help="A PNG: photographs left out beside the predictions."),
    as_json: bool = typer.Option(False, "--json", help="One JSON object."),
) -> None:
    """Share reflectance between the pixels of a few photographs: radial functions of place and angle."""
    import numpy as np

    from gonio.files.relightable import write_relightable
    from gonio.files.whole import writable
    from gonio.fitting.sharing import share_reflectance
    from gonio.rendering.relight import Relightable

    for path, suffix in ((output, ".gonio"), (picture, ".png")):
        if path:
            writable(path, suffix)
    given = _scales(scales)
    scene = captures.read(capture, encoding, partial, lights)
    left = _left_out(leave, len(scene.photographs))
    kept = [k for k in range(len(scene.photographs)) if k not in left]
    if scene.normals is None:
        typer.echo(f"{capture}: its shape is unknown; normals by photometric stereo", err=True)
        scene = _shaped(scene, kept)
    used = scene.select(kept)
    places = None if homogeneous else _places(scene)
    with bar("centres") as progress:
        fit = share_reflectance(
            used.reflectance(least),
            places,
            centres=centres,
            error=error,
            scales=given,
            texture=texture,
            logarithm=not paper,
            folded=not paper,
            smooth=not paper,
            progress=progress,
        )
    thing = Relightable(scene.view, scene.textures(fit.value.material))
    made = f"gonio share {capture.name}: {len(kept)} photographs, {fit.reason}"
    write_relightable(output, thing, made)
    facts: dict[str, Any] = {
        "photographs": len(kept),
        "centres": fit.history[-1][0] if fit.history else 0,
        "residual": fit.residual,
        "m_xy, m_w, rho": list(dataclasses.astuple(fit.value.scales)),
        "ended": fit.reason,
    }
    predictions = [_predicted(scene, thing, k) for k in left]
    for k, (_, _, off) in zip(left, predictions, strict=True):
        facts[f"error of {scene.photographs.names[k]}"] = off
    if predictions:
        facts["median of them"] = float(np.median([off for _, _, off in predictions]))
    if picture:
        from gonio.viewer.sharing import sharing_picture

        shown = predictions or [_predicted(scene, thing, k) for k in kept[:3]]
        names = [scene.photographs.names[k] for k in (left or kept[:3])]
        sharing_picture(picture, names, shown, fit.history)
    if as_json:
        typer.echo(json.dumps(facts))
    else:
        for name, value in facts.items():
            worded = " ".join(f"{x:.3g}" for x in value) if isinstance(value, list) else value
            typer.echo(f"{name:>28}  {worded:.4g}" if isinstance(worded, float) else f"{name:>28}  {worded}")
        typer.echo(str(output))
    if error and not fit.converged:
        raise typer.Exit(1)


def _left_out(text: str, count: int) -> list[int]:
    """The numbers of photographs that `--leave` names, each once."""
    from gonio.errors import ParameterError

    numbers = parse.numbers(text) if text else ()
    for k in numbers:
        if k not in range(count):
            raise ParameterError(f"--leave {text}: there is no photograph {k:g}; there are 0 to {count - 1}.")
    left = [int(k) for k in dict.fromkeys(numbers)]
    if len(left) == count:
        raise ParameterError(f"--leave {text}: all photographs are left out; keep one or more.")
    return left


def _shaped(scene: Capture, kept: list[int]) -> Capture:
    """The capture with normals from the photographs that are kept, from all where those are too few."""
    import numpy as np

    import gonio as gn

    some = scene.select(kept) if len(kept) > 3 else scene
    if len(kept) <= 3:
        typer.echo("normals are of all photographs: those that are kept are too few", err=True)
    with bar("normals") as progress:
        relief = gn.photometric_stereo(some, progress=progress)
    found = np.isfinite(relief.error) & (relief.normals[..., 2] > 0.05)
    return dataclasses.replace(scene, normals=np.where(found[..., None], relief.normals, 0), mask=found)


def _places(scene: Capture) -> np.ndarray:
    """Where sites lie in the image's plane, the longer side of the object from 0 to 1 (RS 7)."""
    at = scene.sites.positions @ scene.camera.pose[:3, :2]
    low, high = at.min(axis=0), at.max(axis=0)
    places: np.ndarray = (at - low) / max(float((high - low).max()), 1e-30)
    return places


def _scales(text: str) -> Scales | None:
    from gonio.errors import ParameterError
    from gonio.fitting.sharing import Scales

    if not text:
        return None
    values = parse.numbers(text)
    if len(values) not in (2, 3):
        raise ParameterError(f"--scales {text}: m_xy,m_w or m_xy,m_w,rho is wanted.")
    return Scales(*values)


def _predicted(scene: Capture, thing: Relightable, k: int) -> tuple[np.ndarray, np.ndarray, float]:
    """The photograph, what the model makes of its light, and their relative rms where it is not clipped."""
    import numpy as np

    import gonio as gn

    assert scene.lights is not None
    photograph, clipped = scene.photographs.read(k)
    image = gn.relight(thing, scene.lights[k])
    some = scene.mask & ~clipped
    total = np.mean(photograph[some].astype(float) ** 2)
    off = np.sqrt(np.mean((image[some] - photograph[some]) ** 2) / total) if total > 0 else 0.0
    return np.where(scene.mask[..., None], photograph, 0), image, float(off)
