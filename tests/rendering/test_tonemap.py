"""From scene radiance to a display."""

import numpy as np
import pytest

import gonio as gn
from gonio.colour import luminance
from gonio.errors import ArrayError, ParameterError
from gonio.rendering.tonemap import Filmic, Reinhard, clipped, exposure_of

operators = pytest.mark.parametrize("operator", [clipped, Reinhard(), Reinhard(20.0), Filmic(), Filmic(2.0)])


@operators
def test_every_curve_rises_from_black_to_white(operator):
    x = np.concatenate([[0.0], np.geomspace(1e-6, 1e4, 2001)])
    y = gn.tone_map(np.repeat(x[:, None], 3, axis=1), operator)
    assert y[0].tolist() == [0, 0, 0]
    assert y[-1].tolist() == [1, 1, 1]
    # 0 <= y <= 1 and never falling, to rounding of values near 1.
    assert np.all(np.diff(y, axis=0) >= -4e-16)
    dark = x < 0.5
    assert np.all(np.diff(y[dark], axis=0) > 0)


@operators
def test_grey_stays_grey(operator):
    y = gn.tone_map(np.repeat(np.geomspace(1e-3, 1e3, 50)[:, None], 3, axis=1), operator)
    assert np.all(y == y[:, :1])


@operators
def test_saturated_light_stays_in_range(operator, rng):
    y = gn.tone_map(rng.exponential(5.0, (1000, 3)) * np.array([100.0, 1.0, 0.0]), operator)
    assert y.min() >= 0 and y.max() <= 1


@operators
def test_the_brightest_light_that_single_precision_holds_is_white(operator):
    x = np.full((1, 3), np.finfo(np.float32).max)
    with np.errstate(over="ignore"):
        assert gn.tone_map(x, operator, exposure=10.0).tolist() == [[1, 1, 1]]


def test_white_is_the_least_value_shown_as_one():
    for operator in (Reinhard(4.0), Filmic(4.0)):
        y = gn.tone_map(np.array([[3.99] * 3, [4.0] * 3]), operator)
        assert y[0, 0] < 1 and y[1, 0] == pytest.approx(1, abs=1e-15)


def test_curves_take_their_published_values():
    # Hable's x = 1 with W = 11.2, by hand: h(1) = .204 / .71 - .2/3, h(11.2) = 19.38 / 24.476 - .2/3.
    assert gn.tone_map(np.ones(3), Filmic(11.2))[0] == pytest.approx(
        (0.204 / 0.71 - 0.02 / 0.3) / (19.38 / 24.476 - 0.02 / 0.3), rel=1e-14
    )
    # Reinhard's eq. 3 is the limit of eq. 4: x / (1 + x).
    assert gn.tone_map(np.ones(3), Reinhard(1e12))[0] == pytest.approx(0.5, rel=1e-14)


def test_reinhard_maps_luminance_and_keeps_the_ratios_of_channels():
    x = np.array([0.6, 0.3, 0.1])
    y = gn.tone_map(x, Reinhard(4.0))
    np.testing.assert_allclose(y / y[0], x / x[0], rtol=1e-15)
    lum = luminance(x)
    assert luminance(y) == pytest.approx(lum * (1 + lum / 16) / (1 + lum), rel=1e-14)


def test_a_stop_doubles_the_light():
    x = np.array([0.1, 0.2, 0.3])
    np.testing.assert_allclose(gn.tone_map(x, clipped, exposure=1.0), 2 * x, rtol=1e-15)
    np.testing.assert_allclose(gn.tone_map(x, clipped, exposure=-2.0), x / 4, rtol=1e-15)


def test_automatic_exposure_brings_the_log_average_to_middle_grey_whatever_the_scale(rng):
    image = rng.lognormal(0, 1, (40, 30, 3))
    image[0, 0] = 0  # black, of which there is no logarithm
    for scale in (1e-4, 1.0, 1e4):
        exposed = image * scale * 2.0 ** exposure_of(image * scale)
        lit = luminance(exposed)[luminance(exposed) > 0]
        assert np.exp(np.log(lit).mean()) == pytest.approx(0.18, rel=1e-12)
        np.testing.assert_allclose(gn.tone_map(image * scale, exposure=None), gn.tone_map(exposed), rtol=1e-12)


def test_a_black_image_stays_black():
    assert not gn.tone_map(np.zeros((2, 2, 3)), exposure=None).any()


def test_pytorch_gets_the_same_values_and_keeps_its_dtype(rng):
    torch = pytest.importorskip("torch")
    image = rng.exponential(2.0, (8, 9, 3)).astype(np.float32)
    for operator in (clipped, Reinhard(), Filmic()):
        mapped = gn.tone_map(torch.asarray(image), operator, exposure=None)
        assert mapped.dtype == torch.float32
        # Single precision, some ten operations.
        np.testing.assert_allclose(mapped.numpy(), gn.tone_map(image.astype(float), operator, None), atol=2e-6)


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.full((1, 1, 3), np.nan), r"image\[0, 0, 0\] is nan"),
        (np.full((1, 1, 3), -1.0), "negative radiance, down to -1"),
        (np.ones((4, 4)), r"shape \(4, 4\); expected \(\.\.\., 3\)"),
    ],
)
def test_what_is_no_radiance_is_refused(image, message):
    with pytest.raises(ArrayError, match=message):
        gn.tone_map(image)


def test_white_and_exposure_have_their_range():
    for bad in (0.0, -1.0, float("inf"), float("nan")):
        with pytest.raises(ParameterError, match="white must be"):
            Reinhard(bad)
        with pytest.raises(ParameterError, match="white must be"):
            Filmic(bad)
    with pytest.raises(ParameterError, match="exposure must be"):
        gn.tone_map(np.ones(3), exposure=float("inf"))
