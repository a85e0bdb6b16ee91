"""Facts about captures: some of their photographs, what their camera sees, and maps over their pixels."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn
from gonio.brdf.radial import Interpolant, Radial
from gonio.capture.model import above
from gonio.capture.photographs import Chosen, Held
from gonio.capture.simulation import from_above
from gonio.reflection import textured

SKY = gn.normalise([[0.0, 0, 1], [1, 0, 1], [0, 1, 1], [-1, 0, 2]])
UP = np.broadcast_to([0.0, 0, 1], (3, 5, 3))


@pytest.fixture
def capture(rng):
    """Four photographs of 3 x 5 pixels, some of which are on the object."""
    mask = np.ones((3, 5), bool)
    mask[0, :2] = mask[2, 4] = False
    lights = gn.distant_lights(SKY, np.arange(1.0, 5))
    return gn.Capture(Held(rng.random((4, 3, 5, 3)), white=0.9), lights, mask, UP)


def test_some_photographs_are_read_as_they_are_in_the_order_asked_for(capture):
    held = capture.photographs
    chosen = Chosen(held, np.array([2, 0, 3]))
    assert (len(chosen), chosen.names, chosen.size) == (3, ("2", "0", "3"), (3, 5))
    at, heard = np.array([7, 0, 12]), []
    radiance, clipped = chosen.pixels(at, lambda done, total: heard.append((done, total)))
    for k, of in enumerate((2, 0, 3)):
        for a, b in zip(chosen.read(k), held.read(of), strict=True):
            np.testing.assert_array_equal(a, b)
        np.testing.assert_array_equal(radiance[k], held.radiance[of].reshape(-1, 3)[at])
        np.testing.assert_array_equal(clipped[k], held.read(of).clipped.reshape(-1)[at])
    assert heard[-1][0] == heard[-1][1]
    assert np.concatenate(list(chosen.parts(at, 2))).tolist() == [0, 1, 2]
    assert Chosen(chosen, [1, -1]).names == ("0", "3")


def test_a_selection_keeps_lights_with_their_photographs(capture):
    some = capture.select([3, 1])
    assert some.lights == (capture.lights[3], capture.lights[1])
    assert some.photographs.names == ("3", "1")
    assert some.camera is capture.camera
    np.testing.assert_array_equal(some.mask, capture.mask)
    for block, k in zip(some.reflectance(), (3, 1), strict=True):
        site = np.flatnonzero(~capture.photographs.read(k).clipped[capture.mask])
        np.testing.assert_array_equal(block.site, site)
        radiance = capture.photographs.read(k).radiance[capture.mask][site]
        assert_allclose(block.value, radiance / (capture.lights[k].irradiance * SKY[k, 2]), rtol=1e-6)
    assert capture.select([-1]).photographs.names == ("3",)
    assert dataclasses.replace(capture, lights=None).select([0, 1]).lights is None


@pytest.mark.parametrize("which", [[], [4], [0, -5], np.array([9])])
def test_photographs_that_are_none_are_refused(capture, which):
    with pytest.raises(gn.errors.ArrayError, match="give one or more of 0 to 3"):
        capture.select(which)


def test_maps_over_the_sites_are_textures_that_the_view_looks_up(capture, rng):
    n = int(capture.mask.sum())
    flat = Interpolant(rng.random((9, 5)), np.ones(5), rng.random((9, 3)), np.zeros((6, 3)))
    albedo, alpha, x, y = rng.random((n, 3)), rng.uniform(0.1, 1, n), rng.random(n), rng.random(n)
    material = gn.Lambert(albedo) + 0.5 * gn.Microfacet(gn.GGX(alpha), gn.Fresnel(1.5)) + Radial(flat, x=x, y=y)
    textures = capture.textures(material)
    lambert, scaled, radial = textures.terms
    assert lambert.albedo.shape == (3, 5, 3)
    assert scaled.model.ndf.alpha.shape == radial.x.shape == radial.y.shape == (3, 5)
    np.testing.assert_array_equal(lambert.albedo[capture.mask], albedo)
    back = textured(textures, capture.view.uv[capture.mask])
    wi, wo = np.array([0.6, 0, 0.8]), np.array([0, 0.6, 0.8])
    assert_allclose(back.f(wi, wo), material.f(wi, wo), rtol=1e-6)


def test_beyond_the_mask_textures_are_those_of_the_nearest_site(capture):
    n = int(capture.mask.sum())
    number = np.arange(1.0, n + 1)
    albedo = capture.textures(gn.Lambert(number[:, None] / n * np.ones(3))).albedo[..., 0] * n
    # Sites 1 2 3 in the first row, from its third pixel on, 4 to 8 in the second, 9 to 12 in the last.
    assert albedo[0, 0] == pytest.approx(4)
    assert albedo[0, 1] in (pytest.approx(1), pytest.approx(5))
    assert albedo[2, 4] in (pytest.approx(8), pytest.approx(12))
    assert_allclose(albedo[capture.mask], number)


def test_a_material_without_maps_is_itself_and_other_sites_are_refused(capture):
    plain = gn.Lambert([0.5, 0.3, 0.2])
    assert capture.textures(plain) is plain
    with pytest.raises(gn.errors.ArrayError, match="12 sites"):
        capture.textures(gn.Lambert(np.full((11, 3), 0.5)))


def test_a_view_holds_the_sites_at_the_pixels_of_the_mask(capture):
    view, sites = capture.view, capture.sites
    np.testing.assert_array_equal(view.mask, capture.mask)
    np.testing.assert_array_equal(view.position[capture.mask], sites.positions)
    np.testing.assert_array_equal(view.lifted[capture.mask], sites.lifted)
    assert_allclose(view.frames[capture.mask], sites.frames, atol=1e-7)
    assert_allclose(view.wo[capture.mask], np.tile([0.0, 0, 1], (12, 1)), atol=1e-12)
    assert np.isnan(view.position[~capture.mask]).all() and np.isnan(view.uv[~capture.mask]).all()
    # Row 0 of a texture lies at v = 1; pixels' centres are texels' centres.
    assert_allclose(view.uv[0, 2], [2.5 / 5, 1 - 0.5 / 3])
    assert_allclose(view.distance[capture.mask], 16 * 5)


def test_a_view_is_what_renderers_see_of_the_shape():
    sphere = gn.Sphere()
    for camera in (from_above(sphere, 20), gn.Pinhole.look_at((3, 1, 2), (0, 0, 0), 40, (16, 20))):
        capture = gn.simulate(sphere, gn.Lambert(0.5), gn.distant_lights(SKY), camera)
        seen, mask = sphere.view(camera), capture.mask
        for name in ("position", "lifted", "wo", "distance"):
            assert_allclose(getattr(capture.view, name)[mask], getattr(seen, name)[mask], rtol=1e-6, atol=1e-9)
        assert_allclose(capture.view.normal[mask], seen.normal[mask], atol=1e-6)
        assert_allclose(capture.view.frames[mask], seen.frames[mask], atol=1e-5)


def test_a_view_wants_normals(capture):
    with pytest.raises(gn.errors.ArrayError, match="give normals"):
        _ = gn.Capture(capture.photographs, camera=above((3, 5))).view
