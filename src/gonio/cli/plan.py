"""`gonio plan`: what photographs tell of reflectance, and how many would tell what is asked for."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from . import captures

if TYPE_CHECKING:
    from ..capture.model import Capture
    from ..fitting.planning import Needed, Plan, Told


def plan(
    capture: Path = captures.FOLDER,
    highlight: float = typer.Option(
        math.inf, "--highlight", help="Degrees: the width s of a highlight exp(-theta_h^2 / (2 s^2)) to tell."
    ),
    texture: float = typer.Option(math.inf, "--texture", help="Pixels a period, of a texture to tell."),
    lights: Path | None = typer.Option(None, "--lights", help="An .lp to use instead: its lights in the same order."),
    encoding: str = captures.ENCODING,
    partial: bool = captures.PARTIAL,
    picture: Path | None = typer.Option(None, "--picture", help="A PNG: what is told, and where the lights stand."),
    as_json: bool = typer.Option(False, "--json", help="One JSON object."),
) -> None:
    """Say how sharp highlights and how fine textures photographs tell, shared between pixels and not."""
    import numpy as np

    from gonio.capture.lighting import directions_from
    from gonio.errors import FileError, ParameterError
    from gonio.files.whole import writable
    from gonio.fitting.planning import plan_sharing

    if picture:
        writable(picture, ".png")
    if not highlight > 0:
        raise ParameterError(f"--highlight {highlight:g}: degrees above 0 are wanted.")
    if not texture >= 2:
        raise ParameterError(f"--texture {texture:g}: a period is two pixels or more.")
    scene = captures.read(capture, encoding, partial, lights)
    if scene.lights is None:
        raise FileError(f"{capture}: its lights are unknown; give --lights, or find them by gonio calibrate.")
    scene = _known(scene, capture)
    towards = directions_from(scene.lights or (), np.nanmean(scene.positions[scene.mask], axis=0))
    assert scene.normals is not None
    found = plan_sharing(scene.normals, towards, scene.view.wo, scene.mask)
    asked = (math.radians(highlight), texture)
    needed = found.photographs_for(*asked) if math.isfinite(min(asked)) else None
    if as_json:
        typer.echo(json.dumps(_facts(found, needed)))
    else:
        typer.echo("\n".join(_advice(found)))
        if needed is not None:
            typer.echo(_answer(found, highlight, texture, needed))
    if picture:
        from gonio.viewer.planning import planning_picture

        planning_picture(picture, found, towards, *asked)
        if not as_json:
            typer.echo(str(picture))


def _known(scene: Capture, path: Path) -> Capture:
    """The capture with normals: its own, or by photometric stereo."""
    from gonio.errors import FileError

    if scene.normals is not None:
        return scene
    count = len(scene.photographs)
    if count < 3:
        raise FileError(
            f"{path}: its shape is unknown, and {count} photographs are too few to tell normals from; add a mesh or "
            "normals to its capture.toml."
        )
    typer.echo(f"{path}: its shape is unknown; normals by photometric stereo", err=True)
    return captures.shaped(scene)


def _advice(plan: Plan) -> list[str]:
    """What the photographs are, and what they tell, a line each."""
    few = plan.photographs == 1
    apart = "" if math.isinf(plan.dtheta) else f", lights {_degrees(plan.dtheta)} degrees apart"
    low, high = plan.theta_d
    theta_d = (
        f"theta_d is {_degrees(low)} degrees throughout: highlights at others are not told"
        if plan.single
        else f"theta_d from {_degrees(low)} to {_degrees(high)} degrees"
    )
    lit = ", ".join(f"{100 * part:.0f} % face {k}" for k, part in enumerate(plan.lit, 1) if k <= plan.photographs)
    lines = [
        f"{plan.photographs} photograph{'' if few else 's'}{apart}; "
        f"normals turn by {_degrees(plan.dalpha)} degrees from pixel to pixel",
        f"{theta_d}; of the pixels {lit}{'' if few else ' lights or more'}",
    ]
    if plan.shared is None:
        lines.append(f"shared: nothing, the surface is flat: its normals turn by {_degrees(plan.turn)} degrees in all")
    else:
        lines.append(f"shared: {_worded(plan.shared)}")
    lines.append(f"each pixel alone: {_worded(plan.alone)}")
    return lines


def _worded(told: Told) -> str:
    if math.isinf(told.highlight):
        return f"no highlights, texture no finer than {told.texture:.3g} pixels"
    texture = "no texture" if math.isinf(told.texture) else f"texture no finer than {told.texture:.3g} pixels"
    return f"highlights down to {_degrees(told.highlight)} degrees wide, {texture}"


def _answer(plan: Plan, highlight: float, texture: float, needed: Needed) -> str:
    wanted = [f"highlights of {highlight:g} degrees"] if math.isfinite(highlight) else []
    wanted += [f"texture of {texture:g} pixels"] if math.isfinite(texture) else []
    counts = ", ".join(
        f"{name} {count or 'no number of'} photograph{'' if count == 1 else 's'}"
        for name, count in (("shared", needed.shared), ("each pixel alone", needed.alone))
    )
    sky = f"lights evenly out to {_degrees(plan.cap)} degrees from the eye"
    return f"to tell {' and '.join(wanted)}, {sky}: {counts}"


def _facts(plan: Plan, needed: Needed | None) -> dict[str, Any]:
    """For machines: what is not told at all is null."""
    facts: dict[str, Any] = {
        "photographs": plan.photographs,
        "dtheta, degrees": _finite(math.degrees(plan.dtheta)),
        "dalpha, degrees": math.degrees(plan.dalpha),
        "turn of normals, degrees": math.degrees(plan.turn),
        "flat": plan.flat,
        "theta_d, degrees": [math.degrees(theta_d) for theta_d in plan.theta_d],
        "one theta_d": plan.single,
        "facing 1, 2, 3 lights": list(plan.lit),
    }
    for name, told in (("shared", plan.shared), ("alone", plan.alone)):
        facts[name] = told and {
            "highlight, degrees": _finite(math.degrees(told.highlight)),
            "texture, pixels": _finite(told.texture),
            **{f"Omega in {axis}": value for axis, value in dataclasses.asdict(told.band).items()},
        }
    if needed is not None:
        facts["photographs needed"] = needed._asdict()
        facts["out to, degrees"] = math.degrees(plan.cap)
    return facts


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.2g}"
