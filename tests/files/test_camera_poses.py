"""Cameras of several photographs: which file is read, and that all tell the same."""

import pytest
from numpy.testing import assert_allclose
from reference.poses import EXACT, LENS, POINTS, binary_model, camera_to_world, text_model, transforms

from gonio.errors import FileError
from gonio.files.camera_poses import read_cameras


def test_a_colmap_model_is_named_by_its_folder_or_either_file_and_binary_leads(tmp_path):
    folder = text_model(tmp_path / "model")
    named = [read_cameras(place) for place in (folder, folder / "cameras.txt", folder / "images.txt")]
    assert list(named[0]) == list(named[1]) == list(named[2])
    (binary_model(tmp_path / "other") / "cameras.bin").rename(folder / "cameras.bin")
    with pytest.raises(FileError, match=r"images\.bin cannot be read"):
        read_cameras(folder)


def test_nerf_and_colmap_agree_on_one_scene(tmp_path):
    colmap = list(read_cameras(text_model(tmp_path / "model")).values())[1]
    frame = {"file_path": "a", "transform_matrix": camera_to_world(1).tolist()}
    nerf = read_cameras(transforms(tmp_path / "transforms.json", [frame], **LENS))["a"]
    assert_allclose(nerf.project(POINTS)[0], colmap.project(POINTS)[0], **EXACT)


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
