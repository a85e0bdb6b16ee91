"""Facts about light directions from photographs of mirror balls."""

import math

import numpy as np
import pytest
from reference.balls import CIRCLE, LAMPS, SIZE, TURN, angle, centres, disc, seen_from_far, seen_near

import gonio as gn
from gonio.cameras import to_opengl
from gonio.capture.circles import Circle, circle_of_mask
from gonio.capture.mirror_ball import highlight, highlight_points, light_directions
from gonio.directions import normalise
from gonio.errors import ArrayError, ParameterError


def test_directions_from_highlights_are_within_a_fifth_of_a_degree_of_the_lamp():
    found = [highlight(seen_from_far(lamp), CIRCLE) for lamp in LAMPS]
    # A pixel is 1.4 degrees at the middle and more towards the rim; highlights there are narrow, and curved.
    error = angle(light_directions(found, CIRCLE), LAMPS)
    assert error[:4].max() < 0.2 and error[4] < 0.5


def test_the_middle_of_the_ball_shows_the_viewer_and_its_rim_what_is_behind():
    middle, right, top = CIRCLE.centre, (97.3, 121.8 + 80.6 * math.sqrt(0.5)), (97.3 - 80.6 * math.sqrt(0.5), 121.8)
    L = light_directions([middle, right, top], CIRCLE)
    # Half way round in slope, n = (1, 0, 1)/sqrt2, the mirror turns by a right angle.
    np.testing.assert_allclose(L, [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-12)
    rim = light_directions([(97.3, 121.8 + 80.6 * (1 - 1e-9))], CIRCLE)
    np.testing.assert_allclose(rim, [[0, 0, -1]], atol=1e-4)


def test_the_brightest_of_two_highlights_is_taken_whole_and_with_its_colour():
    both = seen_from_far(LAMPS[1]) + 0.4 * seen_from_far(LAMPS[2])
    one = highlight(seen_from_far(LAMPS[1]), CIRCLE)
    np.testing.assert_allclose(highlight(both, CIRCLE), one, atol=0.01)
    np.testing.assert_allclose(highlight(both[..., None] * [0.9, 0.5, 0.2], CIRCLE), one, atol=0.01)


def test_glare_does_not_move_a_clipped_highlight():
    photograph = seen_from_far(LAMPS[1], radius=6.0)
    clean = highlight(photograph, CIRCLE)
    row, column = (int(k) for k in clean)
    glare = np.zeros(SIZE)
    glare[row - 2 : row + 3, column : column + 14] = 0.7
    # Only the pixels next to the clipped part let glare in: 5 of some 60, to one side by 4.
    assert math.dist(highlight(np.minimum(photograph + glare, 1.0), CIRCLE), clean) < 0.3


def test_a_ball_without_a_highlight_is_refused(rng):
    matte = np.where(disc(), 0.3 * centres(SIZE, 1)[..., 0] / 200, 0)
    for photograph in (np.full(SIZE, 0.2), np.full(SIZE, 0.2) + rng.uniform(0, 0.1, SIZE), np.zeros(SIZE), matte):
        with pytest.raises(ArrayError, match="no highlight"):
            highlight(photograph, CIRCLE)
    half = np.where(centres(SIZE, 1)[..., 1] < 110, 1.0, 0.01)
    with pytest.raises(ArrayError, match=r"covers 4\d% of it"):
        highlight(half, CIRCLE)
    with pytest.raises(ArrayError, match="outside the photograph"):
        highlight(np.ones(SIZE), Circle((900.0, 900.0), 5.0))
    with pytest.raises(ArrayError, match="is nan"):
        highlight(np.full(SIZE, np.nan), CIRCLE)


def test_highlights_outside_the_circle_are_refused():
    with pytest.raises(ArrayError, match=r"highlights\[1\] = \(10.0, 10.0\) lies outside the ball"):
        light_directions([(97.0, 121.0), (10.0, 10.0)], CIRCLE)
    with pytest.raises(ArrayError, match=r"\(N, 2\)"):
        light_directions([97.0, 121.0], CIRCLE)
    camera = gn.Pinhole(fx=300, fy=300, cx=120, cy=100, size=SIZE)
    with pytest.raises(ArrayError, match=r"highlights\[0\] .* lies outside"):
        light_directions([(10.0, 10.0)], CIRCLE, camera)
    with pytest.raises(ParameterError, match="pass a Pinhole"):
        light_directions([(97.0, 121.0)], CIRCLE, gn.Orthographic(size=SIZE, pixel=1.0))


PINHOLE = gn.Pinhole(fx=420.0, fy=420.0, cx=150.0, cy=110.0, size=(220, 300))
BALL = np.array([1.9, -0.9, 9.0])


def test_perspective_ignored_costs_degrees_and_accounted_for_it_does_not():
    lamps = normalise([[0.2, 0.3, 0.9], [0.7, 0.2, 0.6], [-0.6, 0.4, 0.6], [-0.1, -0.7, 0.6]])
    views = [seen_near(PINHOLE, BALL, TURN * lamp) for lamp in lamps]
    circle = circle_of_mask(views[0][1])
    highlights = [highlight(photograph, circle) for photograph, _ in views]
    assert angle(light_directions(highlights, circle), lamps).min() > 5
    # A pixel here is 2.4 degrees; a fit of 300 points of the outline is good to a twentieth of it.
    assert angle(light_directions(highlights, circle, PINHOLE), lamps).max() < 0.15


def test_the_outline_puts_the_ball_where_it_stands():
    circle = circle_of_mask(seen_near(PINHOLE, BALL, np.array([0.0, 0.0, -1.0]))[1])
    # The ball's own point that faces the camera is 1 nearer than its centre, on the ray to it.
    distance = np.linalg.norm(BALL)
    pixel = PINHOLE.project(BALL)[0]
    point = highlight_points([pixel[::-1]], circle, PINHOLE)[0]
    # Distance follows the radius, 46 pixels, known to .05: 1e-3.
    np.testing.assert_allclose(TURN * point, BALL * (distance - 1) / distance, atol=2e-3 * distance)
    assert abs(TURN * point @ BALL / distance - distance + 1) < 1e-3 * distance
    # And the circle is not around the image of the ball's centre.
    assert math.dist(circle.centre, pixel[::-1]) > 0.1


def test_a_camera_far_away_sees_as_an_orthographic_one_does():
    far = gn.Pinhole(fx=1e6, fy=1e6, cx=121.8, cy=97.3, size=SIZE)
    places = CIRCLE.centre + np.array([[0, 0], [30, 40], [-70, 10.0]])
    # The angle that the ball is seen under, 8e-5, is all that differs; turned twice, and steeper near the rim.
    np.testing.assert_allclose(light_directions(places, CIRCLE, far), light_directions(places, CIRCLE), atol=1e-3)


def test_the_pose_of_the_camera_changes_nothing_and_takes_directions_to_the_world():
    pose = gn.look_at((3.0, -4.0, 2.0), (0.0, 0.0, 0.0))
    here = gn.Pinhole(fx=420.0, fy=420.0, cx=150.0, cy=110.0, size=(220, 300), pose=pose)
    circle, places = Circle((80.0, 200.0), 45.0), [(70.0, 190.0)]
    np.testing.assert_allclose(
        light_directions(places, circle, here), light_directions(places, circle, PINHOLE), atol=1e-12
    )
    to_viewer = to_opengl(pose)[:3, :3] @ [0, 0, 1.0]
    np.testing.assert_allclose(to_viewer, -here.forward, atol=1e-12)
