"""Facets cover the ground they stand on, and show to every direction the area that it sees of the ground."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import gonio as gn
from gonio.brdf.ndf import NDF
from gonio.brdf.projected_area import AreaTable

from .cases import directions

DISTRIBUTIONS = [
    kind(*alpha) for kind in (gn.GGX, gn.Beckmann) for alpha in ((0.02,), (0.1,), (0.5,), (1.0,), (0.08, 0.4))
]


def facets(rings=900, spokes=64):
    """Facet normals over the hemisphere, crowded at the pole, and their solid angles."""
    t, weight = np.polynomial.legendre.leggauss(rings)
    t = 0.5 * (1 + t)
    theta = 0.5 * np.pi * t**3
    solid = 0.5 * weight * 1.5 * np.pi * t**2 * np.sin(theta) * 2 * np.pi / spokes
    phi = 2 * np.pi * (np.arange(spokes) + 0.5) / spokes
    s = np.sin(theta)[:, None]
    h = np.stack((s * np.cos(phi), s * np.sin(phi), np.broadcast_to(np.cos(theta)[:, None], (rings, spokes))), axis=-1)
    return h.reshape(-1, 3), np.repeat(solid, spokes)


@pytest.mark.parametrize("ndf", DISTRIBUTIONS, ids=str)
def test_facets_cover_the_ground_they_stand_on(ndf):
    h, solid = facets()
    # 64 spokes leave 1e-5 of a distribution five times as wide along t as along s.
    assert (ndf.D(h) * h[:, 2]) @ solid == pytest.approx(1, abs=2e-5)


@pytest.mark.parametrize("ndf", DISTRIBUTIONS, ids=str)
def test_weak_white_furnace_of_smith(ndf):
    """The area that facets show is what Smith's masking G1 = (w.n)/g makes of them: the ground's own projection."""
    h, solid = facets()
    w = directions(12, 30)
    area = np.maximum(w @ h.T, 0) @ (ndf.D(h) * solid)
    # 64 spokes across the kink at (w.h) = 0.
    np.testing.assert_allclose(ndf.projected_area(w), area, rtol=5e-4)


@pytest.mark.parametrize("ndf", DISTRIBUTIONS, ids=str)
def test_mirror_facets_reflect_all_light_that_only_masking_holds_back(ndf):
    """Heitz 2014, 30: the integral of G1(wo) D / (4 cos theta_o) over all wi, those below the surface too, is 1."""
    wo = directions(6, 31)[:, None]
    u = np.random.default_rng(3).random((6, 400, 2))
    h = ndf.sample(wo, u)
    wi = 2 * (wo * h).sum(-1, keepdims=True) * h - wo
    density = gn.Microfacet(ndf).pdf(wi, wo)
    # 4 cos theta_o / G1 = 4 g(wo), and samples follow the integrand: each of them must give 1.
    value = ndf.D(h) / (4 * ndf.projected_area(wo)) / density
    np.testing.assert_allclose(value, 1, rtol=1e-6)


def test_isotropic_is_the_case_of_equal_widths():
    h = directions(100, 32)
    for kind in (gn.GGX, gn.Beckmann):
        np.testing.assert_array_equal(kind(0.3).D(h), kind(0.3, 0.3).D(h))
        assert dataclasses.replace(kind(0.3), alpha=0.1).D(h) == pytest.approx(kind(0.1).D(h))


def test_facets_below_the_surface_do_not_exist():
    h = directions(50, 33) * [1, 1, -1]
    assert not gn.GGX(0.5).D(h).any()
    assert not gn.Beckmann(0.5).D(h).any()


@dataclasses.dataclass(frozen=True, eq=False)
class Anonymous(NDF):
    """A distribution that says only its density."""

    behind: NDF = None

    def D(self, h):
        return self.behind.D(h)


@pytest.mark.parametrize("ndf", [gn.GGX(0.05), gn.Beckmann(0.2), gn.GGX(0.1, 0.4)], ids=str)
def test_the_tabulated_area_is_the_closed_form(ndf):
    w = directions(2000, 34)
    expected = ndf.projected_area(w)
    error = Anonymous(behind=ndf).projected_area(w) / expected - 1
    # Linear interpolation of a table of 97 x 128, worst where g bends, near the horizon.
    assert np.abs(error).max() < 5e-3 and np.sqrt((error**2).mean()) < 5e-4
    torch = pytest.importorskip("torch")
    same = Anonymous(behind=ndf).projected_area(torch.tensor(w, dtype=torch.float32))
    assert same.dtype == torch.float32
    np.testing.assert_allclose(same.numpy(), expected, rtol=5e-3)


def test_a_table_meets_itself_around_the_circle_and_at_its_ends():
    table = AreaTable.of(gn.GGX(0.3, 0.5).D, rings=64)
    phi = np.linspace(-4, 4, 400)
    ring = np.stack((0.8 * np.cos(phi), 0.8 * np.sin(phi), np.full_like(phi, 0.6)), axis=-1)
    assert np.abs(np.diff(table(ring))).max() < 0.01
    assert table(np.array([0.0, 0.0, 1.0])) == pytest.approx(1, abs=1e-3)
    assert np.isfinite(table(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -1e-9], [1.0, -1e-18, 0.0]]))).all()


def test_models_of_any_distribution_shadow_alike():
    wi, wo = directions(300, 35), directions(300, 36)
    for shadowing in (gn.Smith(), gn.Ashikhmin(), gn.VGroove()):
        known = gn.Microfacet(gn.GGX(0.2), gn.Schlick(0.1), shadowing).f(wi, wo)
        tabulated = gn.Microfacet(Anonymous(behind=gn.GGX(0.2)), gn.Schlick(0.1), shadowing).f(wi, wo)
        np.testing.assert_allclose(tabulated, known, rtol=1e-2)  # two areas


@pytest.mark.parametrize("shadowing", [gn.Smith(), gn.Smith(correlated=False), gn.Ashikhmin(), gn.VGroove()], ids=str)
def test_shadowing_is_a_share_and_complete_at_the_normal(shadowing):
    wi, wo = directions(400, 37), directions(400, 38)
    up = np.array([0.0, 0.0, 1.0])
    for ndf in (gn.GGX(0.4), gn.Beckmann(0.4)):
        G = shadowing.G(ndf, wi, wo)
        assert (G >= 0).all() and (G <= 1 + 1e-15).all()
        np.testing.assert_allclose(shadowing.G(ndf, up, up), 1, rtol=1e-12)
        assert not shadowing.G(ndf, wi * [1, 1, -1], wo).any()


def test_heights_in_common_show_more():
    wi, wo = directions(400, 39), directions(400, 40)
    for ndf in (gn.GGX(0.6), gn.Beckmann(0.6)):
        assert (gn.Smith().G(ndf, wi, wo) >= gn.Smith(correlated=False).G(ndf, wi, wo) - 1e-15).all()
        np.testing.assert_array_equal(gn.Ashikhmin().G(ndf, wi, wo), gn.Smith(correlated=False).G(ndf, wi, wo))
