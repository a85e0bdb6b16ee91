import numba
import numpy as np
import pytest

import gonio as gn
from gonio.errors import FileError, ParameterError
from gonio.files import environments
from gonio.files.images import write_images
from gonio.frames import euler

O = gn.Orientation
compiled = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="takes minutes where loops are not compiled")


@pytest.fixture
def room(rng):
    image = rng.random((12, 24, 3)).astype(np.float32)
    return gn.Environment(image, gn.LatLongMap(), O.PANORAMA)


def test_the_layout_is_told_by_shape(tmp_path, rng):
    for mapping, rows in (
        (gn.LatLongMap(), 4), (gn.CubeCross(), 8), (gn.CubeCross(vertical=False), 6), (gn.CubeStrip(), 12),
        (gn.CubeStrip(vertical=False), 2),
    ):  # fmt: skip
        path = tmp_path / "room.exr"
        gn.write_image(path, rng.random((*mapping.shape(rows), 3)))
        read = gn.read_environment(path)
        assert read.mapping == mapping and read.orientation is O.PANORAMA


def test_a_square_picture_has_to_be_named(tmp_path):
    path = tmp_path / "ball.exr"
    gn.write_image(path, np.ones((8, 8, 3)))
    with pytest.raises(FileError, match=r"ball.exr: 8 x 8 .* AngularMap and MirrorBall 1:1"):
        gn.read_environment(path)
    assert gn.read_environment(path, gn.MirrorBall()).orientation is O.PROBE


def test_a_picture_of_no_layout_lists_the_choices(tmp_path):
    path = tmp_path / "photo.exr"
    gn.write_image(path, np.ones((8, 11, 3)))
    with pytest.raises(FileError, match="Name it: LatLongMap"):
        gn.read_environment(path)
    with pytest.raises(FileError, match=r"photo.exr: LatLongMap: .* does not fit"):
        gn.read_environment(path, gn.LatLongMap())


@pytest.mark.parametrize("orientation", [O.PANORAMA, O.MITSUBA, O.BLENDER, O.THREE_JS, O.OPENEXR, O.GONIO])
def test_what_is_written_for_a_tool_is_read_back_from_it_pixel_by_pixel(tmp_path, room, orientation):
    path = tmp_path / "room.exr"
    gn.write_environment(path, room, orientation=orientation)
    back = gn.read_environment(path, orientation=orientation)
    np.testing.assert_array_equal(back.resampled(gn.LatLongMap(), 12, O.PANORAMA).image, room.image)


@pytest.mark.parametrize("suffix", ["exr", "hdr"])
@pytest.mark.parametrize("orientation", [O.PANORAMA, O.OPENEXR, O.GONIO.rotated(euler(0.7, -0.4, 2.1))])
@pytest.mark.parametrize(
    ("mapping", "rows"),
    [
        (gn.LatLongMap(), 8), (gn.CubeCross(vertical=False), 9), (gn.CubeStrip.openexr(), 24), (gn.AngularMap(), 16),
        (gn.MirrorBall(5.0), 16), (gn.DualParaboloid(1.1), 16),
    ],
)  # fmt: skip
def test_what_is_written_without_words_is_read_without_words(tmp_path, rng, suffix, orientation, mapping, rows):
    if orientation is O.OPENEXR and not isinstance(mapping, gn.LatLongMap | gn.CubeStrip | gn.CubeCross):
        orientation = O.PROBE
    room = gn.Environment(rng.random((*mapping.shape(rows), 3)).astype(np.float32), mapping, orientation)
    path = tmp_path / f"room.{suffix}"
    gn.write_environment(path, room, mapping, orientation)
    back = gn.read_environment(path)
    assert back.mapping == mapping and back.orientation.name == orientation.name
    w = gn.normalise(rng.normal(size=(200, 3)))
    # Radiance pictures keep 8 bits of a pixel's largest channel.
    np.testing.assert_allclose(back.radiance(w), room.radiance(w), atol=0 if suffix == "exr" else 1 / 256)


def test_openexr_s_own_words_are_written_where_it_has_them(tmp_path, room):
    path = tmp_path / "room.exr"
    for mapping, orientation, word in (
        (gn.LatLongMap(), O.OPENEXR, "latlong"),
        (gn.CubeStrip.openexr(), O.OPENEXR, "cube"),
        (gn.CubeStrip(), O.OPENEXR, None),
        (gn.LatLongMap(), O.PANORAMA, None),
    ):
        gn.write_environment(path, room, mapping, orientation)
        assert gn.image_info(path).attributes.get("envmap") == word


def test_words_that_are_passed_override_the_header(tmp_path, room):
    path = tmp_path / "room.exr"
    gn.write_environment(path, room, orientation=O.MITSUBA)
    assert gn.read_environment(path, gn.LatLongMap()).orientation is O.MITSUBA
    assert gn.read_environment(path, orientation=O.BLENDER).orientation is O.BLENDER
    assert gn.read_environment(path, gn.DualParaboloid()).orientation is O.PROBE


@pytest.mark.parametrize("said", ["?", "[]", '{"layout": "Globe", "orientation": "PROBE"}',
    '{"layout": "LatLongMap", "orientation": "x", "right": [1, 0], "up": [0, 1], "centre": [0, 0]}'])  # fmt: skip
def test_a_header_of_nonsense_is_refused(tmp_path, said):
    path = tmp_path / "room.exr"
    write_images({path: np.ones((4, 8, 3))}, attributes={"gonio:environment": said})
    with pytest.raises(FileError, match=r"room.exr: the header's gonio:environment"):
        gn.read_environment(path)


def test_another_layout_keeps_light_and_resolution(tmp_path, rng):
    w = gn.normalise(rng.normal(size=(200, 3)))
    own, _ = gn.LatLongMap().directions(48, 96)
    smooth = gn.Environment((2 + own @ [[1.0], [0.5], [-0.3]]).repeat(3, -1), gn.LatLongMap(), O.GONIO)
    for mapping, orientation in (
        (gn.CubeCross(), O.PANORAMA),
        (gn.AngularMap(), O.PROBE),
        (gn.CubeStrip(), O.THREE_JS),
    ):
        path = tmp_path / "room.exr"
        gn.write_environment(path, smooth, mapping, orientation)
        back = gn.read_environment(path, mapping, orientation)
        assert 0.5 < back.solid_angles.max() / smooth.solid_angles.max() < 2
        np.testing.assert_allclose(back.radiance(w), smooth.radiance(w), rtol=0.02)


@pytest.mark.parametrize(
    "names",
    [("px", "nx", "py", "ny", "pz", "nz"), ("sky_right", "sky_left", "sky_top", "sky_bottom", "sky_front", "sky_back")],
)
def test_six_faces_are_known_by_their_names_in_any_order(tmp_path, names, rng):
    image = rng.random((24, 4, 3)).astype(np.float32)
    paths = [tmp_path / f"{name}.exr" for name in names]
    for k, path in enumerate(paths):
        gn.write_image(path, image[4 * k : 4 * k + 4])
    read = gn.read_environment(paths[::-1], orientation=O.OPENGL)
    np.testing.assert_array_equal(read.image, image)


@pytest.mark.parametrize("orientation", [O.OPENGL, O.OPENEXR], ids=lambda o: o.name)
def test_six_faces_are_written_and_read_by_one_pattern(tmp_path, room, orientation):
    gn.write_environment(tmp_path / "sky_{face}.exr", room, orientation=orientation)
    assert sorted(p.name for p in tmp_path.iterdir()) == [f"sky_{s}{a}.exr" for s in "np" for a in "xyz"]
    # The middle of pz shows the tool's +Z, which is -y of gonio's world; an even number of pixels meet there.
    face = gn.read_image(tmp_path / "sky_pz.exr")
    n = len(face) // 2
    back = gn.read_environment(tmp_path / "sky_{face}.exr")
    np.testing.assert_allclose(
        back.radiance([0.0, -1.0, 0.0]), face[n - 1 : n + 1, n - 1 : n + 1].mean((0, 1)), rtol=1e-5
    )
    assert back.orientation is orientation
    expected = room.resampled(back.mapping, back.rows, orientation)
    np.testing.assert_array_equal(back.image, expected.image)
    with pytest.raises(FileError, match=r"sky_px.hdr does not exist"):
        gn.read_environment(tmp_path / "sky_{face}.hdr")


def test_of_six_faces_none_appears_where_one_fails(tmp_path, room):
    (tmp_path / "sky_nz.exr").mkdir()
    with pytest.raises(FileError, match=r"sky_nz.exr is a folder"):
        gn.write_environment(tmp_path / "sky_{face}.exr", room)
    with pytest.raises(ParameterError, match=r"six faces.* not of CubeCross"):
        gn.write_environment(tmp_path / "sky_{face}.exr", room, gn.CubeCross())
    assert [p.name for p in tmp_path.iterdir()] == ["sky_nz.exr"]


def test_faces_that_cannot_be_told_apart_are_refused(tmp_path):
    paths = [tmp_path / f"{k}.exr" for k in range(6)]
    for path in paths:
        gn.write_image(path, np.ones((4, 4, 3)))
    with pytest.raises(FileError, match="which face"):
        gn.read_environment(paths)
    with pytest.raises(FileError, match="3 files"):
        gn.read_environment(paths[:3])


def test_a_pair_of_unlike_pictures_is_refused(tmp_path):
    gn.write_image(tmp_path / "a-front.exr", np.ones((4, 4, 3)))
    gn.write_image(tmp_path / "a-back.exr", np.ones((4, 6, 3)))
    with pytest.raises(FileError, match="square and of one size"):
        gn.read_environment([tmp_path / "a-back.exr", tmp_path / "a-front.exr"])


def test_a_tool_without_such_maps_is_refused(tmp_path, room):
    with pytest.raises(ParameterError, match="BLENDER says nothing about cubes"):
        gn.write_environment(tmp_path / "room.exr", room, gn.CubeStrip(), O.BLENDER)
    assert not list(tmp_path.iterdir())


@compiled
@pytest.mark.filterwarnings("ignore::gonio.errors.AlphaWarning")
@pytest.mark.parametrize(("name", "tolerance"), [("Orientation", 0.07), ("StageEnv", 0.2)])
def test_openexr_s_lat_long_and_cube_of_one_scene_agree(data, name, tolerance):
    # Labelled axes in black on white (standard deviation .2), and a stage with lamps. OpenEXR's own programs put the
    # outermost pixels' centres on the picture's edge, so that the two differ by up to half a pixel; a wrong or mirrored
    # face would leave .28 (twice the variance).
    flat = gn.read_environment(data / f"environments/{name}LatLong.exr")
    cube = gn.read_environment(data / f"environments/{name}Cube.exr")
    assert flat.mapping == gn.LatLongMap() and cube.mapping == gn.CubeStrip.openexr()
    assert flat.orientation is O.OPENEXR and cube.orientation is O.OPENEXR
    there = cube.resampled(gn.LatLongMap(), flat.rows, O.OPENEXR)
    band = slice(flat.rows // 8, -flat.rows // 8)
    off = there.image[band] - flat.image[band]
    assert np.sqrt((off**2).mean()) < tolerance * (1 if name == "Orientation" else flat.image[band].std())


@compiled
@pytest.mark.filterwarnings("ignore::gonio.errors.AlphaWarning")
def test_openexr_s_maps_agree_to_a_tenth_with_their_pixels_on_the_edges(data):
    # The same, looked up where ImfEnvmap says the lat-long map's pixels lie: what is left is the cube's half pixel.
    flat = gn.read_environment(data / "environments/OrientationLatLong.exr")
    cube = gn.read_environment(data / "environments/OrientationCube.exr")
    r, c = np.mgrid[: flat.rows, : flat.columns]
    latitude, longitude = np.pi * (0.5 - r / (flat.rows - 1)), 2 * np.pi * (0.5 - c / (flat.columns - 1))
    x, y, z = np.sin(longitude) * np.cos(latitude), np.sin(latitude), np.cos(longitude) * np.cos(latitude)
    off = (cube.radiance(np.stack((x, -z, y), -1)) - flat.image)[64:-64]
    assert np.sqrt((off**2).mean()) < 0.03


@pytest.mark.parametrize("side", [1, 9, 16])
def test_cubes_in_another_order_of_faces_keep_every_texel(side, rng):
    cube = gn.Environment(rng.random((6 * side, side, 3)), gn.CubeStrip(), gn.Orientation.OPENGL)
    for mapping, orientation in (
        (gn.CubeStrip.openexr(), gn.Orientation.OPENEXR),
        (gn.CubeCross(vertical=True), gn.Orientation.PANORAMA),
    ):
        picture = environments.as_picture(cube, mapping, orientation)
        kept = np.sort(picture.image[picture.solid_angles > 0], axis=None)
        np.testing.assert_array_equal(kept, np.sort(cube.image, axis=None))
