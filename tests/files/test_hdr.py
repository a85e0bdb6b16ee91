"""Radiance pictures."""

import numpy as np
import pytest
from reference import runs

import gonio as gn
from gonio._kernels.runs import decode_radiance, decode_targa
from gonio.errors import FileError

PATTERN = np.array([[1.0, 2.0, 4.0], [8.0, 16.0, 32.0]])[..., None] * np.array([1.0, 0.5, 0.25])


def picture(header, resolution, body):
    return b"#?RADIANCE\n" + header + b"\n" + resolution + b"\n" + body


def rgbe(image):
    """Powers of two, as bytes: mantissa 128 for the largest channel."""
    exponent = np.log2(image.max(-1)).astype(int) + 1
    mantissas = image * 256 / 2.0 ** exponent[..., None]
    return np.concatenate([mantissas, exponent[..., None] + 128], axis=-1).astype(np.uint8)


def coded(pixels, rng):
    """Lines of (lines, length, 4) in the new code, runs and literals mixed at random."""
    out = bytearray()
    for line in pixels:
        out += bytes([2, 2, len(line) // 256, len(line) % 256])
        for channel in line.T:
            at = 0
            while at < len(channel):
                same = 1
                while at + same < len(channel) and same < 127 and channel[at + same] == channel[at]:
                    same += 1
                if same > 1 and rng.random() < 0.8:
                    out += bytes([128 + same, channel[at]])
                    at += same
                else:
                    count = min(int(rng.integers(1, 129)), len(channel) - at)
                    out += bytes([count]) + channel[at : at + count].tobytes()
                    at += count
    return bytes(out)


def test_the_decoder_agrees_with_its_plain_twin(rng):
    for length in (8, 100, 300):
        pixels = np.repeat(rng.integers(0, 256, (5, length // 4, 4), dtype=np.uint8), 4, axis=1)
        data = coded(pixels, rng)
        out = np.empty_like(pixels)
        assert decode_radiance(np.frombuffer(data, np.uint8), out) == len(data)
        np.testing.assert_array_equal(out, pixels)
        np.testing.assert_array_equal(out, runs.radiance(data, *pixels.shape[:2]))


def test_runs_of_the_old_code_are_digits_of_one_count():
    # 1 + 3 + 2 * 256 + 1 pixels: one, its run of 3 + 2 * 256 in two digits, and another.
    data = bytes([9, 8, 7, 130, 1, 1, 1, 3, 1, 1, 1, 2, 200, 100, 50, 129])
    out = np.empty((1, 517, 4), np.uint8)
    assert decode_radiance(np.frombuffer(data, np.uint8), out) == len(data)
    np.testing.assert_array_equal(out, runs.radiance(data, 1, 517))
    assert out[0, 515].tolist() == [9, 8, 7, 130] and out[0, 516].tolist() == [200, 100, 50, 129]


def test_every_cut_of_a_stream_is_noticed(rng):
    pixels = np.repeat(rng.integers(0, 256, (2, 5, 4), dtype=np.uint8), 4, axis=1)
    data = coded(pixels, rng)
    for end in range(len(data)):
        assert decode_radiance(np.frombuffer(data[:end], np.uint8), np.empty_like(pixels)) == -1
    packets = bytes([0x83, 1, 2, 3, 0x01, 4, 5, 6, 7, 8, 9])
    assert decode_targa(np.frombuffer(packets, np.uint8), np.empty((6, 3), np.uint8)) == len(packets)
    for end in range(len(packets)):
        assert decode_targa(np.frombuffer(packets[:end], np.uint8), np.empty((6, 3), np.uint8)) == -1


def test_streams_of_noise_never_run_past_their_image(rng):
    for _ in range(300):
        data = rng.integers(0, 256, 400, dtype=np.uint8)
        data[:4] = [2, 2, 0, 16]
        data[4::2] = rng.choice(np.array([1, 2, 4, 129, 132, 255], np.uint8), 198)
        guard = np.full((3, 3, 16, 4), 77, np.uint8)
        assert decode_radiance(data, guard[1]) <= len(data)
        assert np.all(guard[[0, 2]] == 77)


@pytest.mark.parametrize("order", ["-Y+X", "-Y-X", "+Y+X", "+Y-X", "+X-Y", "-X-Y", "+X+Y", "-X+Y"])
def test_all_eight_orders_of_scanlines_show_the_same_picture(tmp_path, order):
    stored = PATTERN
    if "+Y" in order:  # Y grows upwards: the first line is the lowest
        stored = stored[::-1]
    if "-X" in order:
        stored = stored[:, ::-1]
    sizes = {"Y": 2, "X": 3}
    if order[1] == "X":
        stored = stored.swapaxes(0, 1)
    line = f"{order[:2]} {sizes[order[1]]} {order[2:]} {sizes[order[3]]}".encode()
    (tmp_path / "a.hdr").write_bytes(picture(b"FORMAT=32-bit_rle_rgbe\n", line, rgbe(stored).tobytes()))
    np.testing.assert_array_equal(gn.read_image(tmp_path / "a.hdr"), PATTERN)


def test_exposures_multiply_and_are_divided_out(tmp_path):
    # Radiance reference manual: EXPOSURE and COLORCORR are multipliers that were applied, and they accumulate.
    head = b"EXPOSURE=2\nEXPOSURE= 4.0\nCOLORCORR=1 2 4\n"
    (tmp_path / "a.hdr").write_bytes(picture(head, b"-Y 2 +X 3", rgbe(PATTERN).tobytes()))
    np.testing.assert_allclose(gn.read_image(tmp_path / "a.hdr"), PATTERN / 8 / [1, 2, 4], rtol=1e-7)


def test_an_exposure_of_nought_means_unknown(tmp_path):
    (tmp_path / "a.hdr").write_bytes(picture(b"GAMMA=1\nEXPOSURE=0\n", b"-Y 2 +X 3", rgbe(PATTERN).tobytes()))
    np.testing.assert_array_equal(gn.read_image(tmp_path / "a.hdr"), PATTERN)


def test_a_round_trip_is_right_to_half_a_mantissa(tmp_path, rng):
    image = np.exp(rng.normal(0, 15, (50, 40, 1)) + rng.normal(0, 1, (50, 40, 3)))
    image[0, :3] = [[0, 0, 0], [255.6, 0.1, 1e-30], [511.9, 511.9, 0]]  # black, and mantissas that round up to 256
    gn.write_image(tmp_path / "a.hdr", image)
    largest = image.max(axis=-1, keepdims=True)
    # Mantissas of the largest channel are 128 at least; half of one code is 1/256 of it.
    assert np.all(np.abs(gn.read_image(tmp_path / "a.hdr") - image) <= largest * (1 / 256 + 1e-7))


def test_the_ends_of_the_range(tmp_path):
    image = np.array([[[2.0**-150] * 3, [2.0**-128, 0, 0], [255 * 2.0**119] * 3]])
    gn.write_image(tmp_path / "a.hdr", image)
    np.testing.assert_array_equal(gn.read_image(tmp_path / "a.hdr"), [[[0] * 3, image[0, 1], image[0, 2]]])


def test_opencv_and_gonio_read_each_other(tmp_path, rng):
    cv2 = pytest.importorskip("cv2")
    image = rng.exponential(1.0, (21, 34, 3)).astype(np.float32)
    path = str(tmp_path / "a.hdr")
    gn.write_image(path, image)
    np.testing.assert_array_equal(cv2.imread(path, cv2.IMREAD_UNCHANGED)[..., ::-1], gn.read_image(path))
    cv2.imwrite(path, image[..., ::-1])  # run-length coded
    np.testing.assert_array_equal(cv2.imread(path, cv2.IMREAD_UNCHANGED)[..., ::-1], gn.read_image(path))


@pytest.mark.parametrize(
    ("head", "line", "message"),
    [
        (b"FORMAT=32-bit_rle_xyze\n", b"-Y 2 +X 3", "xyze is not read"),
        (b"GAMMA=2.2\n", b"-Y 2 +X 3", "GAMMA=2.2, but Radiance pictures are linear"),
        (b"EXPOSURE=bright\n", b"-Y 2 +X 3", "EXPOSURE=bright in the header, expected 1 number"),
        (b"EXPOSURE=-1\n", b"-Y 2 +X 3", "EXPOSURE=-1"),
        (b"COLORCORR=1 0 1\n", b"-Y 2 +X 3", "takes a channel away"),
        (b"", b"-Y 2 +Y 3", "resolution line"),
        (b"", b"2 3", "resolution line"),
        (b"", b"-Y 0 +X 3", "0 rows"),
        (b"", b"-Y 999999 +X 999999", "more than"),
        (b"", b"-Y 2 +X 4", "cut short"),
    ],
)
def test_headers_that_mislead_are_refused(tmp_path, head, line, message):
    (tmp_path / "a.hdr").write_bytes(picture(head, line, rgbe(PATTERN).tobytes()))
    with pytest.raises(FileError, match=rf"a\.hdr.*{message}"):
        gn.read_image(tmp_path / "a.hdr")
