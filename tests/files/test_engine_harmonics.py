"""Facts about the nine coefficients of renderers: their own published formulas give gonio's irradiance.

Each formula below is the renderer's, in its axes and from its numbers, with the digits that it prints: six of them, so
that 3e-6 of the largest lies between.
"""

import dataclasses
import json

import numpy as np
import pytest

import gonio as gn
from gonio.files.engine_harmonics import (
    ENGINES,
    Engine,
    as_json,
    from_engine,
    read_sh,
    to_engine,
    unity_shader,
    write_sh,
)
from gonio.lights.harmonic import directional
from gonio.rendering.irradiance import irradiance

ROOT_PI = np.sqrt(np.pi)


def three_js_radiance(sh, n):
    """SphericalHarmonics3.getAt."""
    x, y, z = n[:, :1], n[:, 1:2], n[:, 2:]
    total = sh[0] * 0.282095 + 0.488603 * (sh[1] * y + sh[2] * z + sh[3] * x)
    total = total + 1.092548 * (sh[4] * x * y + sh[5] * y * z + sh[7] * x * z)
    return total + sh[6] * 0.315392 * (3 * z * z - 1) + sh[8] * 0.546274 * (x * x - y * y)


def three_js_irradiance(sh, n):
    """SphericalHarmonics3.getIrradianceAt."""
    x, y, z = n[:, :1], n[:, 1:2], n[:, 2:]
    total = sh[0] * 0.886227 + 2 * 0.511664 * (sh[1] * y + sh[2] * z + sh[3] * x)
    total = total + 2 * 0.429043 * (sh[4] * x * y + sh[5] * y * z + sh[7] * x * z)
    return total + sh[6] * (0.743125 * z * z - 0.247708) + sh[8] * 0.429043 * (x * x - y * y)


def filament_irradiance(sh, n):
    """Irradiance_SphericalHarmonics of the shaders, renderPreScaledSH3Bands of CubemapSH.cpp: irradiance / pi."""
    x, y, z = n[:, :1], n[:, 1:2], n[:, 2:]
    first = sh[0] + sh[1] * y + sh[2] * z + sh[3] * x
    second = sh[4] * y * x + sh[5] * y * z + sh[6] * (3 * z * z - 1) + sh[7] * z * x + sh[8] * (x * x - y * y)
    return np.pi * (first + second)


def unity_irradiance(sh, n):
    """SHEvalLinearL0L1, SHEvalLinearL2 of EntityLighting.hlsl on the vectors of PackCoefficients: irradiance / pi."""
    packed = unity_shader(sh)
    one = np.concatenate((n, np.ones((len(n), 1))), axis=-1)
    products = n[:, [0, 1, 2, 2]] * n[:, [1, 2, 2, 0]]  # xyzz * yzzx
    last = (n[:, 0] ** 2 - n[:, 1] ** 2)[:, None] * packed[6, :3]
    return np.pi * (one @ packed[:3].T + products @ packed[3:6].T + last)


def unreal_irradiance(sh, n):
    """DotSH3 of the light with CalcDiffuseTransferSH3(n, 1), whose basis is SHBasisFunction3 (SHCommon.ush)."""
    x, y, z = n.T
    basis = np.stack(
        (
            np.full_like(x, 0.282095), -0.488603 * y, 0.488603 * z, -0.488603 * x,
            1.092548 * x * y, -1.092548 * y * z, 0.315392 * (3 * z * z - 1), -1.092548 * x * z,
            0.546274 * (x * x - y * y),
        )
    )  # fmt: skip
    l0, l1, l2 = 2 * np.pi / (1 + 1), 2 * np.pi / (2 + 1), 2 * np.pi / (3 + 4 + 1)
    return (basis * np.repeat([l0, l1, l2], [1, 3, 5])[:, None]).T @ sh


def unreal_sky(sh, n):
    """GetSkySHDiffuse on the seven vectors of SetupSkyIrradianceEnvironmentMapConstantsFromSkyIrradiance: / pi."""
    c0, c1, c2 = 1 / (2 * ROOT_PI), np.sqrt(3) / (3 * ROOT_PI), np.sqrt(15) / (8 * ROOT_PI)
    c3, c4 = np.sqrt(5) / (16 * ROOT_PI), np.sqrt(15) / (16 * ROOT_PI)
    first = np.stack((-c1 * sh[3], -c1 * sh[1], c1 * sh[2], c0 * sh[0] - c3 * sh[6]))
    second = np.stack((c2 * sh[4], -c2 * sh[5], 3 * c3 * sh[6], -c2 * sh[7]))
    one = np.concatenate((n, np.ones((len(n), 1))), axis=-1)
    products = n[:, [0, 1, 2, 2]] * n[:, [1, 2, 2, 0]]
    return np.pi * (one @ first + products @ second + (n[:, :1] ** 2 - n[:, 1:2] ** 2) * c4 * sh[8])


def godot_irradiance(sh, n):
    """The lightmap capture of scene_forward_clustered.glsl: what it adds to ambient light, irradiance / pi."""
    x, y, z = n[:, :1], n[:, 1:2], n[:, 2:]
    total = 0.886227 * sh[0] + 1.023327 * (sh[1] * y + sh[2] * z + sh[3] * x)
    total = total + 0.858086 * (sh[4] * x * y + sh[5] * y * z + sh[7] * x * z)
    return np.pi * (total + 0.247708 * sh[6] * (3 * z * z - 1) + 0.429043 * sh[8] * (x * x - y * y))


def godot_probe(radiance, w, area):
    """MODE_LIGHT_PROBES of lm_compute.glsl: 4 / rays times the sum of light x basis; a ray stands for 4 pi / rays."""
    x, y, z = w.T
    basis = np.stack(
        (
            np.full_like(x, 0.282095), 0.488603 * y, 0.488603 * z, 0.488603 * x,
            1.092548 * x * y, 1.092548 * y * z, 0.315392 * (3 * z * z - 1), 1.092548 * x * z,
            0.546274 * (x * x - y * y),
        )
    )  # fmt: skip
    return 4 * (basis * (area / (4 * np.pi))) @ radiance


FORMULAS = [
    (Engine.THREE_JS, three_js_irradiance),
    (Engine.FILAMENT, filament_irradiance),
    (Engine.UNITY, unity_irradiance),
    (Engine.UNREAL, unreal_irradiance),
    (Engine.UNREAL, unreal_sky),
    (Engine.GODOT, godot_irradiance),
]


def light(rng):
    return rng.normal(size=(9, 3))


def directions(rng, count=100):
    return gn.normalise(rng.normal(size=(count, 3)))


@pytest.mark.parametrize(("engine", "formula"), FORMULAS)
def test_the_engines_own_formula_in_its_axes_gives_our_irradiance(rng, engine, formula):
    f, n = light(rng), directions(rng)
    theirs = formula(to_engine(f, engine), n @ engine.axes.T)
    ours = irradiance(f, n)
    np.testing.assert_allclose(theirs, ours, atol=3e-6 * abs(ours).max())


def test_three_js_reads_our_radiance(rng):
    f, n = light(rng), directions(rng)
    ours = gn.harmonics(2, n) @ f
    theirs = three_js_radiance(to_engine(f, Engine.THREE_JS), n @ Engine.THREE_JS.axes.T)
    np.testing.assert_allclose(theirs, ours, atol=3e-6 * abs(ours).max())


def test_godot_bakes_from_rays_what_we_write(rng):
    f, grid = light(rng), gn.LatLong(32, 64)
    w, area = grid.directions().reshape(-1, 3), np.repeat(grid.weights, 64)
    baked = godot_probe(gn.harmonics(2, w) @ f, w @ Engine.GODOT.axes.T, area)
    np.testing.assert_allclose(baked, to_engine(f, Engine.GODOT), atol=3e-6 * abs(f).max())


def test_filament_stores_the_products_of_cmgens_table(rng):
    """preprocessSHForShader: A_i / pi times irradiance coefficients against harmonics with (-1)^m; A has such signs."""
    f = light(rng)
    A = np.array([0.282095, -0.488603, 0.488603, -0.488603, 1.092548, -1.092548, 0.315392, -1.092548, 0.546274])
    Al = np.repeat([np.pi, 2 * np.pi / 3, np.pi / 4], [1, 3, 5])
    signed = to_engine(f, dataclasses.replace(Engine.UNREAL, axes=Engine.FILAMENT.axes))
    cmgen = (A * Al)[:, None] * signed / np.pi
    np.testing.assert_allclose(to_engine(f, Engine.FILAMENT), cmgen, atol=3e-6 * abs(f).max())


def test_unity_stores_what_its_rescaling_undoes(rng):
    """UndoCosineRescaling multiplies by these to come to L_lm against harmonics with (-1)^m."""
    f = light(rng)
    undo = [3.5449076, -3.0699801, 3.0699801, -3.0699801, 3.6611648, -3.6611648, 12.682647, -3.6611648, 7.3223295]
    signed = to_engine(f, dataclasses.replace(Engine.UNREAL, axes=Engine.UNITY.axes))
    np.testing.assert_allclose(to_engine(f, Engine.UNITY) * np.array(undo)[:, None], signed, rtol=2e-7, atol=1e-12)


# A lamp towards +x, +y, +z of gonio's world, and where it stands in each engine's.
LAMPS = [
    (Engine.GONIO, "+X +Y +Z"),
    (Engine.THREE_JS, "+X -Z +Y"),
    (Engine.FILAMENT, "+X -Z +Y"),
    (Engine.GODOT, "+X -Z +Y"),
    (Engine.UNITY, "-X -Z +Y"),
    (Engine.UNREAL, "+X -Y +Z"),
]


@pytest.mark.parametrize(("engine", "places"), LAMPS)
def test_a_lamp_on_each_axis_stands_where_glTF_would_bring_it(engine, places):
    for axis, place in zip(np.eye(3), places.split(), strict=True):
        numbers = to_engine(directional(2, axis)[:, None], engine)[:, 0]
        k = {"X": 3, "Y": 1, "Z": 2}[place[1]]
        # Linear terms go with Y, Z, X; Unreal's with -Y, Z, -X.
        basis = -1 if engine is Engine.UNREAL and k != 2 else 1
        sign = 1 if place[0] == "+" else -1
        linear = np.zeros(4)
        linear[k] = sign * basis * abs(engine.factors[k]) * np.sqrt(3 / (4 * np.pi))
        np.testing.assert_allclose(numbers[1:4], linear[1:], atol=1e-15)


@pytest.mark.parametrize(
    ("engine", "orientation", "centre", "right"),
    [
        (Engine.THREE_JS, gn.Orientation.THREE_JS, "X", "Z"),
        (Engine.FILAMENT, gn.Orientation.FILAMENT, "Z", "-X"),
        (Engine.FILAMENT, gn.Orientation.FILAMENT_UNMIRRORED, "Z", "X"),
    ],
)
def test_a_picture_in_a_tools_orientation_has_its_light_where_the_tool_has_it(engine, orientation, centre, right):
    """Lamps at the picture's centre and a quarter of its width beside it, by the table of `orientation.py`."""
    for column, place in ((32, centre), (48, right)):
        image = np.zeros((32, 64, 3))
        image[15:17, column - 1 : column + 1] = 1
        numbers = to_engine(gn.Environment(image, orientation=orientation).harmonics(2), engine)[:, 0]
        k = {"X": 3, "Y": 1, "Z": 2}[place[-1]]
        others = [j for j in (1, 2, 3) if j != k]
        assert (numbers[k] < 0) == place.startswith("-") and abs(numbers[others]).max() < 1e-12 * abs(numbers[k])


@pytest.mark.parametrize(
    ("engine", "numbers"),
    [
        # A lamp of unit irradiance towards gonio's +x, by hand: Y_lm(x) = .282095, 0, 0, .488603, 0, 0, -.315392, 0,
        # .546274 in every one of these axes but for the sign of X.
        (Engine.GONIO, [0.282095, 0, 0, 0.488603, 0, 0, -0.315392, 0, 0.546274]),
        (Engine.THREE_JS, [0.282095, 0, 0, 0.488603, 0, 0, -0.315392, 0, 0.546274]),
        (Engine.UNREAL, [0.282095, 0, 0, -0.488603, 0, 0, -0.315392, 0, 0.546274]),
        (Engine.GODOT, [0.0897935, 0, 0, 0.155527, 0, 0, -0.100392, 0, 0.173885]),
        # .282095^2, .488603^2 2/3, .315392^2 / 4, .546274^2 / 4.
        (Engine.FILAMENT, [0.0795775, 0, 0, 0.159155, 0, 0, -0.0248680, 0, 0.0746039]),
        (Engine.UNITY, [0.0795775, 0, 0, -0.159155, 0, 0, -0.0248680, 0, 0.0746039]),
    ],
)
def test_the_numbers_of_a_lamp_are_these(engine, numbers):
    f = directional(2, [1.0, 0, 0])[:, None]
    np.testing.assert_allclose(to_engine(f, engine)[:, 0], numbers, atol=1e-6)


def test_the_axes_are_right_and_left_handed_as_their_engines():
    handed = {name: round(np.linalg.det(engine.axes)) for name, engine in ENGINES.items()}
    assert handed == {"gonio": 1, "three.js": 1, "filament": 1, "unity": -1, "unreal": -1, "godot": 1}


@pytest.mark.parametrize("engine", ENGINES.values(), ids=ENGINES)
def test_there_and_back_is_where_one_was(rng, engine):
    f = light(rng)
    np.testing.assert_allclose(from_engine(to_engine(f, engine), engine), f, atol=1e-14)


def test_other_axes_are_a_replacement(rng):
    """Unity with gonio's +y ahead instead of behind: half a turn about the vertical."""
    f, n = light(rng), directions(rng)
    ahead = dataclasses.replace(Engine.UNITY, axes=np.array([[1.0, 0, 0], [0, 0, 1], [0, 1, 0]]))
    theirs = unity_irradiance(to_engine(f, ahead), n[:, [0, 2, 1]])
    np.testing.assert_allclose(theirs, irradiance(f, n), atol=1e-12)


@pytest.mark.parametrize("engine", ENGINES.values(), ids=ENGINES)
def test_files_are_read_back_by_the_name_that_stands_in_them(rng, tmp_path, engine):
    f = light(rng)
    path = tmp_path / "sh.json"
    write_sh(path, f, engine)
    np.testing.assert_allclose(read_sh(path), f, atol=1e-14)
    np.testing.assert_allclose(read_sh(path, engine), f, atol=1e-14)
    said = json.loads(path.read_text())
    assert (said["engine"], said["stores"]) == (engine.name, engine.stores)
    np.testing.assert_allclose(said["numbers"], to_engine(f, engine), rtol=1e-15)


def test_axes_are_said_in_words():
    assert "X, Y, Z = -x, z, -y of gonio's world" in as_json(np.zeros((9, 3)), Engine.UNITY)
    assert "X, Y, Z = x, -y, z of gonio's world" in as_json(np.zeros((9, 3)), Engine.UNREAL)


def test_filaments_text_is_what_cmgen_writes(rng, tmp_path):
    f = light(rng)
    path = tmp_path / "sh.txt"
    write_sh(path, f, Engine.FILAMENT)
    lines = path.read_text().splitlines()
    numbers = to_engine(f, Engine.FILAMENT)
    assert lines[1] == "({:18.15f}, {:18.15f}, {:18.15f}); // L1-1, irradiance, pre-scaled base".format(*numbers[1])
    # 15 decimals; the smallest factor divides their rounding by .0788.
    np.testing.assert_allclose(read_sh(path), f, atol=1e-14)


def test_a_text_of_cmgen_is_read(tmp_path):
    """The first lines as in Filament's samples: white light from above, on the ground none."""
    path = tmp_path / "sh.txt"
    rows = [(0.5, 0.5, 0.5), (0.5, 0.25, 0), *[(0, 0, 0)] * 7]
    names = ("00", "1-1", "10", "11", "2-2", "2-1", "20", "21", "22")
    path.write_text(
        "".join(
            "(" + ", ".join(f"{v:18.15f}" for v in row) + f"); // L{name}, irradiance, pre-scaled base\n"
            for row, name in zip(rows, names, strict=True)
        )
    )
    E = irradiance(read_sh(path), np.array([[0, 0, 1.0], [0, 0, -1.0], [1.0, 0, 0]]))
    np.testing.assert_allclose(E, np.pi * np.array([[1, 0.75, 0.5], [0, 0.25, 0.5], [0.5, 0.5, 0.5]]), atol=1e-14)


def test_rows_alone_need_the_name_of_their_engine(rng, tmp_path):
    f, path = light(rng), tmp_path / "sh.json"
    path.write_text(json.dumps(to_engine(f, Engine.UNREAL).tolist()))
    np.testing.assert_allclose(read_sh(path, Engine.UNREAL), f, atol=1e-14)
    with pytest.raises(gn.GonioError, match="no engine is named"):
        read_sh(path)


def test_27_numbers_in_a_row_are_three_js_alone(rng, tmp_path):
    f, path = light(rng), tmp_path / "sh.json"
    path.write_text(json.dumps(to_engine(f, Engine.THREE_JS).ravel().tolist()))
    np.testing.assert_allclose(read_sh(path, Engine.THREE_JS), f, atol=1e-14)
    with pytest.raises(gn.GonioError, match="colours or coefficients"):
        read_sh(path, Engine.UNITY)


def test_another_engine_than_the_files_is_refused(rng, tmp_path):
    write_sh(tmp_path / "sh.json", light(rng), Engine.UNITY)
    with pytest.raises(gn.GonioError, match="unity's, and was to be read as unreal's"):
        read_sh(tmp_path / "sh.json", Engine.UNREAL)


def test_cmgens_plain_coefficients_are_refused(tmp_path):
    path = tmp_path / "sh.txt"
    names = ("00", "1-1", "10", "11", "2-2", "2-1", "20", "21", "22")
    path.write_text("".join(f"( 0.1, 0.1, 0.1); // L{name}\n" for name in names))
    with pytest.raises(gn.GonioError, match="--sh-shader"):
        read_sh(path)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("sh.json", "{"),
        ("sh.json", "[[1, 2, 3]]"),
        ("sh.json", '{"numbers": "nine"}'),
        ("sh.json", '{"engine": "quake", "numbers": []}'),
        ("sh.json", '{"engine": ["unity"], "numbers": [1]}'),
        ("sh.json", '{"engine": "unity", "numbers": [' + ", ".join(["[1, 2, NaN]"] * 9) + "]}"),
        ("sh.json", "[" * 100_000),
        ("sh.json", '[[1, 2], [3]]'),
        ("sh.txt", ""),
        ("sh.txt", "( 0.1, 0.1, 0.1); // L00, irradiance, pre-scaled base\n"),
        ("sh.txt", "( 0.1, nine, 0.1); // L00, irradiance, pre-scaled base\n" * 9),
        ("sh.json", " " * 1_000_001),
    ],
)  # fmt: skip
def test_what_is_no_file_of_coefficients_is_refused(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(gn.GonioError, match=name):
        read_sh(tmp_path / name, Engine.UNITY if name == "sh.json" and text[0] == "[" else None)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(gn.GonioError, match="cannot be read"):
        read_sh(tmp_path / "no.json")


def test_other_files_are_not_written(rng, tmp_path):
    with pytest.raises(gn.GonioError, match=r"\.json, or \.txt"):
        write_sh(tmp_path / "sh.exr", light(rng), Engine.UNITY)
    with pytest.raises(gn.GonioError, match="Filament's"):
        write_sh(tmp_path / "sh.txt", light(rng), Engine.UNITY)
    with pytest.raises(gn.GonioError, match="finite"):
        write_sh(tmp_path / "sh.json", np.full((9, 3), np.nan), Engine.UNITY)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("f", [np.zeros(9), np.zeros((4, 3)), np.zeros((9, 3, 1))])
def test_other_than_nine_coefficients_are_refused(f):
    with pytest.raises(gn.GonioError, match="nine"):
        to_engine(f, Engine.UNITY)
    with pytest.raises(gn.GonioError, match="nine"):
        from_engine(f, Engine.UNITY)


def test_tensors_are_answered_with_tensors(rng):
    torch = pytest.importorskip("torch")
    f = light(rng)
    numbers = to_engine(torch.tensor(f), Engine.UNITY)
    assert isinstance(numbers, torch.Tensor)
    np.testing.assert_allclose(numbers.numpy(), to_engine(f, Engine.UNITY), atol=1e-14)
    np.testing.assert_allclose(unity_shader(numbers).numpy(), unity_shader(to_engine(f, Engine.UNITY)), atol=1e-14)
