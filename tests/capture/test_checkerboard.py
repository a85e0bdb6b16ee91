"""Facts about cameras that a checkerboard calibrates, against the camera that its photographs were ray-traced with."""

import dataclasses

import numpy as np
import pytest
from reference.boards import BOARD, CAMERAS, LENS, POSES, SIZE, photograph, squares

import gonio as gn
from gonio.capture.checkerboard import Board, calibrate_camera, find_corners, pose_of_board
from gonio.errors import ArrayError, ParameterError

TRUE = [camera.project(BOARD.points())[0] for camera in CAMERAS]


@pytest.fixture(scope="module")
def photographs():
    """Six of the board, with noise of 1.3 % of its contrast."""
    rng = np.random.default_rng(6)
    return [photograph(camera) + rng.normal(0, 0.01, SIZE) for camera in CAMERAS]


@pytest.fixture(scope="module")
def corners(photographs):
    return [find_corners(image, BOARD) for image in photographs]


@pytest.fixture(scope="module")
def calibration(corners):
    return calibrate_camera(corners, BOARD, SIZE, terms=4)


def small(board):
    """A camera for other boards, from straight above but turned, and what it sees of one."""
    camera = gn.Pinhole(
        fx=200, fy=200, cx=81, cy=59, size=(120, 160), pose=gn.look_at((1, -2, 16), (0, 0, 0), (0, 1, 0))
    )
    return camera, photograph(camera, lambda x, y: squares(x, y, board), fine=6)


def test_corners_are_found_to_a_twentieth_of_a_pixel_and_count_from_the_edge_of_the_image(corners):
    off = np.array(corners) - TRUE
    # Squares have no blur here but that of a pixel, the worst case: rays of a pixel's third place an edge to a tenth.
    assert np.sqrt(np.mean(off**2)) < 0.08
    # 324 corners: less than a hundredth of the mean. Half a pixel, OpenCV's way of counting, would be fifty times that.
    assert np.abs(off.mean(axis=(0, 1))).max() < 0.02


def test_exact_corners_give_the_exact_camera():
    found = calibrate_camera(TRUE, BOARD, SIZE)
    lens = found.camera
    # OpenCV takes corners in single precision: 1e-5 of a pixel.
    np.testing.assert_allclose([lens.fx, lens.fy, lens.cx, lens.cy], [330.0, 325.0, 163.2, 117.4], atol=2e-3)
    np.testing.assert_allclose(lens.distortion[:4], LENS.distortion[:4], atol=2e-4)
    np.testing.assert_allclose(found.poses, POSES, atol=1e-3)
    assert found.residual.max() < 1e-4 and found.error.max() < 2e-3


def test_focal_length_and_principal_point_are_known_as_well_as_is_said(calibration):
    lens = calibration.camera
    off = np.abs([lens.fx - 330, lens.fy - 325, lens.cx - 163.2, lens.cy - 117.4])
    # Four standard deviations, of errors that neighbours share a little.
    assert (off < 4 * calibration.error).all() and calibration.error.max() < 0.5
    # What corners are off, .07 rms in each coordinate, makes .1.
    assert calibration.residual.min() > 0.03 and calibration.residual.max() < 0.16


def test_pixels_look_where_they_did(calibration):
    """Distortion, focal length and principal point at once: rays through the corners, but for one turn of them all."""
    seen = np.concatenate(TRUE)
    found, true = calibration.camera.rays(seen)[1], LENS.rays(seen)[1]
    u, _, vt = np.linalg.svd(found.T @ true)
    off = np.linalg.norm(found @ (u @ vt) - true, axis=1) * 330
    assert off.max() < 0.25 and np.sqrt(np.mean(off**2)) < 0.08


def test_poses_are_those_of_the_camera_in_the_boards_frame(calibration, corners):
    distance = np.linalg.norm(POSES[:, :3, 3], axis=1)
    off = np.linalg.norm((calibration.poses - POSES)[:, :3, 3], axis=1)
    # The distance follows the focal length, known to 1e-3, and its direction the principal point.
    bound = 4 * (calibration.error[:2].max() / 330 + calibration.error[2:].max() / 330) * distance
    assert (off < bound).all()
    # With the camera known, 54 corners off by .06 give a place to some 1e-3 of the distance.
    for k, pose in enumerate(POSES):
        found = pose_of_board(corners[k], BOARD, LENS)
        assert np.linalg.norm((found - pose)[:3, 3]) < 3e-3 * distance[k]
        assert np.abs((found - pose)[:3, :3]).max() < 5e-3


def test_the_pose_of_exact_corners_is_exact_from_far_away_too():
    for eye in ((300.0, -500, 900), (0.0, 1, 95), (120, 30, 40)):
        camera = dataclasses.replace(LENS, pose=gn.look_at(eye, (0, 0, 0), (0, 1, 0)))
        found = pose_of_board(camera.project(BOARD.points())[0], BOARD, camera)
        np.testing.assert_allclose(found, camera.pose, atol=1e-6)


def test_a_photograph_upside_down_is_told_by_the_black_corner_square(photographs):
    """The board turned in its plane by 180 degrees, which is the camera turned by as much about its axis."""
    upright = find_corners(photographs[0], BOARD)
    turned = find_corners(photographs[0][::-1, ::-1], BOARD)
    np.testing.assert_allclose(turned, np.array(SIZE[::-1]) - upright, atol=0.05)
    # By a quarter, x goes to y.
    quarter = find_corners(np.rot90(photographs[0]), BOARD)
    np.testing.assert_allclose(quarter[:, 0], upright[:, 1], atol=0.05)


@pytest.mark.parametrize("shape", [(4, 4), (3, 5), (5, 4)])
def test_boards_that_look_the_same_upside_down_are_taken_upright(shape):
    camera, image = small(Board(shape))
    board = Board(shape)
    # Squares of 12 pixels: a window of 3 around a corner averages little.
    np.testing.assert_allclose(find_corners(image, board), camera.project(board.points())[0], atol=0.3)
    for turned in (image[::-1, ::-1], image if (sum(shape)) % 2 else np.rot90(image, 2)):
        found = find_corners(turned, board).reshape(*shape, 2)
        right, up = found[0, -1] - found[0, 0], found[0, 0] - found[-1, 0]
        # y is down in the image: seen from its front, right and up turn clockwise there.
        assert right[0] * up[1] - right[1] * up[0] < 0
        if sum(shape) % 2 == 0:
            assert right[0] > 0 and up[1] < 0


@pytest.mark.parametrize("unit", [1e-4, 1.0, 2e5])
def test_the_unit_of_radiance_a_lamp_and_uneven_light_do_not_hide_a_board(photographs, unit):
    image = photographs[5].clip(0, None) * (0.05 + (np.arange(320) + 0.5) / 320) ** 2
    image[:8, :8] = 100.0
    found = find_corners(np.repeat(unit * image[..., None], 3, axis=2), BOARD)
    # Where the light falls to a hundredth, noise is a fifth of the contrast.
    assert np.median(np.abs(found - TRUE[5])) < 0.1 and np.abs(found - TRUE[5]).max() < 1


def test_a_large_photograph_is_searched_small_and_measured_whole():
    pose = gn.look_at((30, -50, 115), (0, 0, 0), (0, 1, 0))
    camera = gn.Pinhole(fx=2000, fy=2000, cx=853, cy=641, size=(1280, 1700), pose=pose)
    image = photograph(camera, lambda x, y: 0.2 + np.minimum(squares(x, y), 0.7), fine=1)
    off = find_corners(image, BOARD) - camera.project(BOARD.points())[0]
    # One ray to a pixel: edges in whole pixels, .29 rms, over some twenty of them. A pixel of the search would be 2.
    assert np.abs(off.mean(axis=0)).max() < 0.05 and np.sqrt(np.mean(off**2)) < 0.2


def test_where_no_board_is_none_is_found(rng, photographs):
    for image in (np.zeros(SIZE), rng.uniform(0, 1, SIZE), photographs[0][:, :160]):
        with pytest.raises(ArrayError, match="shows no checkerboard of 9 x 6 inner corners"):
            find_corners(image, BOARD)
    with pytest.raises(ArrayError, match="no checkerboard of 8 x 5"):
        find_corners(np.full(SIZE, 0.3), Board((5, 8)))
    with pytest.raises(ArrayError, match=r"shape \(240,\)"):
        find_corners(np.zeros(240), BOARD)
    with pytest.raises(ArrayError, match="is nan"):
        find_corners(np.full(SIZE, np.nan), BOARD)


def test_photographs_that_tell_no_camera_are_refused():
    with pytest.raises(ArrayError, match="corners of 2 photographs; three or more"):
        calibrate_camera(TRUE[:2], BOARD, SIZE)
    with pytest.raises(ArrayError, match=r"corners\[1\] has shape \(53, 2\)"):
        calibrate_camera([TRUE[0], TRUE[1][:-1], TRUE[2]], BOARD, SIZE)
    with pytest.raises(ParameterError, match="terms = 3"):
        calibrate_camera(TRUE, BOARD, SIZE, terms=3)
    with pytest.raises(ArrayError, match=r"corners\[2\] are those of a board seen from behind"):
        calibrate_camera([*TRUE[:2], TRUE[2].reshape(6, 9, 2)[:, ::-1].reshape(-1, 2), *TRUE[3:]], BOARD, SIZE, terms=0)
    with pytest.raises(ParameterError, match="camera is Orthographic"):
        pose_of_board(TRUE[0], BOARD, gn.Orthographic(size=SIZE, pixel=1.0))
    flat = [TRUE[5] + shift for shift in ((0, 0), (3.0, 1.0), (-2.0, 4.0))]
    with pytest.raises(ArrayError, match="do not tell the focal length"):
        calibrate_camera(flat, BOARD, SIZE, terms=0)


def test_fewer_terms_leave_the_others_at_zero(corners):
    assert calibrate_camera(corners, BOARD, SIZE, terms=1).camera.distortion[1:] == (0, 0, 0, 0)
    assert calibrate_camera(corners, BOARD, SIZE, terms=2).camera.distortion[2:] == (0, 0, 0)
    assert calibrate_camera(corners, BOARD, SIZE, terms=0).residual.max() > 0.2


def test_a_board_has_rows_and_columns_of_corners_about_its_middle():
    points = Board((3, 4), 2.0).points()
    np.testing.assert_array_equal(points[0], [-3, 2, 0])
    np.testing.assert_array_equal(points[-1], [3, -2, 0])
    np.testing.assert_array_equal(points.mean(axis=0), [0, 0, 0])
    with pytest.raises(ParameterError, match=r"corners = \(2, 9\)"):
        Board((2, 9))
    with pytest.raises(ParameterError, match="square = 0"):
        Board((6, 9), 0.0)
