"""`gonio share`: the reflectance of an object from a handful of photographs, tried on those that are left out."""

from __future__ import annotations

import contextlib
import dataclasses
import enum
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from . import captures, parse
from .progress import bar, stoppable

if TYPE_CHECKING:
    import numpy as np

    from ..capture.model import Capture
    from ..capture.parts import Parts
    from ..fitting.sharing import Scales
    from ..rendering.relight import Relightable

_MOST_REGIONS = 64


class Places(enum.StrEnum):
    """Coordinates of pixels by name."""

    IMAGE = "image"
    GEODESIC = "geodesic"


def share(
    capture: Path = captures.FOLDER,
    output: Path = typer.Option(..., "--output", "-o", help="thing.gonio, which gonio render relights."),
    centres: int = typer.Option(2000, "--centres", min=8, help="Of the radial functions, at most."),
    error: float = typer.Option(
        0.0, "--error", min=0, help="Stop when log f is fitted to this, rms; exit 1 if it never is."
    ),
    leave: str = typer.Option("", "--leave", help="Photographs to leave out and predict: 0,5,9."),
    homogeneous: bool = typer.Option(False, "--homogeneous", help="One BRDF everywhere."),
    places: Places = typer.Option(
        Places.IMAGE, "--places", help="Pixels' coordinates: in the image's plane, or in lengths along the surface."
    ),
    texture: bool = typer.Option(False, "--texture", help="A colour for each pixel, times what is shared."),
    regions: Path | None = typer.Option(
        None, "--regions", help="An image with a colour for each region: they share nothing with each other."
    ),
    separate: str = typer.Option(
        "", "--separate", help="Fit body and surface apart, told by colour or by least (light) of the photographs."
    ),
    crossed: Path | None = typer.Option(
        None, "--crossed", help="The same through a crossed polariser, in a folder: fit body and surface apart."
    ),
    specular_centres: int = typer.Option(5000, "--specular-centres", min=8, help="For the surface, where it is apart."),
    scales: str = typer.Option("", "--scales", help="m_xy,m_w[,rho]; else found by leaving photographs out."),
    paper: bool = typer.Option(
        False, "--paper", help="As the paper: interpolate f itself over v, not fit log f over |v|."
    ),
    least: float = typer.Option(0.0, "--least", help="Leave out what is darker than this part of a pixel's mean."),
    residuals: bool = typer.Option(
        False, "--residuals", help="Keep what photographs show beyond the model, as shadows: this view is relit better."
    ),
    resume: Path | None = typer.Option(
        None, "--resume", help="Go on from a .gonio of these photographs and options, stopped or of fewer centres."
    ),
    lights: Path | None = typer.Option(None, "--lights", help="An .lp to use instead: its lights in the same order."),
    encoding: str = captures.ENCODING,
    partial: bool = captures.PARTIAL,
    picture: Path | None = typer.Option(None, "--picture", help="A PNG: photographs left out beside the predictions."),
    as_json: bool = typer.Option(False, "--json", help="One JSON object."),
) -> None:
    """Share reflectance between the pixels of a few photographs: radial functions of place and angle."""
    import numpy as np

    import gonio as gn
    from gonio.errors import ParameterError
    from gonio.files.relightable import write_relightable
    from gonio.files.whole import writable
    from gonio.rendering.relight import Relightable

    for path, suffix in ((output, ".gonio"), (picture, ".png")):
        if path:
            writable(path, suffix)
    _require_one(separate, crossed, homogeneous, resume, scales)
    given, earlier = _scales(scales), gn.read_relightable(resume).material if resume else None
    scene = captures.read(capture, encoding, partial, lights)
    if residuals and not all(light.distant for light in scene.lights or ()):
        raise ParameterError(f"{capture} has near lights: --residuals are between distant ones, leave it out.")
    left = left_out(leave, len(scene.photographs))
    kept = [k for k in range(len(scene.photographs)) if k not in left]
    behind = captures.read(crossed, encoding, partial, lights) if crossed else None
    if scene.normals is None:
        typer.echo(f"{capture}: its shape is unknown; normals by photometric stereo", err=True)
        matte = scene if behind is None else gn.parts_by_polarisers(scene, behind).diffuse
        shaped = captures.shaped(matte, kept)
        scene = dataclasses.replace(scene, normals=shaped.normals, mask=shaped.mask)
    facts: dict[str, Any] = {"photographs": len(kept)}
    surface = _surface(scene)
    coordinates = None
    if not homogeneous:
        coordinates, off = _coordinates(scene, surface, places)
        facts |= {} if off is None else {"distortion of places": off}
    parts = _parts(scene, behind, separate, kept)
    with bar("centres") as heard, stoppable(heard) as (progress, stopped):
        options: dict[str, Any] = {
            "regions": _regions(regions, scene.mask),
            "logarithm": not paper,
            "folded": not paper,
            "smooth": not paper,
            "progress": progress,
            "until": stopped,
        }
        if parts is None:
            found = gn.share_reflectance(
                scene.select(kept).reflectance(least),
                coordinates,
                centres=centres,
                error=error,
                scales=given,
                texture=texture,
                start=earlier,
                **options,
            )
            material, fits = found.value.material, {"": found}
        else:
            assert coordinates is not None
            d, g = (part.reflectance(least) for part in parts)
            both = gn.share_dichromatic(
                d,
                g,
                coordinates,
                centres=centres,
                specular_centres=specular_centres,
                scales=(given, given),
                **options,
            )
            material, fits = both.material, {" of the body": both.diffuse, " of the surface": both.specular}
    view = scene.view
    if scene.shape is None:
        view = dataclasses.replace(view, position=surface, lifted=surface)
    thing = Relightable(view, scene.textures(material))
    if residuals:
        assert scene.lights is not None
        thing = gn.with_residuals(thing, [scene.lights[k] for k in kept], (_photograph(scene, behind, k) for k in kept))
        assert thing.residuals is not None
        facts["reach, noise of residuals"] = [thing.residuals.reach, thing.residuals.noise]
    ended = "; ".join(fit.reason for fit in fits.values())
    write_relightable(output, thing, f"gonio share {capture.name}: {len(kept)} photographs, {ended}")
    for name, fit in fits.items():
        facts[f"centres{name}"] = fit.history[-1][0] if fit.history else 0
        facts[f"residual{name}"] = fit.residual
        facts[f"m_xy, m_w, rho{name}"] = list(dataclasses.astuple(fit.value.scales))
        facts[f"ended{name}"] = fit.reason

    predictions = [predicted(scene, behind, thing, k) for k in left]
    for k, (_, _, off) in zip(left, predictions, strict=True):
        facts[f"error of {scene.photographs.names[k]}"] = off
    if predictions:
        facts["median of them"] = float(np.median([off for _, _, off in predictions]))
    if picture:
        from gonio.viewer.sharing import sharing_picture

        names = [scene.photographs.names[k] for k in (left or kept[:3])]
        shown = predictions or [predicted(scene, behind, thing, k) for k in kept[:3]]
        sharing_picture(picture, names, shown, next(iter(fits.values())).history)
    say(facts, output, as_json)
    if stopped():
        typer.echo(f"go on with --resume {output}", err=True)
        raise typer.Exit(130)
    if error and not all(fit.converged for fit in fits.values()):
        raise typer.Exit(1)


def say(facts: dict[str, Any], output: Path, as_json: bool) -> None:
    """Facts by name on stdout, and the file they are about."""
    if as_json:
        typer.echo(json.dumps(facts))
        return
    for name, value in facts.items():
        worded = " ".join(f"{x:.3g}" for x in value) if isinstance(value, list) else value
        typer.echo(f"{name:>28}  {worded:.4g}" if isinstance(worded, float) else f"{name:>28}  {worded}")
    typer.echo(str(output))


def _require_one(separate: str, crossed: Path | None, homogeneous: bool, resume: Path | None, scales: str) -> None:
    """Refuse ways to tell body and surface apart that do not go together, or cannot be gone on with."""
    from gonio.errors import ParameterError

    if separate not in ("", "colour", "least"):
        raise ParameterError(f"--separate {separate}: colour or least is wanted.")
    if separate and crossed:
        raise ParameterError("--separate and --crossed both tell body and surface apart; give one of them.")
    if homogeneous and (separate or crossed):
        raise ParameterError("--homogeneous is one BRDF for body and surface: leave --separate and --crossed out.")
    if resume and (separate or crossed):
        raise ParameterError("--resume goes on with body and surface in one: leave --separate and --crossed out.")
    if resume and scales:
        raise ParameterError(f"--resume takes the scales of {resume}: leave --scales out.")


def _parts(scene: Capture, behind: Capture | None, separate: str, kept: list[int]) -> Parts | None:
    """Body and surface of the photographs that are kept; None where they are not to be told apart."""
    import gonio as gn

    if behind is not None:
        return gn.parts_by_polarisers(scene.select(kept), behind.select(kept))
    if not separate:
        return None
    with bar("separate") as progress:
        by = {"colour": gn.parts_by_colour, "least": gn.parts_by_least_light}[separate]
        return by(scene.select(kept), progress)


def _regions(path: Path | None, mask: np.ndarray) -> np.ndarray:
    """The region of each pixel of the mask, (sites,): pixels of the same colour are of one, all without an image."""
    import numpy as np

    from gonio.errors import FileError
    from gonio.files.images import read_raster

    if path is None:
        return np.zeros(np.count_nonzero(mask), int)
    image = read_raster(path).samples
    if image.shape[:2] != mask.shape:
        raise FileError(f"{path} has {image.shape[:2]} pixels, the photographs {mask.shape}.")
    _, label = np.unique(image[mask].reshape(np.count_nonzero(mask), -1), axis=0, return_inverse=True)
    if label.max() >= _MOST_REGIONS:
        raise FileError(
            f"{path} has {label.max() + 1} colours on the object, {_MOST_REGIONS} regions at most are fitted. "
            "Is it smoothed at its edges, or a JPEG?"
        )
    return np.asarray(label).reshape(-1)


def left_out(text: str, count: int) -> list[int]:
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


def _surface(scene: Capture) -> np.ndarray:
    """Where pixels lie (rows, columns, 3), as far as the camera lets their normals tell."""
    from gonio.capture.surface import surface_positions
    from gonio.errors import ParameterError

    try:
        return surface_positions(scene)
    except ParameterError as error:
        typer.echo(f"the surface is taken for a plane: {error}", err=True)
        return scene.positions


def _coordinates(scene: Capture, surface: np.ndarray, places: Places) -> tuple[np.ndarray, float | None]:
    """Coordinates (S, 2) of the sites, the longer side of the object from 0 to 1 (RS 7), and their distortion, where
    pixels span a surface."""
    from gonio.errors import ArrayError
    from gonio.shapes.flattening import distortion
    from gonio.shapes.pixels import pixel_mesh
    from gonio.shapes.places import MOST, surface_places

    off: float | None = None
    if places is Places.GEODESIC:
        at, flat = surface_places(surface, scene.mask)
        off = flat.distortion
    else:
        axes = scene.camera.pose[:3, :2]
        at = scene.sites.positions @ axes
        with contextlib.suppress(ArrayError):  # a mask of single pixels spans none
            mesh = pixel_mesh(surface, scene.mask, most=MOST)
            off = distortion(mesh, mesh.vertices @ axes, welded=False)
    low, high = at.min(axis=0), at.max(axis=0)
    scaled: np.ndarray = (at - low) / max(float((high - low).max()), 1e-30)
    return scaled, off


def _scales(text: str) -> Scales | None:
    from gonio.errors import ParameterError
    from gonio.fitting.sharing import Scales

    if not text:
        return None
    values = parse.numbers(text)
    if len(values) not in (2, 3):
        raise ParameterError(f"--scales {text}: m_xy,m_w or m_xy,m_w,rho is wanted.")
    return Scales(*values)


def _photograph(scene: Capture, behind: Capture | None, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Radiance and what is clipped of photograph k; with one through a crossed polariser, as without polarisers."""
    photograph, clipped = scene.photographs.read(k)
    if behind is None:
        return photograph, clipped
    crossed = behind.photographs.read(k)
    return photograph + crossed.radiance, clipped | crossed.clipped


def predicted(
    scene: Capture, behind: Capture | None, thing: Relightable, k: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """The photograph, what the model makes of its light, and their relative rms where it is not clipped."""
    import numpy as np

    import gonio as gn

    assert scene.lights is not None
    photograph, clipped = _photograph(scene, behind, k)
    image = gn.relight(thing, scene.lights[k])
    some = scene.mask & ~clipped
    total = np.mean(photograph[some].astype(float) ** 2)
    off = np.sqrt(np.mean((image[some] - photograph[some]) ** 2) / total) if total > 0 else 0.0
    return np.where(scene.mask[..., None], photograph, 0), image, float(off)
