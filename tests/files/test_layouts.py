"""Folders as other programs leave them, found by what lies there."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import gonio as gn
from gonio.cameras import to_colmap
from gonio.errors import FileError

SIZE = (6, 8)
VASE = gn.vase(8)
VECTORS = ((0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.0, -0.6, 0.8))


def photograph(path, level=0.5, size=SIZE):
    path.parent.mkdir(parents=True, exist_ok=True)
    gn.write_image(path, np.full((*size, 3), level), "linear", bits=16)


def ring(count=3):
    """Cameras that go round."""
    eyes = [(4 * np.cos(turn), 4 * np.sin(turn), 1.0) for turn in 2 * np.pi * np.arange(count) / count]
    return [gn.Pinhole.look_at(eye, (0, 0, 0), 40, SIZE) for eye in eyes]


def numbered(folder, count=3):
    """Photographs of level 0.1, 0.2, ... in images/, as COLMAP and nerfstudio want them."""
    for k in range(count):
        photograph(folder / "images" / f"{k}.png", 0.1 * (k + 1))
    return folder


def colmap(folder, names, cameras):
    """The text model of pinhole cameras."""
    folder.mkdir(parents=True)
    lines = [f"{k + 1} PINHOLE {c.size[1]} {c.size[0]} {c.fx} {c.fy} {c.cx} {c.cy}" for k, c in enumerate(cameras)]
    (folder / "cameras.txt").write_text("\n".join(lines) + "\n")
    lines = []
    for k, (name, camera) in enumerate(zip(names, cameras, strict=True)):
        quaternion, translation = to_colmap(camera.pose)
        lines += [f"{k + 1} {' '.join(f'{x:.17g}' for x in (*quaternion, *translation))} {k + 1} {name}", ""]
    (folder / "images.txt").write_text("\n".join(lines) + "\n")
    (folder / "points3D.txt").write_text("")


def assert_rounds(capture, cameras):
    """Photograph k, of level (k + 1) / 10, goes with camera k."""
    for k, (camera, expected) in enumerate(zip(capture.cameras, cameras, strict=True)):
        assert_allclose(camera.pose, expected.pose, atol=1e-9)
        assert_allclose(capture.photographs.read(k).radiance, 0.1 * (k + 1), atol=1e-5)


@pytest.mark.parametrize("form", ["images/{}.png", "./images/{}.png", "./images/{}", "{}.png"])
def test_cameras_beside_photographs_and_a_mesh_are_a_turntable(tmp_path, form):
    numbered(tmp_path)
    gn.write_transforms(tmp_path / "transforms.json", {form.format(k): c for k, c in enumerate(ring())})
    gn.write_mesh(tmp_path / "scan.obj", VASE)
    for path in (tmp_path, tmp_path / "transforms.json"):
        capture = gn.read_capture(path)
        assert isinstance(capture, gn.Turntable)
        assert (capture.layout, capture.findings, capture.lights) == ("turntable", (), None)
        assert_rounds(capture, ring())
        assert len(capture.shape.faces) == len(VASE.faces)


def test_names_without_suffix_and_photographs_in_the_folder_itself_are_found(tmp_path):
    for k in range(3):
        photograph(tmp_path / "train" / f"r_{k}.png", 0.1 * (k + 1))
        photograph(tmp_path / f"s_{k}.png", 0.1 * (k + 1))
    gn.write_transforms(tmp_path / "transforms_train.json", {f"./train/r_{k}": c for k, c in enumerate(ring())})
    assert_rounds(gn.read_capture(tmp_path / "transforms_train.json"), ring())
    gn.write_transforms(tmp_path / "transforms.json", {f"s_{k}": c for k, c in enumerate(ring())})
    assert_rounds(gn.read_capture(tmp_path), ring())


@pytest.mark.parametrize("place", [".", "sparse", "sparse/0", "colmap/sparse/0"])
def test_a_model_of_colmap_is_a_turntable_too(tmp_path, place):
    numbered(tmp_path)
    colmap(tmp_path / "model", [f"{k}.png" for k in range(3)], ring())
    (tmp_path / place).mkdir(parents=True, exist_ok=True)
    for entry in (tmp_path / "model").iterdir():
        entry.rename(tmp_path / place / entry.name)
    capture = gn.read_capture(tmp_path)
    assert isinstance(capture, gn.Turntable)
    assert capture.shape is None
    assert_rounds(capture, ring())


def test_photographs_missing_from_a_turntable_are_refused_and_the_rest_is_taken_on_request(tmp_path):
    numbered(tmp_path)
    gn.write_transforms(tmp_path / "transforms.json", {f"images/{k}.png": c for k, c in enumerate(ring())})
    (tmp_path / "images" / "2.png").unlink()
    with pytest.raises(FileError, match=r"images/2\.png of transforms\.json does not exist\. Pass partial=True"):
        gn.read_capture(tmp_path)
    capture = gn.read_capture(tmp_path, partial=True)
    assert_rounds(capture, ring()[:2])
    assert capture.findings == ("images/2.png of transforms.json does not exist",)


def test_photographs_missing_from_a_model_of_colmap_are_told_of_it(tmp_path):
    numbered(tmp_path, 2)
    colmap(tmp_path / "sparse" / "0", ["0.png", "1.png", "2.png"], ring())
    with pytest.raises(FileError, match=r"2\.png of COLMAP's model does not exist\. Pass partial=True"):
        gn.read_capture(tmp_path)
    assert_rounds(gn.read_capture(tmp_path, partial=True), ring()[:2])


def test_of_several_meshes_none_is_guessed(tmp_path):
    numbered(tmp_path)
    gn.write_transforms(tmp_path / "transforms.json", {f"images/{k}.png": c for k, c in enumerate(ring())})
    for name in ("a.obj", "b.obj"):
        gn.write_mesh(tmp_path / name, VASE)
    capture = gn.read_capture(tmp_path)
    assert capture.shape is None
    assert len(capture.findings) == 1
    assert capture.findings[0].startswith("2 meshes (a.obj, b.obj) lie in")


def test_sizes_that_do_not_fit_the_cameras_are_refused(tmp_path):
    for k in range(3):
        photograph(tmp_path / f"{k}.png", size=(6, 9))
    gn.write_transforms(tmp_path / "transforms.json", {f"{k}.png": c for k, c in enumerate(ring())})
    with pytest.raises(FileError, match=r"cameras\[0\] has \(6, 8\) pixels, the photographs \(6, 9\)"):
        gn.read_capture(tmp_path)


@pytest.fixture
def diligent(tmp_path):
    for k in range(3):
        photograph(tmp_path / f"{k + 1:03}.png", 0.25 * (k + 1))
    (tmp_path / "filenames.txt").write_text("001.png\n002.png\n003.png\n")
    (tmp_path / "light_directions.txt").write_text("".join(f"{x} {y} {z}\n" for x, y, z in VECTORS))
    return tmp_path


def normals(rng):
    """Unit, but for a corner of zeros, where DiLiGenT has no object."""
    n = gn.normalise(rng.normal(size=(*SIZE, 3)) + np.array([0, 0, 3]))
    n[:2, :3] = 0
    return n


def test_diligent_brings_its_normals_in_matlabs_format(diligent, rng):
    from scipy.io import savemat

    expected = normals(rng)
    savemat(diligent / "Normal_gt.mat", {"Normal_gt": expected})
    capture = gn.read_capture(diligent)
    assert_array_equal(capture.mask, expected[..., 2] > 0)
    assert_allclose(capture.normals, expected, atol=1e-7)  # single precision
    mask = np.ones(SIZE)
    mask[4:] = 0
    gn.write_image(diligent / "mask.png", mask, "linear")
    capture = gn.read_capture(diligent)
    assert_array_equal(capture.mask, (mask > 0) & (expected[..., 2] > 0))
    assert "6 pixels of the mask have no normal" in capture.findings[0]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"MATLAB 5.0 MAT-file" + bytes(60), "Normal_gt.mat holds no normals of DiLiGenT: .* Take it away"),
        (b"", "Normal_gt.mat holds no normals of DiLiGenT: .* Take it away"),
        ({"Other": np.ones((2, 2))}, "it has no Normal_gt"),
        ({"Normal_gt": np.array(["text"])}, "holds no normals of DiLiGenT"),
        ({"Normal_gt": np.ones((6, 9, 3))}, r"has shape \(6, 9, 3\); normals of \(6, 8\) pixels"),
        ({"Normal_gt": np.ones((6, 8, 3))}, "holds no unit normal"),
        ({"Normal_gt": np.full((6, 8, 3), np.nan)}, "holds no unit normal"),
    ],
)
def test_normals_of_diligent_that_are_none_are_refused_in_one_line(diligent, content, message):
    from scipy.io import savemat

    path = diligent / "Normal_gt.mat"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        savemat(path, content)
    with pytest.raises(FileError, match=message) as refused:
        gn.read_capture(diligent)
    assert "\n" not in str(refused.value)


def test_a_cut_matlab_file_is_refused_wherever_it_is_cut(diligent, rng):
    from scipy.io import savemat

    path = diligent / "Normal_gt.mat"
    savemat(path, {"Normal_gt": normals(rng)}, do_compression=True)
    whole = path.read_bytes()
    for size in (1, 100, 128, 130, 140, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:size])
        with pytest.raises(FileError, match=r"Normal_gt\.mat holds no normals of DiLiGenT"):
            gn.read_capture(diligent)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("light_directions.txt", "0 0 1\n0 0 0\n0 0 1\n", "light_directions.txt: a direction is 0"),
        ("light_directions.txt", "0 0 1\n0 0 x\n0 0 1\n", "light_directions.txt: .*'x'"),
        ("light_directions.txt", "0 0 1\n0 0\n0 0 1\n", "light_directions.txt"),
        ("light_directions.txt", "0 0 1\n0 0 1\n", "2 light directions and 3 photographs"),
        ("light_directions.txt", "", "light_directions.txt is not rows of 3 numbers"),
        ("filenames.txt", "001.png\n002.png\n004.png\n", r"004\.png of filenames\.txt does not exist"),
    ],
)
def test_tables_of_diligent_that_do_not_fit_are_refused_by_file(diligent, name, text, message):
    (diligent / name).write_text(text)
    with pytest.raises(FileError, match=message):
        gn.read_capture(diligent)


def test_lights_one_folder_up_that_point_nowhere_are_refused_by_file(tmp_path):
    for k in range(3):
        photograph(tmp_path / "cat" / f"cat.{k}.png")
    (tmp_path / "lights.txt").write_text("3\n0 0 1\n0 0 0\n0 0 1\n")
    with pytest.raises(FileError, match=r"lights\.txt: a direction is 0"):
        gn.read_capture(tmp_path / "cat")
    (tmp_path / "lights.txt").write_text("2\n0 0 1\n0 0 1\n")
    capture = gn.read_capture(tmp_path / "cat")
    assert capture.lights is None
    assert "has 2 lights for 3 photographs: not used" in capture.findings[0]


def test_a_single_photograph_is_a_capture_without_lights(tmp_path):
    photograph(tmp_path / "only.png", 0.25)
    capture = gn.read_capture(tmp_path)
    assert (capture.layout, capture.photographs.names, capture.lights) == ("photographs", ("only.png",), None)
    assert_allclose(capture.mean(), 0.25, atol=1e-5)
    # One that ends in a number is not numbered: there is nothing to count.
    photograph(tmp_path / "one" / "cat.0.png", 0.25)
    assert gn.read_capture(tmp_path / "one").layout == "photographs"


def test_a_link_out_of_a_list_of_lights_is_not_followed(tmp_path):
    photograph(tmp_path / "secret.png")
    folder = tmp_path / "inside"
    photograph(folder / "a.png")
    (folder / "b.png").symlink_to(tmp_path / "secret.png")
    (folder / "dirs.lp").write_text("2\na.png 0 0 1\nb.png 0.6 0 0.8\n")
    with pytest.raises(FileError, match=r"b\.png of dirs\.lp does not exist"):
        gn.read_capture(folder)
