"""Cameras: rays and projection are inverse, and agree with OpenCV, COLMAP and OpenGL."""

import math

import numpy as np
import pytest

import gonio as gn
from gonio.cameras import from_colmap, from_opengl, to_colmap, to_opengl

POSE = gn.look_at((2.0, -3.0, 1.5), (0.1, 0.2, -0.1))
LENS = (-0.21, 0.08, 0.0011, -0.0007, -0.012)


def photograph(distortion=LENS, size=(48, 64)):
    return gn.Pinhole(fx=71.0, fy=69.0, cx=30.5, cy=25.25, size=size, pose=POSE, distortion=distortion)


CAMERAS = {
    "orthographic": gn.Orthographic(size=(48, 64), pixel=0.05, pose=POSE),
    "pinhole": photograph((0, 0, 0, 0, 0)),
    "lens": photograph(),
}


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())
def test_a_point_on_a_pixels_ray_is_seen_in_that_pixel(camera, rng):
    origins, directions = camera.rays()
    assert origins.shape == directions.shape == (48, 64, 3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1, atol=1e-14)
    distance = rng.uniform(0.5, 9.0, size=(48, 64, 1))
    pixels, depth = camera.project(origins + distance * directions)
    np.testing.assert_allclose(pixels, camera.pixels(), atol=1e-9)  # Newton ends at 1e-12 of the image plane
    np.testing.assert_allclose(depth, (distance[..., 0] * (directions @ camera.forward)), atol=1e-12)


def test_the_target_is_seen_in_the_middle_with_up_upwards():
    camera = gn.Pinhole.look_at((2.0, -3.0, 1.5), (0.1, 0.2, -0.1), field_of_view=40, size=(48, 64))
    target = np.array([0.1, 0.2, -0.1])
    np.testing.assert_allclose(camera.project(target)[0], (32, 24), atol=1e-12)
    above = camera.project(target + np.array([0, 0, 0.1]))[0]
    assert above[1] < 24 - 1
    assert above[0] == pytest.approx(32)
    # To the viewer's right is the cross product of where he looks and up.
    right = np.cross(camera.forward, (0, 0, 1))
    assert camera.project(target + 0.1 * right)[0][0] > 33


def test_the_field_of_view_spans_the_rows():
    camera = gn.Pinhole.look_at((0, -1, 0), (0, 0, 0), field_of_view=40, size=(48, 64))
    _, d = camera.rays([[32.0, 0.0], [32.0, 48.0]])
    assert math.degrees(math.acos(d[0] @ d[1])) == pytest.approx(40)


def test_projection_agrees_with_opencv(rng):
    cv2 = pytest.importorskip("cv2")
    camera = photograph()
    points = camera.position + 4 * camera.forward + rng.normal(size=(200, 3)) * 0.7
    to_camera = camera.pose[:3, :3].T
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    theirs, _ = cv2.projectPoints(
        points, cv2.Rodrigues(to_camera)[0], -to_camera @ camera.position, matrix, np.array(camera.distortion)
    )
    np.testing.assert_allclose(camera.project(points)[0], theirs[:, 0], atol=1e-9)


def test_rays_agree_with_opencv():
    cv2 = pytest.importorskip("cv2")
    camera = photograph()
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    pixels = camera.pixels().reshape(-1, 1, 2)
    # OpenCV iterates a fixed point, which at this distortion has come to 1e-6 after 200 turns.
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-12)
    undistort = getattr(cv2, "undistortPointsIter", cv2.undistortPoints)  # one name since OpenCV 5
    theirs = undistort(pixels, matrix, np.array(camera.distortion), R=None, P=None, criteria=criteria)[:, 0]
    local = camera.rays()[1].reshape(-1, 3) @ camera.pose[:3, :3]
    np.testing.assert_allclose(local[:, :2] / local[:, 2:], theirs, atol=1e-6)


def test_opengl_poses_look_along_minus_z_with_y_up():
    identity = from_opengl(np.eye(4))
    np.testing.assert_array_equal(identity[:3, 2], (0, 0, -1))
    np.testing.assert_array_equal(identity[:3, 1], (0, -1, 0))
    np.testing.assert_allclose(from_opengl(to_opengl(POSE)), POSE, atol=1e-15)


def test_colmap_poses_take_the_world_to_the_camera(rng):
    quaternion, translation = to_colmap(POSE)
    np.testing.assert_allclose(from_colmap(quaternion, translation), POSE, atol=1e-12)
    # What COLMAP documents: X_camera = R(q) X_world + t, with the camera at -R^T t.
    from scipy.spatial.transform import Rotation

    world = rng.normal(size=(5, 3))
    w, x, y, z = quaternion
    theirs = Rotation.from_quat([x, y, z, w]).apply(world) + translation
    camera = gn.Pinhole(fx=1, fy=1, cx=0, cy=0, size=(1, 1), pose=POSE)
    np.testing.assert_allclose(camera.project(world)[1], theirs[:, 2], atol=1e-12)


def test_points_behind_a_pinhole_have_no_pixel():
    camera = photograph()
    pixels, depth = camera.project(camera.position - camera.forward)
    assert np.isnan(pixels).all()
    assert depth == pytest.approx(-1)


def test_points_past_the_fold_of_a_lens_have_no_pixel():
    camera = gn.Pinhole(fx=100, fy=100, cx=16, cy=16, size=(32, 32), distortion=(-0.3, 0, 0, 0, 0))
    # d(r - .3 r^3)/dr = 0 at r = 1.054; at r = 1.9 the polynomial would show the point at r = -.16, in the image.
    assert np.isnan(camera.project((1.9, 0, 1.0))[0]).all()
    assert np.isfinite(camera.project((1.0, 0, 1.0))[0]).all()


def test_a_lens_that_folds_inside_the_image_is_refused():
    with pytest.raises(gn.GonioError, match="folds over"):
        gn.Pinhole(fx=20, fy=20, cx=16, cy=16, size=(32, 32), distortion=(-0.4, 0, 0, 0, 0))


def test_a_strong_lens_is_inverted_up_to_its_fold():
    # r - .3 r^3 has its largest value .7027 at the fold: rays up to 99.9 % of it are found.
    camera = gn.Pinhole(fx=100, fy=100, cx=0, cy=0, size=(32, 32), distortion=(-0.3, 0, 0, 0, 0))
    radius = np.linspace(0, 0.702, 50)
    pixels = np.stack((100 * radius, 0 * radius), axis=-1)
    origins, directions = camera.rays(pixels)
    np.testing.assert_allclose(camera.project(origins + directions)[0], pixels, atol=1e-6)
    assert np.all(np.diff(directions[:, 0] / directions[:, 2]) > 0)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: gn.look_at((0, 0, 5), (0, 0, 0)), "along the line of sight"),
        (lambda: gn.look_at((1, 0, 0), (1, 0, 0)), "no direction"),
        (lambda: gn.look_at((1, 0), (1, 0, 0)), "shape"),
        (lambda: gn.Orthographic(size=(0, 5), pixel=1), "rows, columns"),
        (lambda: gn.Orthographic(size=(5, 5), pixel=-1), "pixel = -1"),
        (lambda: gn.Orthographic(size=(5, 5), pixel=1, pose=2 * np.eye(4)), "last row"),
        (lambda: gn.Orthographic(size=(5, 5), pixel=1, pose=np.diag([1.0, 1, -1, 1])), "mirrors"),
        (lambda: gn.Orthographic(size=(5, 5), pixel=1, pose=np.full((3, 4), np.nan)), "nan"),
        (lambda: gn.Pinhole(fx=math.nan, fy=1, cx=0, cy=0, size=(5, 5)), "fx"),
        (lambda: gn.Pinhole(fx=1, fy=1, cx=0, cy=0, size=(5, 5), distortion=(0.1, 0.2)), "five finite terms"),
        (lambda: gn.Pinhole.look_at((1, 0, 0), (0, 0, 0), field_of_view=190, size=(5, 5)), "degrees"),
        (lambda: from_colmap((2, 0, 0, 0), (0, 0, 0)), "length 2"),
        (lambda: photograph().project((1.0, 2.0)), "points has shape"),
        (lambda: photograph().rays((1.0, 2.0, 3.0)), "pixels has shape"),
    ],
)
def test_cameras_refuse(make, match):
    with pytest.raises(gn.GonioError, match=match):
        make()


def test_cameras_are_frozen():
    with pytest.raises(ValueError, match="read-only"):
        CAMERAS["pinhole"].pose[0, 0] = 2
