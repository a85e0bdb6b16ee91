"""Facts about KTX 2.0 files: what stands at which byte, what is refused, and which way faces stand."""

import struct

import numpy as np
import pytest

import gonio as gn
from gonio.files import ktx2
from gonio.rendering.chain import RoughnessChain, roughness_chain

# VK_FORMAT_R16G16B16A16_SFLOAT by the Khronos Data Format Specification 1.3, written out by hand.
HALF_DESCRIPTOR = bytes.fromhex(
    "5c000000"  # 92 bytes
    "00000000" "0200" "5800"  # Khronos, basic block, version 2, 88 bytes
    "01010100" "00000000" "0800000000000000"  # RGBSDA BT709 linear straight; 1 x 1 x 1 x 1; 8 bytes in plane 0
    "00000fc0" "00000000" "000080bf" "0000803f"  # bits 0-15: red, signed float, from -1 to 1
    "10000fc1" "00000000" "000080bf" "0000803f"
    "20000fc2" "00000000" "000080bf" "0000803f"
    "30000fcf" "00000000" "000080bf" "0000803f"
)  # fmt: skip


def parsed(path):
    """(header's numbers, descriptor, [(key, value)], [level's bytes], [offsets]) by the format's tables."""
    content = path.read_bytes()
    assert content[:12] == bytes([0xAB, 0x4B, 0x54, 0x58, 0x20, 0x32, 0x30, 0xBB, 0x0D, 0x0A, 0x1A, 0x0A])
    header = struct.unpack_from("<9I", content, 12)
    at, length, kvd, kvd_length = struct.unpack_from("<4I", content, 48)
    assert struct.unpack_from("<2Q", content, 64) == (0, 0)
    descriptor = content[at : at + length]
    pairs, here = [], kvd
    while here < kvd + kvd_length:
        (size,) = struct.unpack_from("<I", content, here)
        key, value = content[here + 4 : here + 4 + size].split(b"\0", 1)
        pairs.append((key.decode(), value))
        here += 4 + (size + 3) // 4 * 4
    assert here == kvd + kvd_length
    index = [struct.unpack_from("<3Q", content, 80 + 24 * k) for k in range(header[7])]
    return header, descriptor, pairs, [content[o : o + n] for o, n, _ in index], [o for o, _, _ in index]


@pytest.fixture
def mips(rng):
    return [rng.random((6, 4 >> k, 4 >> k, 3), dtype=np.float32) for k in range(3)]


def test_a_cube_map_stands_at_the_bytes_that_the_format_says(tmp_path, mips):
    path = tmp_path / "cube.ktx2"
    ktx2.write_ktx2(path, mips, {"gonio:why": "because"})
    header, descriptor, pairs, contents, offsets = parsed(path)
    # vkFormat, typeSize, width, height, depth, layers, faces, levels, supercompression
    assert header == (97, 2, 4, 4, 0, 0, 6, 3, 0)
    assert descriptor == HALF_DESCRIPTOR
    assert [key for key, _ in pairs] == ["KTXwriter", "gonio:why"]  # sorted; a cube has no KTXorientation
    assert pairs[1][1] == b"because\0"
    assert offsets[2] < offsets[1] < offsets[0]  # smallest first
    assert all(offset % 8 == 0 for offset in offsets)  # lcm(8, 4)
    assert path.stat().st_size == offsets[0] + len(contents[0])
    for level, content in zip(mips, contents, strict=True):
        texels = np.frombuffer(content, "<f2").reshape(*level.shape[:3], 4)
        np.testing.assert_array_equal(texels[..., :3], level.astype(np.float16))
        np.testing.assert_array_equal(texels[..., 3], 1)


def test_what_half_floats_cannot_hold_is_written_in_single(tmp_path):
    path = tmp_path / "sun.ktx2"
    ktx2.write_ktx2(path, [np.full((2, 4), 1e5)])
    header, descriptor, pairs, (content,), (offset,) = parsed(path)
    assert header == (109, 4, 4, 2, 0, 0, 1, 1, 0)
    assert struct.unpack_from("<B", descriptor, 20) == (16,)  # bytes in plane 0
    assert dict(pairs)["KTXorientation"] == b"rd\0"
    assert offset % 16 == 0
    np.testing.assert_array_equal(np.frombuffer(content, "<f4").reshape(2, 4, 4)[..., :3], np.float32(1e5))


@pytest.mark.parametrize("shape", [(2, 4), (2, 4, 1), (2, 4, 2), (2, 4, 3), (2, 4, 4)])
def test_an_image_comes_back(tmp_path, rng, shape):
    image = rng.random(shape).astype(np.float16)
    ktx2.write_ktx2(tmp_path / "image.ktx2", [image])
    (back,) = ktx2.read_ktx2(tmp_path / "image.ktx2").levels
    assert (back.shape, back.dtype) == ((2, 4, 4), np.float32)
    channels = {(2, 4): 1}.get(shape, shape[-1])
    np.testing.assert_array_equal(back[..., :channels], image.reshape(2, 4, channels))
    if channels == 1:
        np.testing.assert_array_equal(back[..., 2], back[..., 0])
    if channels < 4:
        np.testing.assert_array_equal(back[..., 3], 1)


@pytest.fixture
def chain():
    w = gn.LatLong(16, 32).directions()
    return roughness_chain(gn.Environment(1 + w), 8, 3, error=1e-2)


def test_a_chain_comes_back_as_half_floats_hold_it(tmp_path, chain):
    ktx2.write_chain(tmp_path / "chain.ktx2", chain)
    back = ktx2.read_chain(tmp_path / "chain.ktx2")
    assert isinstance(back, RoughnessChain)
    assert (back.lobe, back.degrees, back.sizes) == ("ggx", chain.degrees, (8, 4, 2))
    np.testing.assert_array_equal(back.alphas, chain.alphas)
    np.testing.assert_array_equal(back.errors, chain.errors)
    for ours, theirs in zip(chain.faces, back.faces, strict=True):
        np.testing.assert_allclose(theirs, ours, rtol=2**-11, atol=1e-7)


@pytest.mark.parametrize("orientation", [None, gn.Orientation.THREE_JS, gn.Orientation.OPENEXR])
def test_six_faces_a_level_show_the_same_light(tmp_path, chain, rng, orientation):
    ktx2.write_chain(tmp_path / "sky_{level}_{face}.exr", chain, orientation)
    assert len(list(tmp_path.glob("sky_?_??.exr"))) == 18
    w = gn.normalise(rng.normal(size=(100, 3)))
    for level in range(3):
        back = gn.read_environment(tmp_path / f"sky_{level}_{{face}}.exr")
        assert back.orientation.name == (orientation or gn.Orientation.PANORAMA).name
        # Pixels are moved, not resampled.
        np.testing.assert_allclose(back.radiance(w), chain.environment(level).radiance(w), atol=1e-6)


def test_a_folder_gets_names_that_cmgen_would_give(tmp_path, chain):
    ktx2.write_chain(tmp_path, chain)
    expected = {f"m{k}_{sign}{axis}.exr" for k in range(3) for sign in "pn" for axis in "xyz"}
    assert {path.name for path in tmp_path.iterdir()} == expected


def test_the_first_face_is_what_lies_towards_x(tmp_path):
    """OpenGL's +X has its centre at X = x of the world, +Y at Y = z, +Z at Z = -y; 8.13 of its specification."""
    w = gn.LatLong(64, 128).directions()
    for face, axis in enumerate(([1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1], [0, -1, 0], [0, 1, 0])):
        lamp = gn.Environment((w @ np.array(axis) > 0.9).astype(float))
        ktx2.write_chain(tmp_path / "lamp.ktx2", roughness_chain(lamp, 4, 1))
        (level,) = ktx2.read_ktx2(tmp_path / "lamp.ktx2").levels
        assert level[..., 0].mean(axis=(1, 2)).argmax() == face


@pytest.mark.parametrize(
    ("levels", "says"),
    [
        ([], "at least one level"),
        ([np.zeros((5, 4, 4, 3))], "shape"),
        ([np.zeros((6, 4, 2, 3))], "square"),
        ([np.zeros((4, 4, 5))], "shape"),
        ([np.zeros((4, 4)), np.zeros((3, 2))], "level 1"),
        ([np.zeros((1, 1)), np.zeros((1, 1))], "level 1"),
        ([np.full((2, 2), np.nan)], "NaN"),
    ],
)
def test_what_is_no_texture_is_refused(tmp_path, levels, says):
    with pytest.raises(gn.GonioError, match=says):
        ktx2.write_ktx2(tmp_path / "no.ktx2", levels)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["chain.dds", "m_{face}.exr", "m_{level}.exr"])
def test_a_name_that_holds_no_chain_is_refused(tmp_path, chain, name):
    with pytest.raises(gn.GonioError, match="six faces a level"):
        ktx2.write_chain(tmp_path / name, chain)


def test_a_texture_in_another_orientation_is_refused(tmp_path, chain):
    with pytest.raises(gn.GonioError, match="stands as OPENGL"):
        ktx2.write_chain(tmp_path / "chain.ktx2", chain, gn.Orientation.FILAMENT)


# (byte, format, value): what a hostile or foreign header says.
LIES = [
    (12, "<I", 37, "R8G8B8A8_UNORM"),
    (12, "<I", 131, "no name here"),
    (20, "<I", 1 << 31, "faces of"),
    (24, "<I", 0, "no single 2D image"),
    (28, "<I", 2, "no single 2D image"),
    (32, "<I", 3, "layers"),
    (36, "<I", 5, "faces"),
    (40, "<I", 1 << 31, "halved"),
    (44, "<I", 2, "Zstandard"),
    (48, "<I", 1 << 31, "descriptor"),
    (52, "<I", 8, "too few"),
    (60, "<I", 1 << 31, "key/value"),
    (80, "<Q", 1 << 63, "level 0"),
    (80, "<Q", 0, "level 0"),
    (88, "<Q", 1 << 62, "level 0"),
    (104, "<Q", 1 << 20, "level 1"),
]


@pytest.mark.parametrize(("at", "form", "value", "says"), LIES)
def test_headers_that_lie_are_refused_by_name(tmp_path, mips, at, form, value, says):
    path = tmp_path / "cube.ktx2"
    ktx2.write_ktx2(path, mips)
    content = bytearray(path.read_bytes())
    struct.pack_into(form, content, at, value)
    path.write_bytes(content)
    with pytest.raises(gn.GonioError, match=says) as refused:
        ktx2.read_ktx2(path)
    assert str(refused.value).startswith(str(path))


def test_gamma_in_the_descriptor_is_refused(tmp_path, mips):
    path = tmp_path / "cube.ktx2"
    ktx2.write_ktx2(path, mips)
    content = bytearray(path.read_bytes())
    (at,) = struct.unpack_from("<I", content, 48)
    content[at + 14] = 2  # sRGB
    path.write_bytes(content)
    with pytest.raises(gn.GonioError, match="transfer 2"):
        ktx2.read_ktx2(path)


def test_an_image_upside_down_is_refused(tmp_path):
    path = tmp_path / "image.ktx2"
    ktx2.write_ktx2(path, [np.zeros((4, 4))])
    path.write_bytes(path.read_bytes().replace(b"KTXorientation\0rd", b"KTXorientation\0ru"))
    with pytest.raises(gn.GonioError, match="'ru'"):
        ktx2.read_ktx2(path)


def test_a_file_that_is_cut_or_spoilt_anywhere_is_read_or_refused_but_nothing_else(tmp_path, mips, rng):
    path = tmp_path / "cube.ktx2"
    ktx2.write_ktx2(path, mips)
    whole = path.read_bytes()
    for length in range(0, len(whole), 13):
        path.write_bytes(whole[:length])
        with pytest.raises(gn.GonioError):
            ktx2.read_ktx2(path)
    for _ in range(300):
        spoilt = bytearray(whole)
        for at in rng.integers(12, 300, 3):
            spoilt[at] = rng.integers(256)
        path.write_bytes(spoilt)
        try:
            ktx2.read_ktx2(path)
        except gn.GonioError:
            continue


def test_a_cube_map_of_others_is_no_chain(tmp_path, mips):
    ktx2.write_ktx2(tmp_path / "cube.ktx2", mips)
    with pytest.raises(gn.GonioError, match="do not describe a chain"):
        ktx2.read_chain(tmp_path / "cube.ktx2")


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(gn.GonioError, match="cannot be read"):
        ktx2.read_ktx2(tmp_path / "no.ktx2")
