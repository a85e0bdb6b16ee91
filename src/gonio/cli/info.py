"""`gonio info`: what a file holds, said by gonio's own readers."""

from __future__ import annotations

import json
import math
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from ..brdf.facet_mixture import FacetMixture
    from ..capture.model import Capture
    from ..capture.turntable import Turntable

IMAGES = (".exr", ".hdr", ".pic", ".pfm", ".png", ".tif", ".tiff", ".jpg", ".jpeg", ".tga")
RAW = (".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2")
BRDFS = (".binary", ".bsdf", ".brdf")
MESHES = (".obj", ".ply", ".stl", ".off")
MAPS = (".gonio", ".ktx2")
FITS = ".json"
CAPTURES = (".lp", ".toml")


def info(
    files: list[Path] = typer.Argument(..., help="Images, environment maps, BRDFs, meshes; folders of captures."),
    as_json: bool = typer.Option(False, "--json", help="One JSON object a file, a line each."),
    picture: Path | None = typer.Option(None, "--picture", help="A PNG to look at: an image, or the lobes of BRDFs."),
    pixels: str = typer.Option("", "--pixels", help="Of a .gonio, whose lobes or facets to draw: row,column;..."),
) -> None:
    """Say what files hold: sizes, formats, ranges, albedos, what looks wrong."""
    if picture:
        _draw(files, picture, pixels)
    for path in files:
        facts = describe(path)
        if as_json:
            typer.echo(json.dumps({"file": str(path), **facts}, default=str))
            continue
        typer.echo(str(path))
        width = max(map(len, facts))
        for name, value in facts.items():
            typer.echo(f"  {name:<{width}}  {_worded(value)}")


def describe(path: Path) -> dict[str, Any]:
    """The facts of one file, by name. Raises `FileError` where nothing can be said."""
    from gonio.errors import FileError

    suffix = path.suffix.lower()
    if path.is_dir() or suffix in CAPTURES or path.name.startswith("transforms"):
        return _capture(path)
    if suffix in IMAGES + RAW:
        return _image(path)
    if suffix in BRDFS:
        return _brdf(path)
    if suffix in MESHES:
        return _mesh(path)
    if suffix in MAPS:
        return _gonio(path) if suffix == ".gonio" else _texture(path)
    if suffix == FITS:
        return _fits(path)
    known = " ".join((*IMAGES, *BRDFS, FITS, *MESHES, *MAPS))
    raise FileError(f"{path}: not a kind of file that gonio knows ({known}, and camera raw).")


def _draw(files: list[Path], picture: Path, pixels: str) -> None:
    """One image, exposed for its own brightness, or the lobes of BRDF files together."""
    import gonio as gn
    from gonio.errors import ParameterError
    from gonio.viewer.plots import lobes

    if picture.suffix.lower() != ".png":
        raise ParameterError(f"--picture {picture}: the picture is a PNG; end its name in .png.")
    kinds = {path.suffix.lower() for path in files}
    if len(files) == 1 and (files[0].is_dir() or kinds <= set(CAPTURES)):
        from gonio.viewer.captures import contact_sheet

        contact_sheet(picture, _captured(files[0]))
        return
    if len(files) == 1 and kinds == {".gonio"}:
        _draw_lobes(files[0], picture, pixels)
    elif kinds <= set(BRDFS):
        lobes(picture, {path.stem: gn.read_brdf(path) for path in files})
    elif len(files) == 1 and kinds <= set(IMAGES + RAW):
        gn.write_image(picture, gn.tone_map(gn.read_image(files[0]).clip(0), exposure=None))
    else:
        raise ParameterError("--picture shows one image, capture or shared material, or BRDF files together.")


def _draw_lobes(path: Path, picture: Path, pixels: str) -> None:
    """The lobes of a shared material, or the facets of a mixture, at pixels of its view."""
    import gonio as gn
    from gonio.brdf.facet_mixture import FacetMixture
    from gonio.errors import ParameterError
    from gonio.viewer.facets import facets_picture
    from gonio.viewer.lobes import lobes_picture, spread_pixels

    from . import parse

    thing = gn.read_relightable(path)
    mask = thing.view.mask
    chosen = spread_pixels(mask)
    if pixels:
        chosen = []
        for text in pixels.split(";"):
            place = parse.numbers(text)
            if len(place) != 2 or not all(0 <= k < n and k == int(k) for k, n in zip(place, mask.shape, strict=True)):
                raise ParameterError(f"--pixels {text}: row,column within {mask.shape} is wanted.")
            row, column = int(place[0]), int(place[1])
            if not mask[row, column]:
                raise ParameterError(f"--pixels {text}: nothing was seen there.")
            chosen.append((row, column))
        if len(chosen) > 6:
            raise ParameterError(f"--pixels {pixels}: {len(chosen)} pixels; six at most are drawn.")
    (facets_picture if isinstance(thing.material, FacetMixture) else lobes_picture)(picture, thing, chosen)


def _image(path: Path) -> dict[str, Any]:
    import numpy as np

    import gonio as gn
    from gonio.colour import luminance

    header = gn.image_info(path)
    image = gn.read_image(path)
    bright = np.asarray(luminance(image))
    facts: dict[str, Any] = {
        "kind": "image",
        "format": header.format,
        "columns": header.columns,
        "rows": header.rows,
        "channels": list(header.channels),
        "samples": header.dtype,
        "encoding": header.encoding or "not stated",
        "mean": image.mean(axis=(0, 1), dtype=np.float64).tolist(),
        "luminance": {
            name: float(of(bright)) for name, of in (("least", np.min), ("median", np.median), ("most", np.max))
        },
    }
    layout = _layout(path)
    if layout:
        facts["environment map"] = layout
    attributes = {
        # NaN and infinity are no JSON.
        k: v
        for k, v in header.attributes.items()
        if isinstance(v, str | int) or (isinstance(v, float) and math.isfinite(v))
    }
    if attributes:
        facts["attributes"] = attributes
    return facts


def _layout(path: Path) -> str:
    """What the picture would be taken for as an environment map; empty where its shape fits none."""
    from gonio.errors import FileError
    from gonio.files.environments import layout_of

    try:
        mapping, orientation = layout_of(path)
    except FileError:
        return ""
    return f"{type(mapping).__name__}, orientation {orientation.name}"


def _brdf(path: Path) -> dict[str, Any]:
    import numpy as np

    import gonio as gn

    brdf = gn.read_brdf(path)
    angles = np.array([0.0, 30.0, 60.0, 80.0])
    # Two digits tell a material; scattered measurements take ten times as long to four.
    albedo = np.asarray(gn.albedo(brdf, gn.from_spherical(np.radians(angles), 0.0), tolerance=1e-2))
    facts = {
        "kind": "BRDF",
        "model": type(brdf).__name__,
        **{f"albedo at {angle:g} degrees": row.tolist() for angle, row in zip(angles, albedo, strict=True)},
    }
    if albedo.max() > 1.01:
        facts["looks wrong"] = f"more light leaves than arrives at {angles[albedo.max(axis=1).argmax()]:g} degrees"
    return facts


def _captured(path: Path) -> Capture | Turntable:
    """What is sound of a capture. That its encoding is not stated is among its facts."""
    import gonio as gn
    from gonio.errors import EncodingWarning

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", EncodingWarning)
        return gn.read_capture(path, partial=True)


def _capture(path: Path) -> dict[str, Any]:
    import gonio as gn
    from gonio.capture.lighting import is_near
    from gonio.lights.uneven import Uneven

    capture = _captured(path)
    photographs = capture.photographs
    files = getattr(photographs, "photographs", photographs)  # beneath what the lens leaves of light
    exposures = getattr(photographs, "times", ())
    facts: dict[str, Any] = {
        "kind": "capture",
        "layout": capture.layout,
        "photographs": len(photographs),
        **({"exposures, seconds": list(exposures)} if exposures else {}),
        "rows": photographs.size[0],
        "columns": photographs.size[1],
        "lights": "unknown" if capture.lights is None else len(capture.lights),
        "encoding": "not stated" if getattr(files, "assumed", False) else "stated",
    }
    told = capture.lights or ()
    near = sum(is_near(light) for light in told)
    if near:
        facts["near lights"] = near
    uneven = sum(isinstance(light, Uneven) for light in told)
    if uneven:
        facts["lights with a measured falloff"] = uneven
    if isinstance(capture, gn.Capture):
        facts["object"] = f"{capture.mask.mean():.1%} of the pixels"
        facts["normals"] = "given" if capture.normals is not None else "unknown"
    else:
        facts["places"] = len({tuple(camera.position) for camera in capture.cameras})
        facts["shape"] = "unknown" if capture.shape is None else f"{len(capture.shape.faces)} faces"
    if capture.findings:
        facts["looks wrong"] = "; ".join(capture.findings)
    return facts


def _fits(path: Path) -> dict[str, Any]:
    import gonio as gn

    fits = gn.read_merl_fits(path)
    return {
        "kind": "fits of BRDFs",
        "models": sorted({type(fit).__name__ for fit in fits.values()}),
        "materials": list(fits),
        "as a BRDF": f"--brdf {path}:{next(iter(fits))}",
    }


def _mesh(path: Path) -> dict[str, Any]:
    import gonio as gn

    mesh = gn.read_mesh(path)
    low, high = mesh.bounds
    return {
        "kind": "mesh",
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "texture coordinates": mesh.uv is not None,
        "low": low.tolist(),
        "high": high.tolist(),
    }


def _gonio(path: Path) -> dict[str, Any]:
    from gonio.files.archive import kind_of

    return {"relightable": _relightable, "precomputed": _precomputed}.get(kind_of(path), _shrm)(path)


def _relightable(path: Path) -> dict[str, Any]:
    import numpy as np

    import gonio as gn
    from gonio.brdf.combine import Scaled, Sum
    from gonio.brdf.facet_mixture import FacetMixture
    from gonio.brdf.radial import Radial

    thing = gn.read_relightable(path)
    facts: dict[str, Any] = {
        "kind": "facet material" if isinstance(thing.material, FacetMixture) else "shared material",
        "rows": thing.view.mask.shape[0],
        "columns": thing.view.mask.shape[1],
        "object": f"{thing.view.mask.mean():.1%} of the pixels",
        "shape": "unknown" if thing.shape is None else f"{len(thing.shape.faces)} faces",
    }
    if thing.residuals is not None:
        facts["residuals"] = f"of {len(thing.residuals.images)} photographs"
    if isinstance(thing.material, FacetMixture):
        return facts | _facets(thing.material) | {"bytes": path.stat().st_size}
    for k, given in enumerate(thing.material.terms if isinstance(thing.material, Sum) else (thing.material,)):
        term = given.model if isinstance(given, Scaled) else given
        if isinstance(term, FacetMixture):
            facts[f"term {k}"] = _facets(term)
            continue
        assert isinstance(term, Radial)
        of = term.interpolant
        facts[f"term {k}"] = (
            f"{len(of.centres)} centres in {of.centres.shape[1]} dimensions, {of.coefficients.shape[1]} channels, "
            f"of {'log f' if term.logarithm else 'f'}"
        )
        facts[f"scales of term {k}"] = np.asarray(of.scales).tolist()
    return facts


def _facets(material: FacetMixture) -> dict[str, Any]:
    import numpy as np

    from gonio.arrays import to_numpy

    grid, tables = material.basis.grid, to_numpy(material.basis.tables)
    facts = {
        "representatives": len(tables),
        "grid": f"{grid.rows} x {grid.columns}, warp {grid.warp:g}",
        "pairs a texel": material.indices.shape[-1],
        "median eta": float(np.median(material.eta)),
        **{
            f"mean {name}": [float(x) for x in np.atleast_1d(value.mean(axis=tuple(range(value.ndim - 1))))]
            for name in ("k_d", "k_s")
            for value in [to_numpy(getattr(material, name))]
        },
    }
    if material.basis.trust is not None:
        # Of all texels, by what each table adds to them.
        drawn = np.clip(to_numpy(material.weights), 0, None)
        drawn, indices = np.broadcast_arrays(drawn / drawn.sum(axis=-1, keepdims=True), to_numpy(material.indices))
        use = np.bincount(indices.ravel(), drawn.ravel(), minlength=len(tables))
        trust = to_numpy(material.basis.trust)
        kinds = {"own data": trust == 255, "others": (trust > 0) & (trust < 255), "no data": trust == 0}
        told = [np.einsum("krc,r,k->", tables * where, grid.projected, use) for where in kinds.values()]
        facts["facets told by"] = {name: float(part / sum(told)) for name, part in zip(kinds, told, strict=True)}
    return facts


def _precomputed(path: Path) -> dict[str, Any]:
    import gonio as gn

    held = gn.read_precomputed(path)
    return {
        "kind": "precomputed view",
        "made": held.made,
        "rows": held.mask.shape[0],
        "columns": held.mask.shape[1],
        "error": held.error,
        "cells of light": len(held.cells),
        "lights": held.lights.shape[1],
        "images of a block": float(held.ranks.mean()),
    }


def _shrm(path: Path) -> dict[str, Any]:
    import gonio as gn

    shrm = gn.read_shrm(path)
    return {
        "kind": "SHRM",
        "made": shrm.made,
        "error": shrm.error,
        **{
            f"lobe {k}": f"about the {lobe.about.value} direction, F = {lobe.degree}, P = {lobe.exit_degree}"
            for k, lobe in enumerate(shrm.lobes)
        },
    }


def _texture(path: Path) -> dict[str, Any]:
    import gonio as gn

    texture = gn.read_ktx2(path)
    first = texture.levels[0]
    return {
        "kind": "texture",
        "format": "KTX 2.0",
        "columns": first.shape[-2],
        "rows": first.shape[-3],
        "faces": 6 if first.ndim == 4 else 1,
        "levels": len(texture.levels),
        **texture.text,
    }


def _worded(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{k} {_worded(v)}" for k, v in value.items())
    if isinstance(value, list):
        return " ".join(_worded(v) for v in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
