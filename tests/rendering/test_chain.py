"""Facts about roughness chains."""

import numpy as np
import pytest

import gonio as gn
from gonio.errors import NegativeWarning
from gonio.rendering import chain as module
from gonio.rendering.chain import roughness_chain
from gonio.rendering.lobes import ggx, phong


def of_opengl(size):
    """World directions (6, size, size, 3) of the texels, from the table of OpenGL 4.6, 8.13: (rx, ry, rz) by sc, tc."""
    centre = 2 * (np.arange(size) + 0.5) / size - 1
    t, s = np.meshgrid(centre, centre, indexing="ij")
    one = np.ones_like(s)
    faces = ((one, -t, -s), (-one, -t, s), (s, one, t), (s, -one, -t), (s, -t, one), (-s, -t, -one))
    x, y, z = np.moveaxis(np.array([np.stack(face, axis=-1) for face in faces]), -1, 0)
    return gn.normalise(np.stack((x, -z, y), axis=-1))  # Y up -> Z up


def brute_force(light, lobe, alpha, R):
    """Sums over every pixel of the map that shines, and none over harmonics."""
    theta = (np.arange(20_000) + 0.5) * (np.pi / 2 / 20_000)
    whole = 2 * np.pi * np.mean(lobe(alpha, theta) * np.sin(theta)) * np.pi / 2
    beams = light.beams()
    shines = beams.irradiance.max(axis=1) > 0
    w, irradiance = beams.directions[shines], beams.irradiance[shines].astype(np.float64)
    out = []
    for r in R.reshape(-1, 3):
        cosine = w @ r
        ahead = cosine > 0
        out.append(lobe(alpha, np.arccos(cosine[ahead].clip(None, 1))) @ irradiance[ahead] / whole)
    return np.array(out).reshape(*R.shape[:-1], -1)


def relative_rms(actual, expected):
    return np.sqrt(np.mean((actual - expected) ** 2) / np.mean(np.asarray(expected, np.float64) ** 2))


@pytest.fixture(scope="module")
def room():
    return gn.studio(128)


@pytest.mark.parametrize("lobe", [ggx, phong])
@pytest.mark.parametrize("orientation", [gn.Orientation.GONIO, gn.Orientation.MITSUBA])
def test_each_level_is_the_sum_of_lobe_times_light_over_the_map(room, lobe, orientation, rng):
    light = gn.Environment(room.image, room.mapping, orientation.rotated(gn.euler(0.3, 0.4, 0.5)))
    alphas = (0.1, 0.25, 0.5, 1.0)
    chain = roughness_chain(light, 32, alphas, lobe, error=1e-3)
    for level, alpha in zip(chain.faces, alphas, strict=True):
        some = rng.integers(0, level[..., 0].size, 100)
        R = of_opengl(level.shape[1]).reshape(-1, 3)[some]
        # The lamps of the room are broader than the points for which the error is told.
        assert relative_rms(level.reshape(-1, 3)[some], brute_force(light, lobe, alpha, R)) < 1e-3


@pytest.mark.parametrize("error", [1e-2, 1e-3, 1e-4])
def test_under_a_lamp_of_one_pixel_the_error_is_the_one_told(error):
    image = np.zeros((128, 256, 1))
    image[40, 100] = 1
    lamp = gn.Environment(image)
    chain = roughness_chain(lamp, 32, (0.2,), error=error)
    assert chain.errors[0] <= error
    off = relative_rms(chain.faces[0], brute_force(lamp, ggx, 0.2, of_opengl(32)))
    # Texels at the lamp weigh most and are few, and negative radiance was cut: within a factor of two below.
    assert chain.errors[0] / 4 < off < 1.2 * chain.errors[0]


def test_a_sun_in_a_dim_sky_is_no_worse():
    image = np.zeros((128, 256, 3), np.float32)
    image[30, 77] = 30_000
    sun, light = gn.Environment(image), gn.Environment(image + np.float32(0.1))
    chain = roughness_chain(light, 32, (0.1, 0.3), error=1e-3)
    for k, alpha in enumerate((0.1, 0.3)):
        expected = 0.1 + brute_force(sun, ggx, alpha, of_opengl(32 >> k))
        assert relative_rms(chain.faces[k], expected) < 1e-3
        # The sky far from the sun is the sky and GGX's tail, not the sun's ringing.
        assert np.min(chain.faces[k]) > 0.09


def test_constant_light_stays_constant():
    sky = gn.Environment(np.full((64, 128, 3), 2.5))
    for face in roughness_chain(sky, 32, 3).faces:
        np.testing.assert_allclose(face, 2.5, rtol=1e-5)  # splines on a thinned map: far below the error of 1e-3


def test_every_level_keeps_the_mean_radiance(room):
    chain = roughness_chain(room, 64, 4)
    for k in range(4):
        # The midpoint rule over texels of angle a is off by a^2 / 24 of the curvature; .25 rad across the smallest.
        np.testing.assert_allclose(chain.environment(k).mean_radiance, room.mean_radiance, rtol=3e-3)


def test_faces_meet_without_seams(room):
    chain = roughness_chain(room, 32, (0.15, 0.4, 1.0))
    for faces in chain.faces:
        n = faces.shape[1]
        flat = faces.reshape(-1, 3)
        # Beside each edge texel lies its neighbour's: one step further, as within a face.
        ghosts = gn.CubeStrip().ghosts(n, n)[:, 1:-1, [0, -1]]
        across = np.abs(flat[ghosts] - faces[:, :, [0, -1]])
        within = np.abs(np.diff(faces, axis=2))
        assert across.max() < 1.2 * within.max()


def test_six_lamps_land_on_their_faces():
    """A lamp of its own colour along each axis. +X -X +Y -Y +Z -Z with Y up are +x -x +z -z -y +y of the world."""
    axes = {(1, 0, 0): 0, (-1, 0, 0): 1, (0, 0, 1): 2, (0, 0, -1): 3, (0, -1, 0): 4, (0, 1, 0): 5}
    colours = np.array([[1, 0, 0], [0, 1, 1], [0, 1, 0], [1, 0, 1], [0, 0, 1], [1, 1, 0]])
    w = gn.LatLong(64, 128).directions()
    image = sum((w @ axis > 0.97)[..., None] * colours[face] for axis, face in axes.items())
    chain = roughness_chain(gn.Environment(image.astype(float)), 16, 2)
    for face in range(6):
        middle = chain.faces[0][face, 7:9, 7:9].mean(axis=(0, 1))
        np.testing.assert_allclose(middle, colours[face], atol=1e-6)
        blurred = roughness_chain(gn.Environment(image.astype(float)), 16, (0.2,)).faces[0][face, 7:9, 7:9].mean((0, 1))
        assert np.all((blurred > 0.5 * blurred.max()) == (colours[face] == 1))


def test_brightness_does_not_depend_on_size(room, rng):
    w = gn.normalise(rng.normal(size=(300, 3)))
    coarse, fine = (roughness_chain(room, size, (0.4,)).environment(0).radiance(w) for size in (32, 64))
    # Bilinear between texels 1/16 apart, of a lobe .4 wide.
    np.testing.assert_allclose(coarse, fine, rtol=0.01)


@pytest.mark.parametrize("size", [16, 64])
def test_level_0_is_the_light_itself_averaged(room, size):
    """By shares of pixels where those are the finer, else by `resampled`; which says what to expect."""
    light = gn.Environment(room.image, room.mapping, gn.Orientation.MITSUBA.rotated(gn.euler(0.3, 0.4, 0.5)))
    chain = roughness_chain(light, size, (0.0,))
    expected = light.resampled(gn.CubeStrip(), 6 * size, gn.Orientation.OPENGL)
    # `resampled` takes light as linear between pixels, shares take it as constant within: lamps' edges differ.
    assert relative_rms(chain.faces[0].reshape(-1, size, 3), expected.image) < (0.04 if size == 16 else 1e-12)
    solid = expected.solid_angles[..., None] / (4 * np.pi)
    mean = np.sum(light.solid_angles[..., None] * light.image.astype(np.float64), axis=(0, 1)) / (4 * np.pi)
    np.testing.assert_allclose(np.sum(chain.faces[0].reshape(-1, size, 3) * solid, axis=(0, 1)), mean, rtol=1e-2)
    assert (chain.alphas[0], chain.degrees[0], chain.errors[0]) == (0, 0, 0)


def test_level_0_of_smooth_light_is_the_light_at_the_texels():
    w = gn.LatLong(128, 256).directions()
    (faces,) = roughness_chain(gn.Environment(1 + w), 32, (0.0,)).faces
    # A texel's mean of 1 + w is off its centre by a^2 / 24 of 1, a = 1/16; its share of pixels, by 1/6 of one of .025.
    np.testing.assert_allclose(faces, 1 + of_opengl(32), atol=5e-3)


def test_a_lobe_sharper_than_the_rows_carry_blurs_what_lies_between_the_pixels(rng):
    light = gn.Environment(rng.random((16, 32, 3)))
    chain = roughness_chain(light, 32, (0.08,))
    assert chain.degrees[0] > 15
    fine = gn.Environment(light.radiance(gn.LatLong(256, 512).directions()))
    some = rng.integers(0, 6 * 32 * 32, 100)
    expected = brute_force(fine, ggx, 0.08, of_opengl(32).reshape(-1, 3)[some])
    # Resampling takes means over the finer pixels: (pi / 128)^2 / 24 of the kinks' curvature, a few in a thousand.
    assert relative_rms(chain.faces[0].reshape(-1, 3)[some], expected) < 5e-3


def test_other_layouts_give_the_same_chain(room):
    cube = room.resampled(gn.CubeStrip(), 6 * 128, gn.Orientation.FILAMENT)
    ours, theirs = (roughness_chain(light, 32, (0.3,)).faces[0] for light in (room, cube))
    assert relative_rms(theirs, ours) < 5e-3  # two resamplings, each of which keeps energy to 1e-3


def test_roughness_is_gltfs_and_faces_halve(room):
    chain = roughness_chain(room, 64)
    np.testing.assert_allclose(chain.roughness, [0, 1 / 3, 2 / 3, 1])
    np.testing.assert_allclose(chain.alphas, chain.roughness**2)
    assert chain.sizes == (64, 32, 16, 8)
    assert chain.lobe == "ggx"


def test_one_channel_and_double_precision_stay(rng):
    light = gn.Environment(rng.random((32, 64)))
    (face,) = roughness_chain(light, 8, (0.5,)).faces
    assert (face.shape, face.dtype, face.flags.writeable) == ((6, 8, 8, 1), np.float64, False)


def test_ringing_beyond_the_error_is_told(room, monkeypatch):
    """A series cut on purpose: nothing that the planner makes rings so much."""
    plan = module._plan(ggx, 0.2, 1e-3, 127)
    monkeypatch.setattr(module, "_plan", lambda *_: plan._replace(A=plan.A[:6]))
    with pytest.warns(NegativeWarning, match="rang below zero"):
        roughness_chain(room, 16, (0.2,))


@pytest.mark.parametrize(
    ("size", "levels", "says"),
    [
        (0, None, "no number of texels"),
        (1 << 20, 2, "memory limit"),
        (12.0, None, "no number of texels"),
        (24, 5, "cannot be halved 4 times"),
        (16, 0, "at least one"),
        (16, (), "ascend"),
        (16, (0.5, 0.2), "ascend"),
        (16, (0.5, 1.2), "ascend"),
        (16, (0.5, np.nan), "ascend"),
        (16, (0.0005,), "too narrow"),
    ],
)
def test_sizes_and_alphas_out_of_range_are_refused(room, size, levels, says):
    with pytest.raises(gn.GonioError, match=says):
        roughness_chain(room, size, levels)


@pytest.mark.parametrize("error", [0.0, 1e-9, 1.0, np.nan])
def test_an_error_out_of_range_is_refused(room, error):
    with pytest.raises(gn.GonioError, match="relative"):
        roughness_chain(room, 16, 2, error=error)
