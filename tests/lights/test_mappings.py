import math

import numpy as np
import pytest

import gonio as gn
from gonio.errors import ArrayError, ParameterError

WHOLE = [
    (gn.LatLongMap(), 9), (gn.LatLongMap(), 64), (gn.AngularMap(), 4), (gn.AngularMap(), 7), (gn.AngularMap(), 64),
    (gn.MirrorBall(), 5), (gn.MirrorBall(), 64), (gn.DualParaboloid(), 8), (gn.DualParaboloid(1.0), 33),
    (gn.CubeCross(), 16), (gn.CubeCross(vertical=False), 15), (gn.CubeStrip(), 42), (gn.CubeStrip(vertical=False), 1),
    (gn.CubeStrip.openexr(), 12),
]  # fmt: skip


@pytest.mark.parametrize(("mapping", "rows"), WHOLE, ids=lambda x: str(x)[:30])
def test_the_pixels_of_a_whole_map_cover_the_sphere(mapping, rows):
    # 1e-12 leaves room for the rounding of some thousand terms.
    assert mapping.solid_angles(*mapping.shape(rows)).sum() == pytest.approx(4 * math.pi, rel=1e-12)


@pytest.mark.parametrize("distance", [1.5, 4.0, 100.0])
def test_a_near_camera_sees_all_but_the_cone_behind_the_ball(distance):
    hidden = 2 * math.pi * (1 - math.cos(math.asin(1 / distance)))
    solid = gn.MirrorBall(distance).solid_angles(32, 32)
    assert solid.sum() == pytest.approx(4 * math.pi - hidden, rel=1e-12)


@pytest.mark.parametrize(("mapping", "rows"), [*WHOLE, (gn.MirrorBall(3.0), 32)], ids=lambda x: str(x)[:30])
def test_directions_and_pixels_undo_each_other(mapping, rows):
    shape = mapping.shape(rows)
    w, mask = mapping.directions(*shape)
    np.testing.assert_allclose(np.linalg.norm(w, axis=-1), 1, rtol=1e-14)
    row, column = mapping.pixels(w, *shape)
    r, c = np.mgrid[: shape[0], : shape[1]]
    good = mask & ~_on_rim(mapping, shape)
    np.testing.assert_allclose(row[good], r[good] + 0.5, atol=1e-9)
    np.testing.assert_allclose(column[good], c[good] + 0.5, atol=1e-9)
    assert good.sum() >= mask.sum() / 2


def _on_rim(mapping, shape):
    """Pixels whose centre lies outside the disc, or within rounding of it."""
    if not isinstance(mapping, gn.AngularMap | gn.MirrorBall | gn.DualParaboloid):
        return np.zeros(shape, dtype=bool)
    n = shape[0]
    a = (np.arange(n) + 0.5) * 2 / n - 1
    beyond = np.hypot(*np.meshgrid(a, a)) > (1 - 1e-6) * getattr(mapping, "rim", 1.0)
    return np.tile(beyond, (1, shape[1] // n))


@pytest.mark.parametrize("mapping", [gn.AngularMap(), gn.MirrorBall(), gn.DualParaboloid(), gn.CubeCross()])
def test_solid_angles_are_those_of_random_directions(mapping, rng):
    # Chi-square of 200,000 uniform directions over the pixels that expect 20 or more; 5 sigma.
    shape = mapping.shape(12)
    w = gn.normalise(rng.normal(size=(200_000, 3)))
    row, column = mapping.pixels(w, *shape)
    index = np.minimum(row.astype(int), shape[0] - 1) * shape[1] + np.minimum(column.astype(int), shape[1] - 1)
    seen = np.bincount(index, minlength=shape[0] * shape[1])
    expected = mapping.solid_angles(*shape).ravel() / (4 * math.pi) * len(w)
    assert (seen[expected == 0] == 0).all()
    usual = expected >= 20
    chi2 = ((seen - expected)[usual] ** 2 / expected[usual]).sum()
    assert chi2 < usual.sum() + 5 * math.sqrt(2 * usual.sum())


@pytest.mark.parametrize(("mapping", "rows"), [*WHOLE, (gn.MirrorBall(3.0), 32)], ids=lambda x: str(x)[:30])
def test_a_pixel_s_solid_angle_is_the_integral_of_the_density(mapping, rows):
    # Midpoints of 16 x 16 within each pixel meet smooth densities to 2e-3. Not at a rim, which cuts pixels.
    height, width = mapping.sheet_shape(*mapping.shape(rows))
    n = 16
    y, x = (np.arange(height * n) + 0.5)[:, None] / (height * n), (np.arange(width * n) + 0.5) / (width * n)
    far = np.hypot(2 * x - 1, 2 * y - 1).reshape(height, n, width, n).max(axis=(1, 3))
    whole = far < 0.95 * getattr(mapping, "rim", math.inf)
    sums = mapping.density(x, y).reshape(height, n, width, n).sum(axis=(1, 3))[whole]
    solid = mapping.sheet_solid_angles(height, width)[whole]
    np.testing.assert_allclose(sums / sums.sum(), solid / solid.sum(), rtol=2e-3)


def test_a_lat_long_map_starts_at_the_zenith_and_at_phi_zero():
    w, _ = gn.LatLongMap().directions(256, 512)
    np.testing.assert_allclose(w[0, 0], [0, 0, 1], atol=0.01)
    np.testing.assert_allclose(w[128, 0], [1, 0, 0], atol=0.01)
    np.testing.assert_allclose(w[128, 128], [0, 1, 0], atol=0.01)


def test_an_angular_map_has_its_probe_formula():
    # r = acos(z) / pi / sqrt(x^2 + y^2), (u, v) = (x r, y r): as published with the light probe gallery.
    w = gn.normalise(np.array([[0.3, 0.5, -0.2], [-0.7, 0.1, 0.9]]))
    row, column = gn.AngularMap().pixels(w, 100, 100)
    r = np.arccos(w[:, 2]) / math.pi / np.hypot(w[:, 0], w[:, 1])
    np.testing.assert_allclose(column, 50 + 50 * w[:, 0] * r, rtol=1e-12)
    np.testing.assert_allclose(row, 50 - 50 * w[:, 1] * r, rtol=1e-12)


@pytest.mark.parametrize("distance", [math.inf, 2.0, 10.0])
def test_a_mirror_ball_reflects(distance):
    # A ray from the camera to a point of the ball, reflected about the normal there, is the direction of its pixel.
    n = 101
    mapping = gn.MirrorBall(distance)
    w, mask = mapping.directions(n, n)
    for r, c in ((50, 50), (20, 60), (70, 10), (95, 55)):
        a, b = (c + 0.5) * 2 / n - 1, 1 - (r + 0.5) * 2 / n
        if math.isinf(distance):
            normal = np.array([a, b, math.sqrt(1 - a * a - b * b)])
            ray = np.array([0, 0, -1.0])
        else:
            tangent = math.tan(math.asin(1 / distance))
            ray = gn.normalise(np.array([a * tangent, b * tangent, -1.0]))
            eye = np.array([0, 0, distance])
            t = -eye @ ray - math.sqrt((eye @ ray) ** 2 - distance**2 + 1)
            normal = eye + t * ray
        np.testing.assert_allclose(w[r, c], ray - 2 * (ray @ normal) * normal, atol=1e-12)
    assert mask[50, 50] and not mask[0, 0]


def test_the_second_paraboloid_shows_the_opposite_direction():
    w, mask = gn.DualParaboloid().directions(64, 128)
    np.testing.assert_allclose(w[:, 64:][mask[:, 64:]], -w[:, :64][mask[:, :64]], atol=1e-15)


def test_the_faces_of_a_strip_are_those_of_opengl():
    # The middle and the right-hand neighbour (s) of +X -X +Y -Y +Z -Z, from the table of the OpenGL specification.
    w, _ = gn.CubeStrip().directions(18, 3)
    axes = {0: ("+x", "-z"), 1: ("-x", "+z"), 2: ("+y", "+x"), 3: ("-y", "+x"), 4: ("+z", "+x"), 5: ("-z", "-x")}
    down = ("-y", "-y", "+z", "-z", "-y", "-y")

    def axis(name):
        return np.eye(3)["xyz".index(name[1])] * (1 if name[0] == "+" else -1)

    for face, (centre, right) in axes.items():
        np.testing.assert_allclose(w[3 * face + 1, 1], axis(centre), atol=1e-15)
        assert w[3 * face + 1, 2] @ axis(right) > 0.3
        assert w[3 * face + 2, 1] @ axis(down[face]) > 0.3


@pytest.mark.parametrize("vertical", [True, False])
def test_the_faces_of_a_cross_meet_at_their_edges(vertical):
    # Neighbouring pixels of a cross lie one pixel apart on the sphere, across the edges of its faces too.
    mapping = gn.CubeCross(vertical)
    shape = mapping.shape(64 if vertical else 48)
    w, mask = mapping.directions(*shape)
    for axis in (0, 1):
        step = np.linalg.norm(np.diff(w, axis=axis), axis=-1)
        both = np.diff(mask.astype(int), axis=axis) == 0
        both &= np.take(mask, range(mask.shape[axis] - 1), axis)
        if not vertical and axis == 0:
            both[:, :16] = both[:, 32:] = False
        assert step[both].max() < 2.1 / 16


@pytest.mark.parametrize(
    ("mapping", "shape"),
    [
        (gn.LatLongMap(), (4, 9)), (gn.AngularMap(), (4, 8)), (gn.MirrorBall(), (5, 4)), (gn.DualParaboloid(), (4, 4)),
        (gn.CubeCross(), (3, 4)), (gn.CubeCross(vertical=False), (4, 3)), (gn.CubeStrip(), (1, 6)),
        (gn.CubeStrip(vertical=False), (6, 1)), (gn.LatLongMap(), (0, 0)),
    ],
)  # fmt: skip
def test_pictures_of_another_aspect_are_refused(mapping, shape):
    with pytest.raises(ArrayError, match=rf"{shape[0]} x {shape[1]} .* does not fit"):
        mapping.solid_angles(*shape)


def test_impossible_layouts_are_refused():
    with pytest.raises(ParameterError, match="radii"):
        gn.MirrorBall(1.0)
    with pytest.raises(ParameterError, match="horizon"):
        gn.DualParaboloid(0.9)
    with pytest.raises(ParameterError, match="order"):
        gn.CubeStrip(faces=("right",) * 6)
    with pytest.raises(ArrayError, match="faces"):
        gn.CubeCross().shape(10)


@pytest.mark.parametrize("mapping", [gn.LatLongMap(), gn.AngularMap(), gn.DualParaboloid(), gn.CubeCross()])
def test_tensors_find_the_same_pixels(mapping, rng):
    torch = pytest.importorskip("torch")
    shape = mapping.shape(16)
    w = gn.normalise(rng.normal(size=(50, 3)))
    for ours, theirs in zip(mapping.pixels(w, *shape), mapping.pixels(torch.as_tensor(w), *shape), strict=True):
        np.testing.assert_allclose(np.asarray(theirs), ours, rtol=1e-13, atol=1e-12)
