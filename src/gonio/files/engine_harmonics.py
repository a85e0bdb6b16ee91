"""Nine coefficients of the light as renderers store them: numbers_k = factor_k L_k, L in the renderer's own axes.

    engine     axes, from gonio's (x, y, z)    basis             what is stored
    GONIO      X = x,  Y = y,  Z = z           as below          radiance L_lm
    THREE_JS   X = x,  Y = z,  Z = -y          the same          radiance L_lm
    FILAMENT   X = x,  Y = z,  Z = -y          polynomials       irradiance / pi
    UNITY      X = -x, Y = z,  Z = -y          polynomials       irradiance / pi
    UNREAL     X = x,  Y = -y, Z = z           (-1)^m as below   radiance L_lm
    GODOT      X = x,  Y = z,  Z = -y          the same          radiance L_lm / pi

All go through l, m = 00, 1-1, 10, 11, 2-2, 2-1, 20, 21, 22, a row (r, g, b) each. The basis is Y_lm of RH 4.5 in the
axes: 1, Y, Z, X, XY, YZ, 3ZZ - 1, XZ, XX - YY with its norms; "polynomials" are these without norms, which stand in
the numbers, A_l / pi of RH 4.12 as well, so that a shader adds nine products and multiplies by the albedo.

The axes are those in which a scene arrives that was z up and travels as glTF, (x, z, -y): three.js, Filament and Godot
take it as it is (Y up, right-handed); importers of Unity turn X about (left-handed, Y up: UnityGLTF's
SchemaExtensions.CoordinateSpaceConversionScale); Unreal exchanges Y and Z (left-handed, Z up: GLTFExporter's
FGLTFCoreUtilities::ConvertVector). So light and scene stay together. Other axes: `dataclasses.replace(Engine.UNITY,
axes=...)`.

Sources, each with the formula that a test holds against `irradiance`:
    three.js   src/math/SphericalHarmonics3.js: getAt, getIrradianceAt
    Filament   libs/ibl/src/CubemapSH.cpp: preprocessSHForShader, renderPreScaledSH3Bands; sh.txt as tools/cmgen writes
               with --sh-shader or --deploy. Plain --sh is another thing: (-1)^m, without A_l, and is refused
    Unity      SphericalHarmonicsL2, sh[channel, k] being row k: PackCoefficients and UndoCosineRescaling of HDRP's
               SphericalHarmonics.cs; SHEvalLinearL0L1 and SHEvalLinearL2 of EntityLighting.hlsl
    Unreal     FSHVectorRGB3, R.V[k] being number k of red: SHBasisFunction3, CalcDiffuseTransferSH3 of SHCommon.ush;
               SetupSkyIrradianceEnvironmentMapConstantsFromSkyIrradiance of SceneRendering.cpp
    Godot      LightmapGIData's capture_sh, nine colours a probe: MODE_LIGHT_PROBES of lightmapper_rd/lm_compute.glsl,
               USE_LIGHTMAP_CAPTURE of scene_forward_clustered.glsl

Not here: exposure and whatever else a renderer multiplies light by, ringing (`rendering/deringing.py`), Godot's
lightmaps of four coefficients.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import re
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ..arrays import Array, floats, like
from ..errors import ArrayError, FileError
from ..sphere.harmonics import degrees_and_orders
from ..sphere.rotation import rotate
from ..sphere.zonal import clamped_cosine
from .whole import writing

_L, _M = degrees_and_orders(2)
NAMES = tuple(f"L{l}{m}" for l, m in zip(_L, _M, strict=True))
_LARGEST = 1_000_000  # bytes of a file that holds 27 numbers
_NUMBER = r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*"
_LINE = re.compile(rf"\({_NUMBER},{_NUMBER},{_NUMBER}\)\s*;?\s*//\s*(L\d-?\d)(.*)")


@dataclasses.dataclass(frozen=True, eq=False)
class Engine:
    """`axes` (3, 3): directions of gonio's world to the engine's, W = axes w, orthogonal, determinant +1 or -1;
    `factors` (9,): what each L_lm in these axes is multiplied by; `stores`: in words, what that gives.

    The published ones are `Engine.UNITY` and so on, all of them in `ENGINES` by name.
    """

    name: str
    axes: np.ndarray
    factors: np.ndarray
    stores: str

    GONIO: ClassVar[Engine]
    THREE_JS: ClassVar[Engine]
    FILAMENT: ClassVar[Engine]
    UNITY: ClassVar[Engine]
    UNREAL: ClassVar[Engine]
    GODOT: ClassVar[Engine]


def to_engine(coefficients: Array, engine: Engine) -> Array:
    """The engine's numbers (9, C) from the coefficients of the radiance (9, C) in gonio's axes and basis.

    Raises `ArrayError` for other shapes.
    """
    _, f = floats(coefficients)
    _require_nine(f, "coefficients")
    return _turned(f, engine.axes) * like(engine.factors[:, None], f)


def from_engine(numbers: Array, engine: Engine) -> Array:
    """The inverse of `to_engine`: coefficients of the radiance (9, C) from the engine's numbers (9, C)."""
    _, f = floats(numbers)
    _require_nine(f, "numbers")
    return _turned(f * like(1 / engine.factors[:, None], f), engine.axes.T)


def unity_shader(numbers: Array) -> Array:
    """(7, 4): unity_SHAr, SHAg, SHAb, SHBr, SHBg, SHBb, SHC, from Unity's numbers (9, 3).

    The shader adds SHA.(n, 1) + SHB.(XY, YZ, ZZ, ZX) + SHC.rgb (X^2 - Y^2): the -1 of 3Z^2 - 1 goes with the constant.
    """
    xp, f = floats(numbers)
    if tuple(f.shape) != (9, 3):
        raise ArrayError(f"numbers have shape {tuple(f.shape)}; Unity's shaders take three colours: (9, 3).")
    first = xp.stack((f[3, :], f[1, :], f[2, :], f[0, :] - f[6, :]), axis=-1)
    second = xp.stack((f[4, :], f[5, :], 3 * f[6, :], f[7, :]), axis=-1)
    third = xp.concat((f[8, :], xp.ones_like(f[8, :1])), axis=0)[None, :]
    return xp.concat((first, second, third), axis=0)


def write_sh(path: str | os.PathLike[str], coefficients: Array, engine: Engine) -> None:
    """Writes the engine's numbers of the radiance's coefficients (9, 3), or (9, 1) for grey light.

    .json: an object with the engine's name, what its numbers mean, and nine rows (r, g, b). .txt: Filament's sh.txt.
    Raises `FileError` for other suffixes, .txt for other engines, and files that cannot be written.
    """
    path = Path(path)
    text = _text(path, coefficients, engine)
    with writing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def as_json(coefficients: Array, engine: Engine) -> str:
    """The text that `write_sh` puts into a .json."""
    said = {
        "engine": engine.name,
        "stores": engine.stores,
        "axes": "X, Y, Z = " + ", ".join(_axis(row) for row in engine.axes) + " of gonio's world, z up, right-handed",
        "order": list(NAMES),
    }
    # A row a line: json alone writes everything on one, or every number on its own.
    head = ",\n".join(f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in said.items())
    rows = ",\n".join(f"    {json.dumps(row)}" for row in _rgb(coefficients, engine).tolist())
    return f'{{\n{head},\n  "numbers": [\n{rows}\n  ]\n}}\n'


def read_sh(path: str | os.PathLike[str], engine: Engine | None = None) -> np.ndarray:
    """The coefficients of the radiance (9, 3), float64, in gonio's axes and basis, from a file of `write_sh` or cmgen.

    A .json that does not name its engine, nine rows of three numbers and nothing else, needs `engine`; 27 numbers in
    a row are read for three.js alone, whose toArray writes them. Raises `FileError` where the engine is not known or
    another than the file says, and for what is not nine finite colours.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            text = file.read(_LARGEST + 1).decode("utf-8")
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error
    except UnicodeDecodeError as error:
        raise FileError(f"{path}: not a text file.") from error
    if len(text) > _LARGEST:
        raise FileError(f"{path}: more than {_LARGEST} bytes; 27 numbers take fewer.")
    said, numbers = _from_json(path, text) if path.suffix.lower() == ".json" else _from_cmgen(path, text)
    if said and engine and ENGINES[said].name != engine.name:
        raise FileError(f"{path}: the file is {said}'s, and was to be read as {engine.name}'s.")
    engine = engine or (ENGINES[said] if said else None)
    if engine is None:
        raise FileError(f"{path}: no engine is named in it. Say whose numbers these are: {', '.join(ENGINES)}.")
    if np.shape(numbers) == (27,):
        if engine.name != Engine.THREE_JS.name:
            raise FileError(
                f"{path}: 27 numbers in a row do not say whether colours or coefficients go first. "
                "Make them nine rows of three."
            )
        numbers = np.reshape(numbers, (9, 3))
    if np.shape(numbers) != (9, 3) or not np.all(np.isfinite(numbers)):
        raise FileError(f"{path}: not nine rows of three finite numbers.")
    found: np.ndarray = from_engine(np.asarray(numbers, np.float64), engine)
    return found


def _turned(f: Array, axes: np.ndarray) -> Array:
    """Coefficients in other axes, W = axes w: what stood at w stands at W."""
    if np.linalg.det(axes) < 0:
        # A mirror is a turn after the reflection of every direction through the origin: (-1)^l.
        f, axes = f * like((-1.0) ** _L[:, None], f), -axes
    return rotate(f, axes)


def _require_nine(f: Array, name: str) -> None:
    if f.ndim != 2 or f.shape[0] != 9:
        raise ArrayError(f"{name} have shape {tuple(f.shape)}; renderers hold nine, (9, C).")


def _rgb(coefficients: Array, engine: Engine) -> np.ndarray:
    """The engine's numbers (9, 3), finite, in double precision."""
    numbers = to_engine(np.asarray(coefficients, np.float64), engine)
    if numbers.shape[1] not in (1, 3) or not np.all(np.isfinite(numbers)):
        raise ArrayError(f"coefficients of shape {numbers.shape}: a file holds finite ones, (9, 3) or (9, 1).")
    rgb: np.ndarray = np.broadcast_to(numbers, (9, 3)) + 0.0  # no -0.0
    return rgb


def _text(path: Path, coefficients: Array, engine: Engine) -> str:
    suffix = path.suffix.lower()
    if suffix == ".json":
        return as_json(coefficients, engine)
    if suffix != ".txt":
        raise FileError(f"{path}: coefficients are written as .json, or .txt for Filament.")
    if engine.name != Engine.FILAMENT.name:
        raise FileError(f"{path}: sh.txt is Filament's; {engine.name}'s numbers are written as .json.")
    lines = (
        "(" + ", ".join(f"{number:18.15f}" for number in row) + f"); // {name}, irradiance, pre-scaled base\n"
        for name, row in zip(NAMES, _rgb(coefficients, engine), strict=True)
    )
    return "".join(lines)


def _from_json(path: Path, text: str) -> tuple[str, Any]:
    """The engine's name, empty where none is given, and the numbers."""
    try:
        found = json.loads(text)
        said, numbers = (found.get("engine", ""), found["numbers"]) if isinstance(found, dict) else ("", found)
        numbers = np.array(numbers)
        if numbers.dtype.kind not in "fi":
            raise ValueError("numbers are expected")
    except (ValueError, KeyError, RecursionError) as error:
        raise FileError(f"{path}: not JSON with nine rows of three numbers ({error}).") from error
    if said and (not isinstance(said, str) or said not in ENGINES):
        raise FileError(f"{path}: engine {said!r:.40} is none of {', '.join(ENGINES)}.")
    return said, numbers


def _from_cmgen(path: Path, text: str) -> tuple[str, Any]:
    """Filament's sh.txt."""
    found = [_LINE.fullmatch(line.strip()) for line in text.splitlines() if line.strip()]
    lines = [line for line in found if line]
    if len(lines) != 9 or len(found) != 9 or tuple(line[4] for line in lines) != NAMES:
        raise FileError(f"{path}: not the nine lines '(r, g, b); // L00, ...' of Filament's sh.txt.")
    if not all("pre-scaled base" in line[5] for line in lines):
        raise FileError(
            f"{path}: cmgen's plain --sh, which has other signs and no constants in it. Write it with --sh-shader."
        )
    return Engine.FILAMENT.name, np.array([[float(line[k]) for k in (1, 2, 3)] for line in lines])


def _axis(row: np.ndarray) -> str:
    """A row of axes in words: -y for (0, -1, 0)."""
    terms = {"x": row[0], "y": row[1], "z": row[2]}
    words = {1.0: "", -1.0: "-"}
    return " + ".join(words.get(a, f"{a:.6g} ") + name for name, a in terms.items() if a)


def _folded() -> np.ndarray:
    """A_l / pi times the norms of RH 4.5: .282095, .325735 (3), .273137 (2), .078848, .273137, .136569."""
    norms = np.sqrt(np.array([1, 3, 3, 3, 15, 15, 5 / 4, 15, 15 / 4]) / (4 * math.pi))
    folded: np.ndarray = norms * clamped_cosine(2)[_L] / math.pi
    return folded


_RIGHT_Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
_LEFT_Y_UP = np.diag([-1.0, 1, 1]) @ _RIGHT_Y_UP
_LEFT_Z_UP = np.diag([1.0, -1, 1])
_ONES = np.ones(9)
_IRRADIANCE = "irradiance / pi: nine sums with 1, Y, Z, X, XY, YZ, 3ZZ - 1, XZ, XX - YY, times the albedo"

Engine.GONIO = Engine("gonio", np.eye(3), _ONES, "radiance")
Engine.THREE_JS = Engine("three.js", _RIGHT_Y_UP, _ONES, "radiance")
Engine.FILAMENT = Engine("filament", _RIGHT_Y_UP, _folded(), _IRRADIANCE)
Engine.UNITY = Engine("unity", _LEFT_Y_UP, _folded(), _IRRADIANCE)
Engine.UNREAL = Engine("unreal", _LEFT_Z_UP, (-1.0) ** _M, "radiance, against harmonics with (-1)^m")
Engine.GODOT = Engine("godot", _RIGHT_Y_UP, _ONES / math.pi, "radiance / pi")
ENGINES = {
    engine.name: engine
    for engine in (Engine.GONIO, Engine.THREE_JS, Engine.FILAMENT, Engine.UNITY, Engine.UNREAL, Engine.GODOT)
}
