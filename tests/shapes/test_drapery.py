"""Facts about the draped cloth, the open cylinder, and textures that are repeated."""

import numpy as np
import pytest

import gonio as gn
from gonio.capture.simulation import from_above
from gonio.rendering.image import _footprint


def test_the_cloth_is_smooth_faces_outwards_and_runs_along_its_texture():
    mesh = gn.cloth(100)
    assert mesh.vertices.shape == (101**2, 3)
    np.testing.assert_allclose(mesh.uv.min(axis=0), 0, atol=1e-12)
    np.testing.assert_allclose(mesh.uv.max(axis=0), 1)
    centre = np.flatnonzero(np.all(np.abs(mesh.uv - 0.5) < 1e-9, axis=1))[0]
    np.testing.assert_allclose(mesh.vertices[centre], (0, 0, 0.5))
    np.testing.assert_allclose(mesh.normals[centre], (0, 0, 1), atol=1e-2)
    # Folds turn some of it aside, never inwards as a whole: all that lies on the ball looks up.
    upper = mesh.vertices[:, 2] > 0.2
    assert mesh.normals[upper, 2].min() > 0.2
    # Neighbouring faces bend by a few degrees.
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    flat = gn.normalise(np.cross(b - a, c - a))
    assert np.mean(np.einsum("fi,fi->f", flat, mesh.normals[mesh.faces[:, 0]]) > 0.95) > 0.99
    # Tangents are unit, in the surface, and along growing u.
    np.testing.assert_allclose(np.linalg.norm(mesh.tangents, axis=1), 1)
    np.testing.assert_allclose(np.einsum("vi,vi->v", mesh.tangents, mesh.normals), 0, atol=1e-12)
    grid = mesh.vertices.reshape(101, 101, 3)
    along = gn.normalise(grid[:, 2:] - grid[:, :-2])
    assert np.einsum("rci,rci->rc", along, mesh.tangents.reshape(101, 101, 3)[:, 1:-1]).min() > 0.8


def test_the_cloth_never_meets_itself_and_hardly_stretches():
    mesh = gn.cloth(100)
    x, y = 2 * mesh.uv.T - 1
    # Height tells rho, and the azimuth is that of the table, so that no two places are the same.
    order = np.argsort(np.hypot(x, y), kind="stable")
    rho, z = np.hypot(x, y)[order], mesh.vertices[order, 2]
    assert np.all(np.diff(z)[np.diff(rho) > 1e-9] < 0)
    radius = np.hypot(*mesh.vertices[:, :2].T)
    off = radius * np.stack((x, y)) - np.hypot(x, y) * mesh.vertices[:, :2].T
    np.testing.assert_allclose(off, 0, atol=1e-12)
    assert radius[np.hypot(x, y) > 0.01].min() > 0.005
    grid = mesh.vertices.reshape(101, 101, 3)
    stretch = np.concatenate([np.linalg.norm(np.diff(grid, axis=k), axis=-1).ravel() for k in (0, 1)]) / 0.02
    assert np.all((np.quantile(stretch, (0.1, 0.5, 0.9)) > 0.7) & (np.quantile(stretch, (0.1, 0.5, 0.9)) < 1.15))


def test_the_cylinder_is_open_upright_and_seen_from_outside():
    mesh = gn.cylinder(0.5, 3.0, 64)
    np.testing.assert_allclose(np.hypot(*mesh.vertices[:, :2].T), 0.5)
    np.testing.assert_allclose(mesh.bounds, [[-0.5, -0.5, -1.5], [0.5, 0.5, 1.5]], atol=1e-12)
    np.testing.assert_allclose(mesh.normals[:, :2], 2 * mesh.vertices[:, :2], atol=1e-12)
    np.testing.assert_allclose(mesh.tangents[:, 2], 0, atol=1e-12)
    view = mesh.trace(np.array([[0, 0, 5.0], [5.0, 0.01, 0.75]]), np.array([[0, 0, -1.0], [-1, 0, 0]]))
    assert view.mask.tolist() == [False, True]
    assert view.uv[1] == pytest.approx((0.0032, 0.75), abs=1e-3)
    for bad in ((0.0, 1.0), (1.0, np.nan)):
        with pytest.raises(gn.GonioError, match="radius"):
            gn.cylinder(*bad)
    with pytest.raises(gn.GonioError, match="steps = 3"):
        gn.cloth(3)


def test_a_repeated_texture_is_tiled():
    plane = gn.Plane()
    tiled = gn.Repeated(plane, 3)
    camera = from_above(plane, 12)
    view, seen = tiled.view(camera), plane.view(camera)
    np.testing.assert_allclose(view.uv[view.mask], 3 * seen.uv[seen.mask] % 1)
    np.testing.assert_array_equal(view.position, seen.position)
    np.testing.assert_array_equal(tiled.bounds, plane.bounds)
    up = np.array([0.0, 0, 1])
    assert tiled.occluded(-up, up)
    bare = gn.Repeated(gn.Mesh(np.eye(3), np.array([[0, 1, 2]])), 2)
    assert bare.trace(2 * np.ones(3), -np.ones(3) / 3**0.5).uv is None
    for times in (0, 1.5):
        with pytest.raises(gn.GonioError, match="times"):
            gn.Repeated(plane, times)


def test_footprints_are_the_area_between_rays():
    plane = gn.Plane()
    camera = from_above(plane, 24)
    for times in (1, 4):
        view = gn.Repeated(plane, times).view(camera)
        # 24 pixels see 1.04 of the texture along each side; tiles' seams and the outline make no leap.
        np.testing.assert_allclose(_footprint(view.uv)[view.mask], times * 1.04 / 24, rtol=1e-9)
    # A turn and a squeeze keep the area but for what they squeeze.
    turned = plane.view(camera).uv @ np.array([[0.6, 0.8], [-0.8, 0.6]]) * [0.1, 0.4]
    np.testing.assert_allclose(_footprint(turned)[view.mask], 0.2 * 1.04 / 24, rtol=1e-9)
    assert np.all(_footprint(view.uv)[~view.mask] == 0)
    assert _footprint(view.uv[:1, :1]).tolist() == [[0.0]]
