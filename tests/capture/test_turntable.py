"""Facts about photographs from many places, and about meshes laid out over their texture."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn
from gonio.shapes.atlas import atlas

PLASTIC = gn.Lambert([0.5, 0.3, 0.2]) + gn.Microfacet(gn.GGX(0.4), gn.Fresnel(1.5))


def ring(count, size=96):
    turn = 2 * np.pi * np.arange(count) / count
    eyes = np.stack((4 * np.cos(turn), 4 * np.sin(turn), np.full(count, 1.5)), axis=-1)
    return [gn.Pinhole.look_at(eye, (0, 0, 0), 40, (size, size)) for eye in eyes]


def suns(count):
    return gn.distant_lights(
        gn.from_spherical(0.4 + 0.05 * np.arange(count), 2.4 * np.arange(count)), np.full(count, 3)
    )


def turntable(**changes):
    scene = {"material": PLASTIC, "lights": suns(6), "cameras": ring(6)} | changes
    return gn.simulate_turntable(gn.vase(96), scene["material"], scene["lights"], scene["cameras"])


def test_samples_from_many_places_are_the_brdf():
    capture = turntable()
    misses, count = [], 0
    for block in capture.reflectance():
        # Not where light or eye graze: there the radiance between pixels is not bilinear.
        good = (block.wi[:, 2] > 0.3) & (block.wo[:, 2] > 0.3)
        expected = PLASTIC.f(block.wi[good], block.wo[good])
        misses.append(np.abs(block.value[good] / expected - 1).max(axis=1))
        count += good.sum()
    misses = np.concatenate(misses)
    assert count > 0.4 * len(capture.sites)
    # Radiance bends by some percent from one of 96 pixels to the next, and more where the highlight is.
    assert np.median(misses) < 0.005
    assert np.quantile(misses, 0.95) < 0.05


def test_every_site_is_seen_only_from_before_it():
    capture = turntable()
    normals = capture.sites.frames[:, 2]
    for k, camera in enumerate(capture.cameras):
        seen = capture.observe(k)
        towards = gn.normalise(camera.position - capture.sites.positions)
        assert_allclose(seen.wo, towards, atol=1e-12)
        assert (np.sum(normals * towards, axis=1)[seen.known] > np.cos(np.radians(80))).all()
    back = np.sum(normals * gn.normalise(capture.cameras[0].position), axis=1) < -0.3
    assert not capture.observe(0).known[back].any()


def test_what_the_shape_hides_is_not_seen():
    # A ball behind a wall: all of the ball's vertices face the camera or not, and none is seen through the wall.
    ball = gn.vase(24)
    wall = np.array([[2.0, -3, -3], [2, 3, -3], [2, 3, 3], [2, -3, 3]])
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + len(ball.vertices)
    both = gn.Mesh(np.concatenate((ball.vertices, wall)), np.concatenate((ball.faces, faces)))
    camera = gn.Pinhole.look_at((6, 0, 0), (0, 0, 0), 40, (32, 32))
    capture = gn.simulate_turntable(both, gn.Lambert(0.5), suns(1), [camera])
    assert not capture.observe(0).known[: len(ball.vertices)].any()


def test_slices_of_a_turntable_hold_the_same_samples():
    capture = turntable()
    samples, some = capture.reflectance(), np.arange(0, 22000, 97)
    slices = samples.at(some)
    assert slices.wo.shape == slices.wi.shape
    for k, block in enumerate(samples):
        for i, site in enumerate(some):
            at = np.flatnonzero(block.site == site)
            if at.size:
                assert_allclose(slices.value[i, k], block.value[at[0]], rtol=1e-6)
                assert_allclose(slices.wo[i, k], block.wo[at[0]], atol=1e-12)
            else:
                assert np.isnan(slices.value[i, k]).all()
    assert np.isfinite(slices.value[..., 0]).any(axis=1).mean() > 0.3


def test_radiance_under_an_unknown_light_is_told_from_every_place():
    capture = turntable(lights=gn.studio(32))
    assert capture.lights is None
    blocks = list(capture.radiance())
    assert len(blocks) == 6
    with pytest.raises(gn.GonioError, match="lights are unknown"):
        capture.reflectance()


def test_texels_lie_on_the_mesh_where_its_uv_says():
    shape = gn.vase(64)
    view = atlas(shape, (40, 80))
    rows, columns = np.nonzero(view.mask)
    assert view.mask.mean() > 0.95
    assert_allclose(view.uv[view.mask][:, 0], (columns + 0.5) / 80, atol=1e-9)
    assert_allclose(view.uv[view.mask][:, 1], 1 - (rows + 0.5) / 40, atol=1e-9)
    # u goes round: positions at column j stand at that azimuth, up to the chords of 64 sides.
    position, turn = view.position[view.mask], 2 * np.pi * (columns + 0.5) / 80
    off = position[:, 1] * np.cos(turn) - position[:, 0] * np.sin(turn)
    assert np.abs(off).max() < 2e-3


def test_samples_over_texels_are_the_texture(rng):
    texture = rng.random((6, 12, 3)) * 0.5 + 0.2
    albedo = np.repeat(np.repeat(texture, 8, axis=0), 8, axis=1)
    capture = turntable(material=gn.Lambert(albedo), cameras=ring(6, 300))
    capture = dataclasses.replace(capture, texels=(48, 96))
    total, weight = np.zeros((len(capture.sites), 3)), np.zeros(len(capture.sites))
    for block in capture.reflectance():
        np.add.at(total, block.site, block.value * block.weight[:, None])
        np.add.at(weight, block.site, block.weight)
    rows, columns = np.nonzero(capture.mask)
    # In the middles of the patches, away from their edges and the frame's.
    inner = (rows % 8 > 2) & (rows % 8 < 5) & (columns % 8 > 2) & (columns % 8 < 5) & (weight > 0)
    assert inner.sum() > 150
    found = total[inner] / weight[inner, None] * np.pi
    assert np.median(np.abs(found / albedo[rows[inner], columns[inner]] - 1)) < 0.01


def test_what_does_not_fit_a_turntable_is_refused():
    capture = turntable()
    for arguments, message in (
        ({"cameras": ring(5)}, "5 cameras came for 6 photographs"),
        ({"cameras": ring(6, 32)}, r"cameras\[0\] has \(32, 32\) pixels"),
        ({"lights": suns(5)}, "5 lights came"),
        ({"grazing": 100}, "grazing = 100"),
        ({"shape": gn.Mesh(gn.vase(8).vertices, gn.vase(8).faces), "texels": (8, 8)}, "want a shape with uv"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            dataclasses.replace(capture, **arguments)
    with pytest.raises(gn.GonioError, match="shape is unknown"):
        next(dataclasses.replace(capture, shape=None).radiance())
    with pytest.raises(gn.GonioError, match="no texture coordinates"):
        atlas(gn.Mesh(gn.vase(8).vertices, gn.vase(8).faces), (4, 4))
