"""Half/difference tables: symmetries, look-ups against the plain twin, and what a table keeps of a known model."""

import dataclasses

import numpy as np
import pytest
from reference import half_difference as twin

import gonio as gn
from gonio.brdf.model import BRDF
from gonio.brdf.table import HalfDifferenceTable, above_surface
from gonio.directions import from_half_difference, from_spherical
from gonio.errors import ArrayError, ParameterError


def directions(rng, n, lowest=0.05):
    z = rng.uniform(lowest, 1, n)
    phi = rng.uniform(0, 2 * np.pi, n)
    return from_spherical(np.arccos(z), phi)


@dataclasses.dataclass(frozen=True, eq=False)
class Glossy(BRDF):
    """Lambert and a Blinn lobe, in closed form: smooth everywhere, isotropic, reciprocal."""

    exponent: float = 50.0

    def _f(self, xp, wi, wo):
        h = wi + wo
        cosine = h[..., 2] / xp.sqrt(xp.sum(h * h, axis=-1))
        lobe = xp.clip(cosine, 0.0, None) ** self.exponent
        return xp.stack([0.1 + 0.5 * lobe, 0.2 + lobe, 0.3 + 2 * lobe], axis=-1)


@pytest.fixture
def noise(rng):
    """A table without any structure, so that no two cells can be mistaken for each other."""
    return rng.uniform(size=(7, 6, 10, 3))


def test_look_ups_are_the_plain_twins(rng, noise):
    table = HalfDifferenceTable(noise)
    wi, wo = directions(rng, 300), directions(rng, 300)
    expected = np.array([twin.trilinear(table.values, a, b) for a, b in zip(wi, wo, strict=True)])
    # Single-precision table, and acos near the pole in the twin.
    assert np.allclose(table.f(wi, wo), expected, atol=1e-5)
    cells = np.array([twin.nearest(table.values, a, b) for a, b in zip(wi, wo, strict=True)])
    assert np.array_equal(dataclasses.replace(table, nearest=True).f(wi, wo), cells.astype(np.float64))


def test_tables_are_reciprocal_and_isotropic(rng, noise):
    table = HalfDifferenceTable(noise)
    wi, wo = directions(rng, 200), directions(rng, 200)
    assert np.allclose(table.f(wi, wo), table.f(wo, wi), atol=1e-6)
    turn = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])
    assert np.allclose(table.f(wi, wo), table.f(wi @ turn.T, wo @ turn.T), atol=1e-6)


def test_centres_give_their_cells_back_whole(noise):
    table = HalfDifferenceTable(noise, above_surface(noise.shape[:3]))
    j, k, m = np.nonzero(table.valid)
    wi, wo = from_half_difference(
        np.pi / 2 * ((j + 0.5) / 7) ** 2, 0.3, np.pi / 2 * (k + 0.5) / 6, np.pi * (m + 0.5) / 10
    )
    assert np.allclose(table.f(wi, wo), noise[j, k, m], atol=1e-5)


def test_a_table_keeps_what_its_resolution_can(rng):
    model = Glossy()
    table = HalfDifferenceTable.of(model, (90, 12, 16))  # f changes with theta_h alone
    wi, wo = directions(rng, 3000, 0.2), directions(rng, 3000, 0.2)
    f = model.f(wi, wo)
    # Linear interpolation errs by spacing^2/8 times the second derivative: rows are 2 degrees apart at 45 degrees,
    # the lobe's curvature some 30 times its height: .5 % of the highlight.
    assert np.abs(table.f(wi, wo) - f).max() < 5e-3 * f.max()
    # The nearest cell errs by half a row times the slope (some 5 times the height a radian), ten times as much.
    cell = np.abs(dataclasses.replace(table, nearest=True).f(wi, wo) - f).max()
    assert 5e-3 * f.max() < cell < 0.1 * f.max()


def test_lambert_is_kept_exactly(rng):
    table = HalfDifferenceTable.of(gn.Lambert([0.1, 0.5, 0.9]), (9, 8, 10))
    f = table.f(directions(rng, 100), directions(rng, 100))
    assert np.allclose(f, np.array([0.1, 0.5, 0.9]) / np.pi, rtol=1e-6)


def test_ggx_survives_tabulation(rng):
    model = gn.Lambert(0.3) + gn.Microfacet(gn.GGX(0.3), gn.Fresnel(1.5))
    table = HalfDifferenceTable.of(model, (60, 20, 24))
    wi, wo = directions(rng, 3000, 0.3), directions(rng, 3000, 0.3)
    f = model.f(wi, wo)
    # Cells of 4.5 and 7.5 degrees leave 6 % where Fresnel's term rises; MERL's own resolution leaves .3 %.
    assert np.abs(table.f(wi, wo)[..., :1] / f - 1).max() < 0.08


def test_nothing_is_reflected_below_the_surface(noise):
    table = HalfDifferenceTable(noise + 1)
    up, down = np.array([0.6, 0, 0.8]), np.array([0.6, 0, -0.8])
    assert np.all(table.f(up, up) > 0)
    assert not table.f(up, down).any()
    assert not table.f(down, up).any()


def test_cells_that_were_not_measured_take_the_nearest_along_theta_h(noise):
    valid = np.ones(noise.shape[:3], bool)
    valid[2:4, 1, 3] = False
    valid[:, 4, 5] = False
    noise[~valid] = np.nan
    table = HalfDifferenceTable(noise, valid)
    assert np.array_equal(table.values[2, 1, 3], table.values[1, 1, 3])
    assert np.array_equal(table.values[3, 1, 3], table.values[4, 1, 3])
    # No row of theta_h has (4, 5): the nearest along theta_d stands in, the smaller where two are alike.
    assert np.array_equal(table.values[:, 4, 5], table.values[:, 3, 5])
    assert np.array_equal(table.valid, valid)
    assert np.array_equal(HalfDifferenceTable(table.values, valid).values, table.values)


def test_one_measured_cell_fills_the_table(noise):
    valid = np.zeros(noise.shape[:3], bool)
    valid[3, 2, 1] = True
    assert np.array_equal(
        HalfDifferenceTable(noise, valid).values, np.broadcast_to(noise[3, 2, 1], noise.shape).astype(np.float32)
    )


def test_the_mask_is_where_both_directions_are_above():
    shape = (9, 8, 10)
    j, k, m = np.indices(shape)
    wi, wo = from_half_difference(
        np.pi / 2 * ((j + 0.5) / 9) ** 2, 0.0, np.pi / 2 * (k + 0.5) / 8, np.pi * (m + 0.5) / 10
    )
    assert np.array_equal(above_surface(shape), (wi[..., 2] > 0) & (wo[..., 2] > 0))


@pytest.mark.parametrize("nearest", [False, True])
def test_tensors_get_the_same_values_in_kind(rng, noise, nearest):
    torch = pytest.importorskip("torch")
    table = HalfDifferenceTable(noise, nearest=nearest)
    wi, wo = directions(rng, 200)[:, None], directions(rng, 5)
    ours = table.f(wi, wo)
    assert ours.shape == (200, 5, 3)
    assert table.f(wi.astype(np.float32), wo.astype(np.float32)).dtype == np.float32
    theirs = table.f(torch.asarray(wi), torch.asarray(wo))
    assert theirs.dtype == torch.float64
    assert np.allclose(theirs.numpy(), ours, atol=1e-6)


@pytest.mark.parametrize(
    ("values", "valid", "message"),
    [
        (np.ones((3, 3, 4)), None, "theta_h, theta_d, phi_d"),
        (np.ones((3, 3, 4, 2)), None, "1 or 3"),
        (np.full((3, 3, 4, 1), -1.0), None, "unmeasured"),
        (np.full((3, 3, 4, 1), np.nan), None, "nan"),
        (np.ones((3, 3, 4, 1)), np.ones((3, 4, 3)), "cells"),
        (np.ones((3, 3, 4, 1)), np.zeros((3, 3, 4)), "no cell"),
    ],
)
def test_bad_tables_are_refused(values, valid, message):
    with pytest.raises(ArrayError, match=message):
        HalfDifferenceTable(values, valid)


def test_models_that_no_isotropic_table_can_hold_are_refused():
    class Brushed(BRDF):
        def _f(self, xp, wi, wo):
            return 1 + (wi + wo)[..., :1]

    with pytest.raises(ParameterError, match="phi_h"):
        HalfDifferenceTable.of(Brushed(), (5, 5, 6))
    with pytest.raises(ParameterError, match="site"):
        HalfDifferenceTable.of(gn.Lambert(np.full((4, 1, 1, 1), 0.5)), (5, 5, 6))
