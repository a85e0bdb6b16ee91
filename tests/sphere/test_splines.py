"""Facts about splines between harmonic series and scattered directions, or finer maps."""

import numpy as np
import pytest
from reference import splines as plain

import gonio as gn
from gonio._kernels import splines as kernels
from gonio.sphere import splines
from gonio.sphere.harmonics import harmonics


def places(w):
    theta, phi = gn.spherical(w)
    return theta / np.pi, phi / (2 * np.pi)


@pytest.mark.parametrize("rows", [1, 2, 7, 40])
def test_sharpening_undoes_the_blur_over_the_poles(rows, rng):
    grid = rng.normal(size=(rows, 8, 3))
    sharp = grid.copy()
    kernels.sharpen(sharp.reshape(rows, -1))
    np.testing.assert_allclose(plain.blurred(sharp), grid, atol=1e-14)


@pytest.mark.parametrize("channels", [1, 3])
def test_look_ups_are_sums_of_splines(channels, rng):
    columns = 8
    sheet = rng.normal(size=(4 + 2 * kernels.GHOSTS, columns + 2 * kernels.GHOSTS, channels))
    v, u = np.r_[0, 1, rng.random(40)], np.r_[0, 1 - 1e-9, rng.random(40)]
    out = np.empty((42, channels))
    kernels.look_up(sheet.reshape(len(sheet), -1), columns, v, u, out)
    np.testing.assert_allclose(out, plain.look_up(sheet, kernels.GHOSTS, columns, v, u), atol=1e-14)


@pytest.mark.parametrize(("factor", "channels"), [(2, 3), (4, 1), (6, 3)])
def test_thinning_is_the_sum_over_pixels_and_splines(factor, channels, rng):
    image, weights = rng.normal(size=(12, 24, channels)), rng.random(12)
    taps = np.stack(kernels.splines((np.arange(factor) + 0.5) / factor), axis=-1)
    sheet = np.empty((12 // factor + 2 * kernels.GHOSTS, 24 // factor + 2 * kernels.GHOSTS, channels))
    kernels.thin(image.reshape(12, -1), weights, taps, sheet)
    expected = plain.thin(image, weights, factor, kernels.GHOSTS)
    np.testing.assert_allclose(sheet, expected, atol=1e-13)


@pytest.mark.parametrize(("degree", "rows"), [(8, 16), (8, 64), (20, 64), (20, 208)])
def test_a_series_at_scattered_directions_is_good_to_the_error_that_is_told(degree, rows, rng):
    c = rng.normal(size=((degree + 1) ** 2, 3))
    # Straight up and down as well, where all columns meet.
    w = np.concatenate(([[0.0, 0, 1], [0, 0, -1]], gn.normalise(rng.normal(size=(4000, 3)))))
    off = splines.values(c, rows, *places(w)) - harmonics(degree, w) @ c
    l = np.arange(degree + 1)
    told = np.sqrt(np.sum((2 * l + 1) * splines.relative_error(l, rows) ** 2) / (degree + 1) ** 2)
    rms = np.sqrt(np.mean(off**2) * 4 * np.pi / (degree + 1) ** 2)
    # Waves askew to the grid err by less than those along it, for which the formula is.
    assert told / 4 < rms < told
    assert np.abs(off[:2]).max() < 6 * told * (degree + 1) / np.sqrt(4 * np.pi)


@pytest.mark.parametrize("factor", [2, 4, 8])
def test_a_thinned_analysis_sees_a_lamp_where_the_maps_own_does(factor, rng):
    rows, degree = 128, 7
    image = np.zeros((rows, 2 * rows, 3))
    image[rng.integers(0, rows, 20), rng.integers(0, 2 * rows, 20)] = rng.random((20, 3))
    image[0, 3], image[-1, 90] = 5, 7  # across either pole as well
    own = gn.analysis(image, gn.LatLong(rows, 2 * rows), degree)
    off = splines.thinned_analysis(image, degree, factor) - own
    l = np.arange(degree + 1)
    rms = [np.sqrt(np.mean(off[k * k : (k + 1) ** 2] ** 2)) for k in l]
    size = np.sqrt(np.mean(own**2))
    # A lamp is as bright in every degree, so each errs by its own share; twice, since twenty lamps are few.
    assert np.all(np.array(rms) < 2 * splines.relative_error(l, rows // factor) * size + 1e-14)


def test_single_precision_stays(rng):
    image = rng.random((64, 128, 3), dtype=np.float32)
    c = splines.thinned_analysis(image, 5, 4)
    assert c.dtype == np.float32
    assert splines.values(c, 32, np.array([0.5]), np.array([0.25])).dtype == np.float32


@pytest.mark.parametrize(("degree", "factor"), [(4, 3), (4, 5), (8, 4), (4, 0)])
def test_maps_that_cannot_be_thinned_so_far_are_refused(degree, factor):
    with pytest.raises(gn.GonioError, match="cannot be thinned"):
        splines.thinned_analysis(np.zeros((64, 128, 3)), degree, factor)
