"""`gonio merge` and `gonio flat`: a bracket of photographs, its response, and the vignetting of the lens."""

from __future__ import annotations

import json
import struct

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose
from reference.verbs import run

import gonio as gn
from gonio.colour import srgb_encode
from gonio.files.responses import read_response

TIMES = (1 / 250, 1 / 80, 1 / 15, 1 / 4, 1)
TYPED = "1/250,1/80,1/15,0.25,1"
GAIN, READ = 5e-5, 1e-3
SIZE = (100, 120)


def film(exposure):
    """A curve of no standard: softer than sRGB at its shoulder."""
    return 1.1 * srgb_encode(exposure) / (1 + 0.1 * srgb_encode(exposure))


def codes(rng, exposure, curve):
    electrons = rng.poisson(exposure / GAIN) + READ / GAIN * rng.normal(size=exposure.shape)
    return np.floor(curve(np.clip(electrons * GAIN, 0, 1)) * 255 + 0.5).astype(np.uint8)


@pytest.fixture
def truth(rng):
    """Radiance from .05 to 200, from what no exposure clips to what all but the shortest do."""
    return np.exp(rng.uniform(np.log(0.05), np.log(200), (*SIZE, 3)))


@pytest.fixture
def bracket(tmp_path, rng, truth):
    """Files of a camera that has its own curve."""
    truth[:2] = 900
    for k, t in enumerate(TIMES):
        cv2.imwrite(str(tmp_path / f"b{k}.png"), codes(rng, truth * t, film)[..., ::-1])
    return [tmp_path / f"b{k}.png" for k in range(len(TIMES))]


def test_a_bracket_gives_the_response_and_radiance_as_well_known_as_it_says(capsys, tmp_path, bracket, truth):
    out, response, picture = tmp_path / "radiance.exr", tmp_path / "response.toml", tmp_path / "plot.png"
    code, text, err = run(
        capsys, "merge", *bracket, "-o", out, "--times", TYPED, "--recover", response, "--noise", f"{GAIN},{READ}",
        "--picture", picture, "--json",
    )  # fmt: skip
    assert (code, err) == (0, "")
    facts = json.loads(text)
    assert facts["times"] == pytest.approx(TIMES)
    assert facts["times from"] == "--times"
    assert facts["saturated"] == pytest.approx(0.02, abs=0.002)
    assert facts["residual of the response"] < 0.05
    assert gn.image_info(picture).columns > 1000
    found = read_response(response).log_exposure
    # What film() does, inverted by a table.
    exposure = np.linspace(0, 1, 100001)
    expected = np.interp(np.arange(256) / 255, film(exposure), exposure)
    # 24,000 samples of 2 % noise, and brackets of uneven ratios: to 5 %, mostly at the dark end, and .6 % rms.
    off = found[20:250] - np.log(expected[20:250, None])
    assert np.abs(off).max() < 0.05
    assert np.sqrt(np.mean(off**2)) < 0.01
    layers = gn.read_layers(out)
    assert layers["saturated"][:2].all()
    assert layers["saturated"][2:].sum() == 0
    good = layers["saturated"] == 0
    off = (layers["RGB"] - truth)[good]
    # The brightest code leaves a factor open, here by .2 %. 36,000 samples; codes cut off noise below black.
    assert_allclose(np.median(off / truth[good]), 0, atol=0.005)
    assert 0.85 < np.mean((off / layers["deviation"][good]) ** 2) < 1.1
    assert_allclose(gn.read_image(out), layers["RGB"])
    # The same by the file, without recovering.
    code, text, _ = run(
        capsys, "merge", *bracket, "-o", tmp_path / "again.exr", "--times", TYPED, "--response", response,
        "--noise", f"{GAIN},{READ}",
    )  # fmt: skip
    assert code == 0
    assert "2.000% of the pixels saturated" in text
    assert_allclose(gn.read_image(tmp_path / "again.exr"), layers["RGB"], rtol=1e-5)


def exposed(path, image, seconds, iso):
    """A JPEG with an EXIF segment that was put there by hand: ExposureTime and PhotographicSensitivity."""
    _, whole = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 100])
    exif = b"Exif\0\0II*\0" + struct.pack("<IHHHIIIH", 8, 1, 0x8769, 4, 1, 26, 0, 2)
    exif += struct.pack("<HHII", 0x829A, 5, 1, 56) + struct.pack("<HHIHH", 0x8827, 3, 1, iso, 0)
    exif += struct.pack("<III", 0, *seconds)
    segment = b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif
    path.write_bytes(b"\xff\xd8" + segment + whole.tobytes()[2:])
    return path


@pytest.mark.filterwarnings("default::gonio.errors.EncodingWarning")
def test_times_come_from_exif_where_none_are_typed(capsys, tmp_path):
    files = []
    # 4, 16 and 64 times as long: 1/80 s, 1/20, 1/20 at four times the ISO.
    for k, (seconds, iso, factor) in enumerate((((1, 80), 100, 1), ((1, 20), 100, 4), ((1, 20), 400, 16))):
        grey = np.full((16, 16, 3), np.uint8(255 * srgb_encode(0.05 * factor)))
        files.append(exposed(tmp_path / f"e{k}.jpg", grey, seconds, iso))
    code, text, _ = run(capsys, "merge", *files, "-o", tmp_path / "out.exr", "--encoding", "srgb", "--json")
    facts = json.loads(text)
    assert code == 0
    assert facts["times"] == pytest.approx([1 / 80, 1 / 20, 1 / 5])
    assert "ISO differs" in facts["times from"]
    # .05 of full scale in 1/80 s; JPEG codes are right to one.
    assert_allclose(gn.read_image(tmp_path / "out.exr"), 4, rtol=0.02)
    code, _, err = run(capsys, "merge", *files[:2], "-o", tmp_path / "out.exr")
    assert code == 0
    assert "taken for sRGB. Say --encoding or --response" in err


def test_the_vignetting_of_a_white_target_is_divided_out(capsys, tmp_path):
    y, x = np.meshgrid(np.linspace(-0.6, 0.6, 90), np.linspace(-0.8, 0.8, 120), indexing="ij")
    vignette = np.cos(np.arctan(0.7 * np.hypot(x, y))) ** 4
    gn.write_image(tmp_path / "white.png", 0.8 * vignette, "linear", bits=16)
    vignetting = tmp_path / "vignetting.exr"
    code, text, err = run(capsys, "flat", tmp_path / "white.png", "-o", vignetting)
    assert (code, err) == (0, "")
    corner = float(vignette[0, 0] / vignette.max())
    assert f"corners keep {corner:.2f}" in text
    # As `flat_field` promises: half a percent.
    assert_allclose(gn.read_image(vignetting)[..., 1], vignette / vignette.max(), rtol=0.005)
    for k, factor in enumerate((0.2, 0.9)):
        gn.write_image(tmp_path / f"v{k}.png", factor * vignette, "linear", bits=16)
    photographs = [tmp_path / f"v{k}.png" for k in range(2)]
    code, _, _ = run(
        capsys, "merge", *photographs, "-o", tmp_path / "even.exr", "--times", ".2,.9", "--vignetting", vignetting
    )
    assert code == 0
    assert_allclose(gn.read_image(tmp_path / "even.exr"), vignette.max(), rtol=0.006)
    # Merged exposures of a white target are a white target.
    run(capsys, "merge", *photographs, "-o", tmp_path / "white.exr", "--times", ".2,.9")
    code, _, _ = run(capsys, "flat", tmp_path / "white.exr", "-o", tmp_path / "again.exr")
    assert code == 0
    assert_allclose(gn.read_image(tmp_path / "again.exr"), gn.read_image(vignetting), rtol=0.001)


def test_what_does_not_fit_is_refused_in_one_line(capsys, tmp_path, bracket):
    gn.write_image(tmp_path / "white.png", np.ones((20, 20, 3)))
    gn.write_image(tmp_path / "small.exr", np.ones((20, 20, 3)))
    rough = np.random.default_rng(5).uniform(0.1, 0.9, (20, 20, 3))
    gn.write_image(tmp_path / "rough.png", rough)
    (tmp_path / "bad.toml").write_text("version = 3\n")
    merge, out = ("merge", *bracket), ("-o", tmp_path / "out.exr")
    timed = (*merge, "--times", TYPED)
    for arguments, message in (
        ((*merge, *out), "b0.png says no exposure time"),
        ((*merge, *out, "--times", "1,2"), "has 2 times for 5 photographs"),
        ((*merge, *out, "--times", "1,2,x,4,5"), "seconds such as 1/250"),
        ((*merge, *out, "--times", "1,2,1/0,4,5"), "seconds such as 1/250"),
        ((*merge, *out, "--times", "1,2,3,4,-5"), "seconds above 0"),
        ((*timed, "-o", tmp_path / "out.png"), "end its name in .exr"),
        ((*timed, *out, "--recover", tmp_path / "r.txt"), "end its name in .toml"),
        ((*timed, *out, "--recover", tmp_path / "r.toml", "--encoding", "srgb"), "give one of them"),
        ((*timed, *out, "--response", tmp_path / "bad.toml"), "version = 3; 1 is wanted"),
        ((*timed, *out, "--encoding", "raw"), "--encoding raw"),
        ((*timed, *out, "--noise", "1"), "gain,read is wanted"),
        ((*timed, *out, "--noise", "0,1"), "gain must be positive"),
        ((*timed, *out, "--vignetting", tmp_path / "small.exr"), r"vignetting has shape (20, 20, 3)"),
        (("merge", bracket[0], tmp_path / "small.exr", *out, "--times", "1,2"), "small.exr has 20 x 20 pixels"),
        (("merge", bracket[4], bracket[0], *out, "--times", "1,2", "--recover", tmp_path / "r.toml"), "codes fall"),
        (("flat", tmp_path / "white.png", *out), "100.00% of its pixels are clipped"),
        (("flat", tmp_path / "rough.png", *out, "--encoding", "srgb"), "no photograph of an even target"),
        (("flat", tmp_path / "white.png", "-o", tmp_path / "out.png"), "end its name in .exr"),
        (("flat", tmp_path / "small.exr", *out, "--response", tmp_path / "bad.toml"), "leave --response out"),
    ):
        code, _, err = run(capsys, *arguments)
        assert (code, err.count("\n")) == (2, 1), err
        assert message in err
    assert not (tmp_path / "out.exr").exists()
    assert not (tmp_path / "r.toml").exists()
