"""Facts about windows against ringing, and about the minimum of a series over the sphere."""

import numpy as np
import pytest
from scipy.optimize import minimize

import gonio as gn
from gonio.rendering.deringing import dering, hanning, lanczos, minimum
from gonio.sphere.harmonics import degrees_and_orders
from gonio.sphere.zonal import clamped_cosine, convolve, values

LAMP = gn.normalise([0.3, -0.5, 0.7])


@pytest.fixture(scope="module")
def everywhere():
    """Directions .9 degrees apart."""
    return gn.LatLong(200, 400).directions().reshape(-1, 3)


def series(rng, degree, channels=3):
    """Random coefficients that fall off, around a positive mean, as those of lights do."""
    l, _ = degrees_and_orders(degree)
    f = rng.normal(size=(len(l), channels)) / (1 + l[:, None])
    f[0] = 1 + abs(f[0])
    return f


def lamp(degree):
    """Irradiance of a lamp of unit strength towards LAMP, to `degree`."""
    return convolve(gn.harmonics(degree, LAMP), clamped_cosine(degree))


def lamp_error(window):
    """rms over all normals of the windowed irradiance of a lamp against max(n.l, 0)."""
    u, weight = np.polynomial.legendre.leggauss(400)
    off = values(clamped_cosine(len(window) - 1) * window, u) - np.maximum(u, 0)
    return np.sqrt((weight * off**2).sum() / 2)


@pytest.mark.parametrize("window", [hanning, lanczos])
def test_windows_fall_from_one_to_zero_at_their_width(window):
    w = window(8, 6.5)
    assert w[0] == 1 and np.all(np.diff(w[:7]) < 0) and np.all(w[7:] == 0)
    # 1 - (pi l / width)^2 / 4 or / 6: nothing is left of either at a thousand times the degree.
    np.testing.assert_allclose(window(8, 8000.0), 1, atol=3e-6)


def test_windows_have_the_values_of_their_definitions():
    np.testing.assert_allclose(hanning(4, 4.0), [1, (1 + np.sqrt(0.5)) / 2, 0.5, (1 - np.sqrt(0.5)) / 2, 0], atol=1e-15)
    np.testing.assert_allclose(lanczos(2, 4.0), [1, np.sqrt(8) / np.pi, 2 / np.pi], atol=1e-15)


@pytest.mark.parametrize("width", [0.0, -1.0, np.nan, np.inf])
def test_a_width_that_is_none_is_refused(width):
    with pytest.raises(gn.GonioError, match="width"):
        hanning(2, width)


@pytest.mark.parametrize("degree", [0, 1, 2])
def test_the_minimum_to_degree_two_is_the_global_one(rng, everywhere, degree):
    f = rng.normal(size=((degree + 1) ** 2, 20))
    least, n = minimum(f)
    np.testing.assert_allclose(np.sum(gn.harmonics(degree, n) * f.T, axis=-1), least, atol=1e-14)
    brute = gn.harmonics(degree, everywhere) @ f
    for k in range(20):

        def at(w, k=k):
            return float(gn.harmonics(degree, gn.normalise(w)) @ f[:, k])

        refined = minimize(at, everywhere[brute[:, k].argmin()], tol=1e-14).fun
        # SciPy's gradients by differences stop within 1e-8 of the place: 1e-15 in the value, more where it gives up.
        assert least[k] == pytest.approx(refined, abs=1e-10) and least[k] <= refined + 1e-14


@pytest.mark.parametrize(
    ("f", "least"),
    [
        # z^2 and -z^2: a ring and two poles of minima; no linear term picks one of them.
        ([0, 0, 0, 0, 0, 0, 1, 0, 0], -np.sqrt(5 / (16 * np.pi))),
        ([0, 0, 0, 0, 0, 0, -1, 0, 0], -2 * np.sqrt(5 / (16 * np.pi))),
        # x with -z^2: the linear term is orthogonal to the lowest eigenvector, the hard case of trust regions.
        # In units of sqrt(5 / 16 pi): 1 - 3 z^2 + t x, least where x = -t / 6, at -2 - t^2 / 12.
        (
            [0, 0, 0, 0.6 * np.sqrt(5 / 16 / np.pi) / np.sqrt(3 / 4 / np.pi), 0, 0, -1, 0, 0],
            -2.03 * np.sqrt(5 / 16 / np.pi),
        ),
        ([2, 0, 0, 0, 0, 0, 0, 0, 0], 1 / np.sqrt(np.pi)),
    ],
)
def test_the_minimum_stands_where_several_places_share_it(f, least):
    value, n = minimum(np.array(f, float))
    assert value == pytest.approx(least, abs=1e-14)
    assert gn.harmonics(2, n) @ f == pytest.approx(least, abs=1e-14)


@pytest.mark.parametrize("degree", [3, 5, 8])
def test_the_minimum_of_higher_degrees_is_below_every_sample(rng, everywhere, degree):
    f = series(rng, degree)
    least, n = minimum(f)
    brute = gn.harmonics(degree, everywhere) @ f
    # Samples .011 from the minimum at most: f rises by degree^2 times half its range times .011^2 / 2.
    above = brute.min(axis=0) - least
    assert np.all(above >= -1e-12) and np.all(above < degree**2 * 6e-5 * np.ptp(brute, axis=0) / 2 + 1e-12)
    np.testing.assert_allclose(np.sum(gn.harmonics(degree, n) * f.T, axis=-1), least, atol=1e-13)


def test_the_minimum_of_a_polynomial_in_z_is_that_of_one_variable():
    """A ring of minima, at no vertex or edge of anything: P_4 has them at z^2 = 3/7, of value -3/7."""
    f = np.zeros(25)
    f[20] = np.sqrt(4 * np.pi / 9)
    value, n = minimum(f)
    assert value == pytest.approx(-3 / 7, abs=1e-12)
    assert n[2] ** 2 == pytest.approx(3 / 7, abs=1e-5)


@pytest.mark.parametrize("degree", [0, 1, 2, 4])
def test_a_positive_series_is_left_as_it_is(rng, degree):
    f = series(rng, degree)
    f[0] = 20
    deringed = dering(f)
    assert np.array_equal(deringed.coefficients, f) and np.array_equal(deringed.window, np.ones(degree + 1))


@pytest.mark.parametrize("degree", [1, 2, 3, 5])
def test_a_deringed_series_is_nowhere_negative_and_keeps_its_mean(rng, everywhere, degree):
    f = series(rng, degree)
    f[1] += 2  # negative somewhere
    deringed = dering(f)
    assert np.all(deringed.coefficients[0] == f[0])
    np.testing.assert_array_equal(deringed.coefficients, convolve(f, deringed.window))
    assert deringed.window.min() >= 0 and deringed.window.max() <= 1 and deringed.window.min() < 1
    assert (gn.harmonics(degree, everywhere) @ deringed.coefficients).min() >= 0
    assert minimum(deringed.coefficients)[0].min() >= 0


@pytest.mark.parametrize(("degree", "slack"), [(1, 1e-8), (2, 1e-8), (4, 1e-3)])
def test_a_weaker_window_leaves_the_series_negative(rng, degree, slack):
    """Mixed with no window by `slack`, which is above the 1e-9 of degree 2 or the 1e-5 of the range of higher ones."""
    f = series(rng, degree)
    f[1] += 2
    window = dering(f).window
    weaker = convolve(f, window + slack * (1 - window))
    assert minimum(weaker)[0].min() < 0


def test_no_other_window_changes_less(rng):
    """Of random windows that leave nothing negative, and of the families of one parameter, none is closer."""
    f = series(rng, 2)
    f[3] -= 2
    power = gn.power_spectrum(f).sum(axis=1)

    def change(window):
        return ((1 - window) ** 2 * power).sum()

    best = change(dering(f).window)
    tried = [np.append(1, rng.uniform(size=2)) for _ in range(400)]
    tried += [family(2, width) for family in (hanning, lanczos) for width in np.geomspace(1.01, 100, 50)]
    allowed = [w for w in tried if minimum(convolve(f, w))[0].min() >= 0]
    assert len(allowed) > 30
    # The search stops at -1e-9 of the mean.
    assert min(change(w) for w in allowed) >= best * (1 - 1e-8)


def test_the_irradiance_of_a_lamp_loses_a_quarter_of_what_other_windows_take():
    f = lamp(2)
    assert minimum(f)[0] == pytest.approx(3 / 32 - 2 / 15, abs=1e-14)  # of 3/32 + u/2 + 15/32 u^2, at u = -8/15
    ours = dering(f).window
    # The best w_1 of a w_2 has the minimum 1/4 - 5/32 w_2 - 2/15 w_1^2 / w_2 = 0; (1 - w_1)^2 13.2 + (1 - w_2)^2 3.08
    # is least at these two.
    np.testing.assert_allclose(ours, [1, 0.85789, 0.90940], atol=1e-5)
    assert 1 / 4 - 5 / 32 * ours[2] - 2 / 15 * ours[1] ** 2 / ours[2] == pytest.approx(0, abs=1e-8)
    assert lamp_error(ours) == pytest.approx(0.0561, abs=1e-4)
    for family in (hanning, lanczos):
        windows = [family(2, width) for width in np.geomspace(1.01, 100, 100)]
        allowed = [w for w in windows if minimum(convolve(f, w))[0] >= 0]
        assert min(lamp_error(w) for w in allowed) > 0.2


def test_one_window_serves_all_channels(rng):
    f = series(rng, 2, 1)
    f[2] += 3
    both = np.concatenate((f, np.eye(9)[:, :1]), axis=1)
    np.testing.assert_allclose(dering(both).window, dering(f[:, 0]).window, atol=1e-8)


def test_black_channels_stay_black():
    f = np.stack((lamp(2), np.zeros(9)), axis=-1)
    deringed = dering(f)
    assert np.all(deringed.coefficients[:, 1] == 0) and minimum(deringed.coefficients)[0].min() >= 0


def test_a_channel_without_positive_mean_is_refused():
    f = np.zeros((9, 3))
    f[0, :2] = 1
    f[1, 2] = 1
    with pytest.raises(gn.GonioError, match=r"coefficients\[0, 2\] = 0"):
        dering(f)


@pytest.mark.parametrize("f", [np.zeros(5), np.zeros((4, 3, 1)), np.array([1, np.nan, 0, 0])])
def test_what_is_no_series_is_refused(f):
    with pytest.raises(gn.GonioError, match="coefficients"):
        minimum(f)
    with pytest.raises(gn.GonioError, match="coefficients"):
        dering(f)


def test_single_precision_is_kept_and_stays_above_zero_to_its_rounding(everywhere):
    f = lamp(2).astype(np.float32)
    deringed = dering(f)
    assert deringed.coefficients.dtype == np.float32 and minimum(f)[0].dtype == np.float32
    assert (gn.harmonics(2, everywhere) @ deringed.coefficients.astype(np.float64)).min() >= 0


def test_tensors_are_answered_with_tensors(rng):
    torch = pytest.importorskip("torch")
    f = series(rng, 2)
    f[1] += 2
    tensor = torch.tensor(f, requires_grad=True)
    least, n = minimum(tensor)
    np.testing.assert_allclose(least.detach().numpy(), minimum(f)[0], atol=1e-14)
    # The gradient of a minimum is that of the function where it stands.
    (gradient,) = torch.autograd.grad(least[1], tensor)
    np.testing.assert_allclose(gradient[:, 1].numpy(), gn.harmonics(2, n[1].numpy()), atol=1e-14)
    deringed = dering(tensor)
    assert isinstance(deringed.coefficients, torch.Tensor)
    np.testing.assert_allclose(deringed.coefficients.detach().numpy(), dering(f).coefficients, atol=1e-14)
