"""Facts about `gonio sh`: the numbers of renderers, from maps and from each other."""

import json

import numpy as np
import pytest
from reference.verbs import run

import gonio as gn
from gonio.cli.sh import Name
from gonio.files.engine_harmonics import ENGINES, Engine, read_sh, to_engine, write_sh


@pytest.fixture
def room(tmp_path):
    """A map whose radiance is 1 + w, and its coefficients."""
    environment = gn.Environment((1 + gn.LatLong(16, 32).directions()).astype(np.float32))
    path = tmp_path / "room.exr"
    gn.write_environment(path, environment)
    return path, environment.harmonics(2)


def test_every_engine_has_a_name():
    assert {name.value for name in Name} == set(ENGINES)


def test_project_writes_the_numbers_of_a_map(capsys, room, tmp_path):
    path, light = room
    code, out, err = run(capsys, "sh", "project", path, "--to", "unity", "-o", tmp_path / "sh.json")
    assert (code, out) == (0, f"{tmp_path / 'sh.json'}\n") and "LatLongMap" in err
    # The file is turned to a panorama by moving its pixels: single precision lies between.
    np.testing.assert_allclose(read_sh(tmp_path / "sh.json"), light, atol=1e-6)


def test_project_says_the_numbers_for_people_and_machines(capsys, room):
    path, light = room
    code, out, _ = run(capsys, "sh", "project", path, "--to", "unreal", "--json")
    assert code == 0
    np.testing.assert_allclose(json.loads(out)["numbers"], to_engine(light, Engine.UNREAL), atol=1e-6)
    code, out, _ = run(capsys, "sh", "project", path)
    rows = [line.split() for line in out.splitlines()]
    assert code == 0 and [row[0] for row in rows][:4] == ["L00", "L1-1", "L10", "L11"]
    np.testing.assert_allclose([[float(v) for v in row[1:]] for row in rows], light, atol=1e-5)


def test_project_takes_the_orientation_that_is_named(capsys, room):
    """1 + w, read as if mirrored: left and right change places."""
    path, _ = room
    picture = gn.read_environment(path, orientation=gn.Orientation.BLENDER)
    _, out, _ = run(capsys, "sh", "project", path, "--orientation", "blender", "--layout", "latlong", "--json")
    np.testing.assert_allclose(json.loads(out)["numbers"], picture.harmonics(2), atol=1e-6)


def test_convert_goes_from_engine_to_engine(capsys, rng, tmp_path):
    f = rng.normal(size=(9, 3))
    write_sh(tmp_path / "a.txt", f, Engine.FILAMENT)
    code, out, _ = run(capsys, "sh", "convert", tmp_path / "a.txt", "--to", "unreal", "-o", tmp_path / "b.json")
    assert (code, out) == (0, f"{tmp_path / 'b.json'}\n")
    np.testing.assert_allclose(json.loads((tmp_path / "b.json").read_text())["numbers"], to_engine(f, Engine.UNREAL))


def test_convert_is_told_whose_bare_rows_are(capsys, rng, tmp_path):
    f, bare, to = rng.normal(size=(9, 3)), tmp_path / "a.json", tmp_path / "b.txt"
    bare.write_text(json.dumps(to_engine(f, Engine.GODOT).tolist()))
    assert run(capsys, "sh", "convert", bare, "--from", "godot", "--to", "filament", "-o", to)[0] == 0
    np.testing.assert_allclose(read_sh(to), f, atol=1e-13)
    code, out, err = run(capsys, "sh", "convert", bare, "--to", "filament", "-o", to)
    assert (code, out, err.count("\n")) == (2, "", 1) and "no engine is named" in err


@pytest.mark.parametrize(
    "arguments",
    [
        "sh paint",
        "sh convert no.json --to unity -o x.json",
        "sh convert no.json --to quake -o x.json",
        "sh project no.exr --to unity",
    ],
)
def test_bad_use_is_one_line_and_exit_2(capsys, arguments):
    code, out, err = run(capsys, *arguments.split())
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("gonio: error: ")


def test_a_text_is_filaments_alone(capsys, room, tmp_path):
    code, _, err = run(capsys, "sh", "project", room[0], "--to", "unity", "-o", tmp_path / "sh.txt")
    assert code == 2 and "Filament" in err and not (tmp_path / "sh.txt").exists()
