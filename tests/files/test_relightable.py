"""Facts about .gonio files that hold what reflectance sharing found of one view."""

import dataclasses
import json
import zipfile

import numpy as np
import pytest
from reference.archives import first, rewritten, with_array, with_fields, without

import gonio as gn
from gonio.brdf.coverage import Coverage
from gonio.brdf.radial import Interpolant, Radial
from gonio.capture.simulation import from_above
from gonio.files.relightable import read_relightable, write_relightable
from gonio.rendering.relight import Relightable, relight, relit_confidence

SUN = gn.Directional(np.array([0.6, 0, 0.8]), [3.0, 3.0, 3.0])


@pytest.fixture(scope="module")
def view():
    return gn.simulate(gn.Sphere(), gn.Lambert(0.5), [SUN], from_above(gn.Sphere(), 12)).view


def radial(rng, d, limits=None, channels=3, **options):
    """One with d coordinates, whose values lie near 0."""
    centres, coefficients = rng.random((20, d)), rng.normal(size=(20, channels)) / 50
    interpolant = Interpolant(
        centres, rng.uniform(0.2, 1, d), coefficients, rng.normal(size=(d + 1, channels)), limits, 0.25
    )
    return Radial(interpolant, **options)


def materials(rng, view):
    x, y = rng.random((2, *view.mask.shape))
    limits = np.array([[-2.0] * 3, [2.0] * 3])
    spatial = radial(rng, 5, limits, x=x, y=y)
    return {
        "homogeneous": radial(rng, 3),
        "gray": radial(rng, 3, limits[:, :1], channels=1),
        "spatial": spatial,
        "covered": dataclasses.replace(spatial, coverage=Coverage(rng.random((9, 5)), rng.uniform(0.5, 1, 5), 0.125)),
        "flat": radial(rng, 2, limits, flat=True),
        "the paper's": radial(rng, 5, logarithm=False, folded=False, x=x, y=y),
        "scaled": spatial * rng.random((*view.mask.shape, 3)),
        "of one colour": [0.5, 0.2, 0.1] * radial(rng, 3),
        "sum": spatial + 0.5 * radial(rng, 4, x=x, y=y, flat=True) + radial(rng, 3),
    }


CASES = ["homogeneous", "gray", "spatial", "covered", "flat", "the paper's", "scaled", "of one colour", "sum"]


@pytest.mark.parametrize("case", CASES)
def test_what_was_written_is_read(tmp_path, rng, view, case):
    thing = Relightable(view, materials(rng, view)[case])
    write_relightable(tmp_path / "thing.gonio", thing, "by hand")
    read = read_relightable(tmp_path / "thing.gonio")
    np.testing.assert_array_equal(read.view.mask, view.mask)
    for name in ("position", "lifted", "normal", "wo", "uv"):
        # Places are in single precision, of a ball of radius 1.
        np.testing.assert_allclose(getattr(read.view, name), getattr(view, name), atol=3e-7)
    assert read.shape is None
    assert json.loads(zipfile.ZipFile(tmp_path / "thing.gonio").read("gonio.json"))["made"] == "by hand"
    models = [getattr(lobe, "model", lobe) for lobe in read.material.lobes()]
    assert {model.interpolant.rho for model in models} == {0.25}
    image = relight(thing, SUN)
    assert image.max() > 0.1
    np.testing.assert_allclose(relight(read, SUN), image, rtol=1e-4, atol=1e-5)
    trust = relit_confidence(read, SUN)
    np.testing.assert_allclose(trust, relit_confidence(thing, SUN), atol=1e-3)
    assert (trust[view.mask].min() < 0.9) == (case == "covered")


def test_the_same_thing_makes_the_same_file(tmp_path, rng, view):
    thing = Relightable(view, materials(rng, view)["sum"])
    for name in ("a", "b"):
        write_relightable(tmp_path / name, thing)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_mesh_comes_back_with_its_uv_or_without(tmp_path, rng, view):
    path = tmp_path / "thing.gonio"
    vertices, faces = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])
    for uv in (vertices[:, :2], None):
        write_relightable(path, Relightable(view, radial(rng, 3), gn.Mesh(vertices, faces, uv)))
        shape = read_relightable(path).shape
        np.testing.assert_array_equal(shape.vertices, vertices)
        np.testing.assert_array_equal(shape.faces, faces)
        assert (shape.uv is None) == (uv is None)


@pytest.mark.parametrize("material", [gn.Lambert(0.5), 2 * (gn.Lambert(0.5) + gn.Lambert(0.1))])
def test_other_materials_are_refused_and_leave_no_file(tmp_path, rng, view, material):
    path = tmp_path / "thing.gonio"
    for given in (material, radial(rng, 3) + material):
        with pytest.raises(gn.errors.FileError, match=r"a (Lambert|Sum) is not written"):
            write_relightable(path, Relightable(view, given))
    assert not path.exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (with_fields(gonio="shrm"), "field 'gonio' is 'shrm'"),
        (with_fields(version=2), "field 'version' is 2"),
        (with_fields(terms=[]), "field 'terms'"),
        (with_fields(terms="radial"), "field 'terms'"),
        (with_fields(terms=[{"logarithm": True, "folded": 1, "flat": False}]), r"terms\[0\]"),
        (with_fields(terms=[{"logarithm": True, "folded": True, "flat": True}]), "5 coordinates"),
        (with_fields(terms=[{"logarithm": True, "folded": True, "flat": False, "rho": "stiff"}]), "rho = 'stiff'"),
        (with_fields(terms=[{"logarithm": True, "folded": True, "flat": False, "rho": -1}]), "rho = -1"),
        (with_fields(terms=[{"logarithm": True, "folded": True, "flat": False}] * 2), "term-1-centres.npy is missing"),
        (without("term-0-scales.npy"), "term-0-scales.npy is missing"),
        (without("term-0-y.npy"), "x and y are given both"),
        (without("mask.npy"), "mask.npy is missing"),
        (without("wo.npy"), "wo.npy is missing"),
        (without("gonio.json"), "no gonio.json"),
        (with_array("term-0-coefficients", first(np.nan)), r"coefficients\[0, 0\] is nan"),
        (with_array("term-0-coefficients", lambda a: a[1:]), "coefficients has shape"),
        (with_array("term-0-scales", first(-1)), "a scale is -1"),
        (with_array("term-0-limits", first(9)), "limits"),
        (with_array("term-0-x", first(np.nan)), "x = nan"),
        (with_array("term-0-x", lambda a: a[:, 1:]), r"x \(12, 11\)"),
        (with_array("term-0-factor", first(-1)), "factor = -1"),
        (with_array("mask", lambda a: a.astype(np.uint8)), "mask.npy is uint8"),
        (with_array("mask", lambda a: a.ravel()), "pixels of bool"),
        (with_array("mask", lambda a: a & False), "some seen|is wanted"),
        (with_array("position", lambda a: a[1:]), "position.npy has shape"),
        (with_array("lifted", first(np.inf)), "lifted.npy has shape .* not finite"),
        (with_array("normal", lambda a: 2 * a), "normal.npy holds vectors that are not unit"),
        (lambda entries: entries | {"wo.npy": entries["wo.npy"][:-4]}, "says it holds"),
    ],
)
def test_files_that_are_not_right_are_refused_by_name(tmp_path, rng, view, change, message):
    path = tmp_path / "thing.gonio"
    write_relightable(path, Relightable(view, materials(rng, view)["scaled"]))
    rewritten(path, change)
    with pytest.raises(gn.errors.FileError, match=message) as refused:
        read_relightable(path)
    assert str(path) in str(refused.value)


def test_another_kind_of_gonio_file_is_refused(tmp_path, rng, view):
    write_relightable(tmp_path / "thing.gonio", Relightable(view, radial(rng, 3)))
    with pytest.raises(gn.errors.FileError, match="'relightable'; a file with 'shrm'"):
        gn.read_shrm(tmp_path / "thing.gonio")


def test_residuals_come_back_in_half_floats(tmp_path, rng, view):
    path, count = tmp_path / "thing.gonio", int(view.mask.sum())
    kept = gn.Residuals(gn.normalise(rng.normal(size=(4, 3))), 1e6 * rng.normal(size=(4, count, 3)), 0.5, 0.03)
    write_relightable(path, Relightable(view, radial(rng, 3), residuals=kept))
    read = read_relightable(path).residuals
    assert (read.reach, read.noise) == (0.5, 0.03)
    np.testing.assert_allclose(read.directions, kept.directions, atol=1e-12)
    np.testing.assert_allclose(read.images, kept.images, rtol=5e-4, atol=1e-6 * np.abs(kept.images).max())
    for change, message in (
        (with_fields(residuals={"reach": 1.0, "noise": 0.1}), "'residuals'"),
        (with_fields(residuals={"reach": -1.0, "noise": 0.1, "scale": 1.0}), "reach = -1"),
        (without("residual-images.npy"), "residual-images.npy is missing"),
    ):
        write_relightable(path, Relightable(view, radial(rng, 3), residuals=kept))
        rewritten(path, change)
        with pytest.raises(gn.errors.FileError, match=message):
            read_relightable(path)
