"""Facts about the strengths of lights from a white target."""

import dataclasses
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn
from gonio.capture.lighting import arriving
from gonio.capture.photographs import Held
from gonio.capture.white import lights_of_white
from gonio.lights.uneven import Uneven

TOWARDS = gn.from_spherical([0.2, 0.5, 0.9], [0.0, 2.0, 4.0])
PLACES = 60 * TOWARDS
POWERS = np.array([[3.0, 2.0, 1.0], [1.0, 1.0, 1.0], [0.5, 0.6, 0.7]])
FLAT = gn.HeightField(np.zeros((30, 30)))  # in texels, about 0
FALLOFF = np.array([[0.0, 0.02, -0.01, -1e-3, 5e-4, -2e-3], [0, 0.02, 0.01, -1e-3, 0, 0], [0, 0, 0, -1e-3, 0, -1e-3]])


def white(lights, told, material=None, sensor=None, shape=FLAT):
    """Photographs of a white target under `lights`, which are told to be `told`."""
    camera = FLAT.camera() if shape is FLAT else None
    target = gn.simulate(shape, material or gn.Lambert(0.9), lights, camera, sensor)
    return dataclasses.replace(target, lights=told)


def powers(lights):
    return np.array([light.intensity if isinstance(light, gn.Point) else light.irradiance for light in lights])


def dusty(target, rng, parts=0.2):
    """`target` with dust on some parts of it."""
    images = np.stack([target.photographs.read(k).radiance for k in range(len(target.photographs))])
    images[:, rng.random(images.shape[1:3]) < parts] *= 0.3
    return dataclasses.replace(target, photographs=Held(images))


def test_a_white_target_gives_back_distant_lights():
    target = white(gn.distant_lights(TOWARDS, POWERS), gn.distant_lights(TOWARDS))
    # Photographs are in single precision.
    assert_allclose(powers(lights_of_white(target, 0.9)), POWERS, rtol=1e-6)


def test_a_white_target_gives_back_near_lights_whose_light_falls_off_across_it():
    target = white(gn.near_lights(PLACES, POWERS), gn.near_lights(PLACES))
    image = target.photographs.read(2).radiance
    assert image.max() / image.min() > 2
    # The simulation lights where shadow rays start: 1e-4 of a texel above the target, whose lamps are at 60.
    assert_allclose(powers(lights_of_white(target, 0.9)), POWERS, rtol=1e-5)


def test_strengths_that_were_told_are_corrected():
    told = gn.near_lights(PLACES, [2.0, 3.0, 4.0], axis=[0, 0, -1.0], exponent=2)
    target = white(gn.near_lights(PLACES, POWERS, axis=[0, 0, -1.0], exponent=2), told)
    assert_allclose(powers(lights_of_white(target, 0.9)), POWERS, rtol=1e-5)


def test_a_white_target_need_not_be_flat():
    target = white(gn.distant_lights(TOWARDS, POWERS), gn.distant_lights(TOWARDS), shape=gn.Sphere())
    assert_allclose(powers(lights_of_white(target, 0.9)), POWERS, rtol=1e-5)


def test_dust_on_the_target_does_not_count(rng):
    target = dusty(white(gn.distant_lights(TOWARDS, POWERS), gn.distant_lights(TOWARDS)), rng)
    assert_allclose(powers(lights_of_white(target, 0.9)), POWERS, rtol=1e-6)


def test_patches_of_known_colours_give_the_lights_and_what_is_not_known_does_not_count(rng):
    albedo = rng.uniform(0.05, 0.95, (30, 30, 3))
    lights = gn.distant_lights(TOWARDS, POWERS)
    shading = np.maximum(TOWARDS[:, 2], 0)[:, None, None, None] * POWERS[:, None, None, :] / math.pi
    images = albedo * shading
    images[:, :, :12] = 7.0  # a frame that nothing is known about
    albedo[:, :12] = np.nan
    noisy = images + rng.normal(size=images.shape) * 1e-3
    for photographs, tolerance in ((images, 1e-6), (noisy, 3e-3)):
        # 540 pixels of .15 or so, with noise of .001: 5e-4, and five times that.
        target = gn.Capture(Held(photographs), gn.distant_lights(TOWARDS))
        assert_allclose(powers(lights_of_white(target, albedo)), powers(lights), rtol=tolerance)


def test_a_falloff_is_found_with_the_strength_in_the_middle():
    for make, where in ((gn.distant_lights, TOWARDS), (gn.near_lights, PLACES)):
        lights = [Uneven(light, FALLOFF) for light in make(where, POWERS)]
        target = white(lights, make(where))
        found = lights_of_white(target, 0.9, falloff=True)
        # The farthest texels lie at 15: 1e-6 of what falls off there.
        terms = np.array([1, 15, 15, 15**2, 15**2, 15**2])
        for light in found:
            assert_allclose(light.falloff * terms, FALLOFF * terms, atol=1e-5)
            assert not light.falloff[:, 0].any()
        assert_allclose(powers([light.light for light in found]), POWERS, rtol=1e-5)


def test_neither_dust_nor_noise_bends_a_falloff(rng):
    lights = [Uneven(light, FALLOFF) for light in gn.distant_lights(TOWARDS, POWERS)]
    target = dusty(white(lights, gn.distant_lights(TOWARDS), sensor=gn.Sensor(read=1e-3)), rng)
    at = target.positions[target.mask]
    for found, true in zip(lights_of_white(target, 0.9, falloff=True), lights, strict=True):
        ratio = arriving(found, at).irradiance / arriving(true, at).irradiance
        # Noise of at most .001 / .07 over 700 pixels that six numbers fit: .13 % rms, in the corners three times that.
        assert abs(ratio - 1).max() < 6e-3


def test_a_falloff_that_was_told_is_corrected():
    lights = [Uneven(light, FALLOFF) for light in gn.distant_lights(TOWARDS, POWERS)]
    told = [Uneven(light, [[0.3, -0.02, 0.02, 1e-3, 0, 0]]) for light in gn.distant_lights(TOWARDS)]
    target = white(lights, told)
    for found, true in zip(lights_of_white(target, 0.9, falloff=True), lights, strict=True):
        at = target.positions[target.mask]
        assert_allclose(arriving(found, at).irradiance, arriving(true, at).irradiance, rtol=1e-5)
    # And where it is right, it is kept.
    told = [Uneven(light, FALLOFF) for light in gn.distant_lights(TOWARDS)]
    for found, true in zip(lights_of_white(dataclasses.replace(target, lights=told), 0.9), lights, strict=True):
        assert_allclose(found.falloff, true.falloff)
        assert_allclose(found.light.irradiance, true.light.irradiance, rtol=1e-6)


def test_a_falloff_is_as_well_known_far_from_the_middle():
    # 3,000 texels away, squares are 9e6 +- 1e5: not centred, the seven digits of a photograph would be lost in them.
    middle = np.array([2015.0, 3015, 0])
    camera = gn.Orthographic(pixel=1.0, size=(30, 30), pose=gn.look_at([2015.0, 3015, 100], middle, [0, 1.0, 0]))
    up = gn.distant_lights([[0.0, 0, 1]])
    scene = gn.Capture(Held(np.ones((1, 30, 30, 3))), up, camera=camera)
    at = scene.positions[scene.mask]
    true = Uneven(up[0], [[0, 1e-3, -1e-3, -2e-7, 0, 1e-7]])
    image = (arriving(true, at).irradiance / math.pi * np.ones(3)).reshape(1, 30, 30, 3)
    (found,) = lights_of_white(dataclasses.replace(scene, photographs=Held(image)), falloff=True)
    assert_allclose(arriving(found, at).irradiance, arriving(true, at).irradiance * np.ones(3), rtol=1e-6)


def test_with_its_lights_known_a_capture_tells_the_brdf_in_its_units():
    material = gn.Lambert([0.5, 0.3, 0.2]) + gn.Microfacet(gn.GGX(0.4), gn.Fresnel(1.5))
    for make, where in ((gn.distant_lights, TOWARDS), (gn.near_lights, PLACES)):
        lights = make(where, POWERS)
        capture = dataclasses.replace(
            white(lights, make(where), material), lights=lights_of_white(white(lights, make(where)), 0.9)
        )
        for block in capture.reflectance():
            assert_allclose(block.value, material.f(block.wi, block.wo), rtol=1e-5)


def test_targets_that_tell_nothing_are_refused():
    target = white(gn.distant_lights(TOWARDS, POWERS), gn.distant_lights(TOWARDS))
    up, down = gn.distant_lights([[0.0, 0, 1]]), gn.distant_lights([[0.0, 0, -1]])
    bright = gn.Capture(Held(np.ones((1, 4, 4, 3)), white=1.0), up)
    dark = gn.Capture(Held(np.zeros((1, 4, 4, 3))), up)
    below = gn.Capture(Held(np.ones((1, 4, 4, 3))), down)
    line = dataclasses.replace(below, lights=up, mask=np.arange(16).reshape(4, 4) < 4)
    for capture, arguments, message in (
        (bright, {}, "0: 100% of the white is clipped"),
        (dark, {}, "0: the white is black"),
        (below, {}, "0: the light stands below the white"),
        (line, {"falloff": True}, "along a line"),
        (target, {"albedo": 1.2}, "albedo = 1.2"),
        (target, {"albedo": np.ones((4, 4))}, r"albedo has shape \(4, 4\)"),
        (target, {"albedo": np.full((30, 30, 3), np.nan)}, "NaN everywhere"),
        (dataclasses.replace(target, lights=None), {}, "lights are unknown"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            lights_of_white(capture, **arguments)
