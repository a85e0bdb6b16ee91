"""Facts about `gonio rectify`: a flat sample under a tilted camera, found by a checkerboard or by its corners."""

import dataclasses
import json

import numpy as np
import pytest
from reference.boards import BOARD, CAMERAS, LENS, SIZE, photograph

import gonio as gn
from gonio.cameras import to_opengl
from gonio.cli import main
from gonio.directions import normalise

EYE = gn.look_at((40.0, -60, 115), (0, 0, 0), (0, 1, 0))
CAMERA = dataclasses.replace(LENS, pose=EYE)
LIGHTS = gn.from_spherical(np.radians([20.0, 40, 50]), np.radians([10.0, 130, 250]))  # in the sample's frame


def run(capsys, *arguments):
    """(exit code, stdout, stderr) of the verb."""
    with pytest.raises(SystemExit) as left:
        main(["rectify", *(str(argument) for argument in arguments)])
    said = capsys.readouterr()
    return left.value.code, said.out, said.err


def stripes(x, y):
    return 0.4 + 0.2 * np.sin(2 * np.pi * x / 20) + 0.15 * np.cos(2 * np.pi * y / 15)


def write(path, image, **options):
    gn.write_image(path, np.repeat(image[..., None], 3, axis=2), **options)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A matte sample of stripes under three lights, told in the camera's frame, and six photographs of a board."""
    root, rng = tmp_path_factory.mktemp("rectify"), np.random.default_rng(7)
    for name in ("sample", "boards"):
        (root / name).mkdir()
    sheet = photograph(CAMERA, stripes, fine=2)
    for k, light in enumerate(LIGHTS):
        image = sheet * light[2]
        if k == 0:
            image[120, 160] = 1.0
        write(root / "sample" / f"photo{k}.png", image, encoding="linear", bits=16)
    to_plane = to_opengl(EYE)[:3, :3]
    gn.write_lp(root / "sample" / "dirs.lp", [f"photo{k}.png" for k in range(3)], LIGHTS @ to_plane)
    for k, camera in enumerate([*CAMERAS[:5], CAMERA]):
        image = (photograph(camera) + rng.normal(0, 0.005, SIZE)).clip(0, 1)
        write(root / "boards" / f"{'flat' if k == 5 else f'board{k}'}.png", image, encoding="linear", bits=16)
    return root


@pytest.fixture
def by_board(folders):
    return (
        folders / "sample", "--board", "9x6", "--square", BOARD.square, "--boards", folders / "boards",
        "--flat", "flat", "--width", 60, "--texels", "100x80", "--terms", 4,
    )  # fmt: skip


def test_a_board_brings_the_sample_to_its_plane_with_lights_eye_and_camera(capsys, tmp_path, by_board):
    out, picture = tmp_path / "out", tmp_path / "view.png"
    code, said, err = run(capsys, *by_board, "-o", out, "--picture", picture, "--json")
    assert code == 0, err
    facts = json.loads(said)
    assert (facts["photographs"], facts["columns"], facts["rows"], facts["boards"]) == (3, 100, 80, 6)
    assert facts["corners off, pixels rms"] < 0.15
    capture = gn.read_capture(out)
    x, y, z = np.moveaxis(capture.positions, -1, 0)
    assert capture.photographs.names == ("photo0.png", "photo1.png", "photo2.png") and np.abs(z).max() < 1e-9
    assert (x[0, 0], y[0, 0]) == pytest.approx((-29.7, 23.7)) and (capture.normals == (0, 0, 1)).all()
    for k, light in enumerate(LIGHTS):
        radiance, clipped = capture.photographs.read(k)
        off = (radiance[..., 0] - light[2] * stripes(x, y))[~clipped]
        # A tenth of a pixel, .04 across, at slopes of .09 is .004; bilinear as much.
        assert np.abs(off).max() < 0.02 and np.sqrt(np.mean(off**2)) < 0.005
        # The one pixel that was clipped marks what it gives light to.
        assert clipped.any() == (k == 0) and clipped.sum() < 25
    # Corners good to .1 of 330 turn the frame by less than .1 degrees.
    np.testing.assert_allclose(capture.directions, LIGHTS, atol=3e-3)
    np.testing.assert_allclose(capture.eye, EYE[:3, 3], atol=1.0)
    (camera,) = gn.read_cameras(out / "camera.json").values()
    np.testing.assert_allclose(camera.position, capture.eye, rtol=1e-6)
    assert camera.fx == pytest.approx(330, abs=1.5) and camera.size == SIZE
    to_eye = normalise(EYE[:3, 3] - capture.positions.reshape(-1, 3))
    np.testing.assert_allclose(capture.observe(0).wo, to_eye, atol=0.01)
    # Radiance over irradiance, whatever the light and the eye: the stripes themselves.
    for block in capture.reflectance():
        assert block.value.min() > 0.04 and block.value.max() < 0.76
        assert block.value.mean() == pytest.approx(0.4, rel=0.03)
    assert gn.image_info(picture).columns > 400


def test_lights_of_the_sample_are_not_turned_and_the_grid_may_stand_beside_the_board(capsys, tmp_path, by_board):
    out = tmp_path / "out"
    code, _, err = run(capsys, *by_board, "-o", out, "--in-plane", "--centre", "8,-5", "--thickness", 2, "--json")
    assert code == 0, err
    capture = gn.read_capture(out)
    before = gn.read_lp(by_board[0] / "dirs.lp").directions
    np.testing.assert_allclose(capture.directions, before, atol=1e-6)
    np.testing.assert_allclose(capture.eye, EYE[:3, 3] + (-8, 5, 2), atol=1.0)


def test_four_corners_bring_the_sample_to_a_rectangle(capsys, tmp_path, folders):
    out = tmp_path / "out"
    corners, _ = CAMERA.project(np.array([(-30.0, 24, 0), (30, 24, 0), (30, -24, 0), (-30, -24, 0)]))
    text = ",".join(f"{v:.3f}" for v in corners.ravel())
    code, said, err = run(
        capsys, folders / "sample", "--corners", text, "--width", 60, "--height", 48, "--texels", 100, "-o", out
    )
    assert code == 0 and "lights are kept" in err and "100" in said
    capture = gn.read_capture(out)
    assert capture.photographs.size == (80, 100) and capture.eye is None and not (out / "camera.json").exists()
    x, y, _ = np.moveaxis(capture.positions, -1, 0)
    off = capture.photographs.read(1).radiance[..., 0] - LIGHTS[1, 2] * stripes(x, y)
    # The lens's distortion stays in it: a pixel or so within the corners.
    assert np.sqrt(np.mean(off**2)) < 0.03


def test_radiance_above_one_is_kept_in_floats_and_the_mask_goes_with_it(capsys, tmp_path):
    folder, out = tmp_path / "bright", tmp_path / "out"
    folder.mkdir()
    image = np.linspace(0, 8, 20 * 30).reshape(20, 30)
    write(folder / "a.exr", image)
    write(folder / "b.exr", 1e-4 * image)
    write(folder / "c.exr", 0.1 * image)
    inside = np.ones((20, 30))
    inside[:, :3] = 0
    gn.write_image(folder / "mask.png", inside, "linear")
    square = ("--corners", "0,0,30,0,30,20,0,20", "--width", 30, "--height", 20, "--texels", "30x20")
    code, _, err = run(capsys, folder, *square, "-o", out)
    assert code == 0, err
    capture = gn.read_capture(out)
    assert capture.photographs.names == ("a.exr", "b.exr", "c.png")
    np.testing.assert_allclose(capture.photographs.read(0).radiance[..., 0], image, rtol=1e-5)
    np.testing.assert_allclose(capture.photographs.read(1).radiance[..., 0], 1e-4 * image, rtol=1e-5)
    np.testing.assert_array_equal(capture.mask, inside > 0)


def test_what_cannot_be_done_is_refused_before_anything_is_written(capsys, tmp_path, folders, by_board):
    sample, out = folders / "sample", tmp_path / "out"
    square = ("--corners", "0,0,30,0,30,20,0,20", "--width", 30, "--height", 20)
    for arguments, match in (
        ((sample, "--width", 30), "either --board"),
        ((sample, *square, "--board", "9x6"), "either --board"),
        ((sample, "--board", "9x6", "--width", 30), "--board wants --boards"),
        ((sample, *square[:-2]), "--corners wants --width and --height"),
        ((sample, *square, "--texels", "30x30"), "write --texels 30x20"),
        ((sample, "--corners", "0,0,30,0,30", *square[2:]), "5 numbers; x,y of four corners"),
        ((sample, "--corners", "0,0,0,20,30,20,30,0", *square[2:]), "another order"),
        ((*by_board[:7], "--flat", "none", "--width", 60), "--flat none is neither in"),
        ((*by_board[:7], "--flat", "photo1", "--width", 60), "shows no checkerboard"),
        ((*by_board, "--centre", "900,0"), "does not show 100.0% of the grid"),
        ((*by_board, "--picture", tmp_path / "view.jpg"), "end its name in .png"),
        ((sample, "--board", "8x5", *by_board[3:]), "shows no checkerboard of 8 x 5"),
    ):
        code, _, err = run(capsys, *arguments, "-o", out)
        assert code == 2 and match in err, (arguments, err)
        assert not out.exists()
    out.mkdir()
    (out / "mine.txt").write_text("kept")
    code, _, err = run(capsys, *by_board, "-o", out)
    assert code == 2 and "not empty" in err and [p.name for p in out.iterdir()] == ["mine.txt"]
