"""The forward model against closed forms and the sum written out."""

import math

import numpy as np
import pytest

import gonio as gn
from gonio.lights.model import Beams, Light
from gonio.lights.points import Directional, Lights, Point
from gonio.reflection import varied


def sky(radiance, rows=48):
    """Beams of a sky whose radiance is a function of direction, one for each cell of a lat-long grid."""
    grid = gn.LatLong(rows, 2 * rows)
    w = grid.directions().reshape(-1, 3)
    weight = np.repeat(grid.weights, grid.columns)
    return Beams(w, (radiance(w) * weight)[:, None], np.full(len(w), np.inf))


def directions_above(rng, normals, least=0.05):
    """A unit direction in each normal's hemisphere."""
    w = gn.normalise(rng.normal(size=normals.shape))
    cosine = (w * normals).sum(axis=-1, keepdims=True)
    w = w + (np.abs(cosine) + least - cosine) * normals
    return gn.normalise(w)


@pytest.fixture
def sites(rng):
    """Frames (700, 3, 3) and eyes (700, 3), in every direction."""
    n = gn.normalise(rng.normal(size=(700, 3)))
    return gn.frame(n, gn.normalise(np.cross(n, rng.normal(size=(700, 3))))), directions_above(rng, n)


GLOSSY = gn.Lambert((0.3, 0.2, 0.1)) + gn.Microfacet(gn.GGX(0.3, 0.15), gn.Fresnel(1.5))


def test_lambert_under_one_light_is_albedo_over_pi_e_cos(sites):
    frames, wo = sites
    sun = gn.normalise(np.array([0.3, -0.4, 0.8]))
    B = gn.radiance(gn.Lambert(0.6), Directional(sun, (2.0, 1.0, 0.5)), frames, wo)
    expected = 0.6 / math.pi * np.maximum(frames[:, 2] @ sun, 0)[:, None] * (2.0, 1.0, 0.5)
    np.testing.assert_allclose(B, expected, atol=1e-15)


def test_a_white_furnace_returns_the_albedo(sites):
    frames, wo = sites
    B = gn.radiance(gn.Lambert((1.0, 0.5, 0.25)), sky(lambda w: np.ones(len(w)), 96), frames, wo)
    # 96 rows of cells of 1.9 degrees, cut by the horizon: the sum is right to the square of their width.
    np.testing.assert_allclose(B, np.broadcast_to((1.0, 0.5, 0.25), B.shape), rtol=1e-3)


def test_the_irradiance_of_a_linear_sky_is_pi_plus_two_thirds_pi_cos(sites):
    frames, wo = sites
    B = gn.radiance(gn.Lambert(0.7), sky(lambda w: 1 + w[:, 2], 96), frames, wo)
    expected = 0.7 / math.pi * (math.pi + 2 * math.pi / 3 * frames[:, 2, 2])
    np.testing.assert_allclose(B[:, 0], expected, rtol=2e-3)  # as above; E is least where it is pi / 3


def test_a_point_light_falls_off_by_the_square_of_its_distance(rng):
    place = np.array([0.0, 0.0, 2.0])
    x = np.concatenate((rng.uniform(-3, 3, size=(50, 2)), np.zeros((50, 1))), axis=1)
    wo = np.broadcast_to((0.0, 0.0, 1.0), x.shape)
    B = gn.radiance(gn.Lambert(0.5), Point(place, 3.0), np.eye(3), wo, x)
    d2 = ((place - x) ** 2).sum(axis=-1)
    np.testing.assert_allclose(B[:, 0], 0.5 / math.pi * 3 / d2 * 2 / np.sqrt(d2), rtol=1e-12)


def test_blocks_add_up_to_the_sum_written_out(sites):
    frames, wo = sites
    light = sky(lambda w: np.exp(2 * w[:, 0]), 20)
    B = gn.radiance(GLOSSY, light, frames, wo)
    for k in range(0, 700, 50):
        wi = light.directions @ frames[k].T
        above = wi[:, 2] > 0
        f = GLOSSY.f(wi[above], frames[k] @ wo[k])
        expected = (f * wi[above, 2:] * light.irradiance[above]).sum(axis=0)
        np.testing.assert_allclose(B[k], expected, rtol=1e-10)


def test_threads_change_nothing(sites):
    frames, wo = sites
    light = sky(lambda w: 1 + w[:, 2], 16)
    one = gn.radiance(GLOSSY, light, frames, wo, threads=1)
    np.testing.assert_array_equal(gn.radiance(GLOSSY, light, frames, wo, threads=3), one)


def test_neighbouring_sites_may_leave_out_the_beams_below_their_horizon(rng):
    # All normals within 10 degrees: 47 % of the beams are left out; alone, each site takes its own half.
    n = gn.normalise(np.array([0.2, 0.3, 0.9]) + 0.1 * rng.normal(size=(200, 3)))
    frames, wo = gn.frame(n), directions_above(rng, n)
    light = sky(lambda w: 1 + 0.5 * w[:, 2], 16)
    together = gn.radiance(GLOSSY, light, frames, wo)
    alone = np.concatenate([gn.radiance(GLOSSY, light, frames[k : k + 1], wo[k : k + 1]) for k in range(200)])
    np.testing.assert_allclose(together, alone, rtol=1e-12)


def test_parameters_may_vary_over_the_sites(rng):
    rows, columns = 30, 40
    n = gn.normalise(rng.normal(size=(rows, columns, 3)))
    frames, wo = gn.frame(n), directions_above(rng, n)
    albedo, alpha = rng.uniform(size=(rows, columns, 3)), rng.uniform(0.1, 0.5, size=columns)
    light = sky(lambda w: 1 + w[:, 0], 12)
    brdf = gn.Lambert(albedo) + 0.5 * gn.Microfacet(gn.GGX(alpha), gn.Fresnel(1.5))
    B = gn.radiance(brdf, light, frames, wo)
    assert B.shape == (rows, columns, 3)
    for r, c in ((0, 0), (7, 33), (29, 39)):
        one = gn.Lambert(albedo[r, c]) + 0.5 * gn.Microfacet(gn.GGX(alpha[c]), gn.Fresnel(1.5))
        np.testing.assert_allclose(B[r, c], gn.radiance(one, light, frames[r, c], wo[r, c]), rtol=1e-10)


def test_a_model_without_varying_parameters_is_left_as_it_is():
    assert varied(GLOSSY, lambda value, axes: value * 0) is GLOSSY


def test_visibility_weighs_the_beams(sites, rng):
    frames, wo = sites
    light = sky(lambda w: 1 + w[:, 2], 8)
    whole = gn.radiance(GLOSSY, light, frames, wo)
    half = rng.uniform(size=(700, 128)) < 0.5
    a = gn.radiance(GLOSSY, light, frames, wo, visibility=half)
    b = gn.radiance(GLOSSY, light, frames, wo, visibility=~half)
    np.testing.assert_allclose(a + b, whole, rtol=1e-12)
    assert np.abs(a - b).max() > 0.1 * whole.max()


@pytest.mark.parametrize("near", [False, True])
def test_visibility_is_asked_for_lit_pairs_only(sites, near):
    frames, wo = sites
    positions = np.stack((np.arange(700), np.zeros(700), np.zeros(700)), axis=-1)  # each says whose it is
    lamps = Lights((Directional((0.0, 0, 1)), Point((350.0, 100, 80), 3e4)))
    light = lamps if near else sky(lambda w: np.ones(len(w)), 8)

    def east(x, w, distance):
        assert x.shape == w.shape == (*distance.shape, 3)
        assert ((frames[x[:, 0].astype(int), 2] * w).sum(axis=-1) > 0).all()
        return w[:, 0] > 0

    traced = gn.radiance(GLOSSY, light, frames, wo, positions, visibility=east)
    beams = lamps.beams(positions) if near else light
    told = gn.radiance(GLOSSY, light, frames, wo, positions, visibility=(beams.directions[..., 0] > 0))
    np.testing.assert_allclose(traced, told, rtol=1e-12)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_tensors_give_the_same_radiance_in_their_dtype(sites, dtype):
    torch = pytest.importorskip("torch")
    frames, wo = sites
    light = sky(lambda w: 1 + w[:, 2], 8)
    ours = gn.radiance(GLOSSY, light, frames.astype(dtype), wo.astype(dtype))
    theirs = gn.radiance(GLOSSY, light, torch.tensor(frames.astype(dtype)), torch.tensor(wo.astype(dtype)))
    assert str(ours.dtype) == dtype
    assert theirs.dtype == getattr(torch, dtype)
    np.testing.assert_allclose(theirs.numpy(), ours, rtol=1e-11 if dtype == "float64" else 1e-4)


def test_gradients_reach_the_model_and_the_light(sites):
    torch = pytest.importorskip("torch")
    frames, wo = (torch.tensor(x) for x in sites)
    albedo = torch.tensor(0.4, dtype=torch.float64, requires_grad=True)
    given = sky(lambda w: 1 + w[:, 2], 8)
    E = torch.tensor(given.irradiance, requires_grad=True)
    light = Beams(torch.tensor(given.directions), E, torch.tensor(given.distance))
    total = gn.radiance(gn.Lambert(albedo), light, frames, wo).sum()
    total.backward()
    # B is linear in both.
    assert float(albedo.grad) == pytest.approx(float(total.detach()) / 0.4)
    assert float((E.grad * E).sum().detach()) == pytest.approx(float(total.detach()))


def test_eyes_and_lights_below_the_surface_see_nothing(rng):
    n = gn.normalise(rng.normal(size=(50, 3)))
    below = -directions_above(rng, n)
    assert (gn.radiance(GLOSSY, sky(lambda w: np.ones(len(w)), 8), gn.frame(n), below) == 0).all()


def test_no_sites_have_no_radiance():
    assert gn.radiance(GLOSSY, Directional((0, 0, 1.0)), np.zeros((0, 3, 3)), np.zeros((0, 3))).shape == (0, 3)


class Dark(Light):
    distant = True

    def beams(self, positions=None, budget=None):
        return Beams(np.array([[0.0, 0, 1]]), np.array([[math.nan]]), np.array([np.inf]))


UP = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ((gn.Lambert(0.5), Directional(UP), np.eye(3), 2 * UP), "wo has length 2"),
        ((gn.Lambert(0.5), Directional(UP), 2 * np.eye(3), UP), "frames is not orthonormal"),
        ((gn.Lambert(0.5), Directional(UP), np.ones((4, 3)), UP), "rotation is"),
        ((gn.Lambert(0.5), Directional(UP), np.stack([np.eye(3)] * 4), np.stack([UP] * 5)), "same sites"),
        ((gn.Lambert(0.5), Point(UP), np.eye(3), UP), "positions are needed"),
        ((gn.Lambert(0.5), Point(UP), np.eye(3), UP, np.zeros((4, 3))), "positions of shape"),
        ((gn.Lambert(np.full((5, 3), 0.5)), Directional(UP), np.stack([np.eye(3)] * 4), UP), "a parameter of shape"),
        ((gn.Lambert(0.5), Dark(), np.eye(3), UP), "irradiance"),
        ((gn.Lambert(0.5), Point(UP).beams(np.zeros((4, 3))), np.eye(3), UP), "pass the light itself"),
    ],
)
def test_what_does_not_fit_is_refused(arguments, match):
    with pytest.raises(gn.GonioError, match=match):
        gn.radiance(*arguments)


def test_visibility_of_another_shape_is_refused():
    with pytest.raises(gn.GonioError, match="visibility of shape"):
        gn.radiance(gn.Lambert(0.5), Directional(UP), np.eye(3), UP, visibility=np.ones(7))
    with pytest.raises(gn.GonioError, match="positions are needed"):
        gn.radiance(gn.Lambert(0.5), Directional(UP), np.eye(3), UP, visibility=lambda x, w, d: d > 0)
