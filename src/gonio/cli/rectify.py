"""`gonio rectify`: a flat sample photographed at an angle, brought to a square grid in its own plane."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ..errors import ArrayError, FileError, ParameterError
from . import captures, parse
from .progress import bar

if TYPE_CHECKING:
    import numpy as np

    from ..capture.checkerboard import Board
    from ..capture.model import Capture
    from ..capture.rectification import Grid

_ODD = 3.0  # times the median residual: a photograph that is told of
_DARK = 1 / 256  # a photograph all darker than that would lose digits to 16-bit codes


def rectify(
    capture: Path = captures.FOLDER,
    output: Path = typer.Option(..., "--output", "-o", help="A new folder."),
    texels: str = typer.Option("512", "--texels", help="COLUMNSxROWS, or COLUMNS alone."),
    width: float = typer.Option(..., "--width", help="Of the grid, in the unit of --square, or any."),
    height: float = typer.Option(0.0, "--height", help="Of the grid; else as square texels have it."),
    board: str = typer.Option("", "--board", help="A checkerboard's inner corners, COLUMNSxROWS, such as 9x6."),
    square: float = typer.Option(1.0, "--square", help="The side of its squares."),
    boards: Path | None = typer.Option(None, "--boards", help="A folder of 3 or more photographs of it, tilted."),
    flat: str = typer.Option("", "--flat", help="The one of them, or of the capture, where it lies on the sample."),
    thickness: float = typer.Option(0.0, "--thickness", help="How far above the sample its face lay there."),
    centre: str = typer.Option("0,0", "--centre", help="Of the grid from the middle of the board, x,y."),
    terms: int = typer.Option(5, "--terms", help="Of the lens's distortion: 0, 1, 2, 4 or 5 of k1 k2 p1 p2 k3."),
    corners: str = typer.Option("", "--corners", help="Without a board: the sample's, x,y four times, from the top "
                                "left clockwise, in pixels from the top left of the image."),
    in_plane: bool = typer.Option(False, "--in-plane", help="The lights' places are in the sample's frame already."),
    encoding: str = captures.ENCODING,
    partial: bool = captures.PARTIAL,
    picture: Path | None = typer.Option(None, "--picture", help="A PNG: photograph and grid, and what came of them."),
    as_json: bool = typer.Option(False, "--json", help="One JSON object."),
) -> None:  # fmt: skip
    """Bring the photographs of a flat sample to square texels in its plane, by a checkerboard or its four corners.

    Writes 16-bit linear PNG, or EXR where radiance exceeds 1, with a capture.toml; of a board, camera.json, too.
    """
    import numpy as np

    import gonio as gn
    from gonio.capture.model import above
    from gonio.capture.rectification import Rectified, homography_of_points
    from gonio.files.photographs import PhotographFiles
    from gonio.files.whole import writable

    if output.exists() and any(output.iterdir() if output.is_dir() else [output]):
        raise FileError(f"{output} exists and is not empty: give a new folder.")
    if picture:
        writable(picture, ".png")
    if bool(board) == bool(corners):
        raise ParameterError("give either --board with --boards and --flat, or --corners: one of them tells the plane.")
    if corners and not height:
        raise ParameterError("--corners wants --width and --height: what lies between them on the sample.")
    if board and (boards is None or not flat):
        raise ParameterError("--board wants --boards FOLDER, photographs of it, and --flat NAME, where it lies flat.")
    grid = _grid(texels, width, height)
    clicked, pattern, shift = _clicked(corners), _board(board, square), _pair(centre)
    scene = captures.read(capture, encoding, partial)
    view: Any
    if boards is None or pattern is None:
        half = np.array((width, height)) / 2
        view, marks = homography_of_points(clicked, half * [(-1, 1), (1, 1), (1, -1), (-1, -1)]), clicked
        facts: dict[str, Any] = {}
        lights, eye = scene.lights, None
        if lights is not None and not in_plane:
            typer.echo("lights are kept as they are told: without a board nothing says how the camera stood", err=True)
    else:
        shown = captures.read(boards, encoding, partial)
        view, marks, facts = _calibrated(scene, capture, shown, boards, pattern, flat, terms)
        pose = np.array(view.pose)
        pose[:3, 3] += (-shift[0], -shift[1], thickness)
        view = dataclasses.replace(view, pose=pose)
        lights, eye = scene.lights if in_plane else _turned(scene, view), view.position
    sheet = Rectified(scene.photographs, grid, view)
    mask = sheet.covered(scene.mask)
    if not mask.any():
        raise ParameterError(f"{capture}: no texel of the grid lies within the mask of the photographs.")
    output.mkdir(parents=True, exist_ok=True)
    names, unmarked = [], 0
    stems = [Path(name).stem for name in sheet.names]
    if len(set(stems)) < len(stems):
        stems = [f"{k:0{len(str(len(stems)))}d}" for k in range(len(stems))]
    with bar("rectify") as progress:
        for k, stem in enumerate(stems):
            name, lost = _written(output, stem, *sheet.read(k))
            names.append(name)
            unmarked += lost
            progress(k + 1, len(stems))
    if unmarked:
        typer.echo(f"{output}: {unmarked} clipped texels are not marked, as EXR has no code for them", err=True)
    if not mask.all():
        gn.write_image(output / "mask.png", mask.astype(float), "linear")
    if not corners:
        gn.write_transforms(output / "camera.json", {flat: view})
    upwards = np.broadcast_to((0.0, 0.0, 1.0), (*grid.size, 3))
    seen = above(grid.size, grid.texel)
    files = PhotographFiles(output, names, "linear")
    gn.write_capture(output, gn.Capture(files, lights, mask, upwards, camera=seen, eye=eye))
    if picture:
        from gonio.viewer.rectification import rectified_picture

        middle = len(sheet) // 2
        rectified_picture(picture, sheet, scene.photographs.read(middle).radiance, sheet.read(middle).radiance, marks)
    rows, columns = grid.size
    facts = {"photographs": len(sheet), "columns": columns, "rows": rows, "texel": grid.texel, **facts}
    facts["places in a texel"] = sheet.samples[0] * sheet.samples[1]
    if eye is not None:
        facts["eye"] = [float(f"{x:.6g}") for x in eye]
    if as_json:
        typer.echo(json.dumps(facts))
        return
    for key, value in facts.items():
        typer.echo(f"{key:>28}  {value:.5g}" if isinstance(value, float) else f"{key:>28}  {value}")
    typer.echo(str(output / "capture.toml"))


def _grid(texels: str, width: float, height: float) -> Grid:
    from gonio.capture.rectification import Grid

    columns, rows = parse.size(texels)
    if not 0 < width < float("inf") or not 0 <= height < float("inf"):
        raise ParameterError(f"--width {width:g} --height {height:g}: positive lengths are wanted.")
    texel = width / columns
    if height and "x" not in texels.lower():
        rows = max(1, round(height / texel))
    if height and abs(rows * texel - height) > 0.501 * texel:
        raise ParameterError(
            f"--texels {columns}x{rows} on {width:g} by {height:g} are not square: write --texels "
            f"{columns}x{max(1, round(height / texel))}."
        )
    return Grid((rows, columns), texel)


def _clicked(text: str) -> np.ndarray:
    import numpy as np

    values = parse.numbers(text) if text else (0.0,) * 8
    if len(values) != 8:
        raise ParameterError(f"--corners {text} has {len(values)} numbers; x,y of four corners are eight.")
    return np.array(values).reshape(4, 2)


def _board(text: str, square: float) -> Board | None:
    from gonio.capture.checkerboard import Board

    if not text:
        return None
    columns, rows = parse.size(text)
    return Board((rows, columns), square)


def _pair(text: str) -> tuple[float, float]:
    values = parse.numbers(text)
    if len(values) != 2:
        raise ParameterError(f"--centre {text} has {len(values)} numbers; x,y are two.")
    return values[0], values[1]


def _calibrated(
    scene: Capture, capture: Path, shown: Capture, boards: Path, pattern: Board, flat: str, terms: int
) -> tuple[Any, np.ndarray, dict[str, Any]]:
    """The camera in the frame of the board that lies flat, its corners there, and what there is to say of it."""
    import numpy as np

    from gonio.capture.checkerboard import calibrate_camera, find_corners, pose_of_board

    size = tuple(scene.photographs.size)
    if tuple(shown.photographs.size) != size:
        raise FileError(
            f"{boards} has photographs of {tuple(shown.photographs.size)} pixels, {capture} of {size}: take them with "
            "one camera, and crop or turn none."
        )
    among, k = _named(flat, {boards: shown, capture: scene})
    found, kept, lying = [], [], None
    for at, name in enumerate(shown.photographs.names):
        try:
            found.append(find_corners(shown.photographs.read(at).radiance, pattern))
        except ArrayError as error:
            if among is shown and at == k:
                raise ArrayError(f"{boards}: {name}: {error}") from error
            typer.echo(f"{boards}: {name} is left out: {error}", err=True)
            continue
        kept.append(name)
        if among is shown and at == k:
            lying = found[-1]
    try:
        calibration = calibrate_camera(found, pattern, (size[0], size[1]), terms)
        if lying is None:
            lying = find_corners(among.photographs.read(k).radiance, pattern)
        pose = pose_of_board(lying, pattern, calibration.camera)
    except ArrayError as error:
        raise ArrayError(f"{boards}: {error}") from error
    lens, usual = calibration.camera, float(np.median(calibration.residual))
    for name, residual in zip(kept, calibration.residual, strict=True):
        if residual > max(_ODD * usual, 0.5):
            typer.echo(f"{boards}: corners of {name} are {residual:.2f} pixels off, others {usual:.2f}", err=True)
    facts = {
        "boards": len(found),
        "fx, fy, cx, cy": [round(x, 2) for x in (lens.fx, lens.fy, lens.cx, lens.cy)],
        "standard errors of them": [round(float(x), 2) for x in calibration.error],
        "corners off, pixels rms": float(np.sqrt(np.mean(calibration.residual**2))),
    }
    return dataclasses.replace(lens, pose=pose), lying, facts


def _named(flat: str, places: dict[Path, Capture]) -> tuple[Capture, int]:
    """Which photograph is called `flat`, with its suffix or without."""
    for scene in places.values():
        for k, name in enumerate(scene.photographs.names):
            if flat in (name, Path(name).name, Path(name).stem):
                return scene, k
    raise FileError(f"--flat {flat} is neither in {' nor in '.join(map(str, places))}.")


def _turned(scene: Capture, view: Any) -> Any:
    """The lights, told in the frame of the capture's camera, in that of the plane."""
    import numpy as np

    import gonio as gn
    from gonio.capture.rectification import moved_lights

    if scene.lights is None:
        return None
    before = np.asarray(scene.camera.pose)
    if isinstance(scene.camera, gn.Pinhole):
        return moved_lights(scene.lights, view.pose @ np.linalg.inv(before))
    turn = np.eye(4)
    turn[:3, :3] = view.pose[:3, :3] @ before[:3, :3].T
    if scene.directions is None:
        raise ParameterError(
            "the capture's lights are near, and its camera's place among them is not known. Survey them from the "
            "rectified photographs, or say --in-plane if they are told in the sample's frame."
        )
    return moved_lights(scene.lights, turn)


def _written(folder: Path, stem: str, radiance: np.ndarray, clipped: np.ndarray) -> tuple[str, int]:
    """The name of the image written, and how many clipped texels it has without a mark."""
    import numpy as np

    import gonio as gn

    top = float(radiance.max())
    # Sums of weights that make 1 may be a rounding more.
    if radiance.min() < 0 or not _DARK <= top <= 1 + 1e-5:
        gn.write_image(folder / f"{stem}.exr", radiance)
        return f"{stem}.exr", int(clipped.sum())
    # A reader takes the brightest code for clipped, and no other: that of one channel tells it.
    codes = np.minimum(radiance, 65534 / 65535)
    at = np.nonzero(clipped)
    codes[(*at, radiance[at].argmax(axis=-1))] = 1
    gn.write_image(folder / f"{stem}.png", codes, "linear", bits=16)
    return f"{stem}.png", 0
