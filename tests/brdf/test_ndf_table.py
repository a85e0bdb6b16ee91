"""Tabulated distributions of facets: what they keep, their mass, turns, sampling, and their place in Microfacet."""

import dataclasses
import itertools

import numpy as np
import pytest

import gonio as gn
from gonio.brdf.ndf_table import TabulatedNDF
from gonio.directions import from_spherical
from gonio.errors import ParameterError

METAL = gn.GGX(0.05, 0.2)
UP = np.array([0.0, 0.0, 1.0])


def error(ndf, shape, warp):
    """Relative rms error of the table over the hemisphere."""
    theta, phi = np.linspace(1e-4, 1.55, 700), np.random.default_rng(2).uniform(0, 2 * np.pi, 500)
    h, weight = from_spherical(theta[:, None], phi), np.sin(theta)[:, None]
    D = ndf.D(h)
    return np.sqrt((weight * (TabulatedNDF.of(ndf, shape, warp).D(h) - D) ** 2).sum() / (weight * D**2).sum())


def test_warped_rows_keep_brushed_metal():
    # Measured figures, with 10 % to spare; the warp gains threefold at the same size, nine times the knots nine more.
    assert error(METAL, (32, 96), 1.0) > 0.06
    assert error(METAL, (32, 96), 1.5) < 0.024
    assert error(METAL, (32, 96), 2.0) < 0.017
    assert error(METAL, (96, 256), 1.5) < 0.0027


def test_cloth_is_smooth_enough_for_any_grid():
    assert error(gn.Beckmann(0.4, 0.6), (32, 96), 1.5) < 0.005
    assert error(gn.Beckmann(0.4, 0.6), (96, 256), 1.5) < 0.0005


@pytest.mark.parametrize("warp", [1.0, 1.5, 2.0])
def test_the_mass_is_the_integral_of_the_interpolant(rng, warp):
    table = TabulatedNDF(rng.uniform(size=(4, 5)), warp)
    x, w = np.polynomial.legendre.leggauss(40)
    rows = np.pi / 2 * np.linspace(0, 1, 4) ** warp
    total = 0.0
    for low, high in itertools.pairwise(rows):  # row by row, where the integrand is smooth in theta
        theta = 0.5 * (high + low) + 0.5 * (high - low) * x
        # The mean of a periodic table that is linear between its columns is that of its knots.
        D = table.D(from_spherical(theta[:, None], 2 * np.pi * np.arange(5) / 5)).mean(axis=1)
        total += (0.5 * (high - low) * w * D * np.cos(theta) * np.sin(theta)).sum() * 2 * np.pi
    assert float(table.mass) == pytest.approx(total, abs=1e-6)


def test_facets_cover_the_ground_they_stand_on():
    assert float(TabulatedNDF.of(METAL).mass) == pytest.approx(1, abs=1e-14)
    doubled = TabulatedNDF(2 * TabulatedNDF.of(METAL).values)
    assert float(doubled.mass) == pytest.approx(2, abs=1e-13)
    assert float(doubled.normalised().mass) == pytest.approx(1, abs=1e-14)


def test_knots_are_met(rng):
    table = TabulatedNDF(rng.uniform(size=(6, 8)), 1.7)
    theta = np.pi / 2 * (np.arange(5) / 5) ** 1.7
    h = from_spherical(theta[1:, None], 2 * np.pi * np.arange(8) / 8)
    assert np.allclose(table.D(h), table.values[1:5], atol=1e-12)
    assert table.D(from_spherical(2.0, 0.3)) == 0


def test_a_turn_is_a_shift_of_columns(rng):
    table = TabulatedNDF(rng.uniform(size=(6, 8)))
    theta, phi = rng.uniform(0.1, 1.5, 50), rng.uniform(0, 2 * np.pi, 50)
    turned = table.turned(3 * 2 * np.pi / 8)
    assert np.array_equal(turned.values, np.roll(table.values, 3, axis=1))
    assert np.allclose(turned.D(from_spherical(theta, phi + 3 * np.pi / 4)), table.D(from_spherical(theta, phi)))


def test_a_turn_between_columns_costs_little():
    angle = 0.3  # 12.2 columns of 256
    turned = TabulatedNDF.of(METAL).turned(angle)
    theta, phi = np.linspace(0.01, 1, 300)[:, None], np.linspace(0, 6, 200)
    D = METAL.D(from_spherical(theta, phi))
    off = turned.D(from_spherical(theta, phi + angle)) - D
    # The interpolation itself costs .24 %, and the mix of two shifts little more.
    assert np.sqrt((np.sin(theta) * off**2).sum() / (np.sin(theta) * D**2).sum()) < 0.004
    assert float(turned.mass) == pytest.approx(1, abs=1e-12)


def test_samples_fall_by_their_density(rng):
    table = TabulatedNDF(rng.uniform(0.1, 1, (5, 6)) ** 3)
    h = table.sample(UP, rng.uniform(size=(60000, 2)))
    assert np.allclose(np.linalg.norm(h, axis=-1), 1, atol=1e-12)
    n = 240
    z, phi = np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) * 2 * np.pi / n, indexing="ij")
    boxes = (
        (table.pdf(from_spherical(np.arccos(z), phi), UP) * (2 * np.pi / n**2)).reshape(6, 40, 8, 30).sum(axis=(1, 3))
    )
    assert boxes.sum() == pytest.approx(1, abs=1e-4)
    counted, _, _ = np.histogram2d(
        h[:, 2], np.arctan2(h[:, 1], h[:, 0]) % (2 * np.pi), (6, 8), ((0, 1), (0, 2 * np.pi))
    )
    # 48 boxes: chi2 stays below 84 in 999 of 1000 draws.
    assert ((counted - boxes * len(h)) ** 2 / (boxes * len(h))).sum() < 84


def test_samples_follow_the_facets_closely(rng):
    table = TabulatedNDF.of(gn.GGX(0.2, 0.4))
    h = table.sample(UP, rng.uniform(size=(20000, 2)))
    ratio = gn.GGX(0.2, 0.4).D(h) * h[:, 2] / table.pdf(h, UP)
    # Both interpolants share their knots, so that they differ by their curvature within a cell.
    assert np.all(np.abs(ratio - 1) < 0.005)


@pytest.mark.parametrize("shadowing", [gn.Smith(), gn.Ashikhmin()])
def test_microfacets_take_tables_as_they_take_formulas(rng, shadowing):
    wi = from_spherical(rng.uniform(0, 1.2, 500), rng.uniform(0, 2 * np.pi, 500))
    wo = from_spherical(rng.uniform(0, 1.2, 500), rng.uniform(0, 2 * np.pi, 500))
    exact = gn.Microfacet(gn.GGX(0.2, 0.4), gn.Fresnel(1.5), shadowing)
    table = gn.Microfacet(TabulatedNDF.of(gn.GGX(0.2, 0.4)), gn.Fresnel(1.5), shadowing)
    # Measured .19 %: D between its knots, and the projected areas of either direction to .1 % each.
    assert np.allclose(table.f(wi, wo), exact.f(wi, wo), rtol=0.004)
    u = rng.uniform(size=(500, 3))
    drawn = table.sample(wo, u)
    assert np.all(table.pdf(drawn, wo)[drawn[:, 2] > 0] > 0)


def test_tensors_get_the_same_values_in_kind(rng):
    torch = pytest.importorskip("torch")
    table = TabulatedNDF.of(gn.GGX(0.3), (12, 16))
    h, u = from_spherical(rng.uniform(0, 1.5, 40), rng.uniform(0, 6, 40)), rng.uniform(size=(40, 2))
    H, U = torch.asarray(h), torch.asarray(u)
    assert np.allclose(table.D(H).numpy(), table.D(h))
    assert np.allclose(table.pdf(H, H).numpy(), table.pdf(h, h))
    assert np.allclose(table.sample(H, U).numpy(), table.sample(h, u))
    assert table.D(H.float()).dtype == torch.float32
    values = torch.tensor(np.array(table.values), requires_grad=True)
    held = dataclasses.replace(table, values=values)
    (held.D(H).sum() + held.mass).backward()
    assert bool(torch.isfinite(values.grad).all())
    assert bool((values.grad > 0).any())


@pytest.mark.parametrize(
    ("values", "warp", "message"),
    [
        (np.ones((1, 8)), 1.5, "2 or more rows"),
        (np.ones((8, 2)), 1.5, "3 or more columns"),
        (np.ones(8), 1.5, "rows"),
        (-np.ones((8, 8)), 1.5, "outside"),
        (np.full((8, 8), np.nan), 1.5, "outside"),
        (np.ones((8, 8)), 0.5, "warp"),
        (np.ones((8, 8)), np.nan, "warp"),
    ],
)
def test_bad_tables_are_refused(values, warp, message):
    with pytest.raises(ParameterError, match=message):
        TabulatedNDF(values, warp)


def test_what_cannot_be_tabulated_normalised_or_drawn_is_refused():
    with pytest.raises(ParameterError, match="site"):
        TabulatedNDF.of(gn.GGX(np.full((5, 1, 1), 0.3)), (8, 8))
    nothing = TabulatedNDF(np.zeros((8, 8)))
    with pytest.raises(ParameterError, match="zero throughout"):
        nothing.normalised()
    with pytest.raises(ParameterError, match="zero throughout"):
        nothing.sample(UP, np.array([0.5, 0.5]))
