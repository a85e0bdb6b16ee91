"""`gonio share`: photographs that were left out are predicted; and `gonio render` of what it wrote."""

import dataclasses
import json
import shutil
import signal

import numpy as np
import pytest
from reference.verbs import run

import gonio as gn
from gonio.capture.photographs import Held
from gonio.cli import main
from gonio.cli.share import Places, _coordinates
from gonio.fitting import centres
from gonio.viewer.sharing import sharing_picture

BRDF = ("--brdf", "lambert:albedo=.5/.4/.3", "--brdf", "ggx:alpha=.4,eta=1.5")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A ball of plastic under nine lights, 32 x 32, in codes of 16 bits."""
    path = tmp_path_factory.mktemp("ball") / "ball"
    with pytest.raises(SystemExit):
        main(["simulate", "-o", str(path), *BRDF, "--count", "9", "--size", "32"])
    return path


@pytest.fixture(scope="module")
def thing(folder):
    """What is shared between all pixels of the ball, from eight of the photographs."""
    path = folder.parent / "thing.gonio"
    with pytest.raises(SystemExit):
        main(["share", str(folder), "-o", str(path), "--leave", "4", "--centres", "200", "--scales", ".2,.5"])
    return path


@pytest.mark.parametrize(
    ("how", "most"), [("", 0.01), ("--homogeneous", 0.005), ("--texture", 0.03), ("--paper", 0.015)]
)
def test_photographs_left_out_are_predicted(capsys, tmp_path, folder, how, most):
    output, picture = tmp_path / "thing.gonio", tmp_path / "seen.png"
    arguments = ("--leave", "4,1", "--centres", 300, "--scales", ".2,.5,.01", "--json")
    how = [how] if how else ["--picture", picture]
    code, out, err = run(capsys, "share", folder, "-o", output, *how, *arguments)
    assert code == 0, err
    facts = json.loads(out)
    assert (facts["photographs"], facts["centres"], facts["m_xy, m_w, rho"]) == (7, 300, [0.2, 0.5, 0.01])
    errors = [facts["error of photo4.png"], facts["error of photo1.png"]]
    assert facts["median of them"] == pytest.approx(np.median(errors))
    # 300 centres of a smooth material leave a few thousandths, codes of 16 bits less. A median of seven samples holds
    # more or less of the gloss from pixel to pixel.
    assert max(errors) < most
    assert facts["residual"] < most
    assert not how[1:] or gn.image_info(picture).columns > 600
    # What is written predicts the same.
    capture, read = gn.read_capture(folder), gn.read_relightable(output)
    image, photograph = gn.relight(read, capture.lights[4]), capture.photographs.read(4).radiance
    kept = capture.mask & ~capture.photographs.read(4).clipped
    off = np.sqrt(np.mean((image - photograph)[kept] ** 2) / np.mean(photograph[kept] ** 2))
    assert off == pytest.approx(errors[0], rel=0.01)


def test_body_and_surface_are_fitted_apart(capsys, tmp_path, folder):
    output, arguments = tmp_path / "thing.gonio", ("--leave", "4", "--centres", 60, "--specular-centres", 150, "--json")
    for how in ("colour", "least"):
        code, out, err = run(
            capsys, "share", folder, "-o", output, "--separate", how, "--scales", ".2,.5,.01", *arguments
        )
        assert code == 0, err
        facts = json.loads(out)
        assert (facts["centres of the body"], facts["centres of the surface"]) == (60, 150)
        # Nine lights leave no pixel's gloss dark, and the parts are told poorly; their sum is not.
        assert facts["error of photo4.png"] < 0.03
    assert len(gn.read_relightable(output).material.terms) == 2


def test_photographs_through_polarisers_are_predicted_as_without(capsys, tmp_path, folder):
    for name, sign in (("parallel", 1), ("crossed", -1)):
        shutil.copytree(folder, tmp_path / name)
        for path in (tmp_path / name).glob("photo*.png"):
            image = gn.read_image(path, "linear")
            surface = 0.4 * image.min(axis=2, keepdims=True)  # grey
            gn.write_image(path, (image + sign * surface) / 2, bits=16, encoding="linear")
    picture = tmp_path / "p.png"
    code, out, err = run(
        *(capsys, "share", tmp_path / "parallel", "--crossed", tmp_path / "crossed", "-o", tmp_path / "thing.gonio"),
        *("--leave", "4", "--centres", 100, "--specular-centres", 100, "--scales", ".2,.5", "--picture", picture),
        "--json",
    )
    assert code == 0, err
    assert json.loads(out)["error of photo4.png"] < 0.03
    assert gn.image_info(picture).columns > 600


def test_regions_are_the_colours_of_an_image(capsys, tmp_path, folder):
    labels = np.zeros((32, 32, 3))
    labels[:, 16:] = [0.5, 0, 0]
    gn.write_image(tmp_path / "labels.png", labels)
    output = tmp_path / "thing.gonio"
    arguments = ("-o", output, "--leave", "4", "--centres", 200, "--scales", "1,.5", "--homogeneous", "--json")
    code, out, err = run(capsys, "share", folder, "--regions", tmp_path / "labels.png", *arguments)
    assert code == 0, err
    assert json.loads(out)["error of photo4.png"] < 0.01
    assert len(gn.read_relightable(output).material.terms) == 2
    gn.write_image(tmp_path / "noise.png", np.random.default_rng(0).random((32, 32, 3)))
    gn.write_image(tmp_path / "small.png", labels[:8])
    for name, message in (
        ("noise.png", "64 regions at most"),
        ("small.png", "(8, 32) pixels, the photographs (32, 32)"),
    ):
        code, _, err = run(capsys, "share", folder, "--regions", tmp_path / name, *arguments)
        assert code == 2
        assert message in err


def test_people_read_a_table_and_the_file(capsys, tmp_path, folder):
    output = tmp_path / "thing.gonio"
    code, out, _ = run(capsys, "share", folder, "-o", output, "--homogeneous", "--centres", 40, "--scales", "1,.5")
    lines = out.splitlines()
    assert code == 0
    assert lines[-1] == str(output)
    assert "9" in lines[0] and "photographs" in lines[0]
    assert "error of" not in out


def test_what_was_shared_is_rendered_under_other_light(capsys, tmp_path, thing):
    seen = gn.read_relightable(thing)
    sun, image = gn.Directional(gn.normalise([1.0, 0, 1]), [2.0, 1.0, 0.5]), tmp_path / "image.exr"
    code, out, err = run(capsys, "render", thing, "-o", image, "--sun", "1,0,1:2/1/.5")
    assert (code, out) == (0, f"{image}\n"), err
    np.testing.assert_allclose(gn.read_image(image), gn.relight(seen, sun), rtol=1e-3, atol=1e-6)
    gn.write_image(tmp_path / "sky.exr", np.full((16, 32, 3), 0.5))
    code, _, err = run(capsys, "render", thing, "-o", image, "--light", tmp_path / "sky.exr", "--samples", 64)
    assert code == 0, err
    # Matte .5 .4 .3 under a gloss of 4 %, in a room of .5.
    assert gn.read_image(image).shape == (32, 32, 3)
    np.testing.assert_allclose(gn.read_image(image)[16, 16], 0.5 * np.array([0.54, 0.44, 0.34]), rtol=0.1)
    code, _, _ = run(capsys, "render", thing, "-o", tmp_path / "image.png", "--sun", "0,0,1:3")
    assert code == 0
    assert gn.read_image(tmp_path / "image.png", encoding="srgb").max() > 0.1


def test_what_was_shared_is_seen_from_elsewhere(capsys, tmp_path, folder, thing):
    seen, image = gn.read_relightable(thing), tmp_path / "image.exr"
    look = ("--sun", "0,0,1:3", "--size", "32", "--supersample", "1", "--no-background")
    low, high = seen.surface.bounds
    radius = np.linalg.norm(seen.surface.vertices - (low + high) / 2, axis=1).max()
    # From far above, with the lens that shows what the capture's camera did.
    half = 16 * gn.read_capture(folder).camera.pixel
    lens = ("--eye", "0,0,300", "--fov", 2 * np.degrees(np.arctan(half / (300 * radius))))
    code, _, err = run(capsys, "render", thing, "-o", image, *lens, *look)
    assert code == 0, err
    before, after = gn.relight(seen, gn.Directional([0, 0, 1], 3.0)), gn.read_image(image)
    inner = seen.view.mask & (seen.view.normal[..., 2] > 0.6)
    # 300 radii off, rays at the rim lean by a third of a per cent.
    np.testing.assert_allclose(after[inner], before[inner], rtol=0.02)
    trust = tmp_path / "trust.exr"
    aside = ("--eye", "1,0,3", "--shadows", "--confidence", trust)
    code, _, err = run(capsys, "render", thing, "-o", image, *aside, *look)
    assert code == 0, err
    known = gn.read_image(trust)[..., 0]
    assert 0.5 < np.median(known[known > 0]) <= 1
    code, _, err = run(capsys, "render", thing, "-o", image, "--shadows")
    assert code == 2 and "--shadows wants an --eye" in err


def test_what_photographs_show_beyond_the_model_is_kept(capsys, tmp_path, folder):
    output = tmp_path / "thing.gonio"
    arguments = ("--leave", "4", "--homogeneous", "--centres", "12", "--scales", "1,.5", "--json")
    code, out, err = run(capsys, "share", folder, "-o", output, *arguments, "--residuals")
    assert code == 0, err
    assert json.loads(out)["reach, noise of residuals"] == [1.0, 0.03]
    thing, capture = gn.read_relightable(output), gn.read_capture(folder)
    photograph, clipped = capture.photographs.read(0)
    some = capture.mask & ~clipped
    with_them, without = (
        np.sqrt(np.mean((gn.relight(each, capture.lights[0]) - photograph)[some] ** 2))
        for each in (thing, dataclasses.replace(thing, residuals=None))
    )
    # Of eight lights far apart a twentieth of their own goes to the noise.
    assert with_them < 0.1 * without
    code, out, _ = run(capsys, "info", output, "--json")
    assert json.loads(out)["residuals"] == "of 8 photographs"
    near = tmp_path / "near"
    code, _, err = run(capsys, "simulate", "-o", near, "--near", "3", "--count", "3", "--size", "16")
    assert code == 0, err
    code, _, err = run(capsys, "share", near, "-o", output, "--residuals")
    assert code == 2 and "near lights" in err


def test_ctrl_c_keeps_the_centres_there_are_and_the_fit_goes_on(capsys, tmp_path, folder, thing, monkeypatch, request):
    part, whole = tmp_path / "part.gonio", tmp_path / "whole.gonio"
    told = []

    def press(self, indices):
        if len(self.chosen) > 60 and not told:
            told.append(len(self.chosen))
            signal.raise_signal(signal.SIGINT)
        return take(self, indices)

    outer = signal.signal(signal.SIGINT, signal.default_int_handler)  # in the background it may be ignored
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, outer))
    take = centres._Rounds._take
    monkeypatch.setattr(centres._Rounds, "_take", press)
    arguments = ("--leave", "4", "--centres", "200", "--json")
    code, out, err = run(capsys, "share", folder, "-o", part, "--scales", ".2,.5", *arguments)
    facts = json.loads(out)
    assert code == 130
    assert f"go on with --resume {part}" in err and "gonio: stopped" in err
    assert 60 < facts["centres"] < 100 and "it was stopped with" in facts["ended"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    code, out, err = run(capsys, "share", folder, "-o", whole, "--resume", part, *arguments)
    assert code == 0, err
    ended, light = json.loads(out), gn.Directional(gn.normalise([0.4, 0.2, 1.0]))
    assert (ended["centres"], ended["m_xy, m_w, rho"]) == (200, [0.2, 0.5, 0.0])
    image, expected = (gn.relight(gn.read_relightable(path), light) for path in (whole, thing))
    np.testing.assert_allclose(image, expected, rtol=1e-3, atol=1e-5)


def test_what_was_precomputed_is_rendered_and_told(capsys, tmp_path, thing):
    fast, image = tmp_path / "fast.gonio", tmp_path / "image.exr"
    code, _, err = run(capsys, "precompute", thing, "-o", fast, "--side", "4", "--samples", "1", "--error", ".05")
    assert code == 0, err
    code, out, err = run(capsys, "render", fast, "-o", image, "--sun", "0,.3,1")
    assert (code, out) == (0, f"{image}\n"), err
    expected = gn.read_precomputed(fast).relight(gn.Directional(gn.normalise([0, 0.3, 1.0])))
    np.testing.assert_allclose(gn.read_image(image), expected, rtol=1e-3, atol=1e-6)
    code, out, _ = run(capsys, "info", fast, "--json")
    assert json.loads(out)["kind"] == "precomputed view" and json.loads(out)["cells of light"] == 96
    code, _, err = run(capsys, "render", fast, "-o", image, "--eye", "0,0,4")
    assert code == 2 and "images of one view" in err


def test_places_along_the_surface_are_nearer_to_its_distances(capsys, tmp_path, folder):
    off = {}
    for places in ("image", "geodesic"):
        arguments = ("--places", places, "--leave", 4, "--centres", 100, "--scales", ".2,.5,.01", "--json")
        code, out, err = run(capsys, "share", folder, "-o", tmp_path / "thing.gonio", *arguments)
        assert code == 0, err
        facts = json.loads(out)
        off[places] = facts["distortion of places"]
        assert facts["error of photo4.png"] < 0.02
    # An image of a hemisphere shortens its rim to nothing.
    assert off["geodesic"] < 0.7 * off["image"]


def test_how_far_to_trust_what_is_rendered_is_drawn(capsys, tmp_path, thing):
    image, trust = tmp_path / "image.exr", tmp_path / "trust.exr"
    found = []
    # Lights of the capture reach down to some 60 degrees.
    for sun in ("0,.3,1:3", "1,0,-.9:3"):
        code, out, err = run(capsys, "render", thing, "-o", image, "--sun", sun, "--confidence", trust)
        assert (code, out) == (0, f"{image}\n{trust}\n"), err
        found.append(gn.read_image(trust)[..., 0])
    mask = gn.read_relightable(thing).view.mask
    assert np.all(found[0][~mask] == 0) and found[0].max() <= 1 and found[0].min() >= 0
    lit = gn.read_image(image).max(axis=2) > 0
    assert np.median(found[0][mask]) > 0.95
    assert np.median(found[1][mask & lit]) < 0.5
    code, _, err = run(capsys, "render", "-o", image, "--confidence", trust)
    assert code == 2
    assert "goes with a .gonio" in err


def test_lobes_of_chosen_pixels_are_drawn(capsys, tmp_path, thing):
    picture = tmp_path / "lobes.png"
    code, out, err = run(capsys, "info", thing, "--picture", picture, "--json")
    assert code == 0, err
    facts = json.loads(out)
    assert facts["kind"] == "shared material"
    assert facts["term 0"] == "200 centres in 5 dimensions, 3 channels, of log f"
    automatic = picture.read_bytes()
    assert gn.image_info(picture).columns > 900
    code, _, err = run(capsys, "info", thing, "--picture", picture, "--pixels", "16,16;12,20")
    assert code == 0, err
    assert picture.read_bytes() != automatic
    for pixels, message in (
        ("99,1", "row,column within (32, 32)"),
        ("1", "row,column"),
        ("0,0", "nothing was seen there"),
        (";".join(["16,16"] * 7), "six at most"),
    ):
        code, _, err = run(capsys, "info", thing, "--picture", picture, "--pixels", pixels)
        assert code == 2
        assert message in err


def test_a_capture_without_normals_goes_through_photometric_stereo(capsys, tmp_path, folder):
    bare = tmp_path / "bare"
    shutil.copytree(folder, bare, ignore=shutil.ignore_patterns("normals.png", "truth", "*.toml"))
    output = tmp_path / "thing.gonio"
    arguments = ("--homogeneous", "--leave", 4, "--centres", 100, "--scales", "1,.5", "--json")
    code, out, err = run(capsys, "share", bare, "-o", output, *arguments, "--encoding", "linear")
    assert code == 0, err
    assert "normals by photometric stereo" in err
    # Highlights turn the normals that a matte model finds by some degrees.
    assert json.loads(out)["error of photo4.png"] < 0.2
    view = gn.read_relightable(output).view
    truth = gn.read_capture(folder)
    both = view.mask & truth.mask
    off = np.degrees(np.arccos(np.sum(view.normal[both] * truth.normals[both], axis=1).clip(-1, 1)))
    assert np.median(off) < 5


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--leave", "9"), "no photograph 9; there are 0 to 8"),
        (("--leave", "0,-1"), "no photograph -1"),
        (("--leave", "0.5"), "no photograph 0.5"),
        (("--leave", "nan"), "no photograph nan"),
        (("--leave", "a"), "'a' is not numbers"),
        (("--leave", "0,1,2,3,4,5,6,7,8"), "all photographs are left out"),
        (("--scales", "1"), "m_xy,m_w or m_xy,m_w,rho"),
        (("--scales", "1,2,3,4"), "m_xy,m_w or m_xy,m_w,rho"),
        (("--scales", "1,0"), "positive"),
        (("--scales", "1,x"), "'1,x' is not numbers"),
        (("--least", "2"), "least = 2"),
        (("--separate", "size"), "colour or least is wanted"),
        (("--separate", "colour", "--homogeneous"), "leave --separate and --crossed out"),
        (("--separate", "colour", "--crossed", "x"), "give one of them"),
        (("--crossed", "none"), "none"),
        (("--separate", "colour", "--resume", "x.gonio"), "leave --separate and --crossed out"),
        (("--resume", "none.gonio"), "none.gonio does not exist"),
        (("--resume", "none.gonio", "--scales", "1,1"), "leave --scales out"),
        (("--centres", "4"), "centres"),
        (("--picture", "seen.jpg"), "end its name in .png"),
        (("--output", "thing.exr"), "end its name in .gonio"),
    ],
)
def test_bad_use_is_one_line_and_leaves_no_file(capsys, tmp_path, folder, arguments, message):
    output = tmp_path / "thing.gonio"
    code, out, err = run(capsys, "share", folder, "-o", output, *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert not output.exists()


def test_a_file_that_holds_no_thing_is_refused(capsys, tmp_path):
    for name, data in (("none.gonio", None), ("no.gonio", b"not a ZIP")):
        if data:
            (tmp_path / name).write_bytes(data)
        code, _, err = run(capsys, "render", tmp_path / name, "-o", tmp_path / "a.exr")
        assert code == 2
        assert name in err and len(err.strip().splitlines()) == 1


def test_lights_can_be_given_beside_and_are_wanted(capsys, tmp_path, folder):
    (tmp_path / "few.lp").write_text("1\na.png 0 0 1\n")
    code, _, err = run(capsys, "share", folder, "-o", tmp_path / "a.gonio", "--lights", tmp_path / "few.lp")
    assert code == 2
    assert "1 lights for 9 photographs" in err
    dark = tmp_path / "dark"
    dark.mkdir()
    for k in range(2):
        shutil.copy(folder / f"photo{k}.png", dark)
    code, _, err = run(capsys, "share", dark, "-o", tmp_path / "a.gonio", "--encoding", "linear")
    assert code == 2
    assert "lights" in err.splitlines()[-1]


def test_places_lie_in_the_image_whichever_way_the_camera_looks():
    # A wall that stands up, whose places in the world share one y.
    x, z = np.array([[-1.0, 1, 1, -1], [0, 0, 1, 1]])
    wall = gn.Mesh(np.stack((x, 0 * x, z), axis=1), np.array([[0, 1, 2], [0, 2, 3]]))
    camera = gn.Pinhole.look_at((0, -4, 0.5), (0, 0, 0.5), 40, (12, 16))
    capture = gn.Capture(Held(np.ones((1, 12, 16, 3))), shape=wall, camera=camera)
    (places, off), (row, column) = _coordinates(capture, capture.positions, Places.IMAGE), np.nonzero(capture.mask)
    assert off < 1e-6  # a wall seen from straight before it
    assert places.min(axis=0).tolist() == [0, 0] and places.max() == 1
    # x to the right and y down, by one step a pixel.
    step = 1 / np.ptp(column)
    np.testing.assert_allclose(places, step * np.stack((column - column.min(), row - row.min()), axis=1), atol=1e-9)


def test_a_picture_is_made_of_black_photographs_too(tmp_path):
    black, gray = np.zeros((8, 6, 3), np.float32), np.full((8, 6, 3), 0.2, np.float32)
    sharing_picture(tmp_path / "a.png", ["a"], [(black, gray, 1.0)], ())
    assert gn.image_info(tmp_path / "a.png").columns > 600
