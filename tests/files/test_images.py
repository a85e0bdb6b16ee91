"""Image files of every format: what comes in is linear, whole and the right way up."""

import struct
import sys
import warnings
import zlib

import numpy as np
import pytest

import gonio as gn
from gonio.colour import srgb_decode
from gonio.errors import (
    AlphaWarning,
    ArrayError,
    ClippedWarning,
    EncodingWarning,
    FileError,
    MissingExtraError,
    NegativeWarning,
    ParameterError,
)
from gonio.files.images import read_raster

cv2 = pytest.importorskip("cv2")
tifffile = pytest.importorskip("tifffile")

# No symmetry of rows, columns or channels; below the brightest code.
PATTERN = np.arange(18).reshape(2, 3, 3) * 12 + 5


def chunk(name, body):
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def png(image, *chunks):
    """OpenCV's PNG of an RGB[A] or grey image, with chunks put after IHDR."""
    image = image[..., [2, 1, 0, 3][: image.shape[2]]] if image.ndim == 3 else image
    data = cv2.imencode(".png", image)[1].tobytes()
    return data[:33] + b"".join(chunks) + data[33:]


def tga(kind, bits, descriptor, body, columns=3, rows=2):
    return struct.pack("<BBBHHBHHHHBB", 0, 0, kind, 0, 0, 0, 0, 0, columns, rows, bits, descriptor) + body


# What is written is read back


@pytest.mark.parametrize("suffix", [".exr", ".hdr", ".pic", ".pfm", ".tif", ".TIFF", ".png"])
def test_every_format_keeps_orientation_and_channels(tmp_path, suffix):
    image = PATTERN / 256
    gn.write_image(tmp_path / f"a{suffix}", image)
    # Eight bits of sRGB: half a code is .002, times the slope of the curve, below 2.3. RGBE: 1/256 of the largest.
    np.testing.assert_allclose(gn.read_image(tmp_path / f"a{suffix}"), image, atol=0.0045)
    info = gn.image_info(tmp_path / f"a{suffix}")
    assert (info.rows, info.columns) == (2, 3) and set(info.channels) == {"R", "G", "B"}


@pytest.mark.filterwarnings("ignore::gonio.errors.ClippedWarning")
@pytest.mark.parametrize("suffix", [".png", ".tif"])
@pytest.mark.parametrize(("bits", "dtype"), [(8, np.uint8), (16, np.uint16)])
@pytest.mark.parametrize("encoding", ["srgb", "linear", 2.2])
def test_every_code_of_8_and_16_bits_survives_a_round_trip(tmp_path, suffix, bits, dtype, encoding):
    codes = np.arange(2**bits, dtype=dtype).reshape(16, -1)
    first = png(codes) if suffix == ".png" else None
    path = tmp_path / f"a{suffix}"
    path.write_bytes(first) if first else tifffile.imwrite(path, codes)
    image = gn.read_image(path, encoding)
    gn.write_image(path, image[..., 0], encoding, bits=bits)
    np.testing.assert_array_equal(read_raster(path).samples[..., 0], codes)


def test_16_bits_are_read_whole_and_red_first(tmp_path):
    codes = (PATTERN * 257 + 1).astype(np.uint16)
    expected = srgb_decode(codes / 65535)
    (tmp_path / "cv.png").write_bytes(png(codes))
    tifffile.imwrite(tmp_path / "tf.tif", codes, photometric="rgb")
    (tmp_path / "cv.tif").write_bytes(cv2.imencode(".tif", codes[..., ::-1])[1].tobytes())  # LZW
    for name in ("cv.png", "tf.tif", "cv.tif"):
        np.testing.assert_array_equal(read_raster(tmp_path / name).samples, codes)
        np.testing.assert_allclose(gn.read_image(tmp_path / name, "srgb"), expected, rtol=1e-7)


def test_other_readers_see_what_is_written(tmp_path):
    codes = (PATTERN * 257 + 1).astype(np.uint16)
    image = srgb_decode(codes / 65535)
    gn.write_image(tmp_path / "a.png", image, bits=16)
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED)[..., ::-1], codes)
    gn.write_image(tmp_path / "a.tif", image, bits=16)
    np.testing.assert_array_equal(tifffile.imread(tmp_path / "a.tif"), codes)
    gn.write_image(tmp_path / "b.tif", image)
    np.testing.assert_array_equal(tifffile.imread(tmp_path / "b.tif"), image.astype(np.float32))


@pytest.mark.parametrize("suffix", [".exr", ".hdr", ".pfm", ".tif", ".png"])
def test_grey_is_written_and_read_as_three_equal_channels(tmp_path, suffix):
    image = np.array([[0.0, 0.25], [0.5, 0.99]])
    for given in (image, image[..., None]):
        gn.write_image(tmp_path / f"a{suffix}", given)
        got = gn.read_image(tmp_path / f"a{suffix}")
        np.testing.assert_allclose(got, np.repeat(image[..., None], 3, axis=2), atol=0.0045)


def test_pytorch_images_are_written_as_numpys_are(tmp_path):
    torch = pytest.importorskip("torch")
    image = torch.rand(4, 5, 3, requires_grad=True)
    gn.write_image(tmp_path / "a.exr", image)
    np.testing.assert_array_equal(gn.read_image(tmp_path / "a.exr"), image.detach().numpy())


# How codes stand for light


def test_codes_of_unknown_encoding_are_taken_for_srgb_aloud(tmp_path):
    codes = PATTERN.astype(np.uint8)
    (tmp_path / "a.png").write_bytes(png(codes))
    with pytest.warns(EncodingWarning, match=r"a\.png: the file does not say.*Say encoding='srgb'"):
        image = gn.read_image(tmp_path / "a.png")
    np.testing.assert_allclose(image, srgb_decode(codes / 255), rtol=1e-7)
    # An encoding that is given is believed without a word.
    np.testing.assert_allclose(gn.read_image(tmp_path / "a.png", "linear"), codes / 255, rtol=1e-7)
    np.testing.assert_allclose(gn.read_image(tmp_path / "a.png", 2.2), (codes / 255) ** 2.2, rtol=1e-6)


@pytest.mark.parametrize(
    ("chunks", "encoding"),
    [
        ([chunk(b"sRGB", b"\0")], "srgb"),
        ([chunk(b"gAMA", struct.pack(">I", 100000))], "linear"),
        ([chunk(b"gAMA", struct.pack(">I", 45455))], "srgb"),
        ([chunk(b"gAMA", struct.pack(">I", 50000))], 2.0),
        ([chunk(b"sRGB", b"\0"), chunk(b"gAMA", struct.pack(">I", 50000))], "srgb"),
        ([chunk(b"gAMA", struct.pack(">I", 50000)), chunk(b"sRGB", b"\0")], "srgb"),
    ],
)
def test_a_png_that_states_its_encoding_is_believed(tmp_path, chunks, encoding):
    codes = PATTERN.astype(np.uint8)
    (tmp_path / "a.png").write_bytes(png(codes, *chunks))
    assert gn.image_info(tmp_path / "a.png").encoding == encoding
    np.testing.assert_array_equal(gn.read_image(tmp_path / "a.png"), gn.read_image(tmp_path / "a.png", encoding))


@pytest.mark.parametrize("encoding", ["gamma", 0, -1.0, float("nan"), float("inf")])
def test_no_other_encoding_is_known(tmp_path, encoding):
    with pytest.raises(ParameterError, match="encoding must be"):
        gn.read_image(tmp_path / "a.png", encoding)
    with pytest.raises(ParameterError, match="encoding must be"):
        gn.write_image(tmp_path / "a.png", np.zeros((2, 2)), encoding)


# The kinds of PNG, TIFF, JPEG and Targa


def test_transparency_is_left_out_aloud_and_opacity_silently(tmp_path):
    codes = np.dstack([PATTERN, np.full((2, 3), 255)]).astype(np.uint8)
    (tmp_path / "opaque.png").write_bytes(png(codes))
    np.testing.assert_array_equal(read_raster(tmp_path / "opaque.png").samples, PATTERN)
    assert gn.read_image(tmp_path / "opaque.png", "linear").shape == (2, 3, 3)
    codes[0, 0, 3] = 254
    (tmp_path / "a.png").write_bytes(png(codes))
    tifffile.imwrite(tmp_path / "a.tif", codes, photometric="rgb", extrasamples=["unassalpha"])
    (tmp_path / "a.tga").write_bytes(tga(2, 32, 0x28, codes[..., [2, 1, 0, 3]].tobytes()))
    for name in ("a.png", "a.tif", "a.tga"):
        with pytest.warns(AlphaWarning, match=rf"{name}: transparency was left out"):
            image = gn.read_image(tmp_path / name, "linear")
        np.testing.assert_allclose(image, PATTERN / 255, rtol=1e-6)


def test_palettes_and_few_bits_are_spread_out(tmp_path):
    # A PNG of two bits: IHDR, a palette of four colours, one row of four pixels 0 1 2 3.
    palette = bytes([10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 120])
    for kind, extra, expected in ((3, chunk(b"PLTE", palette), palette), (0, b"", bytes([0, 85, 170, 255]))):
        data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 4, 1, 2, kind, 0, 0, 0)) + extra
        (tmp_path / "a.png").write_bytes(data + chunk(b"IDAT", zlib.compress(b"\0\x1b")) + chunk(b"IEND", b""))
        assert read_raster(tmp_path / "a.png").samples.tobytes() == expected


def test_the_orientation_tag_of_a_tiff_turns_it_upright(tmp_path):
    codes = PATTERN.astype(np.uint8)
    # TIFF 6.0: the tag names where row 0 and column 0 of the stored pixels stand in the picture.
    stored = {1: codes, 2: codes[:, ::-1], 3: codes[::-1, ::-1], 4: codes[::-1]}
    stored |= {k + 4: stored[m].swapaxes(0, 1) for k, m in ((1, 1), (2, 2), (3, 3), (4, 4))}
    stored = {k: v if k < 5 else {5: stored[5], 6: stored[6], 7: stored[7], 8: stored[8]}[k] for k, v in stored.items()}
    for orientation, pixels in stored.items():
        path = tmp_path / f"{orientation}.tif"
        tifffile.imwrite(
            path, np.ascontiguousarray(pixels), photometric="rgb", extratags=[(274, 3, 1, orientation, True)]
        )
        np.testing.assert_array_equal(read_raster(path).samples, codes, err_msg=f"orientation {orientation}")
        assert (gn.image_info(path).rows, gn.image_info(path).columns) == (2, 3)


def test_tiffs_that_tifffile_leaves_to_opencv_are_turned_alike(tmp_path):
    pillow = pytest.importorskip("PIL.Image")
    codes = PATTERN.astype(np.uint8)
    stored = np.ascontiguousarray(codes[::-1].swapaxes(0, 1))  # orientation 6 or 8, by which corner comes first
    for orientation, expected in ((6, codes[::-1, ::-1]), (8, codes)):
        pillow.fromarray(stored).save(tmp_path / "a.tif", compression="tiff_lzw", tiffinfo={274: orientation})
        np.testing.assert_array_equal(read_raster(tmp_path / "a.tif").samples, expected)
    pillow.fromarray(np.dstack([codes, codes[..., 0]])).save(tmp_path / "b.tif", compression="tiff_lzw")
    with pytest.raises(FileError, match=r"b\.tif: alpha is not read from LZW TIFF\. Save it deflated"):
        gn.read_image(tmp_path / "b.tif")


def test_separate_planes_and_big_endian_tiffs_are_read(tmp_path):
    image = PATTERN.astype(np.float32)
    tifffile.imwrite(tmp_path / "a.tif", np.moveaxis(image, -1, 0), photometric="rgb", planarconfig="separate")
    tifffile.imwrite(tmp_path / "b.tif", image, photometric="rgb", byteorder=">")
    tifffile.imwrite(tmp_path / "c.tif", image, photometric="rgb", bigtiff=True, compression="zlib")
    (tmp_path / "d.tif").write_bytes(cv2.imencode(".tif", image[..., ::-1])[1].tobytes())
    for name in ("a.tif", "b.tif", "c.tif", "d.tif"):
        np.testing.assert_array_equal(gn.read_image(tmp_path / name), image)


def test_tiffs_of_another_kind_are_refused(tmp_path):
    codes = PATTERN.astype(np.uint8)
    tifffile.imwrite(tmp_path / "pages.tif", np.stack([codes, codes]), photometric="rgb")
    tifffile.imwrite(tmp_path / "white.tif", codes[..., 0], photometric="miniswhite")
    tifffile.imwrite(tmp_path / "signed.tif", codes[..., 0].astype(np.int16))
    tifffile.imwrite(tmp_path / "ink.tif", np.dstack([codes, codes[..., 0]]), photometric="separated")
    for name, message in (("pages", "has 2 pages"), ("white", "MINISWHITE"), ("signed", "int16"), ("ink", "SEPARATED")):
        with pytest.raises(FileError, match=rf"{name}\.tif.*{message}"):
            gn.read_image(tmp_path / f"{name}.tif")


def jpeg(image, orientation=None):
    data = cv2.imencode(".jpg", image[..., ::-1] if image.ndim == 3 else image, [cv2.IMWRITE_JPEG_QUALITY, 100])[1]
    if orientation is None:
        return data.tobytes()
    tags = b"MM\0*\0\0\0\x08\0\x01" + struct.pack(">HHIHxx", 274, 3, 1, orientation) + bytes(4)
    segment = b"Exif\0\0" + tags
    return data[:2].tobytes() + b"\xff\xe1" + struct.pack(">H", len(segment) + 2) + segment + data[2:].tobytes()


def test_a_jpeg_is_turned_upright_as_its_camera_says(tmp_path):
    # Smooth, so that the loss of JPEG is a code or two; red rises along rows, green along columns.
    rows, columns = np.mgrid[0:16, 0:32]
    codes = np.stack([rows * 8 + 40, columns * 4 + 40, 0 * rows + 90], axis=-1).astype(np.uint8)
    (tmp_path / "1.jpg").write_bytes(jpeg(codes))
    (tmp_path / "6.jpg").write_bytes(jpeg(np.rot90(codes), 6))  # the camera stood on its side: turn it clockwise
    for name in ("1.jpg", "6.jpg"):
        got = read_raster(tmp_path / name).samples
        np.testing.assert_allclose(got.astype(int), codes, atol=4)
        assert (gn.image_info(tmp_path / name).rows, gn.image_info(tmp_path / name).columns) == (16, 32)
    (tmp_path / "grey.jpg").write_bytes(jpeg(codes[..., 0]))
    assert read_raster(tmp_path / "grey.jpg").samples.shape == (16, 32, 1)


def test_targas_start_in_the_corner_that_they_name(tmp_path):
    codes = PATTERN.astype(np.uint8)
    for descriptor, stored in ((0, codes[::-1]), (32, codes), (16, codes[::-1, ::-1]), (48, codes[:, ::-1])):
        (tmp_path / "a.tga").write_bytes(tga(2, 24, descriptor, stored[..., ::-1].tobytes()))
        np.testing.assert_array_equal(read_raster(tmp_path / "a.tga").samples, codes)
    (tmp_path / "a.tga").write_bytes(tga(3, 8, 32, codes[..., 0].tobytes()))
    np.testing.assert_array_equal(read_raster(tmp_path / "a.tga").samples, codes[..., :1])


def test_packed_targas_are_unpacked(tmp_path):
    codes = np.array([[[1, 2, 3], [1, 2, 3], [4, 5, 6]], [[7, 8, 9], [7, 8, 9], [7, 8, 9]]], np.uint8)
    # Blue, green, red: two alike, one as it is, three alike.
    body = bytes([0x81, 3, 2, 1, 0x00, 6, 5, 4, 0x82, 9, 8, 7])
    (tmp_path / "a.tga").write_bytes(tga(10, 24, 32, body))
    np.testing.assert_array_equal(read_raster(tmp_path / "a.tga").samples, codes)


def test_a_fourth_byte_without_alpha_bits_means_nothing(tmp_path):
    codes = np.dstack([PATTERN[..., ::-1], np.zeros((2, 3))]).astype(np.uint8)
    (tmp_path / "a.tga").write_bytes(tga(2, 32, 32, codes.tobytes()))
    np.testing.assert_allclose(gn.read_image(tmp_path / "a.tga", "linear"), PATTERN / 255, rtol=1e-6)


# Data that cannot be trusted whole


def test_clipped_pixels_are_reported_with_their_share(tmp_path):
    codes = np.full((100, 100), 200, np.uint8)
    codes[0, :10] = 255
    (tmp_path / "a.png").write_bytes(png(codes))
    gn.read_image(tmp_path / "a.png", "linear")  # one in a thousand is a highlight
    codes[0, :11] = 255
    (tmp_path / "a.png").write_bytes(png(codes))
    with pytest.warns(ClippedWarning, match=r"a\.png: 0\.11% of the pixels are at 255, the most that"):
        gn.read_image(tmp_path / "a.png", "linear")


def test_negative_radiance_is_reported_and_kept(tmp_path):
    image = np.array([[[1.0, -0.5, 1.0], [1.0, 1.0, 1.0]]], np.float32)
    gn.write_image(tmp_path / "a.exr", image)
    with pytest.warns(NegativeWarning, match=r"50\.000% of the pixels are negative, down to -0\.5"):
        np.testing.assert_array_equal(gn.read_image(tmp_path / "a.exr"), image)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_the_first_pixel_that_is_no_number_is_named(tmp_path, bad):
    image = np.ones((4, 5, 3), np.float32)
    image[2, 3, 1] = bad
    tifffile.imwrite(tmp_path / "a.tif", image, photometric="rgb")
    with pytest.raises(FileError, match=rf"a\.tif: pixel \[2, 3\], channel 1, is {bad}; 1 samples are not finite"):
        gn.read_image(tmp_path / "a.tif")


def test_warnings_point_at_the_caller(tmp_path):
    (tmp_path / "a.png").write_bytes(png(np.full((4, 4), 255, np.uint8)))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        gn.read_image(tmp_path / "a.png")
    assert {w.category for w in caught} == {EncodingWarning, ClippedWarning}
    assert {w.filename for w in caught} == {__file__}


# What is not written


def test_values_beyond_the_display_are_refused_unless_clipped(tmp_path):
    image = np.zeros((2, 3, 3))
    image[1, 2, 0] = 1.5
    with pytest.raises(
        ArrayError, match=r"image\[1, 2, 0\] is 1\.5, outside 0 to 1\. Bring it to the display by tone_map"
    ):
        gn.write_image(tmp_path / "a.png", image)
    with pytest.raises(ArrayError, match=r"image\[1, 2, 0\] is -1\.5, outside 0 to 1"):
        gn.write_image(tmp_path / "a.png", -image)
    assert not any(tmp_path.iterdir())
    gn.write_image(tmp_path / "a.png", image - 0.1, clip=True)
    assert read_raster(tmp_path / "a.png").samples[1, 2].tolist() == [255, 0, 0]
    gn.write_image(tmp_path / "a.png", np.full((2, 2), 1 + 1e-7))  # rounds to 1


@pytest.mark.parametrize(
    ("name", "image", "options", "error", "message"),
    [
        ("a.hdr", [[-1.0]], {}, ArrayError, r"image\[0, 0, 0\] is -1, outside 0 to .*Write \.exr"),
        ("a.exr", [[np.nan]], {}, ArrayError, r"image\[0, 0, 0\] is nan"),
        ("a.exr", [[7e4]], {"bits": 16}, ArrayError, r"is 70000, outside -65504 to 65504\. Write more bits"),
        ("a.pfm", [[1e300]], {}, ArrayError, "outside"),
        ("a.exr", np.zeros((2, 2, 4)), {}, ArrayError, r"shape \(2, 2, 4\)"),
        ("a.exr", np.zeros((0, 2, 3)), {}, ArrayError, r"shape \(0, 2, 3\)"),
        ("a.exr", np.zeros((2, 2), complex), {}, ArrayError, "dtype complex128"),
        ("a.png", np.full((2, 2), 255, np.uint8), {}, ArrayError, "is 255, outside 0 to 1"),
        ("a.png", [[0.0]], {"bits": 32}, ParameterError, r"bits must be 8 or 16 for \.png, got 32"),
        ("a.exr", [[0.0]], {"encoding": "srgb"}, ParameterError, r"floats in \.exr are linear"),
        ("a.jpg", [[0.0]], {}, FileError, r"a\.jpg: images are written as \.exr"),
        ("a", [[0.0]], {}, FileError, "not without suffix"),
        ("none/a.exr", [[0.0]], {}, FileError, "does not exist"),
    ],
)
def test_what_cannot_be_written_is_refused_before_a_file_appears(tmp_path, name, image, options, error, message):
    with pytest.raises(error, match=message):
        gn.write_image(tmp_path / name, image, **options)
    assert not any(tmp_path.iterdir())


# Real files


def dng(path, colour):
    """A uniform colour behind a Bayer mosaic; a camera whose colours are linear sRGB's, saturated at 4000."""
    mosaic = np.empty((32, 48), np.uint16)
    for row, column, channel in ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)):
        mosaic[row::2, column::2] = colour[channel] * 4000
    xyz_to_rgb = [32404542, -15371385, -4985314, -9692660, 18760108, 415560, 556434, -2040259, 10572252]
    matrix = tuple(k for m in xyz_to_rgb for k in (m, 10**7))
    tags = [(50706, 1, 4, (1, 4, 0, 0)), (33421, 3, 2, (2, 2)), (33422, 1, 4, (0, 1, 1, 2)), (50714, 3, 1, 0)]
    tags += [(50717, 3, 1, 4000), (50721, 10, 9, matrix), (50728, 5, 3, (1, 1, 1, 1, 1, 1)), (50778, 3, 1, 21)]
    tags += [(50708, 2, 6, "gonio")]
    tifffile.imwrite(path, mosaic, photometric=32803, extratags=[(*tag, True) for tag in tags], metadata=None)


def test_camera_raw_is_linear_from_black_to_saturation(tmp_path):
    pytest.importorskip("rawpy")
    dng(tmp_path / "a.dng", (0.2, 0.5, 0.3))
    dng(tmp_path / "a.tif", (0.2, 0.5, 0.3))  # a raw file under another name is still one
    for name in ("a.dng", "a.tif"):
        # LibRaw's fixed-point matrix and 16-bit output are right to some codes.
        np.testing.assert_allclose(
            gn.read_image(tmp_path / name)[8:-8, 8:-8], np.full((16, 32, 3), (0.2, 0.5, 0.3)), atol=2e-4
        )
        assert gn.image_info(tmp_path / name).format == "camera raw"


def test_camera_raw_names_the_extra_that_it_needs(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rawpy", None)  # as where it is not installed
    (tmp_path / "a.nef").write_bytes(bytes(60))
    with pytest.raises(MissingExtraError, match=r"a\.nef is a camera's raw file.*pip install 'gonio\[raw\]'"):
        gn.read_image(tmp_path / "a.nef")


@pytest.mark.parametrize("folder", ["probes", "hdri", "environments", "rti/synth", "photometric"])
def test_every_image_of_the_data_folder_opens(data, folder):
    names = [
        p for p in sorted((data / folder).rglob("*")) if p.suffix.lower() in (".hdr", ".exr", ".jpg", ".png", ".tga")
    ]
    assert names
    for path in names:
        info = gn.image_info(path)
        assert read_raster(path).samples.shape[:2] == (info.rows, info.columns), path


def test_opencv_reads_the_same_radiance_from_the_probes(data):
    for path in (data / "probes" / "rnl_probe.hdr", data / "hdri" / "venice_sunset_1k.hdr"):
        np.testing.assert_array_equal(gn.read_image(path), cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., ::-1])


def test_a_rendered_normal_map_has_16_bits_and_unit_normals(data):
    path = sorted((data / "rti" / "synth").rglob("normals.png"))[0]
    raster = read_raster(path)
    assert raster.samples.dtype == np.uint16
    lengths = np.linalg.norm(raster.samples / 65535 * 2 - 1, axis=-1)
    # Cut to 8 bits, the error would be some .003.
    assert np.median(np.abs(lengths - 1)) < 1e-4
