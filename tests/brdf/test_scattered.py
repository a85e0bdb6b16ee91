"""Scattered measurements: their symmetries, what held-out samples say, and refusals."""

import numpy as np
import pytest

import gonio as gn
from gonio.brdf.scattered import ScatteredBRDF
from gonio.directions import from_spherical
from gonio.errors import ArrayError, DirectionError
from gonio.files.cornell import read_cornell

# The median error at measurements left out, as found; pbrt-v2's kernel leaves 6.4 % over the three.
PAINTS = {"acryl_blue": 0.059, "garnet_red": 0.029, "krylon_blue": 0.026}


def directions(rng, n, lowest=0.1):
    return from_spherical(np.arccos(rng.uniform(lowest, 1, n)), rng.uniform(-np.pi, np.pi, n))


@pytest.fixture
def paint(rng):
    """A glossy paint measured at 2000 scattered pairs."""
    wi, wo = directions(rng, 2000), directions(rng, 2000)
    model = gn.Lambert([0.1, 0.4, 0.7]) + gn.Microfacet(gn.GGX(0.4), gn.Fresnel(1.5))
    return model, ScatteredBRDF(wi, wo, model.f(wi, wo))


def test_f_is_reciprocal_isotropic_mirrored_and_never_negative(rng, paint):
    _, scattered = paint
    wi, wo = directions(rng, 300, 0.0), directions(rng, 300, 0.0)
    f = scattered.f(wi, wo)
    assert np.all(f >= 0)
    assert np.allclose(scattered.f(wo, wi), f, rtol=1e-8)
    turn = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])
    assert np.allclose(scattered.f(wi @ turn.T, wo @ turn.T), f, rtol=1e-8)
    assert np.allclose(scattered.f(wi * [1, -1, 1], wo * [1, -1, 1]), f, rtol=1e-8)


def test_a_known_paint_is_predicted_between_its_samples(rng, paint):
    model, scattered = paint
    wi, wo = directions(rng, 1000, 0.3), directions(rng, 1000, 0.3)
    off = np.abs(scattered.f(wi, wo) / model.f(wi, wo) - 1)
    # Two thousand samples stand some .08 apart in q; measured .13 % in the median and 1.7 % at the highlight's edge.
    assert np.median(off) < 0.003
    assert np.quantile(off, 0.95) < 0.03


def test_samples_themselves_are_nearly_met(paint):
    _, scattered = paint
    off = np.abs(scattered.f(scattered.wi, scattered.wo) / scattered.values - 1)
    # A sample's own weight is a hundred times its neighbours', not infinite: noise is not chased to the last digit.
    assert np.quantile(off, 0.99) < 0.001


@pytest.mark.parametrize(("name", "median"), PAINTS.items())
def test_held_out_measurements_are_predicted(data, name, median):
    whole = read_cornell(data / "brdf" / "cornell" / f"{name}.brdf")
    fold = np.random.default_rng(0).integers(10, size=len(whole.values))
    f = np.empty_like(whole.values)
    for k in range(10):
        kept = fold != k
        part = ScatteredBRDF(whole.wi[kept], whole.wo[kept], whole.values[kept])
        f[~kept] = part.f(whole.wi[~kept], whole.wo[~kept])
    measured = whole.values.sum(axis=1)
    lit = measured > 0
    off = np.abs(f - whole.values).sum(axis=1)[lit] / measured[lit]
    # A tenth to spare, for another order of the folds. Single samples in the grazing highlight err by far more.
    assert np.median(off) < 1.1 * median


def test_nothing_is_reflected_below_the_surface_and_dtypes_stay(paint):
    _, scattered = paint
    up, down = np.array([0.6, 0, 0.8], np.float32), np.array([0.6, 0, -0.8], np.float32)
    assert scattered.f(up, up).dtype == np.float32
    assert scattered.f(np.broadcast_to(up, (4, 1, 3)), np.broadcast_to(up, (5, 3))).shape == (4, 5, 3)
    assert not scattered.f(up, down).any()


def test_bad_samples_and_tensors_are_refused(rng, paint):
    _, s = paint
    with pytest.raises(ArrayError, match="expected"):
        ScatteredBRDF(s.wi[:15], s.wo[:15], s.values[:15])
    with pytest.raises(ArrayError, match="1 or 3"):
        ScatteredBRDF(s.wi, s.wo, s.values[:, :2])
    with pytest.raises(ArrayError, match="negative"):
        ScatteredBRDF(s.wi, s.wo, -s.values)
    with pytest.raises(ArrayError, match="nan"):
        ScatteredBRDF(s.wi, s.wo, s.values * np.nan)
    with pytest.raises(ArrayError, match="below"):
        ScatteredBRDF(-s.wi, s.wo, s.values)
    with pytest.raises(DirectionError, match="length"):
        ScatteredBRDF(2 * s.wi, s.wo, s.values)
    torch = pytest.importorskip("torch")
    up = torch.tensor([0.0, 0.0, 1.0])
    with pytest.raises(ArrayError, match="NumPy"):
        s.f(up, up)
