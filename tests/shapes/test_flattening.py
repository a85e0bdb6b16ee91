"""Meshes laid flat: what can be rolled out is, what cannot says so, and pixels find their places."""

import numpy as np
import pytest
from scipy.spatial.distance import pdist
from scipy.spatial.transform import Rotation

import gonio as gn
from gonio.files.images import read_raster
from gonio.shapes.flattening import distortion, flatten, stretch
from gonio.shapes.places import surface_places
from gonio.shapes.revolution import revolve
from gonio.viewer.flattening import flattening_picture


def hemisphere(rings=24):
    theta = np.linspace(np.pi / 2, 0, rings + 1)
    return revolve(np.stack((np.sin(theta), np.cos(theta)), axis=-1), 4 * rings)


def cone(segments=96):
    return revolve([(r, 2.5 * (1 - r)) for r in np.linspace(1.0, 0.2, 21)], segments)


def pixels(side):
    y, x = np.mgrid[1 : -1 : side * 1j, -1 : 1 : side * 1j]
    return x, y


def test_a_plane_stays_as_it_is_wherever_it_lies():
    heights = gn.HeightField(np.zeros((12, 20)), 0.1).mesh
    turn = Rotation.from_rotvec([1.0, 0.3, -2.0]).as_matrix()
    for vertices in (heights.vertices, heights.vertices @ turn.T + (3, 1, -4)):
        flat = flatten(gn.Mesh(vertices, heights.faces))
        np.testing.assert_allclose(pdist(flat.coordinates), pdist(vertices), rtol=1e-6)
        np.testing.assert_allclose(flat.stretch, 1, atol=1e-6)  # not mirrored either
        assert flat.distortion < 1e-6


def test_tubes_and_cones_cut_open_roll_out():
    tube = revolve([(1.0, z) for z in np.linspace(-1, 1, 21)], 96)
    flat = flatten(tube, welded=False)
    assert flat.distortion < 1e-6
    np.testing.assert_allclose(np.ptp(flat.coordinates, axis=0), (2 * np.pi, 2), rtol=1e-3)
    # Across the cone's inner rim ways bend that are straight when it is rolled out.
    assert flatten(cone(), welded=False).distortion < 0.01


def test_a_hemisphere_is_flattened_no_better_than_can_be_and_better_than_an_image_of_it():
    ball = hemisphere()
    flat = flatten(ball)
    # Milnor 1969: between the greatest and the least scale of a map of a cap of radius a lies a / sin a or more.
    assert flat.stretch[:, 0].max() / flat.stretch[:, 1].min() > np.pi / 2
    theta = np.arccos(ball.vertices[:, 2:].clip(-1, 1))
    equidistant = theta * ball.vertices[:, :2] / np.sin(theta).clip(1e-9)
    best = distortion(ball, equidistant)
    off = distortion(ball, flat.coordinates, scaled=False)
    assert 0.05 < off < 1.02 * best
    assert off < 0.7 * distortion(ball, ball.vertices[:, :2])
    assert abs(flat.distortion - off) < 0.1 * off  # whatever pairs are drawn


def test_closed_surfaces_fold_and_the_figures_say_so():
    tube = revolve([(1.0, z) for z in np.linspace(-1, 1, 21)], 48)
    closed, opened = flatten(tube), flatten(tube, welded=False)
    assert closed.distortion > 0.1
    assert (closed.stretch[:, 1] < 0).mean() > 0.3
    assert opened.stretch[:, 1].min() > 0.99


def test_distances_in_the_plane_do_not_change_when_the_mesh_is_moved():
    # No two of its points are alike, or rounding would choose between them.
    x, y = pixels(16)
    mesh = gn.HeightField(x**2 + 0.3 * x * y + 0.1 * y, 1 / 8).mesh
    turn = Rotation.from_rotvec([0.7, 0.1, -0.4]).as_matrix()
    moved = gn.Mesh(mesh.vertices @ turn.T + (1, 2, 3), mesh.faces)
    before, after = (flatten(each, welded=False).coordinates for each in (mesh, moved))
    np.testing.assert_allclose(pdist(after), pdist(before), atol=1e-6)


def test_parts_stand_as_far_apart_as_in_space():
    one = gn.HeightField(np.zeros((8, 16)), 0.1).mesh
    small = one.vertices * 0.5 + (0, 0, 3)
    unused = [[7.0, 7, 7]]
    both = gn.Mesh(np.concatenate((small, one.vertices, unused)), np.concatenate((one.faces, one.faces + len(small))))
    flat = flatten(both)
    assert set(flat.part) == {0, 1, -1} and np.isnan(flat.coordinates[-1]).all()
    first, second = flat.coordinates[: len(small)], flat.coordinates[len(small) : -1]
    np.testing.assert_allclose(pdist(first), 0.5 * pdist(second), atol=1e-6)
    assert abs(first[:, 0].min() - second[:, 0].max() - 3) < 1e-3  # the 3 that lie between them
    assert flat.distortion < 1e-6


def test_stretch_and_distortion_judge_other_coordinates():
    plane = gn.HeightField(np.zeros((10, 10)), 0.1).mesh
    x = plane.vertices[:, :2]
    np.testing.assert_allclose(stretch(plane, x * (3, 0.5)), np.broadcast_to((3, 0.5), (len(plane.faces), 2)))
    np.testing.assert_allclose(stretch(plane, x * (-1, 1))[:, 1], -1)  # mirrored
    assert distortion(plane, 7 * x) < 1e-9
    assert abs(distortion(plane, 1.5 * x, scaled=False) - 0.5) < 1e-9
    assert distortion(plane, x * (2, 1)) > 0.2


def test_pixels_of_a_tube_seen_from_the_side_are_rolled_out_though_every_third_is_a_vertex():
    x, y = pixels(61)
    mask = abs(x) < 0.95
    positions = np.stack((x, y, np.sqrt((1 - x * x).clip(0))), axis=-1)
    positions[~mask] = np.nan
    exact = pdist(np.stack((np.arcsin(x[mask]), y[mask]), axis=-1)[::7])
    for most, within in ((20_000, 1e-3), (400, 5e-3)):
        places, flat = surface_places(positions, mask, most)
        assert places.shape == (mask.sum(), 2) and len(flat.mesh.vertices) <= 1.1 * most
        np.testing.assert_allclose(pdist(places[::7]), exact, rtol=within, atol=within / 10)


def test_no_triangle_bridges_a_leap_and_crumbs_go_with_what_is_near():
    x, y = pixels(41)
    mask = np.ones(x.shape, bool)
    step = np.where(x > 0, 3.0, 0.0)
    step[20, 10] = 9.0  # one pixel far off
    places, flat = surface_places(np.stack((x, y, step), axis=-1), mask)
    assert flat.part.max() == 1 and flat.distortion < 0.01
    assert np.isfinite(places).all()
    assert flat.stretch[:, 0].max() < 1.2


def test_the_picture_is_drawn(tmp_path):
    path = flattening_picture(tmp_path / "cone.png", flatten(cone(32), welded=False))
    image = read_raster(path).samples
    assert min(image.shape[:2]) > 100 and np.ptp(image) > 0


def test_what_cannot_be_laid_flat_is_refused():
    plane = gn.HeightField(np.zeros((4, 4))).mesh
    with pytest.raises(gn.GonioError, match="landmarks = 2"):
        flatten(plane, landmarks=2)
    with pytest.raises(gn.GonioError, match=r"coordinates have shape \(3, 2\)"):
        distortion(plane, np.zeros((3, 2)))
    with pytest.raises(gn.GonioError, match=r"coordinates\[0, 0\] is nan"):
        stretch(plane, np.full((len(plane.vertices), 2), np.nan))
    positions, mask = np.zeros((3, 3, 3)), np.ones((3, 3), bool)
    with pytest.raises(gn.GonioError, match="mask"):
        surface_places(positions, mask[:2])
    with pytest.raises(gn.GonioError, match="most = 1"):
        surface_places(positions, mask, most=1)
    with pytest.raises(gn.GonioError, match=r"positions\[0, 0, 0\] is nan"):
        surface_places(positions * np.nan, mask)
    with pytest.raises(gn.GonioError, match="no three neighbouring"):
        surface_places(positions, np.eye(3, dtype=bool) & (positions[..., 0] > 1))
