"""The sphere and the flat sample against their closed forms."""

import math

import numpy as np
import pytest

import gonio as gn

ABOVE = gn.Orthographic(size=(64, 64), pixel=1 / 32, pose=gn.look_at((0, 0, 5), (0, 0, 0), up=(0, 1, 0)))


def test_a_sphere_from_above_is_its_own_normal_map():
    view = gn.Sphere().view(ABOVE)
    x, y = (ABOVE.pixels()[..., k] / 32 - 1 for k in range(2))
    y = -y  # rows run downwards
    disc = x**2 + y**2 < 1
    np.testing.assert_array_equal(view.mask, disc)
    z = np.sqrt(1 - x[disc] ** 2 - y[disc] ** 2)
    np.testing.assert_allclose(view.normal[disc], np.stack((x[disc], y[disc], z), axis=-1), atol=1e-12)
    np.testing.assert_allclose(view.position[disc], view.normal[disc], atol=1e-12)
    np.testing.assert_allclose(view.distance[disc], 5 - z, atol=1e-12)
    np.testing.assert_allclose(view.wo[disc], np.broadcast_to((0, 0, 1), view.wo[disc].shape), atol=1e-15)
    assert np.isnan(view.normal[~disc]).all()


def test_the_tangent_of_a_sphere_runs_along_growing_u():
    view = gn.Sphere(centre=(1, 2, 3), radius=2.5).view(
        gn.Pinhole.look_at((8, 2, 6), (1, 2, 3), field_of_view=50, size=(40, 40))
    )
    m = view.mask
    n, s = view.normal[m], view.tangent[m]
    np.testing.assert_allclose((n * s).sum(axis=-1), 0, atol=1e-12)
    turned = n + 1e-6 * s
    phi = np.arctan2(turned[:, 1], turned[:, 0]) / (2 * math.pi) % 1
    step = (phi - view.uv[m][:, 0] + 0.5) % 1 - 0.5
    assert (step > 0).all()
    np.testing.assert_allclose(view.uv[m][:, 1], 1 - np.arccos(n[:, 2]) / math.pi, atol=1e-9)


def test_a_sphere_is_met_from_inside_and_from_afar():
    ball = gn.Sphere()
    assert ball.trace((0.5, 0, 0), (1.0, 0, 0)).distance == pytest.approx(0.5)
    # The grazing ray at 1 - 1e-9 of the radius from 1e6 away; b^2 - 4ac would lose it in 1e-4.
    far = ball.trace((-1e6, 1 - 1e-9, 0), (1.0, 0, 0))
    assert far.mask
    assert far.position[0] == pytest.approx(-math.sqrt(2e-9), rel=1e-3)
    assert not ball.trace((3.0, 0, 0), (1.0, 0, 0)).mask


def test_a_sphere_shadows_itself_exactly_below_the_horizon(rng):
    n = gn.normalise(rng.normal(size=(500, 3)))
    w = gn.normalise(rng.normal(size=(500, 3)))
    horizon = (n * w).sum(axis=-1)
    clear = abs(horizon) > 1e-5
    np.testing.assert_array_equal(gn.Sphere().occluded(n, w)[clear], (horizon < 0)[clear])


def test_a_plane_is_met_within_its_rectangle():
    sheet = gn.Plane(size=(1.0, 0.5), centre=(0, 0, 0.25))
    view = sheet.view(ABOVE)
    x, y = ABOVE.pixels()[..., 0] / 32 - 1, 1 - ABOVE.pixels()[..., 1] / 32
    np.testing.assert_array_equal(view.mask, (abs(x) <= 0.5) & (abs(y) <= 0.25))
    m = view.mask
    np.testing.assert_allclose(view.distance[m], 4.75)
    np.testing.assert_allclose(view.uv[m], np.stack((x[m] + 0.5, 2 * y[m] + 0.5), axis=-1), atol=1e-12)
    np.testing.assert_allclose(view.frames[m], np.broadcast_to(np.eye(3), (m.sum(), 3, 3)), atol=1e-15)
    assert sheet.occluded((0, 0, 0), (0, 0, 1.0))
    assert not sheet.occluded((0, 0, 0), (0, 0, 1.0), 0.2)
    assert not sheet.occluded((0.7, 0, 0), (0, 0, 1.0))


def test_bounds_hold_the_shape():
    low, high = gn.Plane(size=(2, 4), normal=(1.0, 0, 0), tangent=(0, 1.0, 0)).bounds
    np.testing.assert_allclose((low, high), ((0, -1, -2), (0, 1, 2)), atol=1e-15)
    low, high = gn.Sphere((1, 2, 3), 2).bounds
    np.testing.assert_allclose((low, high), ((-1, 0, 1), (3, 4, 5)))


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: gn.Sphere(radius=0), "radius = 0"),
        (lambda: gn.Sphere(centre=(0, 0)), "shape"),
        (lambda: gn.Sphere(centre=(0, math.nan, 0)), "nan"),
        (lambda: gn.Plane(size=(1, -1)), "two positive lengths"),
        (lambda: gn.Plane(normal=(0, 0, 2.0)), "length 2"),
        (lambda: gn.Plane(tangent=(0, 0, 1.0)), "parallel"),
        (lambda: gn.Sphere().trace((0, 0, 0), (0, 0, 3.0)), "length 3"),
    ],
)
def test_shapes_refuse(make, match):
    with pytest.raises(gn.GonioError, match=match):
        make()
