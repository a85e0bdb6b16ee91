"""Photographs of balls that several tests of lights are held against."""

import warnings

import numpy as np
import pytest

from gonio.errors import ClippedWarning
from gonio.files.images import read_image, read_raster


@pytest.fixture(scope="module")
def uw(data):
    """Photographs (12, rows, columns, 3) and mask of the chrome and the gray ball, and the twelve lights as stated."""
    folder = data / "photometric" / "uw"
    balls = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ClippedWarning)  # highlights are clipped, and may be
        for name in ("chrome", "gray"):
            photographs = [read_image(folder / name / f"{name}.{k}.tga", encoding="linear") for k in range(12)]
            balls[name] = np.stack(photographs), read_raster(folder / name / f"{name}.mask.tga").samples[..., 0] > 127
    return balls, np.loadtxt(folder / "lights.txt", skiprows=1)
