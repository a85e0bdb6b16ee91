"""Facts about the command line: what it prints where, its exit codes, its errors of one line."""

import json
import subprocess
import sys

import numpy as np
import pytest
from reference.verbs import run

import gonio as gn
from gonio.cli import parse


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
    assert (facts["columns"], facts["rows"], sorted(facts["channels"])) == (32, 16, ["B", "G", "R"])
    assert facts["environment map"].startswith("LatLongMap")
    assert facts["mean"] == pytest.approx([1, 1, 1], abs=1e-6)


def test_a_missing_file_is_one_line_on_stderr_and_exit_2(capsys, tmp_path):
    code, out, err = run(capsys, "info", tmp_path / "no.exr")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "no.exr" in err


@pytest.mark.parametrize(
    "arguments",
    [
        "paint",
        "info --loud x",
        "render --size 9999999 -o x.exr",
        "render --samples 0 -o x.exr",
        "render --sun 0,0,0 -o x",
    ],
)
def test_bad_use_and_too_much_are_one_line_and_exit_2(capsys, arguments):
    code, out, err = run(capsys, *arguments.split())
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("gonio: error: ")


def test_ctrl_c_is_exit_130(capsys, monkeypatch, tmp_path):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("gonio.rendering.image.radiance", stopped)
    output = tmp_path / "x.exr"
    assert run(capsys, "render", "--sun", "0,0,1", "--size", 8, "-o", output) == (130, "", "gonio: stopped\n")
    assert not output.exists()


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


@pytest.mark.parametrize("name", ["no-folder/x.exr", "x.jpg"])
def test_where_a_picture_cannot_go_is_said_before_it_is_rendered(capsys, monkeypatch, tmp_path, name):
    monkeypatch.setattr("gonio.rendering.image.radiance", None)  # what is not callable is not called
    code, _, err = run(capsys, "render", "-o", tmp_path / name)
    assert (code, err.count("\n")) == (2, 1)
    assert name in err


@pytest.mark.parametrize(
    ("term", "names"),
    [
        ("lambert:albedo=.5,albedo=.7", "twice"),
        ("ggx:alpha=.1/.2/.3", "alpha is one number"),
        ("ggx:f0=.9,eta=2", "Schlick has no 'eta'"),
        ("ggx:k=3", "Conductor also needs eta"),
        ("lambert:albedo", "key=value"),
        ("lambert:albedo=red", "red"),
    ],
)
def test_what_a_term_says_wrongly_is_named(term, names):
    with pytest.raises(gn.GonioError, match=names):
        parse.reflectance([term])


@pytest.mark.parametrize("name", [*parse.ANALYTIC, *parse.FACETS])
def test_every_model_is_made_by_its_name(name):
    assert parse.reflectance([name]).f([[0.0, 0, 1]], [[0.0, 0, 1]]) >= 0


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


def seen_from(eye, capsys, tmp_path, *arguments):
    output = tmp_path / "seen.exr"
    code, _, err = run(capsys, "render", "--eye", eye, "--size", 16, "--supersample", 1, *arguments, "-o", output)
    assert code == 0, err
    return gn.read_image(output)[..., 0]


def test_a_mesh_with_y_up_is_stood_up(capsys, tmp_path):
    # A triangle in the plane y = 0 of the file, facing its up: from above it is lit by a sun overhead.
    (tmp_path / "up.obj").write_text("v -1 0 1\nv 1 0 1\nv 0 0 -1\nf 1 2 3\n")
    image = seen_from("0,0,4", capsys, tmp_path, "--shape", tmp_path / "up.obj", "--y-up", "--sun", "0,0,1")
    assert image.max() == pytest.approx(0.6 / np.pi)
    # Its tip, at -z of the file, goes to +y, which is up in a view from straight above.
    assert (image > 0).sum(axis=1)[5] < (image > 0).sum(axis=1)[10]


def test_smooth_normals_take_the_place_of_a_files_facets(capsys, tmp_path):
    # A roof with facet normals in the file: two shades. Smooth normals shade the ridge between them.
    roof = "v 0 -1 1\nv 0 1 1\nv 1 0 0\nv -1 0 0\n"
    facets = "vn .7 0 .7\nvn -.7 0 .7\nf 1//1 3//1 2//1\nf 2//2 4//2 1//2\n"
    (tmp_path / "roof.obj").write_text(roof + facets)
    given = ("--shape", tmp_path / "roof.obj", "--sun", "1,0,1")
    assert len(np.unique(seen_from("0,0,4", capsys, tmp_path, *given).round(4))) == 2  # lit, and black elsewhere
    assert len(np.unique(seen_from("0,0,4", capsys, tmp_path, *given, "--smooth").round(4))) > 3


def test_info_draws_an_image_to_look_at(capsys, tmp_path, environment):
    picture = tmp_path / "seen.png"
    code, _, _ = run(capsys, "info", environment, "--picture", picture)
    assert code == 0
    # Exposed by itself: the log-average comes to .18 and the curve leaves middle grey in the middle.
    assert 0.05 < gn.read_image(picture).mean() < 0.5
    code, _, err = run(capsys, "info", environment, "--picture", tmp_path / "seen.exr")
    assert (code, err.count("\n")) == (2, 1)


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


def test_a_material_of_a_file_of_fits_is_named_after_a_colon(capsys, tmp_path):
    fits = tmp_path / "fits.json"
    fits.write_text('{"red-clay": {"kD": [0.5, 0.2, 0.1], "A": [0, 0, 0], "B": 1, "C": 1, "ior": 1.5}}')
    straight = [[0.0, 0.0, 1.0]]
    np.testing.assert_allclose(
        parse.reflectance([f"{fits}:red-clay"]).f(straight, straight), [[0.5 / np.pi, 0.2 / np.pi, 0.1 / np.pi]]
    )
    with pytest.raises(gn.GonioError, match="no material 'red-cly'"):
        parse.reflectance([f"{fits}:red-cly"])
    code, out, _ = run(capsys, "info", fits, "--json")
    assert code == 0
    assert json.loads(out)["materials"] == ["red-clay"]


def test_a_square_probe_lights_a_ball_once_its_layout_is_named(capsys, tmp_path):
    probe = tmp_path / "probe.pfm"  # a format whose header says nothing of layouts
    gn.write_image(probe, np.ones((16, 16, 3)))
    render = ("render", "--light", probe, "--size", 8, "-o", tmp_path / "ball.exr")
    code, _, err = run(capsys, *render)
    assert code == 2
    assert "AngularMap" in err
    code, _, err = run(capsys, *render, "--layout", "angular")
    assert code == 0
    assert "AngularMap PROBE" in err  # what was taken is told
    # A white furnace: what is 1 all around is the albedo on the ball, .6 by default, and 1 behind it.
    image = gn.read_image(tmp_path / "ball.exr")
    np.testing.assert_allclose(image[3:5, 3:5], 0.6, rtol=0.01)


def test_info_says_where_a_measured_material_reflects_more_than_it_receives(capsys, data):
    """Dupuy and Jakob's measurements gain light towards grazing views; satin does so visibly."""
    code, out, _ = run(capsys, "info", data / "brdf" / "rgl" / "satin_rosaline_rgb.bsdf", "--json")
    facts = json.loads(out)
    assert code == 0
    assert "80 degrees" in facts["looks wrong"]
    assert max(facts["albedo at 60 degrees"]) < 1


def test_maps_are_rendered_and_compared_with_the_sum(capsys, tmp_path, environment):
    maps, picture = tmp_path / "maps.gonio", tmp_path / "ball.exr"
    matte = ("--brdf", "lambert:albedo=.5")
    assert run(capsys, "prefilter", environment, "-o", maps, *matte, "--error", ".02")[0] == 0
    size = ("--size", 24, "--supersample", 1)
    code, _, err = run(capsys, "render", "--maps", maps, *size, "-o", picture)
    assert code == 0
    assert "maps: gonio prefilter" in err
    quick = gn.read_image(picture)
    code, _, err = run(
        capsys, "render", "--maps", maps, "--compare", "--light", environment, *matte, *size, "-o", picture
    )
    assert code == 0
    first, second, third = np.split(gn.read_image(picture), 3, axis=1)
    assert quick.shape == first.shape
    # Of a matte ball under light of degree 1 the maps miss what splines and halves of pixels do: a per cent.
    assert np.max(np.abs(first - second)) < 0.02 * second.max()
    np.testing.assert_allclose(third, 10 * np.abs(first - second), atol=1e-5)
    assert "rms difference" in err


def test_comparing_wants_one_environment(capsys, tmp_path):
    code, _, err = run(capsys, "render", "--compare", "--sun", "0,0,1", "--size", 8, "-o", tmp_path / "ball.exr")
    assert code == 2
    assert "one environment" in err
