"""Facts about reliefs under lamps that are near."""

import dataclasses

import numpy as np
import pytest

import gonio as gn
from gonio.capture.near_stereo import heights_of, near_photometric_stereo


def scene(texel=1.0):
    y, x = np.mgrid[-1:1:60j, -1:1:60j]
    heights = 12 * np.exp(-3 * (x * x + y * y)) * (1 + 0.3 * x)
    relief = gn.HeightField(texel * (heights - heights.mean()), texel)
    k = np.arange(12)
    lamps = texel * 90 * gn.from_spherical(np.radians(20 + 3 * k), 2.4 * k)
    lights = gn.near_lights(lamps, np.full(12, (90 * texel) ** 2 * np.pi))
    capture = gn.simulate(relief, gn.Lambert([0.6, 0.5, 0.4]), lights, relief.camera())
    return relief, dataclasses.replace(capture, normals=None, shape=None)


def error(normals, relief):
    return np.degrees(np.arccos(np.sum(normals * relief.normals, axis=-1).clip(-1, 1))).mean()


@pytest.mark.parametrize("texel", [1.0, 0.02])
def test_heights_and_normals_come_to_agree_with_near_lamps(texel):
    relief, capture = scene(texel)
    flat = gn.photometric_stereo(capture)
    found = near_photometric_stereo(capture)
    assert found.converged
    # Lamps 90 texels away, relief 12 high.
    expected = relief.heights / texel
    assert error(flat.normals, relief) > 1
    # What is left is where heights stop, and the trapezium rule between texels: hundredths of either.
    assert error(found.relief.normals, relief) < 0.02
    assert np.std(found.surface.heights - expected) < 0.03
    assert np.std(heights_of(flat).heights - expected) > 0.1


def test_cameras_that_look_aslant_are_refused():
    _, capture = scene()
    camera = gn.Pinhole.look_at((0, -100, 100), (0, 0, 0), 40, (60, 60))
    with pytest.raises(gn.GonioError, match="straight above"):
        near_photometric_stereo(dataclasses.replace(capture, camera=camera))
