"""`gonio simulate`: folders whose samples are the material that was photographed; and `gonio info` on them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose
from reference.verbs import run

import gonio as gn
from gonio.capture.exposure import Noise

BRDF = ("--brdf", "lambert:albedo=.5/.4/.3", "--brdf", "ggx:alpha=.4,eta=1.5")
PLASTIC = gn.Lambert([0.5, 0.4, 0.3]) + gn.Microfacet(gn.GGX(0.4), gn.Fresnel(1.5))


def simulated(capsys, folder, *arguments):
    code, _, err = run(capsys, "simulate", "-o", folder, *arguments)
    assert code == 0, err
    return gn.read_capture(folder)


def vase(folder):
    """A coarse one: the verb's own takes seconds to write."""
    gn.write_mesh(folder / "vase.obj", gn.vase(24))
    return folder / "vase.obj"


def relief(folder):
    """A smooth image of heights, from 0 to 3 pixels, in 24 x 32."""
    y, x = np.mgrid[:24, :32]
    gn.write_image(folder / "heights.exr", 1.5 + 1.5 * np.sin(x / 4) * np.cos(y / 3))
    return folder / "heights.exr"


@pytest.mark.parametrize("shape", ["sphere", "vase", "heights"])
def test_samples_of_a_folder_under_near_lamps_are_the_brdf(capsys, tmp_path, shape):
    what = {"sphere": lambda _: "sphere", "vase": vase, "heights": relief}[shape](tmp_path)
    size = 40 if shape == "heights" else 24  # other than the heights' own
    capture = simulated(capsys, tmp_path / "sim", "--shape", what, *BRDF, "--near", 2, "--count", 5, "--size", size)
    assert capture.directions is None
    assert len(capture.lights) == 5
    total = 0
    for block in capture.reflectance():
        good = (block.wi[:, 2] > 0.2) & (block.wo[:, 2] > 0.2)
        # Normals and codes are rounded to 16 bits, of which the dark have fewer. Of the coarse mesh, light is taken
        # where shadow rays start, up to .012 off its faces: 1 %.
        assert_allclose(block.value[good], PLASTIC.f(block.wi[good], block.wo[good]), rtol=0.015)
        total += good.sum()
    assert total > 2 * len(capture.sites)


def test_samples_of_a_folder_from_all_around_are_the_brdf(capsys, tmp_path):
    arguments = ("--shape", vase(tmp_path), "--views", 5, "--size", 96, *BRDF)
    capture = simulated(capsys, tmp_path / "sim", *arguments)
    assert isinstance(capture, gn.Turntable)
    assert len(capture.cameras) == len(capture.lights) == 5
    misses = []
    for block in capture.reflectance():
        good = (block.wi[:, 2] > 0.3) & (block.wo[:, 2] > 0.3)
        misses.append((block.value[good] / PLASTIC.f(block.wi[good], block.wo[good]) - 1).ravel())
    misses = np.abs(np.concatenate(misses))
    # Radiance bends from pixel to pixel, as in tests/capture/test_turntable.py.
    assert len(misses) > 3000
    assert np.median(misses) < 0.005
    assert np.quantile(misses, 0.95) < 0.05


def test_brackets_of_a_folder_hold_the_brdf_within_their_noise(capsys, tmp_path):
    noise = ("--gain", 1e-4, "--read", 1e-3)
    capture = simulated(capsys, tmp_path / "sim", *BRDF, "--brackets", "1,4,16", *noise, "--count", 4, "--size", 32)
    photographs = capture.photographs
    assert photographs.noise == Noise(1e-4, 1e-3)
    assert_allclose(np.divide(photographs.times, photographs.times[0]), [1, 4, 16])
    off = []
    for k, (block, light) in enumerate(zip(capture.reflectance(), capture.lights, strict=True)):
        merged = photographs.merged(k)
        # Standard deviation of f by what the merge says of its radiance.
        cosine = block.wi[:, 2:] * light.irradiance
        sigma = np.sqrt(merged.variance[capture.mask][block.site]) / cosine
        good = (block.wi[:, 2] > 0.2) & (block.wo[:, 2] > 0.2)
        off.append(((block.value - PLASTIC.f(block.wi, block.wo)) / sigma)[good].ravel())
    off = np.concatenate(off)
    # 5000 of them: the mean is known to .015, the deviation to .01; rounding to codes and of normals adds a little.
    assert off.size > 4000
    assert abs(off.mean()) < 0.1
    assert off.std() == pytest.approx(1, abs=0.1)
    # The list of lights beside is of the first exposures.
    lights = gn.read_capture(tmp_path / "sim" / "dirs.lp")
    assert lights.photographs.names == photographs.names


def test_a_folder_under_a_map_of_light_tells_no_lights_but_its_radiance(capsys, tmp_path):
    gn.write_image(tmp_path / "sky.exr", np.full((16, 32, 3), [2.0, 4, 8]))
    capture = simulated(
        capsys, tmp_path / "sim", "--brdf", "lambert:albedo=.5", "--environment", tmp_path / "sky.exr", "--size", 16
    )
    assert capture.lights is None
    (block,) = capture.radiance()
    # All directions are as bright: a matte surface sends albedo times that; codes are radiance times an exposure.
    exposure = json.loads((tmp_path / "sim" / "truth" / "made.json").read_text())["sensor"]["exposure"]
    assert not capture.photographs.read(0).clipped[capture.mask].any()  # however bright it is
    # The map is 16 rows of pixels: the sum over them is right to half a percent.
    assert_allclose(block.value / exposure, np.broadcast_to([1.0, 2.0, 4.0], block.value.shape), rtol=0.01)


def test_a_texture_comes_back_texel_by_texel(capsys, tmp_path):
    albedo = np.array([[0.8, 0.2], [0.4, 0.6]])[..., None] * [1, 0.5, 0.25]
    gn.write_image(tmp_path / "albedo.png", np.repeat(np.repeat(albedo, 12, 0), 16, 1), "linear", bits=16)
    brdf = f"lambert:albedo=@{tmp_path / 'albedo.png'}"
    gn.write_image(tmp_path / "flat.exr", np.zeros((24, 32)))
    capture = simulated(
        capsys, tmp_path / "sim", "--shape", tmp_path / "flat.exr", "--brdf", brdf, "--count", 3, "--size", 64
    )
    assert capture.normals is not None
    f = np.full((*capture.photographs.size, 3), np.nan)
    for block in capture.reflectance():
        f.reshape(-1, 3)[np.flatnonzero(capture.mask)[block.site]] = block.value
        rows, columns = f.shape[:2]
        for row, column in ((0, 0), (0, 1), (1, 0), (1, 1)):
            quarter = f[rows * (2 * row + 1) // 4, columns * (2 * column + 1) // 4]
            assert_allclose(quarter, albedo[row, column] / np.pi, rtol=0.002)  # codes of 16 bits, in the dark


def test_info_draws_near_lamps_and_cameras(capsys, tmp_path):
    simulated(capsys, tmp_path / "near", "--near", 2, "--count", 7, "--size", 24)
    code, out, _ = run(capsys, "info", tmp_path / "near", "--json", "--picture", tmp_path / "near.png")
    facts = json.loads(out)
    assert code == 0
    assert (facts["lights"], facts["near lights"], facts["normals"]) == (7, 7, "given")
    assert gn.image_info(tmp_path / "near.png").columns > 400
    simulated(capsys, tmp_path / "round", "--shape", vase(tmp_path), "--views", 5, "--size", 24)
    code, out, _ = run(capsys, "info", tmp_path / "round", "--json", "--picture", tmp_path / "round.png")
    facts = json.loads(out)
    assert code == 0
    assert (facts["photographs"], facts["places"], facts["lights"]) == (5, 5, 5)
    assert facts["shape"].endswith(" faces")
    assert "looks wrong" not in facts
    assert gn.image_info(tmp_path / "round.png").columns > 400


def test_info_counts_lights_by_what_is_known_of_them(capsys, tmp_path):
    gn.write_image(tmp_path / "a.png", np.full((6, 8, 3), 0.5))
    uneven = "falloff = [[[0, 0.1, 0, 0, 0, 0]]]\n"
    for lights, near in (("directions = [[0, 0, 1]]\n", None), ("positions = [[0, 0, 9]]\n", 1)):
        text = f"version = 1\nphotographs = ['a.png']\n[lights]\n{lights}{uneven}"
        (tmp_path / "capture.toml").write_text(text)
        _, out, _ = run(capsys, "info", tmp_path, "--json")
        facts = json.loads(out)
        assert (facts.get("near lights"), facts["lights with a measured falloff"]) == (near, 1)


def test_the_truth_holds_where_near_lamps_stood(capsys, tmp_path):
    capture = simulated(capsys, tmp_path / "sim", "--near", 2, "--count", 8, "--size", 8, "--misaligned", 2)
    stood = np.array(json.loads((tmp_path / "sim" / "truth" / "made.json").read_text())["positions"])
    told = np.array([light.position for light in capture.lights])
    assert_allclose(np.linalg.norm(stood, axis=1), 4)  # twice the ball's diameter from its middle
    assert_allclose(np.linalg.norm(told, axis=1), 4)
    off = np.degrees(np.arccos((np.sum(stood * told, axis=1) / 16).clip(-1, 1)))
    assert 1 < np.sqrt(np.mean(off**2)) < 4  # 2 degrees rms, of eight


def test_info_says_that_an_encoding_is_not_stated_beneath_a_vignetting(capsys, tmp_path):
    from PIL import Image

    Image.fromarray(np.full((6, 8, 3), 100, np.uint8)).save(tmp_path / "a.jpg")
    gn.write_image(tmp_path / "v.exr", np.ones((6, 8)))
    (tmp_path / "capture.toml").write_text("version = 1\nphotographs = ['a.jpg']\nvignetting = 'v.exr'\n")
    _, out, _ = run(capsys, "info", tmp_path, "--json")
    assert json.loads(out)["encoding"] == "not stated"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--environment", "sky.exr", "--near", 1), "--environment goes in the place of"),
        (("--views", 3), "--views photographs a mesh"),
        (("--brackets", "1,x"), "'1,x' is not numbers"),
        (("--brackets", "1,0"), "exposure"),
        (("--brdf", "lambert:albedo=@none.png"), "none.png"),
        (("--bits", 8, "--exposure", -1, "--gain", -1), "negative"),
    ],
)
def test_what_cannot_be_photographed_leaves_no_folder(capsys, tmp_path, arguments, message):
    code, _, err = run(capsys, "simulate", "-o", tmp_path / "sim", "--size", 8, "--count", 3, *arguments)
    assert code == 2
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert not (tmp_path / "sim").exists()
