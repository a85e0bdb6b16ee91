"""Facts about lights' intensities from a white target."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn
from gonio.capture.photographs import Held
from gonio.capture.white import intensities_of_white

LIGHTS = gn.from_spherical([0.2, 0.5, 0.9], [0.0, 2.0, 4.0])
POWERS = np.array([[3.0, 2.0, 1.0], [1.0, 1.0, 1.0], [0.5, 0.6, 0.7]])


def white(**changes):
    flat = gn.HeightField(np.zeros((30, 30)))
    scene = {"material": gn.Lambert(0.9), "directions": LIGHTS, "intensities": POWERS} | changes
    return gn.simulate(flat, scene["material"], scene["directions"], flat.camera(), scene["intensities"])


def test_a_white_target_gives_back_the_lights():
    assert_allclose(intensities_of_white(white(), 0.9), POWERS, rtol=1e-6)


def test_dust_on_the_target_does_not_count(rng):
    target = white()
    images = np.stack([target.photographs.read(k).radiance for k in range(3)])
    images[:, rng.random((30, 30)) < 0.2] *= 0.3
    dusty = gn.Capture(Held(images), LIGHTS)
    assert_allclose(intensities_of_white(dusty, 0.9), POWERS, rtol=1e-6)


def test_with_its_lights_known_a_capture_tells_the_brdf_in_its_units():
    material = gn.Lambert([0.5, 0.3, 0.2]) + gn.Microfacet(gn.GGX(0.4), gn.Fresnel(1.5))
    blind = dataclasses.replace(white(material=material), intensities=np.ones((3, 3)))
    capture = dataclasses.replace(blind, intensities=intensities_of_white(white(), 0.9))
    for block in capture.reflectance():
        assert_allclose(block.value, material.f(block.wi, block.wo), rtol=1e-5)


def test_targets_that_tell_nothing_are_refused():
    target = white()
    bright = gn.Capture(Held(np.ones((1, 4, 4, 3)), white=1.0), [[0.0, 0, 1]])
    dark = gn.Capture(Held(np.zeros((1, 4, 4, 3))), [[0.0, 0, 1]])
    below = gn.Capture(Held(np.ones((1, 4, 4, 3))), [[0.0, 0, -1]])
    for capture, arguments, message in (
        (bright, {}, "100% of the white is clipped"),
        (dark, {}, "white is black"),
        (below, {}, "below the white"),
        (target, {"albedo": 1.2}, "albedo = 1.2"),
        (target, {"normal": [0, 0, 2.0]}, "length 2"),
        (dataclasses.replace(target, directions=None), {}, "lights are unknown"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            intensities_of_white(capture, **arguments)
