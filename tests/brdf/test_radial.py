"""Radial functions: against SciPy, their symmetries, places, and what a fit keeps of a known model."""

import dataclasses

import numpy as np
import pytest
import reference.radial as twin
from reference.radial_fits import directions, interpolant
from scipy.interpolate import RBFInterpolator

import gonio as gn
from gonio.brdf.radial import Interpolant, Radial
from gonio.directions import from_half_difference, from_uvw, uvw
from gonio.errors import ArrayError, ParameterError
from gonio.reflection import radiance, textured


@pytest.fixture
def glossy(rng):
    """log f of a glossy paint at 600 pairs of directions, and as many on theta_d = 0 at eight angles."""
    paint = gn.Lambert([0.2, 0.3, 0.4]) + gn.Microfacet(gn.GGX(0.4), gn.Fresnel(1.5))
    wi, wo = directions(rng, 600, 0.2), directions(rng, 600, 0.2)
    q = uvw(wi, wo)
    theta_h = np.repeat(rng.uniform(0, 1.2, 40), 8)
    phi_d = np.tile(np.arange(8) * (np.pi / 8), 40)
    s = np.sin(theta_h)
    circles = np.stack((s * np.cos(2 * phi_d), s * np.sin(2 * phi_d), 0 * s), axis=-1)
    f = np.concatenate((paint.f(wi, wo), paint.f(*from_half_difference(theta_h, 0.0, 0.0, 0.0))))
    q = np.concatenate((q, circles))
    q[:, 1] = np.abs(q[:, 1])
    q, first = np.unique(np.round(q, 12), axis=0, return_index=True)
    scales = np.array([1.0, 1.0, 0.3])
    return paint, Radial(Interpolant(q, scales, *twin.fitted(q, scales, np.log(f[first]))))


@pytest.mark.parametrize(("d", "channels"), [(2, 1), (3, 1), (3, 3), (4, 1), (5, 3), (6, 1)])
def test_values_are_scipys(rng, d, channels):
    s = interpolant(rng, d, channels)
    values = s(s.centres)
    # SciPy solves for its own coefficients: the function is the same, though its polynomial is scaled otherwise.
    theirs = RBFInterpolator(s.centres * s.scales, values, kernel="linear", degree=1)
    q = rng.uniform(-1.5, 1.5, (500, d))
    assert np.abs(s(q) - theirs(q * s.scales)).max() < 1e-7 * np.abs(s.coefficients).sum()


@pytest.mark.parametrize("spatial", [False, True])
def test_single_precision_leaves_a_hundred_thousandth_of_the_range(rng, spatial):
    paint = gn.Lambert(0.3) + gn.Microfacet(gn.GGX(0.2), gn.Fresnel(1.5))
    wi, wo = directions(rng, 1500), directions(rng, 1500)
    q, values, scales = uvw(wi, wo), np.log(paint.f(wi, wo)), np.array([1.0, 1.0, 0.3])
    if spatial:
        place = rng.uniform(size=(len(q), 2))
        q, scales = np.concatenate((place, q), axis=1), np.array([0.3, 0.3, *scales])
        values = values + np.sin(5 * place[:, :1])
    s = Interpolant(q[:1200], scales, *twin.fitted(q[:1200], scales, values[:1200]))
    distance = np.linalg.norm((q[:, None] - s.centres) * scales, axis=-1)
    exact = distance @ s.coefficients + s.polynomial[0] + (q * scales) @ s.polynomial[1:]
    off = np.abs(s(q) - exact) / np.ptp(exact)
    # Coefficients whose sizes add up to some 500 ranges cancel; half of the loss is the rounding of distances.
    assert off.max() < 2e-5
    assert np.sqrt(np.mean(off**2)) < 5e-6
    assert np.abs(s(q.astype(np.float32)) - exact).max() < 2e-5 * np.ptp(exact)


def test_a_far_origin_costs_no_digits(rng):
    near = interpolant(rng, 3)
    there = np.array([1000.0, -2000.0, 0.0])
    polynomial = near.polynomial.copy()
    polynomial[0] -= there * near.scales @ polynomial[1:]
    far = dataclasses.replace(near, centres=near.centres + there, polynomial=polynomial)
    q = rng.uniform(-1, 1, (300, 3))
    assert np.allclose(far(q + there), near(q), atol=1e-5)


def test_it_is_reciprocal_and_isotropic_and_folded_it_is_mirrored(rng):
    wi, wo = directions(rng, 300), directions(rng, 300)
    turn = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])
    mirror = np.array([1.0, -1.0, 1.0])
    for folded in (False, True):
        model = Radial(interpolant(rng, 3, 3), folded=folded)
        f = model.f(wi, wo)
        assert np.allclose(model.f(wo, wi), f, rtol=1e-4)
        assert np.allclose(model.f(wi @ turn.T, wo @ turn.T), f, rtol=1e-4)
        assert np.allclose(model.f(wi * mirror, wo * mirror), f, rtol=1e-4) == folded


def test_a_fit_keeps_what_its_centres_can(rng, glossy):
    paint, fit = glossy
    wi, wo = directions(rng, 1000, 0.3), directions(rng, 1000, 0.3)
    off = np.abs(fit.f(wi, wo) / paint.f(wi, wo) - 1).max(axis=-1)
    # 900 centres lie some .1 apart in a domain of 2 by 1 by .3; the highlight is a few times as wide.
    assert np.median(off) < 0.02
    # At the centres themselves only rounding is left.
    at = np.unique(fit.interpolant.centres[fit.interpolant.centres[:, 2] > 0], axis=0)
    assert np.allclose(fit.f(*from_uvw(at)), paint.f(*from_uvw(at)), rtol=1e-3)


def test_light_behind_the_eye_is_nearly_one_value_whatever_phi_d(rng, glossy):
    paint, fit = glossy
    for theta_h in (0.0, 0.3, 0.8):
        phi_d = rng.uniform(0, 2 * np.pi, 200)
        for theta_d in (0.0, 1e-9, 1e-4):
            wi, wo = from_half_difference(theta_h, 0.4, theta_d, phi_d)
            f = fit.f(wi, wo)
            assert np.all(np.isfinite(f))
            # Between the eight angles of the fit; without them the spread is the highlight's own.
            assert np.all(np.abs(f / paint.f(wi, wo) - 1) < 0.1)
    same = directions(rng, 50)
    assert np.all(np.isfinite(fit.f(same, same)))


def test_nothing_is_negative_and_nothing_comes_from_below(rng):
    wi, wo = directions(rng, 400, -1), directions(rng, 400, -1)
    above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
    for logarithm in (False, True):
        model = Radial(interpolant(rng, 3), logarithm)
        f = model.f(wi, wo)
        assert f.min() >= 0
        assert not f[~above].any()
        assert f[above].any()
        assert not model.f(wi[~above][:1], wo[~above][:1]).any()  # no pair at all is lit


def test_extrapolation_is_held(rng):
    limits = np.array([[-1.0], [2.0]])
    s = interpolant(rng, 3, limits=limits)
    far = s(np.array([[50.0, 0, 0], [-50.0, 0, 0], [0, 0, 50.0], [0, 0, -50.0]]))
    assert far.min() == -1
    assert far.max() == 2
    steep = Interpolant(np.zeros((1, 3)), np.ones(3), np.zeros((1, 1)), np.array([[500.0], [0], [0], [0]]))
    up = np.array([0.0, 0, 1], np.float32)
    assert np.isfinite(Radial(steep).f(up, up)).all()


def test_places_vary_over_sites(rng):
    s = interpolant(rng, 5, 3)
    x, y = rng.uniform(size=(2, 40))
    model = Radial(s, x=x, y=y)
    wi, wo = directions(rng, 7)[:, None], directions(rng, 40)
    f = model.f(wi, wo)
    assert f.shape == (7, 40, 3)
    k = (3, 17)
    q = twin.coordinates(wi[3, 0], wo[17], folded=True, place=(x[17], y[17]))
    assert np.allclose(model.coordinates(wi, wo)[k], q, atol=1e-7)
    assert np.allclose(f[k], np.exp(twin.value(q, s.centres, s.scales, s.coefficients, s.polynomial)), rtol=1e-4)
    one = dataclasses.replace(model, x=x[17], y=y[17])
    assert np.allclose(one.f(wi[3, 0], wo[17]), f[k], rtol=1e-6)


def test_radiance_and_textures_see_the_places(rng):
    s = interpolant(rng, 5)
    rows, columns = 6, 8
    x, y = np.meshgrid(np.linspace(-1, 1, columns), np.linspace(-1, 1, rows))
    model = Radial(s, x=x, y=y)
    light = gn.Directional(np.array([0.0, 0.6, 0.8]), 1.0)
    frames, wo = np.broadcast_to(np.eye(3), (rows, columns, 3, 3)), np.array([0.6, 0, 0.8])
    B = radiance(model, light, frames, wo)
    assert np.allclose(B, 0.8 * model.f(np.array([0.0, 0.6, 0.8]), wo), rtol=1e-5)
    # Texel centres of row 0, which is at v = 1.
    uv = np.stack(((np.arange(columns) + 0.5) / columns, np.full(columns, 1 - 0.5 / rows)), axis=-1)
    looked_up = textured(model, uv)
    assert np.allclose(looked_up.x, x[0])
    assert np.allclose(looked_up.y, y[0])


def test_dtypes_stay(rng):
    s = interpolant(rng, 3)
    q = rng.uniform(size=(4, 5, 3))
    assert s(q).dtype == np.float64
    assert s(q.astype(np.float32)).dtype == np.float32
    assert s(q).shape == (4, 5, 1)
    assert s(q[:0]).shape == (0, 5, 1)
    up = np.array([0.6, 0, 0.8], np.float32)
    assert Radial(s).f(up, up).dtype == np.float32


def test_tensors_get_the_same_values_in_kind_and_gradients(rng):
    torch = pytest.importorskip("torch")
    s = interpolant(rng, 5, 3, limits=[[-2.0] * 3, [3.0] * 3])
    x, y = rng.uniform(size=(2, 20))
    wi, wo = directions(rng, 20), directions(rng, 20)
    ours = Radial(s, x=x, y=y).f(wi, wo)
    place = torch.asarray(x).requires_grad_()
    theirs = Radial(s, x=place, y=y).f(torch.asarray(wi), torch.asarray(wo))
    assert theirs.dtype == torch.float64
    assert np.allclose(theirs.detach().numpy(), ours, rtol=1e-4)
    theirs.sum().backward()
    assert bool(torch.all(torch.isfinite(place.grad)))
    assert bool(torch.any(place.grad != 0))
    q = torch.asarray(s.centres[:3].copy()).requires_grad_()
    s(q).sum().backward()
    assert bool(torch.all(torch.isfinite(q.grad)))  # at a centre the distance has none


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"centres": np.zeros((5, 7))}, ArrayError, "d = 2 to 6"),
        ({"coefficients": np.zeros((4, 1))}, ArrayError, "want"),
        ({"coefficients": np.zeros((5, 2))}, ArrayError, "1 or 3"),
        ({"polynomial": np.zeros((3, 1))}, ArrayError, "want"),
        ({"scales": [1.0, 0.0, 1.0]}, ParameterError, "positive"),
        ({"centres": np.full((5, 3), np.nan)}, ArrayError, "nan"),
        ({"limits": [[1.0], [0.0]]}, ParameterError, "limits"),
    ],
)
def test_bad_interpolants_are_refused(change, error, message):
    good = {
        "centres": np.zeros((5, 3)),
        "scales": np.ones(3),
        "coefficients": np.zeros((5, 1)),
        "polynomial": np.zeros((4, 1)),
    }
    with pytest.raises(error, match=message):
        Interpolant(**(good | change))


def test_interpolants_that_do_not_fit_are_refused(rng):
    three, five = interpolant(rng, 3, n=20), interpolant(rng, 5, n=20)
    with pytest.raises(ParameterError, match="u, v"):
        Radial(three, flat=True)
    with pytest.raises(ParameterError, match="x, y, u, v, w"):
        Radial(three, x=0.5, y=0.5)
    with pytest.raises(ParameterError, match="neither"):
        Radial(five, x=0.5)
    with pytest.raises(ArrayError, match="broadcast"):
        Radial(five, x=np.zeros(3), y=np.zeros(4))
    with pytest.raises(ArrayError, match="expected"):
        three(np.zeros((4, 5)))
