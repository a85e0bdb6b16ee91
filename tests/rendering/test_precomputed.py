"""Facts about images made beforehand: relit they are what the full model makes, with the error that was asked for."""

import dataclasses

import numpy as np
import pytest

import gonio as gn
from gonio.capture.simulation import from_above
from gonio.errors import AccuracyWarning, ArrayError, MemoryLimitError, ParameterError
from gonio.lights.cubes import CubeStrip
from gonio.rendering import precomputing
from gonio.rendering.precomputed import Cells, Precomputed, blocks
from gonio.rendering.precomputing import precompute
from gonio.rendering.relight import Relightable, relight

PLASTIC = gn.Lambert([0.5, 0.3, 0.2]) + gn.Microfacet(gn.GGX(0.3), gn.Fresnel(1.5))
SUN = gn.Directional(np.array([0.48, 0.36, 0.8]), [3.0, 2.0, 1.0])


@pytest.fixture(scope="module")
def view():
    return gn.Sphere().view(from_above(gn.Sphere(), 20))


def smooth_room(rows=48):
    w = gn.LatLongMap().directions(rows, 2 * rows)[0]
    return gn.Environment(1 + np.stack((w[..., 0], w[..., 2], w[..., 1] * w[..., 0]), axis=-1))


def responses(thing, cells, samples):
    """T (pixels, colours, K) by the forward model, one direction of light after another."""
    view = thing.view
    m = view.mask
    w, solid = cells.directions(samples)
    T = np.zeros((np.count_nonzero(m), 3, len(cells)))
    visibility = (lambda x, w, d: ~thing.shape.occluded(x, w, d)) if thing.shape else None
    for k in range(len(cells)):
        for direction, E in zip(w[:, k], solid[:, k], strict=True):
            light, where = gn.Directional(direction, [E] * 3), (view.frames[m], view.wo[m], view.lifted[m])
            T[..., k] += gn.radiance(thing.material, light, *where, visibility=visibility, threads=1)
    return T


def played(made):
    """T as `made` holds it: what it shows of each cell alone, in white."""
    images = [
        made.shown(np.eye(len(made.cells), dtype=np.float32)[k][:, None] * np.ones(3)) for k in range(len(made.cells))
    ]
    return np.stack([image[made.mask] for image in images], axis=-1)


def off(image, truth):
    return float(np.sqrt(np.mean((image - truth) ** 2) / np.mean(truth**2)))


@pytest.fixture(scope="module")
def brute(view):
    return responses(Relightable(view, PLASTIC), Cells(4), 1)


@pytest.mark.parametrize("error", [0.1, 0.02, 0.0021, 1e-3])
def test_the_error_is_what_brute_force_finds_and_no_more_than_asked(view, brute, error):
    made = precompute(Relightable(view, PLASTIC), error=error, side=4, samples=1)
    assert 0.9 * error < made.error <= error
    root = np.sqrt(made.cells.solid_angles)
    # What would be below zero is shown as zero, which is nearer to the truth.
    found = off(played(made) / root, brute / root)
    assert 0.8 * made.error < found <= made.error * 1.001


def test_under_smooth_light_it_is_the_full_model(view):
    thing = Relightable(view, PLASTIC)
    made = precompute(thing, error=0.02)
    truth = relight(thing, smooth_room(), samples=10_000)
    image = made.relight(smooth_room())
    assert image.dtype == np.float32 and image.shape == truth.shape
    assert not image[~view.mask].any()
    assert off(image, truth) < 0.01


def test_a_lamp_is_as_wide_as_its_cell(view):
    matte = Relightable(view, gn.Lambert([0.5, 0.3, 0.2]))
    errors = [off(precompute(matte, error=0.01, side=side).relight(SUN), relight(matte, SUN)) for side in (4, 16)]
    assert errors[0] > 0.06 > 0.03 > errors[1]


def test_lights_add_and_near_ones_are_refused(view):
    made = precompute(Relightable(view, PLASTIC), error=0.05, side=6, samples=1)
    both = made.cells.radiance(SUN + smooth_room())
    np.testing.assert_allclose(both, made.cells.radiance(SUN) + made.cells.radiance(smooth_room()))
    with pytest.raises(ParameterError, match=r"gn\.relight"):
        made.relight(gn.Point(np.array([0.0, 0, 3])))
    with pytest.raises(ArrayError, match=r"\(216, 3\) is wanted"):
        made.shown(both[1:])


def test_a_matte_ball_takes_nine_lights_to_a_tenth_and_gloss_takes_more(view):
    # Basri and Jacobs 2003: nine harmonics leave .8 % of the square of a clamped cosine, which is 9 % rms.
    matte, gloss = (
        precompute(Relightable(view, material), error=0.13, samples=2)
        for material in (gn.Lambert([0.5, 0.3, 0.2]), gn.Microfacet(gn.GGX(0.1), gn.Fresnel(1.5)))
    )
    assert matte.lights.shape[1] <= 9
    assert gloss.lights.shape[1] > 10 * matte.lights.shape[1]
    assert gloss.ranks.mean() > 2 * matte.ranks.mean()


def test_pixels_of_one_normal_are_one_image(rng):
    """Whatever their albedo: colours share the lights."""
    mask = np.ones((9, 14), bool)
    n = np.tile([0.0, 0, 1], (mask.sum(), 1))
    uv = rng.random((mask.sum(), 2))
    tangent = np.tile([1.0, 0, 0], (mask.sum(), 1))
    view = gn.View.of(mask, position=n, lifted=n, geometric=n, normal=n, tangent=tangent, uv=uv, wo=n, distance=n[:, 0])
    made = precompute(Relightable(view, gn.Lambert(rng.random((5, 5, 3)))), error=1e-3)
    assert made.lights.shape[1] == 1
    np.testing.assert_array_equal(made.ranks, 1)


def test_a_gray_material_keeps_one_colour(view):
    made = precompute(Relightable(view, gn.Lambert(0.5)), error=0.02, side=8)
    assert made.colours == 1
    image = made.relight(gn.Directional(np.array([0.0, 0, 1]), [3.0, 2, 1]))
    np.testing.assert_allclose(image[..., 0], 3 * image[..., 2], rtol=1e-3)


def test_shadows_fall_where_the_shape_is_known():
    heights = np.zeros((24, 24))
    heights[8:16, 8:16] = 6.0
    shape = gn.HeightField(heights).mesh
    view = shape.view(from_above(shape, 16))
    thing = Relightable(view, gn.Lambert([0.5, 0.4, 0.3]), shape)
    made = precompute(thing, error=0.01, side=3, samples=2)
    root = np.sqrt(made.cells.solid_angles)
    T = responses(thing, made.cells, 2)
    assert off(played(made) / root, T / root) <= 0.0101
    bare = precompute(thing, error=0.01, side=3, samples=2, shadows=False)
    assert off(bare.relight(smooth_room()), made.relight(smooth_room())) > 0.05


@pytest.mark.parametrize("block", [1, 5, 64])
def test_blocks_of_any_size_show_the_same(view, block):
    thing = Relightable(view, PLASTIC)
    made = precompute(thing, error=0.01, side=6, block=block, samples=1)
    other = precompute(thing, error=0.01, side=6, samples=1)
    assert off(made.relight(smooth_room()), other.relight(smooth_room())) < 0.01


def test_blocks_hold_every_pixel_once():
    mask = np.random.default_rng(1).random((21, 34)) < 0.3
    mask[:8, 8:16] = False
    at, counts = blocks(mask, 8)
    assert sorted(at) == np.flatnonzero(mask).tolist()
    assert counts.sum() == at.size and counts.min() > 0
    row, column = np.divmod(at, 34)
    ends = np.cumsum(counts)
    for low, high in zip(ends - counts, ends, strict=True):
        assert np.ptp(row[low:high] // 8) == np.ptp(column[low:high] // 8) == 0


def test_cells_cover_the_sphere_and_average_their_samples():
    cells = Cells(5)
    w, solid = cells.directions(3)
    assert w.shape == (9, 150, 3) and solid.sum() == pytest.approx(4 * np.pi)
    np.testing.assert_allclose(solid.sum(axis=0), cells.solid_angles)
    # A lamp towards any sample of a cell lights that cell.
    for j, k in ((0, 0), (4, 77), (8, 149), (2, 131)):
        lit = cells.radiance(gn.Directional(w[j, k], 2.0))
        assert np.flatnonzero(lit[:, 0]).tolist() == [k]
        np.testing.assert_allclose(lit[k], 2 / cells.solid_angles[k])
    # A picture of the cells themselves is taken as it is.
    image = np.random.default_rng(2).random((30, 5, 3))
    np.testing.assert_allclose(cells.radiance(gn.Environment(image, CubeStrip())), image.reshape(-1, 3))


def test_narrow_lobes_get_more_samples_and_narrower_ones_a_warning(view):
    def samples(alpha, side):
        thing = Relightable(view, gn.Microfacet(gn.GGX(alpha), gn.Fresnel(1.5)))
        return precomputing._Responses(thing, Cells(side), False).samples(np.flatnonzero(view.mask), 0.1)

    assert samples(0.6, 8) < samples(0.15, 8)
    with pytest.warns(AccuracyWarning, match="narrowest lobes"):
        assert samples(0.02, 4) == 8


def test_threads_change_nothing(view, monkeypatch):
    thing = Relightable(view, PLASTIC)
    two = precompute(thing, error=0.02, side=6)
    monkeypatch.setattr(precomputing, "processors", lambda: 1)
    one = precompute(thing, error=0.02, side=6)
    for name in ("ranks", "images", "mixtures", "lights"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


def test_progress_hears_of_all_pixels_and_may_stop_the_work(view):
    heard = []
    precompute(Relightable(view, PLASTIC), error=0.1, side=2, samples=1, progress=lambda *now: heard.append(now))
    count = int(view.mask.sum())
    assert heard[-1] == (count, count) and len(heard) == len(blocks(view.mask, 8)[1])

    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        precompute(Relightable(view, PLASTIC), side=2, progress=stop)


def test_a_black_thing_stays_black(view):
    made = precompute(Relightable(view, gn.Lambert(0.0)), side=2)
    assert made.error == 0 and not made.relight(SUN).any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"error": 0}, "error = 0 lies outside"),
        ({"error": np.nan}, "error = nan"),
        ({"side": 0}, "side = 0"),
        ({"side": 2.5}, "side = 2.5"),
        ({"block": 0}, "block = 0"),
        ({"samples": 0}, "samples = 0"),
    ],
)
def test_numbers_out_of_range_are_refused(view, options, message):
    with pytest.raises(ParameterError, match=message):
        precompute(Relightable(view, PLASTIC), **options)


def test_what_outgrows_the_memory_is_refused(view, monkeypatch):
    monkeypatch.setattr(precomputing, "MEMORY_LIMIT", 10_000)
    with pytest.raises(MemoryLimitError, match="larger error"):
        precompute(Relightable(view, PLASTIC), error=0.01, side=4, samples=1)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (lambda p: {"mask": p.mask & False}, "some true"),
        (lambda p: {"mask": p.mask[1:]}, "ranks|images"),
        (lambda p: {"ranks": p.ranks[1:]}, "ranks is int32"),
        (lambda p: {"ranks": -p.ranks}, "ranks is int32"),
        (lambda p: {"images": p.images[1:]}, "images has shape"),
        (lambda p: {"mixtures": p.mixtures[1:]}, "mixtures has shape"),
        (lambda p: {"lights": p.lights[1:]}, "lights"),
        (lambda p: {"lights": p.lights * np.nan}, "lights"),
        (lambda p: {"cells": Cells(3)}, "lights"),
        (lambda p: {"error": -1.0}, "error = -1"),
        (lambda p: {"block": 0}, "block = 0"),
    ],
)
def test_parts_that_do_not_fit_are_refused(view, changed, message):
    made = precompute(Relightable(view, PLASTIC), error=0.1, side=2, samples=1)
    assert isinstance(made, Precomputed)
    with pytest.raises(gn.GonioError, match=message):
        dataclasses.replace(made, **changed(made))
