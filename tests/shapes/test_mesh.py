"""Meshes: smooth normals, tangents, shadows without steps, and what is refused."""

import math

import numpy as np
import pytest

import gonio as gn
from gonio.errors import GeometryWarning
from gonio.shapes.revolution import revolve

ABOVE = gn.Orthographic(size=(96, 96), pixel=1 / 45, pose=gn.look_at((0, 0, 5), (0, 0, 0), up=(0, 1, 0)))


def icosphere(subdivisions):
    trimesh = pytest.importorskip("trimesh")
    made = trimesh.creation.icosphere(subdivisions=subdivisions)
    return gn.Mesh(np.asarray(made.vertices), np.asarray(made.faces))


def cylinder(segments=64):
    return revolve([(1.0, -1.0), (1.0, 0.0), (1.0, 1.0)], segments)


def test_smooth_normals_of_a_fine_sphere_are_its_radii():
    ball = icosphere(4)
    # The weighting is right to second order: e^2 / 2 with edges of e = .07.
    np.testing.assert_allclose(ball.normals, ball.vertices, atol=2.5e-3)
    view = ball.view(ABOVE)
    exact = gn.Sphere().view(ABOVE)
    both = view.mask & exact.mask
    assert (view.mask != exact.mask).mean() < 0.002
    rim = exact.normal[both][:, 2] > 0.2
    np.testing.assert_allclose(view.normal[both][rim], exact.normal[both][rim], atol=0.01)
    np.testing.assert_allclose(view.distance[both][rim], exact.distance[both][rim], atol=0.01)


def test_a_cubes_corner_normal_is_the_diagonal_however_its_sides_are_cut():
    # Weighted by angle, a side that two triangles share counts once; weighted by face it would count twice.
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1]])
    faces = [[0, 2, 1], [1, 2, 4], [0, 1, 5], [0, 5, 3], [0, 3, 2]]
    normal = gn.Mesh(vertices, np.array(faces)).normals[0]
    np.testing.assert_allclose(normal, -np.ones(3) / math.sqrt(3), atol=1e-12)


def test_normals_are_smooth_across_the_seam_of_a_texture():
    tube = cylinder()
    welded = gn.Mesh(tube.vertices, tube.faces, uv=tube.uv)
    np.testing.assert_allclose(welded.normals, tube.normals, atol=1e-12)


def test_tangents_run_along_growing_u():
    tube = cylinder(256)
    x, y, z = tube.vertices.T
    np.testing.assert_allclose(tube.tangents, np.stack((-y, x, 0 * z), axis=-1), atol=2e-2)  # chords of 2 pi / 256
    camera = gn.Pinhole.look_at((4, 1, 0.3), (0, 0, 0), field_of_view=40, size=(32, 32))
    view = tube.view(camera)
    m = view.mask
    s, t, n = (view.frames[m][:, k] for k in range(3))
    np.testing.assert_allclose((s * n).sum(axis=-1), 0, atol=1e-12)
    np.testing.assert_allclose(t, np.broadcast_to((0, 0, 1), t.shape), atol=0.02)  # v grows upwards: t = n x s


def test_mirrored_and_missing_uv_still_give_frames():
    tube = cylinder()
    mirrored = gn.Mesh(tube.vertices, tube.faces, uv=tube.uv * (-1, 1), normals=tube.normals)
    np.testing.assert_allclose(mirrored.tangents, -tube.tangents, atol=1e-12)
    for uv in (None, np.zeros((len(tube.vertices), 2))):
        bare = gn.Mesh(tube.vertices, tube.faces, uv=uv, normals=tube.normals)
        view = bare.view(gn.Pinhole.look_at((4, 1, 0.3), (0, 0, 0), field_of_view=40, size=(16, 16)))
        frames = view.frames[view.mask]
        np.testing.assert_allclose(
            frames @ frames.swapaxes(-1, -2), np.broadcast_to(np.eye(3), frames.shape), atol=1e-12
        )


def test_flat_meshes_shade_by_facets():
    view = icosphere(1).flat().view(ABOVE)
    np.testing.assert_allclose(view.normal[view.mask], view.geometric[view.mask], atol=1e-12)


@pytest.mark.parametrize("subdivisions", [1, 2, 3])
@pytest.mark.parametrize("light", [(1.0, 0, 0.2), (0.3, -0.8, 0.1), (0.0, 1.0, -0.3)])
def test_a_coarse_sphere_throws_no_shadow_on_its_lit_side(subdivisions, light):
    ball = icosphere(subdivisions)
    view = ball.view(ABOVE)
    m = view.mask
    w = gn.normalise(np.array(light))
    shadow = ball.occluded(view.lifted[m], w)
    horizon = view.normal[m] @ w
    # Lifted points lie on or outside the sphere, from where no lit direction meets the mesh, which lies inside it.
    # What remains is the error of the interpolated normal, of second order in the edge.
    assert not shadow[horizon > (0.02, 0.005, 0.002)[subdivisions - 1]].any()
    # From the faces themselves, the terminator shows in steps.
    stepped = ball.occluded((view.position + ball.scene.clearance * view.geometric)[m], w)
    assert stepped[horizon > (0.1, 0.05, 0.02)[subdivisions - 1]].any()
    # Points lifted to 1.06 see past the 80 faces, which reach in to .94, down to n.w = -.46.
    assert shadow[horizon < -0.5].all()


def test_a_real_occluder_throws_its_shadow():
    # A square of side .4 hangs .5 above a floor; light falls straight down, then from the side.
    square = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    vertices = np.concatenate((square, 0.2 * square + (0, 0, 0.5)))
    two = np.array([[0, 1, 2], [0, 2, 3]])
    scene = gn.Mesh(vertices, np.concatenate((two, two + 4)))
    x, y = np.meshgrid(np.linspace(-0.9, 0.9, 37), np.linspace(-0.9, 0.9, 37))
    view = scene.trace(np.stack((x, y, 0 * x + 0.25), axis=-1), (0.0, 0, -1.0))
    for slope in (0.0, 0.8):
        shadow = scene.occluded(view.lifted, gn.normalise(np.array([slope, 0, 1.0])))
        inside = (abs(x + 0.5 * slope) < 0.2) & (abs(y) < 0.2)
        edge = (abs(abs(x + 0.5 * slope) - 0.2) < 1e-3) | (abs(abs(y) - 0.2) < 1e-3)
        np.testing.assert_array_equal(shadow[~edge], inside[~edge])


def test_normals_against_the_winding_decide_the_outside():
    tube = cylinder()
    inside_out = gn.Mesh(tube.vertices, tube.faces[:, ::-1], uv=tube.uv, normals=tube.normals)
    view = inside_out.view(gn.Pinhole.look_at((4, 1, 0.3), (0, 0, 0), field_of_view=20, size=(16, 16)))
    assert ((view.geometric * view.normal).sum(axis=-1)[view.mask] > 0).all()


def test_faces_without_area_are_reported_and_left_out():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]])
    with pytest.warns(GeometryWarning, match=r"1 of 2 faces have no area and are left out, face 1"):
        mesh = gn.Mesh(vertices, np.array([[0, 1, 2], [0, 1, 3]]))
    assert len(mesh.faces) == 1


TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: gn.Mesh(TRIANGLE, np.array([[1, 2, 3]])), r"faces\[0\] = \[1, 2, 3\] points outside"),
        (lambda: gn.Mesh(TRIANGLE, np.array([[0, 1, -1]])), "points outside"),
        (lambda: gn.Mesh(TRIANGLE, np.array([[0.0, 1, 2]])), "float64"),
        (lambda: gn.Mesh(TRIANGLE, np.zeros((0, 3), int)), "F >= 1"),
        (lambda: gn.Mesh(TRIANGLE * math.nan, np.array([[0, 1, 2]])), r"vertices\[0, 0\] is nan"),
        (lambda: gn.Mesh(TRIANGLE[:, :2], np.array([[0, 1, 2]])), r"\(V, 3\)"),
        (lambda: gn.Mesh(TRIANGLE, np.array([[0, 1, 2]]), uv=np.zeros((2, 2))), "uv has shape"),
        (lambda: gn.Mesh(TRIANGLE, np.array([[0, 1, 2]]), normals=np.zeros((3, 3))), "no direction"),
        (lambda: gn.Mesh(TRIANGLE, np.array([[0, 1, 1]])), "no face has any area"),
    ],
)
def test_meshes_refuse(make, match):
    with pytest.raises(gn.GonioError, match=match):
        make()


def test_the_bunny_is_seen_whole(data):
    trimesh = pytest.importorskip("trimesh")
    loaded = trimesh.load(data / "meshes" / "bunny.obj", process=False, force="mesh")
    bunny = gn.Mesh(np.asarray(loaded.vertices), np.asarray(loaded.faces))
    low, high = bunny.bounds
    camera = gn.Pinhole.look_at(
        (low + high) / 2 + (0, 0, 3 * (high - low).max()), (low + high) / 2, 30, (64, 64), (0, 1, 0)
    )
    view = bunny.view(camera)
    assert 0.1 < view.mask.mean() < 0.9
    assert np.isfinite(view.frames[view.mask]).all()
    # Eyes outside a closed surface see outsides: hardly any shading normal looks away.
    assert ((view.normal * view.wo).sum(axis=-1)[view.mask] > 0).mean() > 0.98


def test_no_face_seen_from_outside_is_shaded_from_below():
    # A ball of eight by eight faces, whose smooth normals turn away at the outline from an eye that sees the face.
    theta = np.linspace(math.pi, 0, 9)
    ball = revolve(np.stack((abs(np.sin(theta)), np.cos(theta)), axis=-1), 8)
    view = ball.view(gn.Pinhole.look_at((4, 1, 0.3), (0, 0, 0), field_of_view=40, size=(64, 64)))
    outside = view.mask & ((view.geometric * view.wo).sum(axis=-1) > 0)
    assert (view.normal * view.wo).sum(axis=-1)[outside].min() > 0
    np.testing.assert_allclose(np.linalg.norm(view.normal[outside], axis=-1), 1)
