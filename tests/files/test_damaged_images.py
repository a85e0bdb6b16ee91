"""Files that are cut short, damaged, enormous or no images: one FileError that names the file, and no memory taken."""

import struct
import tracemalloc
import warnings
import zlib

import numpy as np
import pytest

import gonio as gn
from gonio.errors import FileError

cv2 = pytest.importorskip("cv2")

# Smooth with some noise, so that every code has runs and literals; 8-bit codes for the rest.
IMAGE = (np.mgrid[0:24, 0:20].sum(axis=0)[..., None] + np.array([3, 5, 9])) / 64
CODES = np.rint(IMAGE * 200).astype(np.uint8)


def targa(codes):
    head = struct.pack("<BBBHHBHHHHBB", 0, 0, 2, 0, 0, 0, 0, 0, codes.shape[1], codes.shape[0], 24, 32)
    return head + codes[..., ::-1].tobytes()


def packed_targa(codes):
    head = struct.pack("<BBBHHBHHHHBB", 0, 0, 10, 0, 0, 0, 0, 0, codes.shape[1], codes.shape[0], 24, 32)
    return head + b"".join(bytes([0x80]) + bytes(pixel[::-1].tolist()) for pixel in codes.reshape(-1, 3))


@pytest.fixture(scope="session")
def whole(tmp_path_factory):
    """The bytes of a sound image in every format."""
    folder = tmp_path_factory.mktemp("whole")
    for name, options in (("a.exr", {}), ("a.hdr", {}), ("a.pfm", {}), ("a.png", {}), ("a.tif", {"bits": 16})):
        gn.write_image(folder / name, IMAGE, **options)
    files = {path.name: path.read_bytes() for path in folder.iterdir()}
    files["rle.hdr"] = cv2.imencode(".hdr", IMAGE.astype(np.float32))[1].tobytes()
    files["lzw.tif"] = cv2.imencode(".tif", CODES)[1].tobytes()
    files["a.jpg"] = cv2.imencode(".jpg", CODES)[1].tobytes()
    files["progressive.jpg"] = cv2.imencode(".jpg", CODES, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1].tobytes()
    files["a.tga"] = targa(CODES)
    files["packed.tga"] = packed_targa(CODES)
    return files


LINEAR = ["a.exr", "a.hdr", "rle.hdr", "a.pfm"]
NAMES = [*LINEAR, "a.png", "a.tif", "lzw.tif", "a.jpg", "progressive.jpg", "a.tga", "packed.tga"]


@pytest.mark.parametrize("name", NAMES)
def test_a_sound_file_is_read(tmp_path, whole, name):
    (tmp_path / name).write_bytes(whole[name])
    assert gn.read_image(tmp_path / name, None if name in LINEAR else "srgb").shape == (24, 20, 3)


@pytest.mark.parametrize("name", NAMES)
def test_every_cut_is_noticed(tmp_path, whole, name, capfd):
    data = whole[name]
    cuts = {0, 1, 2, 4, 8, 17, 18, 30, len(data) - 1, len(data) - 2} | set(range(40, len(data), len(data) // 12))
    for end in sorted(cuts):
        (tmp_path / name).write_bytes(data[:end])
        with pytest.raises(FileError, match=name):
            gn.read_image(tmp_path / name, "linear")
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", NAMES)
def test_any_byte_may_be_wrong(tmp_path, whole, name, rng):
    """Whatever a damaged file says, the answer is an image or a FileError, of the file and of its header alone."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gn.GonioWarning)
        for k in range(60):
            broken = bytearray(whole[name])
            at = rng.integers(0, min(len(broken), 300 if k % 2 else len(broken)))
            broken[at] ^= rng.integers(1, 256)
            (tmp_path / name).write_bytes(broken)
            for read in (gn.read_image, gn.image_info):
                try:
                    read(tmp_path / name)
                except FileError as error:
                    assert name in str(error)


def chunk(name, body):
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def png_of(rows, columns):
    pixels = chunk(b"IDAT", zlib.compress(bytes(100)))
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + pixels + chunk(b"IEND", b"")


def jpeg_of(rows, columns, data):
    at = data.index(b"\xff\xc0") + 5
    return data[:at] + struct.pack(">HH", rows, columns) + data[at + 4 :]


def tiff_of(rows, columns):
    tags = [(256, 4, columns), (257, 4, rows), (258, 3, 8), (259, 3, 8), (262, 3, 1), (273, 4, 8), (277, 3, 1)]
    tags += [(278, 4, rows), (279, 4, 50)]
    ifd = struct.pack("<H", len(tags)) + b"".join(
        struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags
    )
    return b"II*\0" + struct.pack("<I", 58) + bytes(50) + ifd + bytes(4)


# What fits a 32-bit header, and what fits the limit on samples but not the bytes that are there.
@pytest.mark.parametrize("size", [(60000, 60000), (17000, 20000)])
@pytest.mark.parametrize("name", ["a.hdr", "a.pfm", "a.png", "a.tif", "a.jpg", "a.tga"])
def test_sizes_are_checked_before_memory_is_taken(tmp_path, whole, name, size):
    rows, columns = size
    data = {
        "a.hdr": f"#?RADIANCE\n\n-Y {rows} +X {columns}\n".encode() + bytes(100),
        "a.pfm": f"PF\n{columns} {rows}\n-1\n".encode() + bytes(100),
        "a.png": png_of(rows, columns),
        "a.tif": tiff_of(rows, columns),
        "a.jpg": jpeg_of(rows, columns, whole["a.jpg"]),
        "a.tga": struct.pack("<BBBHHBHHHHBB", 0, 0, 2, 0, 0, 0, 0, 0, columns, rows, 24, 32) + bytes(100),
    }[name]
    (tmp_path / name).write_bytes(data)
    with pytest.raises(FileError, match=rf"{name}.*({rows} x {columns}|more than|cut short)"):
        gn.read_image(tmp_path / name)


def test_a_promise_of_pixels_takes_no_memory(tmp_path):
    (tmp_path / "a.tif").write_bytes(tiff_of(17000, 20000))
    (tmp_path / "a.png").write_bytes(png_of(17000, 20000))
    (tmp_path / "a.pfm").write_bytes(b"PF\n17000 20000\n-1\n" + bytes(100))
    for name in ("a.tif", "a.png", "a.pfm"):
        with pytest.raises(FileError):
            gn.read_image(tmp_path / name)  # once, for what importing the codec takes
        tracemalloc.start()
        with pytest.raises(FileError):
            gn.read_image(tmp_path / name)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < 2**20, name  # a thousandth of what the header promises


def test_what_is_no_image_is_refused_by_name(tmp_path):
    (tmp_path / "empty.exr").touch()
    (tmp_path / "text.png").write_text("a letter")
    (tmp_path / "folder.exr").mkdir()
    (tmp_path / "noise.hdr").write_bytes(bytes(range(200)))
    for name, message in (
        ("empty.exr", r"is empty \(0 bytes\)"),
        ("text.png", "is no image that gonio reads .*starts with b'a letter'"),
        ("folder.exr", "is a folder"),
        ("none.exr", "does not exist"),
        ("noise.hdr", "is no image"),
    ):
        for read in (gn.read_image, gn.image_info, gn.read_layers):
            with pytest.raises(FileError, match=rf"{name}:? {message}"):
                read(tmp_path / name)


def test_the_content_and_not_the_suffix_says_what_a_file_is(tmp_path, whole):
    (tmp_path / "a.exr").write_bytes(whole["a.png"])
    assert gn.image_info(tmp_path / "a.exr").format == "PNG"
    np.testing.assert_allclose(gn.read_image(tmp_path / "a.exr"), IMAGE, atol=0.005)
