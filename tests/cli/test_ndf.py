"""`gonio ndf`: a flat sample's photographs that were left out are predicted, and what cannot serve is refused."""

import contextlib
import dataclasses
import json
import shutil

import numpy as np
import pytest
from reference.verbs import run

import gonio as gn
from gonio.brdf.facet_mixture import FacetMixture
from gonio.capture.reading import ReadPhotographs
from gonio.cli import ndf as verb
from gonio.cli.simulate import _write, dome
from gonio.files.lp import write_lp

# Coarser than the default, in a fifth of its time: of the radiance .003 is lost.
QUICK = ("--grid", "14x32", "--representatives", 12)


def satin(lights, size=24):
    """A flat square, aslant, whose warp turns by a right angle over it: tangents follow uv = z^2 of z = x + iy."""
    steps = np.linspace(-1, 1, 33)
    x, y = np.meshgrid(steps, steps)
    uv = (x + 1j * y + 1.5 + 1.2j) ** 2 / 10
    k = np.arange(33**2).reshape(33, 33)
    a, b, c, d = k[:-1, :-1], k[:-1, 1:], k[1:, 1:], k[1:, :-1]
    faces = np.concatenate([np.stack([i.ravel() for i in face], axis=-1) for face in ((a, b, c), (a, c, d))])
    vertices, uv = np.stack((x, y, 0 * x), axis=-1).reshape(-1, 3), np.stack((uv.real, uv.imag), axis=-1).reshape(-1, 2)
    # Another shadowing and eta than are fitted.
    gloss = gn.Microfacet(gn.GGX(0.3, 0.5), gn.Fresnel(1.6))
    camera = gn.Orthographic(pixel=1.9 / size, size=(size, size), pose=gn.look_at((0, -2.5, 3), (0, 0, 0)))
    mesh = gn.Mesh(vertices, faces, uv=uv)
    capture = gn.simulate(mesh, gn.Lambert([0.3, 0.1, 0.05]) + gloss, lights, camera)
    return dataclasses.replace(capture, shape=None)


def written(folder, directions, exposure=0.5):
    """Photographs of satin in codes of 16 bits, with normals and mask."""
    folder.mkdir()
    _write(folder, satin(gn.distant_lights(directions, np.full(len(directions), np.pi))), [gn.Sensor(exposure)])
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return written(tmp_path_factory.mktemp("satin") / "satin", dome(80))


@pytest.fixture
def bare(tmp_path, folder):
    """The same without normals: numbered photographs and an .lp."""
    path = tmp_path / "bare"
    shutil.copytree(folder, path, ignore=shutil.ignore_patterns("*.toml", "normals.png"))
    write_lp(path / "dirs.lp", sorted(p.name for p in path.glob("photo*.png")), dome(80))
    return path


def test_photographs_left_out_are_predicted(capsys, tmp_path, folder):
    output, picture = tmp_path / "satin.gonio", tmp_path / "seen.png"
    code, out, err = run(
        *(capsys, "ndf", folder, "-o", output, *QUICK, "--leave", "10,40,70", "--picture", picture, "--json")
    )
    assert (code, err) == (0, "")
    facts, scene = json.loads(out), gn.read_capture(folder)
    assert (facts["lights"], facts["sites"], facts["warnings"]) == (77, np.count_nonzero(scene.mask), [])
    assert facts["representatives"] <= 12 and facts["bytes"] == output.stat().st_size
    # Seen from 40 degrees under lights to 75, half vectors are within 60 of the normal: most of these facets.
    assert facts["facets told by own data"] > 0.7
    assert facts["facets told by own data"] + facts["facets told by others"] == pytest.approx(1, abs=0.05)
    errors = [facts[f"error of photo{k}.png"] for k in (10, 40, 70)]
    assert facts["median of them"] == pytest.approx(np.median(errors))
    assert facts["90 % of them below"] == pytest.approx(np.percentile(errors, 90))
    # 80 lights stand 16 degrees apart, half vectors 8, a third of a lobe's width: between them its logarithm bends by
    # some hundredths.
    assert max(errors) < 0.03 and facts["residual"] < 0.02
    assert gn.image_info(picture).columns > 600
    # What is written predicts the same.
    thing = gn.read_relightable(output)
    assert isinstance(thing.material, FacetMixture)
    image, photograph = gn.relight(thing, scene.lights[40]), scene.photographs.read(40).radiance
    off = np.sqrt(np.mean((image - photograph)[scene.mask] ** 2) / np.mean(photograph[scene.mask] ** 2))
    assert off == pytest.approx(errors[1], rel=0.05)


def test_people_read_a_table_and_see_facets(capsys, tmp_path, folder):
    output, picture = tmp_path / "satin.gonio", tmp_path / "seen.png"
    code, out, err = run(capsys, "ndf", folder, "-o", output, *QUICK, "--paper", "--eta", "1.6", "--picture", picture)
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0].split() == ["lights", "80"] and lines[-1] == str(output)
    assert "error of" not in out
    assert np.allclose(gn.read_relightable(output).material.eta, 1.6, rtol=1e-3)
    assert gn.image_info(picture).columns > 800
    code, _, err = run(
        *(capsys, "render", output, "--shape", "cloth", "--sun", "1,-1,1", "--size", 16, "--supersample", 1),
        *("-o", tmp_path / "cloth.exr"),
    )
    assert code == 0, err
    assert gn.read_image(tmp_path / "cloth.exr").max() > 0.1


def test_a_sample_without_normals_is_flat_or_goes_through_photometric_stereo(capsys, tmp_path, bare):
    output = tmp_path / "satin.gonio"
    arguments = (*QUICK, "--encoding", "linear", "--leave", "40", "--json")
    code, _, err = run(capsys, "ndf", bare, "-o", output, *arguments)
    assert code == 0, err
    # Aslant it was photographed, which nothing tells here, and highlights draw normals towards the eye.
    assert "normals by photometric stereo, which highlights mislead, tilt by" in err and "give --flat" in err
    view = gn.read_relightable(output).view
    assert np.ptp(view.normal[view.mask], axis=0)[2] > 0
    code, _, err = run(capsys, "ndf", bare, "-o", output, "--flat", *arguments)
    assert code == 0, err
    assert "photometric" not in err
    view = gn.read_relightable(output).view
    assert np.all(view.normal[view.mask] == [0, 0, 1])


def test_what_ctrl_c_stops_goes_on(capsys, tmp_path, folder, monkeypatch):
    output, steps = tmp_path / "satin.gonio", []

    @contextlib.contextmanager
    def pressed(label):
        def heard(step, done, total):
            steps.append(step)
            if step == "representatives" and press:
                raise KeyboardInterrupt

        yield heard

    press = True
    monkeypatch.setattr(verb, "steps", pressed)
    code, out, err = run(capsys, "ndf", folder, "-o", output, *QUICK)
    assert (code, out, output.exists()) == (130, "", False)
    assert "--work keeps what is done" in err
    # Of many sites they are kept unasked.
    monkeypatch.setattr(verb, "_MANY", 100)
    code, _, err = run(capsys, "ndf", folder, "-o", output, *QUICK)
    work = tmp_path / "satin.gonio.work"
    assert code == 130 and f"go on with the same command: {work} holds" in err
    assert {path.name for path in work.iterdir()} == {"partial.npy", "done.npy", "made.json"}
    code, _, err = run(capsys, "ndf", folder, "-o", output, *QUICK, "--eta", "1.3")
    assert code == 2 and f"{work} was begun with another eta" in err
    code, _, err = run(capsys, "ndf", folder, "-o", output, *QUICK, "--flat", "--leave", "3")
    assert code == 2 and "another photographs" in err
    press = False
    steps.clear()
    code, _, err = run(capsys, "ndf", folder, "-o", output, *QUICK)
    assert (code, err) == (0, "")
    assert "partial distributions" not in steps and "completion" in steps
    assert output.exists() and not work.exists()


def test_lights_from_one_side_and_clipped_photographs_are_told(capsys, tmp_path):
    directions = dome(60)
    directions[:, 0] = np.abs(directions[:, 0])
    path = written(tmp_path / "side", directions, exposure=3.0)
    code, out, err = run(capsys, "ndf", path, "-o", tmp_path / "satin.gonio", *QUICK, "--json")
    assert code == 0, err
    one, two = json.loads(out)["warnings"]
    assert "lights come from one side" in one and "% of what its photographs show is clipped" in two
    assert err.splitlines() == [f"{path}: {one}", f"{path}: {two}"]


def test_what_is_not_made_of_facets_is_sent_elsewhere(capsys, tmp_path, folder):
    # Photographs of nothing that their lights have made.
    path = tmp_path / "mixed"
    shutil.copytree(folder, path)
    rng = np.random.default_rng(0)
    for photograph in path.glob("photo*.png"):
        gn.write_image(photograph, rng.random((24, 24, 3)) ** 4, "linear", bits=16)
    code, _, err = run(capsys, "ndf", path, "-o", tmp_path / "mixed.gonio", *QUICK)
    assert code == 0
    assert "of its photographs unexplained" in err and "gonio share" in err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--grid", "32"), "ROWSxCOLUMNS is wanted"),
        (("--grid", "1x9"), "2 or more rows"),
        (("--eta", "0.8"), "leave it out to have it found"),
        (("--representatives", "0"), "representatives"),
        (("--representatives", "99999"), "sites; ask for fewer"),
        (("--leave", "80"), "there are 0 to 79"),
        (("--leave", ",".join(map(str, range(70)))), "10 lights: a distribution of facets wants dozens; gonio share"),
        (("--picture", "seen.jpg"), "end its name in .png"),
        (("--output", "satin.exr"), "end its name in .gonio"),
        (("--lights", "few.lp"), "1 lights for 80 photographs"),
        (("--lights", "twice.lp"), "photo03.png and photo05.png have lights at one place: leave one of them out"),
        (("--work", "few.lp"), "few.lp cannot be a folder"),
        (("--work", "."), "holds other things"),
    ],
)
def test_bad_use_is_one_line_and_leaves_no_file(capsys, tmp_path, folder, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "few.lp").write_text("1\na.png 0 0 1\n")
    twice = dome(80)
    twice[5] = twice[3]
    write_lp(tmp_path / "twice.lp", [f"{k}.png" for k in range(80)], twice)
    code, out, err = run(capsys, "ndf", folder, "-o", "satin.gonio", *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert not (tmp_path / "satin.gonio").exists()


def test_lights_are_wanted(capsys, tmp_path, bare):
    (bare / "dirs.lp").unlink()
    code, _, err = run(capsys, "ndf", bare, "-o", tmp_path / "a.gonio", "--encoding", "linear", "--flat")
    assert code == 2
    assert "its lights are unknown; give them as --lights" in err.splitlines()[-1]


def test_photographs_too_large_to_hold_are_read_as_they_are_needed(capsys, tmp_path, folder, monkeypatch):
    found = []
    for held in (verb._HELD, 1000):
        monkeypatch.setattr(verb, "_HELD", held)
        code, _, err = run(capsys, "ndf", folder, "-o", tmp_path / "a.gonio", *QUICK)
        assert code == 0
        found.append(gn.read_relightable(tmp_path / "a.gonio").material)
    assert "gonio ingest makes this quick" in err
    assert np.array_equal(found[0].k_s, found[1].k_s) and np.array_equal(found[0].indices, found[1].indices)


def test_photographs_that_are_held_are_those_that_were_read(folder):
    capture = gn.read_capture(folder)
    at = np.flatnonzero(capture.mask)
    read = ReadPhotographs(capture.photographs, at)
    photograph, clipped = capture.photographs.read(7)
    np.testing.assert_array_equal(read.read(7).radiance, np.where(capture.mask[..., None], photograph, 0))
    np.testing.assert_array_equal(read.read(7).clipped, clipped | ~capture.mask)
    some = np.array([0, at[5], at[2]])
    assert some[0] not in at
    for a, b in zip(read.pixels(some), (x[:, some] for x in _all(read)), strict=True):
        np.testing.assert_array_equal(a, b)


def _all(read):
    every = [read.read(k) for k in range(len(read))]
    return np.stack([x.reshape(-1, 3) for x, _ in every]), np.stack([x.ravel() for _, x in every])


def test_mixtures_of_sites_become_textures_of_whole_numbers(folder):
    capture = gn.read_capture(folder)
    count, (rows, columns) = np.count_nonzero(capture.mask), capture.mask.shape
    grid = gn.brdf.polar_grid.PolarGrid(4, 8)
    basis = gn.brdf.facet_mixture.FacetBasis.of(grid, np.ones((count, *grid.shape)))
    indices = np.stack((np.arange(count), np.arange(count)[::-1]), axis=-1)
    weights = np.full((count, 2), 0.5)
    material = capture.textures(FacetMixture(basis, indices, weights, 0.1, np.ones((count, 3)), np.full(count, 1.4)))
    assert (material.indices.shape, material.indices.dtype) == ((rows, columns, 2), np.int32)
    assert (material.weights.dtype, material.k_s.shape, material.eta.shape) == (
        np.float32,
        (rows, columns, 3),
        (rows, columns),
    )
    np.testing.assert_array_equal(material.indices[capture.mask], indices)
    assert material.k_d == 0.1


def test_a_sample_turned_under_the_camera_is_fitted_with_it(capsys, tmp_path, folder):
    output = tmp_path / "both.gonio"
    code, out, err = run(capsys, "ndf", folder, "-o", output, *QUICK, "--turned", folder, "--json")
    assert (code, err) == (0, "")
    material = gn.read_relightable(output).material
    assert material.k_d.shape[:2] == (24, 24)  # of the first alone
    assert json.loads(out)["sites"] == np.count_nonzero(gn.read_capture(folder).mask)
