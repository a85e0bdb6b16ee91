import numpy as np
import pytest

import gonio as gn
from gonio.capture.integration import integrate_normals
from gonio.directions import normalise
from gonio.shapes.heightfield import HeightField


def normals_of(p, q):
    """Unit normals of a surface with the slopes dz/dcolumn = p and dz/drow = q."""
    p, q = np.broadcast_arrays(p, q)
    return normalise(np.stack((-p, q, np.ones_like(p)), axis=-1))


def wavy(rows, columns):
    """Heights and normals that differ everywhere, with slopes up to about 1."""
    r, c = np.mgrid[:rows, :columns].astype(float)
    z = 6 * np.sin(c / 7) * np.cos(r / 9)
    return z, normals_of(6 / 7 * np.cos(c / 7) * np.cos(r / 9), -6 / 9 * np.sin(c / 7) * np.sin(r / 9))


def disc(rows):
    """x to the right, y up, and the mask of a disc of radius rows / 2."""
    y, x = np.mgrid[:rows, :rows] - (rows - 1) / 2
    return x, -y, x**2 + y**2 < (rows / 2) ** 2


def centred(z, mask):
    return np.where(mask, z - z[mask].mean(), np.nan)


# Heights are found to 1e-10 of themselves in the norm of slopes: to 1e-8 of a pixel on these grids.
CLOSE = {"rtol": 0, "atol": 1e-7}


def test_a_plane_is_integrated_exactly():
    r, c = np.mgrid[:40, :60].astype(float)
    found = integrate_normals(normals_of(np.full((40, 60), 0.7), -1.3))
    np.testing.assert_allclose(found.heights, centred(0.7 * c - 1.3 * r, r >= 0), **CLOSE)
    np.testing.assert_allclose(found.residual, 0, atol=1e-8)
    assert found.converged and "was reached" in found.reason


def test_slopes_of_a_quadratic_surface_are_integrated_exactly_in_any_mask(rng):
    """The trapezium rule has no error where slopes are linear, with holes and weights as without."""
    r, c = np.mgrid[:50, :70].astype(float)
    z = 0.01 * c**2 - 0.02 * c * r + 0.015 * r**2 + 0.3 * c - r
    mask = (r - 25) ** 2 + (c - 35) ** 2 < 700
    mask[20:25, 30:50] = False
    normals, weights = normals_of(0.02 * c - 0.02 * r + 0.3, -0.02 * c + 0.03 * r - 1), rng.uniform(0.01, 1, (50, 70))
    for w in (None, weights):
        np.testing.assert_allclose(integrate_normals(normals, mask, w).heights, centred(z, mask), **CLOSE)


def test_normals_of_a_height_field_give_its_heights_back():
    """Orientation is that of `HeightField`, whose central differences are exact on a quadratic surface."""
    r, c = np.mgrid[:20, :30].astype(float)
    z = 0.02 * r**2 - 0.03 * r * c + 0.01 * c**2 + c
    np.testing.assert_allclose(integrate_normals(HeightField(z).normals).heights, z - z.mean(), **CLOSE)


def test_a_hemisphere_in_a_disc_is_the_closed_form_to_second_order():
    """z = sqrt(R^2 - x^2 - y^2) to an angle of 64 degrees; off by step^2 z''' / 12, summed over the disc."""
    errors = []
    for rows in (60, 120):
        x, y, mask = disc(rows)
        R = rows / 2 / 0.9
        z = np.sqrt(np.where(mask, R**2 - x**2 - y**2, 1))
        normals = np.stack((x, y, z), axis=-1) / R
        errors.append(np.nanmax(np.abs(integrate_normals(normals, mask).heights - centred(z, mask))) / R)
    # In units of R the step is halved: a quarter of the error, a little more at a rim of stairs.
    assert errors[0] < 1e-3 and errors[1] < errors[0] / 3


def test_the_residual_equations_are_those_of_weighted_least_squares(rng):
    """Against a dense solver, for normals that are those of no surface and a mask in pieces."""
    rows, columns = 9, 11
    p, q, weights = (
        rng.normal(size=(rows, columns)),
        rng.normal(size=(rows, columns)),
        rng.uniform(0.1, 2, (rows, columns)),
    )
    mask = rng.random((rows, columns)) < 0.8
    mask[4] = False
    equations, right, edges = [], [], np.zeros((rows, columns))
    for a in np.argwhere(mask):
        for step, slope in ((np.array([0, 1]), p), (np.array([1, 0]), q)):
            b = a + step
            if (b < (rows, columns)).all() and mask[tuple(b)]:
                a_, b_ = tuple(a), tuple(b)
                root = np.sqrt(2 / (1 / weights[a_] + 1 / weights[b_]))
                line = np.zeros((rows, columns))
                line[b_], line[a_] = root, -root
                equations.append(line.ravel())
                right.append(root * (slope[a_] + slope[b_]) / 2)
                edges[a_] += 1
                edges[b_] += 1
    z = np.linalg.lstsq(np.array(equations), np.array(right))[0].reshape(rows, columns)
    found = integrate_normals(normals_of(p, q), mask, weights)
    across, along = mask[:, :-1] & mask[:, 1:], mask[:-1] & mask[1:]
    # Differences, since each piece of the mask has its own constant.
    np.testing.assert_allclose(np.diff(found.heights, axis=1)[across], np.diff(z, axis=1)[across], **CLOSE)
    np.testing.assert_allclose(np.diff(found.heights, axis=0)[along], np.diff(z, axis=0)[along], **CLOSE)
    squares = np.zeros((rows, columns))
    off = np.where(across, np.diff(z, axis=1) - (p[:, 1:] + p[:, :-1]) / 2, 0) ** 2
    squares[:, 1:] += off
    squares[:, :-1] += off
    off = np.where(along, np.diff(z, axis=0) - (q[1:] + q[:-1]) / 2, 0) ** 2
    squares[1:] += off
    squares[:-1] += off
    np.testing.assert_allclose(found.residual[mask], np.sqrt(squares / np.maximum(edges, 1))[mask], atol=1e-7)


def test_every_component_has_mean_zero_and_its_own_shape():
    _, normals = wavy(40, 60)
    left, right, alone = (np.zeros((40, 60), bool) for _ in range(3))
    left[:, :25], right[:, 30:], alone[3, 27] = True, True, True
    right[10:20, 40:50] = False
    found = integrate_normals(normals, left | right | alone)
    for part in (left, right):
        assert abs(found.heights[part].mean()) < 1e-12
        np.testing.assert_allclose(found.heights[part], integrate_normals(normals, part).heights[part], **CLOSE)
    assert found.heights[3, 27] == 0 and found.residual[3, 27] == 0


def test_pixels_that_touch_at_corners_alone_are_apart():
    mask = np.array([[True, False], [False, True]])
    np.testing.assert_array_equal(integrate_normals(wavy(2, 2)[1], mask).heights, [[0, np.nan], [np.nan, 0]])
    board = np.indices((40, 40)).sum(axis=0) % 2 == 0
    found = integrate_normals(wavy(40, 40)[1], board)
    assert found.converged and not found.heights[board].any()


def test_many_small_pieces_are_solved_as_one_piece_is(rng):
    """Pieces of all sizes finish on different levels of the multigrid: none may disturb the others."""
    r, c = np.mgrid[:150, :150].astype(float)
    z = 0.01 * c**2 - 0.02 * c * r
    mask = rng.random((150, 150)) < 0.62
    found = integrate_normals(normals_of(0.02 * c - 0.02 * r, -0.02 * c), mask)
    assert found.converged
    across, along = mask[:, :-1] & mask[:, 1:], mask[:-1] & mask[1:]
    np.testing.assert_allclose(np.diff(found.heights, axis=1)[across], np.diff(z, axis=1)[across], **CLOSE)
    np.testing.assert_allclose(np.diff(found.heights, axis=0)[along], np.diff(z, axis=0)[along], **CLOSE)


def test_a_patch_without_weight_does_not_pull_at_the_rest(rng):
    _, normals = wavy(60, 60)
    patch = np.zeros((60, 60), bool)
    patch[20:35, 25:45] = True
    corrupted = normals.copy()
    corrupted[patch] = normals_of(*rng.normal(size=(2, 15, 20))).reshape(-1, 3)
    heights = integrate_normals(corrupted, weights=~patch).heights
    without = integrate_normals(normals, ~patch).heights
    here, there = centred(heights, ~patch), centred(without, ~patch)
    # Edges of the patch keep 1e-6 of the weight, with slopes that are off by 3 at most, over some 20 pixels.
    np.testing.assert_allclose(here, there, atol=1e-4)
    bent = centred(integrate_normals(corrupted).heights, ~patch)
    assert np.nanmax(np.abs(bent - there)) > 1
    assert np.isfinite(heights).all()


def test_weights_over_six_decades_still_converge(rng):
    r, c = np.mgrid[:100, :100].astype(float)
    weights = 10 ** rng.uniform(-6, 0, (100, 100))
    found = integrate_normals(normals_of(0.02 * c, 0.01 * r), weights=weights)
    z = 0.01 * c**2 + 0.005 * r**2
    # The least weights are felt a thousandth as much in the norm that is minimised.
    assert found.converged
    np.testing.assert_allclose(found.heights, z - z.mean(), atol=1e-4)


def test_only_ratios_of_weights_matter(rng):
    normals, weights = normals_of(*rng.normal(size=(2, 20, 20))), rng.random((20, 20))
    np.testing.assert_allclose(
        integrate_normals(normals, weights=weights).heights,
        integrate_normals(normals, weights=1e-200 * weights).heights,
        **CLOSE,
    )


def test_heights_do_not_depend_on_what_stands_outside_the_mask():
    _, normals = wavy(50, 50)
    _, _, mask = disc(50)
    other, weights = normals.copy(), np.ones((50, 50))
    other[~mask], weights[~mask] = [np.nan, 7, -1], np.nan
    expected = integrate_normals(normals, mask)
    found = integrate_normals(other, mask, weights)
    np.testing.assert_array_equal(found.heights, expected.heights)
    np.testing.assert_array_equal(np.isnan(found.heights), ~mask)
    np.testing.assert_array_equal(np.isnan(found.residual), ~mask)


def test_without_a_mask_all_finite_normals_count():
    _, normals = wavy(50, 50)
    _, _, mask = disc(50)
    normals[~mask] = np.nan
    np.testing.assert_array_equal(integrate_normals(normals).heights, integrate_normals(normals, mask).heights)


def test_slopes_are_cut_at_twenty():
    normals = np.array([[[-1.0, 0, 0.01], [-1.0, 0, 0.01]]])
    np.testing.assert_allclose(integrate_normals(normalise(normals)).heights, [[-10, 10]], rtol=1e-12)


def test_the_residual_shows_where_normals_are_those_of_no_surface():
    p = np.zeros((40, 40))
    p[20:, 10:30] = 0.5
    found = integrate_normals(normals_of(p, 0))
    # Along the border of the patch p jumps from row to row, which heights cannot; away from it they give way.
    assert found.residual[18:22, 10:30].mean() > 3 * found.residual[:10].mean()


def test_normals_in_single_precision_give_heights_in_double():
    _, normals = wavy(30, 30)
    found = integrate_normals(normals.astype(np.float32)).heights
    assert found.dtype == np.float64
    # Rounding of slopes, 1e-7 each, adds up over 30 pixels.
    np.testing.assert_allclose(found, integrate_normals(normals).heights, atol=1e-5)


def changed(place, normal):
    _, normals = wavy(6, 8)
    normals[place] = normal
    return normals


GOOD = np.ones((6, 8), bool)


@pytest.mark.parametrize(
    ("normals", "mask", "weights", "message"),
    [
        (np.ones((6, 8)), None, None, r"\(rows, columns, 3\) are wanted"),
        (np.ones((6, 8, 4)), None, None, r"shape \(6, 8, 4\)"),
        (np.ones((6, 8, 3), complex), None, None, "complex128"),
        (wavy(6, 8)[1], np.ones((8, 6), bool), None, r"mask has shape \(8, 6\)"),
        (wavy(6, 8)[1], np.ones((6, 8)), None, "float64; booleans"),
        (wavy(6, 8)[1], ~GOOD, None, "empty"),
        (np.full((6, 8, 3), np.nan), None, None, "empty"),
        (changed((2, 3), [0, 0, 2]), None, None, r"normals\[2, 3\] = \[0.0, 0.0, 2.0\] is not a unit vector"),
        (changed((2, 3), [np.nan, 0, 1]), GOOD, None, r"normals\[2, 3\].*not finite"),
        (changed((4, 1), [0, 0.6, -0.8]), None, None, r"normals\[4, 1\].*faces away"),
        (changed((4, 1), [0, 1, 0]), None, None, r"normals\[4, 1\].*faces away"),
        (wavy(6, 8)[1], None, np.ones(6), r"weights have shape \(6,\)"),
        (wavy(6, 8)[1], None, np.where(np.arange(48).reshape(6, 8) == 19, -0.5, 1), r"weights\[2, 3\] = -0.5"),
        (wavy(6, 8)[1], None, np.where(np.arange(48).reshape(6, 8) == 19, np.nan, 1), r"weights\[2, 3\] = nan"),
        (wavy(6, 8)[1], None, np.zeros((6, 8)), "0 throughout"),
    ],
)
def test_what_cannot_be_integrated_is_refused_by_name(normals, mask, weights, message):
    with pytest.raises(gn.errors.ArrayError, match=message):
        integrate_normals(normals, mask, weights)
