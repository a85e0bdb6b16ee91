"""Captures of which every light was photographed at several exposures, and what EXIF says of these."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import gonio as gn
from gonio.capture.exposure import Noise, Response
from gonio.capture.photographs import Flattened, Held
from gonio.colour import srgb_encode
from gonio.files import store
from gonio.files.brackets import BracketFiles
from gonio.files.exif import exposure_settings, exposure_time, exposures
from gonio.files.png import write as write_png

TIMES = (1 / 250, 1 / 60, 1 / 15, 1 / 4)
SIZE = (60, 80)


def camera(rng, radiance, seconds, curve, noise, levels):
    """Codes of a sensor that counts electrons, adds read noise, clips, and puts `curve` on what is left."""
    full = 1 / noise.gain
    electrons = rng.poisson(radiance * seconds * full) + noise.read * full * rng.normal(size=radiance.shape)
    exposure = np.clip(electrons / full, 0, 1)
    return np.floor(curve(exposure) * (levels - 1) + 0.5).astype(np.uint8 if levels == 256 else np.uint16)


def save(path, codes, curve="srgb"):
    write_png(path, codes, curve)
    return path.name


def lights(rng, count=2):
    """Radiance from a thirtieth of what the shortest exposure clips down to nothing, and some beyond it."""
    every = np.exp(rng.uniform(np.log(0.01), np.log(200), (count, *SIZE, 3)))
    every[:, :3] = 0
    every[:, 3] = 600
    return every


CAMERAS = {
    "srgb, 8 bits": (srgb_encode, 256, "srgb"),
    "power, 8 bits": (lambda x: x ** (1 / 1.8), 256, 1.8),
    "linear, 8 bits": (lambda x: x, 256, "linear"),
    "linear, 16 bits": (lambda x: x, 65536, "linear"),
}


@pytest.mark.parametrize("name", CAMERAS)
@pytest.mark.parametrize(
    "noise", [Noise(1 / 20000, 1e-3), Noise(1 / 80000, 2e-4)], ids=["small sensor", "large sensor"]
)
def test_merged_radiance_is_as_far_off_the_truth_as_it_says(rng, tmp_path, name, noise):
    curve, levels, encoding = CAMERAS[name]
    truth = lights(rng)
    groups = [
        [save(tmp_path / f"l{k}e{j}.png", camera(rng, truth[k], t, curve, noise, levels)) for j, t in enumerate(TIMES)]
        for k in range(len(truth))
    ]
    brackets = BracketFiles(tmp_path, groups, TIMES, encoding, noise)
    assert brackets.names == ("l0e0.png", "l1e0.png")
    assert brackets.size == SIZE
    for k in range(2):
        merged = brackets.merged(k)
        photo = brackets.read(k)
        assert photo.radiance.dtype == np.float32
        assert_array_equal(photo.radiance, merged.radiance)
        assert_array_equal(photo.clipped, merged.saturated)
        assert photo.clipped[3].all()
        # A fifth of a standard deviation from clipping at 250, which is 1 there; noise is .7 %.
        assert not photo.clipped[4:].any()
        off = (merged.radiance - truth[k])[4:] ** 2 / merged.variance[4:]
        # 13,000 samples: chi^2 is known to 1.2 %. It is .92 to .99, since codes cut off noise below black.
        assert 0.9 < off.mean() < 1.1
        # The dark: codes cut off what lies below black, which is too bright by about half a standard deviation.
        dark = merged.radiance[:3] / np.sqrt(merged.variance[:3])
        assert 0 <= dark.mean() < 0.6
        assert (dark**2).mean() < 1.1


def test_rounding_counts_where_codes_are_coarser_than_noise():
    """Linear codes of 8 bits: their rounding, 1 / (255 sqrt 12), is ten times this sensor's noise in the dark."""
    noise = gn.capture.exposure.CodedNoise(1e-6, 1e-4, response=Response.power(1.0))
    variance = noise.variance(np.array([[[1e-3, 0.5, 1.0]]]))
    assert_allclose(variance, 1 / 255**2 / 12 + 1e-8 + 1e-6 * np.array([[[1e-3, 0.5, 1.0]]]), rtol=1e-6)
    # sRGB at its top: dX/dZ = 2.4 / 1.055 / 255, over one code.
    steep = gn.capture.exposure.CodedNoise(1e-12, 0.0, response=Response.srgb()).variance(np.ones((1, 1, 3)))
    assert_allclose(np.sqrt(steep), 2.4 / 1.055 / 255 / np.sqrt(12), rtol=0.01)


def bracket(folder, rng, response=None, count=3):
    """Three lights at four exposures of a scene without noise; groups of names, and the truth."""
    truth = np.exp(rng.uniform(np.log(2), np.log(100), (count, *SIZE, 3)))
    groups = []
    for k in range(count):
        codes = [np.floor(srgb_encode(np.clip(truth[k] * t, 0, 1)) * 255 + 0.5).astype(np.uint8) for t in TIMES]
        groups.append([save(folder / f"light{k}_{j}.png", z) for j, z in enumerate(codes)])
    return groups, truth


def test_a_recovered_response_stands_in_the_place_of_an_encoding(rng, tmp_path):
    groups, truth = bracket(tmp_path, rng)
    encoded, given = (BracketFiles(tmp_path, groups, TIMES, e) for e in ("srgb", Response.srgb()))
    assert_array_equal(given.read(1).radiance, encoded.read(1).radiance)
    assert given.encoding is None
    assert not given.assumed
    # Half a code of 22, the darkest that count alone: the shortest exposure, where another channel clips the next.
    assert_allclose(given.read(1).radiance, truth[1], rtol=0.035)
    # A curve with half the exposure at each code below the last makes half the radiance.
    half = Response(Response.srgb().log_exposure - np.log(2))
    other = BracketFiles(tmp_path, groups, TIMES, half).read(1)
    assert_allclose(other.radiance, encoded.read(1).radiance / 2, rtol=0.02)


def test_vignetting_is_divided_by(rng, tmp_path):
    groups, _ = bracket(tmp_path, rng)
    vignetting = rng.uniform(0.4, 1, (*SIZE, 3)).astype(np.float32)
    plain = BracketFiles(tmp_path, groups, TIMES, "srgb")
    divided = BracketFiles(tmp_path, groups, TIMES, "srgb", vignetting=vignetting)
    assert_allclose(divided.read(0).radiance, plain.read(0).radiance / vignetting, rtol=1e-6)
    assert_allclose(divided.merged(0).variance, plain.merged(0).variance / vignetting**2, rtol=1e-5)
    at = np.array([3, 81, 4799])
    assert_allclose(divided.pixels(at).radiance, plain.pixels(at).radiance / vignetting.reshape(-1, 3)[at], rtol=1e-6)
    held = Held(rng.random((2, *SIZE, 3)), white=0.9)
    grey = vignetting[..., :1]
    flat = Flattened(held, grey)
    assert_allclose(flat.read(1).radiance, held.radiance[1] / grey, rtol=1e-6)
    assert_array_equal(flat.read(1).clipped, held.read(1).clipped)
    assert_allclose(flat.pixels(at).radiance, held.pixels(at).radiance / grey.reshape(-1, 1)[at], rtol=1e-6)
    assert (flat.names, flat.size, len(flat)) == (held.names, held.size, 2)
    for wrong, message in (
        (vignetting[1:], r"shape \(59, 80, 3\); \(60, 80, 3\) is wanted"),
        (vignetting[..., 0], "is wanted"),
        (np.where(vignetting < 0.5, 0, vignetting), "a share of the light above 0 is wanted"),
        (vignetting * np.nan, "nan"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            Flattened(held, wrong)
        with pytest.raises(gn.GonioError, match=message):
            BracketFiles(tmp_path, groups, TIMES, vignetting=wrong)


def test_a_store_of_the_codes_gives_the_same_radiance(rng, tmp_path):
    groups, _ = bracket(tmp_path, rng, count=9)  # 36 photographs: the ninth light lies in a second chunk
    brackets = BracketFiles(tmp_path, groups, TIMES, "srgb", vignetting=np.full((*SIZE, 1), 0.7))
    store.ingest(brackets.files, tmp_path / store.STORE)
    found, why = store.stored(brackets.files)
    assert why == ""
    quick = brackets.over(found)
    assert quick.names == brackets.names
    for k in (0, 8):
        assert_array_equal(quick.read(k).radiance, brackets.read(k).radiance)
        assert_array_equal(quick.read(k).clipped, brackets.read(k).clipped)
    at = np.array([0, 79, 80, 4799])
    assert_array_equal(quick.pixels(at).radiance, brackets.pixels(at).radiance)
    assert_array_equal(quick.pixels(at).clipped, brackets.pixels(at).clipped)
    assert_array_equal(np.concatenate(list(quick.parts(np.arange(100), 40))), np.arange(100))
    with pytest.raises(gn.GonioError, match="of other photographs than these brackets"):
        BracketFiles(tmp_path, groups[1:], TIMES, "srgb").over(found)


def test_grey_photographs_become_three_equal_channels(rng, tmp_path):
    truth = rng.uniform(2, 100, (*SIZE, 1))
    names = [
        save(tmp_path / f"{j}.png", np.floor(np.clip(truth * t, 0, 1) * 65535 + 0.5).astype(np.uint16), "linear")
        for j, t in enumerate(TIMES)
    ]
    photo = BracketFiles(tmp_path, [names], TIMES).read(0)
    assert_allclose(photo.radiance, np.repeat(truth, 3, axis=2), rtol=1e-3)
    three = Response(np.repeat(Response.power(1.0, 65536).log_exposure, 3, axis=1))
    with pytest.raises(gn.GonioError, match=r"0.png: codes have shape \(60, 80, 1\)"):
        BracketFiles(tmp_path, [names], TIMES, three).read(0)


def test_brackets_that_do_not_fit_are_refused_by_name(rng, tmp_path):
    groups, _ = bracket(tmp_path, rng, count=2)
    gn.write_image(tmp_path / "float.exr", np.ones((*SIZE, 3)))
    gn.write_image(tmp_path / "small.png", np.ones((5, 8, 3)))
    gn.write_image(tmp_path / "deep.png", np.ones((*SIZE, 3)), bits=16)
    gn.write_image(tmp_path / "linear.png", np.ones((*SIZE, 3)), "linear")
    two = [["light0_0.png", "light0_1.png"]]
    for given, times, encoding, message in (
        ([groups[0], groups[1][:3]], TIMES, None, r"bracket 1 \(light1_0.png, light1_1.png, light1_2.png\) has 3 .* 4"),
        (groups, (0.1, 0.2, 0.3, 0.0), None, "positive numbers are wanted"),
        (groups, (), None, "positive numbers are wanted"),
        ([], TIMES, None, "no bracket"),
        ([groups[0], groups[0]], TIMES, None, "light0_0.png stands twice"),
        ([["light0_0.png", "float.exr"]], (1, 2), None, "float.exr has samples of float32, which have no known"),
        ([["light0_0.png", "small.png"]], (1, 2), None, "small.png has 5 x 8 pixels"),
        ([["light0_0.png", "deep.png"]], (1, 2), None, "mixes samples of uint16 and uint8"),
        ([["light0_0.png", "linear.png"]], (1, 2), None, "state different encodings"),
        ([["light0_0.png", "absent.png"]], (1, 2), None, "absent.png does not exist"),
        (two, (1, 2), Response.srgb(1024), "codes up to 255, but the response is of 1024"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            BracketFiles(tmp_path, given, times, encoding)
    few = BracketFiles(tmp_path, two, (1, 2), Response.power(1.0, 16))
    with pytest.raises(gn.GonioError, match=r"light0_0.png: codes run .* the response knows 0 to 15"):
        few.read(0)


def directory(order, seconds=None, aperture=None, iso=None, kind=3):
    """A TIFF directory with one Exif directory behind it, written by hand: rationals stand at its end."""
    tags = []
    if seconds:
        tags.append((0x829A, 5, seconds))
    if aperture:
        tags.append((0x829D, 5, aperture))
    if iso:
        tags.append((0x8827, kind, iso))
    head = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(order + "I", 8)
    first = struct.pack(order + "HHHII", 1, 0x8769, 4, 1, 26) + bytes(4)
    end = 26 + 2 + 12 * len(tags) + 4
    entries, values = b"", b""
    for tag, kind, value in tags:
        entries += struct.pack(order + "HHI", tag, kind, 1)
        if kind == 5:
            entries += struct.pack(order + "I", end + len(values))
            values += struct.pack(order + "II", *value)
        else:
            entries += struct.pack(order + "H2x" if kind == 3 else order + "I", value)
    return head + first + struct.pack(order + "H", len(tags)) + entries + bytes(4) + values


def jpeg(path, exif):
    """An EXIF segment behind a JFIF one, before the rest of a JPEG: header and end are all that is asked for."""
    jfif = b"\xff\xe0" + struct.pack(">H", 16) + b"JFIF\0\1\1" + bytes(7)
    segment = b"\xff\xe1" + struct.pack(">H", len(exif) + 8) + b"Exif\0\0" + exif
    path.write_bytes(b"\xff\xd8" + jfif + segment + b"\xff\xda\0\2\xff\xd9")
    return path


@pytest.mark.parametrize("order", ["<", ">"])
def test_exif_says_how_a_photograph_was_exposed(tmp_path, order):
    exif = directory(order, (1, 250), (28, 10), 400)
    assert exposure_settings(jpeg(tmp_path / "a.jpg", exif)) == (1 / 250, 2.8, 400)
    assert exposure_time(tmp_path / "a.jpg") == 1 / 250
    # A TIFF, and raw files that are built on it, begin with their directory.
    (tmp_path / "a.dng").write_bytes(exif)
    assert exposure_settings(tmp_path / "a.dng") == (1 / 250, 2.8, 400)
    png = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4s", 2, b"gAMA") + bytes(6)
    (tmp_path / "a.png").write_bytes(png + struct.pack(">I4s", len(exif), b"eXIf") + exif + bytes(4))
    assert exposure_settings(tmp_path / "a.png") == (1 / 250, 2.8, 400)
    assert exposure_settings(jpeg(tmp_path / "b.jpg", directory(order, (30, 1), iso=102400, kind=4))) == (
        30,
        None,
        102400,
    )
    # What a short cannot hold is not said, nor what is 0 or divided by it.
    assert exposure_settings(jpeg(tmp_path / "c.jpg", directory(order, (1, 0), (0, 10), 65535))) == (None, None, None)


def test_a_tiff_of_a_camera_says_it_too(tmp_path):
    tifffile = pytest.importorskip("tifffile")
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, np.zeros((4, 4, 3), np.uint8), photometric="rgb", extratags=[(0x829A, 5, 1, (1, 8), True)])
    assert exposure_time(path) == 1 / 8


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_exif_that_pillow_writes_is_read(tmp_path, suffix):
    image = pytest.importorskip("PIL.Image")
    rational = pytest.importorskip("PIL.TiffImagePlugin").IFDRational
    exif = image.Exif()
    exif[0x010F] = "a camera"
    tags = {0x829A: rational(1, 160), 0x829D: rational(28, 5), 0x8827: 1600, 0x9003: "2024:05:17 12:00:00"}
    exif.get_ifd(0x8769).update(tags)
    path = tmp_path / f"a{suffix}"
    image.new("RGB", (16, 8)).save(path, exif=exif)
    assert exposure_settings(path) == (1 / 160, 5.6, 1600)


def test_damaged_exif_says_nothing_and_is_refused_where_a_time_is_wanted(tmp_path, rng):
    exif = directory("<", (1, 250), (28, 10), 400)
    whole = jpeg(tmp_path / "a.jpg", exif).read_bytes()
    for _ in range(300):
        content = bytearray(whole[: rng.integers(3, len(whole) + 1)])
        for _ in range(3):
            content[rng.integers(len(content))] = rng.integers(256)
        (tmp_path / "b.jpg").write_bytes(content)
        exposure_settings(tmp_path / "b.jpg")  # whatever it says
    gn.write_image(tmp_path / "plain.png", np.ones((4, 4, 3)))
    for name in ("plain.png", "cut.jpg"):
        (tmp_path / "cut.jpg").write_bytes(whole[:40])
        with pytest.raises(gn.GonioError, match=f"{name} says no exposure time"):
            exposure_time(tmp_path / name)
    with pytest.raises(gn.GonioError, match=r"absent.jpg does not exist"):
        exposure_time(tmp_path / "absent.jpg")


def test_aperture_and_iso_count_where_they_differ(tmp_path):
    def files(*settings):
        return [jpeg(tmp_path / f"{k}.jpg", directory("<", *given)) for k, given in enumerate(settings)]

    alike = files(((1, 100), (56, 10), 400), ((1, 25), (56, 10), 400))
    assert exposures(alike) == ((0.01, 0.04), "")
    times, note = exposures(files(((1, 100), (4, 1), 100), ((1, 100), (2, 1), 200)))
    assert_allclose(times, (0.01 / 16, 0.01 * 2 / 4))
    assert note == "aperture and ISO differ: times are those at f/1 and ISO 100"
    times, note = exposures(files(((1, 100), (4, 1), 100), ((1, 100), (4, 1), 800)))
    assert times[1] / times[0] == pytest.approx(8)
    assert note.startswith("ISO differs: ")
    with pytest.raises(gn.GonioError, match=r"1.jpg says no ISO, but others do"):
        exposures(files(((1, 100), (4, 1), 100), ((1, 100), (4, 1))))
