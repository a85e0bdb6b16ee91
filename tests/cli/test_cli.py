"""Facts about the command line: what it prints where, its exit codes, its errors of one line."""

import json
import subprocess
import sys

import numpy as np
import pytest

import gonio as gn
from gonio.cli import main, parse


def run(capsys, *arguments):
    """(exit code, stdout, stderr) of a verb."""
    with pytest.raises(SystemExit) as left:
        main([str(argument) for argument in arguments])
    said = capsys.readouterr()
    return left.value.code, said.out, said.err


@pytest.fixture
def environment(tmp_path):
    """A map whose radiance is 1 + w: every direction has its own colour."""
    path = tmp_path / "room.exr"
    gn.write_environment(path, gn.Environment(1 + gn.LatLong(16, 32).directions()))
    return path


def test_help_is_answered_without_the_mathematics():
    code = (
        "import sys; sys.argv = ['gonio', '--help']\n"
        "from gonio.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "assert 'numpy' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


def test_info_tells_size_format_and_layout(capsys, environment):
    code, out, _ = run(capsys, "info", environment, "--json")
    facts = json.loads(out)
    assert code == 0
    assert facts["pixels"] == "32 x 16"
    assert facts["environment map"].startswith("LatLongMap")
    assert facts["mean"] == pytest.approx([1, 1, 1], abs=1e-6)


def test_a_missing_file_is_one_line_on_stderr_and_exit_2(capsys, tmp_path):
    code, out, err = run(capsys, "info", tmp_path / "no.exr")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "no.exr" in err


def test_an_unknown_suffix_lists_the_known_ones(capsys, tmp_path):
    (tmp_path / "what.xyz").write_text("?")
    code, _, err = run(capsys, "info", tmp_path / "what.xyz")
    assert code == 2
    assert ".exr" in err


def test_a_misspelt_model_is_met_with_the_nearest_name(capsys, tmp_path):
    code, _, err = run(capsys, "render", "--brdf", "lambrt", "-o", tmp_path / "x.png")
    assert code == 2
    assert "lambert" in err
    assert not (tmp_path / "x.png").exists()


def test_a_misspelt_parameter_is_met_with_the_models_own(capsys, tmp_path):
    code, _, err = run(capsys, "render", "--brdf", "ggx:rough=.2", "-o", tmp_path / "x.png")
    assert code == 2
    assert "alpha" in err


def test_a_parameter_out_of_range_is_refused_by_name(capsys, tmp_path):
    code, _, err = run(capsys, "render", "--brdf", "lambert:albedo=2", "-o", tmp_path / "x.png")
    assert code == 2
    assert "albedo" in err


def test_render_of_a_matte_ball_under_a_sun_is_albedo_over_pi_times_cosine(capsys, tmp_path):
    output = tmp_path / "ball.exr"
    code, out, _ = run(
        capsys, "render", "--brdf", "lambert:albedo=.5", "--sun", "0,0,1:2", "--eye", "0,-4,0", "--fov", 1,
        "--size", 8, "--supersample", 1, "-o", output,
    )  # fmt: skip
    assert (code, out.strip()) == (0, str(output))
    # Seen through half a degree about the equator, every normal lies within a degree or so of -y: E = 2 sin(elevation).
    image = gn.read_image(output)
    camera = gn.Pinhole.look_at(eye=(0, -4, 0), target=(0, 0, 0), field_of_view=1, size=(8, 8))
    cosine = np.maximum(gn.Sphere().view(camera).normal[..., 2], 0)
    np.testing.assert_allclose(image[..., 0], 0.5 / np.pi * 2 * cosine, atol=1e-6)


def test_convert_keeps_the_radiance_of_every_direction(capsys, tmp_path, environment):
    cross = tmp_path / "cross.exr"
    code, _, _ = run(capsys, "convert", environment, "--to", "cross", "--rows", 96, "-o", cross)
    assert code == 0
    w = gn.normalise(np.random.default_rng(1).normal(size=(500, 3)))
    # Bilinear between centres pi / 16 apart, twice: step^2 / 8 of curvature 1 from each axis of both maps, .02 at most.
    np.testing.assert_allclose(gn.read_environment(cross).radiance(w), 1 + w, atol=0.02)


def test_convert_writes_and_reads_the_six_faces_of_a_cube(capsys, tmp_path, environment):
    run(capsys, "convert", environment, "--rows", 96, "-o", tmp_path / "sky_{face}.exr")
    assert sorted(p.name for p in tmp_path.glob("sky_*")) == [f"sky_{s}{a}.exr" for s in "np" for a in "xyz"]
    _, said, _ = run(capsys, "convert", tmp_path / "sky_{face}.exr", "--to", "latlong", "-o", tmp_path / "back.exr")
    assert "CubeStrip PANORAMA -> LatLongMap PANORAMA" in said
    w = gn.normalise(np.random.default_rng(1).normal(size=(500, 3)))
    # As above, with another resampling.
    np.testing.assert_allclose(gn.read_environment(tmp_path / "back.exr").radiance(w), 1 + w, atol=0.03)


def test_convert_to_png_maps_tones(capsys, tmp_path, environment):
    code, _, _ = run(capsys, "convert", environment, "-o", tmp_path / "room.png")
    assert code == 0
    assert gn.image_info(tmp_path / "room.png").columns == 32


def test_an_unknown_orientation_lists_the_published(capsys, tmp_path, environment):
    code, _, err = run(capsys, "convert", environment, "--orientation", "atlantis", "-o", tmp_path / "x.exr")
    assert code == 2
    assert "mitsuba" in err


@pytest.mark.parametrize(("text", "expected"), [("640x480", (640, 480)), ("32", (32, 32))])
def test_sizes_are_columns_by_rows(text, expected):
    assert parse.size(text) == expected


def test_terms_add_and_weights_scale():
    brdf = parse.reflectance(["lambert:albedo=.2/.4/.6", "ggx:alpha=.3,eta=1.5,weight=2"])
    expected = gn.Lambert([0.2, 0.4, 0.6]) + 2 * gn.Microfacet(gn.GGX(0.3), gn.Fresnel(1.5))
    wi, wo = gn.normalise([[0.3, 0.1, 0.9]]), gn.normalise([[-0.2, 0.4, 0.8]])
    np.testing.assert_array_equal(brdf.f(wi, wo), expected.f(wi, wo))
