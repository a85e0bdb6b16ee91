"""Scattered measurements of isotropic reflectance in Cornell's text format, as pbrt-v2 ships and reads it (`.brdf`).

    number of wavelengths, the wavelengths in nm, then for each sample
    theta_i phi_i theta_o phi_o (radians) and its values in 1/sr at the wavelengths;   # begins a comment

Spectra become linear sRGB under D65 (`colour.spectrum_to_rgb`). Not here: the look-ups (`brdf/scattered.py`).
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from ..brdf.scattered import ScatteredBRDF
from ..colour import spectrum_to_rgb
from ..directions import from_spherical
from ..errors import FileError, GonioError


def read_cornell(path: str | os.PathLike[str]) -> ScatteredBRDF:
    """The BRDF of a Cornell `.brdf` file, RGB in 1/sr.

    Saturated paints have slightly negative components in sRGB: they are taken for zero.
    Raises `FileError` where the text holds anything but numbers, their count does not fit, or values make no sense.
    """
    try:
        text = Path(path).read_text("ascii")
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error
    except UnicodeDecodeError as error:
        raise FileError(f"{path}: byte {error.start} is no plain text: it is no Cornell file.") from error
    words = [word for line in text.splitlines() for word in line.partition("#")[0].split()]
    try:
        numbers = np.array(words, dtype=np.float64)
    except ValueError as error:
        raise FileError(f"{path}: expected numbers only: {error}.") from error
    count = numbers[0] if len(numbers) else 0.0
    if not (2 <= count <= 10000 and count == int(count)):
        raise FileError(f"{path}: the number of wavelengths is {count:g}; expected a whole number from 2 to 10000.")
    n = int(count)
    wavelengths, rest = numbers[1 : n + 1], numbers[n + 1 :]
    if len(wavelengths) < n or len(rest) == 0 or len(rest) % (n + 4):
        raise FileError(
            f"{path}: {len(rest)} numbers follow {len(wavelengths)} of {n} wavelengths; "
            f"samples take {n + 4} each, so the file is cut short."
        )
    samples = rest.reshape(-1, n + 4)
    if not np.isfinite(samples).all():
        k = int(np.argwhere(~np.isfinite(samples).all(axis=1))[0, 0])
        raise FileError(f"{path}: sample {k} holds NaN or infinity.")
    elevations = samples[:, [0, 2]]
    if elevations.min() < 0 or elevations.max() > np.pi / 2 + 1e-6:
        raise FileError(f"{path}: theta runs from {elevations.min():g} to {elevations.max():g}; expected 0 to pi/2.")
    if samples[:, 4:].min() < 0:
        raise FileError(f"{path}: the smallest value is {samples[:, 4:].min():g}; reflectance is not negative.")
    try:
        rgb = np.maximum(spectrum_to_rgb(wavelengths, samples[:, 4:]), 0)
        wi, wo = from_spherical(samples[:, 0], samples[:, 1]), from_spherical(samples[:, 2], samples[:, 3])
        return ScatteredBRDF(wi, wo, rgb)
    except GonioError as error:
        raise FileError(f"{path}: {error}") from error
