"""`gonio plan`: what a folder's photographs tell, for people and for machines."""

import json
import math
import shutil

import numpy as np
import pytest
from reference.verbs import run

import gonio as gn
from gonio.cli import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A matte ball under nine lights, 24 x 24, its normals known."""
    path = tmp_path_factory.mktemp("ball") / "ball"
    with pytest.raises(SystemExit):
        main(["simulate", "-o", str(path), "--count", "9", "--size", "24"])
    return path


@pytest.fixture
def shapeless(folder, tmp_path):
    """The first of its photographs with their lights and nothing else."""

    def made(count):
        capture = gn.read_capture(folder)
        for k in range(count):
            image = np.where(capture.mask[..., None], capture.photographs.read(k).radiance, 0)
            gn.write_image(tmp_path / f"photo{k}.png", image, "linear", bits=16, clip=True)
        names = [f"photo{k}.png" for k in range(count)]
        gn.write_lp(tmp_path / "dirs.lp", names, capture.directions[:count])
        return tmp_path

    return made


def test_people_read_a_few_lines(capsys, tmp_path, folder):
    picture = tmp_path / "plan.png"
    code, out, err = run(capsys, "plan", folder, "--highlight", 20, "--texture", 10, "--picture", picture)
    lines = out.splitlines()
    assert code == 0, err
    assert lines[0].startswith("9 photographs, lights ")
    assert lines[1].startswith("theta_d from ")
    assert lines[2].startswith("shared: highlights down to ")
    assert lines[3].startswith("each pixel alone: ") and lines[3].endswith("texture no finer than 4 pixels")
    assert lines[4].startswith("to tell highlights of 20 degrees and texture of 10 pixels, lights evenly out to ")
    assert lines[5:] == [str(picture)]
    assert gn.image_info(picture).columns > 600


def test_machines_read_the_plan(capsys, folder):
    code, out, err = run(capsys, "plan", folder, "--highlight", 2, "--texture", 10, "--json")
    facts, capture = json.loads(out), gn.read_capture(folder)
    assert code == 0, err
    found = gn.plan_sharing(capture.normals, capture.directions, mask=capture.mask)
    assert facts["dtheta, degrees"] == pytest.approx(math.degrees(found.dtheta))
    assert facts["dalpha, degrees"] == pytest.approx(math.degrees(found.dalpha))
    assert facts["shared"]["texture, pixels"] == pytest.approx(found.shared.texture)
    # A ball of 12 pixels turns by some 6 degrees a pixel: no number of photographs shares highlights of 2.
    needed = found.photographs_for(math.radians(2), 10)
    assert facts["photographs needed"] == {"shared": None, "alone": needed.alone}
    assert (facts["flat"], facts["one theta_d"]) == (False, False)


def test_without_a_shape_normals_are_those_of_the_photographs(capsys, folder, shapeless):
    code, out, err = run(capsys, "plan", shapeless(9), "--encoding", "linear", "--json")
    assert code == 0, err
    assert "normals by photometric stereo" in err
    _, known, _ = run(capsys, "plan", folder, "--json")
    # They are of other pixels at the rim, where normals turn fast.
    assert json.loads(out)["dalpha, degrees"] == pytest.approx(json.loads(known)["dalpha, degrees"], rel=0.15)
    assert json.loads(out)["dtheta, degrees"] == pytest.approx(json.loads(known)["dtheta, degrees"])


def test_one_photograph_tells_no_texture(capsys, tmp_path, folder):
    shutil.copytree(folder, tmp_path / "one")
    text = (folder / "capture.toml").read_text()
    start, end = text.index("photographs = ["), text.index("encoding")
    text = text[:start] + 'photographs = ["photo0.png"]\n' + text[end : text.index("[lights]")]
    (tmp_path / "one" / "capture.toml").write_text(text + "[lights]\ndirections = [[0.6, 0, 0.8]]\n")
    code, out, err = run(capsys, "plan", tmp_path / "one" / "capture.toml", "--texture", 20)
    assert code == 0, err
    assert out.startswith("1 photograph; normals turn by ")
    assert "theta_d is 18 degrees throughout" in out
    assert "degrees wide, no texture\n" in out
    assert "each pixel alone: no highlights" in out
    assert "90 degrees from the eye" in out


def test_what_cannot_be_planned_is_refused(capsys, folder, shapeless):
    two = shapeless(2)
    for arguments, message in (
        ((folder, "--highlight", 0), "--highlight 0: degrees above 0"),
        ((folder, "--texture", 1), "--texture 1: a period is two pixels"),
        ((folder, "--picture", "plan.jpg"), "plan.jpg"),
        ((two, "--encoding", "linear"), "2 photographs are too few to tell normals from"),
    ):
        code, out, err = run(capsys, "plan", *arguments)
        assert (code, out) == (2, "")
        assert message in err
    (two / "dirs.lp").unlink()
    code, _, err = run(capsys, "plan", two, "--encoding", "linear")
    assert code == 2
    assert "its lights are unknown; give --lights" in err
