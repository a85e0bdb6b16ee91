"""Both ray tracers meet what brute force meets, at any scale and from any distance."""

import sys

import numpy as np
import pytest
from reference import rays

import gonio as gn
from gonio.shapes.visibility import Embree, Hierarchy, default_tracer


def soup(rng, faces=300, size=0.4):
    """Triangles at random places: every depth, orientation and size."""
    centre = rng.uniform(-1, 1, size=(faces, 1, 3))
    corners = centre + rng.normal(size=(faces, 3, 3)) * rng.uniform(0.01, size, size=(faces, 1, 1))
    return corners.reshape(-1, 3), np.arange(3 * faces).reshape(-1, 3)


def bundle(rng, count=400):
    origins = rng.uniform(-2, 2, size=(count, 3))
    return origins, gn.normalise(rng.uniform(-1, 1, size=(count, 3)) - origins)


def tracers():
    yield pytest.param(Hierarchy, id="hierarchy")
    yield pytest.param(Embree, id="embree")


@pytest.fixture(params=tracers())
def tracer(request):
    if request.param is Embree:
        pytest.importorskip("embreex")
    return request.param


def test_rays_meet_what_brute_force_meets(tracer, rng):
    vertices, faces = soup(rng)
    origins, directions = bundle(rng)
    hits = gn.Scene(vertices, faces, tracer).intersect(origins, directions)
    t, face = rays.intersect(origins, directions, vertices[faces])
    # Single precision may see a ray within 1e-6 of an edge on its other side: at most one in 400 here.
    same = hits.face == face
    assert same.mean() > 0.997
    met = same & (face >= 0)
    assert 0.3 < met.mean() < 0.95
    np.testing.assert_allclose(hits.distance[met], t[met], rtol=1e-10)
    inside = (hits.barycentric[met, :, None] * vertices[faces[face[met]]]).sum(axis=1)
    np.testing.assert_allclose(inside, origins[met] + t[met, None] * directions[met], atol=1e-9)
    assert np.isinf(hits.distance[hits.face < 0]).all()
    assert np.isnan(hits.barycentric[hits.face < 0]).all()


def test_what_stands_before_the_distance_occludes(tracer, rng):
    vertices, faces = soup(rng)
    origins, directions = bundle(rng)
    scene = gn.Scene(vertices, faces, tracer)
    t, face = rays.intersect(origins, directions, vertices[faces])
    assert np.mean(scene.occluded(origins, directions) == (face >= 0)) > 0.997
    met = face >= 0
    assert scene.occluded(origins[met], directions[met], 1.01 * t[met]).mean() > 0.997
    assert scene.occluded(origins[met], directions[met], 0.99 * t[met]).mean() < 0.003


@pytest.mark.parametrize("scale", [1e-6, 1e5])
def test_scale_and_place_of_the_scene_change_nothing(tracer, rng, scale):
    vertices, faces = soup(rng)
    origins, directions = bundle(rng)
    here = gn.Scene(vertices, faces, tracer).intersect(origins, directions)
    shift = np.array([30.0, -7.0, 11.0])
    there = gn.Scene(scale * (vertices + shift), faces, tracer).intersect(scale * (origins + shift), directions)
    same = here.face == there.face
    assert same.mean() > 0.997  # as above
    np.testing.assert_allclose(there.distance[same], scale * here.distance[same], rtol=1e-9)


def test_rays_from_a_million_units_away_still_meet_the_right_face(tracer):
    # 24 x 24 quads of .08 units: single precision alone would place the rays to .06 units there.
    x = np.linspace(-1, 1, 25)
    vertices = np.stack(np.meshgrid(x, x, [0.0]), axis=-1).reshape(-1, 3)
    at = np.arange(25 * 25).reshape(25, 25)
    a, b, c, d = (q.ravel() for q in (at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]))
    faces = np.concatenate((np.stack((a, b, c), axis=-1), np.stack((a, c, d), axis=-1)))
    scene = gn.Scene(vertices, faces, tracer)
    target = vertices[faces].mean(axis=1)
    way = gn.normalise(np.array([1.0, 2.0, 5.0]))
    hits = scene.intersect(target + 1e6 * way, -way)
    np.testing.assert_array_equal(hits.face, np.arange(len(faces)))
    np.testing.assert_allclose(hits.distance, 1e6, rtol=1e-9)
    assert not scene.occluded(target + 1e6 * way, -way, 1e6 - 1).any()
    assert scene.occluded(target + 1e6 * way, -way, 1e6 + 1).all()


def test_no_ray_slips_between_neighbouring_triangles(tracer, rng):
    sphere = icosphere(2)
    # Rays through vertices and the middles of edges, from inside: each must meet the closed surface.
    edges = sphere.vertices[sphere.faces]
    targets = np.concatenate((sphere.vertices, (edges + np.roll(edges, 1, axis=1)).reshape(-1, 3) / 2))
    origin = 0.2 * rng.normal(size=3) / 3
    hits = gn.Scene(sphere.vertices, sphere.faces, tracer).intersect(origin, gn.normalise(targets - origin))
    assert (hits.face >= 0).all()


def test_the_tracers_agree(rng):
    pytest.importorskip("embreex")
    vertices, faces = soup(rng, faces=1000, size=0.1)
    origins, directions = bundle(rng, 3000)
    a, b = (gn.Scene(vertices, faces, tracer) for tracer in (Embree, Hierarchy))
    assert np.mean(a.intersect(origins, directions).face == b.intersect(origins, directions).face) > 0.999
    far = rng.uniform(0, 2, 3000)
    assert np.mean(a.occluded(origins, directions, far) == b.occluded(origins, directions, far)) > 0.999


def test_where_embree_has_no_wheel_our_own_hierarchy_stands_in(monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex", None)
    assert default_tracer() is Hierarchy


def test_visibility_is_what_single_rays_say(rng):
    vertices, faces = soup(rng)
    scene = gn.Scene(vertices, faces)
    positions, directions = bundle(rng, 60)
    seen = scene.visible(positions, directions[:40])
    assert seen.shape == (60, 40)
    np.testing.assert_array_equal(seen[7], ~scene.occluded(positions[7], directions[:40]))
    each = np.broadcast_to(directions[:40], (60, 40, 3))
    np.testing.assert_array_equal(scene.visible(positions, each), seen)


def test_coincident_triangles_make_a_tree_all_the_same():
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    scene = gn.Scene(corner, np.tile([[0, 1, 2]], (500, 1)), Hierarchy)
    assert scene.intersect((0.2, 0.2, 1.0), (0.0, 0.0, -1.0)).distance == pytest.approx(1)


def test_scenes_refuse(rng):
    vertices, faces = soup(rng, 10)
    scene = gn.Scene(vertices, faces)
    with pytest.raises(gn.GonioError, match="GB"):
        scene.visible(vertices, gn.normalise(vertices), memory_limit=100)
    with pytest.raises(gn.GonioError, match="length 2"):
        scene.occluded(vertices, (0, 0, 2.0))
    with pytest.raises(gn.GonioError, match="origins has shape"):
        scene.intersect((1.0, 2.0), (0, 0, 1.0))
    with pytest.raises(gn.GonioError, match=r"vertices\[0, 0\] is nan"):
        gn.Scene(np.full((3, 3), np.nan), [[0, 1, 2]])
    with pytest.raises(gn.GonioError, match="one point"):
        gn.Scene(np.zeros((3, 3)), [[0, 1, 2]])


def icosphere(subdivisions):
    trimesh = pytest.importorskip("trimesh")
    made = trimesh.creation.icosphere(subdivisions=subdivisions)
    return gn.Mesh(np.asarray(made.vertices), np.asarray(made.faces))
