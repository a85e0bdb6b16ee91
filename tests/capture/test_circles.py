"""Facts about circles in images, the outlines of balls."""

import math

import numpy as np
import pytest
from reference.balls import CIRCLE, LAMPS, SIZE, binned, centres, disc, off, seen_from_far

from gonio.capture.circles import Circle, circle_of_mask, find_circle
from gonio.errors import ArrayError, ParameterError


def test_the_circle_of_a_mask_is_that_which_it_was_drawn_with():
    circle = circle_of_mask(disc())
    # 640 points of the outline, each off by an even spread within half a pixel (.29 rms): .03 of the mean and less.
    assert max(off(circle, CIRCLE)) < 0.05 and 0.1 < circle.residual < 0.4


def test_a_circle_is_found_though_a_stand_covers_its_foot_and_the_frame_cuts_its_side():
    mask = disc(CIRCLE)
    mask[160:, 100:145] = True
    assert max(off(circle_of_mask(mask), CIRCLE)) < 0.1
    # The frame takes a third of what is left; the stand's sides are cut off as points apart.
    assert max(off(circle_of_mask(mask[:, 80:]), Circle((97.3, 41.8), 80.6))) < 0.15


def test_holes_and_specks_in_a_mask_change_nothing():
    mask = disc()
    mask[80:110, 100:130] = False
    mask[2:6, 2:6] = True
    assert circle_of_mask(mask) == circle_of_mask(disc())


def test_masks_that_show_no_ball_are_refused():
    for mask, match in (
        (disc().astype(np.uint8), "mask > 127"),
        (np.zeros((9, 9), bool), "False everywhere"),
        (np.ones((9, 9), bool), "outline of 0 points"),
        (np.pad(np.ones((20, 90), bool), 9), "not round"),
    ):
        with pytest.raises(ArrayError, match=match):
            circle_of_mask(mask)


def scene(rng, circle, size, gain=1.0):
    """A dark mirror ball on a stand before two walls, one as dark as itself, with highlights of several lamps."""
    image = np.full(size, 0.2)
    image[int(circle.centre[0] + 0.45 * circle.radius) :] = 0.004
    photographs = [seen_from_far(lamp, circle, size, fine=2, glow=0) for lamp in LAMPS]
    share = binned((np.hypot(*np.moveaxis(centres(size, 4) - circle.centre, -1, 0)) < circle.radius).astype(float), 4)
    image = image * (1 - share) + np.mean(photographs, axis=0)
    foot, width = int(circle.centre[0] + 0.98 * circle.radius), int(circle.radius / 3)
    image[foot:, int(circle.centre[1]) - width : int(circle.centre[1]) + width] = 0.1
    return gain * image * rng.normal(1, 0.03, size)


@pytest.mark.parametrize(("size", "circle"), [(SIZE, CIRCLE), ((180, 260), Circle((61.2, 150.4), 31.7))])
def test_a_ball_is_found_by_its_outline(rng, size, circle):
    # Three fifths of the outline show: what moves the radius moves the centre, too, and errors of a tenth double.
    assert max(off(find_circle(scene(rng, circle, size)), circle)) < 0.25


def test_the_unit_of_radiance_does_not_move_the_ball(rng):
    state = rng.bit_generator.state
    found = find_circle(scene(rng, CIRCLE, SIZE))
    rng.bit_generator.state = state
    assert max(off(find_circle(scene(rng, CIRCLE, SIZE, gain=1e4)), found)) < 1e-6


def test_a_large_photograph_is_searched_small_and_measured_whole(rng):
    circle = Circle((421.3, 517.9), 322.4)
    image = np.where(disc(circle, (900, 1100)), 0.01, 0.2) * rng.normal(1, 0.03, (900, 1100))
    # Steps of whole pixels, even over the outline: a pixel of the search would be 2.
    assert max(off(find_circle(image), circle)) < 0.2


def test_where_no_ball_is_none_is_found(rng):
    walls = np.full(SIZE, 0.2)
    walls[:, 90:] = 0.5
    walls[120:] *= 0.3
    for image in (walls * rng.normal(1, 0.02, SIZE), rng.uniform(0.1, 1, SIZE)):
        with pytest.raises(ArrayError, match="shows no ball"):
            find_circle(image)
    with pytest.raises(ArrayError, match="black"):
        find_circle(np.zeros(SIZE))


def test_a_circle_has_a_centre_and_a_radius():
    with pytest.raises(ParameterError, match="radius = -1"):
        Circle((1.0, 2.0), -1.0)
    with pytest.raises(ArrayError, match="nan"):
        Circle((1.0, math.nan), 1.0)


def test_the_balls_are_found_without_their_masks(uw):
    for photographs, mask in uw[0].values():
        found, drawn = find_circle(photographs.mean(axis=0)), circle_of_mask(mask)
        # Masks are drawn by hand to a pixel; of the chrome ball three fifths of the outline are seen at all.
        assert max(off(found, drawn)) < 1.5 and found.residual < 0.2
