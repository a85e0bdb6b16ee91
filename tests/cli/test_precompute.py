"""`gonio precompute`: what `gonio share` wrote, compressed for all light, and its picture beside the full model."""

import json

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import gonio as gn
from gonio.brdf.radial import Interpolant
from gonio.capture.simulation import from_above
from gonio.cli.precompute import precompute
from gonio.errors import FileError
from gonio.files.precomputed import read_precomputed
from gonio.files.relightable import write_relightable
from gonio.rendering.relight import Relightable

FAST = ("--side", "4", "--samples", "1", "--error", ".05")


@pytest.fixture(scope="module")
def app():
    app = typer.Typer(pretty_exceptions_enable=False)
    app.command()(precompute)
    return app


@pytest.fixture(scope="module")
def thing(tmp_path_factory):
    rng = np.random.default_rng(3)
    interpolant = Interpolant(
        rng.random((30, 3)), np.ones(3), rng.normal(size=(30, 3)) / 50, rng.normal(size=(4, 3)) / 2
    )
    vase = gn.vase(24)
    view = vase.view(from_above(vase, 12))
    path = tmp_path_factory.mktemp("thing") / "thing.gonio"
    write_relightable(path, Relightable(view, gn.Radial(interpolant), vase))
    return path


def run(app, *arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments], catch_exceptions=False)


def test_the_file_relights_and_the_numbers_say_how_well(app, tmp_path, thing):
    output, picture = tmp_path / "fast.gonio", tmp_path / "seen.png"
    room = tmp_path / "room.exr"
    gn.write_environment(room, gn.studio(16))
    shown = ("--light", room, "--sun", "0,.6,.8:3", "--picture", picture, "--json")
    said = run(app, thing, "-o", output, *FAST, *shown)
    assert said.exit_code == 0, said.output
    facts, made = json.loads(said.stdout), read_precomputed(output)
    assert facts["error"] == made.error <= 0.05
    assert facts["lights"] == made.lights.shape[1] and facts["bytes"] == output.stat().st_size
    # A lamp is as wide as its cell, 22 degrees.
    assert facts["off under room.exr"] < 0.1 and facts["off under 0,.6,.8:3"] < 0.5
    info = gn.image_info(picture)
    assert (info.rows, info.columns) == (2 * made.mask.shape[0], 3 * made.mask.shape[1])
    assert made.made.startswith("gonio precompute thing.gonio --error 0.05 --side 4")


def test_people_read_a_table_and_the_file(app, tmp_path, thing):
    output, picture = tmp_path / "fast.gonio", tmp_path / "seen.png"
    said = run(app, thing, "-o", output, "--no-shadows", *FAST, "--picture", picture)
    assert said.stdout.splitlines()[-1] == str(output)
    assert "off under studio" in said.stdout and gn.image_info(picture).columns > 30


def test_files_of_other_names_are_refused_before_the_work(app, tmp_path, thing):
    with pytest.raises(FileError, match="gonio"):
        run(app, thing, "-o", tmp_path / "fast.png")
    with pytest.raises(FileError, match="png"):
        run(app, thing, "-o", tmp_path / "fast.gonio", "--picture", tmp_path / "seen.exr")
    assert not list(tmp_path.iterdir())
