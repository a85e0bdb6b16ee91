"""Facts about fibres under an environment."""

import numpy as np
import pytest

import gonio as gn
from gonio.rendering.fibres import fibre_transfer, prefilter_fibres


@pytest.fixture(scope="module")
def room():
    return gn.studio(48)


def test_orders_are_those_of_rh_5_7_1():
    """s = 32: P = 8 and F = 9 for 97 % of the energy, of which P = 8 carries 97.3."""
    rho, energy = fibre_transfer(gn.KajiyaKay(0.0, 1.0, 32.0), 20, 20)
    carried = (rho[:, :, 0, 0] ** 2).cumsum(axis=0).cumsum(axis=1) / energy[0]
    assert carried[-1, 8] == pytest.approx(0.973, abs=5e-4)
    assert int(np.argmax(carried[-1] >= 0.97)) == 8
    assert int(np.argmax(carried[:, 8] >= 0.97)) == 9


def test_maps_are_the_integral_over_the_sphere(room, rng):
    model = gn.KajiyaKay(0.3, 0.5, 24.0)
    maps = prefilter_fibres(room, model, error=0.02)
    t, wo = gn.normalise(rng.normal(size=(60, 3))), gn.normalise(rng.normal(size=(60, 3)))
    beams = room.beams()
    exact = []
    for tangent, eye in zip(t, wo, strict=True):
        # Any frame whose x is the tangent: f knows no azimuth about it.
        frame = np.roll(gn.frame(tangent), 1, axis=0)
        f = model._f(np, beams.directions @ frame.T, np.broadcast_to(frame @ eye, beams.directions.shape))
        exact.append((f * beams.irradiance).sum(axis=0))
    exact = np.array(exact)
    found = np.sqrt(np.mean((maps.radiance(t, wo) - exact) ** 2) / np.mean(exact**2))
    # The error told is over all tangents and eyes, this one over 60 of them.
    assert found < 1.5 * maps.error + 2e-3
    assert maps.error <= 0.02


def test_an_error_that_cannot_be_reached_is_told(room):
    with pytest.warns(gn.GonioWarning, match="what fibres reflect"):
        prefilter_fibres(room, gn.KajiyaKay(0.0, 1.0, 2000.0), error=0.001)


def test_what_cannot_be_is_refused(room):
    with pytest.raises(gn.GonioError, match="between 0 and 1"):
        prefilter_fibres(room, gn.KajiyaKay(), error=2.0)
    with pytest.raises(gn.GonioError, match="no Environment"):
        prefilter_fibres(gn.Directional(np.array([0.0, 0.0, 1.0])), gn.KajiyaKay())
