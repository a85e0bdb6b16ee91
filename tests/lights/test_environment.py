import math

import numpy as np
import pytest
from reference import environment as reference

import gonio as gn
from gonio._kernels import environment as kernels
from gonio.errors import ArrayError, DirectionError, ParameterError
from gonio.frames import euler

O = gn.Orientation
LAYOUTS = [
    (gn.LatLongMap(), 16), (gn.AngularMap(), 24), (gn.MirrorBall(), 24), (gn.MirrorBall(4.0), 24),
    (gn.DualParaboloid(), 24), (gn.CubeCross(), 32), (gn.CubeStrip.openexr(), 48),
]  # fmt: skip
TURN = euler(0.7, -0.4, 2.1)


def smooth(w):
    """Radiance that no layout's pixels miss: degree 2 in direction, positive."""
    x, y, z = w[..., 0], w[..., 1], w[..., 2]
    return np.stack((2 + x + 0.5 * y * z, 1.5 + z * z - 0.3 * y, 1 + 0.5 * x * y), axis=-1)


def room(mapping=None, rows=16, orientation=O.PANORAMA, radiance=smooth):
    mapping = mapping or gn.LatLongMap()
    own, _ = mapping.directions(*mapping.shape(rows))
    return gn.Environment(radiance(own @ orientation.matrix(mapping).T), mapping, orientation)


@pytest.fixture
def directions(rng):
    return gn.normalise(rng.normal(size=(400, 3)))


def test_look_ups_of_a_lat_long_map_are_bilinear_across_its_edges(rng, directions):
    image = rng.random((6, 12, 3))
    poles = gn.normalise(np.array([[0, 0, 1], [0, 0, -1], [1e-9, -1e-9, 1], [1, -1e-12, 0], [1, 0, 0], [-1, 0, 0.0]]))
    w = np.concatenate((directions[:60], poles))
    expected = [reference.radiance_of_lat_long(image, d) for d in w]
    np.testing.assert_allclose(gn.Environment(image).radiance(w), expected, rtol=1e-9)


@pytest.mark.parametrize(("mapping", "rows"), LAYOUTS)
def test_the_loops_and_the_array_code_look_up_alike(mapping, rows, rng, directions):
    e = gn.Environment(rng.random((*mapping.shape(rows), 3)), mapping)
    np.testing.assert_allclose(e.radiance(directions), e._radiance(directions), rtol=1e-11)
    np.testing.assert_array_equal(e.nearest(directions), e._nearest(directions))


@pytest.mark.parametrize(("mapping", "rows"), LAYOUTS)
def test_look_ups_find_their_place_to_a_millionth_of_a_pixel(mapping, rows, directions):
    # An atlas that holds its own columns and rows answers where it was looked up. The truth comes from NumPy's
    # functions in double precision, whose rounding of some 1e-15 is 1e-11 of a pixel in maps of 8,192.
    height, width = 64, 128
    columns, row = np.meshgrid(np.arange(width + 2.0), np.arange(height + 2.0))
    ruler = np.tile(np.stack((columns, row, 0 * row), axis=-1).reshape(-1, 3), (mapping.sheets, 1))
    _, u, v = mapping.locate(np, directions)
    out = np.empty((len(directions), 3))
    layout = mapping.kernel, mapping.parameter
    kernels.look_up(*layout, height, width, ruler, np.eye(3), directions, False, out)
    np.testing.assert_allclose((out[:, 0] - 0.5) / width, u, atol=1e-6 / 8192)
    np.testing.assert_allclose((out[:, 1] - 0.5) / height, v, atol=1e-6 / 8192)


@pytest.mark.parametrize(("mapping", "rows"), LAYOUTS)
def test_the_nearest_look_up_is_a_pixel_s_value_everywhere_within_it(mapping, rows, rng):
    e = gn.Environment(rng.random((*mapping.shape(rows), 3)), mapping, O.GONIO.rotated(TURN))
    height, width = mapping.sheet_shape(e.rows, e.columns)
    pixels = e.image.reshape(-1, 3)
    i, j = np.mgrid[:height, :width]
    for offset in (np.array([0.5, 0.5]), *rng.uniform(0.01, 0.99, (5, 2))):
        v, u = (i + offset[0]) / height, (j + offset[1]) / width
        inside = mapping.density(u, v) > 0
        for sheet, place in enumerate(mapping.placement(e.rows, e.columns)):
            w = mapping.direct(sheet, u, v)[inside] @ e.turn.T
            np.testing.assert_array_equal(e.nearest(w), pixels[place[inside]])


@pytest.mark.parametrize(("mapping", "rows"), LAYOUTS)
def test_a_constant_room_is_constant_in_every_direction(mapping, rows, directions):
    e = gn.Environment(np.full((*mapping.shape(rows), 3), 7.0), mapping)
    np.testing.assert_allclose(e.radiance(directions), 7, rtol=1e-12)
    np.testing.assert_allclose(e.mean_radiance, 7, rtol=1e-12)


@pytest.mark.parametrize(("mapping", "rows"), LAYOUTS)
def test_a_pixel_has_its_value_at_its_centre(mapping, rows, rng):
    e = gn.Environment(rng.random((*mapping.shape(rows), 3)), mapping)
    w, shown = e.directions()
    # Not where a rim cuts the pixel's centre off: there the nearest point of the rim stands for it.
    solid = e.solid_angles
    inside = shown & (solid > 0.999 * mapping.solid_angles(*mapping.shape(rows)))
    row, column = mapping.pixels(mapping.directions(e.rows, e.columns)[0], e.rows, e.columns)
    r, c = np.mgrid[: e.rows, : e.columns]
    inside &= (abs(row - r - 0.5) < 1e-6) & (abs(column - c - 0.5) < 1e-6)
    np.testing.assert_allclose(e.radiance(w)[inside], e.image[inside], rtol=1e-6)


@pytest.mark.parametrize(("mapping", "rows"), [m for m in LAYOUTS if isinstance(m[0], gn.LatLongMap | gn.CubeStrip)])
def test_look_ups_have_no_seam(mapping, rows, rng):
    # Along a great circle in 20,000 steps a seam would be a jump of noise in [0, 1], some .3; a texel of a few
    # degrees takes a hundred steps or more, ten near a pole. (Discs have a rim on which many pixels show one direction,
    # and each half of a paraboloid pair keeps its own pixels to the horizon.)
    e = gn.Environment(rng.random((*mapping.shape(rows), 1)), mapping)
    angle = np.linspace(0, 2 * math.pi, 20_001)
    for a, b in ((0, 1), (0, 2), (1, 2)):
        w = np.zeros((len(angle), 3))
        w[:, a], w[:, b] = np.cos(angle), np.sin(angle)
        w = gn.normalise(w @ euler(0.3, 0.2, 0.1))
        assert np.abs(np.diff(e.radiance(w)[:, 0])).max() < 0.1


def test_a_cube_is_continuous_at_its_corners(rng):
    e = gn.Environment(rng.random((24, 4, 1)), gn.CubeStrip())
    for corner in np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).T.reshape(-1, 3):
        around = gn.normalise(corner + 1e-7 * rng.normal(size=(50, 3)))
        assert np.ptp(e.radiance(around)) < 1e-5


@pytest.mark.parametrize(("mapping", "rows"), LAYOUTS)
def test_turning_a_room_turns_everything_it_answers(mapping, rows, directions, rng):
    e = gn.Environment(rng.random((*mapping.shape(rows), 3)), mapping)
    turned = e.rotated(TURN)
    np.testing.assert_allclose(turned.radiance(directions @ TURN.T), e.radiance(directions), atol=1e-10)
    np.testing.assert_allclose(turned.harmonics(3), gn.rotate(e.harmonics(3), TURN), atol=1e-12)
    np.testing.assert_allclose(
        turned.pdf(directions @ TURN.T), e.pdf(directions), rtol=0.5 if mapping.sheets > 1 else 1e-6
    )
    np.testing.assert_allclose(turned.beams().directions, e.beams().directions @ TURN.T, atol=1e-12)
    assert turned.image is e.image or np.array_equal(turned.image, e.image)


@pytest.mark.parametrize("orientation", [O.GONIO, O.PANORAMA, O.PROBE, O.MITSUBA.rotated(TURN)], ids=lambda o: o.name)
def test_harmonics_are_those_of_the_world_whatever_the_picture_stands_like(orientation):
    # smooth() is band-limited at degree 2: the coefficients are exact, and synthesise to it.
    c = room(rows=16, orientation=orientation).harmonics(4)
    w = gn.LatLong(5, 8).directions()
    np.testing.assert_allclose(gn.harmonics(4, w) @ c, smooth(w), atol=1e-12)


@pytest.mark.parametrize(("mapping", "rows"), [(gn.AngularMap(), 96), (gn.DualParaboloid(), 96), (gn.CubeStrip(), 384)])
def test_harmonics_of_other_layouts_are_sums_over_solid_angles(mapping, rows):
    # The midpoint rule on some 7,000 to 25,000 pixels: second order in a pixel of 2 degrees.
    exact = room(rows=16).harmonics(2)
    np.testing.assert_allclose(room(mapping, rows).harmonics(2), exact, atol=2e-3)


def test_all_beams_carry_the_light_of_every_texel():
    e = room(rows=32)
    beams = e.beams()
    assert beams.directions.shape == (32 * 64, 3) and np.isinf(beams.distance).all()
    np.testing.assert_allclose(beams.irradiance.sum(0), 4 * math.pi * e.mean_radiance, rtol=1e-12)
    # The irradiance of a facing plane of a room of radiance 1 is pi; 32 rows leave 1e-3.
    even = gn.Environment(np.ones((32, 64))).beams()
    assert np.maximum(even.directions[:, 2], 0) @ even.irradiance[:, 0] == pytest.approx(math.pi, rel=2e-3)


@pytest.mark.parametrize("budget", [1, 7, 100, 10_000])
@pytest.mark.parametrize(("mapping", "rows"), [(gn.LatLongMap(), 16), (gn.AngularMap(), 24), (gn.CubeCross(), 32)])
def test_a_budget_keeps_the_energy_of_every_colour(mapping, rows, budget, rng):
    e = gn.Environment(rng.random((*mapping.shape(rows), 3)) ** 8, mapping)
    beams = e.beams(budget=budget)
    assert len(beams.directions) <= budget
    if budget < np.count_nonzero(e.solid_angles):
        assert e.beams(budget=budget) is beams  # not reckoned twice
    np.testing.assert_allclose(beams.irradiance.sum(0), e.beams().irradiance.sum(0), rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(beams.directions, axis=-1), 1, rtol=1e-12)


def test_a_sun_gets_a_beam_all_but_of_its_own():
    image = np.ones((64, 128, 3))
    image[20, 30] = 50_000
    e = gn.Environment(image)
    beams = e.beams(budget=16)
    sun = e.directions()[0][20, 30]
    nearest = int(np.argmax(beams.directions @ sun))
    # A thirtieth of its texel's width of 3 degrees.
    assert beams.directions[nearest] @ sun > math.cos(math.radians(0.1))
    np.testing.assert_allclose(beams.irradiance[nearest], 50_000 * e.solid_angles[20, 30], rtol=0.01)


def test_a_hundred_beams_light_a_matte_ball_within_one_per_cent(directions):
    def lit(beams):
        return np.maximum(directions @ beams.directions.T, 0) @ beams.irradiance

    image = np.ones((32, 64, 3))
    image[5:9, 10:20] = [30, 20, 10]
    image[15, 40] = 500
    e = gn.Environment(image)
    truth = lit(e.beams())
    assert np.linalg.norm(lit(e.beams(budget=100)) - truth) < 0.01 * np.linalg.norm(truth)


def test_a_dark_room_has_one_dark_beam_and_even_samples():
    e = gn.Environment(np.zeros((4, 8, 3)))
    beams = e.beams(budget=5)
    assert len(beams.directions) == 1 and (beams.irradiance == 0).all()
    np.testing.assert_allclose(e.pdf(np.array([[0, 0, 1.0], [1, 0, 0]])), 1 / (4 * math.pi), rtol=1e-12)


@pytest.mark.parametrize(("mapping", "rows"), LAYOUTS)
def test_samples_follow_their_density(mapping, rows, rng):
    # Chi-square on 18 x 36 cells of equal solid angle, whose probabilities come from integrating pdf on 40 x 40 points.
    image = rng.random((*mapping.shape(rows), 3)) ** 4
    e = gn.Environment(image, mapping, O.GONIO.rotated(TURN))
    count, rows_z, columns = 100_000, 18, 36
    w = e.sample(rng.random((count, 2)))
    np.testing.assert_allclose(np.linalg.norm(w, axis=-1), 1, rtol=1e-12)
    cell = np.minimum(((w[:, 2] + 1) / 2 * rows_z).astype(int), rows_z - 1) * columns
    cell += np.minimum(
        (np.arctan2(w[:, 1], w[:, 0]) % (2 * math.pi) / (2 * math.pi) * columns).astype(int), columns - 1
    )
    fine = 40
    z = (np.arange(rows_z * fine) + 0.5) / (rows_z * fine) * 2 - 1
    phi = (np.arange(columns * fine) + 0.5) / (columns * fine) * 2 * math.pi
    s = np.sqrt(1 - z * z)[:, None]
    points = np.stack((s * np.cos(phi), s * np.sin(phi), z[:, None] + 0 * phi), axis=-1)
    p = e.pdf(points).reshape(rows_z, fine, columns, fine).mean((1, 3)).ravel() * (4 * math.pi / (rows_z * columns))
    assert p.sum() == pytest.approx(1, abs=1e-3)
    expected = p * count
    chi2 = ((np.bincount(cell, minlength=len(p)) - expected) ** 2 / expected).sum()
    assert chi2 < len(p) + 6 * math.sqrt(2 * len(p))


def test_samples_estimate_the_irradiance_of_a_lamp(rng):
    image = np.full((32, 64, 3), 0.01)
    image[4, 7] = 1000
    e = gn.Environment(image)
    w = e.sample(rng.random((10_000, 2)))
    weights = np.maximum(w[:, 2], 0)[:, None] * e.radiance(w) / e.pdf(w)[:, None]
    # The truth by quadrature of the same bilinear radiance; the estimator's own standard error is below 1 %.
    fine = e.resampled(gn.LatLongMap(), 64).beams()
    truth = np.maximum(fine.directions[:, 2], 0) @ fine.irradiance
    np.testing.assert_allclose(weights.mean(0), truth, rtol=0.03)


def test_resampling_is_the_mean_over_each_new_texel(rng):
    e = gn.Environment(rng.random((8, 16, 3)), gn.LatLongMap(), O.MITSUBA.rotated(TURN))
    small = e.resampled(gn.LatLongMap(), 5, O.PANORAMA)
    turn = O.PANORAMA.matrix(gn.LatLongMap())
    finest = math.sqrt(e.solid_angles.max())
    samples = math.ceil(2 * math.sqrt(small.solid_angles.max()) / finest)
    expected = reference.mean_over_texels(e, gn.LatLongMap(), 5, turn, samples)
    np.testing.assert_allclose(small.image, expected, rtol=1e-9)


@pytest.mark.parametrize(("mapping", "rows"), LAYOUTS)
@pytest.mark.parametrize("target", [gn.LatLongMap(), gn.AngularMap(), gn.CubeCross()], ids=lambda m: type(m).__name__)
def test_resampling_keeps_the_energy(mapping, rows, target, rng):
    # Noise in every pixel, finer to coarser and coarser to finer. A near camera's blind cone is filled from the rim.
    e = gn.Environment(rng.random((*mapping.shape(rows), 3)), mapping)
    for there in (8, 48):
        moved = e.resampled(target, there, O.PANORAMA.rotated(TURN))
        tolerance = 0.05 if mapping == gn.MirrorBall(4.0) else 0.01
        np.testing.assert_allclose(moved.mean_radiance, e.mean_radiance, rtol=tolerance)
        assert np.isfinite(moved.image).all()


def test_a_lone_lamp_does_not_fall_through_when_a_map_shrinks(rng):
    # One texel in 32 x 64, anywhere, into 8 x 16: all of its energy arrives, but for what bilinear look-ups spread.
    for _ in range(10):
        image = np.zeros((32, 64))
        image[rng.integers(4, 28), rng.integers(0, 64)] = 1000.0
        e = gn.Environment(image)
        small = e.resampled(gn.LatLongMap(), 8, O.GONIO.rotated(TURN))
        np.testing.assert_allclose(small.mean_radiance, e.mean_radiance, rtol=0.02)


def test_another_place_for_the_same_pixels_does_not_blur_them(rng):
    e = gn.Environment(rng.random((16, 32, 3)), gn.LatLongMap(), O.PANORAMA)
    for orientation in (O.MITSUBA, O.BLENDER, O.GONIO, O.THREE_JS):
        there = e.resampled(gn.LatLongMap(), 16, orientation)
        assert not np.array_equal(there.image, e.image) or orientation.name == "GONIO"
        np.testing.assert_array_equal(there.resampled(gn.LatLongMap(), 16, O.PANORAMA).image, e.image)
    cross = e.resampled(gn.CubeCross(), 32, O.PANORAMA)
    strip = cross.resampled(gn.CubeStrip.openexr(), 48, O.OPENEXR)
    np.testing.assert_array_equal(
        np.sort(strip.image, axis=None), np.sort(cross.image[cross.solid_angles > 0], axis=None)
    )
    np.testing.assert_array_equal(strip.resampled(gn.CubeCross(), 32, O.PANORAMA).image, cross.image)


def test_what_a_disc_does_not_show_is_dark_whatever_it_holds():
    image = np.full((16, 16, 3), np.nan)
    shown = gn.AngularMap().solid_angles(16, 16) > 0
    image[shown] = 1.0
    e = gn.Environment(image, gn.AngularMap())
    np.testing.assert_allclose(e.radiance(np.array([[0, 0, 1.0], [0, 1, 0], [0, -1, 0]])), 1, rtol=1e-12)
    assert (e.image[~shown] == 0).all()


def test_an_environment_is_a_frozen_copy():
    image = np.ones((4, 8, 3), dtype=np.float32)
    e = gn.Environment(image)
    image[:] = 5
    assert e.image.dtype == np.float32 and e.image.max() == 1
    with pytest.raises(ValueError, match="read-only"):
        e.image[0] = 2


def test_tensors_are_answered_in_kind_and_carry_gradients(rng, directions):
    torch = pytest.importorskip("torch")
    image = rng.random((48, 8, 3))
    for mapping, values in ((gn.CubeStrip(), image), (gn.LatLongMap(), image[:8, :].repeat(2, 1)[:8, :16])):
        ours = gn.Environment(values, mapping)
        tensor = torch.tensor(values, requires_grad=True)
        theirs = gn.Environment(tensor, mapping)
        seen = theirs.radiance(torch.as_tensor(directions))
        np.testing.assert_allclose(seen.detach().numpy(), ours.radiance(directions), rtol=1e-10)
        np.testing.assert_allclose(theirs.harmonics(2).detach().numpy(), ours.harmonics(2), rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(theirs.beams().irradiance.detach().numpy(), ours.beams().irradiance, rtol=1e-12)
        np.testing.assert_array_equal(theirs.nearest(torch.as_tensor(directions)).detach(), ours.nearest(directions))
        (seen.sum() + theirs.harmonics(1).sum()).backward()
        assert torch.isfinite(tensor.grad).all() and (tensor.grad != 0).any()
        single = gn.Environment(torch.tensor(values, dtype=torch.float32), mapping)
        assert single.radiance(torch.as_tensor(directions, dtype=torch.float32)).dtype == torch.float32


@pytest.mark.parametrize(
    ("make", "error", "says"),
    [
        (lambda: gn.Environment(np.ones((4, 8, 4))), ArrayError, "alpha"),
        (lambda: gn.Environment(np.ones((4, 9, 3))), ArrayError, "does not fit"),
        (lambda: gn.Environment(-np.ones((4, 8, 3))), ArrayError, r"image\[0, 0, 0\] is -1"),
        (lambda: gn.Environment(np.full((4, 8), np.nan)), ArrayError, "nan"),
        (lambda: gn.Environment(np.ones((4, 8)), gn.LatLongMap), ParameterError, "mapping such as"),
        (lambda: gn.Environment(np.ones((4, 4)), gn.AngularMap(), O.BLENDER), ParameterError, "BLENDER says nothing"),
        (lambda: room().radiance([0, 0, 2.0]), DirectionError, "length 2"),
        (lambda: room().nearest([0, 0, 2.0]), DirectionError, "length 2"),
        (lambda: room().beams(budget=0), ParameterError, "budget"),
        (lambda: room().rotated(-np.eye(3)), DirectionError, "mirrors"),
        (lambda: room().harmonics(-1), ParameterError, "negative"),
    ],
)
def test_bad_environments_are_refused(make, error, says):
    with pytest.raises(error, match=says):
        make()


def test_the_mean_of_a_large_map_is_summed_in_double_precision():
    room = gn.Environment(np.tile(gn.studio(32).image, (16, 16, 1)))
    image = room.image.astype(np.float64) * room.solid_angles[..., None]
    np.testing.assert_allclose(room.mean_radiance, image.sum(axis=(0, 1)) / (4 * np.pi), rtol=1e-6)
    assert room.mean_radiance.dtype == room.image.dtype
