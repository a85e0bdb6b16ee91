"""Cameras of transforms.json, read and written."""

import json
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from reference.poses import EXACT, LENS, POINTS, by_nerf, camera_to_world, transforms

import gonio as gn
from gonio.errors import FileError, ParameterError
from gonio.files.camera_poses import read_cameras
from gonio.files.transforms import write_transforms


def test_points_are_seen_where_nerf_defines_them(tmp_path):
    distortion = {"k1": -0.08, "k2": 0.03, "p1": 0.002, "p2": -0.001, "k3": 0.01}
    path = transforms(tmp_path / "transforms.json", **LENS, **distortion, k4=0, is_fisheye=False, camera_angle_x=2.0)
    cameras = read_cameras(path)
    assert list(cameras) == ["./images/0.png", "./images/1.png"]
    lens = {key: value for key, value in LENS.items() if key not in "wh"}
    for k, camera in enumerate(cameras.values()):
        assert_allclose(camera.project(POINTS)[0], by_nerf(camera_to_world(k), **lens, **distortion), **EXACT)
    assert list(read_cameras(tmp_path)) == list(cameras)


def test_an_angle_of_view_is_that_of_the_whole_width(tmp_path):
    frames = [{"file_path": "a.png", "transform_matrix": camera_to_world(0).tolist()}]
    camera = read_cameras(transforms(tmp_path / "x.json", frames, w=800.0, h=600, camera_angle_x=0.9))["a.png"]
    assert camera.size == (600, 800)
    _, ray = camera.rays(np.array([[0.0, 300.0], [800.0, 300.0]]))
    assert_allclose(np.arccos(ray[0] @ ray[1]), 0.9, atol=1e-12)
    assert camera.fx == camera.fy  # square pixels, where nothing else is said
    path = transforms(tmp_path / "x.json", frames, w=800, h=600, camera_angle_x=0.9, camera_angle_y=0.7)
    _, ray = read_cameras(path)["a.png"].rays(np.array([[400.0, 0.0], [400.0, 600.0]]))
    assert_allclose(np.arccos(ray[0] @ ray[1]), 0.7, atol=1e-12)


def test_what_a_frame_says_goes_before_what_all_share(tmp_path):
    own = {"w": 640, "h": 480, "fl_x": 700.0, "fl_y": 710.0, "cx": 300.0, "cy": 250.0, "k1": 0.05}
    matrix = camera_to_world(0)
    frames = [{"file_path": "a", "transform_matrix": matrix.tolist()}]
    frames += [{"file_path": "b", "transform_matrix": matrix[:3].tolist(), **own}]
    cameras = read_cameras(transforms(tmp_path / "x.json", frames, **LENS, k1=-0.08, p1=0.001))
    assert cameras["a"].size == (600, 800)
    assert cameras["b"].size == (480, 640)
    assert_allclose(
        cameras["a"].project(POINTS)[0],
        by_nerf(matrix, 900.5, 880.25, 410.25, 305.5, k1=-0.08, p1=0.001),
        **EXACT,
    )
    assert_allclose(
        cameras["b"].project(POINTS)[0], by_nerf(matrix, 700.0, 710.0, 300.0, 250.0, k1=0.05, p1=0.001), **EXACT
    )


def test_sizes_that_a_file_does_not_give_are_those_of_its_photographs(tmp_path):
    (tmp_path / "train").mkdir()
    gn.write_image(tmp_path / "train" / "r_0.png", np.full((6, 8, 3), 0.5), "srgb")
    frames = [{"file_path": "./train/r_0", "transform_matrix": camera_to_world(0).tolist()}]
    camera = read_cameras(transforms(tmp_path / "x.json", frames, camera_angle_x=0.6))["./train/r_0"]
    assert camera.size == (6, 8)
    assert (camera.cx, camera.cy) == (4, 3)
    assert_allclose(camera.fx, 4 / math.tan(0.3))
    # Not outside the folder.
    frames[0]["file_path"] = "../r_0.png"
    gn.write_image(tmp_path / "r_0.png", np.full((6, 8, 3), 0.5), "srgb")
    with pytest.raises(FileError, match=r"frames\[0\] has no w and h, and '\.\./r_0\.png' does not lie"):
        read_cameras(transforms(tmp_path / "train" / "x.json", frames, camera_angle_x=0.6))


@pytest.mark.parametrize("shared", [True, False])
def test_cameras_come_back_as_written(tmp_path, shared):
    first = gn.Pinhole.look_at((3, 1, 2), (0, 0, 0), 40, (600, 800))
    lens = {"fx": 901.0, "fy": 1 / 3, "cx": 17.3, "cy": 444.4, "distortion": (1e-3, 2e-9, 3e-4, -4e-5, 5e-6)}
    second = gn.Pinhole(size=(480, 640), pose=gn.look_at((-1, 2, 0.3), (0, 0, 1)), **{**lens, "fy": 877.0 + 1 / 3})
    cameras = {"a/ä b.jpg": first, "c.png": first if shared else second}
    write_transforms(tmp_path / "transforms.json", cameras)
    again = read_cameras(tmp_path / "transforms.json")
    assert list(again) == list(cameras)
    for name, camera in cameras.items():
        for field in ("size", "fx", "fy", "cx", "cy", "distortion"):
            assert getattr(again[name], field) == getattr(camera, field)
        assert_allclose(again[name].pose, camera.pose, rtol=0, atol=2e-15)  # the rotation is made exact again


def test_what_is_written_is_what_nerf_reads(tmp_path):
    camera = gn.Pinhole.look_at((3, 1, 2), (0, 0, 0), 40, (600, 800))
    write_transforms(tmp_path / "transforms.json", {"a.png": camera})
    written = json.loads((tmp_path / "transforms.json").read_text())
    assert (written["w"], written["h"]) == (800, 600)
    lens = {key: written[key] for key in ("fl_x", "fl_y", "cx", "cy")}
    matrix = np.array(written["frames"][0]["transform_matrix"])
    assert_allclose(by_nerf(matrix, **lens), camera.project(POINTS)[0], **EXACT)
    # The camera is above the plane z = 0 and upright: its y axis goes up in the world.
    assert matrix[2, 1] > 0.5
    assert_allclose(written["camera_angle_x"], 2 * math.atan(400 / camera.fx))


def test_a_file_is_written_whole_or_not_at_all(tmp_path):
    path = tmp_path / "transforms.json"
    path.write_text("old")
    with pytest.raises(ParameterError, match="cameras is empty"):
        write_transforms(path, {})
    with pytest.raises(ParameterError, match=r"cameras\['a'\] is of Orthographic"):
        write_transforms(path, {"a": gn.Orthographic(size=(4, 4), pixel=1.0)})
    assert path.read_text() == "old"
    with pytest.raises(FileError, match="does not exist"):
        write_transforms(tmp_path / "none" / "x.json", {"a": gn.Pinhole.look_at((3, 1, 2), (0, 0, 0), 40, (6, 8))})


def test_rotations_of_few_digits_are_made_exact(tmp_path):
    matrix = camera_to_world(1)
    rough = np.round(matrix, 3)
    frames = [{"file_path": "a", "transform_matrix": rough.tolist()}]
    pose = read_cameras(transforms(tmp_path / "x.json", frames, **LENS))["a"].pose
    assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-15)
    # Nearest in the Frobenius norm: nearer to what came than the rotation that was rounded.
    rotation = pose[:3, :3] * (1, -1, -1)
    assert np.linalg.norm(rotation - rough[:3, :3]) < np.linalg.norm(matrix[:3, :3] - rough[:3, :3])
    assert_array_equal(pose[:3, 3], rough[:3, 3])


def mirrored(matrix):
    return (matrix @ np.diag([-1, 1, 1, 1])).tolist()


GOOD = camera_to_world(0)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"camera_model": "OPENCV_FISHEYE"}, "camera_model 'OPENCV_FISHEYE' is not read; SIMPLE_PINHOLE, "),
        ({"camera_model": ["PINHOLE"]}, "camera_model .*is not read"),
        ({"is_fisheye": True}, "is_fisheye is not read"),
        ({"ftheta_p0": 0.0}, "ftheta_p0 is not read"),
        ({"k4": 0.1}, "k4 = 0.1 is not read"),
        ({"fl_x": "900"}, "fl_x = '900' is no number"),
        ({"fl_x": True}, "fl_x = True is no number"),
        ({"fl_x": -1.0}, "fx = -1 is not a positive number"),
        ({"fl_x": 9.0, "fl_y": 0.0}, "fy = 0 is not a positive number"),
        ({"fl_y": 9.0}, "has neither fl_x nor camera_angle_x"),  # whether the shared fl_x is meant is not known
        ({"cx": math.nan}, "cx = nan is not finite"),
        ({"cy": 10**400}, "cy = 1000.* is no number that fits"),
        ({"w": 800.5}, "size = "),
        ({"h": 0}, "size = "),
        ({"k1": math.inf}, "k1 = inf is not finite"),
        ({"k1": -5.0}, "folds over"),
        ({"file_path": ""}, "file_path = '' is no name"),
        ({"file_path": 3}, "file_path = 3 is no name"),
        ({"file_path": "first"}, "file_path 'first' has two cameras"),
        ({"transform_matrix": "eye"}, "transform_matrix is no rows of numbers"),
        ({"transform_matrix": [[1, 0], [0]]}, "transform_matrix is no rows of numbers"),
        ({"transform_matrix": GOOD[:3, :3].tolist()}, r"transform_matrix has shape \(3, 3\)"),
        ({"transform_matrix": GOOD.T.tolist()}, "last row"),
        ({"transform_matrix": (GOOD * math.nan).tolist()}, "transform_matrix has numbers that are not finite"),
        ({"transform_matrix": (GOOD * 1e200).tolist()}, "transform_matrix does not rotate"),
        ({"transform_matrix": (GOOD @ np.diag([1.002, 1, 1, 1])).tolist()}, "determinant is 1.002"),
        ({"transform_matrix": mirrored(GOOD)}, "determinant is -1"),
        ({"transform_matrix": (GOOD + np.diag([0, 0.01, 0, 0])).tolist()}, "transform_matrix does not rotate"),
    ],
)
def test_frames_that_are_no_cameras_are_refused_by_field(tmp_path, fields, message):
    first = {"file_path": "first", "transform_matrix": GOOD.tolist()}
    frames = [first, {**first, "file_path": "second", **fields}]
    with pytest.raises(FileError, match=rf"(?s)x\.json: frames\[1\].*{message}"):
        read_cameras(transforms(tmp_path / "x.json", frames, **LENS))


def test_an_angle_of_view_lies_below_a_half_turn(tmp_path):
    with pytest.raises(FileError, match=r"camera_angle_x = 3\.2 lies outside"):
        read_cameras(transforms(tmp_path / "x.json", w=8, h=6, camera_angle_x=3.2))
    with pytest.raises(FileError, match=r"frames\[0\] has neither fl_x nor camera_angle_x"):
        read_cameras(transforms(tmp_path / "x.json", w=8, h=6))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "is no JSON, or is cut short"),
        ("[" * 100_000, "is no JSON, or is cut short"),
        ("\udcff", "is no JSON"),
        ("[]", "no list of frames"),
        ('{"frames": {}}', "no list of frames"),
        ('{"frames": []}', "has no camera"),
        ('{"frames": [1]}', r"frames\[0\] is no object"),
        ('{"frames": [{"file_path": "a", "w": 8, "h": 6, "fl_x": 9}]}', "has no transform_matrix"),
    ],
)
def test_what_is_no_transforms_is_refused(tmp_path, text, message):
    (tmp_path / "x.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(FileError, match=message):
        read_cameras(tmp_path / "x.json")


def test_a_file_too_large_for_transforms_is_refused_before_it_is_read(tmp_path):
    with (tmp_path / "x.json").open("wb") as stream:
        stream.truncate(2**26 + 1)
    with pytest.raises(FileError, match="more than 67108864 bytes"):
        read_cameras(tmp_path / "x.json")
