"""Facts about `gonio prefilter`: what it writes, what it prints, what it refuses before it works."""

import json

import numpy as np
import pytest

import gonio as gn
from gonio.cli import main
from gonio.files.ktx2 import read_chain, read_ktx2


def run(capsys, *arguments):
    """(exit code, stdout, stderr) of the verb."""
    with pytest.raises(SystemExit) as left:
        main(["prefilter", *map(str, arguments)])
    said = capsys.readouterr()
    return left.value.code, said.out, said.err


@pytest.fixture
def sky(tmp_path):
    """A map whose radiance is 1 + z."""
    path = tmp_path / "sky.exr"
    gn.write_environment(path, gn.Environment(1 + gn.LatLong(16, 32).directions()[..., 2]))
    return path


@pytest.mark.parametrize("lobe", ["ggx", "phong"])
def test_a_chain_in_one_file_and_a_line_a_level(capsys, tmp_path, sky, lobe):
    output = tmp_path / "chain.ktx2"
    code, out, err = run(capsys, sky, "-o", output, "--size", 16, "--levels", 3, "--lobe", lobe, "--json")
    facts = [json.loads(line) for line in out.splitlines()]
    assert code == 0
    assert "LatLongMap" in err  # what was taken is told
    assert [(f["level"], f["size"], f["roughness"], f["alpha"]) for f in facts] == [
        (0, 16, 0, 0), (1, 8, 0.5, 0.25), (2, 4, 1, 1),
    ]  # fmt: skip
    assert all(f["error"] <= 0.01 for f in facts)
    chain = read_chain(output)
    assert chain.lobe == lobe
    with pytest.raises(SystemExit):
        main(["info", str(output), "--json"])
    said = json.loads(capsys.readouterr().out)
    assert (said["columns"], said["faces"], said["levels"], said["gonio:lobe"]) == (16, 6, 3, lobe)
    # A matte surface under 1 + z: E / pi = 1 + 2/3 n.z (RH 3.32); half floats and an error of 1e-2.
    z = chain.environment(2).directions()[0][..., 2]
    np.testing.assert_allclose(chain.faces[2].reshape(24, 4, 3)[..., 0], 1 + 2 / 3 * z, atol=0.01)


def test_a_table_of_numbers_for_people(capsys, tmp_path, sky):
    code, out, _ = run(capsys, sky, "-o", tmp_path / "chain.ktx2", "--size", 16, "--levels", 2)
    head, *lines = out.splitlines()
    assert (code, head.split(), len(lines)) == (0, ["level", "size", "roughness", "alpha", "degree", "error"], 2)


def test_faces_follow_the_tool_that_is_named(capsys, tmp_path, sky):
    pattern = tmp_path / "m{level}_{face}.exr"
    code, _, _ = run(capsys, sky, "-o", pattern, "--size", 8, "--levels", 2, "--to-orientation", "three.js")
    assert code == 0
    assert gn.read_environment(tmp_path / "m1_{face}.exr").orientation.name == "THREE_JS"


@pytest.mark.parametrize("suffix", ["ktx2", "exr"])
def test_the_table_of_the_split_sum(capsys, tmp_path, sky, suffix):
    table = tmp_path / f"brdf.{suffix}"
    code, _, _ = run(capsys, sky, "-o", tmp_path / "chain.ktx2", "--size", 8, "--levels", 1, "--table", table)
    assert code == 0
    image = read_ktx2(table).levels[0] if suffix == "ktx2" else gn.read_image(table)
    # Smooth and seen from above, F0 counts whole: scale 1, bias 0, to the width of a texel and half floats.
    np.testing.assert_allclose(image[0, -1, :3], [1, 0, 0], atol=2e-3)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["-o", "chain.dds"], "six faces a level"),
        (["-o", "no-folder/chain.ktx2"], "no-folder"),
        (["-o", "chain.ktx2", "--table", "brdf.png"], "brdf.png"),
        (["-o", "chain.ktx2", "--to-orientation", "filament"], "stands as OPENGL"),
        (["-o", "chain.ktx2", "--size", "24", "--levels", "5"], "cannot be halved"),
        (["-o", "chain.ktx2", "--error", "0"], "relative"),
        (["-o", "chain.ktx2", "--lobe", "cone"], "cone"),
    ],
)
def test_what_cannot_be_done_is_one_line_and_exit_2(capsys, tmp_path, monkeypatch, sky, options, says):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, sky, *options)
    assert (code, out) == (2, "")
    assert says in err.splitlines()[-1]
    assert [path.name for path in tmp_path.iterdir()] == ["sky.exr"]


def test_a_material_makes_maps_for_all_views(capsys, tmp_path, sky):
    output = tmp_path / "maps.gonio"
    code, out, _ = run(capsys, sky, "-o", output, "--brdf", "lambert:albedo=.5", "--error", 0.05, "--json")
    facts = json.loads(out)
    assert code == 0
    assert facts["error"] <= 0.05
    assert [lobe["about"] for lobe in facts["lobes"]] == ["normal"]
    maps = gn.read_shrm(output)
    assert "lambert:albedo=.5" in maps.made
    with pytest.raises(SystemExit):
        main(["info", str(output), "--json"])
    assert json.loads(capsys.readouterr().out)["lobe 0"].startswith("about the normal direction")
    # Matte, under 1 + z: albedo (1 + 2/3 n.z), of which splines and the fit leave half a per cent.
    n = gn.normalise(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.6, -0.8]]))
    np.testing.assert_allclose(maps.radiance(n, n)[:, 0], 0.5 * (1 + 2 / 3 * n[:, 2]), atol=0.005)


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        ("maps.exr", ("--brdf", "lambert"), "written as .gonio"),
        ("maps.gonio", (), "--brdf"),
        ("maps.gonio", ("--brdf", "ward:ks=.3,alpha_x=.1,alpha_y=.4"), "has no"),
    ],
)
def test_maps_that_cannot_be_are_refused_in_one_line(capsys, tmp_path, sky, name, arguments, message):
    code, _, err = run(capsys, sky, "-o", tmp_path / name, *arguments)
    assert code == 2
    assert message in err.splitlines()[-1]
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize("name", ["chain.ktx2", "maps.gonio"])
def test_a_picture_comes_with_the_maps(capsys, tmp_path, sky, name):
    picture = tmp_path / "look.png"
    what = ("--size", 16, "--levels", 2) if name.endswith("ktx2") else ("--brdf", "lambert:albedo=.5", "--error", 0.1)
    code, _, _ = run(capsys, sky, "-o", tmp_path / name, *what, "--picture", picture)
    image = gn.read_image(picture)
    assert code == 0
    # Two levels of six faces of 96 pixels; five balls of 200.
    assert image.shape == ((192, 576, 3) if name.endswith("ktx2") else (200, 1000, 3))
    # Light is 1 + z: what looks up is brightest, what looks down darkest.
    if name.endswith("ktx2"):
        up, down = image[:96, 192:288].mean(), image[:96, 288:384].mean()
        assert up > 2 * down
    else:
        assert image[40, 100].mean() > image[160, 100].mean()


def test_a_picture_that_is_no_png_is_refused_first(capsys, tmp_path, sky):
    code, _, err = run(capsys, sky, "-o", tmp_path / "chain.ktx2", "--picture", tmp_path / "look.jpg")
    assert code == 2
    assert "PNG" in err
    assert not (tmp_path / "chain.ktx2").exists()
