"""Facts about samples of captures, and of simulated ones."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import gonio as gn
from gonio.capture.photographs import Held
from gonio.capture.simulation import from_above

OVERHEAD = gn.distant_lights([[0.0, 0, 1]], [np.pi])
PLASTIC = gn.Lambert([0.4, 0.3, 0.2]) + gn.Microfacet(gn.GGX(0.3), gn.Fresnel(1.5))


def dome(count):
    return gn.from_spherical(np.linspace(0.1, 1.2, count), np.arange(count) * 2.4)


def suns(count):
    return gn.distant_lights(dome(count), np.full(count, np.pi))


def test_samples_of_a_simulated_capture_are_the_brdf():
    capture = gn.simulate(gn.Sphere(), PLASTIC, suns(8), from_above(gn.Sphere(), 24))
    count = 0
    for block in capture.reflectance():
        # Photographs and normals are in single precision, and both are divided by cosines down to some hundredths.
        expected = PLASTIC.f(block.wi, block.wo)
        assert_allclose(block.value * block.wi[:, 2:], expected * block.wi[:, 2:], rtol=1e-4, atol=1e-6)
        assert_allclose(block.weight, (np.pi * block.wi[:, 2]) ** 2)
        count += len(block)
    assert count > 0.5 * 8 * len(capture.reflectance())


def test_slices_hold_the_same_samples_with_all_lights_at_a_site():
    capture = gn.simulate(gn.Sphere(), PLASTIC, suns(8), from_above(gn.Sphere(), 24))
    samples = capture.reflectance()
    sites = np.array([3, 50, 200])
    slices = samples.at(sites)
    for k, block in enumerate(samples):
        for i, site in enumerate(sites):
            found = np.flatnonzero(block.site == site)
            if found.size:
                assert_allclose(slices.value[i, k], block.value[found[0]])
                assert_allclose(slices.wi[i, k], block.wi[found[0]])
                assert_allclose(slices.weight[i, k], block.weight[found[0]])
            else:
                assert np.isnan(slices.value[i, k]).all()
                assert slices.weight[i, k] == 0


def test_clipped_and_shadowed_photographs_are_left_out():
    images = np.ones((4, 2, 2, 3), np.float32)
    images[1, 0, 0] = 5.0  # clipped
    images[2, 0, 1] = 0.01  # shadowed
    normals = np.zeros((2, 2, 3)) + np.array([0, 0, 1])
    capture = gn.Capture(Held(images, white=5.0), gn.distant_lights(dome(4)), normals=normals)
    every, lit = capture.reflectance(), capture.reflectance(least=0.05)
    assert [len(block) for block in every] == [4, 3, 4, 4]
    assert [len(block) for block in lit] == [4, 3, 3, 4]
    assert np.isnan(lit.at(np.array([1])).value[0, 2]).all()
    assert np.isnan(lit.at(np.array([0])).value[0, 1]).all()


def test_radiance_is_told_whatever_the_light():
    capture = gn.simulate(gn.Sphere(), PLASTIC, suns(3), from_above(gn.Sphere(), 16))
    blocks = list(dataclasses.replace(capture, lights=None).radiance())
    assert len(blocks) == 3
    radiance = capture.photographs.read(1).radiance[capture.mask]
    assert_allclose(blocks[1].value, radiance[blocks[1].site], rtol=1e-6)
    assert_allclose(blocks[1].normal, capture.normals[capture.mask][blocks[1].site], rtol=1e-6)


def test_captures_that_lack_what_samples_need_are_refused():
    capture = gn.simulate(gn.Sphere(), PLASTIC, suns(3), from_above(gn.Sphere(), 16))
    with pytest.raises(gn.GonioError, match="lights are unknown"):
        dataclasses.replace(capture, lights=None).reflectance()
    shapeless = dataclasses.replace(capture, normals=None, shape=None)
    with pytest.raises(gn.GonioError, match="shape is unknown"):
        shapeless.reflectance()
    with pytest.raises(gn.GonioError, match="shape is unknown"):
        next(shapeless.radiance())
    with pytest.raises(gn.GonioError, match="least = 1"):
        capture.reflectance(least=1)


def test_simulated_photographs_are_the_renderings_of_the_same_scene():
    camera = from_above(gn.vase(), 40)
    lights = suns(3)
    capture = gn.simulate(gn.vase(), PLASTIC, lights, camera, shadows=True)
    for k, sun in enumerate(lights):
        image = gn.render(gn.vase(), PLASTIC, sun, camera, shadows=True, background=False)
        assert_allclose(capture.photographs.read(k).radiance, image, rtol=1e-5, atol=1e-6)


def test_noise_has_the_variance_told_and_codes_are_as_many(rng):
    flat = gn.HeightField(np.zeros((100, 100)))
    sensor = gn.Sensor(exposure=0.8, gain=1e-3, read=2e-3)
    capture = gn.simulate(flat, gn.Lambert(0.5), OVERHEAD * 2, flat.camera(), sensor=sensor)
    codes = 0.8 * capture.photographs.read(0).radiance
    expected = 0.8 * 0.5
    assert codes.mean() == pytest.approx(expected, abs=1e-3)
    # 30,000 samples tell a variance to .8 %.
    assert codes.var() == pytest.approx(1e-3 * expected + 4e-6, rel=0.03)
    again = gn.simulate(flat, gn.Lambert(0.5), OVERHEAD * 2, flat.camera(), sensor=sensor)
    assert_array_equal(again.photographs.read(0).radiance, capture.photographs.read(0).radiance)
    assert not np.array_equal(again.photographs.read(0).radiance, capture.photographs.read(1).radiance)
    coarse = gn.simulate(flat, gn.Lambert(0.5), OVERHEAD, flat.camera(), sensor=dataclasses.replace(sensor, bits=4))
    assert np.unique(np.round(coarse.photographs.read(0).radiance * 0.8 * 15, 3)).size <= 16
    bright = gn.simulate(flat, gn.Lambert(0.5), OVERHEAD, flat.camera(), sensor=gn.Sensor(exposure=4))
    assert bright.photographs.read(0).clipped.all()


def test_misalignment_is_as_large_as_asked_for():
    lights = np.tile(dome(50), (40, 1))
    capture = gn.simulate(
        gn.Sphere(), gn.Lambert(0.5), gn.distant_lights(lights), from_above(gn.Sphere(), 8), misaligned=2.0
    )
    off = np.degrees(np.arccos(np.sum(capture.directions * lights, axis=1).clip(-1, 1)))
    assert np.sqrt(np.mean(off**2)) == pytest.approx(2.0, rel=0.05)


def test_scenes_that_cannot_be_photographed_are_refused():
    for arguments, message in (
        ({"lights": ()}, "no light was given"),
        ({"lights": dome(2)}, r"lights\[0\] is ndarray"),
        ({"lights": suns(2), "misaligned": -1}, "misaligned = -1"),
        ({"lights": suns(2), "camera": gn.Pinhole.look_at((3, 0, 0), (9, 0, 0), 40, (8, 8))}, "sees nothing"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            gn.simulate(gn.Sphere(), gn.Lambert(0.5), **arguments)
    with pytest.raises(gn.GonioError, match="bits = 30"):
        gn.Sensor(bits=30)
    with pytest.raises(gn.GonioError, match="no exposure"):
        gn.Sensor(exposure=0)
