"""Tensor files and RGL's materials: round trips, spectra, hostile headers, and the reader that knows them all."""

import struct

import numpy as np
import pytest

import gonio as gn
from gonio.brdf.adaptive import AdaptiveTable
from gonio.brdf.scattered import ScatteredBRDF
from gonio.brdf.table import HalfDifferenceTable
from gonio.colour import spectrum_to_rgb
from gonio.errors import FileError
from gonio.files.rgl import read_rgl
from gonio.files.tensors import read_tensors, write_tensors

MAGIC = b"tensor_file\0\x01\0"


def fields(**changes):
    rng = np.random.default_rng(5)
    made = {
        "description": np.frombuffer("crème".encode(), np.uint8),
        "theta_i": np.array([0, 0.7, 1.5], np.float32),
        "phi_i": np.zeros(1, np.float32),
        "ndf": rng.uniform(0.5, 1, (2, 8)).astype(np.float32),
        "sigma": rng.uniform(0.5, 1, (2, 8)).astype(np.float32),
        "vndf": rng.uniform(0.5, 1, (1, 3, 9, 8)).astype(np.float32),
        "luminance": rng.uniform(0.5, 1, (1, 3, 4, 4)).astype(np.float32),
        "rgb": rng.uniform(0.5, 1, (1, 3, 3, 4, 4)).astype(np.float32),
        "jacobian": np.ones(1, np.uint8),
    }
    return {name: value for name, value in (made | changes).items() if value is not None}


def test_tensors_come_back_as_they_went(tmp_path, rng):
    path = tmp_path / "any.tensors"
    tensors = {
        "words": np.frombuffer(b"hello", np.uint8),
        "half": rng.normal(size=(3, 2)).astype(np.float16),
        "big endian": np.arange(6, dtype=">i8").reshape(1, 2, 3),
        "nothing": np.zeros((0, 4)),
        "number": np.array(2.5),
    }
    write_tensors(path, tensors)
    again = read_tensors(path)
    assert list(again) == list(tensors)
    for name, array in tensors.items():
        assert again[name].dtype == array.dtype.newbyteorder("=")
        assert again[name].shape == array.shape
        assert np.array_equal(again[name], array)


def test_mitsuba_reads_and_writes_the_same_files(tmp_path, rng):
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    ours = {"a": rng.normal(size=(2, 3)).astype(np.float32), "b": np.arange(5, dtype=np.uint8)}
    write_tensors(tmp_path / "ours.bsdf", ours)
    theirs = mi.tensor_io.read(str(tmp_path / "ours.bsdf"))
    assert all(np.array_equal(np.array(theirs[name]), ours[name]) for name in ours)
    mi.tensor_io.write(str(tmp_path / "theirs.bsdf"), **ours)
    again = read_tensors(tmp_path / "theirs.bsdf")
    assert all(np.array_equal(again[name], ours[name]) for name in ours)


def test_spectra_become_rgb_before_or_after_all_the_same(tmp_path, rng):
    wavelengths = np.linspace(360, 1000, 33).astype(np.float32)
    spectra = rng.uniform(0.4, 0.6, (1, 3, 33, 4, 4)).astype(np.float32)
    write_tensors(tmp_path / "spectral.bsdf", fields(rgb=None, spectra=spectra, wavelengths=wavelengths))
    brdf = read_rgl(tmp_path / "spectral.bsdf")
    assert brdf.description == "crème"
    single = []
    wi, wo = np.array([0.0, 0.6, 0.8]), np.array([0.48, 0.36, 0.8])
    for k in range(33):
        write_tensors(tmp_path / "one.bsdf", fields(rgb=np.repeat(spectra[:, :, k : k + 1], 3, axis=2)))
        single.append(read_rgl(tmp_path / "one.bsdf").f(wi, wo)[0])
    assert brdf.f(wi, wo) == pytest.approx(spectrum_to_rgb(wavelengths, np.array(single)), rel=1e-4)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"vndf": None}, "no field vndf"),
        ({"rgb": None}, "no field rgb"),
        ({"jacobian": np.ones(2, np.uint8)}, "jacobian"),
        ({"ndf": np.full((2, 8), np.nan, np.float32)}, "ndf.*nan"),
        ({"sigma": np.zeros((2, 8), np.float32)}, "sigma"),
        ({"luminance": np.ones((1, 2, 4, 4), np.float32)}, "luminance has shape"),
        ({"theta_i": np.zeros(3, np.float32)}, "theta must rise"),
        ({"phi_i": np.zeros((0,), np.float32)}, "phi has shape"),
        ({"rgb": np.ones((1, 3, 3, 4, 4), np.int32)}, "rgb has dtype"),
        (
            {"rgb": None, "spectra": np.ones((1, 3, 2, 4, 4), np.float32), "wavelengths": np.ones(2, np.float32)},
            "rising",
        ),
        ({"rgb": None, "spectra": np.ones((2, 2), np.float32), "wavelengths": np.ones(2, np.float32)}, "spectra"),
    ],
)
def test_materials_that_make_no_sense_are_refused_by_field(tmp_path, changes, message):
    write_tensors(tmp_path / "broken.bsdf", fields(**changes))
    with pytest.raises(FileError, match=rf"broken\.bsdf: .*{message}"):
        read_rgl(tmp_path / "broken.bsdf")


def field(name=b"a", ndim=1, dtype=10, offset=0, shape=(1,)):
    return struct.pack("<H", len(name)) + name + struct.pack(f"<HBQ{len(shape)}Q", ndim, dtype, offset, *shape)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "tensor_file"),
        (b"PK\3\4 some archive", "tensor_file"),
        (MAGIC, "header ends"),
        (b"tensor_file\0\x02\0" + struct.pack("<I", 0), "version 2.0"),
        (MAGIC + struct.pack("<I", 2**32 - 1) + field(shape=(1,)), "header ends"),
        (MAGIC + struct.pack("<I", 1) + field(shape=(2**62, 2**62), ndim=2), "but the file has"),
        (MAGIC + struct.pack("<I", 1) + field(shape=(2**63, 0), ndim=2), "but the file has"),
        (MAGIC + struct.pack("<I", 1) + field(offset=2**64 - 1), "but the file has"),
        (MAGIC + struct.pack("<I", 1) + field(shape=(1000,)), "but the file has"),
        (MAGIC + struct.pack("<I", 1) + field(ndim=65535), "header ends"),
        (MAGIC + struct.pack("<I", 1) + field(ndim=17, shape=(1,) * 17), "17 dimensions"),
        (MAGIC + struct.pack("<I", 1) + field(dtype=99), "dtype 99"),
        (MAGIC + struct.pack("<I", 2) + field() + field(), "twice"),
    ],
)
def test_hostile_headers_are_refused_before_memory_is_taken(tmp_path, content, message):
    path = tmp_path / "hostile.bsdf"
    path.write_bytes(content)
    with pytest.raises(FileError, match=rf"hostile\.bsdf.*{message}"):
        read_tensors(path)


def test_a_material_cut_anywhere_is_refused(tmp_path):
    write_tensors(tmp_path / "whole.bsdf", fields())
    content = (tmp_path / "whole.bsdf").read_bytes()
    for size in [*range(0, 400, 7), len(content) // 2, len(content) - 1]:
        (tmp_path / "cut.bsdf").write_bytes(content[:size])
        with pytest.raises(FileError, match=r"cut\.bsdf"):
            read_rgl(tmp_path / "cut.bsdf")


def test_dtypes_that_have_no_code_are_not_written(tmp_path):
    with pytest.raises(FileError, match="complex128"):
        write_tensors(tmp_path / "no.bsdf", {"z": np.zeros(2, complex)})
    assert not list(tmp_path.iterdir())


def test_read_brdf_knows_files_by_their_content(tmp_path, data):
    write_tensors(tmp_path / "material.dat", fields())
    assert isinstance(gn.read_brdf(tmp_path / "material.dat"), AdaptiveTable)
    gn.write_merl(tmp_path / "merl.dat", HalfDifferenceTable.of(gn.Lambert(0.5)))
    assert isinstance(gn.read_brdf(tmp_path / "merl.dat"), HalfDifferenceTable)
    assert isinstance(gn.read_brdf(data / "brdf" / "cornell" / "garnet_red.brdf"), ScatteredBRDF)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("photo.png", b"\x89PNG", "MERL.*RGL.*Cornell"),
        ("disney.brdf", b"analytic\n::begin shader", "BRDF Explorer"),
        ("short.binary", b"\0", "header is cut short"),
        ("other.bsdf", b"<WindowElement>", "tensor_file"),
    ],
)
def test_read_brdf_says_what_it_knows(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileError, match=rf"{name}.*{message}"):
        gn.read_brdf(tmp_path / name)
    with pytest.raises(FileError, match="cannot be read"):
        gn.read_brdf(tmp_path / "none.bsdf")
