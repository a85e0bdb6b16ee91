"""Facts about what photographs tell, and that samples taken as planned tell it."""

import dataclasses
import math

import numpy as np
import pytest

import gonio as gn
from gonio.fitting.planning import neighbours, plan_sharing

UP = np.array([[0.0, 0.0, 1.0]])


def cylinder(pixel, columns=24):
    """Normals of a strip that turns by `pixel` radians from column to column, (2, columns, 3)."""
    alpha = pixel * (np.arange(columns) - columns / 2)
    return np.broadcast_to(np.stack((np.sin(alpha), 0 * alpha, np.cos(alpha)), axis=-1), (2, columns, 3))


def arc(count, apart):
    angle = apart * (np.arange(count) - (count - 1) / 2)
    return np.stack((np.sin(angle), 0 * angle, np.cos(angle)), axis=-1)


def ball(radius, part):
    """Normals (rows, columns, 3) of a ball seen from afar, 0 beyond `part` of its radius."""
    half = math.ceil(part * radius)
    y, x = np.mgrid[half : -half - 1 : -1, -half : half + 1] / radius
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    return np.where((np.hypot(x, y) < part)[..., None], np.stack((x, y, z), axis=-1), 0)


def evenly(count, cap):
    """Directions by the golden angle, evenly over a cap."""
    k = np.arange(count) + 0.5
    z = 1 - k / count * (1 - math.cos(cap))
    return gn.from_spherical(np.arccos(z), k * math.pi * (3 - math.sqrt(5)))


def test_flatland_is_that_of_the_paper():
    plan = plan_sharing(cylinder(0.02), arc(5, 0.3))
    assert (plan.photographs, plan.flat, plan.single) == (5, False, False)
    assert (plan.dtheta, plan.dalpha) == pytest.approx((0.3, 0.02))
    assert plan.reach == pytest.approx(0.6)
    assert plan.theta_d == pytest.approx((0, 0.3), abs=1e-7)
    assert plan.shared.highlight == pytest.approx(2.6 * 2 * 0.02 / math.pi)
    assert plan.shared.texture == pytest.approx(0.3 / 0.02)
    assert plan.alone.highlight == pytest.approx(2.6 * 0.3 / (2 * math.pi))
    assert plan.alone.texture == pytest.approx(4)
    for told in (plan.shared, plan.alone):  # RS 6
        assert told.band.space * told.band.angle == pytest.approx(math.pi**2 / 0.3)


def test_a_ball_turns_by_a_pixel_over_its_radius():
    # Within a fifth of it slopes are at most .2, and lengths along the surface within 2 % of those in the image.
    assert plan_sharing(ball(200, 0.2), UP).dalpha == pytest.approx(1 / 200, rel=0.02)
    assert plan_sharing(ball(20, 0.3), UP).dalpha == pytest.approx(1 / 20, rel=0.05)


def test_noise_and_rounding_of_normals_do_not_count_as_curvature(rng):
    normals = ball(100, 0.7)
    smooth = plan_sharing(normals, UP).dalpha
    mask = normals[..., 2] > 0
    # 8 pixels turn by 4.6 degrees, half a degree of noise each way by .7 either way: 3 % in the mean of squares.
    noisy = normals + np.where(mask[..., None], rng.normal(scale=math.radians(0.5), size=normals.shape), 0)
    noisy[mask] = gn.normalise(noisy[mask])
    assert plan_sharing(noisy, UP).dalpha == pytest.approx(smooth, rel=0.05)
    codes = np.round((ball(500, 0.3) + 1) * 127.5) / 127.5 - 1  # a step of code is 4 pixels
    mask = codes[..., 2] > 0.5
    codes[mask] = gn.normalise(codes[mask])
    assert plan_sharing(codes, UP, mask=mask).dalpha == pytest.approx(1 / 500, rel=0.1)


def test_spacing_is_that_of_the_gaps_however_lights_lie(rng):
    # A square lattice in the middle of the sky: each and the next, and as corners lie on the circle of a diagonal, one
    # diagonal of a square at most.
    x, y = np.meshgrid(np.arange(-3, 4) * 0.02, np.arange(-3, 4) * 0.02)
    lattice = gn.normalise(np.stack((x, y, 1 + 0 * x), axis=-1).reshape(-1, 3))
    plan = plan_sharing(ball(20, 0.5), lattice)
    assert 0.0199 < plan.dtheta < 0.02 * (2 + math.sqrt(2)) / 3
    # Of lights at random, mean length 1 / sqrt(density); of 400 the mean has 2 % of noise, and the rim is longer.
    z = rng.uniform(0.5, 1, 400)
    lights = gn.from_spherical(np.arccos(z), rng.uniform(0, 2 * math.pi, 400))
    assert plan_sharing(ball(20, 0.5), lights).dtheta == pytest.approx(math.sqrt(math.pi / 400), rel=0.07)
    # The same light twice is one.
    twice = arc(3, 0.2)[[0, 1, 1, 2]]
    assert neighbours(twice).tolist() == [[0, 1], [1, 3]]
    assert plan_sharing(ball(20, 0.5), twice).dtheta == pytest.approx(0.2)
    assert math.isinf(plan_sharing(ball(20, 0.5), UP[[0, 0]]).dtheta)


def test_a_flat_surface_shares_nothing_until_lights_are_dense():
    flat = np.broadcast_to(UP, (9, 9, 3))
    plan = plan_sharing(flat, arc(5, 0.3))
    assert plan.flat and plan.shared is None
    assert (plan.dalpha, plan.turn) == (0, 0)
    assert plan.alone.texture == pytest.approx(2)  # RS 1
    assert plan.photographs_for(0.1).shared is None
    assert plan.photographs_for(texture=2) == (None, 1)
    bent = cylinder(0.004)  # turns by .09 in all
    assert plan_sharing(bent, arc(5, 0.3)).flat
    assert not plan_sharing(bent, arc(5, 0.15)).flat
    enough = plan_sharing(bent, arc(5, 0.3)).photographs_for(0.1).shared
    assert not plan_sharing(bent, evenly(round(1.1 * enough), 0.6)).flat
    assert plan_sharing(bent, evenly(round(0.8 * enough), 0.6)).flat


@pytest.mark.parametrize("count", [10, 50, 150])
def test_as_many_photographs_as_there_are_tell_what_these_tell(count):
    plan = plan_sharing(ball(100, 0.9), evenly(count, 1.2))
    # Lights by the golden angle are no lattice, and a rim has longer gaps: up to 5 % of them, 10 % of the number.
    more = 1.02
    alone = plan.photographs_for(more * plan.alone.highlight, more * plan.alone.texture)
    assert alone.alone == pytest.approx(count, rel=0.12, abs=1)
    shared = plan.photographs_for(more * plan.shared.highlight, more * plan.shared.texture)
    assert shared.shared == pytest.approx(count, rel=0.12, abs=1)


def test_where_no_number_of_photographs_serves():
    plan = plan_sharing(ball(100, 0.9), evenly(20, 1.2))
    assert plan.photographs_for(0.5 * plan.shared.highlight).shared is None
    assert plan.photographs_for(texture=3.9) == (None, None)
    assert plan.photographs_for() == (1, 1)
    assert plan.photographs_for(0.3, 100).shared < plan.photographs_for(0.3, 50).shared
    assert plan.photographs_for(0.1).alone > plan.photographs_for(0.2).alone
    assert plan.photographs_for(0.1).shared == 1  # with no texture


def test_one_photograph_tells_highlights_of_one_theta_d():
    plan = plan_sharing(ball(100, 0.9), gn.from_spherical([0.5], [1.0]))
    assert plan.single and not plan.flat
    assert plan.theta_d == pytest.approx((0.25, 0.25))
    assert plan.shared.highlight < math.radians(2)
    assert math.isinf(plan.shared.texture) and math.isinf(plan.alone.highlight)
    assert plan.cap == math.pi / 2


def test_eyes_nearby_see_many_theta_d():
    normals = ball(20, 0.5)
    x = np.linspace(-0.2, 0.2, normals.shape[1])
    wo = np.broadcast_to(gn.normalise(np.stack((-x, 0 * x, 1 + 0 * x), axis=-1)), normals.shape)
    plan = plan_sharing(normals, UP, wo)
    assert not plan.single
    assert plan.theta_d[1] == pytest.approx(math.atan(0.18) / 2)  # of the last column on the ball


def test_pixels_face_the_lights_that_are_above_them():
    # Lights from the left and right are above halves of a ball, less those that are above all of it.
    lights = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 0, 1.0]])
    plan = plan_sharing(ball(40, 0.95), lights)
    assert plan.lit[0] == 1
    assert plan.lit[1] == pytest.approx(1, abs=0.02)  # all but the middle column
    assert plan.lit[2] == 0


def lobe(theta, width):
    turned = (theta + np.pi) % (2 * np.pi) - np.pi
    return np.exp(-(turned**2) / (2 * width**2))


def recovered(told, rng, highlight=0.9, texture=0.9):
    """The rms error, relative, of a lobe whose height goes with place, so many times as fine as `told`, as told by
    samples of a closed curve: 64 pixels, lights 90 degrees apart, frequencies within the band."""
    pixels, photographs = 64, 8  # half angles, 45 degrees apart
    n, k = np.meshgrid(np.arange(pixels), np.arange(photographs), indexing="ij")
    alpha, theta = (2 * np.pi * n / pixels).ravel(), (2 * np.pi * (k / photographs - n / pixels)).ravel()
    wave = int(texture * pixels / told.texture)

    def f(alpha, theta):
        return (1 + 0.5 * np.cos(wave * alpha)) * lobe(theta, told.highlight / highlight)

    space, angle = round(told.band.space * pixels / (2 * np.pi)), round(told.band.angle)  # whole ones on a circle
    a, b = np.meshgrid(np.arange(1 - space, space), np.arange(1 - angle, angle))

    def waves(alpha, theta):
        return np.exp(1j * (np.multiply.outer(alpha, a.ravel()) + np.multiply.outer(theta, b.ravel())))

    weights = np.linalg.lstsq(waves(alpha, theta), f(alpha, theta), rcond=None)[0]
    alpha, theta = rng.uniform(-np.pi, np.pi, (2, 400))
    truth = f(alpha, theta)
    off = (waves(alpha, theta) @ weights).real - truth
    return np.sqrt(np.mean(off**2) / np.mean(truth**2))


@pytest.mark.parametrize("how", ["shared", "alone"])
def test_what_is_told_is_recovered_from_samples_and_finer_is_not(how, rng):
    told = getattr(plan_sharing(cylinder(2 * np.pi / 64), arc(2, np.pi / 2)), how)
    # A lobe has 1 % of its spectrum beyond the band, and a texture is a wave within it; of what is twice as fine, a
    # fifth of the lobe's spectrum is beyond, and the wave, a third of what is there, is taken for another.
    assert recovered(told, rng) < 0.02
    assert recovered(told, rng, highlight=2) > 0.15
    assert recovered(told, rng, texture=2) > 0.3


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"normals": np.ones((4, 4))}, r"normals have shape \(4, 4\)"),
        ({"normals": np.ones((4, 4, 3))}, "normals on the mask"),
        ({"lights": np.zeros((0, 3))}, r"lights have shape \(0, 3\)"),
        ({"lights": [[0, 0, 2.0]]}, "lights.* has length 2"),
        ({"lights": [[0, 0, -1.0]]}, "no pixel that faces the eye faces a light"),
        ({"wo": np.ones((2, 3))}, r"wo has shape \(2, 3\)"),
        ({"mask": np.ones((2, 2), bool)}, r"mask has shape \(2, 2\)"),
        ({"mask": np.zeros((4, 4), bool)}, "no pixel is on the mask"),
        ({"mask": np.eye(4, dtype=bool)}, "no two neighbouring pixels"),
    ],
)
def test_what_cannot_be_planned_with_is_refused(change, message):
    given = {"normals": np.broadcast_to(UP, (4, 4, 3)), "lights": UP, **change}
    with pytest.raises(gn.GonioError, match=message):
        plan_sharing(**given)


def test_what_cannot_be_asked_for_is_refused():
    plan = plan_sharing(cylinder(0.02), arc(5, 0.3))
    with pytest.raises(gn.GonioError, match="highlight = 0"):
        plan.photographs_for(highlight=0)
    with pytest.raises(gn.GonioError, match=r"texture = 1.5: .* two pixels"):
        plan.photographs_for(texture=1.5)
    assert dataclasses.replace(plan, photographs=2).cap == math.pi / 2
