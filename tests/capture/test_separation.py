"""Facts about telling diffuse from specular reflection."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn
from gonio.capture.separation import by_colour, by_least_light, by_polarisers

ALBEDO = np.array((0.6, 0.3, 0.1))
COAT = gn.Microfacet(gn.GGX(0.1), gn.Fresnel(1.5))
SITES, LIGHTS = 300, 60


@pytest.fixture
def dome(rng):
    """Lights (1, N, 3) spread over the sky down to 8 degrees, and an eye (sites, 1, 3) for each site."""
    k = np.arange(LIGHTS)
    wi = gn.from_spherical(np.arccos(1 - 0.85 * (k + 0.5) / LIGHTS), 2.39996 * k)
    wo = gn.from_spherical(np.arccos(rng.uniform(0.5, 1, SITES)), rng.uniform(0, 2 * np.pi, SITES))
    return wi[None], wo[:, None]


def seen(brdf, dome):
    """Radiance (sites, N, 3) under beams of irradiance 1, and n.l (sites, N)."""
    wi, wo = dome
    radiance = brdf.f(wi, wo) * wi[..., 2:]
    return np.broadcast_to(radiance, (SITES, LIGHTS, 3)).copy(), np.broadcast_to(wi[..., 2], (SITES, LIGHTS))


def rms(x):
    return np.sqrt(np.mean(np.square(x)))


def test_polarisers_tell_light_that_kept_its_polarisation_from_light_of_all_polarisations(dome):
    specular, _ = seen(COAT, dome)
    diffuse, _ = seen(gn.Lambert(ALBEDO), dome)
    # Malus: cos^2 of the angle passes. Light from within the body comes at all angles, that of the coat at the lamp's.
    angles = np.arange(24) * np.pi / 24
    parallel, crossed = (
        specular * np.cos(turn) ** 2 + diffuse * np.mean(np.cos(angles - turn) ** 2) for turn in (0, np.pi / 2)
    )
    parts = by_polarisers(parallel, crossed)
    assert_allclose(parts.specular, specular, atol=1e-14)
    assert_allclose(parts.diffuse, diffuse, atol=1e-14)
    assert_allclose(parts.diffuse + parts.specular, parallel + crossed, atol=1e-14)
    assert (parts.confidence == 1).all()


def test_confidence_by_polarisers_falls_by_the_relative_noise_of_a_matte_body(rng):
    half, noise = 0.2, 0.01
    parallel, crossed = half + noise * rng.normal(size=(2, 200, 200, 3))
    parts = by_polarisers(parallel, crossed)
    # The mean of the positive part of a normal difference; 120,000 of them tell it to half a per cent.
    expected = np.sqrt(2) * noise / np.sqrt(2 * np.pi) / half
    assert np.mean(1 - parts.confidence) == pytest.approx(expected, rel=0.05)
    assert parts.confidence.min() >= 0
    assert parts.specular.min() == 0


def test_polarisers_trust_no_pixel_that_is_black_unknown_or_seen_by_the_crossed_one_alone():
    crossed = np.array([[0.0, 0, 0], [np.nan, 1, 1], [1, 1, 1], [0, 0, 0], [-1, 0, 0]])
    parallel = np.array([[0.0, 0, 0], [1, 1, 1], [0, 0, 0], [1, 1, 1], [1, 0, 0]])
    parts = by_polarisers(parallel, crossed)
    assert_allclose(parts.confidence, [0, 0, 0, 1, 1])
    assert np.isnan(parts.specular[1, 0]) and np.isnan(parts.diffuse[1, 0])
    assert_allclose(parts.specular[[2, 3, 4]], [[0, 0, 0], [1, 1, 1], [1, 0, 0]])


def test_the_least_light_gives_back_the_albedo_of_a_matte_body_under_a_glossy_coat(dome):
    values, cosines = seen(gn.Lambert(ALBEDO) + COAT, dome)
    specular, _ = seen(COAT, dome)
    for percentile in (0, 20):
        parts = by_least_light(values, cosines, percentile=percentile)
        # What the coat sends away from its highlight stays in k_d: some .002, at most .005, whatever the albedo.
        assert rms(parts.diffuse - ALBEDO) < 0.003
        assert np.abs(parts.diffuse - ALBEDO).max() < 0.005
        assert np.abs(parts.specular - specular).max() < 0.005 / np.pi
        assert np.median(parts.confidence) > 0.8


def test_under_noise_a_percentile_gives_the_albedo_where_the_minimum_is_far_too_low(dome, rng):
    values, cosines = seen(gn.Lambert(ALBEDO) + COAT, dome)
    noisy = values + 0.002 * rng.normal(size=values.shape)  # 3 % of the mean radiance
    least, robust = (by_least_light(noisy, cosines, percentile=percentile) for percentile in (0, 20))
    assert np.mean(least.diffuse - ALBEDO) < -0.03
    assert abs(np.mean(robust.diffuse - ALBEDO)) < 0.01
    assert rms(robust.diffuse - ALBEDO) < 0.2 * rms(least.diffuse - ALBEDO)
    assert np.median(least.confidence) < 0.3
    assert np.median(robust.confidence) > 0.6


def test_shadows_do_not_count_and_half_shadows_do_not_draw_a_percentile_down(dome, rng):
    values, cosines = seen(gn.Lambert(ALBEDO) + COAT, dome)
    passing = rng.permuted(np.tile(np.arange(LIGHTS), (SITES, 1)), axis=1)
    shadowed = np.where((passing < 6)[..., None], 0.001, values)  # stray light, under 2 % of the mean radiance
    for percentile in (0, 20):
        assert rms(by_least_light(shadowed, cosines, percentile=percentile).diffuse - ALBEDO) < 0.003
    half = np.where((passing < 6)[..., None], 0.5 * values, values)
    assert rms(by_least_light(half, cosines).diffuse - ALBEDO) < 0.003
    assert_allclose(by_least_light(half, cosines, percentile=0).diffuse, np.tile(ALBEDO / 2, (SITES, 1)), rtol=0.05)


def test_albedo_and_what_remains_give_back_all_that_is_not_darker_than_the_albedo_alone(dome, rng):
    values, cosines = seen(gn.Lambert(ALBEDO) + COAT, dome)
    values += 0.002 * rng.normal(size=values.shape)
    parts = by_least_light(values, cosines)
    matte = parts.diffuse[:, None] * cosines[..., None] / np.pi
    assert_allclose(matte + parts.specular, np.maximum(values, matte), rtol=1e-12)
    assert parts.specular.min() == 0
    assert parts.diffuse.min() >= 0


def test_the_least_light_is_sure_of_matte_bodies_and_not_of_metals_nor_of_a_single_light(dome):
    values, cosines = seen(gn.Lambert(ALBEDO), dome)
    assert_allclose(by_least_light(values, cosines).confidence, 1)
    metal, _ = seen(gn.Microfacet(gn.GGX(0.4), gn.Schlick(ALBEDO)), dome)
    assert np.quantile(by_least_light(metal, cosines).confidence, 0.9) < 0.3
    values[:, 1:] = np.nan
    parts = by_least_light(values, cosines)
    assert_allclose(parts.diffuse, np.tile(ALBEDO, (SITES, 1)))
    assert_allclose(parts.confidence, 0)


def test_a_percentile_over_the_lights_is_numpys(dome, rng):
    values, cosines = seen(gn.Lambert(ALBEDO) + COAT, dome)
    values[rng.random((SITES, LIGHTS)) < 0.3] = np.nan
    for percentile in (0, 20, 33, 100):
        expected = np.nanpercentile(np.pi * values / cosines[..., None], percentile, axis=1)
        assert_allclose(by_least_light(values, cosines, 0, percentile).diffuse, expected, rtol=1e-12)


def test_unknown_values_and_lights_below_the_horizon_do_not_count(dome):
    values, cosines = seen(gn.Lambert(ALBEDO), dome)
    cosines = cosines.copy()
    values[0] = np.nan
    values[1:, 3] = np.nan
    cosines[1:, 4], values[1:, 4] = -0.5, 0.01
    parts = by_least_light(values, cosines, percentile=0)
    assert np.isnan(parts.diffuse[0]).all() and np.isnan(parts.specular[0]).all()
    assert parts.confidence[0] == 0
    assert_allclose(parts.diffuse[1:], np.tile(ALBEDO, (SITES - 1, 1)))
    assert np.isnan(parts.specular[1:, 3]).all()
    assert_allclose(parts.specular[1:, 4:], 0, atol=1e-15)


def test_highlights_of_the_lights_colour_are_told_from_a_coloured_body(dome):
    light = np.array((1.0, 0.8, 0.6))
    values, _ = seen(gn.Lambert(ALBEDO) + COAT, dome)
    specular, _ = seen(COAT, dome)
    for brightness in (0.1, 10):
        parts = by_colour(light * values, brightness * light)
        # As by the least light, what the coat sends everywhere is taken for the body's.
        assert np.abs(parts.specular - light * specular).max() < 0.002
        assert np.abs(parts.diffuse - light * (values - specular)).max() < 0.002


def test_parts_by_colour_sum_to_the_whole(dome, rng):
    values, _ = seen(gn.Lambert(ALBEDO) + COAT, dome)
    values += 0.01 * rng.normal(size=values.shape)
    values[5, 7, 1] = np.nan
    for some, precision in ((values, 1e-15), (values.astype(np.float32), 1e-7)):
        parts = by_colour(some, (1, 1, 1))
        whole = np.maximum(some, 0)
        whole[5, 7] = np.nan
        assert_allclose(parts.diffuse + parts.specular, whole, atol=precision)
        assert np.nanmin(parts.diffuse) >= 0 and np.nanmin(parts.specular) >= 0
        assert parts.diffuse.dtype == parts.specular.dtype == parts.confidence.dtype == some.dtype


def test_confidence_by_colour_is_the_sine_of_the_angle_between_body_and_light(dome):
    light = gn.normalise(np.array((1.0, 1, 1)))
    for purity in (0.05, 0.3, 1):
        albedo = 0.3 + purity * np.array((0.3, 0, -0.2))
        values, _ = seen(gn.Lambert(albedo), dome)
        sine = np.linalg.norm(np.cross(albedo, light)) / np.linalg.norm(albedo)
        assert_allclose(by_colour(values, light).confidence, sine, rtol=1e-6)


def test_grey_bodies_get_no_confidence_by_colour(dome, rng):
    light = np.array((1.0, 0.8, 0.6))
    values = seen(gn.Lambert(0.4) + COAT, dome)[0] * light
    parts = by_colour(values, light)
    assert (parts.confidence == 0).all()
    assert (parts.specular == 0).all()
    # Noise gives a grey body colours, but none that lie in one plane; a coloured body keeps its own.
    noise = 0.002 * rng.normal(size=values.shape)
    coloured = seen(gn.Lambert(ALBEDO) + COAT, dome)[0] * light
    assert np.quantile(by_colour(values + noise, light).confidence, 0.99) < 0.05
    assert np.quantile(by_colour(coloured + noise, light).confidence, 0.01) > 0.3


def test_one_sample_tells_nothing_by_colour(dome):
    values, _ = seen(gn.Lambert(ALBEDO) + COAT, dome)
    values[:, 1:] = np.nan
    parts = by_colour(values, (1, 1, 1))
    assert (parts.confidence == 0).all()
    assert_allclose(parts.diffuse[:, 0], values[:, 0])
    assert (parts.specular[:, 0] == 0).all()


@pytest.mark.parametrize(("name", "confidence"), [("garnet_red", 0.7), ("krylon_blue", 0.6)])
def test_colour_and_the_least_light_find_the_same_highlights_on_measured_paints(data, dome, name, confidence):
    paint = gn.read_brdf(data / "brdf" / "cornell" / f"{name}.brdf")
    values, cosines = seen(paint, dome)
    colour, least = by_colour(values, (1, 1, 1)), by_least_light(values, cosines)
    assert np.median(colour.confidence) > confidence
    a, b = colour.specular.mean(axis=2), least.specular.mean(axis=2)
    # Two methods that share no assumption: one looks at colours only, the other at the cosine law only.
    assert np.corrcoef(a.ravel(), b.ravel())[0, 1] > 0.97


def test_what_cannot_be_separated_is_refused():
    values, cosines = np.ones((2, 4, 3)), np.ones((2, 4))
    infinite = np.where(np.arange(3) == 1, np.inf, values)
    for call, message in (
        (lambda: by_polarisers(values[0], values), r"parallel has shape \(4, 3\) and crossed \(2, 4, 3\)"),
        (lambda: by_polarisers(cosines, cosines), r"parallel has shape \(2, 4\)"),
        (lambda: by_polarisers(values, infinite), "crossed has infinite"),
        (lambda: by_least_light(values[0], cosines), r"values has shape \(4, 3\)"),
        (lambda: by_least_light(values[:, :0], cosines), r"values has shape \(2, 0, 3\)"),
        (lambda: by_least_light(values, cosines[0]), r"cosines has shape \(4,\)"),
        (lambda: by_least_light(values, np.nan * cosines), "cosines.* is nan"),
        (lambda: by_least_light(values, 2 * cosines), "cosines reach 2"),
        (lambda: by_least_light(values, cosines, floor=1), "floor = 1"),
        (lambda: by_least_light(values, cosines, percentile=101), "percentile = 101"),
        (lambda: by_least_light(infinite, cosines), "values has infinite"),
        (lambda: by_colour(values[..., :1], (1, 1, 1)), r"values has shape \(2, 4, 1\)"),
        (lambda: by_colour(values, (1, 0, 1)), "not three positive"),
        (lambda: by_colour(values, np.ones((4, 3))), "not three positive"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            call()
