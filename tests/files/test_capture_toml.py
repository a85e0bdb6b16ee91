"""The description of a capture: every field as documented, and back."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import gonio as gn
from gonio.capture.exposure import Noise, Response
from gonio.capture.photographs import Flattened, Held
from gonio.errors import FileError
from gonio.files.brackets import BracketFiles
from gonio.files.captures import photograph_files
from gonio.files.photographs import PhotographFiles
from gonio.files.responses import write_response
from gonio.lights.uneven import Uneven

SIZE = (6, 8)
NAMES = ("a.png", "b.png")
LEVELS = {"a.png": 0.25, "b.png": 0.5}
LENS = {"fx": 20.0, "fy": 21.0, "cx": 4.5, "cy": 2.5}


@pytest.fixture
def folder(tmp_path):
    """Two photographs of 16 linear bits, in a folder that has an outside."""
    inside = tmp_path / "inside"
    inside.mkdir()
    for name, level in LEVELS.items():
        photograph(inside / name, level)
    return inside


def photograph(path, level):
    gn.write_image(path, np.full((*SIZE, 3), level), "linear", bits=16)


def power(gamma):
    """A response of codes of 16 bits in 256 levels: 65536 take seconds to write."""
    return dataclasses.replace(Response.power(gamma, 256), step=256)


def described(folder, text="", photographs='["a.png", "b.png"]'):
    (folder / "capture.toml").write_text(f"version = 1\nphotographs = {photographs}\n{text}")
    return gn.read_capture(folder)


def above_pose():
    """Straight above, 9 high, a little aside."""
    return [[1.0, 0, 0, 0.5], [0, -1, 0, 0.25], [0, 0, -1, 9], [0, 0, 0, 1]]


def pinhole(**changes):
    return gn.Pinhole(**({**LENS, "size": SIZE, "pose": np.array(above_pose())} | changes))


def assert_same_light(a, b):
    """To the twelve digits that are written."""
    assert type(a) is type(b)
    for field in dataclasses.fields(a):
        x, y = getattr(a, field.name), getattr(b, field.name)
        if isinstance(x, gn.Directional | gn.Point):
            assert_same_light(x, y)
        elif x is None or y is None:
            assert x is y
        else:
            assert_allclose(*np.broadcast_arrays(x, y), rtol=1e-8, atol=1e-9)  # gray comes back as a colour


def test_photographs_alone_are_a_capture_in_the_frame_of_the_image(folder):
    capture = described(folder)
    assert (capture.layout, capture.findings) == ("capture.toml", ())
    assert capture.lights is None and capture.normals is None and capture.shape is None and capture.eye is None
    assert capture.mask.all()
    # 16 bits round to 1/131070.
    assert_allclose(capture.photographs.read(1).radiance, 0.5, atol=1e-5)
    assert_allclose(capture.positions[0, 0], [-3.5, 2.5, 0], atol=1e-12)


def test_distant_lights_have_their_irradiances_and_otherwise_one(folder):
    lights = "[lights]\ndirections = [[0, 0, 1], [0.6, 0, 0.8]]\n"
    assert_allclose(described(folder, lights).directions, [[0, 0, 1], [0.6, 0, 0.8]])
    assert_allclose(described(folder, lights).lights[1].irradiance, 1)
    some = described(folder, lights + "intensities = [[1, 2, 3], [4, 5, 6]]\n")
    assert_allclose(some.lights[1].irradiance, [4, 5, 6])


def test_near_lights_have_places_an_axis_and_its_exponent(folder):
    lights = "[lights]\npositions = [[0, 0, 9], [1, 2, 8]]\nintensities = [[1, 2, 3], [4, 5, 6]]\n"
    bare = described(folder, lights)
    assert bare.directions is None
    assert_same_light(bare.lights[1], gn.Point([1.0, 2, 8], [4.0, 5, 6]))
    turned = described(folder, lights + "axis = [0, 0.6, -0.8]\nexponent = 2.5\n")
    assert_same_light(turned.lights[0], gn.Point([0.0, 0, 9], [1.0, 2, 3], [0, 0.6, -0.8], 2.5))
    each = described(folder, lights + "axis = [[0, 0.6, -0.8], [0, 0, -1]]\n")
    assert_allclose([light.axis for light in each.lights], [[0, 0.6, -0.8], [0, 0, -1]])
    # A flat lamp, where there is an axis alone; 0 is a half space.
    assert described(folder, lights + "axis = [0, 0, -1]\n").lights[0].exponent == 1
    assert described(folder, lights + "axis = [0, 0, -1]\nexponent = 0\n").lights[0].exponent == 0


def test_a_measured_falloff_goes_with_either_kind_of_light(folder):
    rows = "falloff = [[[0, 0.1, 0, 0, 0, 0]], [[0, 0, 0, 0, 0, 0], [0, 0, 0.2, 0, 0, 0], [0, 0, 0, 0, 0, -0.3]]]\n"
    distant = described(folder, "[lights]\ndirections = [[0, 0, 1], [0, 0, 1]]\n" + rows)
    assert_same_light(distant.lights[0], Uneven(gn.Directional([0.0, 0, 1]), [[0, 0.1, 0, 0, 0, 0]]))
    near = described(folder, "[lights]\npositions = [[0, 0, 9], [0, 0, 9]]\n" + rows)
    assert near.lights[1].falloff.shape == (3, 6)
    assert_allclose(near.lights[1].falloff[[1, 2], [2, 5]], [0.2, -0.3])


def test_a_texel_puts_pixels_into_the_world(folder):
    capture = described(folder, "shape = 'flat'\n[camera]\ntexel = 0.5\n")
    assert_allclose(capture.positions[0, 0], [-1.75, 1.25, 0], atol=1e-12)
    assert_allclose(capture.normals, np.broadcast_to([0.0, 0, 1], (*SIZE, 3)))
    # From elsewhere, with a pose: pixels see the plane below it.
    moved = described(folder, f"[camera]\ntexel = 0.5\nsize = [6, 8]\npose = {above_pose()}\n")
    assert_allclose(moved.positions[0, 0], [-1.25, 1.5, 0], atol=1e-12)


def test_a_pinhole_sees_the_plane_where_its_rays_meet_it(folder):
    lens = f"[camera]\nfx = 20\nfy = 21\ncx = 4.5\ncy = 2.5\nsize = [6, 8]\npose = {above_pose()}\n"
    capture = described(folder, lens)
    # Pixel (row 5, column 7) is seen at (7.5, 5.5): 9 (7.5 - 4.5) / 20 right of the camera, 9 (5.5 - 2.5) / 21 below.
    assert_allclose(capture.positions[5, 7], [0.5 + 27 / 20, 0.25 - 27 / 21, 0], atol=1e-12)
    assert described(folder, lens + "distortion = [0.1, 0, 0, 0, 0]\n").camera.distortion == (0.1, 0, 0, 0, 0)


def test_the_eye_stands_where_it_is_told(folder):
    capture = described(folder, "shape = 'flat'\n[camera]\ntexel = 0.5\neye = [1, 2, 10]\n")
    assert_allclose(capture.eye, [1, 2, 10])
    assert_allclose(capture.observe(0).wo[0], gn.normalise([1 + 1.75, 2 - 1.25, 10]), atol=1e-12)


def test_shapes_are_heights_meshes_and_balls(folder, rng):
    heights = rng.normal(size=SIZE)  # below 0 too
    gn.write_image(folder / "h.exr", heights)
    shape = described(folder, "shape = 'h.exr'\n[camera]\ntexel = 0.5\n").shape
    assert shape.spacing == 0.5
    assert_allclose(shape.heights, heights, rtol=1e-6)  # single precision
    assert described(folder, "shape = 'h.exr'\nspacing = 2\n").shape.spacing == 2
    (folder / "slope.obj").write_text("v -9 -9 -9\nv 9 -9 9\nv 0 9 0\nf 1 2 3\n")
    capture = described(folder, "shape = 'slope.obj'\n")
    inside = capture.mask
    assert inside.sum() > 0
    assert_allclose(capture.positions[inside][:, 2], capture.positions[inside][:, 0], atol=1e-9)  # the slope z = x
    ball = described(folder, "shape = {centre = [1, 0, 0], radius = 2}\n")
    assert_allclose(np.linalg.norm(ball.positions[ball.mask] - [1, 0, 0], axis=1), 2)
    assert_allclose(ball.normals[ball.mask] * 2 + [1, 0, 0], ball.positions[ball.mask], atol=1e-6)


def test_masks_and_normals_are_read_as_from_any_layout(folder):
    mask = np.zeros(SIZE)
    mask[2:, 3:] = 1
    gn.write_image(folder / "where.png", mask, "linear")
    n = gn.normalise([0.3, -0.2, 0.9])
    gn.write_image(folder / "n.png", np.broadcast_to(0.5 * n + 0.5, (*SIZE, 3)), "linear", bits=16)
    capture = described(folder, "mask = 'where.png'\nnormals = 'n.png'\n")
    assert_array_equal(capture.mask, mask > 0)
    assert_allclose(capture.normals[4, 4], n, atol=1e-4)


def test_cameras_of_many_places_are_found_by_photograph_whatever_their_order(folder):
    first, second = pinhole(), pinhole(pose=np.array(above_pose()) + np.outer([1, 0, 0, 0], [0, 0, 0, 1]))
    gn.write_transforms(folder / "t.json", {"images/b.jpg": second, "images/a.jpg": first})
    gn.write_mesh(folder / "m.obj", gn.vase(8))
    capture = described(folder, "cameras = 't.json'\nshape = 'm.obj'\ntexels = [4, 8]\n[lights]\n" + SUNS)
    assert isinstance(capture, gn.Turntable)
    assert capture.photographs.names == NAMES
    assert_allclose(capture.cameras[1].pose, second.pose)
    assert_allclose(capture.cameras[0].pose, first.pose)
    assert capture.texels == (4, 8)
    assert capture.mask.shape == (4, 8)
    assert_allclose(capture.directions[1], [0.6, 0, 0.8])


SUNS = "directions = [[0, 0, 1], [0.6, 0, 0.8]]\n"


def test_photographs_of_one_name_in_two_folders_are_not_mixed_up(folder):
    for side in ("left", "right"):
        (folder / side).mkdir()
        photograph(folder / side / "1.png", 0.5)
    both = '["left/1.png", "right/1.png"]'
    gn.write_transforms(folder / "t.json", {"right/1.png": pinhole(fx=30), "left/1.png": pinhole()})
    assert [camera.fx for camera in described(folder, "cameras = 't.json'\n", both).cameras] == [20, 30]
    gn.write_transforms(folder / "t.json", {"x/right/1.png": pinhole(fx=30), "x/left/1.png": pinhole()})
    with pytest.raises(FileError, match=r"left/1\.png has several cameras in t\.json"):
        described(folder, "cameras = 't.json'\n", both)


def test_brackets_are_radiance_per_second_by_their_exposures(folder):
    capture = described(folder, "exposures = [0.5, 1]\n", '[["a.png", "b.png"]]')
    assert capture.photographs.names == ("a.png",)
    assert_allclose(capture.photographs.read(0).radiance, 0.5, atol=1e-4)
    assert capture.photographs.noise == Noise()
    noisy = described(folder, "exposures = [0.5, 1]\nnoise = {gain = 2e-4, read = 0.5e-3}\n", '[["a.png", "b.png"]]')
    assert noisy.photographs.noise == Noise(2e-4, 0.5e-3)
    silent = described(folder, "exposures = [0.5, 1]\nnoise = {gain = 2e-4}\n", '[["a.png", "b.png"]]')
    assert silent.photographs.noise == Noise(2e-4, 0)


def test_a_response_says_what_the_codes_of_brackets_mean(folder):
    write_response(folder / "camera.toml", power(2.0))
    described(folder, "exposures = [0.25, 1]\nresponse = 'camera.toml'\n", '[["a.png", "b.png"]]')
    capture = gn.read_capture(folder)
    # .25 squared of a quarter second, .5 squared of a second; levels are 1/255 apart.
    assert_allclose(capture.photographs.read(0).radiance, 0.25, atol=0.005)
    # What the caller says goes before it.
    said = gn.read_capture(folder, "linear").photographs
    assert not said.given
    assert photograph_files(folder).names == NAMES


@pytest.mark.parametrize("bracketed", [False, True])
def test_photographs_are_divided_by_the_vignetting(folder, bracketed):
    falloff = np.linspace(0.5, 1, SIZE[1]) * np.ones(SIZE)
    gn.write_image(folder / "v.exr", falloff)
    groups, exposures = ('[["a.png"], ["b.png"]]', "exposures = [1]\n") if bracketed else ('["a.png", "b.png"]', "")
    capture = described(folder, f"{exposures}vignetting = 'v.exr'\n", groups)
    assert_allclose(capture.photographs.read(1).radiance[..., 1], 0.5 / falloff, rtol=1e-4)
    assert_allclose(capture.photographs.pixels(np.array([9])).radiance[0, 0], 0.25 / falloff[1, 1], rtol=1e-4)


@pytest.mark.parametrize(("encoding", "expected"), [("'linear'", 0.5), ("2.0", 0.25), ("'srgb'", 0.21404)])
def test_the_encoding_is_what_is_told(folder, encoding, expected):
    assert_allclose(described(folder, f"encoding = {encoding}\n").photographs.read(1).radiance, expected, atol=1e-5)


UP = np.broadcast_to([0.0, 0, 1], (*SIZE, 3))
DISTANT = gn.distant_lights([[0.0, 0, 1], [0.6, 0, 0.8]], [[1, 2, 3], [4, 5, 6]])
LIGHTS = {
    "unknown": None,
    "distant": DISTANT,
    "of strength 1": gn.distant_lights([[0.0, 0, 1], [0.6, 0, 0.8]]),
    "near": gn.near_lights([[0.0, 1, 9], [1, 2, 8]], [3.0, 4]),
    "near, with an axis": gn.near_lights([[0.0, 1, 9], [1, 2, 8]], axis=[0, 0.6, -0.8], exponent=7.5),
    "near, each with an axis": gn.near_lights([[0.0, 1, 9], [1, 2, 8]], axis=[[0, 0.6, -0.8], [0, 0, -1]], exponent=2),
    "half spaces": gn.near_lights([[0.0, 1, 9], [1, 2, 8]], axis=[0, 0.6, -0.8], exponent=0),
    "uneven": tuple(
        Uneven(light, np.linspace(-1, 1, 6 * n).reshape(n, 6)) for n, light in zip((1, 3), DISTANT, strict=True)
    ),
    "uneven and near": tuple(Uneven(light, np.ones((1, 6)) / 7) for light in gn.near_lights([[0.0, 1, 9], [1, 2, 8]])),
}


@pytest.mark.parametrize("name", LIGHTS)
def test_lights_come_back_as_they_were_written(folder, name):
    lights = LIGHTS[name]
    gn.write_capture(folder, gn.Capture(PhotographFiles(folder, NAMES), lights))
    again = gn.read_capture(folder).lights
    if lights is None:
        assert again is None
    else:
        for a, b in zip(again, lights, strict=True):
            assert_same_light(a, b)


CAMERAS = {
    "usual": None,
    "texel": gn.HeightField(np.zeros(SIZE), 0.25).camera(),
    "orthographic from elsewhere": gn.Orthographic(pixel=0.5, size=SIZE, pose=gn.cameras.look_at((5, 1, 4), (0, 0, 0))),
    "orthographic aside": gn.Orthographic(pixel=1.0, size=SIZE, pose=np.array(above_pose())),
    "pinhole": pinhole(distortion=(0.1, -0.02, 1e-3, 2e-3, 0)),
}


@pytest.mark.parametrize("name", CAMERAS)
@pytest.mark.parametrize("eye", [None, (1.0, 2, 7)])
def test_cameras_and_eyes_come_back_as_they_were_written(folder, name, eye):
    first = gn.Capture(PhotographFiles(folder, NAMES), normals=UP, camera=CAMERAS[name], eye=eye)
    gn.write_capture(folder, first)
    again = gn.read_capture(folder)
    assert type(again.camera) is type(first.camera)
    assert_allclose(again.positions, first.positions, atol=1e-7)
    assert_allclose(again.observe(0).wo, first.observe(0).wo, atol=1e-8)
    assert_array_equal(again.normals, first.normals)


RAISED = gn.HeightField(np.sin(np.arange(48.0)).reshape(SIZE) + 300, 0.5)  # higher than the usual camera stands
VASE = gn.vase(12)
SHAPES = {
    "heights": (gn.HeightField(RAISED.heights - 300, 0.5), None),
    "heights of another spacing": (gn.HeightField(RAISED.heights - 300, 0.7), None),
    "heights far up": (RAISED, None),
    "heights through a lens": (gn.HeightField(RAISED.heights - 300, 0.5), pinhole()),
    "a mesh": (VASE, None),
    "a mesh aside": (gn.Mesh(VASE.vertices + np.array([40.0, -30, 200]), VASE.faces, VASE.uv), None),
    "a ball": (gn.Sphere((0.2, 0.1, -0.4), 1.5), None),
    "a ball through a lens": (gn.Sphere((0.2, 0.1, -0.4), 1.5), pinhole()),
}


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_come_back_where_they_stood(folder, name):
    shape, camera = SHAPES[name]
    if camera is None:
        (x, y, _), (right, top, high) = shape.bounds
        pose = np.diag([1.0, -1, -1, 1])
        pose[:3, 3] = (x + right) / 2, (y + top) / 2, high + 3
        camera = gn.Orthographic(pixel=max(right - x, top - y) / 7, size=SIZE, pose=pose)
    first = gn.Capture(PhotographFiles(folder, NAMES), DISTANT, shape=shape, camera=camera)
    gn.write_capture(folder, first)
    again = gn.read_capture(folder)
    assert_array_equal(again.mask, first.mask)
    # Heights are written in single precision, 3e-5 of 300.
    assert_allclose(again.positions[first.mask], first.positions[first.mask], atol=1e-4)
    assert_allclose(again.normals, first.normals, atol=2e-4)
    assert_allclose(again.sites.frames, first.sites.frames, atol=2e-3)


def test_brackets_come_back_as_they_were_written(folder):
    for response in (None, power(1.8)):
        vignetting = np.linspace(0.5, 1, 48).reshape(*SIZE, 1)
        first = BracketFiles(folder, [NAMES], (0.5, 1), response or "linear", Noise(3e-4, 2e-3), vignetting)
        gn.write_capture(folder, gn.Capture(first))
        again = gn.read_capture(folder).photographs
        assert (again.times, again.noise, again.names) == (first.times, first.noise, first.names)
        assert again.given == (response is not None)
        assert_allclose(again.read(0).radiance, first.read(0).radiance, rtol=1e-6)
        assert_allclose(again.merged(0).variance, first.merged(0).variance, rtol=1e-5)


def test_vignetting_and_encoding_come_back_as_they_were_written(folder):
    vignetting = np.linspace(0.5, 1, 144).reshape(*SIZE, 3)
    for encoding in ("linear", "srgb", 1.8, None):
        first = Flattened(PhotographFiles(folder, NAMES, encoding), vignetting)
        gn.write_capture(folder, gn.Capture(first))
        assert_allclose(gn.read_capture(folder).photographs.read(1).radiance, first.read(1).radiance, rtol=1e-6)


@pytest.mark.parametrize("texels", [None, (12, 24)])
def test_a_turntable_comes_back_as_it_was_written(folder, texels):
    cameras = [gn.Pinhole.look_at((4 * x, 3 * y, 1), (0, 0, 0), 60, SIZE) for x, y in ((1, 0), (0.6, -1))]
    first = gn.Turntable(PhotographFiles(folder, NAMES), cameras, VASE, DISTANT, texels)
    gn.write_capture(folder, first)
    again = gn.read_capture(folder)
    assert again.texels == texels
    for a, b in zip(again.cameras, cameras, strict=True):
        assert_allclose(a.pose, b.pose, atol=1e-12)
    for a, b in zip(again.lights, DISTANT, strict=True):
        assert_same_light(a, b)
    if texels:
        assert_allclose(again.sites.positions, first.sites.positions, atol=1e-7)
        # The vase has smooth frames of its own; what is read has those that its uv give.
        assert_allclose(again.sites.frames[:, 2], first.sites.frames[:, 2], atol=1e-7)
        assert_array_equal(again.observe(1).known, first.observe(1).known)
    else:
        # Sites are the vertices in their order, less those that no face has.
        used = np.unique(first.shape.faces)
        assert_allclose(again.sites.positions, first.sites.positions[used], atol=1e-8)
    bare = dataclasses.replace(first, shape=None, texels=None)
    (folder / "shape.obj").unlink()
    gn.write_capture(folder, bare)
    assert gn.read_capture(folder).shape is None


def test_masks_and_normals_that_no_file_has_are_written(folder, rng):
    mask = np.zeros(SIZE, bool)
    mask[1:4, 2:7] = True
    normals = gn.normalise(rng.normal(size=(*SIZE, 3)) + np.array([0, 0, 2]))
    for known in (None, UP, normals):
        for name in ("mask.png", "normals.png"):
            (folder / name).unlink(missing_ok=True)
        gn.write_capture(folder, gn.Capture(PhotographFiles(folder, NAMES), DISTANT, mask, known))
        again = gn.read_capture(folder)
        assert_array_equal(again.mask, mask)
        assert (again.normals is None) == (known is None)
        if known is not None:
            assert_allclose(again.normals[mask], known[mask], atol=3e-5)  # 16 bits
    # Others that lie there already are left alone.
    gn.write_image(folder / "mask.png", np.ones(SIZE), "linear")
    (folder / "normals.png").unlink()
    gn.write_capture(folder, gn.Capture(PhotographFiles(folder, NAMES), DISTANT, mask))
    assert gn.read_capture(folder).mask.all()


def test_names_with_any_characters_come_back(folder):
    names = ['it\'s "a" \\ b.png', "tab\t.png", "\U000e0001 é.png"]
    for name in names:
        photograph(folder / name, 0.5)
    gn.write_capture(folder, gn.Capture(PhotographFiles(folder, names)))
    assert gn.read_capture(folder).photographs.names == tuple(names)


def test_what_cannot_be_written_is_refused(folder):
    files = PhotographFiles(folder, NAMES)
    sun, lamp = DISTANT[0], gn.Point([0.0, 0, 9])
    turned = gn.Point([0.0, 0, 9], axis=[0.0, 0, -1])
    above = gn.HeightField(np.zeros(SIZE)).camera()
    for capture, message in (
        (gn.Capture(files, (sun, lamp)), "distant and near lights"),
        (gn.Capture(files, (lamp, turned)), "some have no axis"),
        (gn.Capture(files, (dataclasses.replace(turned, exponent=2), turned)), "several exponents"),
        (gn.Capture(files, (sun, Uneven(sun, np.zeros((1, 6))))), "others have none"),
        (gn.Turntable(files, [above, above]), "without perspective"),
        (gn.Capture(files, shape=gn.Plane()), "a Plane is not written"),
        (gn.Capture(Held(np.ones((1, *SIZE, 3)))), "no photograph 0"),
    ):
        with pytest.raises(FileError, match=message):
            gn.write_capture(folder, capture)
        assert not (folder / "capture.toml").exists()


DIRECTIONS = "directions = [[0, 0, 1], [0, 0, 1]]\n"
PLACES = "positions = [[0, 0, 9], [0, 0, 9]]\n"
BRACKETS = "photographs = [['a.png', 'b.png']]\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("mask = 3\n", "mask = 3; the name of a file is wanted"),
        ("shape = 3\n", "shape = 3; 'flat', 'sphere', the name of a file or a ball is wanted"),
        ("shape = {radius = 1}\n", "a ball as shape has a centre and a radius"),
        ("shape = {centre = [0, 0], radius = 1}\n", r"shape\.centre = \[0, 0\]; a list of 3 numbers"),
        ("shape = {centre = [0, 0, 0], radius = 1, colour = 2}\n", r"shape\.colour is not known"),
        ("spacing = 0\n", "spacing = 0; a positive number"),
        ("texels = [4]\n", r"texels = \[4\]; \[rows, columns\]"),
        ("texels = [4, 4]\n", "texels go with cameras"),
        ("encoding = 0\n", "encoding = 0"),
        ("encoding = true\n", "encoding = True"),
        ("response = 'a.png'\n", "response goes with exposures"),
        ("noise = {gain = 1e-4}\n", "noise goes with exposures"),
        ("exposures = ['1/60']\n", "exposures = .*a list of numbers"),
        ("exposures = [1, 2]\n", "brackets have 1 photographs, exposures are 2"),
        (BRACKETS, "there are no exposures"),
        (BRACKETS + "exposures = [1, 2, 3]\n", "brackets have 2 photographs, exposures are 3"),
        (BRACKETS + "exposures = [1, 0]\n", "positive numbers are wanted"),
        (BRACKETS + "exposures = [1, inf]\n", "exposures = .*a list of numbers"),
        (BRACKETS + "exposures = [1, 2]\nnoise = {gain = 0}\n", r"noise\.gain = 0; a positive number"),
        (BRACKETS + "exposures = [1, 2]\nnoise = {read = 0.1}\n", "has a gain"),
        (BRACKETS + "exposures = [1, 2]\nnoise = {gain = 1e-4, read = -1}\n", r"noise\.read = -1; a number >= 0"),
        (BRACKETS + "exposures = [1, 2]\nnoise = {gain = 1e-4, iso = 100}\n", r"noise\.iso is not known"),
        ("photographs = ['a.png', ['a.png', 'b.png']]\n", "are brackets"),
        ("photographs = [[]]\n", r"photographs = \[\[\]\]"),
        ("photographs = 'a.png'\n", "photographs = 'a.png'; a list of names"),
        ("camera = 3\n", "camera = 3; a table"),
        ("[camera]\ntexel = -1\n", r"camera\.texel = -1; a positive number"),
        ("[camera]\ntexel = nan\n", r"camera\.texel = nan"),
        ("[camera]\ntexel = inf\n", r"camera\.texel = inf"),
        (f"[camera]\ntexel = 1{'0' * 400}\n", r"camera\.texel = 1000"),
        ("[camera]\neye = [0, 1]\n", r"camera\.eye = \[0, 1\]; a list of 3 numbers"),
        ("[camera]\nfx = 20\n", "a camera is either texel"),
        ("[camera]\ntexel = 1\nfx = 20\n", "a camera is either texel"),
        ("[camera]\ntexel = 1\nsize = [6, 8]\n", "a camera is either texel"),
        ("[camera]\nlens = 50\n", r"camera\.lens is not known"),
        (
            "[camera]\nfx = 20\nfy = 20\ncx = 4\ncy = 3\nsize = [6, 9]\n" + f"pose = {above_pose()}\n",
            r"the camera has \(6, 9\) pixels, the photographs \(6, 8\)",
        ),
        (
            "[camera]\nfx = 20\nfy = 20\ncx = 4\ncy = 3\nsize = [6, 8]\npose = [[2, 0, 0, 0]]\n",
            r"capture\.toml: .*pose",
        ),
        ("[lights]\n" + DIRECTIONS + PLACES, "directions or positions, not both"),
        ("[lights]\n" + DIRECTIONS + "axis = [0, 0, -1]\n", r"lights\.axis and exponent go with positions"),
        ("[lights]\n" + PLACES + "axis = [0, 0, -2]\n", r"capture\.toml: .*axis.* length 2"),
        ("[lights]\n" + PLACES + "axis = [0, 0]\n", r"lights\.axis = \[0, 0\]"),
        ("[lights]\n" + PLACES + "axis = [[0, 0, -1]]\n", r"lights\.axis has 1 rows for 2 photographs"),
        ("[lights]\n" + PLACES + "axis = []\n", r"lights\.axis = \[\]"),
        ("[lights]\n" + PLACES + "exponent = -1\n", r"lights\.exponent = -1; a number >= 0"),
        ("[lights]\npositions = [[0, 0, 9]]\n", r"lights\.positions has 1 rows for 2 photographs"),
        ("[lights]\npositions = [[0, 0, nan], [0, 0, 9]]\n", r"lights\.positions = "),
        ("[lights]\nintensities = [[1, 1, 1], [1, 1, 1]]\n", "neither directions nor positions"),
        ("[lights]\n" + DIRECTIONS + "intensities = [[1, 1, 1], [1, 0, 1]]\n", "not all positive"),
        ("[lights]\n" + DIRECTIONS + "falloff = [[[0, 0, 0, 0, 0, 0]]]\n", r"lights\.falloff has 1 rows for 2"),
        ("[lights]\n" + DIRECTIONS + "falloff = [[0, 0, 0, 0, 0, 0]]\n", r"lights\.falloff = "),
        ("[lights]\nfalloff = [[[0, 0, 0, 0, 0, 0]], [[0, 0, 0, 0, 0, 0]]]\n", "neither directions nor positions"),
    ],
)
def test_a_wrong_field_is_refused_by_its_name(folder, text, message):
    start = "" if text.startswith("photographs") else "photographs = ['a.png', 'b.png']\n"
    (folder / "capture.toml").write_text(f"version = 1\n{start}{text}")
    with pytest.raises(FileError, match=message) as refused:
        gn.read_capture(folder)
    assert str(folder) in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("field", ["mask", "normals", "shape"])
def test_files_that_are_none_of_their_field_are_refused_by_name(folder, field):
    (folder / "x.png").write_bytes(b"no image")
    with pytest.raises(FileError, match=r"x\.png"):
        described(folder, f"{field} = 'x.png'\n")


@pytest.mark.parametrize("text", ["mask = 'a.png'\n", "normals = 'a.png'\n", "[camera]\ntexel = 2\n"])
def test_what_belongs_to_one_place_does_not_go_with_cameras_of_many(folder, text):
    gn.write_transforms(folder / "t.json", dict.fromkeys(NAMES, pinhole()))
    with pytest.raises(FileError, match="goes with photographs from one place"):
        described(folder, "cameras = 't.json'\n" + text)


def test_the_shape_of_many_places_is_a_mesh_and_every_photograph_has_a_camera(folder):
    gn.write_transforms(folder / "t.json", dict.fromkeys(NAMES, pinhole()))
    for shape in ("'a.png'", "{centre = [0, 0, 0], radius = 1}", "'flat'"):
        with pytest.raises(FileError, match="from many places is a mesh"):
            described(folder, f"cameras = 't.json'\nshape = {shape}\n")
    with pytest.raises(FileError, match="texels want a shape with uv"):
        described(folder, "cameras = 't.json'\ntexels = [4, 4]\n")
    gn.write_transforms(folder / "t.json", {"a.png": pinhole()})
    with pytest.raises(FileError, match=r"b\.png has no camera in t\.json"):
        described(folder, "cameras = 't.json'\n")


FIELDS = {
    "photographs": ("x.png", ""),
    "mask": ("x.png", "mask = {}\n"),
    "normals": ("x.png", "normals = {}\n"),
    "shape, heights": ("x.exr", "shape = {}\n"),
    "shape, mesh": ("x.obj", "shape = {}\n"),
    "cameras": ("x.json", "cameras = {}\n"),
    "response": ("x.toml", "exposures = [1]\nresponse = {}\n"),
    "vignetting": ("x.exr", "vignetting = {}\n"),
}


@pytest.mark.parametrize("way", ["..", "absolute", "link", "folder link"])
@pytest.mark.parametrize("field", FIELDS)
def test_no_field_reaches_outside_the_folder(folder, tmp_path, field, way):
    name, text = FIELDS[field]
    outside = tmp_path / "outside" / name
    outside.parent.mkdir()
    if outside.suffix in (".png", ".exr"):
        gn.write_image(outside, np.full((*SIZE, 3), 0.75))
    elif outside.suffix == ".obj":
        gn.write_mesh(outside, gn.vase(8))
    elif outside.suffix == ".json":
        gn.write_transforms(outside, dict.fromkeys(NAMES, pinhole()))
    else:
        write_response(outside, power(1.0))
    path = {"..": f"../outside/{name}", "absolute": str(outside), "link": name, "folder link": f"sub/{name}"}[way]
    if way == "link":
        (folder / name).symlink_to(outside)
    elif way == "folder link":
        (folder / "sub").symlink_to(outside.parent)
    names = (
        f"['{path}']"
        if field == "photographs"
        else "[['a.png'], ['b.png']]"
        if "exposures" in text
        else str(list(NAMES))
    )
    with pytest.raises(FileError, match=r"does not exist in its folder"):
        described(folder, text.format(f"'{path}'"), names)


def test_of_brackets_with_missing_files_the_whole_ones_are_taken_on_request(folder):
    for name in ("c.png", "d.png"):
        photograph(folder / name, 0.25)
    text = "exposures = [1, 2]\n[lights]\n" + SUNS
    groups = '[["a.png", "gone.png"], ["c.png", "d.png"]]'
    with pytest.raises(FileError, match=r"gone\.png does not exist in its folder\. Pass partial=True .* the 1 that"):
        described(folder, text, groups)
    capture = gn.read_capture(folder, partial=True)
    assert capture.photographs.names == ("c.png",)
    assert_allclose(capture.directions, [[0.6, 0, 0.8]])
    assert capture.findings == ("gone.png does not exist in its folder",)
    assert photograph_files(folder, partial=True).names == ("c.png", "d.png")
    # Where none is whole, partial is no way out, and not named as one.
    with pytest.raises(FileError, match=r"gone\.png does not exist in its folder\.$"):
        described(folder, "exposures = [1, 2]\n", '[["a.png", "gone.png"]]')


def test_a_turntable_without_one_of_its_photographs_is_the_others(folder):
    gn.write_transforms(folder / "t.json", {"a.png": pinhole(), "gone.png": pinhole(fx=30), "b.png": pinhole(fx=40)})
    suns = "[lights]\ndirections = [[0, 0, 1], [0, 0.6, 0.8], [0.6, 0, 0.8]]\n"
    with pytest.raises(FileError, match=r"gone\.png does not exist"):
        described(folder, "cameras = 't.json'\n" + suns, '["a.png", "gone.png", "b.png"]')
    capture = gn.read_capture(folder, partial=True)
    assert [camera.fx for camera in capture.cameras] == [20, 40]
    assert_allclose(capture.directions[1], [0.6, 0, 0.8])
