"""Height fields: rows run downwards, normals are central differences, and pixels are samples."""

import math

import numpy as np
import pytest

import gonio as gn


def grid(rows, columns, spacing):
    c, r = np.meshgrid(np.arange(columns), np.arange(rows))
    return (c - (columns - 1) / 2) * spacing, ((rows - 1) / 2 - r) * spacing


def test_normals_of_a_paraboloid_are_exact():
    x, y = grid(20, 30, 0.1)
    field = gn.HeightField(0.3 * x**2 - 0.2 * y**2 + 0.1 * x * y, spacing=0.1)
    slope = np.stack((-0.6 * x - 0.1 * y, 0.4 * y - 0.1 * x, np.ones_like(x)), axis=-1)
    np.testing.assert_allclose(field.normals, gn.normalise(slope), atol=1e-12)  # second order, at the edges too


def test_its_camera_sees_every_sample_in_its_pixel(rng):
    heights = rng.normal(size=(12, 17))
    field = gn.HeightField(heights, spacing=0.5)
    camera = field.camera()
    view = field.view(camera)
    assert view.mask.all()
    x, y = grid(12, 17, 0.5)
    np.testing.assert_allclose(view.position, np.stack((x, y, heights), axis=-1), atol=1e-9)
    np.testing.assert_allclose(view.normal, field.normals, atol=1e-9)
    u, v = (np.arange(17) + 0.5) / 17, 1 - (np.arange(12) + 0.5) / 12
    np.testing.assert_allclose(view.uv, np.stack(np.meshgrid(u, v), axis=-1), atol=1e-9)


def test_tangents_climb_along_the_rows():
    x, y = grid(9, 7, 0.2)
    field = gn.HeightField(0.5 * x + 2 * y, spacing=0.2)
    view = field.view(field.camera())
    along = np.broadcast_to(gn.normalise(np.array([1.0, 0.0, 0.5])), view.tangent.shape)
    np.testing.assert_allclose(view.tangent, along, atol=1e-12)


def test_the_upper_left_of_the_image_is_towards_minus_x_and_plus_y():
    heights = np.zeros((4, 6))
    heights[0, 0] = 1
    field = gn.HeightField(heights)
    top = field.mesh.vertices[field.mesh.vertices[:, 2].argmax()]
    assert top[0] < 0 < top[1]
    view = field.view(field.camera())
    assert view.position[0, 0, 2] == pytest.approx(1)


def test_a_wall_throws_its_shadow_as_far_as_the_sun_is_low():
    # A wall of height 1, sun at 45 degrees from the left: one unit of shadow to its right.
    heights = np.zeros((10, 60))
    heights[:, 20] = 1.0
    field = gn.HeightField(heights, spacing=0.1)
    view = field.view(field.camera())
    shadow = field.occluded(view.lifted, np.array([-1.0, 0, 1.0]) / math.sqrt(2))
    row = shadow[5]
    assert not row[:20].any()
    assert row[22:30].all()  # the wall's own right side is a ramp to column 21
    assert not row[32:].any()


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: gn.HeightField(np.zeros(5)), "both >= 2"),
        (lambda: gn.HeightField(np.full((3, 3), np.nan)), r"heights\[0, 0\] is nan"),
        (lambda: gn.HeightField(np.zeros((3, 3)), spacing=0), "spacing = 0"),
    ],
)
def test_height_fields_refuse(make, match):
    with pytest.raises(gn.GonioError, match=match):
        make()
