"""The kernel of lobes summed over pixels beside its plain twin."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from reference import lobe_sums as plain

import gonio as gn
from gonio.rendering import angular
from gonio.rendering.lobes import phong


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("angle", [0.02, 0.4, 1.2])
def test_sums_are_those_of_the_plain_twin_over_poles_and_seam_too(channels, angle, rng):
    image = rng.random((24, 48, channels))
    R = gn.normalise(rng.normal(size=(40, 3)))
    # Poles and seam, but nowhere just between pixels: where a lobe holds none, the nearest counts.
    R[:6] = gn.normalise(np.vstack((np.eye(3), -np.eye(3))) + np.array([0.03, 0.02, 0.01]))
    R[6:8] = gn.normalise([[1, 1e-4, 0.2], [1, -1e-4, 0.2]])
    R[8:10] = gn.normalise([[1e-5, 0, 1], [0.02, 0.01, -1]])
    found = angular.blurred(image, phong, 0.3, angle, R)
    # The table of 4,096 steps or more is linear between them.
    assert_allclose(found, plain.add(image, R, lambda theta: phong(0.3, theta), angle), rtol=1e-6)
