"""Two parts of a BRDF told from photographs of each: body and surface (RS 14)."""

import dataclasses

import numpy as np
import pytest

import gonio as gn
from gonio.capture.parts import parts_by_colour, parts_by_least_light, parts_by_polarisers
from gonio.capture.photographs import Held
from gonio.capture.simulation import from_above
from gonio.fitting.dichromatic import share_dichromatic
from gonio.fitting.sharing import Scales

SCALES = Scales(0.3, 0.5, 0.001), Scales(0.3, 0.5, 0.001)
LIGHTS = gn.distant_lights(
    gn.from_spherical(np.arccos(1 - 0.06 * (np.arange(10) + 0.5)), np.arange(10) * 2.39996), np.full(10, np.pi)
)


def tone(x, y):
    """Squares of two colours."""
    return np.where(((np.floor(6 * x) + np.floor(6 * y)) % 2)[:, None], [0.05, 0.1, 0.3], [0.6, 0.2, 0.1])


def gloss(x):
    return 3 * gn.Microfacet(gn.GGX(0.3 + 0.1 * x), gn.Fresnel(1.5))


@pytest.fixture(scope="module")
def parts():
    """A chequered ball whose gloss widens to the right: its two parts, and both together."""
    camera = from_above(gn.Sphere(), 32)
    capture = gn.simulate(gn.Sphere(), gn.Lambert(0.5), LIGHTS, camera)
    sites, wo = capture.sites, capture.observe(0).wo
    x, y = sites.positions[:, :2].T
    images = []
    for material in (gn.Lambert(tone(x, y)), gloss(x)):
        image = np.zeros((len(LIGHTS), *camera.size, 3))
        for one, light in zip(image, LIGHTS, strict=True):
            one[capture.mask] = gn.radiance(material, light, sites.frames, wo)
        images.append(image)
    return tuple(dataclasses.replace(capture, photographs=Held(x)) for x in (*images, sum(images)))


def held(capture, change):
    return dataclasses.replace(capture, photographs=Held(change(capture.photographs.radiance)))


def off(a, b, mask):
    return np.sqrt(np.mean((a[mask] - b[mask]) ** 2) / np.mean(b[mask] ** 2))


def test_two_parts_predict_what_one_with_a_colour_cannot(parts):
    matte, shiny, both = parts
    kept = [0, 1, 2, 3, 4, 5, 7, 8, 9]
    places = (both.sites.positions[:, :2] + 1) / 2
    d, g = (part.select(kept).reflectance() for part in (matte, shiny))
    heard = []
    fit = share_dichromatic(
        d, g, places, centres=40, specular_centres=300, scales=SCALES, progress=lambda *x: heard.append(x)
    )
    one = gn.share_reflectance(both.select(kept).reflectance(), places, centres=340, scales=SCALES[0], texture=True)
    predicted = []
    for material in (fit.material, one.value.material):
        thing = gn.Relightable(both.view, both.textures(material))
        predicted.append(off(gn.relight(thing, LIGHTS[6]), both.photographs.read(6).radiance, both.mask))
    # White highlights over dark squares are no multiple of their colour.
    assert predicted[0] < 0.02
    assert predicted[1] > 5 * predicted[0]
    assert fit.diffuse.residual < 0.005
    assert fit.specular.residual < 0.03
    assert heard[-1] == (340, 340)
    # g is one value for all channels.
    assert fit.material.terms[1].interpolant.coefficients.shape == (300, 1)


def test_polarisers_give_the_parts_back(parts):
    matte, shiny, both = parts
    crossed = held(matte, lambda x: x / 2)
    parallel = held(both, lambda x: x - matte.photographs.radiance / 2)
    diffuse, specular = parts_by_polarisers(parallel, crossed)
    for found, truth in ((diffuse, matte), (specular, shiny)):
        np.testing.assert_allclose(
            found.photographs.read(3).radiance, truth.photographs.read(3).radiance, rtol=1e-5, atol=1e-6
        )
        at = np.flatnonzero(both.mask)[::7]
        np.testing.assert_array_equal(
            found.photographs.pixels(at).radiance[3], found.photographs.read(3).radiance.reshape(-1, 3)[at]
        )
    with pytest.raises(gn.errors.ArrayError, match=r"10 photographs .* the crossed one 9"):
        parts_by_polarisers(parallel, crossed.select(range(9)))


@pytest.mark.parametrize("separate", [parts_by_colour, parts_by_least_light])
def test_parts_add_up_and_are_near_the_truth(parts, separate):
    _, shiny, both = parts
    strong = dataclasses.replace(
        both, lights=gn.distant_lights(both.directions, np.full((10, 3), np.pi) * [1.2, 1.0, 0.8])
    )
    strong = held(strong, lambda x: x * np.float32([1.2, 1.0, 0.8]))
    heard = []
    diffuse, specular = separate(strong, lambda *x: heard.append(x))
    assert heard[-1] == (len(both.sites),) * 2
    for k in (0, 6):
        a, b = (x.photographs.read(k).radiance[both.mask] for x in (diffuse, specular))
        np.testing.assert_allclose(a + b, strong.photographs.read(k).radiance[both.mask], rtol=1e-5, atol=1e-6)
    # One light in five at least makes no highlight there, which both suppose.
    found = specular.photographs.read(6).radiance / [1.2, 1.0, 0.8]
    assert off(found, shiny.photographs.read(6).radiance, both.mask) < 0.35


def test_what_cannot_be_parted_is_refused(parts, monkeypatch):
    both = parts[2]
    with pytest.raises(gn.errors.ArrayError, match="lights are unknown"):
        parts_by_colour(dataclasses.replace(both, lights=None))
    monkeypatch.setattr("gonio.capture.parts.MEMORY_LIMIT", 1000)
    with pytest.raises(gn.errors.MemoryLimitError, match="Select fewer"):
        parts_by_colour(both)
