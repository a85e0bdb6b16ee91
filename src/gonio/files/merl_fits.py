"""Published fits to the MERL materials, as JSON: an object of materials, each an object of parameters.

    ABC (Löw et al. 2012)       kD [3], A [3], B, C, ior
    SGD (Bagher et al. 2012)    rhoD, rhoS, alpha, p, kap, f0, f1, lambda, c, k, theta0, each [3]

Other keys (names, errors) are passed over. The models are in `brdf/merl_models.py`.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from ..brdf.merl_models import ABC, ShiftedGamma
from ..errors import FileError, GonioError

_LARGEST = 2**24  # bytes: all hundred materials take 60 KB

_ABC = {"kD": "kd", "A": "a", "B": "b", "C": "c", "ior": "ior"}
_SGD = {
    "rhoD": "kd",
    "rhoS": "ks",
    "alpha": "alpha",
    "p": "p",
    "kap": "scale",
    "f0": "f0",
    "f1": "f1",
    "lambda": "shadow",
    "c": "c",
    "k": "k",
    "theta0": "theta_0",
}


def read_merl_fits(path: str | os.PathLike[str]) -> dict[str, ABC | ShiftedGamma]:
    """The models of a file of fits by the names of their materials.

    Raises `FileError`, which names the material and the parameter, where the file is none, or a parameter is missing,
    no number, or outside its range.
    """
    try:
        size = Path(path).stat().st_size
        text = Path(path).read_bytes() if size <= _LARGEST else b""
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error
    if size > _LARGEST:
        raise FileError(f"{path} has more than {_LARGEST} bytes: no file of fits.")
    try:
        materials = json.loads(text)
    except ValueError as error:
        raise FileError(f"{path} is no JSON: {error}.") from error
    if not isinstance(materials, dict) or not materials:
        raise FileError(f"{path} holds no materials by name.")
    return {name: _model(f"{path}: {name}", fit) for name, fit in materials.items()}


def _model(where: str, fit: Any) -> ABC | ShiftedGamma:
    if not isinstance(fit, dict):
        raise FileError(f"{where} is no object of parameters.")
    kind, names = (ABC, _ABC) if "kD" in fit else (ShiftedGamma, _SGD)
    missing = [name for name in names if name not in fit]
    if missing:
        raise FileError(f"{where} has no {', '.join(missing)}; it is neither a fit by ABC nor by SGD.")
    values = {}
    for name, ours in names.items():
        try:
            values[ours] = np.array(fit[name], dtype=np.float64)
        except (TypeError, ValueError):
            raise FileError(f"{where}: {name} is no number or list of numbers.") from None
        if values[ours].shape != ((3,) if kind.bounds[ours].colour else ()):
            raise FileError(f"{where}: {name} has shape {values[ours].shape}.")
    try:
        return kind(**values)
    except GonioError as error:
        raise FileError(f"{where}: {error}") from error
