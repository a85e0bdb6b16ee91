"""Cameras of COLMAP's models, text and binary."""

import math
import struct

import pytest
from numpy.testing import assert_allclose, assert_array_equal
from reference.poses import EXACT, MODELS, POINTS, binary_model, by_colmap, text_model, world_to_camera

from gonio.errors import FileError
from gonio.files.camera_poses import read_cameras


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
