"""Facts about .gonio files that hold SHRMs."""

import numpy as np
import pytest
from reference.archives import rewritten, with_fields

import gonio as gn
from gonio.files.shrm import read_shrm, write_shrm
from gonio.rendering.shrm import prefilter


@pytest.fixture(scope="module")
def maps():
    return prefilter(gn.studio(32), gn.Lambert([0.5, 0.3, 0.2]) + gn.OrenNayar(0.2, 0.5), error=0.1)


def test_what_was_written_is_read(tmp_path, maps):
    write_shrm(tmp_path / "room.gonio", maps)
    read = read_shrm(tmp_path / "room.gonio")
    assert (read.error, read.made, len(read.lobes)) == (maps.error, maps.made, 2)
    for a, b in zip(read.lobes, maps.lobes, strict=True):
        assert (a.about, a.exit_cosine) == (b.about, b.exit_cosine)
        np.testing.assert_array_equal(a.coefficients, b.coefficients)


def test_the_same_maps_make_the_same_file(tmp_path, maps):
    for name in ("a", "b"):
        write_shrm(tmp_path / name, maps)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (with_fields(gonio="material"), "field 'gonio' is 'material'"),
        (with_fields(version=99), "field 'version' is 99"),
        (with_fields(error="small"), "field 'error'"),
        (with_fields(made=3), "field 'made'"),
        (with_fields(lobes=[]), "field 'lobes'"),
        (with_fields(lobes=[{"about": "tangent", "exit_cosine": False}]), r"lobes\[0\]"),
        (lambda entries: {k: v for k, v in entries.items() if k != "lobe-1.npy"}, "lobe-1.npy is missing"),
        (lambda entries: {k: v for k, v in entries.items() if k != "gonio.json"}, "no gonio.json"),
        (lambda entries: entries | {"gonio.json": "{"}, "damaged"),
        (lambda entries: entries | {"lobe-0.npy": entries["lobe-0.npy"][:-4]}, "says it holds"),
        (lambda entries: entries | {"lobe-0.npy": b"\x93NUMPY\x01\x00"}, "damaged"),
    ],
)
def test_files_that_are_not_right_are_refused_by_name(tmp_path, maps, change, message):
    path = tmp_path / "room.gonio"
    write_shrm(path, maps)
    rewritten(path, change)
    with pytest.raises(gn.GonioError, match=message):
        read_shrm(path)


def test_coefficients_that_are_not_finite_are_refused(tmp_path, maps):
    path = tmp_path / "room.gonio"
    write_shrm(path, maps)

    def spoilt(entries):
        data = bytearray(entries["lobe-0.npy"])
        data[-4:] = np.float32(np.nan).tobytes()
        return entries | {"lobe-0.npy": bytes(data)}

    rewritten(path, spoilt)
    with pytest.raises(gn.GonioError, match="not finite"):
        read_shrm(path)


def test_arrays_of_objects_are_never_unpickled(tmp_path, maps):
    path = tmp_path / "room.gonio"
    write_shrm(path, maps)
    header = b"\x93NUMPY\x01\x00" + (118).to_bytes(2, "little")
    words = b"{'descr': '|O', 'fortran_order': False, 'shape': (1,), }"
    rewritten(path, lambda entries: entries | {"lobe-0.npy": header + words.ljust(117) + b"\n" + b"\x80\x04."})
    with pytest.raises(gn.GonioError, match="plain numbers"):
        read_shrm(path)


def test_a_file_that_is_no_archive_is_refused(tmp_path):
    path = tmp_path / "room.gonio"
    path.write_bytes(b"not a ZIP")
    with pytest.raises(gn.GonioError, match=r"damaged, or no \.gonio file"):
        read_shrm(path)
