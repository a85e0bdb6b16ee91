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
