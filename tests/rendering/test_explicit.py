"""Facts about SHRMs as twelve maps and as a 3D texture."""

import math

import numpy as np
import pytest

import gonio as gn
from gonio.rendering import explicit
from gonio.rendering.shrm import prefilter


@pytest.fixture(scope="module")
def room():
    return gn.studio(64)


@pytest.fixture(scope="module")
def lobe(room):
    with pytest.warns(gn.GonioWarning):
        (lobe,) = prefilter(room, gn.Microfacet(gn.GGX(0.3), gn.Schlick(0.8)), error=0.01).lobes
    return lobe


@pytest.fixture
def seen(rng):
    """Normals and eyes of pixels of balls, spread over all views."""
    n = gn.normalise(rng.normal(size=(400, 3)))
    theta, phi = np.arcsin(np.sqrt(rng.random(400) * 0.97)), rng.random(400) * 2 * np.pi
    return n, gn.to_world(gn.frame(n), gn.from_spherical(theta, phi))


def test_an_icosahedron_has_twenty_faces_that_cover_the_sphere():
    corners, faces = explicit.icosahedron()
    assert (len(corners), len(faces)) == (12, 20)
    a, b, c = corners[faces].transpose(1, 0, 2)
    # Van Oosterom and Strackee's solid angle of a triangle.
    volume = np.einsum("fi,fi->f", a, np.cross(b, c))
    below = 1 + np.sum(a * b + b * c + c * a, axis=1)
    assert np.sum(2 * np.arctan2(volume, below)) == pytest.approx(4 * math.pi, rel=1e-12)


def test_at_the_corners_twelve_maps_are_exact(lobe, rng):
    corners, _ = explicit.icosahedron()
    n = gn.normalise(corners + 0.5 * rng.normal(size=corners.shape))
    np.testing.assert_allclose(explicit.cabral_radiance(lobe, n, corners), lobe.radiance(n, corners), rtol=1e-5)


def test_weights_are_shares_of_three_corners_around_the_eye(rng):
    wo = gn.normalise(rng.normal(size=(50, 3)))
    weights, (corners, _) = explicit.cabral_weights(wo), explicit.icosahedron()
    assert np.all(weights >= 0)
    assert np.all(np.count_nonzero(weights, axis=1) <= 3)
    np.testing.assert_allclose(weights.sum(axis=1), 1, rtol=1e-12)
    np.testing.assert_allclose(gn.normalise(weights @ corners), wo, atol=1e-12)


def test_the_maps_hold_what_the_eye_at_each_corner_sees(lobe):
    maps, grid = explicit.cabral_maps(lobe, 40), gn.LatLong(40, 80)
    corner = explicit.icosahedron()[0][3]
    # A normal that mirrors the eye into each direction a: halfway between; far from opposite ones, where it is none.
    a = grid.directions()[5:35:7, ::9].reshape(-1, 3)
    a = a[a @ corner > -0.9]
    n = gn.normalise(a + corner)
    gain = lobe._gain(n, np.broadcast_to(corner, n.shape))
    expected = lobe.radiance(n, np.broadcast_to(corner, n.shape)) / gain[:, None]
    found = maps[3][5:35:7, ::9].reshape(-1, 3)[grid.directions()[5:35:7, ::9].reshape(-1, 3) @ corner > -0.9]
    np.testing.assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())


def test_the_texture_is_the_mean_over_azimuth(lobe):
    texture, angle = explicit.kautz_mccool_texture(lobe, 30, 5)
    grid, phi = gn.LatLong(30, 60), np.arange(32) * (2 * np.pi / 32)
    a = grid.directions()[7, 20]
    for k in (1, 2, 3):
        wo = gn.to_world(gn.frame(a), gn.from_spherical(angle[k], phi))
        n = gn.normalise(a + wo)
        values = lobe.radiance(n, wo) / lobe._gain(n, wo)[:, None]
        # 32 steps integrate harmonics of order 6 exactly.
        np.testing.assert_allclose(texture[7, 20, k], values.mean(axis=0), atol=1e-5 * np.abs(texture).max())


def test_looking_along_the_axis_nothing_is_lost_without_azimuth(lobe):
    n = gn.normalise(np.array([[0.3, -0.2, 0.9]]))
    np.testing.assert_allclose(explicit.kautz_mccool_radiance(lobe, n, n), lobe.radiance(n, n), rtol=1e-5)


def test_both_leave_out_more_than_the_shrm(lobe, room, seen):
    """RH 5.7.3, figures 5.8 and 5.9."""
    n, wo = seen
    exact = gn.radiance(gn.Microfacet(gn.GGX(0.3), gn.Schlick(0.8)), room, gn.frame(n), wo)

    def error(field):
        return math.sqrt(np.mean((field - exact) ** 2) / np.mean(exact**2))

    shrm = error(lobe.radiance(n, wo))
    # Measured .045 against .066 and .090.
    assert shrm < 0.9 * error(explicit.kautz_mccool_radiance(lobe, n, wo))
    assert shrm < 0.9 * error(explicit.cabral_radiance(lobe, n, wo))


def test_a_texture_of_one_exit_is_refused(lobe):
    with pytest.raises(gn.GonioError, match="two or more"):
        explicit.kautz_mccool_texture(lobe, 30, 1)
