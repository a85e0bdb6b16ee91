"""OpenEXR images and layers."""

import struct
import warnings

import numpy as np
import pytest

import gonio as gn
from gonio.errors import ArrayError, FileError

OpenEXR = pytest.importorskip("OpenEXR")


def save(path, channels, **header):
    OpenEXR.File({"type": OpenEXR.scanlineimage, **header}, channels).write(str(path))
    return path


def rgb(image):
    return {c: np.ascontiguousarray(image[..., k]) for k, c in enumerate("RGB")}


@pytest.fixture
def image(rng):
    return rng.exponential(1.0, (7, 5, 3)).astype(np.float32)


def test_float_and_half_round_trips_are_exact(tmp_path, image):
    gn.write_image(tmp_path / "a.exr", image)
    np.testing.assert_array_equal(gn.read_image(tmp_path / "a.exr"), image)
    assert gn.image_info(tmp_path / "a.exr").dtype == "float32"
    half = image.astype(np.float16)
    gn.write_image(tmp_path / "a.exr", half, bits=16)
    np.testing.assert_array_equal(gn.read_image(tmp_path / "a.exr"), half)
    assert gn.image_info(tmp_path / "a.exr").dtype == "float16"


def test_layers_come_back_as_they_went(tmp_path, image, rng):
    layers = {
        "RGB": image,
        "diffuse": image.astype(np.float16),
        "left.specular": 2 * image,
        "Z": image[..., 0],
        "diffuse.A": image[..., 1].astype(np.float16),
        "id": rng.integers(0, 2**32, (7, 5), dtype=np.uint32),
    }
    gn.write_layers(tmp_path / "a.exr", layers)
    back = gn.read_layers(tmp_path / "a.exr")
    assert set(back) == set(layers)
    for name, values in layers.items():
        assert back[name].dtype == values.dtype
        np.testing.assert_array_equal(back[name], values)
    np.testing.assert_array_equal(gn.read_image(tmp_path / "a.exr"), image)


def test_the_only_layer_is_the_image_and_two_are_ambiguous(tmp_path, image):
    gn.write_layers(tmp_path / "a.exr", {"diffuse": image, "Z": image[..., 0]})
    np.testing.assert_array_equal(gn.read_image(tmp_path / "a.exr"), image)
    gn.write_layers(tmp_path / "a.exr", {"diffuse": image, "specular": image})
    with pytest.raises(FileError, match=r"no single colour image: it holds diffuse, specular\. Use read_layers"):
        gn.read_image(tmp_path / "a.exr")


def test_luminance_alone_is_grey(tmp_path, image):
    save(tmp_path / "a.exr", {"Y": image[..., 0].copy()})
    np.testing.assert_array_equal(gn.read_image(tmp_path / "a.exr"), np.repeat(image[..., :1], 3, axis=2))


def test_the_display_window_is_the_picture(tmp_path, image):
    # Data over rows 2 to 8 and columns -1 to 3 of a display of 6 x 4: the first column and last rows are cut away.
    windows = {"dataWindow": (-1, 2, 3, 8), "displayWindow": (0, 0, 3, 5)}
    windows = {k: (np.array(v[:2], np.int32), np.array(v[2:], np.int32)) for k, v in windows.items()}
    expected = np.zeros((6, 4, 3), np.float32)
    expected[2:] = image[:4, 1:]
    got = gn.read_image(save(tmp_path / "a.exr", rgb(image), **windows))
    np.testing.assert_array_equal(got, expected)
    info = gn.image_info(tmp_path / "a.exr")
    assert (info.rows, info.columns) == (6, 4)
    assert info.attributes["dataWindow"] == (-1, 2, 3, 8)


def test_data_beside_the_display_leave_it_black(tmp_path, image):
    windows = {"dataWindow": (10, 10, 14, 16), "displayWindow": (0, 0, 3, 5)}
    windows = {k: (np.array(v[:2], np.int32), np.array(v[2:], np.int32)) for k, v in windows.items()}
    assert not gn.read_image(save(tmp_path / "a.exr", rgb(image), **windows)).any()


def test_parts_are_layers_and_a_taken_name_gets_the_parts(tmp_path, image):
    parts = [
        OpenEXR.Part({"type": OpenEXR.scanlineimage}, rgb(image), "left"),
        OpenEXR.Part({"type": OpenEXR.scanlineimage}, rgb(2 * image) | {"Z": image[..., 0].copy()}, "right"),
    ]
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    layers = gn.read_layers(tmp_path / "a.exr")
    assert set(layers) == {"RGB", "right.RGB", "Z"}
    np.testing.assert_array_equal(layers["right.RGB"], 2 * image)
    np.testing.assert_array_equal(gn.read_image(tmp_path / "a.exr"), image)
    assert gn.image_info(tmp_path / "a.exr").attributes["parts"] == ["left", "right"]


def test_every_lossless_compression_and_tiles_are_read(tmp_path, image):
    for name in ("NO", "RLE", "ZIPS", "ZIP", "PIZ"):
        path = save(tmp_path / "a.exr", rgb(image), compression=getattr(OpenEXR, f"{name}_COMPRESSION"))
        np.testing.assert_array_equal(gn.read_image(path), image)
    tiles = OpenEXR.TileDescription()
    tiles.xSize = tiles.ySize = 4
    OpenEXR.File({"type": OpenEXR.tiledimage, "tiles": tiles}, rgb(image)).write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(gn.read_image(tmp_path / "a.exr"), image)


def test_attributes_are_reported_without_the_pixels(tmp_path, image):
    header = {"owner": "a person", "exposure": 0.5, "iso": 100, "at": np.array([1, 2, 3], np.float32)}
    save(tmp_path / "a.exr", rgb(image), **header)
    info = gn.image_info(tmp_path / "a.exr")
    assert (info.format, info.rows, info.columns) == ("OpenEXR", 7, 5)
    assert info.channels == ("B", "G", "R") and info.encoding == "linear"
    assert info.attributes.items() >= {"owner": "a person", "exposure": 0.5, "iso": 100, "at": (1, 2, 3)}.items()
    assert info.attributes["compression"] == "ZIP"


def test_mitsuba_reads_what_is_written(tmp_path, image):
    mitsuba = pytest.importorskip("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    gn.write_image(tmp_path / "a.exr", image)
    np.testing.assert_array_equal(np.array(mitsuba.Bitmap(str(tmp_path / "a.exr"))), image)


def test_integers_and_subsampled_chroma_are_no_radiance(tmp_path):
    whole = np.ones((4, 4), np.uint32)
    with pytest.raises(FileError, match="RGB holds integers, no radiance"):
        gn.read_image(save(tmp_path / "a.exr", {"R": whole, "G": whole, "B": whole}))
    # The library writes no subsampled channels: the sampling rates stand behind name, type and a flag.
    data = save(tmp_path / "a.exr", {"Y": np.ones((4, 4), np.float16), "RY": np.ones((4, 4), np.float16)}).read_bytes()
    at = data.index(b"\0RY\0") + 4 + 8
    (tmp_path / "b.exr").write_bytes(data[:at] + struct.pack("<2I", 2, 2) + data[at + 8 :])
    with pytest.raises(FileError, match="channel RY is subsampled"):
        gn.read_image(tmp_path / "b.exr")


def test_damaged_pixels_are_refused_and_nothing_is_printed(tmp_path, image, capfd):
    compressible = np.tile(image, (9, 9, 1))
    whole = save(tmp_path / "a.exr", rgb(compressible)).read_bytes()
    for damaged in (whole[:-1], whole[:-40] + bytes(40), whole[: len(whole) // 2]):
        (tmp_path / "b.exr").write_bytes(damaged)
        with pytest.raises(FileError, match=r"b\.exr"):
            gn.read_image(tmp_path / "b.exr")
    parts = [OpenEXR.Part({"type": OpenEXR.scanlineimage}, rgb(image), name) for name in ("left", "right")]
    OpenEXR.File(parts).write(str(tmp_path / "c.exr"))
    whole = (tmp_path / "c.exr").read_bytes()
    (tmp_path / "c.exr").write_bytes(whole[:-1])  # the last part alone is damaged, and the library drops it
    with pytest.raises(FileError, match="missing or damaged"):
        gn.read_image(tmp_path / "c.exr")
    assert capfd.readouterr() == ("", "")


def test_a_header_of_any_size_is_refused_before_memory_is_taken(tmp_path, image):
    whole = save(tmp_path / "a.exr", rgb(image)).read_bytes()
    for window in (b"dataWindow", b"displayWindow"):
        at = whole.index(window + b"\0box2i\0") + len(window) + 7 + 4
        (tmp_path / "b.exr").write_bytes(whole[:at] + struct.pack("<4i", 0, 0, 2**31 - 2, 2**31 - 2) + whole[at + 16 :])
        with pytest.raises(FileError, match=r"b\.exr: the header says 2147483647 x 2147483647 pixels"):
            gn.read_image(tmp_path / "b.exr")


def test_any_byte_of_a_header_may_be_wrong(tmp_path, image):
    """Whatever a damaged header says, the answer is an image or a FileError."""
    whole = bytearray(save(tmp_path / "a.exr", rgb(image)).read_bytes())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gn.GonioWarning)
        for at in range(4, 330, 3):
            broken = bytearray(whole)
            broken[at] ^= 0xFF
            (tmp_path / "b.exr").write_bytes(broken)
            try:
                assert gn.read_image(tmp_path / "b.exr").ndim == 3
            except FileError as error:
                assert "b.exr" in str(error)


@pytest.mark.parametrize(
    ("layers", "message"),
    [
        ({}, "layers is empty"),
        ({"a": np.zeros((2, 2)), "b": np.zeros((2, 3))}, r"sizes \(2, 2\) and \(2, 3\)"),
        ({"a": np.zeros((2, 2, 4))}, r"shape \(2, 2, 4\)"),
        ({"a": np.zeros((2, 2, 3)), "a.G": np.zeros((2, 2))}, "layer 'a' has channels of its own called a.G"),
        ({"RGB": np.zeros((2, 2, 3)), "R": np.zeros((2, 2))}, "layer 'RGB' has channels of its own called R"),
        ({"": np.zeros((2, 2))}, "cannot be a layer's name"),
        ({"a": np.full((2, 2), -1)}, "whole numbers outside"),
        ({"a": np.zeros((2, 2), complex)}, "expected real numbers"),
    ],
)
def test_layers_that_cannot_be_written_are_refused(tmp_path, layers, message):
    with pytest.raises(ArrayError, match=message):
        gn.write_layers(tmp_path / "a.exr", layers)
    assert not any(tmp_path.iterdir())


def test_layers_are_openexr_only(tmp_path, image):
    with pytest.raises(FileError, match=r"written as \.exr, not \.png"):
        gn.write_layers(tmp_path / "a.png", {"RGB": image})
    gn.write_image(tmp_path / "a.pfm", image)
    with pytest.raises(FileError, match="has no layers"):
        gn.read_layers(tmp_path / "a.pfm")
