"""Facts about .gonio files that hold mixtures of tabulated facet distributions."""

import dataclasses
import io
import json
import zipfile

import numpy as np
import pytest
from reference.archives import first, rewritten, with_array, with_fields, without

import gonio as gn
from gonio.brdf.facet_mixture import FacetBasis, FacetMixture
from gonio.brdf.polar_grid import PolarGrid
from gonio.capture.simulation import from_above
from gonio.files.relightable import read_relightable, write_relightable
from gonio.rendering.relight import Relightable, relight, relit_confidence

GRID = PolarGrid(12, 16)
SUN = gn.Directional(np.array([0.3, 0.1, 0.95]) / np.linalg.norm([0.3, 0.1, 0.95]), [3.0, 3.0, 3.0])
NAMES = ("indices", "weights", "k_d", "k_s", "eta")
ENTRY = {"model": "facets", "rows": 12, "columns": 16, "warp": 1.5}


@pytest.fixture(scope="module")
def view():
    return gn.simulate(gn.Plane(), gn.Lambert(0.5), [SUN], from_above(gn.Plane(), 8)).view


@pytest.fixture
def facets(rng):
    tables = [gn.TabulatedNDF.of(gn.Beckmann(x, y), GRID.shape).values for x, y in ((0.2, 0.4), (0.5, 0.3), (0.3, 0.3))]
    basis = FacetBasis.of(GRID, np.stack(tables), rng.integers(0, 256, (3, *GRID.shape)))
    weights = rng.uniform(-0.1, 1, (8, 8, 2))
    k_d, k_s = rng.random((2, 8, 8, 3))
    return FacetMixture(
        basis,
        rng.integers(0, 3, (8, 8, 2)),
        weights / weights.sum(axis=-1, keepdims=True),
        k_d,
        k_s,
        rng.uniform(1.3, 2, (8, 8)),
    )


def stored(path, name):
    return np.load(io.BytesIO(zipfile.ZipFile(path).read(f"term-0-{name}.npy")))


def test_a_mixture_comes_back_within_half_floats(tmp_path, view, facets):
    path, thing = tmp_path / "thing.gonio", Relightable(view, facets)
    write_relightable(path, thing, "by hand")
    read = read_relightable(path)
    assert [stored(path, name).dtype for name in ("tables", "indices", "trust")] == [np.float16, np.uint16, np.uint8]
    np.testing.assert_array_equal(read.material.indices, facets.indices)
    np.testing.assert_array_equal(read.material.basis.trust, facets.basis.trust)
    # Half floats round to one part in 2048, and each sum and integral is 1 again.
    for name in NAMES[1:]:
        np.testing.assert_allclose(getattr(read.material, name), getattr(facets, name), rtol=2e-3, atol=1e-6)
    np.testing.assert_allclose(read.material.basis.tables, facets.basis.tables, rtol=1e-3, atol=1e-5)
    np.testing.assert_allclose(read.material.weights.sum(axis=-1), 1, atol=1e-6)
    image = relight(thing, SUN)
    assert image.max() > 0.1
    np.testing.assert_allclose(relight(read, SUN), image, rtol=4e-3)
    np.testing.assert_allclose(relit_confidence(read, SUN), relit_confidence(thing, SUN), atol=2e-3)


def test_what_is_the_same_everywhere_stands_once_and_trust_may_be_unknown(tmp_path, view, facets):
    path = tmp_path / "thing.gonio"
    one = dataclasses.replace(facets, k_d=0.5, k_s=[0.25], eta=1.5, basis=FacetBasis(GRID, facets.basis.tables))
    write_relightable(path, Relightable(view, one))
    read = read_relightable(path).material
    assert [getattr(read, name).shape for name in NAMES] == [(8, 8, 2), (8, 8, 2), (), (1,), ()]
    assert read.basis.trust is None
    single = FacetMixture(one.basis, [1], [1.0])
    write_relightable(path, Relightable(view, single))
    np.testing.assert_allclose(relight(read_relightable(path), SUN), relight(Relightable(view, single), SUN), rtol=1e-3)


def test_terms_of_facets_are_scaled_and_added_as_others(tmp_path, rng, view, facets):
    path = tmp_path / "thing.gonio"
    thing = Relightable(view, facets * rng.random((8, 8, 3)) + 0.5 * facets)
    write_relightable(path, thing)
    np.testing.assert_allclose(relight(read_relightable(path), SUN), relight(thing, SUN), rtol=4e-3)


@pytest.mark.parametrize("scale", [1e-7, 1e6])
def test_what_half_floats_do_not_hold_is_held_in_single_precision(tmp_path, view, facets, scale):
    path = tmp_path / "thing.gonio"
    thing = dataclasses.replace(facets, k_d=facets.k_d * scale, k_s=facets.k_s * scale)
    write_relightable(path, Relightable(view, thing))
    assert stored(path, "k_s").dtype == np.float32
    np.testing.assert_allclose(read_relightable(path).material.k_s, thing.k_s, rtol=1e-6)
    with pytest.raises(gn.errors.FileError, match="k_d = 1e\\+60 is beyond single precision"):
        write_relightable(tmp_path / "b.gonio", Relightable(view, dataclasses.replace(facets, k_d=1e60)))
    assert not (tmp_path / "b.gonio").exists()


def test_many_tables_are_counted_in_whole_numbers_that_suffice(tmp_path, view):
    path, grid = tmp_path / "thing.gonio", PolarGrid(2, 3)
    for count, dtype in ((65536, np.uint16), (65537, np.int32)):
        basis = FacetBasis.of(grid, np.ones((count, 2, 3), np.float32))
        write_relightable(path, Relightable(view, FacetMixture(basis, [count - 1], [1.0])))
        assert stored(path, "indices").dtype == dtype
        assert read_relightable(path).material.indices[0] == count - 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (with_fields(terms=[ENTRY | {"model": "glass"}]), r"terms\[0\] has model = 'glass'"),
        (with_fields(terms=[ENTRY | {"rows": 12.0}]), r"terms\[0\] is .* whole numbers"),
        (with_fields(terms=[ENTRY | {"warp": None}]), r"terms\[0\] is .* warp a number"),
        (with_fields(terms=[ENTRY | {"warp": 9}]), "term-0: PolarGrid: warp = 9"),
        (with_fields(terms=[ENTRY | {"rows": 13}]), r"term-0: FacetBasis: tables has shape \(3, 12, 16\)"),
        (without("term-0-tables.npy"), "term-0-tables.npy is missing"),
        (without("term-0-eta.npy"), "term-0-eta.npy is missing"),
        (with_array("term-0-tables", first(np.nan)), "term-0-tables.npy is float16, or not finite"),
        (with_array("term-0-tables", first(-1)), r"term-0: FacetBasis: tables\[0, 0, 0\] = -1"),
        (with_array("term-0-tables", lambda a: 0 * a), "zero throughout"),
        (with_array("term-0-trust", lambda a: a[1:]), r"term-0: FacetBasis: trust has shape \(2, 12, 16\)"),
        (with_array("term-0-trust", lambda a: a / 2), "term-0-trust.npy is float64"),
        (with_array("term-0-indices", first(3)), "term-0: FacetMixture: indices = 3; basis has tables 0 to 2"),
        (with_array("term-0-indices", lambda a: a[:, :, :1]), r"indices \(8, 8, 1\) and weights \(8, 8, 2\)"),
        (with_array("term-0-indices", lambda a: a.astype(np.float32)), "indices has dtype float32"),
        (with_array("term-0-weights", first(np.inf)), "term-0-weights.npy is float16, or not finite"),
        (with_array("term-0-weights", lambda a: 0 * a), r"term-0-weights.npy has .* not positive"),
        (with_array("term-0-k_s", first(-0.5)), "term-0: FacetMixture: k_s = -0.5"),
        (with_array("term-0-k_d", lambda a: a[1:]), r"k_d \(7, 8\)"),
        (with_array("term-0-eta", first(0.5)), "eta = 0.5"),
    ],
)
def test_files_that_are_not_right_are_refused_by_name(tmp_path, view, facets, change, message):
    path = tmp_path / "thing.gonio"
    write_relightable(path, Relightable(view, facets))
    entry = json.loads(zipfile.ZipFile(path).read("gonio.json"))
    assert (entry["terms"], entry["version"]) == ([ENTRY], 1)
    rewritten(path, change)
    with pytest.raises(gn.errors.FileError, match=message) as refused:
        read_relightable(path)
    assert str(path) in str(refused.value)
