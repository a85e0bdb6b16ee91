"""The loops of radial functions beside their plain twin."""

import numpy as np
import pytest
from reference import radial as twin
from reference.radial_fits import directions, interpolant

from gonio._kernels import radial as kernels
from gonio.arrays import floats
from gonio.brdf.radial import Radial


@pytest.mark.parametrize("n", [1, 2, 255, 256, 257, 600])
def test_loops_are_the_plain_twin_whatever_the_blocks_hold(rng, n):
    for channels in (1, 3):
        centres, q = rng.normal(size=(n, 3)), rng.normal(size=(67, 3)).astype(np.float32)
        coefficients, polynomial = rng.normal(size=(n, channels)), rng.normal(size=(4, channels))
        targets = rng.normal(size=(67, channels)).astype(np.float32)
        expected = np.array([twin.value(x.astype(float), centres, np.ones(3), coefficients, polynomial) for x in q])
        out = np.empty((67, channels))
        kernels.evaluate(q, centres, coefficients, polynomial, out)
        # Each term is rounded to 6e-8 of itself, and partial sums, which grow as a random walk, as often: one after the
        # other as plain Python, more than in the thirty sums that are compiled.
        assert np.abs(out - expected).max() < 3e-7 * np.abs(coefficients).sum() + 1e-6
        left = np.empty((67, channels), np.float32)
        kernels.residuals(q, *(x.astype(np.float32) for x in (centres, coefficients, polynomial)), targets, left)
        assert np.abs(left - (targets - expected)).max() < 3e-7 * np.abs(coefficients).sum() + 5e-6


@pytest.mark.parametrize("folded", [False, True])
@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize("logarithm", [False, True])
def test_reflectance_is_the_plain_twins(rng, folded, flat, logarithm):
    s = interpolant(rng, 2 if flat else 3, 3)
    model = Radial(s, logarithm, folded, flat)
    wi, wo = directions(rng, 40), directions(rng, 40)
    q = [twin.coordinates(a, b, folded, flat) for a, b in zip(wi, wo, strict=True)]
    expected = np.array([twin.value(x, s.centres, s.scales, s.coefficients, s.polynomial) for x in q])
    expected = np.exp(expected) if logarithm else np.maximum(expected, 0)
    assert np.allclose(model.coordinates(wi, wo), q, atol=1e-7)  # acos near the pole in the twin
    assert np.abs(model.f(wi, wo) - expected).max() < 2e-5 * expected.max()
    # The compiled loop and the array code are two.
    slow = model._f(*floats(wi, wo))
    assert np.abs(model.f(wi, wo) - slow).max() < 2e-5 * expected.max()
