"""Tables of samples."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn
from gonio.samples import RadianceSamples, ReflectanceSamples


def some(count, rng):
    w = gn.normalise(rng.normal(size=(2, count, 3)) + np.array([0, 0, 2]))
    return np.arange(count), w[0], w[1], rng.random((count, 3)), rng.random(count)


def test_coordinates_are_those_of_the_directions(rng):
    samples = ReflectanceSamples(*some(20, rng))
    assert len(samples) == 20
    assert_allclose(samples.uvw, gn.uvw(samples.wi, samples.wo))
    theta_h = np.arccos(gn.normalise(samples.wi + samples.wo)[:, 2])
    assert_allclose(samples.half_difference[:, 0], theta_h, atol=1e-7)


@pytest.mark.parametrize("kind", [ReflectanceSamples, RadianceSamples])
def test_tables_that_do_not_fit_are_refused_by_column(kind, rng):
    site, a, b, value, weight = some(5, rng)
    for columns, message in (
        ((site, a[:4], b, value, weight), r"has shape \(4, 3\); \(5, 3\) is wanted"),
        ((site, a, b, value[:, 0], weight), "value has shape"),
        ((site, a, b, np.where(value > 0, np.nan, 0), weight), "value is not all finite"),
        ((site, a, b, value, -weight), "weight is not all finite and >= 0"),
        ((site, 2 * a, b, value, weight), "length 2"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            kind(*columns)
