"""`gonio ndf`: the facets of a flat sample from one view under many lights, tried on photographs that are left out."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import shutil
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ..errors import GonioWarning
from . import captures
from .progress import steps
from .share import left_out, predicted, say

if TYPE_CHECKING:
    from ..brdf.polar_grid import PolarGrid
    from ..capture.model import Capture

_FEWEST = 12  # lights
_EDGE_ON = 0.05  # cosine between normal and eye, of sites that show nothing
_TILTED = 5.0  # degrees, of a flat sample's normals
_CLIPPED = 0.01  # part of what photographs show
_AMISS = 0.25  # relative rms, beyond which facets alone do not look like that
_OVERHEAD = 0.985  # cosine: such lights have no side
_ONE = 2e-6  # between lights at one place
_MANY = 200_000  # sites, beyond which partial results are kept unasked
_HELD = 1_000_000_000  # bytes of photographs in memory
_PICTURED = 6  # predictions


def ndf(
    capture: Path = captures.FOLDER,
    output: Path = typer.Option(..., "--output", "-o", help="satin.gonio, which gonio render relights and drapes."),
    representatives: int | None = typer.Option(
        None, "--representatives", min=1, help="Distributions that are made whole; else 1 % of the sites."
    ),
    eta: float | None = typer.Option(None, "--eta", help="The refractive index; else found."),
    grid: str = typer.Option("32x96", "--grid", help="ROWSxCOLUMNS of a distribution: cloth; brushed metal 96x256."),
    turned: list[Path] = typer.Option(
        [], "--turned", help="The same sample turned under the camera: a capture that is fitted with it as one. Repeat."
    ),
    flat: bool = typer.Option(False, "--flat", help="The sample is flat: its normals are +z, whatever else is told."),
    leave: str = typer.Option("", "--leave", help="Photographs to leave out and predict: 0,5,9."),
    paper: bool = typer.Option(False, "--paper", help="As the paper: distributions grow, one by one, from others."),
    lights: Path | None = typer.Option(None, "--lights", help="An .lp to use instead: its lights in the same order."),
    encoding: str = captures.ENCODING,
    partial: bool = captures.PARTIAL,
    work: Path | None = typer.Option(
        None,
        "--work",
        help="A folder to keep partial results in, from which a run that was stopped goes on. Of more than 200,000 "
        "sites OUTPUT.work, removed when all is done.",
    ),
    picture: Path | None = typer.Option(
        None, "--picture", help="A PNG: facets and colours; with --leave, photographs left out beside the predictions."
    ),
    as_json: bool = typer.Option(False, "--json", help="One JSON object."),
) -> None:
    """Find the distribution of facets at every site of a flat sample, each completed from the others."""
    import numpy as np

    import gonio as gn
    from gonio.errors import ParameterError
    from gonio.files.relightable import write_relightable
    from gonio.files.whole import writable
    from gonio.reflection import varied

    for path, suffix in ((output, ".gonio"), (picture, ".png")):
        if path:
            writable(path, suffix)
    if eta is not None and not 1 < eta <= 10:
        raise ParameterError(f"--eta {eta:g}: an index in (1, 10] is wanted; leave it out to have it found.")
    knots = _grid(grid)
    warned: list[str] = []

    def warn(text: str) -> None:
        warned.append(text)
        typer.echo(f"{capture}: {text}", err=True)

    scene = captures.read(capture, encoding, partial, lights)
    left = left_out(leave, len(scene.photographs))
    kept = [k for k in range(len(scene.photographs)) if k not in left]
    if scene.lights is None:
        raise ParameterError(f"{capture}: its lights are unknown; give them as --lights, an .lp.")
    if len(kept) < _FEWEST:
        raise ParameterError(
            f"{capture}: {len(kept)} lights: a distribution of facets wants dozens; gonio share fits a handful."
        )
    scene = _facing(scene, kept, flat, warn)
    sites = int(np.count_nonzero(scene.mask))
    if representatives is not None and representatives > sites:
        raise ParameterError(f"--representatives {representatives}: {capture} has {sites} sites; ask for fewer.")
    _look(scene, kept, warn)
    others = []
    for path in turned:
        other = captures.read(path, encoding, partial)
        others.append(_facing(other, list(range(len(other.photographs))), flat, warn))
    folder = work
    if work is None and sites > _MANY:
        folder = output.with_name(f"{output.name}.work")
    if folder is not None:
        told = {
            "grid": grid,
            "eta": eta,
            "encoding": encoding,
            "photographs": kept,
            "sample": [_digest(one) for one in (scene, *others)],
        }
        _begin(folder, told)
    try:
        with steps("photographs") as progress, _said(warn):
            some, clipped = _held(scene.select(kept), capture, lambda *of: progress("photographs", *of))
            if clipped > _CLIPPED:
                warn(f"{clipped:.1%} of what its photographs show is clipped: expose shorter, or merge brackets")
            fit = gn.synthesise_ndfs(
                [some.reflectance(), *(other.reflectance() for other in others)],
                grid=knots,
                representatives=representatives,
                eta=eta,
                paper=paper,
                folder=folder,
                progress=progress,
            )
    except KeyboardInterrupt:
        kept_in = f"go on with the same command: {folder} holds what is done" if folder else "--work keeps what is done"
        typer.echo(kept_in, err=True)
        raise typer.Exit(130) from None
    found = fit.value
    material = varied(found.material, lambda value, axes: value[:sites])  # others' follow
    thing = gn.Relightable(scene.view, scene.textures(material))
    write_relightable(output, thing, f"gonio ndf {capture.name}: {len(kept)} lights, {fit.reason}")
    if folder is not None and work is None:
        shutil.rmtree(folder)
    if fit.residual > _AMISS:
        warn(
            f"facets leave {fit.residual:.0%} of its photographs unexplained: relief, light between threads and "
            "clipped highlights are not theirs; gonio share fits how it looks"
        )
    own, others = found.completed.own.mean(), (found.completed.told - found.completed.own).mean()
    facts: dict[str, Any] = {
        "lights": len(kept),
        "sites": sites,
        "representatives": len(found.representatives.texels),
        "median eta": float(np.median(np.asarray(material.eta))),
        "residual": fit.residual,
        "facets told by own data": float(own),
        "facets told by others": float(others),
        "bytes": output.stat().st_size,
    }
    predictions = [predicted(scene, None, thing, k) for k in left]
    names = [scene.photographs.names[k] for k in left]
    if left:
        off = [off for _, _, off in predictions]
        facts |= {f"error of {name}": each for name, each in zip(names, off, strict=True)}
        facts |= {"median of them": float(np.median(off)), "90 % of them below": float(np.percentile(off, 90))}
    if picture:
        from gonio.viewer.facets import facets_picture
        from gonio.viewer.lobes import spread_pixels
        from gonio.viewer.sharing import sharing_picture

        if left:
            residual = np.full(scene.mask.shape, np.nan)
            residual[scene.mask] = found.residual[:sites]
            sharing_picture(picture, names[:_PICTURED], predictions[:_PICTURED], residual=residual)
        else:
            facets_picture(picture, thing, spread_pixels(scene.mask))
    if as_json:
        facts["warnings"] = warned
    say(facts, output, as_json)


@contextlib.contextmanager
def _said(warn: Callable[[str], None]) -> Iterator[None]:
    """Warnings of the fit go to `warn` at once: hours may follow."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", GonioWarning)
        warnings.showwarning = lambda message, *_, **__: warn(str(message))
        yield


def _grid(text: str) -> PolarGrid:
    from gonio.brdf.polar_grid import PolarGrid
    from gonio.errors import ParameterError

    rows, _, columns = text.lower().partition("x")
    if not (rows.isdecimal() and columns.isdecimal()):
        raise ParameterError(f"--grid {text}: ROWSxCOLUMNS is wanted, as 32x96.")
    return PolarGrid(int(rows), int(columns))


def _facing(scene: Capture, kept: list[int], flat: bool, warn: Callable[[str], None]) -> Capture:
    """The capture with normals: +z of a flat sample, else its own, else those of photometric stereo."""
    import numpy as np

    if flat:
        return dataclasses.replace(scene, normals=np.broadcast_to([0.0, 0.0, 1.0], (*scene.mask.shape, 3)))
    if scene.normals is not None:
        sites = scene.sites
        seen = np.sum(sites.frames[:, 2] * scene.towards_eye(sites.positions), axis=1) > _EDGE_ON
        if seen.all():
            return scene
        warn(f"{np.mean(~seen):.1%} of its sites turn away from the eye, and are left out")
        mask = scene.mask.copy()
        mask[mask] = seen
        return dataclasses.replace(scene, mask=mask)
    scene = captures.shaped(scene, kept)
    normals = np.asarray(scene.normals)[scene.mask]
    tilt = float(np.degrees(np.arccos(normals[:, 2].clip(-1, 1)).mean()))
    if tilt > _TILTED:
        warn(
            f"normals by photometric stereo, which highlights mislead, tilt by {tilt:.0f} degrees in the mean: give "
            "--flat if the sample is flat"
        )
    else:
        typer.echo("normals are by photometric stereo; --flat is quicker where the sample is flat", err=True)
    return scene


def _look(scene: Capture, kept: list[int], warn: Callable[[str], None]) -> None:
    """Refuse lights that stand at one place, seen from the middle of the sample; tell of those from one side."""
    import numpy as np
    from scipy.spatial.distance import cdist

    from gonio.errors import ParameterError

    at = scene.sites.positions
    middle = np.array([np.argmin(np.linalg.norm(at - at.mean(axis=0), axis=1))])
    sites = scene.sites[middle]
    wi = scene.select(kept).reflectance().directions(sites.positions, sites.frames)[0][0]
    apart = cdist(wi, wi) + 4 * np.eye(len(wi))
    if apart.min() < _ONE:
        a, b = (kept[i] for i in np.unravel_index(int(apart.argmin()), apart.shape))
        names = scene.photographs.names
        raise ParameterError(f"{names[a]} and {names[b]} have lights at one place: leave one of them out, --leave {b}.")
    aside = wi[(wi[:, 2] > 0) & (wi[:, 2] < _OVERHEAD)]
    azimuth = np.sort(np.arctan2(aside[:, 1], aside[:, 0]))
    gap = float(np.diff(azimuth, append=azimuth[:1] + 2 * np.pi).max(initial=0))
    if gap > np.pi:
        warn(
            f"its lights come from one side, within {360 - np.degrees(gap):.0f} degrees: facets that face the other "
            "are told by other sites, turned, or not at all"
        )


def _held(some: Capture, capture: Path, hear: Callable[[int, int], None]) -> tuple[Capture, float]:
    """The capture with photographs in memory, where they fit, and the part of them that is clipped."""
    import numpy as np

    from gonio.capture.reading import ReadPhotographs
    from gonio.files.store import STORE

    at, count = np.flatnonzero(some.mask), len(some.photographs)
    if 13 * at.size * count <= _HELD:
        read = ReadPhotographs(some.photographs, at, hear)
        return dataclasses.replace(some, photographs=read), float(read.clipped.mean())
    if not (capture / STORE).exists():
        typer.echo(f"{capture}: its photographs are decoded again and again; gonio ingest makes this quick", err=True)
    total = 0.0
    for k in range(count):
        total += float(some.photographs.pick(k, at).clipped.mean())
        hear(k + 1, count)
    return some, total / count


def _digest(scene: Capture) -> str:
    """Of where sites lie, how they face, and where lights stand."""
    import numpy as np

    from gonio.capture.lighting import arriving_from

    assert scene.lights is not None
    sites, code = scene.sites, hashlib.blake2b(digest_size=8)
    for array in (scene.mask, sites.positions, sites.frames, *arriving_from(scene.lights, sites.positions[:1])):
        code.update(np.ascontiguousarray(array).tobytes())
    return code.hexdigest()


def _begin(folder: Path, options: dict[str, Any]) -> None:
    """Make `folder` for partial results of such options, or go on with those that it holds."""
    from gonio.errors import FileError, ParameterError

    path = folder / "made.json"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if path.exists():
            before = json.loads(path.read_text("utf-8"))
        elif any(folder.iterdir()):
            raise FileError(f"{folder} holds other things: name an empty folder, or a new one, as --work.")
        else:
            path.write_text(json.dumps(options), "utf-8")
            return
    except OSError as error:
        raise FileError(f"{folder} cannot be a folder of partial results: {error.strerror or error}.") from error
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise FileError(f"{path} is damaged: remove {folder}.") from error
    for name, value in options.items():
        if not isinstance(before, dict) or before.get(name) != value:
            raise ParameterError(f"{folder} was begun with another {name}: give the same, or remove it.")
