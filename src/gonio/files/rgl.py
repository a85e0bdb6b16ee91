"""RGL's measured materials (`.bsdf`), of the database at rgl.epfl.ch/materials: tensor files of Dupuy and Jakob 2018.

    theta_i [T], phi_i [P], ndf, sigma [..,..], vndf [P,T,..,..], luminance [P,T,n,n], jacobian u8 [1], description u8
    and rgb [P,T,3,n,n],  or  spectra [P,T,L,n,n] with wavelengths [L] in nm

Spectra become linear sRGB under D65 (`colour.spectrum_to_rgb`); the conversion is linear, as all interpolation is, so
that it is the same before and after. Not here: the container (`tensors.py`) and the look-ups (`brdf/adaptive.py`).
"""

from __future__ import annotations

import os

import numpy as np

from ..brdf.adaptive import AdaptiveTable
from ..colour import spectrum_to_rgb
from ..errors import ArrayError, FileError
from .tensors import read_tensors

_FIELDS = {"theta_i": "theta", "phi_i": "phi", "ndf": "ndf", "sigma": "sigma", "vndf": "vndf", "luminance": "luminance"}


def read_rgl(path: str | os.PathLike[str]) -> AdaptiveTable:
    """The BRDF of an RGL `.bsdf` file, isotropic or anisotropic, RGB in 1/sr.

    The files' `theta_i`, `phi_i` are taken for the eye's direction, as Mitsuba's `measured` does. Saturated colours
    have slightly negative components in sRGB; f is clipped at zero there.
    Raises `FileError` where a field is missing, or its size or values make no sense.
    """
    tensors = read_tensors(path)
    spectral = "spectra" in tensors and "wavelengths" in tensors
    missing = [name for name in (*_FIELDS, "jacobian") if name not in tensors]
    if not spectral and "rgb" not in tensors:
        missing.append("rgb (or spectra and wavelengths)")
    if missing:
        raise FileError(f"{path}: no field {', '.join(missing)}: it is a tensor file, but no RGL material.")
    if tensors["jacobian"].size != 1 or tensors["jacobian"].dtype != np.uint8:
        raise FileError(f"{path}: jacobian has shape {tensors['jacobian'].shape}; it is one byte.")
    try:
        if "rgb" in tensors:
            rgb = tensors["rgb"]
        else:
            spectra = tensors["spectra"]
            if spectra.ndim != 5 or spectra.dtype.kind != "f":
                raise ArrayError(
                    f"spectra has shape {spectra.shape} and dtype {spectra.dtype}; expected 5 axes of floats."
                )
            rgb = np.moveaxis(spectrum_to_rgb(tensors["wavelengths"], np.moveaxis(spectra, 2, -1)), -1, 2)
        return AdaptiveTable(
            **{ours: tensors[theirs] for theirs, ours in _FIELDS.items()},
            rgb=rgb,
            jacobian=bool(tensors["jacobian"].ravel()[0]),
            description=tensors.get("description", np.empty(0, np.uint8)).tobytes().decode("utf-8", "replace"),
        )
    except ArrayError as error:
        raise FileError(f"{path}: {error}") from error
