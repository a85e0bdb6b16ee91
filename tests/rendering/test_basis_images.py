"""Facts about harmonic basis images."""

import math

import numpy as np
import pytest

import gonio as gn
from gonio.rendering.basis_images import basis_images, relit, signed_colours


@pytest.fixture(scope="module")
def camera():
    return gn.Orthographic(pixel=2.2 / 40, size=(40, 40), pose=gn.look_at(eye=(2, -3, 1), target=(0, 0, 0)))


def test_their_sum_is_the_matte_object_under_the_light(camera):
    room = gn.studio(48)
    images = basis_images(gn.Sphere(), camera)
    view = gn.Sphere().view(camera)
    light = np.asarray(room.harmonics(2))
    E = gn.irradiance(light, view.normal[view.mask])
    np.testing.assert_allclose(relit(images, light)[view.mask], E / math.pi, rtol=1e-4, atol=1e-5)
    # And of what the room really gives nine images hold the most part: within 9 % of its total intensity (RH 4.3.1).
    exact = gn.radiance(gn.Lambert(1.0), room, view.frames[view.mask], view.wo[view.mask])
    total = room.beams().irradiance.sum(axis=0)
    assert np.all(np.abs(relit(images, light)[view.mask] - exact) < 0.094 * total / math.pi)


def test_where_nothing_is_met_they_are_nan(camera):
    images = basis_images(gn.Sphere(), camera, degree=1)
    assert images.shape == (4, 40, 40)
    assert np.isnan(images[:, 0, 0]).all()
    assert np.isfinite(images[:, 20, 20]).all()


def test_orange_is_above_and_blue_below_zero():
    images = np.array([[[1.0, -1.0, np.nan, 0.0]]])
    above, below, nothing, zero = signed_colours(images)[0, 0]
    assert above[0] > above[2]
    assert below[2] > below[0]
    assert not nothing.any()
    assert not zero.any()


def test_lights_of_another_degree_are_refused(camera):
    with pytest.raises(gn.GonioError, match="for each coefficient"):
        relit(basis_images(gn.Sphere(), camera, degree=1), np.zeros((9, 3)))


def test_with_shadows_a_ball_is_as_without(camera):
    # A ball does not shadow itself. 512 rays of a lattice integrate harmonics of degree 2 to 1e-3.
    shadowed = basis_images(gn.Sphere(), camera, shadows=True)
    np.testing.assert_allclose(shadowed, basis_images(gn.Sphere(), camera), atol=2e-3)


def test_at_the_bottom_of_a_bowl_light_comes_through_the_opening_alone():
    # A hemisphere seen from above along its axis: at its lowest point the rim stands at the horizon's 45 degrees.
    theta, phi = np.linspace(0, np.pi / 2, 40)[:, None], np.linspace(0, 2 * np.pi, 80)
    x = np.stack(np.broadcast_arrays(np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), -np.cos(theta)), axis=-1)
    i, j = np.meshgrid(np.arange(39), np.arange(79), indexing="ij")
    corner = (i * 80 + j).ravel()
    below = corner[corner >= 80]  # at the pole itself one triangle of each pair has no area
    faces = np.concatenate(
        (np.stack((corner, corner + 80, corner + 81), 1), np.stack((below, below + 81, below + 1), 1))
    )
    bowl = gn.Mesh(x.reshape(-1, 3), faces)
    eye = gn.Orthographic(pixel=0.01, size=(3, 3), pose=gn.look_at(eye=(0, 0, 5), target=(0, 0, 0), up=(0, 1, 0)))
    image = basis_images(bowl, eye, degree=1, shadows=True, samples=4096)[:, 1, 1]
    normal = bowl.view(eye).normal[1, 1]
    assert normal[2] > 0.99
    # The opening's rim lies sqrt2 away, 45 degrees off the axis: what arrives of even light is sin^2 45 = 1/2.
    assert image[0] * np.sqrt(4 * np.pi) == pytest.approx(0.5, abs=0.01)
    # And of cos theta sqrt(3 / (4 pi)): integral of 2 cos^2 sin from 0 to 45 degrees.
    assert image[2] / np.sqrt(3 / (4 * np.pi)) == pytest.approx(2 / 3 * (1 - 2**-1.5), abs=0.01)


def test_shadowed_images_are_the_shadowed_integral_of_low_light(camera):
    vase, room = gn.vase(), gn.studio(32)
    light = np.asarray(room.harmonics(4), float)
    images = basis_images(vase, camera, degree=4, shadows=True)
    view = vase.view(camera)
    # The light that these harmonics hold, as beams of 64 x 128 pixels.
    grid = gn.LatLong(64, 128)
    w = grid.directions().reshape(-1, 3)
    E = gn.synthesis(light, grid).reshape(-1, 3) * np.repeat(grid.weights, 128)[:, None]
    sites = np.argwhere(view.mask)[::37]
    for r, c in sites:
        n, x = view.normal[r, c], view.lifted[r, c]
        arrives = ~vase.occluded(np.broadcast_to(x, w.shape), w)
        exact = (np.maximum(w @ n, 0) * arrives) @ E / np.pi
        # Edges of shadows between 512 rays and between pixels: 1 to 2 % of what arrives unshadowed.
        np.testing.assert_allclose(
            np.nan_to_num(relit(images, light))[r, c], exact, atol=0.03 * float(E.sum() / 3 / np.pi)
        )


def test_progress_counts_the_pixels_that_meet_the_shape(camera):
    told = []
    basis_images(gn.Sphere(), camera, degree=1, shadows=True, samples=16, progress=lambda *at: told.append(at))
    assert told[-1] == (int(gn.Sphere().view(camera).mask.sum()),) * 2


def test_no_samples_are_refused(camera):
    with pytest.raises(gn.GonioError, match="whole number"):
        basis_images(gn.Sphere(), camera, shadows=True, samples=0)
