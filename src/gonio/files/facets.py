"""Mixtures of tabulated facet distributions (`brdf/facet_mixture.py`) as a term K of a .gonio (`relightable.py`).

terms[K]         {model: "facets", rows, columns, warp}: the polar grid of the tables
term-K-tables    (M, rows, columns) D in 1/sr; each is divided by its integral of (n.h) D when read
term-K-trust     (M, rows, columns) uint8, where it is known: 255 own data, about half others', 0 filled
term-K-indices   (..., k) uint16, int32 where M > 65536; of the tables
term-K-weights   (..., k), divided by their sum when read
term-K-k_d, -k_s (..., C) or (),   term-K-eta (...) or ()

Numbers are half floats where the greatest lies in [.01, 65504], so that half floats take 1/2000 of each and 3e-6 of the
greatest at most; single precision otherwise.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from ..arrays import Array, to_numpy
from ..brdf.facet_mixture import FacetBasis, FacetMixture
from ..brdf.polar_grid import PolarGrid
from ..errors import FileError, GonioError
from .archive import required

MODEL = "facets"
_NUMBERS = ("weights", "k_d", "k_s", "eta")
_HALF = (1e-2, 65504.0)
_MOST = 1 << 16  # tables that uint16 counts


def facet_term(
    path: str | os.PathLike[str], k: int, term: FacetMixture
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The entry of terms[k] and its arrays by name. Raises `FileError` for numbers beyond single precision."""
    grid, tables = term.basis.grid, term.basis.tables
    entry = {"model": MODEL, "rows": grid.rows, "columns": grid.columns, "warp": float(grid.warp)}
    arrays = {"tables": _packed(path, "tables", tables)}
    if term.basis.trust is not None:
        arrays["trust"] = to_numpy(term.basis.trust).astype(np.uint8, copy=False)
    arrays["indices"] = to_numpy(term.indices).astype(np.uint16 if len(tables) <= _MOST else np.int32)
    arrays |= {name: _packed(path, name, getattr(term, name)) for name in _NUMBERS}
    return entry, {f"term-{k}-{name}": array for name, array in arrays.items()}


def read_facet_term(
    path: str | os.PathLike[str], k: int, entry: dict[str, Any], arrays: dict[str, np.ndarray]
) -> FacetMixture:
    """What `facet_term` made. Raises `FileError` naming the file and the field at fault."""
    rows, columns, warp = (entry.get(name) for name in ("rows", "columns", "warp"))
    if type(rows) is not int or type(columns) is not int or not (type(warp) is int or type(warp) is float):
        raise FileError(f"{path}: terms[{k}] is {entry!r:.80}; rows and columns are whole numbers, warp a number.")
    own = {name: required(path, arrays, f"term-{k}-{name}") for name in ("tables", "indices", *_NUMBERS)}
    for name in ("tables", *_NUMBERS):
        if own[name].dtype not in (np.float16, np.float32) or not np.isfinite(own[name]).all():
            raise FileError(
                f"{path}: term-{k}-{name}.npy is {own[name].dtype}, or not finite; numbers in half or single precision "
                "are wanted. Write it again."
            )
    trust = arrays.get(f"term-{k}-trust")
    if trust is not None and trust.dtype != np.uint8:
        raise FileError(f"{path}: term-{k}-trust.npy is {trust.dtype}; uint8 is wanted.")
    weights = own["weights"].astype(np.float64)
    if weights.ndim < 1 or not np.all((total := weights.sum(axis=-1, keepdims=True)) > 0):
        raise FileError(f"{path}: term-{k}-weights.npy has shape {weights.shape}, or sums that are not positive.")
    try:
        basis = FacetBasis.of(PolarGrid(rows, columns, warp), own["tables"].astype(np.float32), trust)
        numbers = (own[name].astype(np.float64) for name in ("k_d", "k_s", "eta"))
        return FacetMixture(basis, own["indices"], weights / total, *numbers)
    except GonioError as error:
        raise FileError(f"{path}: term-{k}: {error}") from error


def _packed(path: str | os.PathLike[str], name: str, values: Array) -> np.ndarray:
    array = to_numpy(values)
    greatest = float(np.abs(array).max(initial=0.0))
    if greatest > float(np.finfo(np.float32).max):
        raise FileError(f"{path}: {name} = {greatest:.6g} is beyond single precision. Scale the material down.")
    half = greatest == 0 or _HALF[0] <= greatest <= _HALF[1]
    return array.astype(np.float16 if half else np.float32)
