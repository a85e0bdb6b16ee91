"""Facts about what photographs show beyond a model: they are kept, belong to their lights, and lie between them."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn
from gonio.rendering.precomputing import precompute
from gonio.rendering.residuals import Residuals, _left_out

MATTE = gn.Lambert([0.5, 0.4, 0.3])


def dome(count):
    """Directions within 70 degrees of +z, evenly."""
    k = np.arange(count) + 0.5
    return gn.from_spherical(np.arccos(1 - (1 - np.cos(np.radians(70))) * k / count), 2.399963 * k)


@pytest.fixture(scope="module")
def scene():
    """A column in a plain, that throws shadows: its capture, under 40 lights, and what has no shadows."""
    y, x = np.mgrid[-1:1:20j, -1:1:20j]
    mound = gn.HeightField(9 / (1 + (3 * np.hypot(x, y)) ** 6))
    lights = gn.distant_lights(dome(40), np.linspace(2, 4, 40))
    capture = gn.simulate(mound, MATTE, lights, mound.camera(), shadows=True)
    return capture, gn.Relightable(capture.view, MATTE)


def kept(scene, which):
    capture, thing = scene
    return gn.with_residuals(thing, [capture.lights[k] for k in which], (capture.photographs.read(k) for k in which))


def off(image, photograph):
    return np.sqrt(np.mean((image - photograph) ** 2) / np.mean(photograph**2))


def test_shadows_of_lights_that_were_left_out_lie_between_those_that_were_kept(scene):
    capture, bare = scene
    thing = kept(scene, [k for k in range(40) if k % 5])
    errors = []
    for k in range(5, 40, 5):
        photograph = capture.photographs.read(k).radiance
        errors.append([off(gn.relight(each, capture.lights[k]), photograph) for each in (bare, thing)])
    without, with_them = np.median(errors, axis=0)
    assert without > 0.2
    # Lights lie 18 degrees apart, and shadows move between them by a third of their length.
    assert with_them < 0.67 * without


def test_photographs_that_are_kept_are_shown_and_nothing_is_added_far_from_them(scene):
    capture, bare = scene
    thing = dataclasses.replace(kept(scene, range(12)), residuals=None)
    residuals = dataclasses.replace(kept(scene, range(12)).residuals, reach=0.25, noise=1e-6)
    thing = dataclasses.replace(thing, residuals=residuals)
    for k in range(12):
        image, photograph = gn.relight(thing, capture.lights[k]), capture.photographs.read(k).radiance
        assert_allclose(image[capture.mask], photograph[capture.mask], atol=1e-4 * photograph.max())
    behind = gn.Directional(-residuals.directions[:12].mean(axis=0) / np.linalg.norm(residuals.directions.mean(axis=0)))
    # All lights that were kept lie more than a radius away: e^-4.
    assert np.abs(residuals.under(behind)).max() < 0.1 * np.abs(residuals.images).max()
    assert off(gn.relight(thing, capture.lights[39]), gn.relight(bare, capture.lights[39])) < 0.5


def test_lights_add_and_a_sky_is_all_its_beams(scene):
    residuals = kept(scene, range(0, 40, 3)).residuals
    suns = gn.distant_lights(dome(5), [1.0, 2, 3, 4, 5])
    total = sum(residuals.under(sun) for sun in suns)
    assert_allclose(residuals.under(gn.Lights(tuple(suns))), total, rtol=1e-4, atol=1e-6)
    sky = gn.Environment(np.random.default_rng(0).random((8, 16, 3)))
    w, shown = sky.directions()
    one_by_one = np.tensordot(
        residuals.weights(w.reshape(-1, 3)) * sky.solid_angles.reshape(-1, 1), residuals.images, (1, 0)
    )
    expected = np.einsum("msc,mc->sc", one_by_one, sky.image.reshape(-1, 3) * shown.reshape(-1, 1))
    assert_allclose(residuals.under(sky), expected, rtol=1e-3, atol=1e-5)
    lamps = gn.near_lights([[0.0, 0, 9]], [5.0])
    assert not residuals.under(lamps[0]).any()


def test_what_is_missed_when_a_photograph_is_left_out_is_what_leaving_it_out_misses(rng):
    directions, images = dome(14), rng.normal(size=(14, 30, 3)).astype(np.float32)
    levels = rng.uniform(1, 2, 14)
    missed = []
    for k in range(14):
        others = np.arange(14) != k
        few = Residuals(directions[others], images[others], 0.7, 0.05)
        found = np.tensordot(few.weights(directions[k : k + 1])[0], few.images, 1)
        missed.append(np.sqrt(np.mean((found - images[k]) ** 2)) / levels[k])
    flat = images.reshape(14, -1).astype(float)
    assert _left_out(directions, flat @ flat.T / flat.shape[1], levels, 0.7, 0.05) == pytest.approx(np.median(missed))


def test_residuals_that_are_noise_are_not_believed(rng):
    directions, noise = dome(30), rng.normal(size=(30, 200, 3)).astype(np.float32)
    slow = (directions @ rng.normal(size=(3, 600))).reshape(30, 200, 3).astype(np.float32)
    of_noise, of_slow = (Residuals.of(directions, images, np.ones(30)) for images in (noise, slow))
    assert of_noise.noise == 1.0
    assert of_slow.noise == 0.01 and of_slow.reach == 2.0
    few = Residuals.of(directions[:11], noise[:11], np.ones(11))
    assert (few.reach, few.noise) == (1.0, 0.03)


def test_precomputed_images_hold_them(scene):
    thing = kept(scene, range(0, 40, 2))
    made = precompute(thing, error=0.01, side=8, samples=2)
    sky = gn.Environment(1 + np.outer(np.linspace(1, 0, 16), np.ones(32))[..., None] * np.ones(3))
    found, expected = made.relight(sky), gn.relight(thing, sky)
    assert off(found, expected) < 0.03 < off(gn.relight(scene[1], sky), expected)


def test_the_clipped_are_left_to_the_model(scene):
    capture, bare = scene
    light, photograph = capture.lights[0], capture.photographs.read(0).radiance
    clipped = np.zeros(capture.mask.shape, bool)
    clipped[:5] = True
    residuals = gn.with_residuals(bare, [light], [(photograph + 1, clipped)]).residuals
    assert not residuals.images[0, : 5 * capture.mask.shape[1]].any()
    assert residuals.images[0, 5 * capture.mask.shape[1] :].all()


def test_what_cannot_be_kept_is_refused(scene, monkeypatch):
    capture, bare = scene
    read, sun = capture.photographs.read(0), capture.lights[0]
    for lights in (gn.near_lights([[0.0, 0, 9]], [5.0]), [gn.Environment(np.ones((2, 4, 3)))]):
        with pytest.raises(gn.GonioError, match=r"lights\[0\] is no directional light"):
            gn.with_residuals(bare, lights, [read])
    with pytest.raises(gn.GonioError, match=r"photographs\[0\] has shape \(20, 19, 3\)"):
        gn.with_residuals(bare, [sun], [(read.radiance[:, 1:], read.clipped[:, 1:])])
    images = np.zeros((1, 7, 3))
    with pytest.raises(gn.GonioError, match="residuals are of 7 pixels, the view sees 400"):
        dataclasses.replace(bare, residuals=Residuals([[0.0, 0, 1]], images, 1.0, 0.1))
    with pytest.raises(gn.GonioError, match="noise = 0"):
        Residuals([[0.0, 0, 1]], images, 1.0, 0.0)
    with pytest.raises(gn.GonioError, match=r"directions have shape \(2, 3\)"):
        Residuals([[0.0, 0, 1]] * 2, images, 1.0, 0.1)
    monkeypatch.setattr("gonio.rendering.relight.MEMORY_LIMIT", 100)
    with pytest.raises(gn.errors.MemoryLimitError, match="keep fewer"):
        gn.with_residuals(bare, [sun], [read])
