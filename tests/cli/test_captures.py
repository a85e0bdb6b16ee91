"""The verbs that take captures: `info`, `calibrate`, `normals`."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from numpy.testing import assert_allclose
from reference.verbs import run

import gonio as gn


def lights():
    return gn.from_spherical(np.radians([15.0, 30, 30, 40, 35, 25]), np.arange(6) * 1.05)


def sphere(size):
    """Normals of a ball in the middle of an image, and where it is."""
    at = (np.arange(size) + 0.5 - size / 2) / (0.4 * size)
    x, y = np.meshgrid(at, -at)
    inside = x * x + y * y < 1
    return np.stack((x, y, np.sqrt(np.where(inside, 1 - x * x - y * y, 0))), axis=-1), inside


@pytest.fixture
def matte(tmp_path):
    """An RTI folder of a matte ball, with its mask."""
    normals, inside = sphere(48)
    inside &= normals[..., 2] > 0.35
    folder = tmp_path / "matte"
    folder.mkdir()
    for k, light in enumerate(lights()):
        image = np.where(inside, 0.8 * np.maximum(normals @ light, 0), 0)
        gn.write_image(folder / f"photo{k}.png", np.repeat(image[..., None], 3, axis=2), "linear", bits=16)
    gn.write_image(folder / "mask.png", inside.astype(float), "linear")
    gn.write_lp(folder / "dirs.lp", [f"photo{k}.png" for k in range(6)], lights())
    return folder


@pytest.fixture
def chrome(tmp_path):
    """Photographs of a mirror ball that shows each lamp as a disc of 3 degrees, before a gray wall."""
    normals, inside = sphere(160)
    mirrored = 2 * normals[..., 2:] * normals - [0, 0, 1]
    folder = tmp_path / "chrome"
    folder.mkdir()
    for k, light in enumerate(lights()):
        lamp = np.where(mirrored @ light > np.cos(np.radians(3)), 1.0, 0.02)
        image = np.where(inside, lamp, 0.3)
        gn.write_image(folder / f"ball{k}.png", np.repeat(image[..., None], 3, axis=2), "linear", bits=16)
    return folder


def test_a_ball_gives_lights_and_lights_give_normals_and_heights(capsys, tmp_path, matte, chrome):
    found, picture = tmp_path / "found.lp", tmp_path / "ball.png"
    code, out, _ = run(capsys, "calibrate", chrome, "--for", matte, "-o", found, "--picture", picture)
    assert code == 0
    assert "radius 64" in out
    assert picture.exists()
    read = gn.read_lp(found)
    assert read.names == tuple(f"photo{k}.png" for k in range(6))
    # Edges are not smoothed here: half a pixel of the outline's 64 turns a light at 40 degrees by .6 degrees.
    assert np.degrees(np.arccos(np.sum(read.directions * lights(), axis=1).clip(-1, 1))).max() < 1
    code, out, _ = run(capsys, "normals", matte, "--lights", found, "-o", tmp_path / "out", "--json")
    facts = json.loads(out)
    assert code == 0
    assert facts["photographs"] == 6
    assert facts["residual"] < 0.02
    layers = gn.read_layers(tmp_path / "out" / "relief.exr")
    normals, _ = sphere(48)
    mask = np.isfinite(layers["heights"])
    assert mask.sum() == facts["pixels"]
    assert np.median(np.degrees(np.arccos(np.sum(layers["normals"] * normals, axis=2)[mask].clip(-1, 1)))) < 0.7
    # Heights of a ball of 19.2 pixels' radius, up to a constant.
    expected = 19.2 * normals[..., 2]
    off = (layers["heights"] - expected)[mask]
    assert np.std(off) < 0.3
    assert (tmp_path / "out" / "relief.png").exists()
    codes = gn.read_image(tmp_path / "out" / "normals.png", "linear")
    assert_allclose(2 * codes[24, 24] - 1, normals[24, 24], atol=0.02)


def test_info_tells_of_a_folder_and_draws_it(capsys, tmp_path, matte):
    sheet = tmp_path / "sheet.png"
    code, out, _ = run(capsys, "info", matte, "--json", "--picture", sheet)
    facts = json.loads(out)
    assert code == 0
    assert (facts["layout"], facts["photographs"], facts["lights"]) == ("RTI", 6, 6)
    assert "looks wrong" not in facts
    assert gn.image_info(sheet).columns > 400
    (matte / "photo3.png").unlink()
    _, out, _ = run(capsys, "info", matte, "--json")
    assert "photo3.png of dirs.lp does not exist" in json.loads(out)["looks wrong"]


def test_what_is_missing_is_refused_in_one_line_that_tells_the_way_out(capsys, tmp_path, matte, chrome):
    (matte / "photo3.png").unlink()
    code, _, err = run(capsys, "normals", matte, "-o", tmp_path / "out")
    assert code == 2
    assert "photo3.png of dirs.lp does not exist" in err
    code, _, err = run(capsys, "normals", matte, "-o", tmp_path / "out", "--partial")
    assert code == 0
    assert "photo3.png" in err
    code, _, err = run(capsys, "normals", chrome, "-o", tmp_path / "out")
    assert code == 2
    assert "lights are unknown" in err
    code, _, err = run(capsys, "calibrate", chrome, "-o", tmp_path / "lights.txt")
    assert code == 2
    assert "end its name in .lp" in err
    code, _, err = run(capsys, "calibrate", matte, "--partial", "-o", tmp_path / "lights.lp")
    assert code == 2
    assert "photo0.png" in err
    assert not (tmp_path / "lights.lp").exists()


def test_a_simulated_folder_holds_the_truth_and_its_samples_are_the_brdf(capsys, tmp_path):
    folder = tmp_path / "sim"
    brdf = ("--brdf", "lambert:albedo=.5/.4/.3", "--brdf", "ggx:alpha=.4,eta=1.5")
    code, out, _ = run(capsys, "simulate", "-o", folder, *brdf, "--size", 32, "--count", 9, "--misaligned", 1)
    assert code == 0
    assert "9 photographs of 32 x 32" in out
    capture = gn.read_capture(folder)
    truth = gn.read_lp(folder / "truth" / "dirs.lp").directions
    off = np.degrees(np.arccos(np.sum(capture.directions * truth, axis=1).clip(-1, 1)))
    assert 0.2 < np.sqrt(np.mean(off**2)) < 2
    model = gn.Lambert([0.5, 0.4, 0.3]) + gn.Microfacet(gn.GGX(0.4), gn.Fresnel(1.5))
    strengths = [light.irradiance for light in capture.lights]
    capture = dataclasses.replace(capture, lights=gn.distant_lights(truth, strengths))
    for block in capture.reflectance():
        steep = block.wi[:, 2] > 0.2
        # Normals and codes are rounded to 16 bits.
        assert_allclose(block.value[steep], model.f(block.wi[steep], block.wo[steep]), rtol=0.01)
    code, _, err = run(capsys, "simulate", "-o", folder)
    assert code == 2
    assert "not empty" in err


def test_ingested_photographs_give_the_same_normals(capsys, tmp_path, matte):
    _, before, _ = run(capsys, "normals", matte, "-o", tmp_path / "a", "--json")
    code, out, _ = run(capsys, "ingest", matte)
    assert code == 0
    assert "6 photographs in" in out
    assert type(gn.read_capture(matte).photographs).__name__ == "StoredPhotographs"
    _, after, _ = run(capsys, "normals", matte, "-o", tmp_path / "b", "--json")
    assert before == after


def test_a_white_target_puts_albedo_in_its_units(capsys, tmp_path, matte):
    white = tmp_path / "white"
    white.mkdir()
    for k, light in enumerate(lights()):
        gn.write_image(white / f"white{k}.png", np.full((48, 48, 3), 0.5 * light[2]), "linear", bits=16)
    code, _, _ = run(capsys, "normals", matte, "--white", white, "-o", tmp_path / "out")
    assert code == 0
    albedo = gn.read_layers(tmp_path / "out" / "relief.exr")["albedo"]
    # 1/sr: the ball sends .8 of what the white, which is 1 / pi, sends .5 of.
    assert np.nanmedian(albedo) == pytest.approx(0.8 / 0.5 / np.pi, rel=1e-3)
