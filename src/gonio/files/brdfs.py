"""Any measured BRDF by its file: which reader a file wants is told by its first bytes, and by its suffix."""

from __future__ import annotations

import os
import struct
from pathlib import Path

from ..brdf.model import BRDF
from ..brdf.table import MERL_SHAPE
from ..errors import FileError
from .cornell import read_cornell
from .merl import read_merl
from .rgl import read_rgl
from .tensors import MAGIC

_KNOWN = "MERL (.binary), RGL (.bsdf), Cornell's scattered measurements as in pbrt-v2 (.brdf)"


def read_brdf(path: str | os.PathLike[str]) -> BRDF:
    """The measured BRDF of a MERL, RGL or Cornell file, whatever its name where the content tells.

    Raises `FileError` where the file is none of them (it lists what is known), or is broken.
    """
    try:
        with Path(path).open("rb") as stream:
            head = stream.read(64)
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error
    if head.startswith(MAGIC):
        return read_rgl(path)
    if head.startswith(struct.pack("<3i", *MERL_SHAPE)):
        return read_merl(path)
    suffix = Path(path).suffix.lower()
    if head.startswith(b"analytic"):
        raise FileError(f"{path} is a formula for BRDF Explorer, which would have to be run. Known are {_KNOWN}.")
    readers = {".binary": read_merl, ".bsdf": read_rgl, ".brdf": read_cornell}
    if suffix not in readers:
        raise FileError(f"{path} is no BRDF file that can be read. Known are {_KNOWN}.")
    return readers[suffix](path)
