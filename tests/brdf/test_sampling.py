"""Samplers draw what their densities say, over the whole sphere."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import gonio as gn

from .cases import METAL, MODELS, directions

WO = np.array([0.35, 0.45, np.sqrt(1 - 0.35**2 - 0.45**2)])
ROWS, COLUMNS, INNER = 32, 48, 6
SAMPLERS = {
    "cosine": gn.Lambert(0.5),
    "phong": gn.Phong(0.5, 20.0),
    "blinn-phong": gn.BlinnPhong(0.5, 40.0),
    "lafortune": gn.Lafortune([-0.9, -1.0, -0.5], [-0.9, -0.3, -0.9], 0.9, [8.0, 20.0, 3.0]),
    "ward": gn.Ward(0.5, 0.15, 0.3),
    "torrance-sparrow": gn.TorranceSparrow(0.3, 0.4, 1.5, 0.25),
    "ggx": gn.Microfacet(gn.GGX(0.25)),
    "anisotropic ggx": gn.Microfacet(gn.GGX(0.6, 0.15), gn.Conductor(*METAL)),
    "beckmann": gn.Microfacet(gn.Beckmann(0.3)),
    "anisotropic beckmann": gn.Microfacet(gn.Beckmann(0.15, 0.5)),
    "sum": gn.Lambert(0.2) + 2.0 * (gn.Ward(0.3, 0.2) + gn.Lafortune([-0.9, 0.9, -1.0], -0.9, 0.9, 20.0)),
}


def probabilities(model, wo):
    """The integral of the density over each cell of equal area of the whole sphere, by Gauss-Legendre."""
    x, weight = np.polynomial.legendre.leggauss(INNER)
    z = -1 + 2 * (np.arange(ROWS)[:, None] + 0.5 * (1 + x)) / ROWS
    phi = 2 * np.pi * (np.arange(COLUMNS)[:, None] + 0.5 * (1 + x)) / COLUMNS
    z, phi = z[:, None, :, None], phi[None, :, None, :]
    s = np.sqrt(1 - z * z)
    w = np.stack(np.broadcast_arrays(s * np.cos(phi), s * np.sin(phi), z + 0 * phi), axis=-1)
    cell = 0.25 * weight[:, None] * weight * 4 * np.pi / (ROWS * COLUMNS)
    found = np.einsum("rcij,ij->rc", model.pdf(w, wo), cell)
    # Facets seen edge-on send samples to -wo, where the density of half vectors grows as 1 over the distance, too fast
    # for quadrature (and below the surface): the cells about it are one, with what the others leave.
    away = (w @ -wo).max(axis=(2, 3)) > np.cos(0.3)
    rest = 1 - found[~away].sum()
    assert rest > -2e-4  # the others' quadrature error
    return np.where(away, 0, found), max(rest, 0.0), away


@pytest.mark.parametrize("name", SAMPLERS)
def test_samples_fall_as_their_density_says(name):
    model, n = SAMPLERS[name], 50_000
    # An oblique, a steep and a grazing view; in the last two many facets are seen edge-on, or from behind.
    for wo in (WO, np.array([0.0, -0.96, 0.28]), np.array([np.sqrt(1 - 0.05**2), 0.0, 0.05])):
        wi = model.sample(wo, np.random.default_rng(5).random((n, 3)))
        np.testing.assert_allclose((wi**2).sum(-1), 1, rtol=1e-12)
        expected, rest, away = probabilities(model, wo)
        row = np.minimum(((wi[:, 2] + 1) / 2 * ROWS).astype(int), ROWS - 1)
        column = np.floor(np.arctan2(wi[:, 1], wi[:, 0]) / (2 * np.pi) * COLUMNS).astype(int) % COLUMNS
        found = np.bincount(row * COLUMNS + column, minlength=ROWS * COLUMNS).reshape(ROWS, COLUMNS)
        # Cells with few samples are pooled.
        many = expected * n > 8
        few = ~many & ~away
        counts = np.concatenate((found[many], [found[few].sum(), found[away].sum()]))
        means = n * np.concatenate((expected[many], [expected[few].sum(), rest]))
        keep = means > 8
        assert counts[~keep].sum() <= 60  # of the pools that hardly matter
        assert stats.chisquare(counts[keep], means[keep] * counts[keep].sum() / means[keep].sum()).pvalue > 1e-3


@pytest.mark.parametrize("name", SAMPLERS)
def test_estimates_by_sampling_equal_the_integral(name):
    """The mean of f cos / pdf is the albedo by uniform quadrature: no direction that reflects is left out."""
    model = SAMPLERS[name]
    z, weight = np.polynomial.legendre.leggauss(200)
    z, weight = 0.5 * (1 + z), 0.5 * weight
    phi = 2 * np.pi * np.arange(400) / 400
    s = np.sqrt(1 - z * z)[:, None]
    w = np.stack((s * np.cos(phi), s * np.sin(phi), np.broadcast_to(z[:, None], (200, 400))), axis=-1)
    exact = np.einsum("rcx,r->x", model.f(w, WO), z * weight) * 2 * np.pi / 400
    wi = model.sample(WO, np.random.default_rng(6).random((40_000, 3)))
    value = model.f(wi, WO) * (np.maximum(wi[:, 2], 0) / model.pdf(wi, WO))[:, None]
    error = value.std(axis=0) / np.sqrt(len(wi))
    assert (np.abs(value.mean(axis=0) - exact) < 4.5 * error + 1e-6).all()


@pytest.mark.parametrize("name", ["ggx", "ward", "beckmann", "lafortune", "torrance-sparrow", "sum", "blinn-phong"])
def test_pytorch_draws_the_same_directions(name):
    torch = pytest.importorskip("torch")
    model, u = SAMPLERS[name], np.random.default_rng(7).random((50, 3))
    wi = model.sample(WO, u)
    same = model.sample(torch.tensor(WO), torch.tensor(u))
    np.testing.assert_allclose(same.numpy(), wi, atol=1e-9)
    np.testing.assert_allclose(model.pdf(same, torch.tensor(WO)).numpy(), model.pdf(wi, WO), rtol=1e-6)


@pytest.mark.parametrize("name", SAMPLERS)
def test_corners_of_the_square_give_directions(name):
    end = 1 - 2.0**-53
    u = np.array(np.meshgrid([0, 0.5, end], [0, end], [0, end], indexing="ij")).reshape(3, -1).T
    for wo in (WO, np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 1e-12])):
        for dtype in (np.float64, np.float32):
            single = np.minimum(u, 1 - 2.0**-24).astype(dtype)
            wi = SAMPLERS[name].sample(wo.astype(dtype), single)
            assert wi.dtype == dtype
            assert np.allclose((wi**2).sum(-1), 1, atol=1e-5)
            assert np.isfinite(SAMPLERS[name].pdf(wi, wo.astype(dtype))).all()


def test_each_site_draws_from_its_own_lobe():
    alpha, wo = np.array([0.05, 0.2, 0.7]), directions(3, 20)
    u = np.random.default_rng(8).random((3, 3))
    together = gn.Microfacet(gn.GGX(alpha)).sample(wo, u)
    for k in range(3):
        alone = gn.Microfacet(gn.GGX(alpha[k])).sample(wo[k], u[k])
        np.testing.assert_allclose(together[k], alone, atol=1e-14)


def test_every_model_can_be_sampled():
    u = np.random.default_rng(9).random((10, 3))
    for model, _, _ in MODELS.values():
        wi = model.sample(WO, u)
        assert wi.shape == (10, 3)
        assert (model.pdf(wi, WO) > 0).all()
