"""MERL files that the tests write themselves, sound and broken: no measured one may be passed on."""

import struct

import numpy as np
import pytest

import gonio as gn
from gonio.brdf.table import HalfDifferenceTable, above_surface
from gonio.errors import FileError, NegativeWarning
from gonio.files.merl import read_merl, write_merl

SHAPE = (90, 90, 180)
ABOVE = above_surface(SHAPE)


@pytest.fixture(scope="module")
def planes():
    """Raw planes as MERL's: -1 below the surface, noise above."""
    values = np.random.default_rng(1).uniform(0, 3000, (3, *SHAPE))
    values[:, ~ABOVE] = -1
    return values


def save(path, planes, shape=SHAPE):
    path.write_bytes(struct.pack("<3i", *shape) + np.asarray(planes, "<f8").tobytes())
    return path


def test_values_are_scaled_as_merl_says(tmp_path, planes):
    table = read_merl(save(tmp_path / "noise.binary", planes))
    assert np.array_equal(table.valid, ABOVE)
    j, k, m = 3, 40, 17
    assert ABOVE[j, k, m]
    assert table.values[j, k, m] == pytest.approx(planes[:, j, k, m] * [1 / 1500, 1.15 / 1500, 1.66 / 1500], rel=1e-7)


def test_a_round_trip_keeps_every_value_and_the_mask(tmp_path, planes):
    table = read_merl(save(tmp_path / "noise.binary", planes))
    write_merl(tmp_path / "again.binary", table)
    again = read_merl(tmp_path / "again.binary")
    assert np.array_equal(again.values, table.values)
    assert np.array_equal(again.valid, table.valid)


def test_a_gray_model_can_be_written_for_other_programs(tmp_path):
    write_merl(tmp_path / "gray.binary", HalfDifferenceTable.of(gn.Lambert(0.5)))
    up = np.array([0.0, 0.6, 0.8])
    assert read_merl(tmp_path / "gray.binary").f(up, up) == pytest.approx([0.5 / np.pi] * 3, rel=1e-6)


def test_negative_cells_above_the_surface_are_told_and_filled(tmp_path, planes):
    holes = planes.copy()
    holes[1, 5, 10, :] = -1
    with pytest.warns(NegativeWarning, match=r"180 of the .* cells above"):
        table = read_merl(save(tmp_path / "holes.binary", holes))
    assert not table.valid[5, 10].any()
    assert np.array_equal(table.values[5, 10], table.values[4, 10])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "header"),
        (struct.pack("<3i", 90, 90, 360), r"dimensions are \(90, 90, 360\)"),
        (struct.pack("<3i", -90, -90, 180), "dimensions"),
        (struct.pack("<3i", 2**31 - 1, 2**31 - 1, 2**31 - 1), "dimensions"),
        (struct.pack("<3i", *SHAPE) + bytes(1000), "1000 bytes"),
        (struct.pack("<3i", *SHAPE) + bytes(34992001), "34992001 bytes"),
    ],
    ids=["empty", "half-resolution", "negative", "overflow", "truncated", "trailing"],
)
def test_broken_files_are_refused_by_name(tmp_path, content, message):
    path = tmp_path / "broken.binary"
    path.write_bytes(content)
    with pytest.raises(FileError, match=f"broken.binary.*{message}"):
        read_merl(path)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
def test_values_that_are_no_numbers_are_refused(tmp_path, planes, value):
    bad = planes.copy()
    bad[2, 1, 2, 3] = value
    with pytest.raises(FileError, match=r"blue\[1, 2, 3\]"):
        read_merl(save(tmp_path / "bad.binary", bad))


def test_a_file_of_nothing_is_refused(tmp_path):
    with pytest.raises(FileError, match="nothing was measured"):
        read_merl(save(tmp_path / "empty.binary", np.full((3, *SHAPE), -1.0)))
    with pytest.raises(FileError, match=r"none\.binary"):
        read_merl(tmp_path / "none.binary")


def test_only_merls_resolution_is_written(tmp_path):
    with pytest.raises(FileError, match="Tabulate"):
        write_merl(tmp_path / "small.binary", HalfDifferenceTable(np.ones((3, 3, 4, 3))))
    assert not list(tmp_path.iterdir())
