"""SHRMs in .gonio files (`archive.py`): kind "shrm", with their error, and how they were made.

gonio.json      error, made, lobes: [{about: "normal" or "mirror", exit_cosine}, ...]
lobe-K.npy      coefficients of lobe K, ((J+1)^2, (P+1)^2, C) float32 or float64
"""

from __future__ import annotations

import math
import os
from typing import Any

import numpy as np

from ..arrays import frozen, to_numpy
from ..errors import FileError
from ..rendering.orders import About
from ..rendering.shrm import SHRM, ReflectedLobe
from .archive import read_archive, write_archive

_KIND, _VERSION = "shrm", 1


def write_shrm(path: str | os.PathLike[str], shrm: SHRM) -> None:
    """Write `shrm`, whole or not at all. Raises `FileError` where the system refuses."""
    lobes = [{"about": lobe.about.value, "exit_cosine": lobe.exit_cosine} for lobe in shrm.lobes]
    arrays = {f"lobe-{k}": to_numpy(lobe.coefficients) for k, lobe in enumerate(shrm.lobes)}
    write_archive(path, _KIND, _VERSION, {"error": shrm.error, "made": shrm.made, "lobes": lobes}, arrays)


def read_shrm(path: str | os.PathLike[str]) -> SHRM:
    """The SHRM in a .gonio file. Raises `FileError` naming the file and the field at fault."""
    fields, arrays = read_archive(path, _KIND, _VERSION)
    error, made, lobes = fields.get("error"), fields.get("made"), fields.get("lobes")
    if not isinstance(error, int | float) or not 0 <= error < math.inf:
        raise FileError(f"{path}: the field 'error' is {error!r}; a number of 0 or more is wanted.")
    if not isinstance(made, str):
        raise FileError(f"{path}: the field 'made' is {made!r}; words are wanted.")
    if not isinstance(lobes, list) or not lobes:
        raise FileError(f"{path}: the field 'lobes' is no list of one or more.")
    return SHRM(tuple(_lobe(path, k, lobe, arrays) for k, lobe in enumerate(lobes)), float(error), made)


def _lobe(path: str | os.PathLike[str], k: int, fields: Any, arrays: dict[str, np.ndarray]) -> ReflectedLobe:
    about = fields.get("about") if isinstance(fields, dict) else None
    if about not in {member.value for member in About} or not isinstance(fields.get("exit_cosine"), bool):
        raise FileError(f"{path}: lobes[{k}] is {fields!r:.80}; it has 'about', normal or mirror, and 'exit_cosine'.")
    c = arrays.get(f"lobe-{k}")
    if c is None:
        raise FileError(f"{path}: lobe-{k}.npy is missing.")
    squares = c.ndim == 3 and all(n > 0 and math.isqrt(n) ** 2 == n for n in c.shape[:2]) and c.shape[2] in (1, 3)
    if not squares or c.shape[0] < c.shape[1] or c.dtype.kind != "f" or not np.all(np.isfinite(c)):
        raise FileError(
            f"{path}: lobe-{k}.npy is {c.dtype} {c.shape}, or not finite; ((J+1)^2, (P+1)^2, 1 or 3) floats are wanted."
        )
    return ReflectedLobe(frozen(c, c.dtype), About(about), fields["exit_cosine"])
