"""Facts about the lights of captures, and about samples where they, or the eye, are near."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn
from gonio.capture.lighting import arriving, directions_of, scaled
from gonio.capture.photographs import Held
from gonio.lights.uneven import Uneven

PLASTIC = gn.Lambert([0.5, 0.3, 0.2]) + gn.Microfacet(gn.GGX(0.4), gn.Fresnel(1.5))
FLAT = gn.HeightField(np.zeros((12, 16)), spacing=0.5)
UP = np.broadcast_to([0.0, 0, 1], (2, 2, 3))
LAMPS = np.array([[0.0, 0, 6], [4, 1, 5], [-3, -4, 5]])


def test_near_lamps_send_by_the_inverse_square_from_where_they_stand():
    (lamp,) = gn.near_lights([[0.0, 3, 4]], [[1, 2, 3]])
    light = arriving(lamp, np.array([[0.0, 0, 0], [0, 3, 0]]))
    assert_allclose(light.direction, [[0, 0.6, 0.8], [0, 0, 1]])
    assert_allclose(light.irradiance, [[1 / 25, 2 / 25, 3 / 25], [1 / 16, 2 / 16, 3 / 16]])
    assert_allclose(light.distance, [5, 4])


def test_a_lamp_with_an_axis_falls_off_by_its_cosine_to_the_power():
    bare, turned = (
        arriving(light, np.array([[0.0, 0, 0], [3, 0, 0], [0, 0, 9]]))
        for light in (
            gn.Point([0.0, 0, 4], [1.0, 1, 1]),
            gn.Point([0.0, 0, 4], [1.0, 1, 1], axis=[0.0, 0, -1], exponent=3),
        )
    )
    assert_allclose(turned.irradiance / bare.irradiance, np.array([[1], [0.8**3], [0]]) * np.ones(3))


def test_a_measured_falloff_multiplies_the_light_that_it_stands_for():
    sun = gn.Directional([0.0, 0, 1], [2.0, 2, 2])
    light = arriving(Uneven(sun, [[0.0, 0.1, 0, 0, 0, -0.02]]), np.array([[0.0, 0, 0], [2, 3, 0]]))
    assert_allclose(light.irradiance[:, 0], [2, 2 * np.exp(0.2 - 0.18)])
    assert_allclose(light.direction, [[0, 0, 1]] * 2)
    assert_allclose(arriving(scaled(Uneven(sun, [[0.0] * 6]), 3), np.zeros((1, 3))).irradiance, 6)


def test_directions_are_told_of_distant_lights_alone():
    assert_allclose(directions_of(gn.distant_lights(np.eye(3))), np.eye(3))
    assert directions_of(gn.near_lights(np.eye(3))) is None
    assert directions_of(None) is None


def test_samples_under_near_lamps_are_the_brdf_with_true_directions():
    capture = gn.simulate(FLAT, PLASTIC, gn.near_lights(LAMPS, np.full(3, 100.0)), FLAT.camera())
    blocks = list(capture.reflectance())
    assert len(blocks) == 3
    for block, lamp in zip(blocks, LAMPS, strict=True):
        way = lamp - capture.sites.positions[block.site]
        assert_allclose(gn.to_world(capture.sites.frames[block.site], block.wi), gn.normalise(way), atol=1e-12)
        # Photographs and normals are in single precision.
        assert_allclose(block.value, PLASTIC.f(block.wi, block.wo), rtol=1e-4)
        assert_allclose(block.weight, (100 * block.wi[:, 2] / np.sum(way**2, axis=1)) ** 2, rtol=1e-6)
    slices = capture.reflectance().at(np.arange(5))
    assert_allclose(slices.value, PLASTIC.f(slices.wi, slices.wo[:, None]), rtol=1e-4)


def test_a_near_eye_is_seen_from_each_texel():
    # Photographs brought to the sample's plane: texels in a square grid, taken from a place of its own.
    eye = np.array([1.0, -4, 5])
    camera = gn.Pinhole.look_at(eye, (0, 0, 0), 40, (40, 40))
    seen = gn.simulate(FLAT, PLASTIC, gn.near_lights(LAMPS, np.full(3, 100.0)), camera)
    for block in seen.reflectance():
        wo = gn.normalise(eye - seen.sites.positions[block.site])
        assert_allclose(gn.to_world(seen.sites.frames[block.site], block.wo), wo, atol=1e-9)
    grid = gn.Capture(
        Held(np.ones((1, 12, 16, 3))), seen.lights[:1], normals=FLAT.normals, camera=FLAT.camera(), eye=eye
    )
    (block,) = grid.reflectance()
    assert_allclose(block.wo, gn.normalise(eye - grid.sites.positions), atol=1e-12)


def test_pixels_lie_on_the_plane_where_no_shape_is_given():
    capture = gn.Capture(Held(np.ones((1, 3, 4, 3))))
    assert_allclose(capture.positions[0, 0], [-1.5, 1, 0], atol=1e-12)
    assert_allclose(capture.positions[2, 3], [1.5, -1, 0], atol=1e-12)


def test_what_the_shape_shades_is_no_sample():
    heights = np.zeros((16, 16))
    heights[:, 8] = 4.0  # a wall, lit from the right
    wall = gn.HeightField(heights)
    sun = gn.distant_lights(gn.normalise([[1.0, 0, 1]]), [3.0])
    capture = gn.simulate(wall, gn.Lambert(0.5), sun, wall.camera(), shadows=True)
    (kept,) = capture.reflectance()
    (every,) = capture.reflectance(shadows=False)
    assert len(kept) < len(every)
    assert_allclose(kept.value, 0.5 / np.pi, rtol=1e-5)
    shaded = np.setdiff1d(every.site, kept.site)
    # The wall's shadow at 45 degrees is as long as the wall is high; the texel before it faces away from the sun.
    assert set(shaded % 16) == {5, 6}
    assert np.all(every.value[np.isin(every.site, shaded)] == 0)
    assert np.isnan(capture.reflectance().at(shaded[:1]).value).all()


def test_dark_pixels_are_left_out_by_their_radiance():
    images = np.full((1, 2, 2, 3), 0.5)
    images[0, 0, 0] = 0.001
    capture = gn.Capture(Held(images), gn.distant_lights([[0.0, 0, 1]]), normals=UP)
    (block,) = capture.reflectance(dark=0.01)
    assert list(block.site) == [1, 2, 3]
    with pytest.raises(gn.GonioError, match="dark = -1"):
        capture.reflectance(dark=-1)


def test_lights_that_are_none_are_refused():
    for make, message in (
        (lambda: gn.distant_lights(np.ones((2, 3))), "length"),
        (lambda: gn.distant_lights(np.eye(3)[0]), r"directions have shape \(3,\)"),
        (lambda: gn.distant_lights(np.eye(3), [1, 0, 1]), "irradiances are not all positive"),
        (lambda: gn.near_lights(np.eye(3), np.ones(2)), r"intensities have shape \(2,\)"),
        (lambda: gn.near_lights(np.eye(3), axis=np.eye(3)[:2]), r"axis has shape \(2, 3\)"),
        (lambda: gn.Point([0.0, 0, 1], exponent=-1), "exponent = -1"),
        (lambda: Uneven(gn.Point([0.0, 0, 1]), np.zeros((2, 6))), r"falloff has shape \(2, 6\)"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            make()
    capture = gn.Capture(Held(np.ones((1, 2, 2, 3))), gn.near_lights([[0.5, 0.5, 0.0]]), normals=UP)
    with pytest.raises(gn.GonioError, match="lies in the light"):
        next(iter(capture.reflectance()))


def test_textures_are_looked_up_where_pixels_see_them(rng):
    albedo = rng.random((12, 16, 3))
    capture = gn.simulate(FLAT, gn.Lambert(albedo), gn.distant_lights([[0.0, 0, 1]], [np.pi]), FLAT.camera())
    assert_allclose(capture.photographs.read(0).radiance, albedo, rtol=1e-6)
    image = gn.render(FLAT, gn.Lambert(albedo), gn.Directional([0.0, 0, 1], np.pi), FLAT.camera())
    assert_allclose(image, albedo, rtol=1e-6)
    with pytest.raises(gn.GonioError, match="neither one value nor a texture"):
        gn.simulate(FLAT, gn.Lambert(albedo[0]), gn.distant_lights([[0.0, 0, 1]]), FLAT.camera())
    bare = dataclasses.replace(gn.vase(16), uv=None, tangents=None)
    with pytest.raises(gn.GonioError, match="no uv"):
        gn.simulate(bare, gn.Lambert(albedo), gn.distant_lights([[0.0, 0, 1]]))
