"""`gonio info` and `gonio render` of a material of facets."""

import json

import numpy as np
import pytest
from reference.verbs import run

import gonio as gn
from gonio.brdf.facet_mixture import FacetBasis, FacetMixture
from gonio.brdf.polar_grid import PolarGrid
from gonio.capture.simulation import from_above
from gonio.files.relightable import write_relightable
from gonio.rendering.relight import Relightable

GRID = PolarGrid(12, 24)


@pytest.fixture
def thing(tmp_path, rng):
    """A flat sample of 16 x 16 pixels; what lies within 40 degrees of the normal is told by its own data."""
    path = tmp_path / "cloth.gonio"
    tables = [gn.TabulatedNDF.of(gn.Beckmann(x, y), GRID.shape).values for x, y in ((0.2, 0.4), (0.5, 0.3), (0.3, 0.3))]
    trust = np.where(GRID.theta < np.radians(40), 255, np.where(GRID.theta < np.radians(60), 128, 0))
    basis = FacetBasis.of(GRID, np.stack(tables), np.broadcast_to(trust[:, None], (3, *GRID.shape)))
    weights = rng.random((16, 16, 2))
    weights /= weights.sum(axis=-1, keepdims=True)
    k_d = np.broadcast_to([0.2, 0.1, 0.05], (16, 16, 3))
    facets = FacetMixture(basis, rng.integers(0, 3, (16, 16, 2)), weights, k_d, 0.05, np.full((16, 16), 1.5))
    view = gn.simulate(gn.Plane(), gn.Lambert(0.5), [gn.Directional((0, 0, 1), [1.0])], from_above(gn.Plane(), 16)).view
    write_relightable(path, Relightable(view, facets))
    return path


def test_info_tells_what_it_is_made_of(capsys, thing):
    code, out, err = run(capsys, "info", thing, "--json")
    assert code == 0, err
    facts = json.loads(out)
    assert (facts["kind"], facts["rows"], facts["columns"]) == ("facet material", 16, 16)
    assert (facts["representatives"], facts["pairs a texel"], facts["grid"]) == (3, 2, "12 x 24, warp 1.5")
    assert facts["mean k_d"] == pytest.approx([0.2, 0.1, 0.05], rel=1e-3)
    assert facts["mean k_s"] == pytest.approx([0.05], rel=1e-3)
    assert facts["median eta"] == 1.5
    assert facts["bytes"] == thing.stat().st_size
    told = facts["facets told by"]
    assert sum(told.values()) == pytest.approx(1)
    # Of slopes of .3, exp(-(tan 40 / .3)^2) is beyond 40 degrees, more of .5.
    assert 0.9 < told["own data"] < 1
    assert 0 < told["no data"] < told["others"]


def test_a_picture_shows_its_maps_and_facets(capsys, tmp_path, thing):
    picture = tmp_path / "seen.png"
    code, _, err = run(capsys, "info", thing, "--picture", picture, "--pixels", "3,4;10,11")
    assert code == 0, err
    assert gn.image_info(picture).columns > 800


def test_it_is_rendered_on_other_shapes(capsys, tmp_path, thing):
    images = {}
    for name, how in {
        "cylinder": (),
        "repeated": ("--repeat", 3),
        "cloth": ("--shadows", "--confidence", tmp_path / "trust.exr"),
    }.items():
        output = tmp_path / f"{name}.exr"
        shape = "cylinder" if name == "repeated" else name
        light = ("--sun", "1,-1,1", "--size", 24, "--supersample", 1, "--eye", "2.6,-3.2,0")
        code, _, err = run(capsys, "render", thing, "--shape", shape, *light, *how, "-o", output)
        assert code == 0, err
        images[name] = gn.read_image(output)
        assert images[name].max() > 0.02
    assert np.abs(images["repeated"] - images["cylinder"]).max() > 1e-4
    np.testing.assert_allclose(images["repeated"].mean(), images["cylinder"].mean(), rtol=0.05)
    trust = gn.read_image(tmp_path / "trust.exr")[..., 0]
    assert trust.max() == pytest.approx(1, abs=0.01)
    assert np.any((trust > 0) & (trust < 0.9))


def test_options_that_do_not_go_together_are_refused(capsys, tmp_path, thing):
    for how, message in (
        (("--repeat", 2), "--repeat wants a --shape"),
        (("--shape", "cloth", "--compare"), "--maps and --compare"),
        (("--shadows",), "--shadows wants an --eye"),
        (("--shape", "cloth", "--repeat", 0), "times = 0"),
    ):
        code, _, err = run(capsys, "render", thing, *how, "--sun", "0,0,1", "-o", tmp_path / "image.exr")
        assert code == 2
        assert message in err


def test_far_away_a_texture_looks_as_its_mean(rng, thing):
    # Eight pixels over three tiles of 16 x 16 texels: looked up at points it would be noise.
    material = gn.read_relightable(thing).material
    camera = gn.Orthographic(pixel=2 / 8, size=(8, 8), pose=from_above(gn.Plane(), 8).pose)
    sun = gn.Directional((0.0, 0.0, 1.0), [1.0])
    up = np.array([0.0, 0.0, 1.0])
    image = gn.render(gn.Repeated(gn.Plane(), 3), material, sun, camera)
    each = material.at(rng.random((400, 2))).f(up, up)
    # Footprints of .375 of a tile are 6 texels, taken as 8: means of 64 that are bilinear.
    assert image.std(axis=(0, 1)).max() < 0.4 * each.std(axis=0).min()
    np.testing.assert_allclose(image.mean(axis=(0, 1)), each.mean(axis=0), rtol=0.05)
