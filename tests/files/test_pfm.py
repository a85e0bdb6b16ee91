"""Portable float maps."""

import numpy as np
import pytest

import gonio as gn
from gonio.errors import FileError

IMAGE = np.arange(18, dtype=np.float32).reshape(2, 3, 3)  # no symmetry of rows, columns or channels


@pytest.mark.parametrize(("scale", "dtype"), [(b"-1.0", "<f4"), (b"1", ">f4"), (b"-2.5", "<f4")])
def test_rows_run_upwards_and_the_sign_of_the_scale_is_the_byte_order(tmp_path, scale, dtype):
    body = IMAGE[::-1].astype(dtype).tobytes()
    (tmp_path / "a.pfm").write_bytes(b"PF\n3 2\n" + scale + b"\n" + body)
    np.testing.assert_array_equal(gn.read_image(tmp_path / "a.pfm"), IMAGE)
    assert gn.image_info(tmp_path / "a.pfm").attributes["scale"] == float(scale)


def test_grey_becomes_three_equal_channels(tmp_path):
    gn.write_image(tmp_path / "a.pfm", IMAGE[..., 0])
    assert (tmp_path / "a.pfm").read_bytes().startswith(b"Pf\n3 2\n-1.0\n")
    np.testing.assert_array_equal(gn.read_image(tmp_path / "a.pfm"), np.repeat(IMAGE[..., :1], 3, axis=2))


def test_opencv_and_gonio_read_each_other(tmp_path):
    cv2 = pytest.importorskip("cv2")
    path = str(tmp_path / "a.pfm")
    gn.write_image(path, IMAGE)
    np.testing.assert_array_equal(cv2.imread(path, cv2.IMREAD_UNCHANGED)[..., ::-1], IMAGE)
    cv2.imwrite(path, IMAGE[..., ::-1])
    np.testing.assert_array_equal(gn.read_image(path), IMAGE)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"PF\n3 2\n-1.0\n" + bytes(71), "need 72 bytes, there are 71"),
        (b"PF\n3 2\n-1.0\n" + bytes(73), "1 bytes follow the last pixel"),
        (b"PF\n3 2\n0\n" + bytes(72), "scale is 0"),
        (b"PF\n3 2\n1e999\n" + bytes(72), "scale is 1e999"),
        (b"PF\n3\n", "not the header of a PFM"),
        (b"PF\n0 2\n-1\n", "0 columns"),
        (b"PF\n9999999999 9999999999\n-1\n" + bytes(72), "more than"),
    ],
)
def test_headers_that_mislead_are_refused(tmp_path, data, message):
    (tmp_path / "a.pfm").write_bytes(data)
    with pytest.raises(FileError, match=rf"a\.pfm.*{message}"):
        gn.read_image(tmp_path / "a.pfm")
