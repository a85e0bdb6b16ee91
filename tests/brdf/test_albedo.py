"""What surfaces reflect: closed forms, energy, and the quadrature against SciPy's."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest

import gonio as gn

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="takes minutes where loops are not compiled")

ANGLES = np.radians([0, 30, 60, 75, 85])
VIEWS = np.stack((np.sin(ANGLES), np.zeros(5), np.cos(ANGLES)), axis=-1)


def test_lambert_reflects_its_albedo():
    np.testing.assert_allclose(gn.albedo(gn.Lambert([0.2, 0.5, 0.9]), VIEWS), np.tile([0.2, 0.5, 0.9], (5, 1)))
    assert gn.albedo(gn.Lambert(0.7)) == pytest.approx(0.7, abs=1e-12)


def test_normalised_models_reflect_their_albedo_at_the_normal():
    up = np.array([0.0, 0.0, 1.0])
    for s in (1.0, 10.0, 1000.0):
        for model in (gn.Phong(0.5, s), gn.ModifiedPhong(0.5, s), gn.BlinnPhong(0.5, s), gn.KajiyaKay(0.2, 0.3, s)):
            assert gn.albedo(model, up, 1e-3) == pytest.approx(0.5, abs=1e-3)
    assert gn.albedo(gn.Lafortune(-1.0, -1.0, 1.0, 4.0), up) == pytest.approx(2 * math.pi / 6, abs=1e-4)


def test_matte_fibres_reflect_their_albedo_everywhere():
    np.testing.assert_allclose(gn.albedo(gn.KajiyaKay(0.6, 0.0, 1.0), VIEWS), 0.6, atol=1e-4)


def test_phongs_lobe_loses_what_the_horizon_cuts_off():
    # s = 1: the part of a hemisphere about R that lies above, weighted by its cosine, is (1 + cos theta_o) / 2.
    expected = 0.5 * (1 + np.cos(ANGLES))
    np.testing.assert_allclose(gn.albedo(gn.Phong(1.0, 1.0), VIEWS, 1e-3)[:, 0], expected, atol=1e-3)


@pytest.mark.parametrize("alpha", [0.02, 0.1, 0.3, 1.0])
@pytest.mark.parametrize("ndf", [gn.GGX, gn.Beckmann])
@pytest.mark.parametrize("shadowing", [gn.Smith(), gn.Smith(correlated=False), gn.VGroove()], ids=str)
def test_mirror_facets_never_reflect_more_than_they_receive(ndf, alpha, shadowing):
    a = gn.albedo(gn.Microfacet(ndf(alpha), gn.Schlick(1.0), shadowing), VIEWS, 1e-3)
    assert (a <= 1 + 1e-3).all() and (a > 0).all()
    if alpha == 0.02:  # nearly a mirror: little is shadowed, little reflected twice
        assert (a[:3] > 0.99).all()


def test_other_models_keep_their_energy_too():
    for model in (
        *(gn.ModifiedPhong(1.0, s) for s in (0.0, 1.0, 30.0)),
        *(gn.BlinnPhong(1.0, s) for s in (0.0, 1.0, 30.0)),
        *(gn.Phong(1.0, s) for s in (1.0, 30.0)),
        *(gn.Ward(1.0, a, bounded=b) for a in (0.05, 0.3, 1.0) for b in (False, True)),
        gn.KajiyaKay(0.5, 0.5, 30.0),
    ):
        assert (gn.albedo(model, VIEWS, 2e-3) <= 1 + 2e-3).all()


def test_oren_and_nayars_fit_exceeds_its_albedo_by_no_more_than_it_is_known_to():
    # The qualitative model is a fit: near sigma = .2 it gives back up to 1.5 % too much at grazing.
    a = max(float(gn.albedo(gn.OrenNayar(1.0, s), VIEWS, 1e-3).max()) for s in (0.1, 0.2, 0.3, 0.6, 1.2))
    assert 1.0 < a < 1.016


def test_ward_as_published_loses_light_as_the_cosine():
    a = gn.albedo(gn.Ward(1.0, 0.05), VIEWS[:3])[:, 0]
    np.testing.assert_allclose(a, np.cos(ANGLES[:3]), atol=0.01)  # 1 - 3 alpha^2 at the normal


def test_the_simplified_torrance_sparrow_model_gains_light_at_grazing():
    a = gn.albedo(gn.TorranceSparrow(0.0, 1.0, 1.5, 0.2), VIEWS, 1e-2)[:, 0]
    assert a[0] == pytest.approx(0.974, abs=2e-3)  # the A_0 that RH's lobe has at sigma = .2
    assert a[4] > 5


@pytest.mark.parametrize("alpha", [0.02, 0.3])
def test_albedo_agrees_with_scipy(alpha):
    integrate = pytest.importorskip("scipy.integrate")
    model = gn.Microfacet(gn.GGX(alpha), gn.Fresnel(1.5))
    theta_o = math.radians(40)
    wo = np.array([math.sin(theta_o), 0.0, math.cos(theta_o)])

    def over_azimuth(theta_h):
        """Over half vectors, whose lobe stands at the pole: d omega_i = 4 (wo.h) d omega_h."""
        phi = np.linspace(0, np.pi, 401)
        h = np.stack((np.sin(theta_h) * np.cos(phi), np.sin(theta_h) * np.sin(phi), np.cos(theta_h) + 0 * phi), -1)
        d = h @ wo
        wi = 2 * d[:, None] * h - wo
        value = model.f(wi, wo)[:, 0] * np.maximum(wi[:, 2], 0) * 4 * np.maximum(d, 0)
        return 2 * integrate.simpson(value, x=phi) * math.sin(theta_h)

    expected, _ = integrate.quad(over_azimuth, 0, np.pi / 2, points=[alpha, 5 * alpha], epsabs=1e-7, limit=200)
    assert gn.albedo(model, wo) == pytest.approx(expected, abs=1e-4)


def test_a_sum_reflects_the_sum():
    a, b = gn.Lambert([0.3, 0.2, 0.1]), gn.Ward(0.4, 0.2)
    np.testing.assert_allclose(
        gn.albedo(a + 0.5 * b, VIEWS), gn.albedo(a, VIEWS) + 0.5 * gn.albedo(b, VIEWS), atol=1e-4
    )


def test_the_white_albedo_is_the_mean_over_views():
    model = gn.Microfacet(gn.GGX(0.4), gn.Schlick(1.0))
    cosine, weight = np.polynomial.legendre.leggauss(40)
    cosine, weight = 0.5 * (1 + cosine), 0.5 * weight
    wo = np.stack((np.sqrt(1 - cosine**2), 0 * cosine, cosine), axis=-1)
    expected = (2 * cosine * weight) @ gn.albedo(model, wo, 1e-3)[:, 0]
    assert gn.albedo(model, tolerance=1e-3) == pytest.approx(expected, abs=1e-3)


def test_sites_have_albedos_of_their_own():
    alpha = np.array([0.1, 0.5])
    a = gn.albedo(gn.Microfacet(gn.GGX(alpha), gn.Schlick(1.0)), VIEWS[2:3], 1e-3)
    assert a.shape == (2, 1)
    for k in range(2):
        alone = gn.albedo(gn.Microfacet(gn.GGX(alpha[k]), gn.Schlick(1.0)), VIEWS[2], 1e-3)
        assert a[k] == pytest.approx(alone, abs=1e-3)
    white = gn.albedo(gn.Microfacet(gn.GGX(alpha), gn.Schlick(1.0)), tolerance=1e-2)
    assert white.shape == (2, 1)


def test_an_albedo_that_does_not_settle_is_told():
    from gonio.errors import AccuracyWarning

    with pytest.warns(AccuracyWarning, match="Phong still changes by"):
        gn.albedo(gn.Phong(1.0, 0.0), VIEWS[3:], 1e-9)
    with pytest.raises(gn.GonioError, match="not positive"):
        gn.albedo(gn.Lambert(0.5), VIEWS, 0.0)


def test_pytorch_integrates_alike():
    torch = pytest.importorskip("torch")
    model = gn.Microfacet(gn.GGX(0.3), gn.Fresnel(1.5))
    np.testing.assert_allclose(gn.albedo(model, torch.tensor(VIEWS)).numpy(), gn.albedo(model, VIEWS), atol=1e-9)
