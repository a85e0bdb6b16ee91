"""`gonio render`: a shape with any BRDF, or what gonio fitted, under any light, to EXR or tone-mapped PNG."""

from __future__ import annotations

import enum
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from . import maps, parse
from .info import MESHES
from .progress import bar

if TYPE_CHECKING:
    import numpy as np

    from ..brdf.model import BRDF
    from ..cameras import Pinhole
    from ..lights.model import Light
    from ..rendering.precomputed import Precomputed
    from ..rendering.relight import Relightable
    from ..shapes.mesh import Mesh
    from ..shapes.view import Shape


class Curve(enum.StrEnum):
    """Tone curves by name."""

    FILMIC = "filmic"
    REINHARD = "reinhard"
    LINEAR = "linear"


def render(
    thing: Path | None = typer.Argument(None, help="A .gonio, relit; with --shape what it is made of, on that shape."),
    output: Path = typer.Option(..., "--output", "-o", help="image.exr (linear), or image.png (tone-mapped)."),
    brdf: list[str] = typer.Option(
        ["lambert:albedo=.6"],
        "--brdf",
        help="A measured file, or name:key=value,... with colours as r/g/b: lambert, ggx, ward, ... Repeat to add.",
    ),
    shape: str = typer.Option(
        "", "--shape", help="sphere (if none is given), cylinder, cloth, vase, a mesh file, or an image of heights."
    ),
    repeat: int = typer.Option(1, "--repeat", help="Tiles of the texture along each side of the shape's."),
    smooth: bool = typer.Option(False, "--smooth", help="Give a mesh smooth normals in place of its file's."),
    y_up: bool = typer.Option(False, "--y-up", help="Stand a mesh up whose file has y upwards."),
    light: list[Path] = typer.Option([], "--light", help="An environment map. Without any light: a room of gonio's."),
    layout: maps.Layout | None = typer.Option(None, "--layout", help="Its layout, where its shape does not tell."),
    orientation: str = typer.Option("", "--orientation", help="The tool whose convention it follows."),
    sun: list[str] = typer.Option([], "--sun", help="A directional light x,y,z[:irradiance], towards the light."),
    size: str = typer.Option("512", "--size", help="Pixels, as 640x480 or 512."),
    samples: int | None = typer.Option(None, "--samples", help="Most beams a ray takes of the light; else as needed."),
    shadows: bool = typer.Option(False, "--shadows", help="Trace shadow rays."),
    maps_file: Path | None = typer.Option(None, "--maps", help="An SHRM (gonio prefilter --brdf): look-ups, no sums."),
    compare: bool = typer.Option(False, "--compare", help="Maps, sum over the light, ten times their difference."),
    confidence: Path | None = typer.Option(
        None, "--confidence", help="Of a .gonio: also an image of how far to trust each pixel, 0 to 1."
    ),
    eye: str = typer.Option(
        "",
        "--eye",
        help="The camera's place x,y,z, z up, in radii of the shape: else 2.6,-3.2,1.6. Of a .gonio right,up,towards "
        "as it was photographed.",
    ),
    field_of_view: float = typer.Option(34.0, "--fov", help="Vertical field of view in degrees."),
    supersample: int = typer.Option(2, "--supersample", help="Rays a pixel along each side."),
    background: bool = typer.Option(True, "--background/--no-background", help="Show the environment behind."),
    relief: float = typer.Option(1.0, "--relief", help="What an image of heights is multiplied by, in pixels."),
    exposure: float = typer.Option(0.0, "--exposure", help="Stops, for PNG."),
    curve: Curve = typer.Option(Curve.FILMIC, "--curve", help="Tone curve, for PNG."),
) -> None:
    """Render a shape with a BRDF under environment maps and directional lights."""
    import gonio as gn
    from gonio.errors import ParameterError
    from gonio.files.images import require_writable

    for path in (output, confidence):
        if path:
            require_writable(path)
    columns, rows = parse.size(size)
    lens: dict[str, Any] = {"field_of_view": field_of_view, "size": (rows, columns)}
    how: dict[str, Any] = {"shadows": shadows, "samples": samples, "supersample": supersample, "background": background}
    if thing:
        if maps_file or compare:
            raise ParameterError(f"{thing} is summed over the light: --maps and --compare go without.")
        if not shape and repeat != 1:
            raise ParameterError(f"{thing} is relit as it was photographed: --repeat wants a --shape.")
        held = _held(thing, shape, eye, shadows, confidence is not None)
        lit = _light(light, layout, orientation, sun)
        if shape:
            assert isinstance(held, gn.Relightable)
            scene, camera = _before(shape, eye, lens, relief, smooth, y_up, repeat)
            image, trusted = _anew(scene, held.material, lit, camera, how, confidence is not None)
        else:
            image, trusted = _relit(held, lit, eye, lens, how, confidence is not None)
        write(output, image, exposure, curve)
        typer.echo(str(output))
        if confidence:
            gn.write_image(confidence, trusted, "linear")  # codes are parts of 1, not light
            typer.echo(str(confidence))
        return
    if confidence:
        raise ParameterError("--confidence is of what was fitted: it goes with a .gonio of gonio share.")
    material = parse.reflectance(brdf)
    arriving = None if maps_file and not light and not sun and not compare else _light(light, layout, orientation, sun)
    scene, camera = _before(shape or "sphere", eye, lens, relief, smooth, y_up, repeat)
    quick = None
    if maps_file or compare:
        quick = _by_maps(maps_file, arriving, material, scene, camera, supersample, background)
    if quick is not None and not compare:
        image = quick
    else:
        assert arriving is not None
        with bar("render") as progress:
            image = gn.render(scene, material, arriving, camera, progress=progress, **how)
        if quick is not None:
            image = _beside(quick, image)
    write(output, image, exposure, curve)
    typer.echo(str(output))


def _before(
    name: str, eye: str, lens: dict[str, Any], relief: float, smooth: bool, y_up: bool, repeat: int
) -> tuple[Shape, Pinhole]:
    """The shape of that name, its texture repeated, and the camera at `eye`."""
    import gonio as gn

    scene, centre, radius = shape_of(name, relief, smooth, y_up)
    towards = parse.vector(eye or "2.6,-3.2,1.6")
    camera = gn.Pinhole.look_at(
        eye=[c + radius * e for c, e in zip(centre, towards, strict=True)],
        target=centre,
        up=(0, 0, 1) if any(towards[:2]) else (0, 1, 0),  # from straight above, as a map lies
        **lens,
    )
    return scene if repeat == 1 else gn.Repeated(scene, repeat), camera


def _held(path: Path, shape: str, eye: str, shadows: bool, confidence: bool) -> Relightable | Precomputed:
    """What a .gonio holds, if it can be shown as it is asked for."""
    import gonio as gn
    from gonio.errors import ParameterError
    from gonio.files.archive import kind_of

    if kind_of(path) == "precomputed":
        if shape or eye or shadows or confidence:
            raise ParameterError(
                f"{path} holds images of one view: --shape, --eye, --shadows and --confidence go without."
            )
        return gn.read_precomputed(path)
    if shadows and not eye and not shape:
        raise ParameterError(f"{path} is relit as it was photographed: --shadows wants an --eye, as 0,0,4.")
    return gn.read_relightable(path)


def _relit(
    held: Relightable | Precomputed,
    light: Light,
    eye: str,
    lens: dict[str, Any],
    how: dict[str, Any],
    with_confidence: bool,
) -> tuple[np.ndarray, np.ndarray | None]:
    """The image, as it was photographed or from another `eye`, and how far to trust it where that is asked."""
    import gonio as gn

    if isinstance(held, gn.Precomputed):
        return held.relight(light), None
    if eye:
        return _anew(held.surface, held.material, light, _around(held, eye, lens), how, with_confidence)
    with bar("render") as progress:
        image = gn.relight(held, light, how["samples"], progress)
    return image, _trusted(held, light) if with_confidence else None


def _anew(
    scene: Shape, material: BRDF, light: Light, camera: Pinhole, how: dict[str, Any], with_confidence: bool
) -> tuple[np.ndarray, np.ndarray | None]:
    """The image of `scene` with `material`, and how far to trust it where that is asked."""
    import gonio as gn

    with bar("render") as progress:
        image = gn.render(scene, material, light, camera, progress=progress, **how)
    return image, _trusted(gn.Relightable(scene.view(camera), material), light) if with_confidence else None


def _trusted(held: Relightable, light: Light) -> np.ndarray:
    import gonio as gn

    with bar("confidence") as progress:
        return gn.relit_confidence(held, light, progress=progress)


def _around(seen: Relightable, eye: str, lens: dict[str, Any]) -> Pinhole:
    """The camera at `eye`, right,up,towards of the photograph, in radii of what was seen."""
    import numpy as np

    import gonio as gn

    centre, radius = _ball(seen.surface)
    _, up, towards = seen.axes
    place = np.array(parse.vector(eye))
    return gn.Pinhole.look_at(
        eye=centre + radius * place @ seen.axes, target=centre, up=up if np.any(place[[0, 2]]) else -towards, **lens
    )


def _by_maps(
    file: Path | None, light: Light | None, material: Any, scene: Any, camera: Any, supersample: int, background: bool
) -> Any:
    """The image by look-ups in the SHRM of `file`, or in one made for the light and material at hand."""
    import gonio as gn
    from gonio.errors import ParameterError

    room = light if isinstance(light, gn.Environment) else None
    if file:
        shrm = gn.read_shrm(file)
    elif room:
        shrm = gn.prefilter(room, material)
    else:
        raise ParameterError("--compare makes maps of one environment; leave --sun out, or pass --maps.")
    typer.echo(f"maps: {shrm.made}; they leave out {100 * shrm.error:.2g} % rms", err=True)
    behind = room if background else None
    return gn.render_prefiltered(scene, shrm, camera, background=behind, supersample=supersample)


def _beside(quick: Any, slow: Any) -> Any:
    """Both images and ten times their difference, side by side; their relative rms difference is said."""
    import numpy as np

    rms = float(np.sqrt(np.mean((quick - slow) ** 2) / np.mean(slow**2)))
    typer.echo(f"rms difference: {100 * rms:.2f} % of the image's rms", err=True)
    return np.concatenate((quick, slow, 10 * np.abs(quick - slow)), axis=1)


def write(output: Path, image: Any, exposure: float, curve: Curve) -> None:
    """Linear where the format holds radiance, tone-mapped where it holds what a screen shows."""
    import gonio as gn

    gn.write_image(output, shown(output, image, exposure, curve))


def shown(output: Path, image: Any, exposure: float, curve: Curve) -> Any:
    """The image as the format of `output` holds it: display colours for PNG, radiance otherwise."""
    import gonio as gn
    from gonio.rendering import tonemap

    if output.suffix.lower() != ".png":
        return image
    curves: dict[Curve, Callable[[Any], Any]] = {
        Curve.FILMIC: tonemap.Filmic(),
        Curve.REINHARD: tonemap.Reinhard(),
        Curve.LINEAR: tonemap.clipped,
    }
    return gn.tone_map(image, curves[curve], exposure)


def shape_of(name: str, relief: float, smooth: bool, y_up: bool) -> tuple[Any, list[float], float]:
    """The shape, and the centre and radius of a ball about it."""
    import numpy as np

    import gonio as gn

    if name == "sphere":
        return gn.Sphere(), [0.0, 0.0, 0.0], 1.0
    shape: Any
    made = {"vase": gn.vase, "cloth": gn.cloth, "cylinder": gn.cylinder}
    if name in made:
        shape = made[name]()
    elif Path(name).suffix.lower() in MESHES:
        shape = gn.read_mesh(name)
        if smooth:
            shape = gn.Mesh(shape.vertices, shape.faces, shape.uv)
        if y_up:
            turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # (X, Y, Z) -> (X, -Z, Y)
            shape = gn.Mesh(shape.vertices @ turn.T, shape.faces, shape.uv, shape.normals @ turn.T)
    else:
        shape = gn.HeightField(relief * gn.read_image(name, encoding="linear")[..., 0])
    centre, radius = _ball(shape.mesh if isinstance(shape, gn.HeightField) else shape)
    return shape, centre.tolist(), radius


def _ball(mesh: Mesh) -> tuple[np.ndarray, float]:
    """Centre (3,) and radius of a ball about the mesh."""
    import numpy as np

    low, high = mesh.bounds
    centre = (low + high) / 2
    return centre, float(np.linalg.norm(mesh.vertices - centre, axis=-1).max())


def _light(files: list[Path], layout: maps.Layout | None, orientation: str, suns: list[str]) -> Light:
    import gonio as gn

    lights: list[Light] = []
    for path in files:
        environment = maps.read([path], layout, orientation)
        typer.echo(f"{path}: {maps.stands(environment)}", err=True)
        lights.append(environment)
    lights += [parse.directional(text) for text in suns]
    if not lights:
        return gn.studio()
    return lights[0] if len(lights) == 1 else gn.Lights(tuple(lights))
