"""The kernel of SHRMs against its plain twin."""

import numpy as np
import pytest
from reference import expansion as plain

import gonio as gn
from gonio._kernels import expansion as kernels
from gonio._kernels.splines import GHOSTS
from gonio.rendering.shrm import recursion
from gonio.sphere import splines
from gonio.sphere.harmonics import harmonics


@pytest.mark.parametrize(("channels", "far"), [(3, False), (1, False), (3, True)])
def test_look_ups_are_series_of_splines(channels, far, rng):
    coefficients = rng.normal(size=(36, 4 * channels))
    sheet = splines.sheet(coefficients, 8)
    w, eyes, gain = gn.normalise(rng.normal(size=(30, 3))), gn.normalise(rng.normal(size=(30, 3))), rng.random(30)
    eyes = eyes[:1] if far else eyes
    out = np.empty((30, channels))
    kernels.look_up(sheet, splines.BORDER, 16, 1, recursion(1), w, eyes, gain, out)
    whole = sheet.reshape(sheet.shape[0], 16 + 2 * GHOSTS, 4, channels)
    eye = np.broadcast_to(harmonics(1, eyes), (30, 4))
    expected = plain.look_up(whole, splines.BORDER, GHOSTS, 16, w, eye, gain)
    np.testing.assert_allclose(out, expected, atol=1e-9)  # the arctangents differ by 1e-12 of a turn or so


def test_its_harmonics_are_the_harmonics(rng):
    w = gn.normalise(rng.normal(size=(20, 3)))
    out = np.empty((20, 49))
    for k in range(20):
        kernels.harmonics(6, recursion(6), *w[k], out[k])
    np.testing.assert_allclose(out, harmonics(6, w), atol=1e-13)
