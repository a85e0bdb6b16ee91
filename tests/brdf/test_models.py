"""What holds for every analytic model: its twin, reciprocity, the horizon, shapes, precision, PyTorch, refusals."""

from __future__ import annotations

import numpy as np
import pytest

import gonio as gn
from gonio.arrays import floats

from .cases import MODELS, directions

each = pytest.mark.parametrize("name", MODELS)


@each
def test_loop_and_paper_agree(name):
    model, twin, _ = MODELS[name]
    wi, wo = directions(60, 1), directions(60, 2)
    expected = np.array([np.atleast_1d(twin(i, o)) for i, o in zip(wi, wo, strict=True)])
    # 1e-9: the paper's forms lose digits in acos; the hidden slopes of Beckmann are good to 2e-11.
    np.testing.assert_allclose(model.f(wi, wo), expected, rtol=1e-9, atol=1e-300)


@each
def test_loop_and_array_code_agree(name):
    torch = pytest.importorskip("torch")
    model = MODELS[name][0]
    wi, wo = directions(300, 3), directions(300, 4)
    wi[0, 2] *= -1
    answer = model.f(torch.tensor(wi), torch.tensor(wo))
    assert answer.dtype == torch.float64
    # 1e-25: array code, which must be safe in single precision, ends a Gaussian at exp(-80).
    np.testing.assert_allclose(model.f(wi, wo), answer.numpy(), rtol=1e-9, atol=1e-25)
    single = model.f(torch.tensor(wi, dtype=torch.float32), torch.tensor(wo, dtype=torch.float32))
    assert single.dtype == torch.float32
    # Narrow lobes magnify the 6e-8 by which directions are rounded: by their exponents, and by tan theta over alpha.
    np.testing.assert_allclose(single.numpy(), answer.numpy(), rtol=2e-3, atol=1e-6)


@each
def test_models_that_are_reciprocal_and_those_that_are_not(name):
    model, _, reciprocal = MODELS[name]
    wi, wo = directions(500, 5), directions(500, 6)
    there, back = model.f(wi, wo), model.f(wo, wi)
    assert np.allclose(there, back, rtol=1e-12, atol=0) == reciprocal


@each
def test_nothing_is_reflected_below_the_surface(name):
    model = MODELS[name][0]
    w = directions(50, 7)
    below = w * [1, 1, -1]
    horizon = w * [1, 1, 0] / np.linalg.norm(w[:, :2], axis=1, keepdims=True)
    for wi, wo in ((w, below), (below, w), (below, below), (horizon, w), (w, horizon), (horizon, -horizon)):
        assert not model.f(wi, wo).any()


@each
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_grazing_equal_and_opposite_directions_are_finite(name, dtype):
    model = MODELS[name][0]
    phi = np.linspace(0, 2 * np.pi, 9)
    for height in (1e-3, 1e-10, 1e-17):
        w = np.stack((np.cos(phi), np.sin(phi), np.full_like(phi, height)), axis=-1).astype(dtype)
        up = np.zeros_like(w) + np.array([0, 0, 1], dtype)
        for wi, wo in ((w[:, None], w[None]), (w, up), (up, w), (up, up)):
            f = model.f(wi, wo)
            assert f.dtype == dtype
            assert np.isfinite(f).all() and (f >= 0).all()


@each
def test_outer_form_equals_its_pairs(name):
    model = MODELS[name][0]
    wi, wo = directions(7, 8), directions(5, 9)
    outer = model.f(wi[None], wo[:, None])
    pairs = model.f(np.broadcast_to(wi, (5, 7, 3)), np.repeat(wo, 7, axis=0).reshape(5, 7, 3))
    np.testing.assert_array_equal(outer, pairs)
    # Axes that cannot be merged: wi (2, 1, 7), wo (1, 5, 1).
    both = np.stack((wi, wi[::-1]))
    deep = model.f(both[:, None], wo[None, :, None])
    np.testing.assert_array_equal(deep[0], outer)
    np.testing.assert_array_equal(deep[1], outer[:, ::-1])


@each
def test_single_precision_in_is_single_precision_out(name):
    model = MODELS[name][0]
    wi, wo = directions(100, 10).astype(np.float32), directions(100, 11).astype(np.float32)
    f = model.f(wi, wo)
    assert f.dtype == np.float32
    # The loops reckon in double precision, so only the answer is rounded.
    _, wide_i, wide_o = floats(wi.astype(float), wo.astype(float))
    np.testing.assert_allclose(f, model.evaluate(np, wide_i, wide_o), rtol=2e-7, atol=1e-30)


def test_parameters_of_sites_follow_the_leading_axes():
    alpha, colour = np.array([0.1, 0.2, 0.4]), np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6], [0.7, 0.8, 0.9]])
    wi, wo = directions(3, 12), directions(3, 13)
    ggx = gn.Microfacet(gn.GGX(alpha, 0.3), gn.Schlick(colour)).f(wi, wo)
    ward = gn.Ward(colour, alpha).f(wi, wo)
    lights = gn.Ward(colour[:, None], alpha[:, None]).f(wi[None], wo[:, None])
    for k in range(3):
        np.testing.assert_array_equal(
            ggx[k], gn.Microfacet(gn.GGX(alpha[k], 0.3), gn.Schlick(colour[k])).f(wi[k], wo[k])
        )
        np.testing.assert_array_equal(ward[k], gn.Ward(colour[k], alpha[k]).f(wi[k], wo[k]))
        np.testing.assert_array_equal(lights[k], gn.Ward(colour[k], alpha[k]).f(wi, wo[k]))


def test_strided_and_read_only_directions_are_taken():
    wi, wo = directions(20, 14), directions(20, 15)
    frozen = wi.copy()
    frozen.flags.writeable = False
    model = gn.Ward(0.5, 0.3)
    expected = model.f(wi[::2], wo[::2])
    np.testing.assert_array_equal(model.f(frozen[::2], np.asfortranarray(wo)[::2]), expected)
    assert model.f(np.empty((0, 3)), wo[:1]).shape == (0, 1)
    assert model.f(wi[0], wo[0]).shape == (1,)


def test_gradients_reach_the_parameters():
    torch = pytest.importorskip("torch")
    wi, wo = torch.tensor(directions(20, 16)), torch.tensor(directions(20, 17))

    def total(ndf, alpha):
        return gn.Microfacet(ndf(alpha), gn.Fresnel(1.5)).f(wi, wo).sum()

    for ndf in (gn.GGX, gn.Beckmann):
        alpha = torch.tensor(0.3, dtype=torch.float64, requires_grad=True)
        total(ndf, alpha).backward()
        step = 1e-6
        ends = (total(ndf, torch.tensor(0.3 + d, dtype=torch.float64)) for d in (step, -step))
        slope = (next(ends) - next(ends)) / (2 * step)
        assert float(alpha.grad) == pytest.approx(float(slope), rel=1e-6)


def test_mirror_like_models_peak_in_the_mirror_direction():
    wo = np.array([0.6, 0.0, 0.8])
    mirror = np.array([-0.6, 0.0, 0.8])
    others = directions(500, 18)
    others = others[others @ mirror < 0.99]
    for model in (gn.ModifiedPhong(1.0, 300.0), gn.Ward(1.0, 0.03), gn.Microfacet(gn.GGX(0.03), gn.Schlick(1.0))):
        assert model.f(mirror, wo) > model.f(others, wo).max()


def test_fibres_throw_a_cone():
    # The light at 60 degrees to the fibre comes back at 120, all around it.
    light = np.array([0.5, 0.0, np.sqrt(0.75)])
    phi = np.linspace(-1.4, 1.4, 7)
    cone = np.stack((np.full(7, -0.5), np.sqrt(0.75) * np.sin(phi), np.sqrt(0.75) * np.cos(phi)), axis=-1)
    f = gn.KajiyaKay(0.0, 0.5, 80.0).f(light, cone)
    assert np.ptp(f) < 1e-12 * f.max()
    assert gn.KajiyaKay(0.0, 0.5, 80.0).f(light, light) < 1e-3 * f.max()


@pytest.mark.parametrize(
    "make",
    [
        lambda: gn.Lambert(1.1),
        lambda: gn.OrenNayar(0.5, -0.1),
        lambda: gn.Phong(0.5, -1.0),
        lambda: gn.BlinnPhong([0.5, 0.5, 1.5], 10.0),
        lambda: gn.Ward(0.5, 0.0),
        lambda: gn.Ward(0.5, 0.2, -0.1),
        lambda: gn.GGX(0.0),
        lambda: gn.GGX(float("nan")),
        lambda: gn.Beckmann(0.2, 0.0),
        lambda: gn.Fresnel(0.9),
        lambda: gn.Conductor(1.0, -1.0),
        lambda: gn.Schlick(1.01),
        lambda: gn.TorranceSparrow(mu=1.0),
        lambda: gn.KajiyaKay(ks=2.0),
        lambda: gn.Lafortune(n=-1.0),
        lambda: gn.Lafortune(cz=2.0, n=100.0),
        lambda: -0.1 * gn.Lambert(0.5),
        lambda: gn.Lambert([0.5, 0.5]),
        lambda: gn.Microfacet(0.3),
        lambda: gn.Microfacet(gn.GGX(0.3), 1.5),
        lambda: gn.Microfacet(gn.GGX(0.3), gn.Fresnel(1.5), "smith"),
    ],
)
def test_parameters_out_of_range_are_refused(make):
    with pytest.raises(gn.GonioError):
        make()


def test_directions_that_are_no_unit_vectors_are_refused():
    w = directions(5000, 19)
    for model in (gn.Lambert(0.5), gn.Ward(0.5, 0.2)):
        for bad in (2.0, np.nan):
            spoilt = w.copy()
            spoilt[4321, 1] = bad
            with pytest.raises(gn.GonioError, match=r"wi\[4321\]"):
                model.f(spoilt, w)
            with pytest.raises(gn.GonioError, match=r"wo\[4321\]"):
                model.f(w, spoilt)
        with pytest.raises(gn.GonioError, match="components last"):
            model.f(w[:, :2], w)


def test_a_sum_wants_brdfs():
    with pytest.raises(gn.GonioError, match="not a BRDF"):
        gn.Lambert(0.5) + 0.3
