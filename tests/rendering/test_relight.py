"""Facts about relighting what a camera saw: it is the photograph, under the same light, and linear in any other."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn
from gonio.capture.simulation import from_above
from gonio.rendering import relight as relighting

PLASTIC = gn.Lambert([0.5, 0.3, 0.2]) + gn.Microfacet(gn.GGX(0.4), gn.Fresnel(1.5))
LIGHTS = (*gn.distant_lights([[0.0, 0, 1], [0.6, 0, 0.8]], [3.0, 2.0]), *gn.near_lights([[1.0, -2, 3]], [30.0]))


@pytest.fixture(scope="module")
def capture():
    return gn.simulate(gn.Sphere(), PLASTIC, LIGHTS, from_above(gn.Sphere(), 24))


def test_under_its_own_light_it_is_the_photograph(capture):
    thing = gn.Relightable(capture.view, PLASTIC)
    for k, light in enumerate(LIGHTS):
        image, photograph = gn.relight(thing, light), capture.photographs.read(k).radiance
        assert image.dtype == np.float32 and image.shape == (*capture.mask.shape, 3)
        # Normals of a capture are in single precision. A near lamp shines from where shadow rays start, 1e-3 off.
        assert_allclose(image[capture.mask], photograph[capture.mask], rtol=2e-3, atol=1e-4)
        assert not image[~capture.mask].any()


def test_lights_together_are_the_sum_of_each(capture):
    thing = gn.Relightable(capture.view, PLASTIC)
    together = gn.relight(thing, gn.Lights(LIGHTS))
    assert_allclose(together, sum(gn.relight(thing, light) for light in LIGHTS), rtol=1e-5, atol=1e-7)


def test_a_matte_thing_in_a_white_room_is_its_albedo(capture):
    room = gn.Environment(np.ones((32, 64, 3)))
    image = gn.relight(gn.Relightable(capture.view, gn.Lambert([0.5, 0.3, 0.2])), room)
    # The sum over 32 rows of a map; a normal near the horizon cuts pixels of it, of which the cosine is least.
    assert_allclose(image[capture.mask], np.tile([0.5, 0.3, 0.2], (capture.mask.sum(), 1)), rtol=0.01)
    few = gn.relight(gn.Relightable(capture.view, gn.Lambert([0.5, 0.3, 0.2])), room, samples=16)
    assert np.abs(few - image).max() > 1e-4


def test_parameters_of_pixels_stay_with_their_pixels(capture, rng):
    albedo = rng.random((len(capture.sites), 3))
    image = gn.relight(gn.Relightable(capture.view, capture.textures(gn.Lambert(albedo))), LIGHTS[0])
    cosine = capture.sites.frames[:, 2, 2:]
    assert_allclose(image[capture.mask], albedo / np.pi * 3 * cosine, rtol=1e-5)


def test_a_gray_material_gives_three_channels_of_one_kind(capture):
    image = gn.relight(gn.Relightable(capture.view, gn.Lambert(0.5)), LIGHTS[1])
    assert_allclose(image[..., 0], image[..., 2])


def test_progress_hears_of_all_pixels_and_parts_make_no_seams(capture, monkeypatch):
    thing = gn.Relightable(capture.view, PLASTIC)
    whole = gn.relight(thing, LIGHTS[2])
    monkeypatch.setattr(relighting, "_SITES", 100)
    heard = []
    parts = gn.relight(thing, LIGHTS[2], progress=lambda done, total: heard.append((done, total)))
    np.testing.assert_array_equal(parts, whole)
    count = int(capture.mask.sum())
    assert heard[-1] == (count, count) and [n for n, _ in heard] == [*range(100, count, 100), count]


def test_what_was_seen_is_a_surface_that_looks_the_same_from_elsewhere():
    sphere = gn.Sphere()
    thing = gn.Relightable(sphere.view(from_above(sphere, 96)), PLASTIC)
    assert_allclose(thing.axes, np.eye(3), atol=1e-3)  # an image's x, y, and the eye above
    camera = gn.Pinhole.look_at(4 * thing.axes.T @ [0.5, 0.2, 0.8], (0, 0, 0), 34, (48, 48))
    found, truth = (gn.render(shape, PLASTIC, LIGHTS[1], camera) for shape in (thing.surface, sphere))
    view = sphere.view(camera)
    seen = view.mask & (view.position[..., 2] > 0.4)
    # Triangles a fiftieth of the radius wide lie a hundredth of that below the sphere.
    assert np.sqrt(np.mean((found - truth)[seen] ** 2) / np.mean(truth[seen] ** 2)) < 0.01
    hidden = view.mask & (view.position[..., 2] < -0.1)
    assert not found[hidden].any() and truth[hidden].any()
    known = gn.Relightable(thing.view, PLASTIC, gn.vase(24))
    assert known.surface is known.shape


def test_what_cannot_be_relit_is_refused(capture):
    nothing = dataclasses.replace(capture.view, mask=np.zeros_like(capture.mask))
    with pytest.raises(gn.errors.ArrayError, match="some seen"):
        gn.Relightable(nothing, PLASTIC)
    line = dataclasses.replace(capture.view, mask=capture.mask[0])
    with pytest.raises(gn.errors.ArrayError, match=r"shape \(24,\)"):
        gn.Relightable(line, PLASTIC)
    bare = dataclasses.replace(capture.view, uv=None)
    texture = gn.Lambert(np.full((4, 4, 3), 0.5))
    with pytest.raises(gn.errors.ParameterError, match="no uv"):
        gn.relight(gn.Relightable(bare, texture), LIGHTS[0])
    with pytest.raises(gn.errors.ParameterError, match="neither one value nor a texture"):
        gn.relight(gn.Relightable(capture.view, gn.Lambert(np.full((9, 3), 0.5))), LIGHTS[0])
