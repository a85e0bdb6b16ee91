"""Photographs in a store."""

from __future__ import annotations

import json

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import gonio as gn
from gonio.files import store
from gonio.files.captures import photograph_files


@pytest.fixture
def folder(tmp_path, rng):
    """Forty photographs of 70 x 130 noisy pixels in 8 bits, with lights."""
    for k in range(40):
        gn.write_image(tmp_path / f"p{k:02}.png", rng.random((70, 130, 3)), "srgb", bits=8)
    lights = gn.normalise(rng.normal(size=(40, 3)) + np.array([0, 0, 2]))
    gn.write_lp(tmp_path / "dirs.lp", [f"p{k:02}.png" for k in range(40)], lights)
    return tmp_path


def test_a_store_holds_what_the_files_hold_and_is_used_in_their_place(folder, rng):
    files = gn.read_capture(folder).photographs
    heard = []
    store.ingest(photograph_files(folder), folder / store.STORE, lambda done, total: heard.append((done, total)))
    assert heard == [(32, 40), (40, 40)]
    capture = gn.read_capture(folder)
    stored = capture.photographs
    assert isinstance(stored, store.StoredPhotographs)
    assert capture.findings == ()
    for k in (0, 31, 32, 39):
        one, other = files.read(k), stored.read(k)
        assert_array_equal(one.radiance, other.radiance)
        assert_array_equal(one.clipped, other.clipped)
        at = rng.permutation(70 * 130)[:50]
        for picked in (files.pick(k, at), stored.pick(k, at)):
            assert_array_equal(picked.radiance, one.radiance.reshape(-1, 3)[at])
            assert_array_equal(picked.clipped, one.clipped.reshape(-1)[at])
    at = np.array([0, 127, 128, 129, 130 * 69 + 129, 5000])
    one, other = files.pixels(at), stored.pixels(at)
    assert_array_equal(one.radiance, other.radiance)
    assert_array_equal(one.clipped, other.clipped)


def test_what_was_stopped_goes_on_where_it_was(folder, monkeypatch):
    files, path = photograph_files(folder), folder / store.STORE

    def stop(done, _):
        if done == 32:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        store.ingest(files, path, stop)
    assert not isinstance(gn.read_capture(folder).photographs, store.StoredPhotographs)
    assert "is not whole" in gn.read_capture(folder).findings[0]
    decoded = []
    read = store.read_raster
    monkeypatch.setattr(store, "read_raster", lambda path: decoded.append(path) or read(path))
    store.ingest(files, path)
    assert len(decoded) == 8
    assert isinstance(gn.read_capture(folder).photographs, store.StoredPhotographs)


def test_a_store_of_other_photographs_is_not_used_nor_written_over(folder, rng):
    store.ingest(photograph_files(folder), folder / store.STORE)
    gn.write_image(folder / "p03.png", np.full((70, 130, 3), 0.5))
    capture = gn.read_capture(folder)
    assert "of other photographs" in capture.findings[0]
    assert not isinstance(capture.photographs, store.StoredPhotographs)
    with pytest.raises(gn.GonioError, match="begun for other photographs"):
        store.ingest(photograph_files(folder), folder / store.STORE)


def test_damage_is_found_by_checksums(folder):
    store.ingest(photograph_files(folder), folder / store.STORE)
    chunk = max((folder / store.STORE / "c").rglob("*"), key=lambda path: path.stat().st_size if path.is_file() else 0)
    content = bytearray(chunk.read_bytes())
    content[len(content) // 2] ^= 1
    chunk.write_bytes(content)
    photographs = gn.read_capture(folder).photographs
    with pytest.raises(gn.GonioError, match="is damaged"):
        for k in range(40):
            photographs.read(k)


def test_what_is_no_store_is_refused(folder):
    (folder / store.STORE).mkdir()
    with pytest.raises(gn.GonioError, match="is no store of photographs"):
        store.ingest(photograph_files(folder), folder / store.STORE)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("zarr_format", 2),
        ("data_type", "object"),
        ("codecs", [{"name": "bytes"}, {"name": "numcodecs.pickle"}]),
        ("shape", [3, 2**20, 2**20, 3]),
        ("attributes", {"kind": "other", "version": 1}),
    ],
)
def test_stores_that_name_other_codecs_or_sizes_are_not_opened(folder, field, value):
    store.ingest(photograph_files(folder), folder / store.STORE)
    metadata = folder / store.STORE / "zarr.json"
    metadata.write_text(json.dumps(json.loads(metadata.read_text()) | {field: value}))
    with pytest.raises(gn.GonioError, match=r"no store of photographs|more than"):
        store.StoredPhotographs(folder / store.STORE)


def test_sixteen_bits_stay_sixteen(tmp_path):
    image = np.linspace(0, 1, 8 * 8 * 3).reshape(8, 8, 3)
    for k in range(3):
        gn.write_image(tmp_path / f"{k}.png", image, "linear", bits=16)
    store.ingest(photograph_files(tmp_path), tmp_path / store.STORE)
    stored = gn.read_capture(tmp_path).photographs
    assert stored.codes.dtype == np.uint16
    assert np.abs(stored.read(1).radiance - image).max() < 1e-5
