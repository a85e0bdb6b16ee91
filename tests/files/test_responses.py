"""Responses of cameras in files."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn
from gonio.capture.exposure import Response
from gonio.files.responses import read_response, write_response


@pytest.mark.parametrize(
    "response",
    [
        Response.srgb(),
        Response(np.log(np.linspace([0.1, 0.2, 0.3], 1, 64)), 1024, 0.0123),
        Response([[-np.inf, -np.inf, -1.0], [0.0, 1e-12, 2.0]], 3),
    ],
    ids=["srgb", "levels of many codes", "short"],
)
def test_a_response_comes_back_as_written(tmp_path, response):
    write_response(tmp_path / "response.toml", response)
    again = read_response(tmp_path / "response.toml")
    # Nine digits.
    assert_allclose(again.log_exposure, response.log_exposure, rtol=1e-8)
    assert (again.step, again.residual) == (response.step, pytest.approx(response.residual, rel=1e-5))


def test_what_a_person_writes_is_read(tmp_path):
    (tmp_path / "two.toml").write_text("# linear, one bit\nversion = 1\nlog_exposure = [[-inf], [0]]\n")
    response = read_response(tmp_path / "two.toml")
    assert response.step == 1
    assert_allclose(response.linear(np.array([[[0], [1]]])), [[[0], [1]]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("version = 1\nlog_exposure = [", "is no TOML"),
        ("log_exposure = [[0], [1]]\n", "has no version; 1 is wanted"),
        ("version = 2\nlog_exposure = [[0], [1]]\n", "version = 2; 1 is wanted"),
        ("version = true\nlog_exposure = [[0], [1]]\n", "version = True; 1 is wanted"),
        ("version = 1\n", "has no log_exposure"),
        ("version = 1\nlog_exposure = [[0]]\n", r"log_exposure = \[\[0\]\]; a list of rows"),
        ("version = 1\nlog_exposure = [0, 1]\n", "log_exposure, row 0, is 0; 1 or 3 numbers"),
        ("version = 1\nlog_exposure = [[0, 1], [0, 1]]\n", "1 or 3 numbers"),
        ("version = 1\nlog_exposure = [[0], [1, 2]]\n", r"row 1, is \[1, 2\]; 1 numbers are wanted"),
        ("version = 1\nlog_exposure = [[0], ['x']]\n", "row 1, is"),
        ("version = 1\nlog_exposure = [[0], [-1]]\n", "falls from level 0 to 1 of channel 0"),
        ("version = 1\nlog_exposure = [[nan], [1]]\n", "has NaN"),
        ("version = 1\nlog_exposure = [[0], [inf]]\n", "infinite at its last level"),
        ("version = 1\nstep = 0\nlog_exposure = [[0], [1]]\n", "step = 0; a number of codes"),
        ("version = 1\nresidual = -1\nlog_exposure = [[0], [1]]\n", "residual = -1"),
        ("version = 1\ngamma = 2.2\nlog_exposure = [[0], [1]]\n", "the field gamma is not known"),
    ],
)
def test_files_that_are_no_response_are_refused_by_field(tmp_path, text, message):
    path = tmp_path / "response.toml"
    path.write_text(text)
    with pytest.raises(gn.GonioError, match=rf"response\.toml.*{message}"):
        read_response(path)


def test_files_that_are_missing_or_no_text_are_refused(tmp_path):
    (tmp_path / "image.toml").write_bytes(b"\x89PNG\r\n\x1a\n\0\xff")
    for name, message in (("absent.toml", "does not exist"), ("image.toml", "is no TOML"), ("", "is a folder")):
        with pytest.raises(gn.GonioError, match=message):
            read_response(tmp_path / name)
    with pytest.raises(gn.GonioError, match="does not exist"):
        write_response(tmp_path / "absent" / "response.toml", Response.srgb())
