"""Facts about flat samples brought to a grid, against photographs of patterns that are known in the plane."""

import dataclasses

import numpy as np
import pytest
from reference.boards import LENS, photograph

import gonio as gn
from gonio.capture.photographs import Held
from gonio.capture.rectification import Grid, Rectified, homography_of_points, moved_lights
from gonio.errors import ArrayError, ParameterError
from gonio.lights.uneven import Uneven

# Some 40 degrees off the normal, turned, with a lens that distorts: a pixel is .33 to .5 long in the plane.
CAMERA = dataclasses.replace(LENS, pose=gn.look_at((45.0, -70, 110), (2, -3, 0), (0, 1, 0)))
GRID = Grid((48, 60), 0.9, (1.5, -2.0))
FINE = Grid((120, 150), 0.3, (1.5, -2.0))


def waves(length):
    """Three of that length in the plane, one a channel, and their mean over squares of a side."""
    k = 2 * np.pi / length * np.array([(1.0, 0.0), (0.0, 1.0), (0.6, 0.8)])

    def radiance(x, y, side=0.0):
        contrast = 0.8 * np.sinc(k * side / (2 * np.pi)).prod(axis=1)
        return 1 + contrast * np.cos(np.stack((x, y), axis=-1) @ k.T + [0.3, 0.7, 1.1])

    return radiance


def seen(camera, radiance, fine=1):
    """Photograph (1, rows, columns, 3), of rays through the middles of pixels where fine = 1."""
    channels = [photograph(camera, lambda x, y, c=c: radiance(x, y)[..., c], fine) for c in range(3)]
    return Held(np.stack(channels, axis=-1)[None])


def bound(image):
    """What bilinear interpolation may be off: an eighth of the second differences, each way."""
    return sum(np.abs(np.diff(image, 2, axis=k)).max() for k in (0, 1)) / 8


def affine(size, texel=1.0):
    """The homography under which a grid of texels is the photograph's own pixels."""
    rows, columns = size
    return np.array([[1 / texel, 0, columns / 2], [0, -1 / texel, rows / 2], [0, 0, 1]])


def test_a_pattern_lies_where_it_does_in_the_plane():
    radiance, texels = waves(30.0), Rectified(seen(CAMERA, waves(30.0)), FINE, CAMERA)
    image = texels.photographs.radiance[0]
    assert texels.samples == (1, 1) and texels.size == (120, 150)
    x, y, z = np.moveaxis(FINE.positions(), -1, 0)
    off = np.abs(texels.read(0).radiance - radiance(x, y))
    # Second differences of what the grid looks like from here; a twentieth more for those between pixels.
    part = image[60:175, 105:225]
    limit = 1.05 * bound(part)
    assert off.max() < limit and not z.any()
    # Half a pixel would be far more than that.
    assert 0.5 * np.abs(np.diff(part, axis=1)).max() > 10 * limit


def test_what_is_linear_in_the_photograph_is_exact_so_that_places_are_not_rounded():
    """OpenCV's remap rounds places to 1/32 of a pixel, which would be .03 here."""
    ramp = np.repeat(CAMERA.pixels()[None], 2, axis=-1)[..., :3]
    places, _ = CAMERA.project(FINE.positions())
    # Single precision of 300.
    np.testing.assert_allclose(Rectified(Held(ramp), FINE, CAMERA).read(0).radiance[..., 0], places[..., 0], atol=1e-4)
    np.testing.assert_allclose(Rectified(Held(ramp), FINE, CAMERA).read(0).radiance[..., 2], places[..., 1], atol=1e-4)


def test_pixels_themselves_come_back_as_they_were(rng):
    image = rng.uniform(0, 1, (1, 20, 30, 3)).astype(np.float32)
    texels = Rectified(Held(image), Grid((20, 30), 2.5), affine((20, 30), 2.5))
    np.testing.assert_allclose(texels.read(0).radiance, image[0], atol=1e-6)
    # Two by two pixels to a texel: their mean.
    texels = Rectified(Held(image), Grid((10, 15), 5.0), affine((20, 30), 2.5))
    assert texels.samples == (2, 2)
    np.testing.assert_allclose(texels.read(0).radiance, image[0].reshape(10, 2, 15, 2, 3).mean(axis=(1, 3)), atol=1e-6)


@pytest.mark.parametrize("length", [12.0, 2.4])
def test_where_the_photograph_is_finer_a_texel_is_the_mean_over_its_square(length):
    """Waves of 12 are nearly kept, those of 2.4 fade by half and more, by the same law: nothing aliases."""
    grid = Grid((14, 17), 3.0, (1.5, -2.0))
    texels = Rectified(seen(CAMERA, waves(length)), grid, CAMERA)
    x, y, _ = np.moveaxis(grid.positions(), -1, 0)
    off = np.abs(texels.read(0).radiance - waves(length)(x, y, 3.0))
    assert min(texels.samples) > 5
    # Between pixels s = .4 apart a wave of k = 2 pi / length fades by (k s)^2 / 12: .4 % and 9 % of what is left of it,
    # .7 and .15. As much again for squares that end between pixels; without means, the short wave's .8 would be there.
    assert off.max() < {12.0: 0.006, 2.4: 0.03}[length]


def test_energy_is_kept(rng):
    """Any light in the photograph is in the texels, as often as pixels lie in one: the mean of noise stays."""
    image = rng.exponential(1, (1, *LENS.size, 3)).astype(np.float32)
    texels = Rectified(Held(image), Grid((12, 15), 4.0, (1.5, -2.0)), CAMERA)
    pixels = Rectified(Held(image), Grid((160, 200), 0.3, (1.5, -2.0)), CAMERA)
    # 180 texels of some 80 pixels each are means of 15,000: 1 %.
    assert texels.read(0).radiance.mean() == pytest.approx(pixels.read(0).radiance.mean(), rel=0.01)
    assert texels.read(0).radiance.std() < 0.15


@pytest.mark.parametrize("grid", [FINE, GRID])
def test_no_light_of_a_clipped_pixel_comes_into_a_texel_that_is_not_marked(rng, grid):
    image = rng.uniform(0, 0.9, (1, *LENS.size, 3)).astype(np.float32)
    clipped = np.zeros(LENS.size, bool)
    clipped[100:103, 150:152] = clipped[130, 190] = clipped[9, 9] = True
    dull, bright = image.copy(), image.copy()
    dull[0, clipped], bright[0, clipped] = 0.95, 1e3
    a, b = (Rectified(Held(image, white=0.95), grid, CAMERA).read(0) for image in (dull, bright))
    changed = (a.radiance != b.radiance).any(axis=-1)
    assert a.clipped.any() and (a.clipped == b.clipped).all() and (changed == a.clipped).all()
    assert (b.radiance[~b.clipped] < 0.9001).all()
    assert not Rectified(Held(image), grid, CAMERA).read(0).clipped.any()
    # Seven pixels, each in reach of texels within a pixel of it.
    places, _ = CAMERA.project(grid.positions())
    near = np.zeros(grid.size, bool)
    for row, column in np.argwhere(clipped):
        reach = 1.0 if grid is FINE else 2.6
        near |= (np.abs(places - (column + 0.5, row + 0.5)) < reach).all(axis=-1)
    assert (near >= a.clipped).all() and (grid is GRID or (near == a.clipped).all())


def test_some_texels_of_all_photographs_are_those_of_each(rng):
    held = Held(rng.uniform(0, 1, (3, *LENS.size, 3)), white=0.999)
    texels, heard = Rectified(held, GRID, CAMERA), []
    at = rng.choice(48 * 60, 200, replace=False)
    radiance, clipped = texels.pixels(at, lambda done, total: heard.append((done, total)))
    assert radiance.shape == (3, 200, 3) and heard == [(1, 3), (2, 3), (3, 3)]
    for k in range(3):
        whole = texels.read(k)
        np.testing.assert_allclose(radiance[k], whole.radiance.reshape(-1, 3)[at], rtol=1e-6)
        np.testing.assert_array_equal(clipped[k], whole.clipped.reshape(-1)[at])
    assert clipped.any() and texels.names == held.names


def test_a_mask_covers_texels_that_take_nothing_from_outside(rng):
    held = Held(rng.uniform(0, 1, (1, 20, 30, 3)))
    mask = np.ones((20, 30), bool)
    mask[:4, 7] = False
    covered = Rectified(held, Grid((10, 15), 2.0), affine((20, 30))).covered(mask)
    assert np.argwhere(~covered).tolist() == [[0, 3], [1, 3]]
    with pytest.raises(ArrayError, match=r"mask has shape \(20, 20\)"):
        Rectified(held, Grid((10, 15), 2.0), affine((20, 30))).covered(mask[:, :20])


def test_a_grid_that_the_photograph_does_not_show_is_refused_with_its_share():
    held = Held(np.ones((1, 20, 30, 3)))
    Rectified(held, Grid((20, 30), 1.0), affine((20, 30)))  # out to the frame itself
    # Three of thirty columns, and half a column more that is seen in part.
    with pytest.raises(ParameterError, match=r"does not show 13.3% of the grid's 30 x 20 texels"):
        Rectified(held, Grid((20, 30), 1.0, (3.7, 0.0)), affine((20, 30)))
    with pytest.raises(ParameterError, match=r"does not show 100.0%"):
        Rectified(Held(np.ones((1, *LENS.size, 3))), Grid((8, 8), 1.0, (0, 1e5)), CAMERA)
    # Beyond the horizon, where a homography turns over, nothing is seen.
    H = np.array([[1.0, 0, 15], [0, -1.0, 10], [0, 0.05, 1]])
    with pytest.raises(ParameterError, match="does not show"):
        Rectified(held, Grid((60, 4), 1.0), H)


def test_a_view_along_the_plane_asks_for_no_end_of_places():
    held = Held(np.ones((1, 20, 30, 3)))
    # The horizon lies at y = -2, a hair beyond the grid's last centres or within it.
    for tilt in (0.5, 0.5 + 1e-9, 0.52):
        H = np.array([[1.0, 0, 15], [0, -1.0, 10], [0, tilt, 1]])
        with pytest.raises(ParameterError, match="does not show"):
            Rectified(held, Grid((4, 4), 1.0), H)
    with pytest.raises(ParameterError, match="up to 300 pixels long; 256 are allowed"):
        Rectified(Held(np.ones((1, 300, 300, 3))), Grid((1, 1), 1.0), affine((300, 300), 1 / 300))


def test_a_view_that_does_not_belong_to_the_photographs_is_refused():
    held = Held(np.ones((1, 20, 30, 3)))
    with pytest.raises(ParameterError, match=r"the photographs \(20, 30\)"):
        Rectified(held, GRID, CAMERA)
    behind = dataclasses.replace(LENS, pose=gn.look_at((0.0, 0, -100), (0, 0, 0), (0, 1, 0)))
    with pytest.raises(ParameterError, match="behind the plane"):
        Rectified(Held(np.ones((1, *LENS.size, 3))), GRID, behind)
    with pytest.raises(ParameterError, match="mirrored"):
        Rectified(held, Grid((10, 10), 1.0), np.array([[1.0, 0, 15], [0, 1.0, 10], [0, 0, 1]]))
    with pytest.raises(ArrayError, match=r"view has shape \(2, 3\)"):
        Rectified(held, Grid((10, 10), 1.0), np.eye(3)[:2])


def test_four_points_tell_what_a_camera_without_distortion_sees(rng):
    camera = dataclasses.replace(CAMERA, distortion=(0.0,) * 5)
    plane = FINE.corners
    H = homography_of_points(camera.project(np.column_stack((plane, np.zeros(4))))[0], plane)
    held = Held(rng.uniform(0, 1, (1, *LENS.size, 3)))
    a, b = (Rectified(held, FINE, view).read(0).radiance for view in (H, camera))
    # Places differ by rounding alone: 1e-10 of 300 pixels, under slopes of 1.
    np.testing.assert_allclose(a, b, atol=1e-6)


def test_more_points_share_their_errors(rng):
    camera = dataclasses.replace(CAMERA, distortion=(0.0,) * 5)
    plane = rng.uniform(-20, 20, (400, 2))
    true = camera.project(np.column_stack((plane, np.zeros(400))))[0]
    H = homography_of_points(true + rng.normal(0, 0.3, true.shape), plane)
    found = np.column_stack((plane, np.ones(400))) @ H.T
    # Eight numbers of 800 equations: .3 sqrt(8 / 800) = .03.
    off = found[:, :2] / found[:, 2:] - true
    assert np.sqrt(np.mean(off**2)) < 0.045
    assert found[:, 2].mean() == pytest.approx(1) and found[:, 2].min() > 0


def test_points_that_tell_no_homography_are_refused():
    square = np.array([(-1.0, 1), (1, 1), (1, -1), (-1, -1)])
    image = np.array([(10.0, 12), (50, 9), (55, 60), (8, 44)])
    for points, match in (
        (image[[0, 3, 2, 1]], "another order"),
        (image[[0, 2, 1, 3]], "another order"),
        (np.array([(10.0, 10), (20, 20), (30, 30), (8, 44)]), "three of four lie on a line"),
        (np.full((4, 2), 7.0), "all one point"),
        (image[:3], r"shape \(3, 2\)"),
        (np.concatenate((image, image)), "8 points on the image, but 4"),
        (np.full((4, 2), np.nan), "is nan"),
    ):
        with pytest.raises(ArrayError, match=match):
            homography_of_points(points, square)


def test_lights_of_the_camera_are_moved_into_the_plane(rng):
    pose = gn.look_at((3.0, -4, 12), (0, 0, 0), (0, 1, 0))
    point = gn.Point((1.0, 2, 3), (4.0, 5, 6), axis=(0.0, 0, 1), exponent=3)
    near, sun = moved_lights([point, gn.Directional((0.0, 0, 1), 2.0)], pose)
    # The camera looks to the origin: what it has ahead lies there.
    np.testing.assert_allclose(sun.direction, np.array([-3, 4, -12]) / 13, atol=1e-12)
    np.testing.assert_allclose(near.axis, sun.direction, atol=1e-12)
    places = rng.normal(size=(5, 3))
    before, after = point.beams(places), near.beams(places @ pose[:3, :3].T + pose[:3, 3])
    np.testing.assert_allclose(after.irradiance, before.irradiance, rtol=1e-9)
    with pytest.raises(ParameterError, match=r"lights\[0\] is Uneven"):
        moved_lights([Uneven(sun, np.zeros((1, 6)))], pose)


def test_a_grid_stands_about_its_centre_with_its_first_row_at_the_top():
    grid = Grid((2, 3), 2.0, (10.0, 1.0))
    np.testing.assert_array_equal(grid.positions()[0], [[8, 2, 0], [10, 2, 0], [12, 2, 0]])
    np.testing.assert_array_equal(grid.positions()[1, :, 1], [0, 0, 0])
    np.testing.assert_array_equal(grid.corners, [[7, 3], [13, 3], [13, -1], [7, -1]])
    for bad in ({"size": (0, 3)}, {"texel": 0.0}, {"centre": (0.0, np.nan)}):
        with pytest.raises(ParameterError):
            Grid(**{"size": (2, 3), "texel": 1.0, **bad})
