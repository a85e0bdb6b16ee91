"""What reflectance sharing or microfacet synthesis found of one view, in .gonio files (`archive.py`): "relightable".

gonio.json      made; terms: [{logarithm, folded, flat, rho, reach}, ...], the Radial models that add up, and mixtures
                of facets, {model: "facets", ...}, with arrays of their own (`facets.py`)
term-K-NAME.npy centres (N, d), scales (d,), coefficients (N, C), polynomial (d + 1, C), limits (2, C), of term K;
                samples (K, d), sample-scales (d,) where they are known, with reach: its coverage;
                x, y (rows, columns) where it is spatial; factor (rows, columns, C) or (C,) where it is scaled, also of
                facets
NAME.npy        mask (rows, columns) bool; position, lifted, normal, tangent, wo (sites, 3) of the mask, along its rows
vertices, faces, uv.npy    of the shape, where it is known
residual-directions (N, 3), residual-images (N, sites, 3), in half floats, times residuals: {reach, noise, scale} of
                gonio.json, where they are kept (`rendering/residuals.py`)
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from ..arrays import to_numpy
from ..brdf.combine import Scaled, Sum
from ..brdf.coverage import Coverage
from ..brdf.facet_mixture import FacetMixture
from ..brdf.model import BRDF
from ..brdf.radial import Interpolant, Radial
from ..errors import FileError, GonioError
from ..rendering.relight import Relightable
from ..rendering.residuals import Residuals
from ..shapes.mesh import Mesh
from ..shapes.view import View
from .archive import read_archive, required, write_archive
from .facets import MODEL, facet_term, read_facet_term

_KIND, _VERSION = "relightable", 1
_VIEW = ("position", "lifted", "normal", "tangent", "wo")
_FLAGS = ("logarithm", "folded", "flat")
_INTERPOLANT = ("centres", "scales", "coefficients", "polynomial")


def write_relightable(path: str | os.PathLike[str], thing: Relightable, made: str = "") -> None:
    """Write `thing`, with words on how it was made, whole or not at all.

    Raises `FileError` where its material is another than Radial models and FacetMixtures, scaled or not, and their
    sums.
    """
    terms: list[dict[str, Any]] = []
    arrays: dict[str, np.ndarray] = {}
    for k, term in enumerate(thing.material.terms if isinstance(thing.material, Sum) else (thing.material,)):
        if isinstance(term, Scaled):
            arrays[f"term-{k}-factor"] = to_numpy(term.factor)
            term = term.model
        if isinstance(term, FacetMixture):
            entry, own = facet_term(path, k, term)
            terms.append(entry)
            arrays |= own
            continue
        if not isinstance(term, Radial):
            raise FileError(f"{path}: a {type(term).__name__} is not written; Radial models and FacetMixtures are.")
        terms.append({name: getattr(term, name) for name in _FLAGS} | {"rho": term.interpolant.rho})
        if term.coverage is not None:
            terms[-1]["reach"] = term.coverage.reach
            arrays[f"term-{k}-samples"] = to_numpy(term.coverage.points)
            arrays[f"term-{k}-sample-scales"] = to_numpy(term.coverage.scales)
        arrays |= {f"term-{k}-{name}": to_numpy(getattr(term.interpolant, name)) for name in _INTERPOLANT}
        if term.interpolant.limits is not None:
            arrays[f"term-{k}-limits"] = to_numpy(term.interpolant.limits)
        arrays |= {
            f"term-{k}-{name}": to_numpy(getattr(term, name)) for name in "xy" if getattr(term, name) is not None
        }
    fields: dict[str, Any] = {"made": made, "terms": terms}
    if (kept := thing.residuals) is not None:
        scale = max(float(np.abs(kept.images).max()), 1e-30)
        fields["residuals"] = {"reach": kept.reach, "noise": kept.noise, "scale": scale}
        arrays["residual-directions"] = kept.directions
        arrays["residual-images"] = (kept.images / scale).astype(np.float16)
    view = thing.view
    arrays["mask"] = view.mask
    arrays |= {name: getattr(view, name)[view.mask].astype(np.float32) for name in _VIEW}
    if thing.shape is not None:
        of = {name: getattr(thing.shape, name) for name in ("vertices", "faces", "uv")}
        arrays |= {name: to_numpy(array) for name, array in of.items() if array is not None}
    write_archive(path, _KIND, _VERSION, fields, arrays)


def read_relightable(path: str | os.PathLike[str]) -> Relightable:
    """What `write_relightable` wrote. Raises `FileError` naming the file and the field at fault."""
    fields, arrays = read_archive(path, _KIND, _VERSION)
    terms = fields.get("terms")
    if not isinstance(terms, list) or not terms:
        raise FileError(f"{path}: the field 'terms' is no list of one or more.")
    try:
        models = []
        for k, term in enumerate(terms):
            factor, model = arrays.get(f"term-{k}-factor"), _term(path, k, term, arrays)
            models.append(model if factor is None else Scaled(model, factor))
        material = models[0] if len(models) == 1 else Sum(tuple(models))
        shape = None
        if "vertices" in arrays:
            vertices, faces = (required(path, arrays, name) for name in ("vertices", "faces"))
            shape = Mesh(vertices, faces, arrays.get("uv"))
        return Relightable(_view(path, arrays), material, shape, _residuals(path, fields, arrays))
    except FileError:
        raise
    except GonioError as error:
        raise FileError(f"{path}: {error}") from error


def _term(path: str | os.PathLike[str], k: int, term: Any, arrays: dict[str, np.ndarray]) -> BRDF:
    if isinstance(term, dict) and "model" in term:
        if term["model"] != MODEL:
            raise FileError(f"{path}: terms[{k}] has model = {term['model']!r:.40}; '{MODEL}' is known, or none.")
        return read_facet_term(path, k, term, arrays)
    if not isinstance(term, dict) or not all(isinstance(term.get(name), bool) for name in _FLAGS):
        raise FileError(f"{path}: terms[{k}] is {term!r:.80}; it has {', '.join(_FLAGS)}, each true or false.")
    own = {name: required(path, arrays, f"term-{k}-{name}") for name in _INTERPOLANT}
    rho = term.get("rho", 0.0)  # older files have none
    if not isinstance(rho, float | int) or isinstance(rho, bool):
        raise FileError(f"{path}: terms[{k}] has rho = {rho!r:.40}; a number is wanted.")
    interpolant = Interpolant(**own, limits=arrays.get(f"term-{k}-limits"), rho=float(rho))
    coverage = None
    if (samples := arrays.get(f"term-{k}-samples")) is not None:
        reach = term.get("reach")
        if not isinstance(reach, float):
            raise FileError(f"{path}: terms[{k}] has reach = {reach!r:.40}; a number is wanted where it has samples.")
        coverage = Coverage(samples, required(path, arrays, f"term-{k}-sample-scales"), reach)
    return Radial(
        interpolant,
        coverage=coverage,
        x=arrays.get(f"term-{k}-x"),
        y=arrays.get(f"term-{k}-y"),
        **{name: term[name] for name in _FLAGS},
    )


def _residuals(path: str | os.PathLike[str], fields: dict[str, Any], arrays: dict[str, np.ndarray]) -> Residuals | None:
    told = fields.get("residuals")
    if told is None:
        return None
    names = ("reach", "noise", "scale")
    if not isinstance(told, dict) or not all(type(told.get(name)) in (int, float) for name in names):
        raise FileError(f"{path}: the field 'residuals' is {told!r:.80}; it has {', '.join(names)}, numbers.")
    reach, noise, scale = (float(told[name]) for name in names)
    images = required(path, arrays, "residual-images").astype(np.float32) * scale
    return Residuals(required(path, arrays, "residual-directions"), images, reach, noise)


def _view(path: str | os.PathLike[str], arrays: dict[str, np.ndarray]) -> View:
    mask = required(path, arrays, "mask")
    if mask.ndim != 2 or mask.dtype != np.bool_:
        raise FileError(f"{path}: mask.npy is {mask.dtype} {mask.shape}; pixels of bool are wanted.")
    count = int(np.count_nonzero(mask))
    of = {name: required(path, arrays, name).astype(np.float64) for name in _VIEW}
    for name, array in of.items():
        if array.shape != (count, 3) or not np.isfinite(array).all():
            raise FileError(f"{path}: {name}.npy has shape {array.shape}, or is not finite; {(count, 3)} is wanted.")
        if name in ("normal", "tangent", "wo"):
            length = np.linalg.norm(array, axis=1, keepdims=True)
            if not np.all(np.abs(length - 1) < 1e-3):
                raise FileError(f"{path}: {name}.npy holds vectors that are not unit.")
            of[name] = array / length
    row, column = np.nonzero(mask)
    rows, columns = mask.shape
    uv = np.stack(((column + 0.5) / columns, 1 - (row + 0.5) / rows), axis=-1)
    return View.of(mask, geometric=of["normal"], uv=uv, distance=np.zeros(count), **of)
