"""Cameras of several photographs: transforms.json and COLMAP's models."""

from __future__ import annotations

import json
import math
import struct

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

import gonio as gn
from gonio.errors import FileError, ParameterError
from gonio.files.camera_poses import read_cameras, write_transforms

POINTS = np.array([[0.1, 0.2, 0.05], [-0.3, 0.1, 0.2], [0.25, -0.2, -0.1]])  # near the origin, seen by every camera
EXACT = {"rtol": 0, "atol": 1e-9}  # pixels: 1e-16 of some thousand, with the rounding of a few products

# COLMAP's lens models: number, parameters.
MODELS = {
    "SIMPLE_PINHOLE": (0, (900.5, 410.25, 305.5)),
    "PINHOLE": (1, (900.5, 880.25, 410.25, 305.5)),
    "SIMPLE_RADIAL": (2, (900.5, 410.25, 305.5, -0.08)),
    "RADIAL": (3, (900.5, 410.25, 305.5, -0.08, 0.03)),
    "OPENCV": (4, (900.5, 880.25, 410.25, 305.5, -0.08, 0.03, 0.002, -0.001)),
}


def world_to_camera(k):
    """A rotation (OpenCV's axes) and translation of a camera that stands 4 away and looks about to the origin."""
    rotation = Rotation.from_euler("xyz", (0.3 + 0.2 * k, -0.2 + 0.7 * k, 0.1 * k))
    return rotation, np.array([0.1 * k, -0.05, 4.0])


def by_colmap(model, parameters, rotation, translation):
    """Pixels of POINTS by COLMAP's definition of its lens models."""
    u, v, w = (POINTS @ rotation.as_matrix().T + translation).T
    u, v = u / w, v / w
    r2 = u * u + v * v
    du = dv = 0
    if model in ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"):
        f, cx, cy, *k = parameters
        fx = fy = f
        radial = sum(term * r2 ** (n + 1) for n, term in enumerate(k))
    else:
        fx, fy, cx, cy, *k = parameters
        k1, k2, p1, p2 = k or (0, 0, 0, 0)
        radial = k1 * r2 + k2 * r2 * r2
        du = 2 * p1 * u * v + p2 * (r2 + 2 * u * u)
        dv = 2 * p2 * u * v + p1 * (r2 + 2 * v * v)
    return np.stack((fx * (u + u * radial + du) + cx, fy * (v + v * radial + dv) + cy), axis=-1)


def quaternion(rotation):
    x, y, z, w = rotation.as_quat()
    return w, x, y, z


def text_model(folder):
    """One photograph for each lens model, points in every other one, and a name with a space."""
    folder.mkdir()
    cameras, images = (
        [f"# Camera list\n# Number of cameras: {len(MODELS)}\n"],
        ["# Image list\n# Number of images: 5\n"],
    )
    for k, (model, (_, parameters)) in enumerate(MODELS.items()):
        rotation, translation = world_to_camera(k)
        cameras.append(f"{10 * k + 3} {model} 800 600 {' '.join(map(repr, parameters))}\n")
        pose = " ".join(repr(float(x)) for x in (*quaternion(rotation), *translation))
        images.append(f"{k + 1} {pose} {10 * k + 3} views/{model} {k}.jpg\n")
        images.append("\n" if k % 2 else "12.5 30.25 -1 100.0 200.5 77\n")
    (folder / "cameras.txt").write_text("".join(cameras))
    (folder / "images.txt").write_text("".join(images))
    return folder


def binary_model(folder, models=tuple(MODELS)):
    """The same as `text_model`, or some of it."""
    folder.mkdir()
    cameras, images = struct.pack("<Q", len(models)), struct.pack("<Q", len(models))
    for k, model in enumerate(models):
        number, parameters = MODELS[model]
        rotation, translation = world_to_camera(k)
        cameras += struct.pack(f"<iiQQ{len(parameters)}d", 10 * k + 3, number, 800, 600, *parameters)
        images += struct.pack("<i7di", k + 1, *quaternion(rotation), *translation, 10 * k + 3)
        images += f"views/{model} {k}.jpg".encode() + b"\0"
        points = [] if k % 2 else [(12.5, 30.25, -1), (100.0, 200.5, 77)]
        images += struct.pack("<Q", len(points)) + b"".join(struct.pack("<ddq", *point) for point in points)
    (folder / "cameras.bin").write_bytes(cameras)
    (folder / "images.bin").write_bytes(images)
    return folder


def camera_to_world(k):
    """The same camera for NeRF: the inverse, with y and z of the camera turned about."""
    rotation, translation = world_to_camera(k)
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.as_matrix()
    matrix[:3, 3] = translation
    matrix = np.linalg.inv(matrix)
    matrix[:, 1:3] *= -1
    return matrix


def by_nerf(matrix, fl_x, fl_y, cx, cy, k1=0.0, k2=0.0, p1=0.0, p2=0.0, k3=0.0):
    """Pixels of POINTS by NeRF's definition: the camera looks along -z with y up, pixels count downwards."""
    x, y, z, _ = np.linalg.inv(matrix) @ np.concatenate((POINTS, np.ones((3, 1))), axis=1).T
    u, v = x / -z, -y / -z
    r2 = u * u + v * v
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    a = u * radial + 2 * p1 * u * v + p2 * (r2 + 2 * u * u)
    b = v * radial + 2 * p2 * u * v + p1 * (r2 + 2 * v * v)
    return np.stack((fl_x * a + cx, fl_y * b + cy), axis=-1)


def transforms(path, frames=None, **fields):
    """A transforms.json of two frames, or of those given."""
    if frames is None:
        frames = [{"file_path": f"./images/{k}.png", "transform_matrix": camera_to_world(k).tolist()} for k in range(2)]
    path.write_text(json.dumps({**fields, "frames": frames}))
    return path


LENS = {"fl_x": 900.5, "fl_y": 880.25, "cx": 410.25, "cy": 305.5, "w": 800, "h": 600}


def test_points_are_seen_where_colmap_defines_them_in_text_and_binary(tmp_path):
    text, binary = read_cameras(text_model(tmp_path / "text")), read_cameras(binary_model(tmp_path / "binary"))
    assert list(text) == list(binary) == [f"views/{model} {k}.jpg" for k, model in enumerate(MODELS)]
    for k, (model, (_, parameters)) in enumerate(MODELS.items()):
        expected = by_colmap(model, parameters, *world_to_camera(k))
        for cameras in (text, binary):
            camera = cameras[f"views/{model} {k}.jpg"]
            assert camera.size == (600, 800)
            pixels, depth = camera.project(POINTS)
            assert_allclose(pixels, expected, **EXACT)
            assert (depth > 0).all()
        assert_array_equal(text[f"views/{model} {k}.jpg"].pose, binary[f"views/{model} {k}.jpg"].pose)


def test_a_colmap_model_is_named_by_its_folder_or_either_file_and_binary_leads(tmp_path):
    folder = text_model(tmp_path / "model")
    named = [read_cameras(place) for place in (folder, folder / "cameras.txt", folder / "images.txt")]
    assert list(named[0]) == list(named[1]) == list(named[2])
    (binary_model(tmp_path / "other") / "cameras.bin").rename(folder / "cameras.bin")
    with pytest.raises(FileError, match=r"images\.bin cannot be read"):
        read_cameras(folder)


def test_points_are_seen_where_nerf_defines_them(tmp_path):
    distortion = {"k1": -0.08, "k2": 0.03, "p1": 0.002, "p2": -0.001, "k3": 0.01}
    path = transforms(tmp_path / "transforms.json", **LENS, **distortion, k4=0, is_fisheye=False, camera_angle_x=2.0)
    cameras = read_cameras(path)
    assert list(cameras) == ["./images/0.png", "./images/1.png"]
    lens = {key: value for key, value in LENS.items() if key not in "wh"}
    for k, camera in enumerate(cameras.values()):
        assert_allclose(camera.project(POINTS)[0], by_nerf(camera_to_world(k), **lens, **distortion), **EXACT)
    assert list(read_cameras(tmp_path)) == list(cameras)


def test_nerf_and_colmap_agree_on_one_scene(tmp_path):
    colmap = list(read_cameras(text_model(tmp_path / "model")).values())[1]
    frame = {"file_path": "a", "transform_matrix": camera_to_world(1).tolist()}
    nerf = read_cameras(transforms(tmp_path / "transforms.json", [frame], **LENS))["a"]
    assert_allclose(nerf.project(POINTS)[0], colmap.project(POINTS)[0], **EXACT)


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


def test_places_without_cameras_are_refused(tmp_path):
    with pytest.raises(FileError, match=r"holds no transforms\.json, and no cameras\.bin"):
        read_cameras(tmp_path)
    with pytest.raises(FileError, match=r"is neither a transforms\.json"):
        read_cameras(tmp_path / "points3D.txt")
    with pytest.raises(FileError, match=r"absent\.json cannot be read"):
        read_cameras(tmp_path / "absent.json")
    with pytest.raises(FileError, match=r"cameras\.bin cannot be read"):
        read_cameras(tmp_path / "images.bin")
    with pytest.raises(FileError, match=r"cameras\.txt cannot be read"):
        read_cameras(tmp_path / "images.txt")
    folder = text_model(tmp_path / "both")
    transforms(folder / "transforms.json", **LENS)
    with pytest.raises(FileError, match=r"holds transforms\.json and cameras\.txt: give one"):
        read_cameras(folder)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("SIMPLE_RADIAL ", "FOV ", "line 5: the camera model FOV is not read; SIMPLE_PINHOLE, "),
        ("SIMPLE_RADIAL ", "simple_radial ", "line 5: the camera model simple_radial is not read"),
        ("3 SIMPLE_PINHOLE 800 600 900.5 ", "3 SIMPLE_PINHOLE 800 600 ", "line 3: SIMPLE_PINHOLE has 3 parameters"),
        ("3 SIMPLE_PINHOLE 800 600 900.5 ", "3 SIMPLE_PINHOLE 800 600 x ", "line 3: f = x is no number"),
        ("3 SIMPLE_PINHOLE 800 600 900.5 ", "3 SIMPLE_PINHOLE 800 600 nan ", "line 3: f = nan is not finite"),
        ("3 SIMPLE_PINHOLE 800 600 900.5 ", "3 SIMPLE_PINHOLE 800 600 -1 ", "line 3: .*fx = -1 is not a positive"),
        ("3 SIMPLE_PINHOLE 800 ", "3 SIMPLE_PINHOLE 8e2 ", "line 3: WIDTH = 8e2 is no whole number"),
        ("3 SIMPLE_PINHOLE 800 ", "3 SIMPLE_PINHOLE 0 ", "line 3: .*size = "),
        ("13 PINHOLE", "3 PINHOLE", "line 4: CAMERA_ID 3 stands in the file twice"),
        ("13 PINHOLE 800 600 900.5 880.25 410.25 305.5", "13 PINHOLE", "line 4 is '13 PINHOLE'; CAMERA_ID MODEL"),
        ("cameras: 5", "cameras: 6", "its comment says 6 cameras, 5 follow"),
        ("Camera list", "\udcff", "line 1 is no text"),
    ],
)
def test_lines_that_are_no_colmap_cameras_are_refused(tmp_path, old, new, message):
    path = text_model(tmp_path / "model") / "cameras.txt"
    text = path.read_text()
    assert old in text
    path.write_bytes(text.replace(old, new, 1).encode("utf-8", "surrogateescape"))
    with pytest.raises(FileError, match=rf"cameras\.txt: {message}"):
        read_cameras(path)


POSE = "1 0 0 0 0 0 4"


@pytest.mark.parametrize(
    ("images", "message"),
    [
        (f"1 {POSE} 1\n\n", ": line 1 is .*; IMAGE_ID QW"),
        (f"1 {POSE} 2 a.png\n\n", ": line 1: CAMERA_ID 2 does not stand"),
        (f"1 {POSE} one a.png\n\n", ": line 1: CAMERA_ID = one is no whole number"),
        ("1 1 0 0 0 0 nan 4 1 a.png\n\n", ": line 1: TY = nan is not finite"),
        ("1 1 0 0 x 0 0 4 1 a.png\n\n", ": line 1: QZ = x is no number"),
        ("1 0.9 0 0 0 0 0 4 1 a.png\n\n", ": line 1: quaternion has length 0.9"),
        ("1 0 0 0 0 0 0 4 1 a.png\n\n", ": line 1: quaternion has length 0"),
        (f"1 {POSE} 1 a.png\n\n2 {POSE} 1 a.png\n\n", ": line 3: NAME 'a.png' has two cameras"),
        (f"1 {POSE} 1 a.png\n1.5 2.5 -1 3.5\n", ": line 2 is no points"),
        # An image without its line of points, whose neighbour has as many words as points could have.
        (f"1 {POSE} 1 a.png\n2 {POSE} 1 b c d.png\n", ": line 2 is no points"),
        (f"1 {POSE} 1 a.png", " is cut short: line 2, the points of 'a.png'"),
        (f"# Number of images: 2, mean: 0\n1 {POSE} 1 a.png\n\n", ": its comment says 2 images, 1 follow"),
        ("# nothing\n", " has no camera of any photograph"),
    ],
)
def test_lines_that_are_no_colmap_images_are_refused(tmp_path, images, message):
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 800 600 900 900 400 300\n")
    (tmp_path / "images.txt").write_text(images)
    with pytest.raises(FileError, match=rf"images\.txt{message}"):
        read_cameras(tmp_path / "images.txt")


def test_a_line_without_end_is_refused_before_it_is_read(tmp_path):
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 800 600 900 900 400 300\n")
    with (tmp_path / "images.txt").open("wb") as stream:
        stream.truncate(2**24 + 1)
    with pytest.raises(FileError, match=r"images\.txt: line 1 has more than 16777216 bytes"):
        read_cameras(tmp_path)


@pytest.mark.parametrize("name", ["cameras.bin", "images.bin"])
def test_binary_models_cut_short_anywhere_are_refused(tmp_path, name):
    path = binary_model(tmp_path / "model", ["SIMPLE_PINHOLE", "PINHOLE"]) / name
    whole = path.read_bytes()
    for size in range(len(whole)):
        path.write_bytes(whole[:size])
        with pytest.raises(FileError, match=rf"{name}.*(cut short|does not end|cannot stand)"):
            read_cameras(path)
    path.write_bytes(whole + b"\0")
    with pytest.raises(FileError, match=rf"{name} has 1 bytes after its last record"):
        read_cameras(path)


def patched(path, at, form, *values):
    content = bytearray(path.read_bytes())
    struct.pack_into(form, content, at, *values)
    path.write_bytes(content)


@pytest.mark.parametrize(
    ("name", "at", "form", "value", "message"),
    [
        ("cameras.bin", 0, "<Q", 2**63, "9223372036854775808 cameras cannot stand in"),
        ("cameras.bin", 12, "<i", 5, "camera 1 of 5: the camera model OPENCV_FISHEYE is not read"),
        ("cameras.bin", 12, "<i", 17, "the camera model EQUIRECTANGULAR is not read"),
        ("cameras.bin", 12, "<i", -1, "the camera model number -1 is not read"),
        ("cameras.bin", 16, "<Q", 0, "size = "),
        ("cameras.bin", 32, "<d", math.inf, "camera 1 of 5: f = inf is not finite"),
        ("cameras.bin", 56, "<i", 3, "camera 2 of 5: CAMERA_ID 3 stands in the file twice"),
        ("images.bin", 0, "<Q", 2**61, "images cannot stand in"),
        ("images.bin", 12, "<d", 2.0, "image 1 of 5: quaternion has length"),
        ("images.bin", 44, "<d", math.nan, "image 1 of 5: TX = nan is not finite"),
        ("images.bin", 68, "<i", 4, "image 1 of 5: CAMERA_ID 4 does not stand"),
        ("images.bin", 72, "<B", 255, "the NAME of image 1 of 5 is no text"),
        ("images.bin", 72 + len("views/SIMPLE_PINHOLE 0.jpg") + 1, "<Q", 2**62, "cut short: it ends within the 46116"),
    ],
)
def test_damaged_binary_models_are_refused_by_field(tmp_path, name, at, form, value, message):
    folder = binary_model(tmp_path / "model")
    patched(folder / name, at, form, value)
    with pytest.raises(FileError, match=rf"{name}.*{message}"):
        read_cameras(folder)


def test_a_photograph_stands_in_a_binary_model_once(tmp_path):
    (tmp_path / "cameras.bin").write_bytes(struct.pack("<QiiQQ3d", 1, 1, 0, 8, 6, 9, 4, 3))
    image = struct.pack("<i7di", 1, 1, 0, 0, 0, 0, 0, 4, 1) + b"a.png\0" + struct.pack("<Q", 0)
    (tmp_path / "images.bin").write_bytes(struct.pack("<Q", 2) + 2 * image)
    with pytest.raises(FileError, match=r"image 2 of 2: NAME 'a\.png' has two cameras"):
        read_cameras(tmp_path)
