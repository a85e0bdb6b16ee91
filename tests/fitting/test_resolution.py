"""Facts about the trade of space for angle, on flatland signals."""

import math

import numpy as np
import pytest

import gonio as gn
from gonio.fitting.resolution import flat_band, shared_band, textured_band

PIXEL, LIGHTS = 0.01, 0.4


def curved(pixel, lights):
    """Samples (alpha, theta_h) on slanted lines, as RS figure 4 has them, over a window of many periods."""
    along, across = np.meshgrid(np.arange(-100, 100), np.arange(-20, 20))
    return along * pixel + across * lights / 4, -along * pixel + across * lights / 4


def flat(pixel, lights):
    along, across = np.meshgrid(np.arange(-100, 100), np.arange(-20, 20))
    return along * pixel, across * lights / 2


def alike(samples, first, second):
    """How alike two waves of frequencies (space, angle) are on the samples: 1 for the same, near 0 for others."""
    x, theta = samples
    turn = (first[0] - second[0]) * x + (first[1] - second[1]) * theta
    return abs(np.mean(np.exp(1j * turn)))


def corners(band, part):
    return [(s * part * band.space, t * part * band.angle) for s in (-1, 1) for t in (-1, 1)]


@pytest.mark.parametrize(("samples", "band"), [(flat, flat_band), (curved, textured_band), (curved, shared_band)])
def test_waves_within_the_band_are_told_apart(samples, band, rng):
    lattice, limits = samples(PIXEL, LIGHTS), band(PIXEL, LIGHTS)
    waves = rng.uniform(-0.9, 0.9, size=(12, 2)) * [limits.space, limits.angle]
    waves = np.concatenate((waves, corners(limits, 0.9)))
    for i in range(len(waves)):
        for j in range(i):
            # The window has 40 lines and 200 samples on each: waves nearer than a few periods of it look alike.
            if abs(waves[i] - waves[j]).max() > 0.05 * limits.space:
                assert alike(lattice, waves[i], waves[j]) < 0.5


def test_waves_beyond_it_are_taken_for_others():
    # From one replica of the spectrum to the next: RS 3 with (m1, m2) = (1, 0) and (0, 1).
    lattice = curved(PIXEL, LIGHTS)
    shift = np.array([4 * math.pi / LIGHTS] * 2)
    assert alike(lattice, -shift / 2, shift / 2) == pytest.approx(1)
    for band in (textured_band(PIXEL, LIGHTS), shared_band(PIXEL, LIGHTS)):
        assert min(band.space, band.angle) == pytest.approx(shift[0] / 2)
    slant = np.array([-math.pi / PIXEL, math.pi / PIXEL])
    assert alike(lattice, -slant / 2, slant / 2) == pytest.approx(1)
    for band in (textured_band(PIXEL, LIGHTS), shared_band(PIXEL, LIGHTS)):
        assert max(band.space, band.angle) == pytest.approx(slant[1] / 2)


def test_the_product_of_the_bands_is_the_same_whichever_is_shared():
    for band in (textured_band(PIXEL, LIGHTS), shared_band(PIXEL, LIGHTS)):
        assert band.space * band.angle == pytest.approx(math.pi**2 / (PIXEL * LIGHTS))


def test_one_photograph_tells_angles_and_no_space():
    band = shared_band(PIXEL, math.inf)
    assert band.space == 0
    assert band.angle > 100
    with pytest.raises(gn.GonioError, match="pixel = 0"):
        flat_band(0, LIGHTS)
