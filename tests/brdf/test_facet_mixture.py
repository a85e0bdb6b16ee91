"""Mixtures of tabulated facet distributions: their reflectance, its samples, and textures of them."""

import dataclasses

import numpy as np
import pytest
from reference import facet_mixture as twin
from scipy import stats

import gonio as gn
from gonio.arrays import floats
from gonio.brdf.facet_areas import FacetAreas
from gonio.brdf.facet_mixture import FacetBasis, FacetMixture
from gonio.brdf.polar_grid import PolarGrid
from gonio.errors import GonioError
from gonio.reflection import textured

from .cases import directions

GRID = PolarGrid(16, 24)
CLOTHS = [gn.TabulatedNDF.of(ndf, GRID.shape) for ndf in (gn.Beckmann(0.3), gn.GGX(0.5, 0.3), gn.Beckmann(0.4, 0.8))]
BASIS = FacetBasis(GRID, np.stack([np.roll(cloth.values, turn, axis=1) for cloth in CLOTHS for turn in (0, 5)]))
K_S = np.array([0.3, 0.2, 0.1])


def mixture(rng, *lead, k=4, basis=BASIS):
    """Its weights are a little negative here and there."""
    weights = rng.uniform(-0.2, 1, (*lead, k))
    weights /= weights.sum(axis=-1, keepdims=True)
    k_d, k_s = rng.uniform(size=(2, *lead, 3)) * 0.4
    eta = rng.uniform(1.2, 2.5, lead)
    return FacetMixture(basis, rng.integers(0, len(basis.tables), (*lead, k)), weights, k_d, k_s, eta)


def site(model, *at):
    """One of them."""
    names = ("indices", "weights", "k_d", "k_s", "eta")
    return dataclasses.replace(model, **{name: getattr(model, name)[at] for name in names})


@pytest.mark.parametrize("j", range(3))
def test_one_table_alone_is_the_microfacet_model(j):
    # F(1) is divided by: k_s is what is reflected at normal incidence.
    model = FacetMixture(BASIS, [2 * j], [1.0], 0.3, K_S, 1.6)
    facets = gn.Microfacet(CLOTHS[j], gn.Fresnel(1.6), gn.Ashikhmin())
    expected = gn.Lambert(0.3) + facets * (K_S / (0.6 / 2.6) ** 2)
    wi, wo = directions(400, 1), directions(400, 2)
    # Both areas come from tables, this one's good to .2 % of g, the other's to .04 % in the mean and .5 % at grazing.
    ratio = model.f(wi, wo) / expected.f(wi, wo)
    assert np.abs(ratio - 1).max() < 0.02
    assert np.sqrt(np.mean((ratio - 1) ** 2)) < 0.004


def test_areas_are_close_between_the_directions_that_they_stand_at():
    w, areas = directions(2000), FacetAreas(GRID, 10)  # what 24 columns tell
    exact = np.maximum(areas.areas(areas.coefficients(BASIS.tables), w), w[:, 2])
    xp, w = floats(w)
    for j in range(len(exact)):
        off = FacetMixture(BASIS, [j], [1.0])._area(xp, w) / exact[j] - 1
        assert np.sqrt(np.mean(off**2)) < 0.001
        assert np.abs(off).max() < 0.007  # where slopes of .8 and .4 graze


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_loops_are_the_plain_twin(rng, dtype):
    model = mixture(rng, 5)
    wi, wo = directions(60, 1).reshape(12, 5, 3).astype(dtype), directions(5, 2).astype(dtype)
    expected = np.array(
        [
            [
                [
                    twin.value(
                        wi[i, s].astype(float),
                        wo[s].astype(float),
                        BASIS.tables,
                        BASIS.areas,
                        GRID.warp,
                        model.indices[s],
                        model.weights[s],
                        model.k_d[s, c],
                        model.k_s[s, c],
                        model.eta[s],
                    )
                    for c in range(3)
                ]
                for s in range(5)
            ]
            for i in range(12)
        ]
    )
    found = model.f(wi, wo)
    assert found.dtype == dtype
    # float32 directions are unit to 1e-7 only, which the twin takes for angles.
    assert np.allclose(found, expected, rtol=1e-6 if dtype == np.float64 else 1e-4)
    # The array code is another.
    assert np.allclose(model._f(*floats(wi, wo)), expected, rtol=1e-6 if dtype == np.float64 else 1e-4)
    assert not model.f(-wi, wo).any()


def test_sites_asked_for_many_pairs_are_composed_to_the_same_values(rng):
    model = mixture(rng, 3, k=6)
    wi, wo = directions(3000, 1).reshape(1000, 3, 3), directions(3, 2)
    together = model.f(wi, wo)
    few = np.concatenate([model.f(wi[k : k + 8], wo) for k in range(0, 1000, 8)])
    # Composed tables are in single precision, and weights that cancel leave its rounding.
    assert np.allclose(together, few, rtol=1e-5)
    # Sites first, as other callers have them.
    swapped = model.f(np.moveaxis(wi, 0, 1)[:, :, None], wo[:, None, None])
    assert swapped.shape == (3, 1000, 3, 3)
    for j in range(3):
        assert np.allclose(swapped[j, :, j], site(model, j).f(wi[:, j][:, None], wo[j])[:, 0], rtol=1e-5)


def test_facets_and_their_shadows_make_up_the_value(rng):
    model = dataclasses.replace(mixture(rng, 40), k_d=0.0, k_s=0.2, eta=1.5)
    wi, wo = directions(40, 1), directions(40, 2)
    h = gn.normalise(wi + wo)
    F = gn.Fresnel(1.5)(np.sum(wi * h, axis=-1))[..., 0] / 0.04
    # S = cos / g (MS 5): the cosines of the microfacet model cancel.
    expected = 0.2 * model.D(h) * F * model.S(wi) * model.S(wo) / (4 * wi[:, 2] * wo[:, 2])
    assert np.allclose(model.f(wi, wo)[..., 0], expected, rtol=1e-5)
    assert np.all((model.S(wi) > 0) & (model.S(wi) <= 1 + 1e-12))
    assert not model.D(-h).any()
    assert not model.S(-wi).any()


def test_light_and_eye_may_be_exchanged(rng):
    model = mixture(rng, 50)
    wi, wo = directions(50, 1), directions(50, 2)
    assert np.allclose(model.f(wi, wo), model.f(wo, wi), rtol=1e-12)


def test_no_more_is_reflected_than_arrives(rng):
    # F(c) / F(1) is 25 at grazing angles: what the facets reflect at normal incidence is F(1).
    model = dataclasses.replace(mixture(rng, 6), k_d=np.full(3, 0.5), k_s=np.full(3, 0.04), eta=1.5)
    for theta in (0.0, 0.8, 1.3):
        wi = directions(3000, 3)  # uniform in z over [.02, 1]
        wo = gn.from_spherical(theta, 0.3)
        albedo = (model.f(wi[:, None], wo) * wi[:, None, 2:]).mean(axis=0) * 2 * np.pi * 0.98
        assert np.all(albedo < 1)
        assert np.all(albedo > 0.5)


def test_a_turn_of_the_tables_is_a_turn_of_the_frame(rng):
    model = mixture(rng, 30)
    turned = FacetMixture(
        FacetBasis(GRID, np.roll(BASIS.tables, 6, axis=2)),
        model.indices,
        model.weights,
        model.k_d,
        model.k_s,
        model.eta,
    )
    wi, wo = directions(30, 1), directions(30, 2)
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # six columns of 24
    assert np.allclose(turned.f(wi @ quarter.T, wo @ quarter.T), model.f(wi, wo), rtol=1e-4)


def test_samples_fall_by_their_density(rng):
    model, wo = mixture(rng), gn.from_spherical(0.6, 0.4)
    n = 40000
    wi = model.sample(wo, rng.random((n, 3)))
    assert np.allclose(np.linalg.norm(wi, axis=-1), 1, atol=1e-6)
    z, phi = np.meshgrid((np.arange(400) + 0.5) / 200 - 1, (np.arange(400) + 0.5) * np.pi / 200, indexing="ij")
    density = model.pdf(gn.from_spherical(np.arccos(z), phi), wo) * (4 * np.pi / 400**2)
    # Directions beside -wo come of facets seen edge-on; quadrature leaves a little of the peak of their density.
    assert density.sum() == pytest.approx(1, abs=3e-3)
    boxes = density.reshape(10, 40, 8, 50).sum(axis=(1, 3))[5:]
    found, _, _ = np.histogram2d(
        wi[:, 2], np.arctan2(wi[:, 1], wi[:, 0]) % (2 * np.pi), (10, 8), ((-1, 1), (0, 2 * np.pi))
    )
    assert (
        stats.chisquare(np.append(found[5:], n - found[5:].sum()), np.append(boxes, 1 - boxes.sum()) * n).pvalue > 1e-3
    )


def test_samples_and_density_give_the_albedo(rng):
    model, wo = mixture(rng, 4), gn.from_spherical(0.5, 1.0)
    wi = directions(6000, 3)
    albedo = (model.f(wi[:, None], wo) * wi[:, None, 2:]).mean(axis=0) * 2 * np.pi * 0.98
    drawn = model.sample(wo, rng.random((4000, 4, 3)))
    estimate = (model.f(drawn, wo) * drawn[..., 2:] / model.pdf(drawn, wo)[..., None]).mean(axis=0)
    assert np.allclose(estimate, albedo, rtol=0.06)  # three standard errors of both
    lobes = sum(lobe.f(wi[:, None], wo) for lobe in model.lobes())
    assert np.allclose(lobes, model.f(wi[:, None], wo))


def test_sites_radiate_as_each_alone(rng):
    model = mixture(rng, 7)
    frames, wo = gn.frame(gn.normalise(rng.normal(size=(7, 3)) + np.array([0, 0, 3]))), directions(7)
    light = gn.Environment(rng.uniform(size=(8, 16, 3)).astype(np.float32))
    together = gn.radiance(model + 0.5 * gn.Lambert(0.2), light, frames, wo)
    for s in range(7):
        alone = gn.radiance(site(model, s) + 0.5 * gn.Lambert(0.2), light, frames[s], wo[s])
        assert np.allclose(together[s], alone, rtol=1e-5)


def test_a_texels_centre_is_that_texel(rng):
    model = mixture(rng, 3, 4)
    wi, wo = directions(12, 1), directions(12, 2)
    row, column = (x.ravel() for x in np.indices((3, 4)))
    uv = np.stack(((column + 0.5) / 4, 1 - (row + 0.5) / 3), axis=-1)
    expected = np.stack([site(model, r, c).f(a, b) for r, c, a, b in zip(row, column, wi, wo, strict=True)])
    assert np.allclose(model.at(uv).f(wi, wo), expected, rtol=1e-5)
    assert model.at(uv[:0]).eta.shape == (0,)
    within = textured(gn.Lambert(rng.uniform(size=(3, 4, 3))) + 0.5 * model, uv)
    assert np.allclose(within.terms[1].f(wi, wo), 0.5 * expected, rtol=1e-5)


def test_between_texels_reflectance_is_bilinear(rng):
    # Along the normal every g is 1, by its series to 1e-4; if no D is cut at zero and one eta serves all, f is linear.
    model = mixture(rng, 2, 2)
    weights = np.abs(model.weights) / np.abs(model.weights).sum(axis=-1, keepdims=True)
    model = dataclasses.replace(model, weights=weights, k_s=model.k_s[..., :1], eta=np.full((2, 2), 1.5))
    n = np.array([0.0, 0.0, 1.0])
    middle, corner = (site(model.at(np.array([[0.5, 0.5], [2.0, -1.0]])), k) for k in range(2))
    four = [site(model, r, c).f(n, n) for r in (0, 1) for c in (0, 1)]
    assert np.allclose(middle.f(n, n), np.mean(four, axis=0), rtol=2e-4)
    h = gn.from_spherical(0.2, 1.0)
    assert np.allclose(corner.f(h, n), site(model, 1, 1).f(h, n), rtol=1e-5)


def test_a_constant_texture_is_the_same_at_every_level(rng):
    one = mixture(rng)
    names = ("indices", "weights", "k_d", "k_s", "eta")
    model = dataclasses.replace(
        one, **{n: np.broadcast_to(getattr(one, n), (5, 6, *getattr(one, n).shape)) for n in names}
    )
    uv = rng.uniform(size=(40, 2))
    wi, wo = directions(40, 1), directions(40, 2)
    for model_at in (model.at(uv), model.at(uv, rng.uniform(0, 2.2, 40))):
        assert np.allclose(model_at.f(wi, wo), one.f(wi, wo), rtol=1e-5)


def test_a_wide_footprint_sees_the_mean_of_its_texels(rng):
    model = mixture(rng, 4, 8, k=2)
    wide = model.at(np.array([[0.25, 0.5], [0.6, 0.4]]), [4 / 32**0.5, 1e6])
    assert np.allclose(wide.k_d[0], model.k_d[:, :4].mean(axis=(0, 1)))
    assert np.allclose(wide.k_s[1], model.k_s.mean(axis=(0, 1)))
    up, h = np.array([0.0, 0.0, 1.0]), model.basis.tables
    D = np.einsum("rck,rckij->rcij", model.weights, h[model.indices])
    mean = (model.k_s.mean(axis=-1)[..., None, None] * D).mean(axis=(0, 1)) / model.k_s.mean()
    assert np.allclose(np.einsum("k,kij->ij", wide.weights[1], h[wide.indices[1]]), mean, rtol=1e-4)
    assert wide.indices.shape == (2, 6)  # as many as there are tables
    assert np.all(np.isfinite(wide.f(up, up)))


def test_levels_take_little_memory(rng):
    basis = FacetBasis(GRID, np.repeat(BASIS.tables, 50, axis=0))
    for k in (1, 4, 16):
        model = mixture(rng, 32, 32, k=k, basis=basis)
        assert sum(level.weights.size for level in model._coarser) < 2.5 * model.weights.size
        assert model._coarser[-1].eta.shape == (1, 1)
        assert max(level.weights.shape[-1] for level in model._coarser) <= 64


def test_tensors_get_the_same_values_in_kind_and_gradients(rng):
    torch = pytest.importorskip("torch")
    model = mixture(rng, 20)
    wi, wo, u = directions(20, 1), directions(20, 2), rng.random((20, 3))
    Wi, Wo, U = (torch.asarray(x) for x in (wi, wo, u))
    assert np.allclose(model.f(Wi, Wo).numpy(), model.f(wi, wo), rtol=1e-5)
    assert np.allclose(model.pdf(Wi, Wo).numpy(), model.pdf(wi, wo), rtol=1e-6)
    assert np.allclose(model.sample(Wo, U).numpy(), model.sample(wo, u), atol=1e-5)
    assert model.f(Wi.float(), Wo.float()).dtype == torch.float32
    held = dataclasses.replace(model, basis=FacetBasis.of(GRID, torch.tensor(BASIS.tables)))
    assert np.allclose(held.f(Wi, Wo).numpy(), model.f(wi, wo), rtol=1e-5)
    weights = torch.tensor(np.array(model.weights), requires_grad=True)
    dataclasses.replace(model, weights=weights).f(Wi, Wo).sum().backward()
    assert bool(torch.isfinite(weights.grad).all())
    assert bool((weights.grad != 0).any())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"indices": [0, 6]}, "indices = 6; basis has tables 0 to 5"),
        ({"indices": [0, -1]}, "indices = -1"),
        ({"indices": np.array([0, 2**32])}, "indices = 4294967296"),
        ({"indices": [[0, 1], [2]]}, "indices is not an array"),
        ({"indices": [0.0, 1.0]}, "indices has dtype float64"),
        ({"indices": [0, 1, 2]}, r"indices \(3,\) and weights \(2,\)"),
        ({"weights": [0.5, np.nan]}, "weights = nan"),
        ({"weights": [0.5, 0.4]}, "weights sum to 0.9"),
        ({"weights": [[0.5, 0.5]] * 4, "k_d": np.ones((5, 3))}, r"weights \(4,\), k_d \(5,\)"),
        ({"k_s": -0.1}, "k_s = -0.1"),
        ({"eta": 0.9}, "eta = 0.9"),
        ({"basis": BASIS.tables}, "basis"),
    ],
)
def test_bad_mixtures_are_refused(change, message):
    with pytest.raises(GonioError, match=message):
        FacetMixture(**({"basis": BASIS, "indices": [0, 1], "weights": [0.5, 0.5]} | change))


def test_bad_tables_places_and_footprints_are_refused(rng):
    tables = np.array(BASIS.tables)
    with pytest.raises(GonioError, match=r"tables has shape \(6, 24, 16\)"):
        FacetBasis(GRID, tables.transpose(0, 2, 1))
    with pytest.raises(GonioError, match=r"tables\[0\] has integral \(n.h\) D = 2"):
        FacetBasis(GRID, 2 * tables)
    assert np.allclose(FacetBasis.of(GRID, 2 * tables).tables, tables, rtol=1e-6)
    tables[2, 3, 4] = np.nan
    with pytest.raises(GonioError, match=r"tables\[2, 3, 4\] = nan"):
        FacetBasis(GRID, tables)
    with pytest.raises(GonioError, match="zero throughout"):
        FacetBasis.of(GRID, 0 * BASIS.tables)
    with pytest.raises(GonioError, match="neither none nor those of a texture"):
        textured(mixture(rng, 3), np.zeros((2, 2)))
    with pytest.raises(GonioError, match="no uv"):
        textured(mixture(rng, 3, 2), None)
    with pytest.raises(GonioError, match="width"):
        mixture(rng, 3, 2).at(np.zeros((2, 2)), -1.0)


def trusted(grid=GRID, count=6):
    """Own data within 40 degrees, others' to 60, the rest filled; of odd tables nothing is told."""
    trust = np.where(grid.theta < np.radians(40), 255, np.where(grid.theta < np.radians(60), 128, 0))
    trust = np.broadcast_to(trust[:, None], (count, *grid.shape)).copy()
    trust[1::2] = 0
    return trust


def test_confidence_is_the_trust_of_the_tables_by_what_they_add(rng):
    basis = FacetBasis(GRID, BASIS.tables, trusted())
    assert basis.trust.dtype == np.uint8
    assert not basis.trust.flags.writeable
    # A negative weight tells nothing; .9 of 1.2 is of table 0.
    model = FacetMixture(basis, [[0, 1, 2], [0, 2, 4]], [[0.9, 0.3, -0.2], [0.5, 0.25, 0.25]])
    h = gn.from_spherical(np.radians([[0.0], [20], [30], [75], [89]]), 1.0)
    expected = np.array([[0.75, 1], [0.75, 1], [0.75, 1], [0, 0], [0, 0]])
    assert np.allclose(model.confidence(h, h), expected, atol=1e-6)
    # Between the parts it falls without a step.
    theta = np.radians(np.linspace(30, 75, 400))[:, None]
    h = gn.from_spherical(theta, 0.3)
    fall = model.confidence(h, h)[:, 1]
    assert np.all(np.diff(fall) <= 1e-12)
    assert np.abs(np.diff(fall)).max() < 0.02  # of a whole step in some four degrees, .1 apart
    wi, wo = directions(2, 1), directions(2, 2)
    assert np.all((model.confidence(-wi, wo) >= 0) & (model.confidence(-wi, wo) <= 1))
    assert np.all(FacetMixture(BASIS, [0], [1.0]).confidence(wi, wo) == 1)


def test_confidence_is_that_of_tensors_and_textures(rng):
    torch = pytest.importorskip("torch")
    basis = FacetBasis.of(GRID, 3 * BASIS.tables, trusted())
    model = mixture(rng, 3, 4, basis=basis).at(rng.uniform(size=(12, 2)), np.full(12, 0.4))
    wi, wo = directions(12, 1), directions(12, 2)
    expected = model.confidence(wi, wo)
    assert 0 <= expected.min() < 0.1 < expected.max() < 1
    assert np.allclose(model.confidence(torch.asarray(wi), torch.asarray(wo)).numpy(), expected, atol=1e-6)
    held = dataclasses.replace(model, basis=dataclasses.replace(basis, trust=torch.tensor(trusted())))
    assert np.allclose(held.confidence(torch.asarray(wi), torch.asarray(wo)).numpy(), expected, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda trust: trust[1:], r"trust has shape \(5, 16, 24\); that of the tables is \(6, 16, 24\)"),
        (lambda trust: trust + 1, "trust = 256"),
        (lambda trust: trust - 1.0, "trust = -1"),
        (lambda trust: trust / 2, "trust = 127.5"),
        (lambda trust: trust > 0, "trust has dtype bool"),
    ],
)
def test_trust_that_is_none_is_refused(change, message):
    with pytest.raises(GonioError, match=message):
        FacetBasis(GRID, BASIS.tables, change(trusted()))


def test_a_texel_brighter_than_white_has_lobes_all_the_same(rng):
    """Photographs in arbitrary units have any albedo."""
    model = dataclasses.replace(mixture(rng), k_d=np.array([1.5, 1.2, 0.9]))
    wi, wo = directions(50, 1), directions(50, 2)
    np.testing.assert_allclose(sum(lobe.f(wi, wo) for lobe in model.lobes()), model.f(wi, wo), rtol=1e-5)
