"""Facts about slices on a grid."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn
from gonio.capture.resampling import grid_directions, interpolate, push_pull

WAYS = {"push and pull": push_pull, "surface": interpolate}
each = pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)


def scattered(count, rng, lowest=0.1):
    """Directions above the surface, evenly."""
    z, phi = rng.uniform(lowest, 1, count), rng.uniform(0, 2 * np.pi, count)
    return gn.from_spherical(np.arccos(z), phi)


def test_texels_of_the_grid_have_the_same_solid_angle():
    directions, inside = grid_directions(64)
    z = directions[inside][:, 2]
    # Evenly over the hemisphere: the mean of cos theta is 1/2 and of its square 1/3, to the grid's rim.
    assert np.mean(z) == pytest.approx(0.5, abs=2e-3)
    assert np.mean(z**2) == pytest.approx(1 / 3, abs=2e-3)
    assert_allclose(np.linalg.norm(directions, axis=-1), 1)
    assert directions[0, 32, 1] > 0.9  # the first row is y up
    assert directions[32, -1, 0] > 0.9


@each
def test_a_constant_stays_constant_and_fills_the_disc(way, rng):
    wi = scattered(60, rng)
    found = way(wi, np.full((60, 2), 3.0), 32)
    _, inside = grid_directions(32)
    assert_allclose(found.values[inside], 3, rtol=1e-9)
    assert not found.values[~inside].any()
    assert not found.covered[~inside].any()


def test_a_lobe_between_samples_is_met_better_by_the_surface_than_by_push_and_pull(rng):
    wi = scattered(400, rng, 0.0)
    gloss = gn.Microfacet(gn.GGX(0.4), gn.Fresnel(1.5))
    wo = gn.normalise([0.4, 0.1, 1.0])
    directions, _ = grid_directions(64)
    expected = gloss.f(directions, wo)
    off = {}
    for name, way in WAYS.items():
        found = way(wi, gloss.f(wi, wo), 64)
        near = found.covered & (directions[..., 2] > 0.2)
        assert near.sum() > 0.9 * (directions[..., 2] > 0.2).sum() * np.pi / 4
        off[name] = np.sqrt(np.mean((found.values[near] - expected[near]) ** 2)) / expected[near].max()
    assert off["surface"] < 0.02
    assert off["push and pull"] > 3 * off["surface"]


@each
def test_where_no_light_stood_is_not_covered(way, rng):
    wi = scattered(300, rng, 0.0)
    lit = wi[:, 0] < 0.1
    found = way(wi[lit], wi[lit, 2:], 64)
    directions, inside = grid_directions(64)
    assert not found.covered[inside & (directions[..., 0] > 0.35)].any()
    assert found.covered[inside & (directions[..., 0] < -0.05)].mean() > 0.97
    assert np.isfinite(found.values).all()


def test_a_sample_of_no_weight_does_not_count():
    wi = gn.normalise([[0.0, 0, 1], [0.001, 0, 1], [0.5, 0, 1]])
    found = push_pull(wi, [[1.0], [100.0], [1.0]], 16, [1.0, 0.0, 1.0])
    _, inside = grid_directions(16)
    assert_allclose(found.values[inside], 1)


def test_directions_that_come_twice_are_averaged(rng):
    wi = scattered(40, rng)
    values = wi[:, :1] + 2
    twice = interpolate(np.concatenate((wi, wi)), np.concatenate((values - 0.5, values + 0.5)), 16)
    assert_allclose(twice.values, interpolate(wi, values, 16).values, atol=1e-12)


def test_slices_that_cannot_be_are_refused():
    wi = gn.normalise([[0.0, 0, 1], [0.1, 0, 1], [0.0, 0.3, 1]])
    for arguments, message in (
        ((wi, np.ones(3), 16), "shapes"),
        ((2 * wi, np.ones((3, 1)), 16), "length 2"),
        ((-wi, np.ones((3, 1)), 16), "below the surface"),
        ((wi, np.full((3, 1), np.nan), 16), "values"),
    ):
        for way in WAYS.values():
            with pytest.raises(gn.GonioError, match=message):
                way(*arguments)
    with pytest.raises(gn.GonioError, match="power of two"):
        push_pull(wi, np.ones((3, 1)), 12)
    with pytest.raises(gn.GonioError, match="all 0"):
        push_pull(wi, np.ones((3, 1)), 16, np.zeros(3))
    with pytest.raises(gn.GonioError, match="make no surface"):
        interpolate(wi[:2], np.ones((2, 1)), 16)
    with pytest.raises(gn.GonioError, match="n = 1"):
        interpolate(wi, np.ones((3, 1)), 1)
