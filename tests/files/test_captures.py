"""Folders of photographs as captures."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import gonio as gn
from gonio.errors import EncodingWarning
from gonio.files.photographs import PhotographFiles

VECTORS = ((0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.0, -0.6, 0.8))


def photograph(path, value=0.5, size=(6, 8), bits=8):
    path.parent.mkdir(parents=True, exist_ok=True)
    gn.write_image(path, np.full((*size, 3), value), "linear" if bits == 16 else "srgb", bits=bits)


@pytest.fixture
def rti(tmp_path):
    """A folder of three photographs and their lights."""
    for k in range(3):
        photograph(tmp_path / f"image {k}.png", 0.1 * (k + 1))
    gn.write_lp(tmp_path / "dirs.lp", [f"image {k}.png" for k in range(3)], np.array(VECTORS))
    return tmp_path


def test_an_rti_folder_opens_with_its_lights_and_radiance(rti):
    capture = gn.read_capture(rti)
    assert capture.layout == "RTI"
    assert capture.findings == ()
    assert capture.photographs.names == ("image 0.png", "image 1.png", "image 2.png")
    assert capture.photographs.size == (6, 8)
    assert_allclose(capture.directions, VECTORS)
    # 8 bits of sRGB round to half a code, 1/510, where the curve's slope is below .8.
    for k in range(3):
        photo = capture.photographs.read(k)
        assert_allclose(photo.radiance, 0.1 * (k + 1), atol=0.003)
        assert not photo.clipped.any()
    assert_allclose(capture.mean(), 0.2, atol=0.003)


def test_codes_at_the_end_are_marked_as_clipped(tmp_path):
    image = np.full((4, 4, 3), 0.5)
    image[1, 2, 0] = 1.0
    gn.write_image(tmp_path / "a.png", image)
    photo = gn.read_capture(tmp_path).photographs.read(0)
    assert photo.clipped[1, 2]
    assert photo.clipped.sum() == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("three\n", "line 1 is 'three'"),
        ("1\na.png 0 1\n", "line 2 is 'a.png 0 1'; expected a name and x y z"),
        ("1\na.png 0 0 one\n", "line 2 ends in '0 0 one', no three numbers"),
        ("1\na.png 0,1 0,2 0,9\n", "Write decimals with a point"),
        ("1\na.png 0 0 0\n", "points nowhere"),
        ("1\na.png nan 0 1\n", "points nowhere"),
        ("1\n\n", "names no photograph"),
    ],
)
def test_lists_of_lights_that_say_nothing_sound_are_refused_by_line(tmp_path, text, message):
    (tmp_path / "dirs.lp").write_text(text)
    with pytest.raises(gn.GonioError, match=message):
        gn.read_lp(tmp_path / "dirs.lp")


def test_lists_of_lights_come_back_as_written(tmp_path):
    names = ["a b.png", "sub/c.png"]
    gn.write_lp(tmp_path / "x.lp", names, np.array(VECTORS[1:]))
    lights = gn.read_lp(tmp_path / "x.lp")
    assert lights.names == tuple(names)
    assert lights.stated == 2
    assert_allclose(lights.directions, VECTORS[1:], atol=1e-9)


def test_missing_photographs_and_wrong_counts_are_refused_and_the_sound_rest_is_taken_on_request(rti):
    (rti / "image 1.png").unlink()
    (rti / "dirs.lp").write_text((rti / "dirs.lp").read_text().replace("3\n", "7\n", 1))
    with pytest.raises(gn.GonioError, match=r"image 1.png of dirs.lp does not exist; line 1 .* 7 lights, 3 follow"):
        gn.read_capture(rti)
    capture = gn.read_capture(rti, partial=True)
    assert capture.photographs.names == ("image 0.png", "image 2.png")
    assert_allclose(capture.directions, [VECTORS[0], VECTORS[2]])
    assert len(capture.findings) == 2


def test_lengths_are_normalised_and_said(rti):
    (rti / "dirs.lp").write_text("3\n" + "".join(f"image {k}.png 0 {k} 2\n" for k in range(3)))
    capture = gn.read_capture(rti)
    assert_allclose(np.linalg.norm(capture.directions, axis=1), 1)
    assert "lengths 2 to 2.83: normalised" in capture.findings[0]


def test_photographs_are_found_by_name_whatever_the_folder_and_case(rti):
    (rti / "dirs.lp").write_text(
        "3\nC:\\Users\\me\\IMAGE 0.PNG 0 0 1\n/home/me/image 1.png 0.6 0 0.8\nimage 2 0 -0.6 0.8\n"
    )
    assert gn.read_capture(rti).photographs.names == ("image 0.png", "image 1.png", "image 2.png")
    # Other names altogether, as many as there are images: their order.
    (rti / "dirs.lp").write_text("3\nx1.nef 0 0 1\nx2.nef 0.6 0 0.8\nx3.nef 0 -0.6 0.8\n")
    capture = gn.read_capture(rti)
    assert capture.photographs.names == ("image 0.png", "image 1.png", "image 2.png")
    assert "in the order of the images" in capture.findings[0]


def test_lists_do_not_reach_outside_their_folder(tmp_path):
    photograph(tmp_path / "secret.png")
    photograph(tmp_path / "inside" / "a.png")
    (tmp_path / "inside" / "dirs.lp").write_text("2\na.png 0 0 1\n../secret.png 0.6 0 0.8\n")
    with pytest.raises(gn.GonioError, match=r"\.\./secret\.png of dirs\.lp does not exist"):
        gn.read_capture(tmp_path / "inside")
    (tmp_path / "inside" / "capture.toml").write_text('version = 1\nphotographs = ["a.png"]\nmask = "../secret.png"\n')
    with pytest.raises(gn.GonioError, match=r"mask = .* does not exist in its folder"):
        gn.read_capture(tmp_path / "inside")


def test_photographs_of_two_sizes_are_refused_by_name(rti):
    photograph(rti / "image 2.png", size=(5, 8))
    with pytest.raises(gn.GonioError, match=r"image 2.png has 5 x 8 pixels, image 0.png has 6 x 8"):
        gn.read_capture(rti)


def test_masks_and_normals_beside_photographs_count(rti):
    mask = np.zeros((6, 8, 3))
    mask[2:, 3:] = 1
    gn.write_image(rti / "mask.png", mask, "linear")
    capture = gn.read_capture(rti)
    assert_array_equal(capture.mask, mask[..., 0] > 0)
    n = gn.normalise([0.3, -0.2, 0.9])
    normals = np.broadcast_to(0.5 * n + 0.5, (6, 8, 3)).copy()
    normals[5, 7] = 0.5  # no vector
    gn.write_image(rti / "normals.png", normals, "linear", bits=16)
    capture = gn.read_capture(rti)
    assert_allclose(capture.normals[3, 4], n, atol=1e-4)
    assert not capture.mask[5, 7]
    assert "1 pixels of the mask have no normal" in capture.findings[0]


def test_a_diligent_folder_opens(tmp_path):
    for k in range(3):
        photograph(tmp_path / f"{k + 1:03}.png", 0.25 * (k + 1), bits=16)
    (tmp_path / "filenames.txt").write_text("001.png\n002.png\n003.png\n")
    (tmp_path / "light_directions.txt").write_text("".join(f"{x} {y} {z}\n" for x, y, z in VECTORS))
    (tmp_path / "light_intensities.txt").write_text("1 2 3\n2 2 2\n1 1 1\n")
    capture = gn.read_capture(tmp_path)
    assert capture.layout == "DiLiGenT"
    assert_allclose(capture.lights[0].irradiance, [1, 2, 3])
    # 16 bits, linear: to half a code.
    assert_allclose(capture.photographs.read(1).radiance, 0.5, atol=1e-5)
    (tmp_path / "light_intensities.txt").write_text("1 2 3\n2 2 2\n")
    with pytest.raises(gn.GonioError, match="3 light directions and 2 intensities"):
        gn.read_capture(tmp_path)
    (tmp_path / "light_intensities.txt").write_text("1 2 3\n2 2 2\n1 1 0\n")
    with pytest.raises(gn.GonioError, match="an intensity is not positive"):
        gn.read_capture(tmp_path)


def test_numbered_photographs_take_their_mask_and_the_lights_one_folder_up(tmp_path):
    folder = tmp_path / "cat"
    for k in (0, 2, 10):
        photograph(folder / f"cat.{k}.png", 0.1 + 0.01 * k)
    mask = np.zeros((6, 8, 3))
    mask[1:3, 2:5] = 1
    gn.write_image(folder / "cat.mask.png", mask)
    (tmp_path / "lights.txt").write_text("3\n" + "".join(f"{x} {y} {z}\n" for x, y, z in VECTORS))
    capture = gn.read_capture(folder)
    assert capture.photographs.names == ("cat.0.png", "cat.2.png", "cat.10.png")
    assert capture.mask.sum() == 6
    assert_allclose(capture.directions, VECTORS)
    (tmp_path / "lights.txt").unlink()
    assert gn.read_capture(folder).directions is None


def test_a_capture_is_written_and_read_back(rti):
    first = gn.read_capture(rti)
    path = gn.write_capture(rti, first)
    again = gn.read_capture(path)
    assert again.layout == "capture.toml"
    assert again.photographs.names == first.photographs.names
    assert_allclose(again.directions, first.directions, atol=1e-9)
    assert gn.read_capture(rti).layout == "capture.toml"  # it leads where there is one


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("version = 1\n[", "is no TOML"),
        ('photographs = ["image 0.png"]\n', "no version"),
        ("version = 2\n", "version = 2; 1 is wanted"),
        ("version = 1\n", "has no photographs"),
        ("version = 1\nphotographs = []\n", r"photographs = \[\]"),
        ('version = 1\nphotographs = ["image 0.png"]\nencoding = "raw"\n', "encoding = 'raw'"),
        ('version = 1\nphotographs = ["image 0.png"]\nflash = true\n', "the field flash is not known"),
        ('version = 1\nphotographs = ["image 0.png"]\n[lights]\ndirections = [[0, 0]]\n', "directions = "),
        ('version = 1\nphotographs = ["image 0.png"]\n[lights]\ndirections = []\n', "has 0 rows for 1 photographs"),
        ('version = 1\nphotographs = ["image 0.png"]\n[lights]\ndirections = [[0, 0, 2]]\n', "length 2"),
        ('version = 1\nphotographs = ["image 0.png"]\n[lights]\nflash = 1\n', "lights.flash is not known"),
        ('version = 1\nphotographs = ["absent.png"]\n', "absent.png does not exist"),
    ],
)
def test_descriptions_that_are_wrong_are_refused_by_field(rti, text, message):
    (rti / "capture.toml").write_text(text)
    with pytest.raises(gn.GonioError, match=message):
        gn.read_capture(rti)


def test_folders_without_photographs_are_refused(tmp_path):
    with pytest.raises(gn.GonioError, match="holds no photographs"):
        gn.read_capture(tmp_path)
    with pytest.raises(gn.GonioError, match="neither a folder"):
        gn.read_capture(tmp_path / "absent")
    (tmp_path / "a.lp").write_text("1\n")
    (tmp_path / "b.lp").write_text("1\n")
    with pytest.raises(gn.GonioError, match="several lists of lights"):
        gn.read_capture(tmp_path)


def test_photographs_that_do_not_state_their_curve_are_taken_for_srgb_with_a_warning(data):
    with pytest.warns(EncodingWarning, match="taken for sRGB"):
        gn.read_capture(data / "rti/real/item7")


def test_every_capture_among_the_data_opens_and_the_broken_one_says_how_it_is_broken(data):
    folders = [path.parent for path in sorted((data / "rti").rglob("*.lp"))]
    folders += [path for path in sorted((data / "photometric").rglob("*")) if path.is_dir() and any(path.glob("*.0*"))]
    folders += [path for path in sorted((data / "photometric" / "xiong").rglob("*")) if any(path.glob("Image.01*"))]
    assert len(folders) >= 22
    for folder in folders:
        if folder.name == "item12":
            with pytest.raises(gn.GonioError, match=r"image47.jpg of dirs.lp does not exist; line 1 .* 48 follow"):
                gn.read_capture(folder, "srgb")
            assert len(gn.read_capture(folder, "srgb", partial=True).photographs) == 47
        else:
            assert len(gn.read_capture(folder, "srgb").photographs) >= 12


@pytest.mark.parametrize(("name", "bits", "channels"), [("a.png", 8, 1), ("a.png", 16, 3), ("a.tif", 32, 3)])
def test_pixels_are_picked_as_whole_photographs_have_them(tmp_path, rng, name, bits, channels):
    gn.write_image(tmp_path / name, rng.random((6, 8, channels)), "linear", bits=bits)
    photographs = PhotographFiles(tmp_path, [name])
    at = np.array([3, 47, 0, 3])
    whole, picked = photographs.read(0), photographs.pick(0, at)
    assert_array_equal(picked.radiance, whole.radiance.reshape(-1, 3)[at])
    assert_array_equal(picked.clipped, whole.clipped.reshape(-1)[at])
