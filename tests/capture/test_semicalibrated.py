"""Facts about lights' strengths from an object of unknown shape."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn
from gonio.capture.photographs import Held
from gonio.capture.semicalibrated import estimate_strengths
from gonio.capture.simulation import from_above

SPHERE = gn.Sphere()
CAMERA = from_above(SPHERE, 48)
TOWARDS = gn.from_spherical(np.radians(np.where(np.arange(20) % 2, 25.0, 60.0)), np.arange(20) * 2.4)
PAINT = gn.Lambert([0.6, 0.45, 0.3])


@pytest.fixture
def strengths(rng):
    """(20,), from 1 / sqrt(3) to sqrt(3), of geometric mean 1."""
    return np.exp(rng.permutation(np.linspace(-0.55, 0.55, 20)))


def photographed(lights, told, material=PAINT, sensor=None, shape=SPHERE, shadows=True):
    """A capture under `lights` that knows neither their strengths nor the shape."""
    true = gn.simulate(shape, material, lights, CAMERA if shape is SPHERE else shape.camera(), sensor, shadows=shadows)
    return gn.Capture(true.photographs, told, true.mask, camera=true.camera)


def degrees(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1)))


def off(found, strengths):
    """Logarithm of what was found over what is true, (N, 3), one factor a channel left out."""
    ratio = np.log(found.strengths / np.reshape(strengths, (len(found.strengths), -1)))
    return ratio - ratio.mean(axis=0)


def test_a_matte_ball_with_attached_shadows_tells_strengths_that_differ_by_a_factor_of_three(strengths):
    capture = photographed(gn.distant_lights(TOWARDS, strengths), gn.distant_lights(TOWARDS))
    found = estimate_strengths(capture)
    assert found.converged
    assert found.reason == ""
    # Photographs are in single precision.
    assert abs(off(found, strengths)).max() < 1e-5
    assert_allclose(np.log(found.strengths).mean(axis=0), 0, atol=1e-12)
    assert_allclose([light.irradiance for light in found.lights], found.strengths)


def test_noise_codes_and_clipping_cost_half_a_per_cent(strengths):
    sensor = gn.Sensor(exposure=4, read=0.003, bits=8)
    capture = photographed(gn.distant_lights(TOWARDS, strengths), gn.distant_lights(TOWARDS), sensor=sensor)
    assert capture.photographs.read(int(np.argmax(strengths))).clipped.any()
    found = estimate_strengths(capture)
    assert found.converged
    # Noise of .003 / 4 on .1 or so, over a thousand pixels that each light reaches: .03 %, amplified by the least
    # eigenvalue to .1 %, and the worst of 20 lights.
    assert abs(off(found, strengths)).max() < 5e-3
    assert found.doubt < 0.1


def test_highlights_cost_one_per_cent(strengths):
    glossy = PAINT + gn.Microfacet(gn.GGX(0.2), gn.Fresnel(1.5))
    sensor = gn.Sensor(read=0.003)
    capture = photographed(gn.distant_lights(TOWARDS, strengths), gn.distant_lights(TOWARDS), glossy, sensor)
    found = estimate_strengths(capture)
    assert found.converged
    # What the highlight's foot adds below the noise is counted, and differs from light to light.
    assert abs(off(found, strengths)).max() < 0.015
    assert 0.05 < found.doubt < 0.1


def test_the_colours_of_lights_are_found_but_for_a_white_balance(strengths, rng):
    colours = strengths[:, None] * np.exp(0.15 * rng.normal(size=(20, 3)))
    found = estimate_strengths(photographed(gn.distant_lights(TOWARDS, colours), gn.distant_lights(TOWARDS)))
    assert found.converged
    # Rounds end at changes of 1e-4.
    assert abs(off(found, colours)).max() < 2e-4


def test_near_lights_are_found_where_the_object_stands(strengths):
    lights = gn.near_lights(4 * TOWARDS, 16 * strengths)
    capture = photographed(lights, gn.near_lights(4 * TOWARDS, np.full(20, 16.0)))
    found = estimate_strengths(dataclasses.replace(capture, shape=SPHERE))
    assert found.converged
    assert abs(off(found, strengths)).max() < 1e-4
    assert_allclose([light.intensity for light in found.lights], 16 * found.strengths)


def test_four_lights_are_enough_where_all_reach(strengths):
    found = estimate_strengths(
        photographed(gn.distant_lights(TOWARDS[:4], strengths[:4]), gn.distant_lights(TOWARDS[:4]))
    )
    assert abs(off(found, strengths[:4])).max() < 1e-5


def test_cast_shadows_on_a_relief_cost_one_per_cent(strengths):
    y, x = np.mgrid[:48, :48] / 48
    relief = gn.HeightField(4 * (np.sin(9 * x) + np.cos(8 * y + 3 * x)))
    lights, sensor = gn.distant_lights(TOWARDS, strengths), gn.Sensor(read=0.003)
    found = estimate_strengths(photographed(lights, gn.distant_lights(TOWARDS), sensor=sensor, shape=relief))
    assert found.converged
    assert abs(off(found, strengths)).max() < 0.01


def test_normals_come_right_once_strengths_are_known(strengths):
    true = gn.simulate(SPHERE, PAINT, gn.distant_lights(TOWARDS, strengths), CAMERA, gn.Sensor(read=0.003))
    blind = dataclasses.replace(true, lights=gn.distant_lights(TOWARDS), normals=None, shape=None)
    found = dataclasses.replace(blind, lights=estimate_strengths(blind).lights)
    before, after, best = (
        np.median(degrees(gn.photometric_stereo(capture).normals[true.mask], true.normals[true.mask]))
        for capture in (blind, found, dataclasses.replace(blind, lights=true.lights))
    )
    assert before > 5
    # .1 % of a strength turns a normal by a twentieth of a degree at most, where noise alone turns it by .3.
    assert after < best + 0.05


def test_the_standard_error_is_half_the_scatter_or_more(strengths):
    misses, errors = [], []
    for seed in range(3):
        lights = gn.distant_lights(TOWARDS, strengths)
        true = gn.simulate(SPHERE, PAINT, lights, CAMERA, gn.Sensor(read=0.005), shadows=True, seed=seed)
        found = estimate_strengths(
            gn.Capture(true.photographs, gn.distant_lights(TOWARDS), true.mask, camera=true.camera)
        )
        misses.append(off(found, strengths).mean(axis=1))
        errors.append(found.error)
    # 60 numbers tell their rms to 9 %; what counts is chosen by the same noise.
    assert 0.8 < np.sqrt(np.mean(np.square(misses))) / np.sqrt(np.mean(np.square(errors))) < 2.2


def test_a_flat_object_and_lights_on_a_plane_leave_strengths_open(strengths):
    flat = gn.HeightField(np.zeros((40, 40)))
    along = gn.normalise(np.stack((np.linspace(-1, 1, 8), np.zeros(8), np.ones(8)), axis=-1))
    but_one = np.concatenate((along, gn.normalise([[0.0, 0.5, 1]])))
    scenes = [
        photographed(gn.distant_lights(TOWARDS, strengths), gn.distant_lights(TOWARDS), shape=flat, shadows=False)
    ]
    for towards, some in ((along, strengths[:8]), (but_one, strengths[:9])):
        scenes.append(photographed(gn.distant_lights(towards, some), gn.distant_lights(towards)))
    sensor, lights = gn.Sensor(read=0.003), scenes[0].photographs.lights
    noisy = photographed(lights, scenes[0].lights, sensor=sensor, shape=flat, shadows=False)
    for capture, message in zip([*scenes, noisy], ("open", "lie in a plane", "open", "open"), strict=True):
        with pytest.raises(gn.GonioError, match=message):
            estimate_strengths(capture)


def test_lights_that_are_not_where_they_are_told_to_be_are_refused(strengths, rng):
    told = TOWARDS.copy()
    told[::2] = TOWARDS[::2][rng.permutation(10)]
    with pytest.raises(gn.GonioError, match="not where they are told"):
        estimate_strengths(photographed(gn.distant_lights(TOWARDS, strengths), gn.distant_lights(told)))


def test_a_rough_metal_is_told_to_be_none_that_strengths_can_be_trusted_from(strengths):
    metal = gn.Microfacet(gn.GGX(0.5), gn.Schlick(0.9))
    found = estimate_strengths(photographed(gn.distant_lights(TOWARDS, strengths), gn.distant_lights(TOWARDS), metal))
    assert not found.converged
    assert "not matte enough" in found.reason
    assert off(found, strengths).std() < found.doubt


def test_captures_that_cannot_tell_strengths_are_refused():
    images = np.ones((5, 8, 8, 3))
    lights = gn.distant_lights(TOWARDS[:5])
    images[2] = 0
    for capture, message in (
        (gn.Capture(Held(images)), "lights are unknown"),
        (gn.Capture(Held(images[:3]), lights[:3]), "four are wanted"),
        (gn.Capture(Held(images), lights), "2 is black"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            estimate_strengths(capture)


def test_progress_runs_to_its_end():
    heard = []
    estimate_strengths(
        photographed(gn.distant_lights(TOWARDS[:6]), gn.distant_lights(TOWARDS[:6])),
        lambda done, total: heard.append((done, total)),
    )
    assert heard == [(k, 6) for k in range(1, 7)]


def test_lights_of_equal_strength_come_out_equal_within_the_doubt(data):
    # A matte relief, rendered, whose normals lie within 1.5 degrees for the most part: all but flat.
    capture = gn.read_capture(data / "rti/synth/Single/Object1/material1/Dome", "srgb")
    found = estimate_strengths(capture)
    rms = np.log(found.strengths).std()
    assert rms < found.doubt < 1.5 * rms
