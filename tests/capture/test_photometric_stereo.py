"""Facts about photometric stereo."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn
from gonio.capture import photometric_stereo as stereo
from gonio.capture.photographs import Held


def degrees(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1)))


def ball(size=40):
    """Normals and mask of a ball, orthographic."""
    y, x = (size / 2 - np.arange(size) - 0.5) / (0.45 * size), (np.arange(size) + 0.5 - size / 2) / (0.45 * size)
    x, y = np.meshgrid(x, y)
    mask = x * x + y * y < 0.9
    z = np.sqrt(np.where(mask, 1 - x * x - y * y, 0))
    return np.where(mask[..., None], np.stack((x, y, z), axis=-1), [0.0, 0, 1]), mask


def dome(count=20):
    """Lights at 20 and 55 degrees from the camera."""
    theta = np.radians(np.where(np.arange(count) % 2, 20.0, 55.0))
    return gn.from_spherical(theta, np.arange(count) * 2.4)


def photographed(normals, lights, albedo=(0.6, 0.4, 0.2), intensities=None):
    shading = np.maximum(np.einsum("rci,ki->krc", normals, lights), 0)[..., None] * np.array(albedo)
    return shading if intensities is None else shading * intensities[:, None, None, :]


def test_a_matte_ball_is_recovered_exactly_with_its_colour_and_its_attached_shadows():
    normals, mask = ball()
    lights = dome()
    intensities = np.stack([np.linspace(0.5, 2, 20), np.linspace(1, 1.5, 20), np.linspace(2, 1, 20)], axis=-1)
    capture = gn.Capture(
        Held(photographed(normals, lights, intensities=intensities)), gn.distant_lights(lights, intensities), mask
    )
    for robust in (False, True):
        relief = gn.photometric_stereo(capture, robust)
        # Single precision of the photographs; facing away is told from 3 % of the albedo on.
        assert degrees(relief.normals[mask], normals[mask]).max() < 0.01
        assert_allclose(relief.albedo[mask], np.broadcast_to((0.6, 0.4, 0.2), (mask.sum(), 3)), rtol=1e-4)
        assert relief.error[mask].max() < 1e-4
        assert np.isnan(relief.normals[~mask]).all()
        assert not relief.used[~mask].any()


def test_highlights_and_cast_shadows_on_a_third_of_the_photographs_do_not_turn_robust_normals(rng):
    normals, mask = ball()
    lights = dome()
    images = photographed(normals, lights) + rng.normal(size=(20, 40, 40, 1)) * 0.002
    spoilt = rng.permuted(np.tile(np.arange(20)[:, None, None] < 6, (1, 40, 40)), axis=0)
    images = np.where(spoilt[..., None], rng.choice([0.0, 1.5], size=(20, 40, 40, 1)), images)
    capture = gn.Capture(Held(images), gn.distant_lights(lights), mask)
    robust, least = (gn.photometric_stereo(capture, robust) for robust in (True, False))
    off = degrees(robust.normals[mask], normals[mask])
    assert np.median(off) < 1
    assert np.quantile(off, 0.9) < 3
    assert np.median(degrees(least.normals[mask], normals[mask])) > 10


def test_the_standard_error_is_the_scatter_of_normals(rng):
    lights = dome()
    n = gn.normalise([0.2, -0.1, 1.0])
    normals = np.broadcast_to(n, (60, 60, 3))
    images = photographed(normals, lights) + rng.normal(size=(20, 60, 60, 1)) * 0.01
    relief = gn.photometric_stereo(gn.Capture(Held(images), gn.distant_lights(lights)), robust=False)
    scatter = np.sqrt(np.mean(np.sum((relief.normals - n) ** 2, axis=-1)))
    # 3,600 pixels tell a standard deviation to 1.2 %.
    assert np.sqrt(np.mean(relief.error**2)) == pytest.approx(scatter, rel=0.05)


def test_clipped_pixels_do_not_count():
    normals, mask = ball()
    lights = dome()
    images = photographed(normals, lights)
    capture = gn.Capture(Held(np.minimum(images, 0.3), white=0.3), gn.distant_lights(lights), mask)
    relief = gn.photometric_stereo(capture, robust=False)
    known = np.isfinite(relief.error) & mask
    assert known.mean() > 0.2 * mask.mean()
    # Few lights are left near the rim, and the rounds end where g changes by a thousandth.
    assert degrees(relief.normals[known], normals[known]).max() < 0.5


def test_progress_runs_to_its_end():
    normals, mask = ball(16)
    heard = []
    capture = gn.Capture(Held(photographed(normals, dome())), gn.distant_lights(dome()), mask)
    gn.photometric_stereo(capture, progress=lambda done, total: heard.append((done, total)))
    assert heard[0] == (1, 40)
    assert heard[-1] == (40, 40)


def test_lights_that_cannot_tell_normals_are_refused():
    normals, _ = ball(16)
    lights = dome(4)
    capture = gn.Capture(Held(photographed(normals, lights)), gn.distant_lights(lights))
    with pytest.raises(gn.GonioError, match="lights are unknown"):
        gn.photometric_stereo(dataclasses.replace(capture, lights=None))
    plane = gn.normalise([[1, 0, 1], [0.2, 0, 1], [-0.5, 0, 1], [0, 0, 1]])
    with pytest.raises(gn.GonioError, match="do not span space"):
        gn.photometric_stereo(dataclasses.replace(capture, lights=gn.distant_lights(plane)))


def test_a_capture_is_checked_when_it_is_made():
    images = Held(np.ones((2, 3, 4, 3)))
    for arguments, message in (
        ({"lights": gn.distant_lights(np.eye(3))}, "3 lights came for 2 photographs"),
        ({"lights": (gn.studio(), gn.studio())}, r"lights\[0\] is Environment"),
        ({"camera": gn.Orthographic(pixel=1, size=(4, 3))}, r"camera has \(4, 3\) pixels"),
        ({"eye": np.ones(2)}, "eye has shape"),
        ({"mask": np.zeros((3, 4), bool)}, "mask is empty"),
        ({"mask": np.ones((4, 3), bool)}, "mask has shape"),
        ({"normals": np.ones((3, 4, 3))}, "length"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            gn.Capture(images, **arguments)
    with pytest.raises(gn.GonioError, match="is wanted"):
        Held(np.ones((3, 4, 3)))
    assert_allclose(gn.Capture(images).mean(), 1)


def test_normals_of_a_rendered_relief_are_within_a_degree_of_those_given(data):
    capture = gn.read_capture(data / "rti/synth/Single/Object1/material1/Dome", "srgb")
    relief = gn.photometric_stereo(capture)
    assert degrees(relief.normals, capture.normals).mean() < 1
    # What its residuals foresee is what it misses, by a half more or less.
    off = np.median(degrees(relief.normals, capture.normals))
    assert 0.5 < np.degrees(np.median(relief.error)) / off < 2


def test_near_lights_are_seen_from_each_pixel():
    # A flat sample of 20 texels under lamps 25 above it: a distant light's normals would lean by tens of degrees.
    flat = gn.HeightField(np.zeros((20, 20)))
    places = 25 * np.array([[0.0, 0, 1], [0.8, 0, 1], [-0.4, 0.7, 1], [-0.4, -0.7, 1], [0.3, 0.3, 1]])
    capture = gn.simulate(flat, gn.Lambert([0.5, 0.3, 0.2]), gn.near_lights(places, np.full(5, 2000.0)), flat.camera())
    relief = gn.photometric_stereo(capture)
    assert_allclose(relief.normals, np.broadcast_to([0.0, 0, 1], (20, 20, 3)), atol=1e-5)
    assert_allclose(relief.albedo, np.broadcast_to(np.array([0.5, 0.3, 0.2]) / np.pi, (20, 20, 3)), rtol=1e-5)
    far = dataclasses.replace(capture, lights=gn.distant_lights(gn.normalise(places)))
    off = np.arccos(gn.photometric_stereo(far).normals[0, 0, 2].clip(-1, 1))
    assert np.degrees(off) > 10


def test_lamps_that_look_away_do_not_count():
    flat = gn.HeightField(np.zeros((8, 8)))
    places = 25 * np.array([[0.0, 0, 1], [0.8, 0, 1], [-0.4, 0.7, 1], [-0.4, -0.7, 1], [0.3, 0.3, 1]])
    axis = np.array([[0.0, 0, -1]] * 4 + [[0, 0, 1]])
    capture = gn.simulate(flat, gn.Lambert(0.5), gn.near_lights(places, axis=axis), flat.camera())
    relief = gn.photometric_stereo(capture)
    assert_allclose(relief.normals, np.broadcast_to([0.0, 0, 1], (8, 8, 3)), atol=1e-5)
    assert_allclose(relief.albedo, 0.5 / np.pi, rtol=1e-5)
    assert (relief.used == 4).all()


def test_pixels_taken_in_parts_have_the_same_normals(monkeypatch):
    normals, mask = ball(24)
    capture = gn.Capture(Held(photographed(normals, dome())), gn.distant_lights(dome()), mask)
    whole = gn.photometric_stereo(capture)
    monkeypatch.setattr(stereo, "_MEMORY", 13 * len(dome()) * 50)  # fifty pixels
    heard = []
    parts = gn.photometric_stereo(capture, progress=lambda done, total: heard.append((done, total)))
    for name in ("normals", "albedo", "residual", "error", "used"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))
    assert len({total for _, total in heard}) == 1
    assert [done for done, _ in heard] == sorted(done for done, _ in heard)
    assert heard[-1][0] == heard[-1][1]
