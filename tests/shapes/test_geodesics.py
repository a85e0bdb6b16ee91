"""Distances along meshes: straight ways, great circles, ways around corners, and what is refused."""

import numpy as np
import pytest
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

import gonio as gn
from gonio.errors import GeometryWarning, MemoryLimitError
from gonio.shapes import geodesics
from gonio.shapes.geodesics import geodesic_distances
from gonio.shapes.revolution import revolve

SCATTERED = np.random.default_rng(3).random((800, 2))


def sheet(points, keep=lambda middle: np.ones(len(middle), bool)):
    faces = Delaunay(points).simplices
    return gn.Mesh(np.column_stack((points, np.zeros(len(points)))), faces[keep(points[faces].mean(axis=1))])


def ball(rings):
    theta = np.linspace(np.pi, 0, rings + 1)
    profile = np.stack((np.sin(theta), np.cos(theta)), axis=-1)
    return revolve(profile.round(15), 2 * rings)  # rounded, the poles are one place each


@pytest.mark.parametrize("shear", [0.0, 3.0], ids=["well-shaped", "obtuse"])
def test_on_a_plane_ways_are_straight_however_it_is_cut_into_triangles(shear):
    plane = sheet(SCATTERED)
    points = SCATTERED @ np.array([[1, 0], [shear, 1]])
    sheared = gn.Mesh(np.column_stack((points, np.zeros(len(points)))), plane.faces)
    distances = geodesic_distances(sheared, [5, 77])
    exact = np.linalg.norm(points[[5, 77], None] - points, axis=-1)
    np.testing.assert_allclose(distances, exact, rtol=1e-8, atol=1e-12)


def test_on_a_tube_cut_open_ways_are_those_of_the_sheet_it_was_rolled_from():
    segments = 64
    tube = revolve([(1.0, z) for z in np.linspace(-1, 1, 21)], segments)
    around = 2 * segments * np.sin(np.pi / segments)
    rolled_out = tube.uv * (around, 2.0)
    x, y = (rolled_out - rolled_out[7]).T
    np.testing.assert_allclose(geodesic_distances(tube, [7], welded=False)[0], np.hypot(x, y), atol=1e-9)
    # Closed, the shorter way round.
    shorter = np.minimum(abs(x), around - abs(x))
    np.testing.assert_allclose(geodesic_distances(tube, [7])[0], np.hypot(shorter, y), atol=1e-9)


def test_great_circles_are_met_the_better_the_finer_the_sphere():
    off = []
    for rings in (10, 20, 40):
        sphere = ball(rings)
        sources = np.array([0.1, 0.25, 0.5]) * len(sphere.vertices)
        exact = np.arccos((sphere.vertices[sources.astype(int)] @ sphere.vertices.T).clip(-1, 1))
        ratio = geodesic_distances(sphere, sources.astype(int))[exact > 0.4] / exact[exact > 0.4]
        off.append(np.sqrt(np.mean((ratio - 1) ** 2)))
    # To first order in edges of .3, .16 and .08: a front of curvature cot r is taken for 1 / r, h r / 24 of r.
    assert off[2] < 0.005
    assert off[1] < 0.65 * off[0] and off[2] < 0.65 * off[1]


def test_ways_bend_around_a_hole():
    # A ring, whose inner edge is a polygon of 96 sides: along tangents to it, and round it between them.
    inner, rings, segments = 0.25, 24, 96
    ring = revolve([(r, 0.0) for r in np.linspace(1.0, inner, rings)], segments)
    source = 10 * (segments + 1)
    far = np.hypot(*ring.vertices[:, :2].T)
    start = far[source]
    turned = np.arccos((ring.vertices @ ring.vertices[source] / (far * start)).clip(-1, 1))
    free = np.arccos((inner / far).clip(-1, 1)) + np.arccos(inner / start)
    bent = np.sqrt((far**2 - inner**2).clip(0)) + np.sqrt(start**2 - inner**2) + inner * (turned - free)
    straight = np.linalg.norm(ring.vertices - ring.vertices[source], axis=1)
    exact = np.where(turned < free, straight, bent)
    distances = geodesic_distances(ring, [source])[0]
    np.testing.assert_allclose(distances, exact, rtol=0.015, atol=1e-9)
    assert (exact > 1.05 * straight).mean() > 0.05


def test_distances_move_with_the_mesh_and_grow_with_it():
    sphere = ball(10)
    turn = Rotation.from_rotvec([0.4, -1.0, 2.0]).as_matrix()
    moved = gn.Mesh(3 * sphere.vertices @ turn.T + (5, -2, 7), sphere.faces)
    kept = geodesic_distances(sphere, [70], welded=False)
    np.testing.assert_allclose(geodesic_distances(moved, [70], welded=False), 3 * kept, rtol=1e-8)


def test_there_is_no_way_to_another_part_or_to_a_vertex_of_no_face():
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    two = gn.Mesh(np.concatenate((corners, corners + 5, [[9.0, 9, 9]])), np.array([[0, 1, 2], [3, 4, 5]]))
    np.testing.assert_allclose(geodesic_distances(two, [0])[0], [0, 1, 1, np.inf, np.inf, np.inf, np.inf])
    assert np.isinf(geodesic_distances(two, [6])[0, :6]).all()


def test_slivers_and_faces_without_area_do_no_harm():
    points = np.array([[0.0, 0], [1, 0], [2, 0], [2, 1], [0, 1], [1, 1e-7]])
    faces = np.array([[0, 1, 5], [1, 2, 5], [0, 5, 4], [5, 2, 3], [5, 3, 4], [0, 1, 1]])
    with pytest.warns(GeometryWarning):
        mesh = gn.Mesh(np.column_stack((points, np.zeros(6))), faces)
    exact = np.linalg.norm(points[:, None] - points, axis=-1)
    np.testing.assert_allclose(geodesic_distances(mesh, np.arange(6)), exact, atol=1e-6)


def test_what_is_no_vertex_is_refused(monkeypatch):
    plane = sheet(SCATTERED)
    for sources in ([], [0.5], [[1]], 3):
        with pytest.raises(gn.GonioError, match=r"numbers \(S,\) of vertices"):
            geodesic_distances(plane, sources)
    with pytest.raises(gn.GonioError, match=r"sources\[1\] = 800 is none of the 800"):
        geodesic_distances(plane, [0, 800])
    monkeypatch.setattr(geodesics, "MEMORY_LIMIT", 1000)
    with pytest.raises(MemoryLimitError, match="some sources at a time"):
        geodesic_distances(plane, [0])
