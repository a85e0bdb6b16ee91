"""Facts about where spheres stand, from their silhouettes."""

import math

import numpy as np
import pytest

import gonio as gn
from gonio.capture.circles import circle_of_mask, outline_of_mask
from gonio.capture.silhouette import sphere_of_silhouette
from gonio.errors import ArrayError, ParameterError

SIZE = (480, 640)
POSE = gn.look_at((1.0, -3.0, 2.0), (0.2, 0.1, 0.0))
DISTORTION = (-0.2, 0.05, 0.002, -0.001, 0.0)


def pinhole(focal=450.0, distortion=(0.0,) * 5):
    lens = {"fx": focal, "fy": 1.02 * focal, "cx": 250.3, "cy": 235.1, "distortion": distortion}
    return gn.Pinhole(size=SIZE, pose=POSE, **lens)


def standing(camera, degrees, pixels, azimuth=0.1, radius=1.0):
    """A sphere so many degrees off the axis, whose outline on the axis would be of so many pixels."""
    theta, distance = math.radians(degrees), radius / math.sin(math.atan(pixels / camera.fx))
    a = np.array([math.sin(theta) * math.cos(azimuth), math.sin(theta) * math.sin(azimuth), math.cos(theta)])
    return gn.Sphere(camera.position + camera.pose[:3, :3] @ (distance * a), radius)


def off(camera, found, true):
    """How far the image of the centre is off, in pixels, and the distance, as a share of itself."""
    pixels = np.linalg.norm(camera.project(found.centre)[0] - camera.project(true.centre)[0])
    near, far = (np.linalg.norm(sphere.centre - camera.position) for sphere in (found, true))
    return pixels, near / far - 1


@pytest.mark.parametrize("distortion", [(0.0,) * 5, DISTORTION], ids=["straight", "distorted"])
@pytest.mark.parametrize("degrees", [0, 8, 30])
def test_a_sphere_is_found_where_it_stands_on_the_axis_and_off_it(degrees, distortion):
    camera = pinhole(distortion=distortion)
    sphere = standing(camera, degrees, 50)
    found = sphere_of_silhouette(sphere.view(camera).mask, camera, 1.0)
    pixels, distance = off(camera, found.sphere, sphere)
    # Some 400 points, each off by .24: two coordinates to .24 sqrt(2 / 400) = .017 pixels each, the radius to .012 of
    # 50. Neighbours on a grid are off alike, which makes this half as much again. Four times that:
    assert pixels < 0.14 and abs(distance) < 1.5e-3
    # Even over +-1/2 pixel along rows or columns is .29 rms; across a slanting outline it is less.
    assert 0.2 < found.residual < 0.29 and found.share > 0.99
    # A hundredth of a pixel or so all around: a few pixels change sides.
    assert (found.sphere.view(camera).mask ^ sphere.view(camera).mask).sum() < 0.03 * 400


def test_off_the_axis_the_outline_is_no_circle_and_its_nearest_circle_misplaces_the_sphere():
    camera = pinhole()
    with pytest.raises(ArrayError, match="not round"):
        circle_of_mask(standing(camera, 30, 50).view(camera).mask)
    sphere = standing(camera, 30, 15)
    mask = sphere.view(camera).mask
    circle = circle_of_mask(mask)  # of a small ball the ellipse is within what masks may be off
    _, ray = camera.rays(np.array(circle.centre[::-1]))
    by_circle = gn.Sphere(camera.position + ray * camera.fx / circle.radius, 1.0)
    # The ellipse's axes are 15 / cos^2 and 15 / cos of 30 degrees, a quarter more than 15: so much too near.
    assert off(camera, by_circle, sphere)[1] < -0.15
    # 15 pixels instead of 50: .24 * 1.5 / (15 sqrt(120)) = 2.2e-3. Four times that:
    found = sphere_of_silhouette(mask, camera, 1.0)
    assert abs(off(camera, found.sphere, sphere)[1]) < 9e-3
    assert found.residual < 0.29 < circle.residual


def test_outlines_are_neither_too_wide_nor_too_narrow(rng):
    camera = pinhole()
    error = []
    for _ in range(20):
        sphere = standing(camera, rng.uniform(0, 10), rng.uniform(30, 40), rng.uniform(0, 2 * math.pi))
        found = sphere_of_silhouette(sphere.view(camera).mask, camera, 1.0)
        error.append(35 * off(camera, found.sphere, sphere)[1])
    # In pixels of the radius: .24 * 1.5 / sqrt(280) = .02 each, and a fifth of it of 20; of pixels on the sphere alone
    # the outline would be .5 too narrow.
    assert abs(np.mean(error)) < 0.015


def test_a_mask_a_pixel_aside_moves_the_sphere_by_a_pixel():
    camera = gn.Pinhole(fx=2000.0, fy=2000.0, cx=320.0, cy=240.0, size=SIZE)
    sphere = gn.Sphere((0.0, 0.0, 40.0), 1.0)
    mask = sphere.view(camera).mask
    here, aside = (sphere_of_silhouette(m, camera, 1.0).sphere for m in (mask, np.roll(mask, 1, axis=1)))
    # So near to the axis of so long a lens, a silhouette moves without changing.
    move = camera.project(aside.centre)[0] - camera.project(here.centre)[0]
    np.testing.assert_allclose(move, (1, 0), atol=1e-3)


def test_the_unit_of_length_is_the_radiuss():
    camera = pinhole()
    mask = standing(camera, 8, 50).view(camera).mask
    one, many = sphere_of_silhouette(mask, camera, 1.0).sphere, sphere_of_silhouette(mask, camera, 17.5).sphere
    assert many.radius == 17.5
    np.testing.assert_allclose(many.centre - camera.position, 17.5 * (one.centre - camera.position), rtol=1e-12)


@pytest.mark.parametrize("distortion", [(0.0,) * 5, DISTORTION], ids=["straight", "distorted"])
def test_a_stand_and_a_hole_and_a_neighbour_do_not_move_the_sphere(distortion):
    camera = pinhole(distortion=distortion)
    sphere = standing(camera, 20, 50)
    mask = sphere.view(camera).mask
    x, y = (int(k) for k in camera.project(sphere.centre)[0])
    mask[y - 5 : y + 10, x - 20 : x] = False
    mask[y : y + 70, x - 12 : x + 12] = True
    mask |= standing(camera, 14.5, 15).view(camera).mask
    mask[10:20, 10:60] = True
    found = sphere_of_silhouette(mask, camera, 1.0)
    pixels, distance = off(camera, found.sphere, sphere)
    # Four fifths are left, and of a stand's sides the first pixel or two still seem to be the outline's.
    assert 0.67 < found.share < 0.9
    assert pixels < 0.2 and abs(distance) < 2e-3


def test_what_the_frame_leaves_of_an_outline_is_enough():
    camera = pinhole()
    sphere = standing(camera, 40, 50)
    mask = sphere.view(camera).mask
    assert mask[:, -1].sum() > 0.95 * mask.sum(axis=0).max()  # the frame cuts off half of it
    found = sphere_of_silhouette(mask, camera, 1.0)
    pixels, distance = off(camera, found.sphere, sphere)
    # Where the other side is, and so the distance, is told by the curvature of what is left, three times worse.
    assert pixels < 0.5 and abs(distance) < 5e-3


def test_an_orthographic_camera_tells_the_radius_and_not_the_distance():
    camera = gn.Orthographic(size=SIZE, pixel=0.02, pose=POSE)
    for depth in (3.0, 30.0):
        sphere = gn.Sphere(camera.position + camera.pose[:3, :3] @ (1.234, -0.777, depth), 1.1)
        found = sphere_of_silhouette(sphere.view(camera).mask, camera)
        # 55 pixels, 440 points: .012 and .017 pixels of .02, half as much again, and four times that.
        assert found.sphere.radius == pytest.approx(1.1, abs=0.07 * camera.pixel)
        pixels, ahead = camera.project(found.sphere.centre)
        np.testing.assert_allclose(pixels, camera.project(sphere.centre)[0], atol=0.1)
        assert ahead == pytest.approx(2 * found.sphere.radius)
        assert 0.2 < found.residual < 0.29 and found.share > 0.99
        assert (found.sphere.view(camera).mask ^ sphere.view(camera).mask).sum() < 0.03 * 440


def test_masks_that_show_no_sphere_are_refused():
    camera = pinhole()
    box, low = np.zeros(SIZE, bool), np.zeros(SIZE, bool)
    box[100:130, 100:300] = True
    low[-10:] = True
    for mask, match in (
        (np.zeros(SIZE, bool), "False everywhere"),
        (np.ones(SIZE, bool), "outline of 0 points"),
        (np.ones(SIZE), "mask > 127"),
        (np.pad(np.ones((20, 20), bool), 9), r"shape \(38, 38\), camera.size is \(480, 640\)"),
        (box, "not round"),
        (low, "not round"),
    ):
        with pytest.raises(ArrayError, match=match):
            sphere_of_silhouette(mask, camera, 1.0)
    with pytest.raises(ArrayError, match="not round"):
        sphere_of_silhouette(box, gn.Orthographic(size=SIZE, pixel=1.0))


def test_the_radius_is_given_to_a_pinhole_and_to_no_other():
    camera = pinhole()
    mask = standing(camera, 0, 50).view(camera).mask
    with pytest.raises(ParameterError, match="radius is missing"):
        sphere_of_silhouette(mask, camera)
    for radius in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ParameterError, match=r"radius = .* is not a positive number"):
            sphere_of_silhouette(mask, camera, radius)
    with pytest.raises(ParameterError, match="Leave it out"):
        sphere_of_silhouette(mask, gn.Orthographic(size=SIZE, pixel=1.0), 1.0)
    with pytest.raises(ParameterError, match="camera is tuple"):
        sphere_of_silhouette(mask, SIZE, 1.0)


def test_the_outline_runs_midway_between_pixels_on_the_sphere_and_off_it():
    mask = np.zeros((20, 20), bool)
    mask[5:9, 7:12] = True
    row, column = outline_of_mask(mask).T
    # On the grid lines around the box, 5 to 9 and 7 to 12 in coordinates in which pixels are one wide.
    assert set(row[(column > 7) & (column < 12)]) == {5, 9} and set(column[(row > 5) & (row < 9)]) == {7, 12}
    assert len(row) == 2 * (4 + 5)
