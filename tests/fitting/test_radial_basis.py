import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator
from scipy.spatial.distance import cdist

import gonio as gn
from gonio.fitting.radial_basis import RadialSystem, anchors

SCALES = np.array([1, 0.7, 0.2])


def scattered(rng, count):
    """Points off the origin, and three smooth channels."""
    q = rng.random((count, 3)) + np.array([0, 3, -1])
    return q, np.stack((np.sin(4 * q[:, 0]), q[:, 1] * q[:, 2], np.exp(-5 * q[:, 2] ** 2)), axis=-1)


def at(interpolant, q):
    """s in double precision."""
    r = cdist(q * interpolant.scales, interpolant.centres * interpolant.scales)
    return (
        r @ interpolant.coefficients + interpolant.polynomial[0] + (q * interpolant.scales) @ interpolant.polynomial[1:]
    )


def grown(q, g, rho, *bounds):
    system = RadialSystem(SCALES, rho, most=8)
    for low, high in zip((0, *bounds), (*bounds, len(q)), strict=True):
        system.add(q[low:high], g[low:high])
    return system


@pytest.mark.parametrize("rho", [0, 0.01, 0.3])
def test_the_interpolant_is_that_of_scipy_and_so_is_the_sign_of_the_stiffness(rng, rho):
    """SciPy adds its smoothing to the diagonal of -r, where RS 10 subtracts rho from that of r."""
    q, g = scattered(rng, 200)
    there, _ = scattered(rng, 300)
    expected = RBFInterpolator(q * SCALES, g, kernel="linear", degree=1, smoothing=rho)(there * SCALES)
    # The condition is some 1e5: rounding, 1e-16, leaves ten digits.
    np.testing.assert_allclose(at(grown(q, g, rho).solve(), there), expected, atol=1e-10)


@pytest.mark.parametrize("rho", [0, 0.1])
def test_blocks_of_any_size_give_one_system(rng, rho):
    q, g = scattered(rng, 450)
    whole, parts = grown(q, g, rho).solve(), grown(q, g, rho, 10, 11, 12, 250).solve()
    for name in ("centres", "coefficients", "polynomial"):
        np.testing.assert_allclose(getattr(parts, name), getattr(whole, name), atol=1e-8)
    np.testing.assert_allclose(parts.centres, q, rtol=1e-14)


def test_the_equations_of_rs_10_hold(rng):
    q, g = scattered(rng, 60)
    s = grown(q, g, 0.05, 20).solve()
    P = np.concatenate((np.ones((60, 1)), q * SCALES), axis=1)
    np.testing.assert_allclose(P.T @ s.coefficients, 0, atol=1e-10)
    psi = cdist(q * SCALES, q * SCALES)
    np.testing.assert_allclose((psi - 0.05 * np.eye(60)) @ s.coefficients + P @ s.polynomial, g, atol=1e-10)


def test_a_linear_function_needs_no_radial_ones(rng):
    q, _ = scattered(rng, 50)
    s = grown(q, q @ rng.normal(size=(3, 1)) + 2, 0.1, 30).solve()
    np.testing.assert_allclose(s.coefficients, 0, atol=1e-10)


@pytest.mark.parametrize("rho", [0, 0.1])
def test_candidates_know_their_residuals_before_they_are_centres(rng, rho):
    q, g = scattered(rng, 150)
    system = grown(q[:90], g[:90], rho, 40)
    candidates = system.candidates(q[90:], g[90:])
    np.testing.assert_allclose(candidates.residuals, g[90:] - at(system.solve(), q[90:]), atol=1e-10)
    for j in (7, 31, 0):
        candidates.pick(j)
        system.add(q[90 + j : 91 + j], g[90 + j : 91 + j])
    left = g[90:] - at(system.solve(), q[90:])
    np.testing.assert_allclose(candidates.residuals[candidates.free], left[candidates.free], atol=1e-10)
    assert np.count_nonzero(~candidates.free) == 3


def test_what_is_a_centre_already_is_left_out_where_nothing_is_stiff(rng):
    q, g = scattered(rng, 40)
    system = RadialSystem(SCALES)
    assert system.add(q, g).all()
    expected = system.solve()
    again = np.concatenate((q[:5], q[:1] + 0.01, q[:1] + 0.01))
    assert system.add(again, np.concatenate((g[:5], g[:1], g[:1] + 1))).tolist() == [False] * 5 + [True, False]
    assert system.count == 41 and not system.candidates(q[:3], g[:3]).free.any()
    twice = RadialSystem(SCALES)
    assert np.count_nonzero(twice.add(np.repeat(q, 2, axis=0), np.repeat(g, 2, axis=0))) == 40
    np.testing.assert_allclose(at(twice.solve(), q + 0.1), at(expected, q + 0.1), atol=1e-10)


def test_stiff_centres_may_coincide(rng):
    """Two of stiffness 2 rho at one point are one of stiffness rho with their mean."""
    q, g = scattered(rng, 40)
    twice, once = RadialSystem(SCALES, 0.2), RadialSystem(SCALES, 0.1)
    assert twice.add(np.concatenate((q, q)), np.concatenate((g - 0.3, g + 0.3))).all()
    once.add(q, g)
    np.testing.assert_allclose(at(twice.solve(), q + 0.1), at(once.solve(), q + 0.1), atol=1e-10)


def test_anchors_span_space_well(rng):
    """Among the corners of a cube and points within it, d + 1 corners, whose box of differences is not flat."""
    corners = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
    q = np.concatenate((0.3 * rng.normal(size=(100, 3)).clip(-2, 2), corners)) * [1, 1, 1e-3] + [5, 0, 0]
    chosen = anchors(q)
    assert chosen.min() >= 100
    assert abs(np.linalg.det((q[chosen[1:]] - q[chosen[0]]) / [1, 1, 1e-3])) >= 8


@pytest.mark.parametrize(
    ("bend", "message"),
    [
        (lambda q: np.stack((q[:, 0], q[:, 1], np.full(len(q), 0.3)), axis=-1), "coordinate 2 is constant.*RS 15"),
        (lambda q: np.stack((q[:, 0], q[:, 1], 3 * q[:, 0] + 1), axis=-1), "coordinate [02] is a linear function"),
        (lambda q: q[:3], "3 points do not span 3 dimensions"),
    ],
)
def test_points_in_a_plane_are_refused_with_the_way_out(rng, bend, message):
    q = bend(rng.random((50, 3)))
    with pytest.raises(gn.errors.ArrayError, match=message):
        RadialSystem(np.ones(3)).add(q, np.zeros((len(q), 1)))


def test_without_the_constant_coordinate_they_are_fitted(rng):
    q = rng.random((50, 2))
    g = np.sin(3 * q[:, :1])
    system = RadialSystem(np.ones(2))
    system.add(q, g)
    np.testing.assert_allclose(at(system.solve(), q), g, atol=1e-10)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda q, g: RadialSystem([1, 0, 1]), gn.errors.ParameterError, "scales"),
        (lambda q, g: RadialSystem(SCALES, -0.1), gn.errors.ParameterError, "rho is -0.1"),
        (lambda q, g: RadialSystem(SCALES, 0, 30_000), gn.errors.MemoryLimitError, "30000 centres need 7.2 GB"),
        (lambda q, g: RadialSystem(SCALES).solve(), gn.errors.ArrayError, "no centres yet"),
        (lambda q, g: RadialSystem(SCALES).candidates(q, g), gn.errors.ArrayError, "no centres yet"),
        (lambda q, g: RadialSystem(SCALES).add(q[:, :2], g), gn.errors.ArrayError, r"expected \(b, 3\)"),
        (lambda q, g: RadialSystem(SCALES).add(q, g[:, 0]), gn.errors.ArrayError, r"\(b, C\)"),
        (lambda q, g: RadialSystem(SCALES).add(q, g * np.nan), gn.errors.ArrayError, r"values\[0, 0\]"),
        (lambda q, g: grown(q, g, 0).add(q, g[:, :1]), gn.errors.ArrayError, "1 channels"),
    ],
)
def test_what_cannot_be_a_system_is_refused_by_name(rng, make, error, message):
    q, g = scattered(rng, 20)
    with pytest.raises(error, match=message):
        make(q, g)
