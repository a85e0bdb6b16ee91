"""Facts about responses, merged exposures, noise and vignetting."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn
from gonio.capture.exposure import Noise, Response, flat_field, merge, noise_of, recover_response
from gonio.colour import srgb_decode, srgb_encode

TIMES = np.array([1 / 15, 1 / 5, 1, 3, 12])


def scene(rng, size=120):
    """Radiance from 0.004 to 4, as many pixels in each stop."""
    return np.exp(rng.uniform(np.log(0.004), np.log(4), (size, size, 3)))


def sensed(rng, exposure, noise):
    """Electrons counted, read noise added, clipped at full scale."""
    x = rng.poisson(exposure / noise.gain) * noise.gain + noise.read * rng.normal(size=exposure.shape)
    return np.minimum(x, 1)


def coded(exposure, curve, levels=256, dtype=np.uint8):
    return np.floor(curve(np.clip(exposure, 0, 1)) * (levels - 1) + 0.5).astype(dtype)


def bracket(rng, times, noise, bits, radiance):
    """Linear photographs of an even radiance, and what is clipped."""
    x = sensed(rng, np.asarray(times)[:, None, None, None] * np.full((1, 100, 100, 3), radiance), noise)
    x = (np.round(x * (2**bits - 1)) / (2**bits - 1)).astype(np.float32)
    return x, (x >= 1).any(axis=-1)


def test_a_gamma_curve_is_recovered_to_1_percent_of_its_exposure_from_five_brackets(rng):
    codes = coded(scene(rng) * TIMES[:, None, None, None], lambda x: x ** (1 / 2.2))
    response = recover_response(codes, TIMES)
    truth = Response.power(2.2).log_exposure
    # Below code 16, g bends more within a level than smoothness allows.
    assert_allclose(response.log_exposure[16:], np.broadcast_to(truth[16:], (240, 3)), atol=0.01)
    assert (np.diff(response.log_exposure, axis=0) >= 0).all()
    # What is left is rounding: half a code is g' / sqrt(12) = 2.2 / (Z sqrt(12)), weighted.
    assert response.residual < 0.01


def test_srgb_is_recovered_to_2_percent_under_the_noise_of_a_small_sensor(rng):
    noisy = sensed(rng, scene(rng) * TIMES[:, None, None, None], Noise(1 / 20000, 3e-4))
    response = recover_response(coded(noisy, srgb_encode), TIMES)
    assert_allclose(response.log_exposure[16:251] - Response.srgb().log_exposure[16:251], 0, atol=0.02)


def test_pixels_that_are_black_or_clipped_in_every_exposure_tell_nothing(rng):
    codes = coded(scene(rng, 40) * TIMES[:, None, None, None], srgb_encode)
    more = np.concatenate((codes, np.zeros_like(codes[:, :3]), np.full_like(codes[:, :3], 255)), axis=1)
    g = [recover_response(z, TIMES).log_exposure for z in (codes, more)]
    # The picks among equal levels change with the number of pixels.
    assert_allclose(g[1][16:251], g[0][16:251], atol=0.02)


def test_the_order_of_photographs_does_not_matter(rng):
    codes = coded(scene(rng, 40) * TIMES[:, None, None, None], srgb_encode)
    turned = [3, 0, 4, 2, 1]
    g = [recover_response(z, t).log_exposure for z, t in ((codes, TIMES), (codes[turned], TIMES[turned]))]
    assert_allclose(g[1], g[0], atol=1e-9)


def test_codes_of_sixteen_bits_are_recovered_by_1024_levels(rng):
    codes = coded(scene(rng) * TIMES[:, None, None, None], srgb_encode, 65536, np.uint16)
    response = recover_response(codes, TIMES)
    assert response.log_exposure.shape == (1024, 3)
    assert response.step == 64
    z = np.arange(4000, 62000, dtype=np.uint16)
    exposure = response.linear(np.broadcast_to(z[:, None, None], (len(z), 1, 3)))[:, 0]
    assert_allclose(exposure / srgb_decode(z / 65535)[:, None], 1, atol=0.01)


def test_codes_of_a_given_curve_become_its_exposure():
    z = np.arange(256, dtype=np.uint8)[:, None, None]
    assert_allclose(Response.srgb().linear(z), srgb_decode(z / 255), rtol=1e-6)
    assert_allclose(Response.power(1.0, 65536).linear(z.astype(np.uint16) * 257), z / 255, rtol=1e-6)
    three = np.concatenate((z, z, z), axis=-1)
    assert_allclose(Response.power(2.2).linear(three), (three / 255) ** 2.2, rtol=1e-6)
    assert Response.srgb().linear(three).dtype == np.float32
    each = Response(np.log([[0.1, 0.2], [1.0, 2.0]]))
    assert_allclose(each.linear(np.array([[[0, 1], [1, 0]]])), [[[0.1, 2.0], [1.0, 0.2]]], rtol=1e-6)


@pytest.mark.parametrize("radiance", [0.0, 0.003, 0.03, 0.3, 3.0, 30.0])
def test_merged_radiance_is_unbiased_and_its_variance_is_the_one_told(rng, radiance):
    noise = Noise(1 / 20000, 1e-3)
    times = [1 / 60, 1 / 15, 1 / 4, 1]
    x, clipped = bracket(rng, times, noise, 12, radiance)
    merged = merge(x, times, clipped, noise)
    off = merged.radiance - radiance
    told = np.sqrt(merged.variance.mean())
    # 30,000 samples: the mean is known to 0.6 % of a standard deviation, that to 0.4 %. 12 bits add little.
    assert abs(off.mean()) < 0.025 * told
    assert off.std() == pytest.approx(told, rel=0.02)
    assert not merged.saturated.any()


@pytest.mark.parametrize("radiance", [0.03, 0.9])
def test_weights_of_noise_beat_a_hat_where_the_longest_exposure_is_dark_or_bright(rng, radiance):
    noise, times = Noise(1 / 20000, 1e-3), np.array([1 / 60, 1 / 15, 1 / 4, 1])
    x, clipped = bracket(rng, times, noise, 12, radiance)
    hat = np.maximum(1 - np.abs(2 * x - 1), 0)
    by_hat = (hat * x / times[:, None, None, None]).sum(axis=0) / hat.sum(axis=0)
    # The hat gives little weight to what is near black or white, though the longest exposure is the least noisy there.
    assert by_hat.std() > 1.5 * merge(x, times, clipped, noise).radiance.std()


def test_in_the_dark_the_longest_exposure_counts_even_without_read_noise():
    x = np.zeros((2, 4, 4, 3))
    x[0] = 1e-5
    merged = merge(x, [0.01, 1.0], np.zeros((2, 4, 4), bool), Noise(1e-4, 0.0))
    # Weights by t^2: 1e-5 / 0.01 counts for 1e-4.
    assert_allclose(merged.radiance, 1e-3 * 1e-4, rtol=1e-3)


def test_a_pixel_clipped_everywhere_is_marked_and_has_what_the_shortest_exposure_says():
    times = np.array([1.0, 0.25])
    truth = np.full((3, 4, 3), 0.8)
    truth[1, 2] = (9.0, 2.0, 9.0)
    x = np.minimum(truth * times[:, None, None, None], 1)
    merged = merge(x, times, (x >= 1).any(axis=-1))
    assert_allclose(np.argwhere(merged.saturated), [[1, 2]])
    assert_allclose(merged.radiance[1, 2], (4.0, 2.0, 4.0))
    assert np.isinf(merged.variance[1, 2]).all()
    assert_allclose(merged.radiance[~merged.saturated], 0.8, rtol=1e-6)
    assert np.isfinite(merged.variance[~merged.saturated]).all()


def test_photographs_that_are_read_one_by_one_merge_as_those_in_memory(rng):
    times = [0.1, 1.0]
    x, clipped = bracket(rng, times, Noise(), 12, 0.7)

    class OneByOne:
        def __init__(self, held):
            self.held = held

        def __iter__(self):
            return (self.held[k] for k in range(len(self.held)))

    held, read = merge(x, times, clipped), merge(OneByOne(x), times, OneByOne(clipped))
    assert_allclose(read.radiance, held.radiance, rtol=0)
    assert_allclose(read.variance, held.variance, rtol=0)


@pytest.mark.parametrize("noise", [Noise(1 / 20000, 1e-3), Noise(1 / 5000, 5e-3), Noise(1 / 40000, 2e-4)])
@pytest.mark.parametrize("count", [2, 10])
def test_photon_transfer_gives_back_gain_and_read_noise(rng, noise, count):
    radiance = np.linspace(0, 1, 200 * 200 * 3).reshape(200, 200, 3) ** 2.2
    x = np.stack([sensed(rng, radiance, noise) for _ in range(count)])
    x = np.round(x * 16383) / 16383
    # One pixel in 50 flickers.
    x = np.where(rng.random(radiance.shape) < 0.02, rng.random(x.shape), x)
    found = noise_of(x)
    assert found.gain == pytest.approx(noise.gain, rel=0.05)
    assert found.read == pytest.approx(noise.read, rel=0.05)


@pytest.mark.parametrize("corner", [25, 40])
def test_a_cos4_vignette_is_recovered_to_half_a_percent_under_dust_tilt_and_noise(rng, corner):
    """The corner is seen at so many degrees: 0.67 and 0.34 of the centre."""
    y, x = np.meshgrid(np.arange(240) - 119.5, np.arange(320) - 159.5, indexing="ij")
    f = np.hypot(120, 160) / np.tan(np.radians(corner))
    vignette = np.cos(np.arctan(np.hypot(x, y) / f)) ** 4
    white = 0.8 * vignette * (1 + 0.1 * x / 160)
    white = np.where(rng.random(white.shape) < 0.2, white * rng.uniform(0, 0.9, white.shape), white)
    white = white + 0.01 * np.sqrt(white) * rng.normal(size=white.shape)
    found = flat_field(white[..., None] * [1, 0.5, 2])
    assert found.shape == (240, 320, 3)
    assert_allclose(found / (vignette / vignette.max())[..., None], 1, atol=0.005)
    assert_allclose(found.max(axis=(0, 1)), 1)


def test_an_even_photograph_is_divided_by_one():
    assert_allclose(flat_field(np.full((20, 30, 1), 7.0)), 1, rtol=1e-6)


def test_brackets_that_tell_no_response_are_refused(rng):
    radiance = scene(rng, 60)
    codes = coded(radiance * TIMES[:, None, None, None], srgb_encode)
    for z, times, message in (
        (codes[0], TIMES, "codes have shape"),
        (codes.astype(np.float32), TIMES, "float32"),
        (codes, TIMES[:3], "5 photographs, but 3 times"),
        (codes, -TIMES, "not all positive"),
        (codes, TIMES[:, None], "times have shape"),
        (codes[:2], [0.5, 0.5], "times are all 0.5 s"),
        (codes, TIMES[::-1], "codes fall as the time grows"),
        (np.stack([np.roll(z, 3 * k, axis=1) for k, z in enumerate(codes)]), TIMES, "codes fall"),
        (np.full_like(codes, 255), TIMES, "cover 0% of the codes"),
        (np.maximum(codes, 200), TIMES, "of the codes"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            recover_response(z, times)


def test_a_scene_that_shifts_by_pixels_is_refused(rng):
    smooth = np.exp(2.5 * np.sin(np.arange(120) / 4)[:, None, None] * np.cos(np.arange(120) / 5)[None, :, None])
    still = [np.full((1, 1, 3), 0.2) * smooth] * 5
    moving = [np.roll(still[0], 2 * k, axis=1) for k in range(5)]
    recover_response(np.stack([coded(x * t, srgb_encode) for x, t in zip(still, TIMES, strict=True)]), TIMES)
    with pytest.raises(gn.GonioError, match="moved"):
        recover_response(np.stack([coded(x * t, srgb_encode) for x, t in zip(moving, TIMES, strict=True)]), TIMES)


def test_responses_and_codes_that_do_not_fit_are_refused():
    for make, message in (
        (lambda: Response(np.zeros(256)), "is wanted"),
        (lambda: Response([[0.0], [-1.0]]), "falls from level 0 to 1 of channel 0"),
        (lambda: Response([[0.0], [np.nan]]), "NaN"),
        (lambda: Response([[0.0], [1.0]], step=0), "step = 0"),
        (lambda: Response.power(0.0), "gamma = 0"),
        (lambda: Response.srgb(1), "levels = 1"),
        (lambda: Response.srgb().linear(np.zeros((2, 2, 3))), "float64"),
        (lambda: Response.srgb().linear(np.zeros((2, 2), np.uint8)), "codes have shape"),
        (lambda: Response.srgb().linear(np.full((2, 2, 3), 256)), "knows 0 to 255"),
        (lambda: Response(np.zeros((4, 3))).linear(np.zeros((2, 2, 1), np.uint8)), "codes have shape"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            make()


def test_photographs_that_cannot_be_merged_are_refused():
    x, out = np.full((2, 4, 5, 3), 0.5), np.zeros((2, 4, 5), bool)
    for exposures, times, clipped, message in (
        (x, [1.0, 0.0], out, "not all positive"),
        (x, [1.0, 2.0, 3.0], out, "3 times, but 2 photographs"),
        (x, [1.0], out, "not of the same number"),
        (x, [1.0, 2.0], out[:1], "not of the same number"),
        (iter(x), [1.0, 2.0], out, "exposures can be gone through once only"),
        (x, [1.0, 2.0], iter(out), "clipped can be gone through once only"),
        (x[0], [1.0, 2.0], out, "exposures"),
        ([x[0], x[1, :2]], [1.0, 2.0], out, r"exposures\[1\] has shape \(2, 5, 3\)"),
        (x, [1.0, 2.0], out[:, :2], r"clipped\[0\] has shape"),
        (x, [1.0, 2.0], out.astype(float), r"clipped\[0\] .* float64"),
        (np.where(x > 0, np.nan, x), [1.0, 2.0], out, r"exposures\[0\]\[0, 0, 0\] is nan"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            merge(exposures, times, clipped)


def test_photographs_that_tell_no_noise_or_vignette_are_refused(rng):
    ramp = np.linspace(0, 1, 3000).reshape(1, 30, 100, 1)
    for make, message in (
        (lambda: Noise(0.0, 1e-3), "gain must be positive"),
        (lambda: Noise(1e-4, -1.0), "read not negative"),
        (lambda: noise_of(ramp), "two or more"),
        (lambda: noise_of(np.repeat(ramp, 3, axis=0)), "does not grow"),
        (lambda: noise_of(0.5 + 0.01 * rng.normal(size=(3, 30, 100, 1))), "means below 0.9 run from 0.4"),
        (lambda: noise_of(2 + 0.01 * rng.normal(size=(3, 30, 100, 1))), "nowhere"),
        (lambda: noise_of(ramp + 0.05 * (1 - ramp) * rng.normal(size=(4, 30, 100, 1))), "does not grow"),
        (lambda: flat_field(np.ones((30, 30))), "white has shape"),
        (lambda: flat_field(np.ones((4, 30, 3))), "white has shape"),
        (lambda: flat_field(np.zeros((30, 30, 1))), "not positive"),
        (lambda: flat_field(np.full((30, 30, 1), np.inf)), "white"),
        (lambda: flat_field(rng.uniform(0.1, 1, (30, 30, 1))), "no photograph of an even target"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            make()
