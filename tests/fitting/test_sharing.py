"""Reflectance sharing: what it predicts of photographs that it has not seen, and what it does with poor samples."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn
from gonio.brdf.combine import Scaled
from gonio.brdf.radial import Radial
from gonio.capture.photographs import Held
from gonio.capture.simulation import from_above
from gonio.fitting import collecting, sharing
from gonio.fitting.albedo import albedo_of
from gonio.fitting.centres import choose_centres
from gonio.fitting.sharing import Scales, share_reflectance
from gonio.fitting.smoothing import smoothed
from gonio.samples import ReflectanceSamples

PLASTIC = gn.Lambert([0.5, 0.3, 0.2]) + gn.Microfacet(gn.GGX(0.35), gn.Fresnel(1.5))
SCALES = Scales(0.3, 0.5)
PAPERS = {"logarithm": False, "folded": False, "smooth": False}


def dome(count):
    """Irradiance pi from `count` directions down to 66 degrees."""
    k = np.arange(count) + 0.5
    return gn.distant_lights(
        gn.from_spherical(np.arccos(1 - 0.6 * k / count), k * np.pi * (3 - np.sqrt(5))), np.full(count, np.pi)
    )


def photographed(lights, made=lambda x, y: PLASTIC, size=32):
    """A sphere, seen from above, whose material is `made` of the places (S,), (S,), in radii, of its sites."""
    camera = from_above(gn.Sphere(), size)
    capture = gn.simulate(gn.Sphere(), gn.Lambert(0.5), lights, camera)
    sites, wo = capture.sites, capture.observe(0).wo
    images = np.zeros((len(lights), *camera.size, 3))
    for image, light in zip(images, lights, strict=True):
        image[capture.mask] = gn.radiance(made(*sites.positions[:, :2].T), light, sites.frames, wo)
    return dataclasses.replace(capture, photographs=Held(images))


def places(capture):
    return (capture.sites.positions[:, :2] + 1) / 2


def error(capture, material, k):
    """Relative rms of photograph k, relit."""
    thing = gn.Relightable(capture.view, capture.textures(material))
    image, photograph = gn.relight(thing, capture.lights[k]), capture.photographs.read(k).radiance
    return float(np.sqrt(np.mean((image - photograph) ** 2) / np.mean(photograph**2)))


def left(material, blocks):
    """The relative rms of radiance at samples, of one material everywhere."""
    off, value = (
        np.concatenate([b.wi[:, 2:] * x for b, x in zip(blocks, some, strict=True)])
        for some in ([material.f(b.wi, b.wo) - b.value for b in blocks], [b.value for b in blocks])
    )
    return np.sqrt(np.mean(off**2) / np.mean(value**2))


def left_over_sites(material, blocks):
    """The same, of a material that varies."""
    off = total = 0.0
    for b in blocks:
        here = gn.reflection.varied(material, lambda value, axes, site=b.site: value[site])
        off += np.sum((b.wi[:, 2:] * (here.f(b.wi, b.wo) - b.value)) ** 2)
        total += np.sum((b.wi[:, 2:] * b.value) ** 2)
    return np.sqrt(off / total)


def changed(blocks, change):
    return [dataclasses.replace(b, value=change(b.value)) for b in blocks]


@pytest.fixture(scope="module")
def ball():
    """Twelve photographs, 48 x 48, of one plastic everywhere."""
    return photographed(dome(12), size=48)


@pytest.fixture(scope="module")
def blocks(ball):
    return list(ball.select([0, 1, 3, 4, 6, 8, 9, 11]).reflectance())


def test_eight_photographs_of_one_material_predict_four_others(ball, blocks):
    fit = share_reflectance(blocks, centres=200, scales=SCALES)
    # 600 centres leave .0044 of a measured material; 200 leave .001 of a smooth model.
    assert max(error(ball, fit.value.material, k) for k in (2, 5, 7, 10)) < 0.004
    assert fit.residual < 0.004
    assert not fit.converged and "200" in fit.reason
    assert fit.value.sites.tolist() == [True]


def test_scales_are_found_by_leaving_photographs_out():
    capture = photographed(dome(6), size=12)
    fit = share_reflectance(capture.select([0, 1, 2, 4, 5]).reflectance(), centres=100)
    assert fit.value.scales != Scales() and fit.value.scales.space == Scales.space
    assert error(capture, fit.value.material, 3) < 0.01


def test_pixels_tell_each_other_what_one_alone_cannot_know():
    def rough(x, y):
        return gn.Lambert([0.4, 0.3, 0.2]) + gn.Microfacet(gn.GGX(0.3 + 0.15 * x), gn.Fresnel(1.5))

    capture = photographed(dome(6), rough)
    kept = capture.select([0, 1, 2, 4, 5])
    fit = share_reflectance(kept.reflectance(), places(capture), centres=400, scales=Scales(0.2, 0.5))
    alone = np.zeros((len(capture.sites), 3))
    for site in range(len(alone)):
        slices = kept.reflectance().at(np.array([site]))
        light, value = slices.wi[0, :, 2:] * (slices.weight[0, :, None] > 0), np.nan_to_num(slices.value[0])
        alone[site] = np.pi * np.sum(light**2 * value, axis=0) / np.maximum(np.sum(light**2), 1e-9)
    shared, each = (error(capture, material, 3) for material in (fit.value.material, gn.Lambert(alone.clip(0, 1))))
    # A matte surface has no highlight, and what five photographs tell of it moves the albedo.
    assert shared < 0.03
    assert each > 5 * shared
    assert fit.value.sites.all()


def test_colours_of_their_own_are_told_from_what_is_shared():
    def checkered(x, y):
        dark = (np.floor(4 * x) + np.floor(4 * y)) % 2
        return gn.Lambert(np.where(dark[:, None], [0.1, 0.05, 0.2], [0.6, 0.4, 0.3])) + gn.Microfacet(
            gn.GGX(0.6), gn.Fresnel(1.5)
        )

    capture = photographed(dome(8), checkered)
    errors = []
    for texture in (False, True):
        fit = share_reflectance(
            capture.select([0, 1, 2, 3, 4, 6, 7]).reflectance(),
            places(capture),
            centres=300,
            scales=SCALES,
            texture=texture,
        )
        errors.append(error(capture, fit.value.material, 5))
    # 300 centres cannot draw 64 squares. With colours given the gloss still goes by the square, not by its colour.
    assert errors[1] < 0.04
    assert errors[0] > 10 * errors[1]


def test_regions_keep_what_lies_beside_them_out():
    def halves(x, y):
        gloss = gn.Microfacet(gn.GGX(0.25), gn.Fresnel(1.5))
        return gn.Lambert([0.4, 0.3, 0.2]) + Scaled(gloss, np.where(x > 0, 1.0, 0.1)[:, None])

    capture = photographed(dome(8), halves)
    kept, at = capture.select([0, 1, 2, 3, 4, 6, 7]), places(capture)
    right = (capture.sites.positions[:, 0] > 0).astype(int)
    fits = [
        share_reflectance(kept.reflectance(), at, centres=300, scales=SCALES, regions=regions)
        for regions in (None, right)
    ]
    off = [error(capture, fit.value.material, 5) for fit in fits]
    # What bends sharply is drawn by many centres or not at all; two smooth halves by few.
    assert off[1] < 0.03
    assert off[0] > 2 * off[1]
    assert fits[1].history[-1][0] == 300
    assert fits[1].residual == pytest.approx(left_over_sites(fits[1].value.material, kept.reflectance()), rel=1e-6)
    one_each = share_reflectance(kept.reflectance(), None, centres=200, scales=SCALES, regions=right)
    # Each half is one material.
    assert error(capture, one_each.value.material, 5) < 0.01


def test_a_colour_is_what_is_left_when_the_highlight_is_known():
    def tone(x, y):
        return np.where((np.floor(6 * x) + np.floor(6 * y)) % 2, 0.3, 0.6)[:, None]

    gloss = gn.Lambert(0.3) + 8 * gn.Microfacet(gn.GGX(0.5), gn.Fresnel(1.5))
    capture = photographed(dome(5), lambda x, y: Scaled(gloss, tone(x, y) * [1.0, 0.7, 0.5]))
    nowhere = np.zeros(len(capture.sites), int)
    fit = share_reflectance(capture.reflectance(), regions=nowhere, centres=150, scales=SCALES, texture=True)
    table = collecting.collected(capture.reflectance(), None, 0)
    truth = tone(*capture.sites.positions[:, :2].T)
    spread = []
    for albedo in (albedo_of(table, len(truth)), fit.value.material.factor):
        ratio = albedo[:, 0] / truth[:, 0]
        spread.append(np.std(ratio) / np.mean(ratio))
    # Which light shines in the gloss goes by the site; what is shared was fitted with colours that did not know it.
    assert spread[0] > 0.1
    assert spread[1] < 0.7 * spread[0]


def test_one_material_everywhere_becomes_a_reflection_map(ball):
    """What was shared is prefiltered as any isotropic BRDF: look-ups agree with sums over the light."""
    material = share_reflectance(ball.reflectance(), centres=120, scales=SCALES).value.material
    theta, phi = (np.arange(32) + 0.5) * np.pi / 32, np.arange(64) * np.pi / 32
    sky = 1 + np.cos(theta)[:, None] * np.sin(phi) + 0.6 * np.sin(2 * theta)[:, None]
    room = gn.Environment(np.clip(sky, 0, None)[..., None] * [1.0, 0.8, 0.6])
    camera = gn.Pinhole.look_at((0, -4, 1), (0, 0, 0), 30, (24, 24))
    quick = gn.render_prefiltered(gn.Sphere(), gn.prefilter(room, material, 0.02), camera)
    slow = gn.render(gn.Sphere(), material, room, camera, background=False)
    inside = slow.max(axis=2) > 0.2 * slow.max()
    # Photographs end some way from the rim, whose reflection is no smooth function: twice the error asked for.
    assert np.sqrt(np.mean((quick - slow)[inside] ** 2) / np.mean(slow[inside] ** 2)) < 0.04


def test_confidence_falls_as_the_error_grows_beyond_the_photographs(ball):
    from_45 = [k for k in range(12) if ball.directions[k, 2] > 0.8]
    material = share_reflectance(ball.select(from_45).reflectance(), centres=200, scales=SCALES).value.material
    trusted, wrong = [], []
    for theta_d in (10, 25, 50, 65, 80):
        wi, to_eye = gn.from_half_difference(np.linspace(0, 0.3, 40), 0.0, np.radians(theta_d), np.pi / 2)
        trusted.append(np.mean(material.confidence(wi, to_eye)))
        truth = PLASTIC.f(wi, to_eye)
        wrong.append(np.sqrt(np.mean((material.f(wi, to_eye) - truth) ** 2) / np.mean(truth**2)))
    # Photographs end where theta_d is some 18 degrees.
    assert trusted[0] > 0.95
    assert wrong[0] < 0.02
    assert np.all(np.diff(trusted) <= 0)
    assert np.all(np.diff(wrong) > 0)
    assert trusted[-1] < 0.3 and wrong[-1] > 0.7
    assert np.all(PLASTIC.confidence(wi, to_eye) == 1)


def test_one_photograph_shows_one_difference_angle_and_leaves_it_out(ball):
    fit = share_reflectance(ball.select([1]).reflectance(), centres=60)
    assert isinstance(fit.value.material, Radial)
    assert fit.value.material.flat
    assert fit.value.material.interpolant.centres.shape == (60, 2)
    assert fit.value.scales == Scales(stiffness=sharing._STIFF)
    assert fit.residual < 0.02
    assert not share_reflectance(ball.select([1, 2]).reflectance(), centres=30, scales=SCALES).value.material.flat


def test_as_the_paper_has_it_f_is_interpolated_at_the_centres(blocks):
    fit = share_reflectance(blocks, centres=150, scales=Scales(0.3, 0.5, 0.0), **PAPERS)
    material = fit.value.material
    assert not (material.logarithm or material.folded)
    q = np.concatenate([b.uvw for b in blocks])
    value = np.concatenate([b.value for b in blocks])
    here = (material.interpolant.centres[:, None] == q).all(axis=2)
    assert here.any(axis=1).all()
    # Evaluation is in single precision.
    assert_allclose(
        material.interpolant(material.interpolant.centres), value[here.argmax(axis=1)], atol=1e-5 * value.max()
    )


def test_noise_is_smoothed_and_not_interpolated(blocks, rng):
    noisy = changed(blocks, lambda f: f * rng.lognormal(0, 0.1, f.shape))
    smooth, through = (
        left(share_reflectance(noisy, centres=150, scales=Scales(0.3, 0.5, 0.1), smooth=s).value.material, blocks)
        for s in (True, False)
    )
    # 150 coefficients of 10,000 samples: of a tenth of noise sqrt(150 / 10,000) is left. The worst samples are centres.
    assert smooth < 0.025
    assert through > 2.5 * smooth


def test_samples_that_are_far_too_bright_do_not_pull_a_smooth_fit(blocks, rng):
    spoilt = changed(blocks, lambda f: f * np.where(rng.random(len(f)) < 0.05, 10, 1)[:, None])
    smooth, through = (
        left(share_reflectance(spoilt, centres=150, scales=Scales(0.3, 0.5, 0.1), smooth=s).value.material, blocks)
        for s in (True, False)
    )
    # Weights are by the radiance that was fitted, and fall with the square of how far a sample is from it.
    assert smooth < 0.05
    assert through > 1


def test_light_at_the_eye_reflects_alike_whatever_phi_d(monkeypatch):
    capture = photographed([*dome(12)[5:7], *gn.distant_lights([[0.0, 0, 1]], [np.pi])])
    spread = []
    for back in (collecting._BACK, 0.0):
        monkeypatch.setattr(collecting, "_BACK", back)
        material = share_reflectance(capture.reflectance(), centres=200, scales=Scales(0.3, 2.0)).value.material
        theta_h = np.linspace(0.1, 0.8, 8)[:, None]
        f = material.f(*gn.from_half_difference(theta_h, 0.0, 1e-4, np.linspace(0, np.pi, 13)))
        spread.append(np.max(np.ptp(f, axis=1) / np.mean(f, axis=1)))
    # Between the angles s is linear in distance; at one alone the others are those of lights aside.
    assert spread[0] < 0.01
    assert spread[1] > 2 * spread[0]


def test_more_samples_than_are_looked_at_are_thinned_evenly(blocks, monkeypatch):
    total = sum(len(b) for b in blocks)
    monkeypatch.setattr(collecting, "_MOST", 3000)
    table = collecting.collected(blocks, None, 0)
    share = len(table.site) / total
    assert 1500 < len(table.site) <= 3000
    for k, block in enumerate(blocks):
        own, of = table.group == k, len(block)
        assert abs(np.count_nonzero(own) - share * of) < 4 * np.sqrt(share * of)
        np.testing.assert_array_equal(table.value[own], block.value[np.isin(block.site, table.site[own])])
    assert left(share_reflectance(blocks, centres=100, scales=SCALES).value.material, blocks) < 0.05


def test_places_may_lie_far_from_their_origin():
    capture = photographed(dome(4), lambda x, y: gn.Lambert((0.5 + 0.3 * x)[:, None] * [1.0, 0.5, 0.2]), size=16)
    near, far = (
        share_reflectance(capture.reflectance(), places(capture) + away, centres=80, scales=SCALES).residual
        for away in (0, 1000)
    )
    assert far == pytest.approx(near, rel=1e-3)


def test_a_colour_that_is_never_seen_stays_dark(ball):
    red = changed(ball.select([0, 1, 2, 3]).reflectance(), lambda f: f * [1, 0, 0])
    at = places(ball)
    for options in ({}, {"texture": True}):
        material = share_reflectance(red, at, centres=60, scales=SCALES, **options).value.material
        f = gn.reflection.varied(material, lambda value, axes: value[red[0].site]).f(red[0].wi, red[0].wo)
        assert np.all(f[:, 1:] < 0.01 * np.median(f[:, 0]))


def test_the_residual_is_what_is_left_of_radiance(blocks):
    for options in ({}, {"smooth": False}, PAPERS):
        fit = share_reflectance(blocks, centres=60, scales=SCALES, **options)
        assert fit.residual == pytest.approx(left(fit.value.material, blocks), rel=1e-6)


def test_centres_are_added_until_the_error_is_reached_and_progress_hears(blocks):
    heard = []
    fit = share_reflectance(
        blocks, centres=300, error=0.1, scales=SCALES, progress=lambda done, total: heard.append((done, total))
    )
    assert fit.converged and fit.history[-1][1] <= 0.1
    assert heard[-1] == (fit.history[-1][0], 300) and heard[-1][0] < 300


def test_a_fit_that_was_stopped_goes_on_as_if_it_had_not_been(ball, blocks):
    at, scales = places(ball), Scales(0.3, 0.5, 0.02)
    labels = (at[:, 0] > np.median(at[:, 0])).astype(int)
    heard = []
    options = {"scales": scales, "centres": 90}
    for how in ({}, {"texture": True}, {"regions": labels}):
        whole = share_reflectance(blocks, at, **options, **how)
        heard.clear()
        part = share_reflectance(
            blocks, at, **options, **how, progress=lambda done, _: heard.append(done), until=lambda: heard[-1] >= 30
        )
        assert not part.converged and "it was stopped with" in part.reason
        assert 30 <= part.history[-1][0] < 70
        rest = share_reflectance(blocks, at, centres=90, **how, start=part.value.material)
        assert rest.value.scales == scales
        wi, wo = blocks[0].wi[:1], blocks[0].wo[:1]
        # A centre's places have been through the scales and back.
        assert_allclose(rest.value.material.f(wi, wo), whole.value.material.f(wi, wo), rtol=1e-4, err_msg=str(how))


def test_a_start_from_elsewhere_is_refused(ball, blocks):
    start = share_reflectance(blocks, centres=20, scales=SCALES).value.material
    with pytest.raises(gn.errors.ArrayError, match=r"centres of start are none of these samples"):
        share_reflectance(blocks[4:], start=start)
    with pytest.raises(gn.errors.ParameterError, match="3 coordinates, these samples have 5"):
        share_reflectance(blocks, places(ball), start=start)
    with pytest.raises(gn.errors.ParameterError, match="logarithm=False"):
        share_reflectance(blocks, logarithm=False, start=start)
    with pytest.raises(gn.errors.ParameterError, match="2 parts; one for each of 1"):
        share_reflectance(blocks, start=start + start)
    with pytest.raises(gn.errors.ParameterError, match="logarithm=True"):
        share_reflectance(blocks, start=gn.Lambert(0.5))


@pytest.mark.parametrize("rho", [0.03, 1.0])
def test_least_squares_at_the_centres_alone_is_the_stiff_interpolant(rng, rho):
    q = rng.uniform(-1, 1, (80, 3)) + np.array([0, 30, 0])
    g = rng.normal(size=(80, 2))[:, [0, 1, 0]]
    stiff = choose_centres(q, g, None, np.array([1, 1, 0.5]), rho, most=80).interpolant
    again = smoothed(stiff, q, g, np.full(80, 3.0))
    assert_allclose(again.coefficients, stiff.coefficients, atol=1e-6 * np.abs(stiff.coefficients).max())
    assert_allclose(again.polynomial, stiff.polynomial, atol=1e-6 * np.abs(stiff.polynomial).max())


def test_what_cannot_be_shared_is_refused_by_name(ball, blocks):
    black = changed(blocks, lambda f: 0 * f)
    at = places(ball)
    hole = np.where(np.arange(len(at))[:, None] == 7, np.nan, at)
    for samples, where, options, kind, message in (
        ([], None, {}, gn.errors.ArrayError, "no samples"),
        (black, None, {}, gn.errors.ArrayError, "black"),
        (blocks, at[:9], {}, gn.errors.ArrayError, r"places have shape \(9, 2\)"),
        (blocks, at[:, :1], {}, gn.errors.ArrayError, "places have shape"),
        (blocks, hole, {}, gn.errors.ArrayError, r"places\[7, 0\] is nan"),
        (blocks, None, {"texture": True}, gn.errors.ParameterError, "places are wanted"),
        (blocks, None, {"regions": np.zeros(9, int)}, gn.errors.ArrayError, "regions are of 9 sites"),
        (blocks, at, {"regions": np.zeros(9, int)}, gn.errors.ArrayError, r"regions are int64 \(9,\)"),
        (blocks, at, {"regions": np.zeros(len(at))}, gn.errors.ArrayError, "regions are float64"),
        (blocks, at, {"regions": -np.arange(len(at)), "scales": SCALES}, gn.errors.ParameterError, "region -"),
        (blocks, None, {"regions": np.arange(len(at) + 1) // len(at)}, gn.errors.ArrayError, "region 1 has no sample"),
        (blocks, None, {"centres": 3, "scales": SCALES}, gn.errors.ParameterError, "4 centres at least"),
    ):
        with pytest.raises(kind, match=message):
            share_reflectance(samples, where, **options)
    for values in ((0, 1), (1, -1), (1, 1, -1), (np.inf, 1), (1, np.nan), (1, 1, np.inf)):
        with pytest.raises(gn.errors.ParameterError, match="positive"):
            Scales(*values)
    one = blocks[0]
    with pytest.raises(gn.errors.ArrayError, match="value is not all finite"):
        ReflectanceSamples(one.site, one.wi, one.wo, np.full_like(one.value, np.nan), one.weight)
