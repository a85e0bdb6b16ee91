"""Facts about lobes summed over pixels."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn
from gonio.rendering import angular, chain
from gonio.rendering.lobes import ggx, phong


def test_the_part_beyond_the_reach_is_what_was_asked_for():
    # GGX at n = v = R: the integral of D(h) cos falls as that of (1 + (t / 2a)^2)^-2 t dt while angles are small.
    for error in (0.1, 0.01):
        angle, beyond = angular.reach(ggx, 0.002, error)
        assert beyond <= error
        assert angle == pytest.approx(0.004 * np.sqrt(1 / error - 1), rel=0.05)


@pytest.mark.parametrize("lobe", [ggx, phong])
def test_sums_and_series_agree_within_the_error(lobe, rng):
    room = gn.studio(256)
    alpha, error = 0.03, 1e-2
    series = chain.roughness_chain(room, 32, [alpha], lobe, error)
    assert series.degrees[0] > 0
    v, u = chain._places(32, tuple(room.turn.ravel().tolist()))
    angle, _ = angular.reach(lobe, alpha, error)
    summed = angular.blurred(room.image, lobe, alpha, angle, gn.from_spherical(np.pi * v, 2 * np.pi * u))
    difference = summed - series.faces[0].reshape(summed.shape)
    assert np.sqrt(np.mean(difference**2) / np.mean(summed**2)) < 1.5 * error


def test_few_texels_of_a_sharp_lobe_are_summed_and_many_of_a_broad_one_are_not():
    room = gn.studio(256)
    sharp = chain.roughness_chain(room, 8, [0.02], error=1e-2)
    assert sharp.degrees == (0,)
    assert 0 < sharp.errors[0] <= 2e-2
    assert chain.roughness_chain(room, 8, [0.2], error=1e-2).degrees[0] > 0
    # As bright as the light, which a lobe does not change on average.
    white = gn.Environment(np.ones((256, 512, 3), np.float32))
    assert_allclose(chain.roughness_chain(white, 8, [0.02], error=1e-2).faces[0], 1, rtol=1e-6)
