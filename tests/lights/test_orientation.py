import math

import numpy as np
import pytest

import gonio as gn
from gonio.errors import DirectionError, ParameterError
from gonio.frames import euler
from gonio.lights.orientation import PUBLISHED

O = gn.Orientation
# gonio's axes of a tool with Y up: (X, Y, Z) -> (X, -Z, Y).
Y_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


@pytest.fixture
def world(rng):
    return gn.normalise(rng.normal(size=(300, 3)))


def uv(orientation, mapping, w, rows=64):
    """(u, v) in [0, 1], right and down, at which a picture shows the world directions w."""
    shape = mapping.shape(rows)
    row, column = mapping.pixels(w @ orientation.matrix(mapping), *shape)
    return column / shape[1], row / shape[0]


def test_every_orientation_is_orthogonal_and_says_whether_it_mirrors():
    for name, orientation in PUBLISHED.items():
        assert orientation is getattr(O, name) and orientation.name == name
        for mapping in (gn.LatLongMap(), gn.AngularMap(), gn.MirrorBall(), gn.DualParaboloid(), gn.CubeCross()):
            try:
                turn = orientation.matrix(mapping)
            except ParameterError:
                continue
            np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-15)


def test_pictures_taken_from_inside_show_right_on_the_right():
    mirrored = {"GONIO", "PROBE", "OPENGL", "FILAMENT_UNMIRRORED"}
    for name, orientation in PUBLISHED.items():
        for kind, frame in orientation.frames.items():
            right, up, centre = frame.T
            handed = np.cross(centre, up) @ right
            assert handed == pytest.approx(-1 if name in mirrored else 1), (name, kind)


def test_gonio_is_its_own_lat_long():
    np.testing.assert_array_equal(O.GONIO.matrix(gn.LatLongMap()), np.eye(3))


def test_mitsuba_s_formula(world):
    x, y, z = (world @ Y_UP).T
    u, v = uv(O.MITSUBA, gn.LatLongMap(), world)
    np.testing.assert_allclose(u, np.arctan2(x, -z) / (2 * math.pi) % 1, atol=1e-12)
    np.testing.assert_allclose(v, np.arccos(y) / math.pi, atol=1e-12)


def test_three_js_s_formula(world):
    x, y, z = (world @ Y_UP).T
    u, v = uv(O.THREE_JS, gn.LatLongMap(), world)
    np.testing.assert_allclose(u, np.arctan2(z, x) / (2 * math.pi) + 0.5, atol=1e-12)
    np.testing.assert_allclose(1 - v, np.arcsin(y) / math.pi + 0.5, atol=1e-12)


def test_blender_s_formula(world):
    x, y, z = world.T
    u, v = uv(O.BLENDER, gn.LatLongMap(), world)
    np.testing.assert_allclose(u, (np.arctan2(y, x) - math.pi) / (-2 * math.pi), atol=1e-12)
    np.testing.assert_allclose(v, np.arccos(z) / math.pi, atol=1e-12)


def test_openexr_s_formula(world):
    # ImfEnvmap: longitude atan2(x, z) falls from pi on the left to -pi on the right.
    x, y, z = (world @ Y_UP).T
    u, v = uv(O.OPENEXR, gn.LatLongMap(), world)
    np.testing.assert_allclose(u, 0.5 - np.arctan2(x, z) / (2 * math.pi), atol=1e-12)
    np.testing.assert_allclose(v, 0.5 - np.arcsin(y) / math.pi, atol=1e-12)


def test_openexr_s_cube(world):
    # ImfEnvmap's drawing: which axes lie to the right and up on the faces +X -X +Y -Y +Z -Z, from top to bottom.
    drawn = {
        (0, 1): ((0, 0, 1), (0, 1, 0)), (0, -1): ((0, 0, -1), (0, 1, 0)), (1, 1): ((1, 0, 0), (0, 0, 1)),
        (1, -1): ((1, 0, 0), (0, 0, -1)), (2, 1): ((-1, 0, 0), (0, 1, 0)), (2, -1): ((1, 0, 0), (0, 1, 0)),
    }  # fmt: skip
    tool = world @ Y_UP
    u, v = uv(O.OPENEXR, gn.CubeStrip.openexr(), world, 384)
    for k, w in enumerate(tool):
        axis = int(np.argmax(np.abs(w)))
        right, up = drawn[axis, int(np.sign(w[axis]))]
        face = 2 * axis + (w[axis] < 0)
        assert u[k] == pytest.approx(0.5 + 0.5 * (w @ right) / abs(w[axis]), abs=1e-12)
        assert 6 * v[k] - face == pytest.approx(0.5 - 0.5 * (w @ up) / abs(w[axis]), abs=1e-12)


def test_the_two_maps_of_three_js_show_one_world(world):
    # Its cube textures are sampled at (-x, y, z) by OpenGL's faces; so faces cut from its own lat-long map fit it.
    face_x, face_y, face_z = (world @ Y_UP).T * np.array([[-1.0], [1.0], [1.0]])
    u, v = uv(O.THREE_JS, gn.CubeStrip(), world, 384)
    opengl, _ = gn.CubeStrip().directions(384, 64)
    at = opengl[(v * 384).astype(int), (u * 64).astype(int)]
    # Within a pixel's half diagonal of 1/64 of a face.
    assert np.linalg.norm(at - np.stack((face_x, face_y, face_z), -1), axis=-1).max() < 2**0.5 / 64


def test_a_probe_s_centre_is_its_z_axis_and_right_its_x():
    for mapping in (gn.AngularMap(), gn.MirrorBall(), gn.LatLongMap(), gn.CubeCross()):
        for own, probe in ((mapping.picture[:, 0], [1, 0, 0]), (mapping.picture[:, 2], [0, 0, 1.0])):
            np.testing.assert_allclose(O.PROBE.matrix(mapping) @ own, Y_UP @ probe, atol=1e-15)


def test_mitsuba_sees_the_same_room(world):
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    own, _ = gn.LatLongMap().directions(64, 128)
    image = (2 + own @ O.MITSUBA.matrix(gn.LatLongMap()).T).astype(np.float32)
    emitter = mi.load_dict({"type": "envmap", "bitmap": mi.Bitmap(image)})
    for w in world[:100]:
        at = mi.SurfaceInteraction3f()
        at.wi = mi.Vector3f(*(-(w @ Y_UP)).tolist())
        # Mitsuba puts the first and last rows' centres on the poles: half a row, .025, at the most.
        np.testing.assert_allclose(np.array(emitter.eval(at)), 2 + w, atol=0.03)


def test_looking_says_where_a_picture_s_centre_lies():
    orientation = O.looking([1, 1, 0], up=[0, 0, 1])
    for mapping in (gn.LatLongMap(), gn.AngularMap(), gn.CubeCross()):
        turn = orientation.matrix(mapping)
        np.testing.assert_allclose(turn @ mapping.picture[:, 2], [0.5**0.5, 0.5**0.5, 0], atol=1e-15)
        np.testing.assert_allclose(turn @ mapping.picture[:, 0], [0.5**0.5, -(0.5**0.5), 0], atol=1e-15)
    same = O.looking([0, 1, 0])
    np.testing.assert_allclose(same.matrix(gn.LatLongMap()), O.PANORAMA.matrix(gn.LatLongMap()), atol=1e-15)
    ball = O.looking([0, -1, 0], mirrored=True)
    np.testing.assert_allclose(ball.matrix(gn.MirrorBall()), O.PROBE.matrix(gn.MirrorBall()), atol=1e-15)


def test_what_cannot_be_an_orientation_is_refused():
    with pytest.raises(DirectionError, match="parallel"):
        O.looking([0, 0, 1])
    with pytest.raises(DirectionError, match="mirrors"):
        O.PANORAMA.rotated(np.diag([1.0, 1, -1]))
    with pytest.raises(ParameterError, match="MITSUBA says nothing about cubes"):
        O.MITSUBA.matrix(gn.CubeStrip())


def test_turning_twice_is_turning_by_the_product():
    a, b = euler(0.1, 0.2, 0.3), euler(1.0, -2.0, 0.5)
    twice = O.BLENDER.rotated(a).rotated(b).matrix(gn.LatLongMap())
    np.testing.assert_allclose(twice, O.BLENDER.rotated(b @ a).matrix(gn.LatLongMap()), atol=1e-14)
