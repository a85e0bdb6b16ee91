"""Facts about photometric stereo."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn
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
    capture = gn.Capture(Held(photographed(normals, lights, intensities=intensities)), lights, intensities, mask)
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
    capture = gn.Capture(Held(images), lights, mask=mask)
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
    relief = gn.photometric_stereo(gn.Capture(Held(images), lights), robust=False)
    scatter = np.sqrt(np.mean(np.sum((relief.normals - n) ** 2, axis=-1)))
    # 3,600 pixels tell a standard deviation to 1.2 %.
    assert np.sqrt(np.mean(relief.error**2)) == pytest.approx(scatter, rel=0.05)


def test_clipped_pixels_do_not_count():
    normals, mask = ball()
    lights = dome()
    images = photographed(normals, lights)
    capture = gn.Capture(Held(np.minimum(images, 0.3), white=0.3), lights, mask=mask)
    relief = gn.photometric_stereo(capture, robust=False)
    known = np.isfinite(relief.error) & mask
    assert known.mean() > 0.2 * mask.mean()
    # Few lights are left near the rim, and the rounds end where g changes by a thousandth.
    assert degrees(relief.normals[known], normals[known]).max() < 0.5


def test_progress_runs_to_its_end():
    normals, mask = ball(16)
    heard = []
    capture = gn.Capture(Held(photographed(normals, dome())), dome(), mask=mask)
    gn.photometric_stereo(capture, progress=lambda done, total: heard.append((done, total)))
    assert heard[0] == (1, 40)
    assert heard[-1] == (40, 40)


def test_lights_that_cannot_tell_normals_are_refused():
    normals, _ = ball(16)
    lights = dome(4)
    capture = gn.Capture(Held(photographed(normals, lights)), lights)
    with pytest.raises(gn.GonioError, match="lights are unknown"):
        gn.photometric_stereo(dataclasses.replace(capture, directions=None))
    plane = gn.normalise([[1, 0, 1], [0.2, 0, 1], [-0.5, 0, 1], [0, 0, 1]])
    with pytest.raises(gn.GonioError, match="do not span space"):
        gn.photometric_stereo(dataclasses.replace(capture, directions=plane))


def test_a_capture_is_checked_when_it_is_made():
    images = Held(np.ones((2, 3, 4, 3)))
    for arguments, message in (
        ({"directions": np.eye(3)}, r"directions has shape \(3, 3\)"),
        ({"directions": np.ones((2, 3))}, "length"),
        ({"intensities": np.zeros((2, 3))}, "not all positive"),
        ({"mask": np.zeros((3, 4), bool)}, "mask is empty"),
        ({"mask": np.ones((4, 3), bool)}, "mask has shape"),
        ({"normals": np.ones((3, 4, 3))}, "length"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            gn.Capture(images, **arguments)
    with pytest.raises(gn.GonioError, match="is wanted"):
        Held(np.ones((3, 4, 3)))
    assert_allclose(gn.Capture(images, intensities=np.full((2, 3), 2.0)).mean(), 0.5)


def test_normals_of_a_rendered_relief_are_within_a_degree_of_those_given(data):
    capture = gn.read_capture(data / "rti/synth/Single/Object1/material1/Dome", "srgb")
    relief = gn.photometric_stereo(capture)
    assert degrees(relief.normals, capture.normals).mean() < 1
    # What its residuals foresee is what it misses, by a half more or less.
    off = np.median(degrees(relief.normals, capture.normals))
    assert 0.5 < np.degrees(np.median(relief.error)) / off < 2
