"""Facts about the named moments of light."""

import dataclasses

import numpy as np
import pytest

import gonio as gn
from gonio.lights.harmonic import directional
from gonio.lights.moments import Moments
from gonio.sphere.harmonics import harmonics


def test_the_moments_are_the_series_itself(rng):
    L, w = rng.normal(size=(9, 3)), gn.normalise(rng.normal(size=(20, 3)))
    m = Moments.of(L)
    values = m.ambient + 3 * w @ m.vector.T + 7.5 * np.einsum("ni,cij,nj->nc", w, m.axes, w)
    np.testing.assert_allclose(values, harmonics(2, w) @ L, atol=1e-13)
    np.testing.assert_allclose(np.trace(m.axes, axis1=1, axis2=2), 0, atol=1e-14)


def test_they_are_means_over_all_directions():
    room = gn.studio(48)
    m, beams = Moments.of(np.asarray(room.harmonics(2), float)), room.beams()
    w, energy = beams.directions, beams.irradiance / (4 * np.pi)
    # Pixels' centres stand for pixels: 1e-3 at 48 rows.
    np.testing.assert_allclose(m.ambient, energy.sum(axis=0), rtol=2e-3)
    np.testing.assert_allclose(m.vector, energy.T @ w, atol=2e-3 * float(m.ambient.max()))
    second = np.einsum("kc,ki,kj->cij", energy, w, w) - energy.sum(axis=0)[:, None, None] * np.eye(3) / 3
    np.testing.assert_allclose(m.axes, second, atol=2e-3 * float(m.ambient.max()))


def test_coefficients_come_back(rng):
    L = rng.normal(size=(9, 3))
    np.testing.assert_allclose(Moments.of(L).coefficients(), L, atol=1e-13)


def test_a_lamp_is_as_one_sided_as_light_can_be_and_stands_where_it_stands():
    w = gn.normalise(np.array([0.3, -0.5, 0.7]))
    m = Moments.of(directional(2, w, np.array([2.0])))
    np.testing.assert_allclose(m.one_sidedness, 1, rtol=1e-12)
    np.testing.assert_allclose(gn.normalise(m.vector[0]), w, atol=1e-12)
    # Brightest along the lamp's own axis.
    values, vectors = np.linalg.eigh(m.axes[0])
    np.testing.assert_allclose(abs(vectors[:, np.argmax(values)] @ w), 1, rtol=1e-12)


def test_even_light_has_its_radiance_for_ambient_and_nothing_else():
    m = Moments.of(np.asarray(gn.Environment(np.full((8, 16, 3), 0.7)).harmonics(2)))
    np.testing.assert_allclose(m.ambient, 0.7, rtol=1e-6)
    assert np.abs(m.vector).max() < 1e-6
    assert np.abs(m.axes).max() < 1e-6


def test_moments_turn_as_their_light_does(rng):
    R = gn.euler(0.4, 2.0, -1.0)
    L = rng.normal(size=(9, 3))
    np.testing.assert_allclose(Moments.of(L).rotated(R).coefficients(), gn.rotate(L, R), atol=1e-12)


def test_blends_are_of_lights(rng):
    a, b = rng.normal(size=(2, 9, 3))
    blend = Moments.of(a).blended(Moments.of(b), 0.3)
    np.testing.assert_allclose(blend.coefficients(), 0.7 * a + 0.3 * b, atol=1e-13)


def test_more_ambient_light_changes_nothing_else(rng):
    L = rng.normal(size=(9, 3))
    m = Moments.of(L)
    brighter = dataclasses.replace(m, ambient=2 * m.ambient).coefficients()
    np.testing.assert_allclose(brighter[1:], L[1:], atol=1e-13)
    np.testing.assert_allclose(brighter[0], 2 * L[0], rtol=1e-12)


def test_tensors_are_answered_in_kind(rng):
    torch = pytest.importorskip("torch")
    L = torch.asarray(rng.normal(size=(9, 3)))
    np.testing.assert_allclose(Moments.of(L).coefficients().numpy(), L.numpy(), atol=1e-13)


def test_other_shapes_are_refused():
    with pytest.raises(gn.GonioError, match=r"\(9, C\)"):
        Moments.of(np.zeros((4, 3)))
    with pytest.raises(gn.GonioError, match=r"\(C, 3, 3\)"):
        Moments(np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3))).coefficients()
