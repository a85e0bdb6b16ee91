"""Facts about .gonio files that hold a view for any distant light."""

import io
import json
import zipfile

import numpy as np
import pytest
from reference.archives import rewritten, with_array, with_fields, without

import gonio as gn
from gonio.capture.simulation import from_above
from gonio.files.precomputed import read_precomputed, write_precomputed
from gonio.rendering.precomputing import precompute
from gonio.rendering.relight import Relightable

ROOM = gn.studio(16)


def made(error):
    view = gn.Sphere().view(from_above(gn.Sphere(), 12))
    return precompute(Relightable(view, gn.Lambert([0.5, 0.3, 0.2])), error=error, side=4, samples=1)


@pytest.fixture(scope="module")
def coarse():
    return made(0.02)


@pytest.mark.parametrize(("error", "dtype"), [(0.02, np.float16), (1e-3, np.float32)])
def test_what_was_written_is_read_in_as_few_bytes_as_hold_it(tmp_path, error, dtype):
    thing = made(error)
    write_precomputed(tmp_path / "fast.gonio", thing)
    read = read_precomputed(tmp_path / "fast.gonio")
    for name in ("mask", "ranks", "images", "mixtures", "lights"):
        np.testing.assert_array_equal(getattr(read, name), getattr(thing, name))
    assert (read.error, read.block, read.cells, read.made) == (thing.error, thing.block, thing.cells, thing.made)
    np.testing.assert_array_equal(read.relight(ROOM), thing.relight(ROOM))
    with zipfile.ZipFile(tmp_path / "fast.gonio") as archive:
        assert np.load(io.BytesIO(archive.read("images.npy"))).dtype == dtype


def test_a_player_needs_no_more_than_the_file_says(tmp_path, coarse):
    """As its docstring has it, without gonio."""
    write_precomputed(tmp_path / "fast.gonio", coarse)
    with zipfile.ZipFile(tmp_path / "fast.gonio") as archive:
        fields = json.loads(archive.read("gonio.json"))
        mask, ranks, images, mixtures, lights = (
            np.load(io.BytesIO(archive.read(f"{name}.npy")))
            for name in ("mask", "ranks", "images", "mixtures", "lights")
        )
    L = coarse.cells.radiance(ROOM)
    y = mixtures.astype(float) @ (lights.astype(float).T @ L)
    image, at, row, edge = np.zeros((*mask.shape, 3)), 0, 0, fields["block"]
    kept = [
        (r, c, pixels)
        for r in range(0, mask.shape[0], edge)
        for c in range(0, mask.shape[1], edge)
        if (pixels := int(mask[r : r + edge, c : c + edge].sum()))
    ]
    for (r, c, pixels), rank in zip(kept, ranks.tolist(), strict=True):
        U = images[at : at + 3 * rank * pixels].reshape(3, rank, pixels).astype(float)
        shown = np.einsum("crp,rc->pc", U, y[row : row + rank])
        image[r : r + edge, c : c + edge][mask[r : r + edge, c : c + edge]] = np.maximum(shown, 0)
        at, row = at + U.size, row + rank
    np.testing.assert_allclose(image, coarse.relight(ROOM), rtol=1e-4, atol=1e-6)


def test_the_same_thing_makes_the_same_file(tmp_path, coarse):
    for name in ("a", "b"):
        write_precomputed(tmp_path / name, coarse)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (with_fields(gonio="relightable"), "field 'gonio' is 'relightable'"),
        (with_fields(version=2), "field 'version' is 2"),
        (with_fields(error="small"), "field 'error' is 'small'; a number"),
        (with_fields(error=-1), "error = -1"),
        (with_fields(block=True), "field 'block' is True"),
        (with_fields(block=0), "block = 0"),
        (with_fields(side=1000), "side = 1000"),
        (with_fields(side=5), r"\(150, R\)"),
        (with_fields(made=None), "field 'made' is None; words"),
        (without("mask.npy"), "mask.npy is missing"),
        (without("lights.npy"), "lights.npy is missing"),
        (without("gonio.json"), "no gonio.json"),
        (with_array("mask", lambda a: a.astype(np.uint8)), "mask.npy is uint8"),
        (with_array("mask", lambda a: a & False), "some true"),
        (with_array("mask", lambda a: a.ravel()), "some true"),
        (with_array("ranks", lambda a: a.astype(float)), "ranks.npy is float64"),
        (with_array("ranks", lambda a: a[1:]), "ranks is int32"),
        (with_array("ranks", lambda a: a + 1), "images has shape"),
        (with_array("ranks", lambda a: a - 99), "whole numbers >= 0"),
        (with_array("images", lambda a: a[1:]), "images has shape"),
        (with_array("images", lambda a: a[:, None]), "images has shape"),
        (with_array("images", lambda a: a.astype(int)), "images.npy is int64"),
        (with_array("images", lambda a: a * np.float16(np.nan)), "images.* is nan"),
        (with_array("mixtures", lambda a: a[:, 1:]), "mixtures has shape"),
        (with_array("mixtures", lambda a: a.ravel()), "mixtures has shape"),
        (with_array("lights", lambda a: a[0, 0]), "lights"),
        (lambda entries: entries | {"images.npy": entries["images.npy"][:-2]}, "says it holds"),
    ],
)
def test_files_that_are_not_right_are_refused_by_name(tmp_path, coarse, change, message):
    path = tmp_path / "fast.gonio"
    write_precomputed(path, coarse)
    rewritten(path, change)
    with pytest.raises(gn.errors.FileError, match=message) as refused:
        read_precomputed(path)
    assert str(path) in str(refused.value)


def test_another_kind_of_gonio_file_is_refused(tmp_path, coarse):
    write_precomputed(tmp_path / "fast.gonio", coarse)
    with pytest.raises(gn.errors.FileError, match="'precomputed'; a file with 'relightable'"):
        gn.read_relightable(tmp_path / "fast.gonio")
