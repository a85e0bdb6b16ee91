"""Facts about where near lamps stand, from several balls."""

import numpy as np
import pytest
from reference.balls import TURN, seen_near

import gonio as gn
from gonio.capture.circles import circle_of_mask
from gonio.capture.lamps import light_positions
from gonio.capture.mirror_ball import highlight, highlight_points, light_directions
from gonio.directions import normalise
from gonio.errors import ArrayError, DirectionError


def test_three_balls_find_a_near_lamps_position():
    camera = gn.Pinhole(fx=500.0, fy=500.0, cx=180.0, cy=120.0, size=(240, 360))
    balls = np.array([[-3.0, 0.5, 12.0], [2.8, 1.2, 11.0], [0.2, -1.5, 12.5]])
    lamps = np.array([[-4.0, -5.0, 2.0], [5.0, -3.0, 1.0]])
    points, directions = [], []
    for ball in balls:
        views = [seen_near(camera, ball, lamp, fine=3, lamp_radius=0.4) for lamp in lamps]
        circle = circle_of_mask(views[0][1])
        found = [highlight(photograph, circle) for photograph, _ in views]
        points.append(highlight_points(found, circle, camera))
        directions.append(light_directions(found, circle, camera))
    lights = light_positions(np.array(points), np.array(directions))
    # Directions good to .2 degrees over 12 radii: .04 across, and along 2 to 3 times that; balls themselves to .03.
    assert not lights.distant.any() and lights.residual.max() < 0.1
    assert np.linalg.norm(lights.positions - TURN * lamps, axis=-1).max() < 0.2
    # With the balls' centres instead, half a radius is lost.
    near = light_positions(TURN * balls, np.array(directions))
    assert np.linalg.norm(near.positions - TURN * lamps, axis=-1).min() > 0.2


def test_rays_that_meet_give_their_point_and_parallel_rays_a_distant_light(rng):
    balls = np.array([[0, 0, 0], [40.0, 0, 0], [0, 30.0, 5.0]])
    lamp = np.array([20.0, -30.0, 100.0])
    to = normalise(lamp - balls)
    sun = np.broadcast_to(normalise([1.0, 2, 3]), to.shape)
    wide = normalise(sun + 1e-3 * rng.normal(size=to.shape))
    lights = light_positions(balls, np.stack((to, sun, wide), axis=1))
    np.testing.assert_allclose(lights.positions[0], lamp, atol=1e-9)
    assert lights.residual[0] < 1e-9
    assert lights.distant.tolist() == [False, True, True]
    assert np.isinf(lights.positions[1:]).all() and np.isnan(lights.residual[1:]).all()


def test_the_residual_is_the_distance_of_the_rays():
    # Two rays at right angles that pass each other at 2: each lies 1 from the point halfway.
    lights = light_positions([[-5.0, 0, 1], [0, -5.0, -1]], [[[1.0, 0, 0]], [[0, 1.0, 0]]])
    np.testing.assert_allclose(lights.positions, [[0, 0, 0]], atol=1e-12)
    assert lights.residual[0] == pytest.approx(1)


def test_rays_that_run_apart_are_refused():
    with pytest.raises(ArrayError, match="light 0 run apart"):
        light_positions([[-1.0, 0, 0], [1.0, 0, 0]], normalise([[[-1.0, 0, 5]], [[1.0, 0, 5]]]))
    with pytest.raises(ArrayError, match="two balls or more"):
        light_positions([[0.0, 0, 0]], [[[0, 0, 1.0]]])
    with pytest.raises(ArrayError, match="origins has shape"):
        light_positions([0.0, 0, 0], [[[0, 0, 1.0]], [[0, 0, 1.0]]])
    with pytest.raises(DirectionError, match="length 2"):
        light_positions(np.zeros((2, 3)), [[[0, 0, 2.0]], [[0, 0, 1.0]]])
