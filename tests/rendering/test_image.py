"""Rendered images against closed forms, an eclipse, and Mitsuba."""

import math

import numpy as np
import pytest

import gonio as gn
from gonio.lights.environment import Environment
from gonio.lights.points import Directional, Lights, Point
from gonio.rendering.image import beams_wanted

ABOVE = gn.Orthographic(size=(48, 48), pixel=1 / 20, pose=gn.look_at((0, 0, 5), (0, 0, 0), up=(0, 1, 0)))
SUN = gn.normalise(np.array([0.4, -0.3, 0.8]))


def sky(function, rows=48):
    w = gn.LatLong(rows, 2 * rows).directions()
    return Environment(function(w))


def test_a_matte_sphere_under_one_light_is_albedo_over_pi_e_cos():
    image = gn.render(gn.Sphere(), gn.Lambert((0.9, 0.5, 0.2)), Directional(SUN, 2.0), ABOVE)
    x, y = ABOVE.pixels()[..., 0] / 20 - 1.2, 1.2 - ABOVE.pixels()[..., 1] / 20
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    cosine = np.where(x**2 + y**2 < 1, np.maximum(np.stack((x, y, z), axis=-1) @ SUN, 0), 0)
    expected = 2 / math.pi * cosine[..., None] * (0.9, 0.5, 0.2)
    assert image.dtype == np.float32
    np.testing.assert_allclose(image, expected, atol=1e-6)  # single precision


def test_a_matte_sphere_in_a_white_furnace_has_its_albedo_everywhere():
    image = gn.render(gn.Sphere(), gn.Lambert(0.6), sky(lambda w: np.ones(w.shape[:2])), ABOVE, samples=8192)
    mask = gn.Sphere().view(ABOVE).mask
    # 4,608 cells of 3.75 degrees cut by each point's horizon.
    np.testing.assert_allclose(image[mask], 0.6, rtol=3e-3)
    np.testing.assert_allclose(image[~mask], 1.0, rtol=1e-6)


def test_a_linear_sky_lights_a_matte_sphere_linearly():
    image = gn.render(gn.Sphere(), gn.Lambert(0.6), sky(lambda w: 1 + w[..., 2]), ABOVE, samples=8192)
    view = gn.Sphere().view(ABOVE)
    expected = 0.6 / math.pi * (math.pi + 2 * math.pi / 3 * view.normal[view.mask][:, 2])
    np.testing.assert_allclose(image[view.mask][:, 0], expected, rtol=3e-3)


def test_a_smooth_metal_mirrors_its_surroundings():
    # GGX with alpha = .08, wide enough for cells of 2.8 degrees; the sky is smooth, and bends by alpha^2 in the lobe.
    room = sky(lambda w: 2 + w[..., 0] + 0.5 * w[..., 2] * w[..., 1], rows=64)
    metal = gn.Microfacet(gn.GGX(0.08), gn.Schlick(1.0))
    camera = gn.Orthographic(size=(24, 24), pixel=1 / 12, pose=ABOVE.pose)
    image = gn.render(gn.Sphere(), metal, room, camera, samples=8192)
    view = gn.Sphere().view(camera)
    near = view.mask & (np.nan_to_num(view.normal[..., 2]) > 0.5)
    n, wo = view.normal[near], view.wo[near]
    r = 2 * (n * wo).sum(axis=-1, keepdims=True) * n - wo
    np.testing.assert_allclose(image[near][:, 0], 2 + r[:, 0] + 0.5 * r[:, 2] * r[:, 1], rtol=0.03)


def test_a_far_camera_with_a_narrow_view_sees_what_parallel_rays_see():
    far = 2000.0
    view = math.degrees(2 * math.atan(1.2 / far))
    pinhole = gn.Pinhole.look_at((0, 0, far), (0, 0, 0), field_of_view=view, size=(48, 48), up=(0, 1, 0))
    glossy = gn.Lambert(0.3) + gn.Microfacet(gn.GGX(0.3), gn.Fresnel(1.5))
    a = gn.render(gn.Sphere(), glossy, Directional(SUN), ABOVE, supersample=2)
    b = gn.render(gn.Sphere(), glossy, Directional(SUN), pinhole, supersample=2)
    # Rays differ by 1 / 2000; rim pixels by one ray of four.
    assert np.abs(a - b).mean() < 1e-3
    assert (np.abs(a - b) < 5e-3).mean() > 0.99


def test_supersampling_is_the_mean_of_the_finer_image():
    fine = gn.Orthographic(size=(96, 96), pixel=1 / 40, pose=ABOVE.pose)
    whole = gn.render(gn.Sphere(), gn.Lambert(0.5), Directional(SUN), fine)
    halved = gn.render(gn.Sphere(), gn.Lambert(0.5), Directional(SUN), ABOVE, supersample=2)
    np.testing.assert_allclose(halved, whole.reshape(48, 2, 48, 2, 3).mean(axis=(1, 3)), atol=1e-6)


def balls():
    """A sphere of radius .4 at height 1.6 over one of radius 1, as one mesh of 2 x 5,120 faces."""
    trimesh = pytest.importorskip("trimesh")
    one = trimesh.creation.icosphere(subdivisions=4)
    v, f = np.asarray(one.vertices), np.asarray(one.faces)
    return gn.Mesh(np.concatenate((v, 0.4 * v + (0, 0, 1.6))), np.concatenate((f, f + len(v))))


def test_an_eclipse_falls_where_geometry_says():
    scene = balls()
    camera = gn.Pinhole.look_at((4.0, -1.0, 5.0), (0, 0, 0.5), field_of_view=35, size=(64, 64))
    sun = gn.normalise(np.array([-0.25, 0.1, 1.0]))
    lit = gn.render(scene, gn.Lambert(0.5), Directional(sun), camera)
    shaded = gn.render(scene, gn.Lambert(0.5), Directional(sun), camera, shadows=True)
    view = scene.view(camera)
    m = view.mask & (np.linalg.norm(np.nan_to_num(view.position), axis=-1) < 1.01)  # the large ball
    x, n = view.position[m], view.normal[m]
    to_small = np.array([0, 0, 1.6]) - x
    miss = np.linalg.norm(to_small - (to_small @ sun)[:, None] * sun, axis=-1)
    facing = n @ sun > 0.02
    # The faces lie within e^2 / 8 = 1e-3 of the balls.
    inside, outside = facing & (miss < 0.395), facing & (miss > 0.405)
    assert inside.sum() > 40
    assert (shaded[m][inside] == 0).all()
    np.testing.assert_array_equal(shaded[m][outside], lit[m][outside])


def test_near_lights_shadow_up_to_their_distance():
    scene = balls()
    camera = gn.Pinhole.look_at((4.0, -1.0, 5.0), (0, 0, 0.5), field_of_view=35, size=(32, 32))
    # Between the balls' surfaces (z = 1 and 1.2) the small ball stands behind the lamp and shadows nothing below it.
    lamp = Point((0, 0, 1.1), 1.0)
    view = scene.view(camera)
    below = view.mask & (np.linalg.norm(np.nan_to_num(view.position), axis=-1) < 1.01)
    below &= np.nan_to_num(view.normal) @ (0, 0, 1.0) > 0.95
    lit, shaded = (gn.render(scene, gn.Lambert(0.5), lamp, camera, shadows=s) for s in (False, True))
    assert below.sum() > 3
    np.testing.assert_array_equal(shaded[below], lit[below])
    assert (lit[below] > 0).all()


def test_lights_add_and_the_sky_stands_behind():
    blue = sky(lambda w: np.ones((*w.shape[:2], 3)) * (0.1, 0.2, 0.4), rows=24)
    parts = blue, Directional(SUN), Point((1.0, 2, 3), 4.0)
    both = gn.render(gn.Sphere(), gn.Lambert(0.5), Lights(parts), ABOVE, samples=2048)
    each = [gn.render(gn.Sphere(), gn.Lambert(0.5), light, ABOVE, samples=2048) for light in parts]
    np.testing.assert_allclose(both, sum(each), rtol=1e-5, atol=1e-6)  # single precision
    np.testing.assert_allclose(both[0, 0], (0.1, 0.2, 0.4), rtol=1e-6)
    hidden = gn.render(gn.Sphere(), gn.Lambert(0.5), blue, ABOVE, background=False)
    assert (hidden[0, 0] == 0).all()


def test_progress_counts_every_pixel_and_threads_change_nothing():
    seen = []
    room = sky(lambda w: 1 + w[..., 0], rows=32)
    camera = gn.Orthographic(size=(40, 50), pixel=1 / 20)
    one = gn.render(gn.Sphere(), gn.Lambert(0.5), room, camera, samples=2048, threads=1)
    three = gn.render(
        gn.Sphere(), gn.Lambert(0.5), room, camera, samples=2048, threads=3, progress=lambda *at: seen.append(at)
    )
    np.testing.assert_array_equal(one, three)
    done = [d for d, _ in seen]
    assert done == sorted(done)
    assert seen[-1] == (2000, 2000)
    assert len(seen) > 1


def test_an_interrupt_leaves_the_finished_tiles():
    out = np.full((160, 160, 3), np.nan, dtype=np.float32)
    camera = gn.Orthographic(size=(160, 160), pixel=1 / 80)
    room = sky(lambda w: 1 + w[..., 0], rows=32)

    def interrupt(done, total):
        if done > total / 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        gn.render(gn.Sphere(), gn.Lambert(0.5), room, camera, samples=2048, out=out, progress=interrupt)
    finished = np.isfinite(out).all(axis=-1)
    assert 0.25 < finished.mean() < 1
    whole = gn.render(gn.Sphere(), gn.Lambert(0.5), room, camera, samples=2048)
    np.testing.assert_array_equal(out[finished], whole[finished])


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ({"samples": 0}, "samples = 0"),
        ({"supersample": 1.5}, "supersample = 1.5"),
        ({"samples": float("nan")}, "samples = nan"),
        ({"threads": 0}, "threads = 0"),
        ({"out": np.zeros((4, 4, 3), np.float32)}, "out is"),
        ({"out": np.zeros((48, 48, 3))}, "out is float64"),
    ],
)
def test_renders_refuse(arguments, match):
    with pytest.raises(gn.GonioError, match=match):
        gn.render(gn.Sphere(), gn.Lambert(0.5), Directional(SUN), ABOVE, **arguments)


@pytest.fixture(scope="module")
def mitsuba():
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    return mi


def theirs(mi, camera, field_of_view, eye, target, emitter, bsdf, shapes, samples):
    rows, columns = camera.size
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct", "hide_emitters": True},
            "sensor": {
                "type": "perspective",
                "fov": field_of_view,
                "fov_axis": "y",
                "to_world": mi.ScalarTransform4f().look_at(origin=eye, target=target, up=[0, 0, 1]),
                "film": {
                    "type": "hdrfilm",
                    "width": columns,
                    "height": rows,
                    "pixel_format": "rgb",
                    "component_format": "float32",
                    "rfilter": {"type": "box"},
                },
                "sampler": {"type": "multijitter", "sample_count": samples},
            },
            "emitter": emitter,
            **{f"shape{k}": {**shape, "bsdf": bsdf} for k, shape in enumerate(shapes)},
        }
    )
    return np.array(mi.render(scene))


BALLS = ([0, 0, 0], 1.0), ([0, 0, 1.6], 0.4)


def test_mitsuba_sees_the_same_two_balls_with_shadows(mitsuba):
    eye, target = [4.0, -1.0, 5.0], [0, 0, 0.5]
    camera = gn.Pinhole.look_at(eye, target, field_of_view=35, size=(48, 40))
    sun = gn.normalise(np.array([-0.25, 0.1, 1.0]))
    emitter = {"type": "directional", "direction": (-sun).tolist(), "irradiance": {"type": "rgb", "value": [3, 2, 1]}}
    bsdf = {
        "type": "roughconductor",
        "distribution": "ggx",
        "alpha": 0.3,
        "eta": {"type": "rgb", "value": [0.2, 0.9, 1.1]},
        "k": {"type": "rgb", "value": [3.9, 2.4, 2.2]},
    }
    spheres = [{"type": "sphere", "center": centre, "radius": radius} for centre, radius in BALLS]
    reference = theirs(mitsuba, camera, 35, eye, target, emitter, bsdf, spheres, 64)
    copper = gn.Microfacet(gn.GGX(0.3), gn.Conductor((0.2, 0.9, 1.1), (3.9, 2.4, 2.2)))
    ours = gn.render(balls(), copper, Directional(sun, (3.0, 2.0, 1.0)), camera, shadows=True, supersample=4)
    scale = reference.max()
    # Sixteen rays a pixel against 64 jittered ones differ at edges; elsewhere by the balls' faces and their normals.
    off = np.abs(ours - reference).max(axis=-1) / scale
    assert np.median(off) < 1e-4
    assert (off < 0.01).mean() > 0.95
    assert np.abs(ours.mean(axis=(0, 1)) / reference.mean(axis=(0, 1)) - 1).max() < 0.01


def test_mitsuba_sees_the_same_sphere_in_an_environment(mitsuba):
    eye, target = [3.0, -2.0, 1.5], [0, 0, 0]
    camera = gn.Pinhole.look_at(eye, target, field_of_view=40, size=(32, 32))
    rows = 64

    def radiance(w):
        x, y, z = w[..., 0], w[..., 1], w[..., 2]
        return np.stack((1 + z, 1 + 0.8 * x, np.exp(2 * (0.6 * x - 0.8 * y))), axis=-1)

    room = sky(radiance, rows)
    # Mitsuba's map has y up and looks at (sin 2 pi u, ., -cos 2 pi u); turned about x, its y is our z.
    u, v = np.meshgrid((np.arange(2 * rows) + 0.5) / (2 * rows), (np.arange(rows) + 0.5) / rows)
    a, t = 2 * math.pi * u, math.pi * v
    own = np.stack((np.sin(t) * np.sin(a), np.cos(t), -np.sin(t) * np.cos(a)), axis=-1)
    world = np.stack((own[..., 0], -own[..., 2], own[..., 1]), axis=-1)
    emitter = {
        "type": "envmap",
        "bitmap": mitsuba.Bitmap(radiance(world).astype(np.float32)),
        "to_world": mitsuba.ScalarTransform4f().rotate([1, 0, 0], 90),
    }
    bsdf = {
        "type": "roughconductor",
        "distribution": "ggx",
        "alpha": 0.35,
        "eta": {"type": "rgb", "value": [0.2, 0.9, 1.1]},
        "k": {"type": "rgb", "value": [3.9, 2.4, 2.2]},
    }
    reference = theirs(mitsuba, camera, 40, eye, target, emitter, bsdf, [{"type": "sphere"}], 256)
    copper = gn.Microfacet(gn.GGX(0.35), gn.Conductor((0.2, 0.9, 1.1), (3.9, 2.4, 2.2)))
    ours = gn.render(gn.Sphere(), copper, room, camera, samples=8192, supersample=2, background=False)
    inside = gn.Sphere().view(camera).mask.copy()
    inside[1:-1, 1:-1] &= inside[:-2, 1:-1] & inside[2:, 1:-1] & inside[1:-1, :-2] & inside[1:-1, 2:]
    relative = np.abs(ours - reference)[inside] / reference[inside]
    # Mitsuba's noise is 1-2 % a pixel at 256 samples; over all pixels it averages out.
    assert np.median(relative) < 0.02
    bias = ours[inside].mean(axis=0) / reference[inside].mean(axis=0) - 1
    assert np.abs(bias).max() < 0.005


def test_a_narrow_lobe_wants_more_beams_as_the_square_of_its_width():
    few, many = (beams_wanted(gn.Microfacet(gn.GGX(alpha), gn.Schlick(1.0))) for alpha in (0.1, 0.05))
    assert many / few == pytest.approx(4, rel=0.05)


def test_too_few_beams_for_a_narrow_lobe_are_told():
    room = gn.studio(32)
    metal = gn.Microfacet(gn.GGX(0.03), gn.Schlick(1.0))
    camera = gn.Pinhole.look_at(eye=(0, -4, 0), target=(0, 0, 0), field_of_view=30, size=(4, 4))
    with pytest.warns(gn.GonioWarning, match="in dots"):
        gn.render(gn.Sphere(), metal, room, camera, samples=64)
    gn.render(gn.Sphere(), metal, room, camera)  # every texel of so small a room: nothing to warn of
    gn.render(gn.Sphere(), gn.Lambert(0.5), room, camera, samples=64)


def test_an_image_beyond_the_memory_limit_is_refused_before_it_is_made():
    camera = gn.Orthographic(size=(40000, 40000), pixel=1e-4, pose=gn.look_at((0, 0, 5), (0, 0, 0), up=(0, 1, 0)))
    with pytest.raises(gn.GonioError, match=r"19.2 GB.*memmap"):
        gn.render(gn.Sphere(), gn.Lambert(0.5), Directional(SUN), camera)


def test_lamps_without_extent_want_no_more_beams_than_they_have():
    """Nothing of theirs is thinned, so that there is nothing to warn of, however narrow the lobe."""
    metal = gn.Microfacet(gn.GGX(0.01), gn.Schlick(1.0))
    camera = gn.Pinhole.look_at(eye=(0, -4, 0), target=(0, 0, 0), field_of_view=30, size=(4, 4))
    for lamp in (Point((0.0, -3.0, 3.0), 1.0), Directional(SUN)):
        few, many = (gn.render(gn.Sphere(), metal, lamp, camera, samples=n) for n in (1, None))
        np.testing.assert_array_equal(few, many)


def test_too_few_beams_are_told_beside_a_near_lamp_too():
    metal = gn.Microfacet(gn.GGX(0.03), gn.Schlick(1.0))
    camera = gn.Pinhole.look_at(eye=(0, -4, 0), target=(0, 0, 0), field_of_view=30, size=(4, 4))
    light = Lights((gn.studio(32), Point((0.0, -3.0, 3.0), 1.0)))
    with pytest.warns(gn.GonioWarning, match="in dots"):
        gn.render(gn.Sphere(), metal, light, camera, samples=64)
