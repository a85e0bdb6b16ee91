"""Triangle meshes from files: OBJ, PLY, STL and OFF, decoded by trimesh.

Vertices, texture coordinates and normals are those of the file, in its axes: many meshes have y up where gonio has z.
A vertex that an OBJ gives several texture coordinates or normals becomes several vertices. Quads and larger faces are
cut into triangles. Written are OBJ files. Not here: materials and textures, scenes (glTF).
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ..errors import ArrayError, FileError
from ..shapes.mesh import Mesh
from .raster import decoding, require_file
from .whole import writing


def read_mesh(path: str | os.PathLike[str]) -> Mesh:
    """The mesh in an .obj, .ply, .stl or .off file; several objects in it become one.

    Normals are the file's where it has them (for a faceted file, facets), otherwise smooth: `Mesh(m.vertices, m.faces,
    m.uv)` makes them smooth again. Texture coordinates are None where any object lacks them.

    Raises `FileError` where the file is missing, damaged, of another format, or holds no faces.
    """
    path = Path(path)
    require_file(path)
    load = {".obj": _obj, ".ply": _ply, ".stl": _stl, ".off": _off}.get(path.suffix.lower())
    if load is None:
        raise FileError(
            f"{path}: meshes are read from .obj, .ply, .stl and .off, not {path.suffix or 'without suffix'}."
        )
    with decoding(path), path.open("rb") as file:
        parts = [_part(geometry) for geometry in load(file)]
    parts = [part for part in parts if len(part["faces"])]
    if not parts:
        raise FileError(f"{path} holds no faces. Points and lines alone are no surface.")
    starts = np.cumsum([0] + [len(part["vertices"]) for part in parts])
    try:
        return Mesh(
            np.concatenate([part["vertices"] for part in parts]),
            np.concatenate([part["faces"] + start for part, start in zip(parts, starts, strict=False)]),
            _joined(parts, "uv"),
            _joined(parts, "normals"),
        )
    except ArrayError as error:
        raise FileError(f"{path}: {error}") from error


def write_mesh(path: str | os.PathLike[str], mesh: Mesh) -> None:
    """Write an .obj with the mesh's normals, and its texture coordinates where it has them, whole or not at all.

    Raises `FileError` for another suffix.
    """
    path = Path(path)
    if path.suffix.lower() != ".obj":
        raise FileError(f"{path}: meshes are written as .obj, not {path.suffix or 'without suffix'}.")
    tables = {"v": mesh.vertices, "vn": mesh.normals} | ({} if mesh.uv is None else {"vt": mesh.uv})
    # Places to the last digit: surveyed ones lie far from the origin.
    digits = {"v": ".17g", "vn": ".9g", "vt": ".9g"}
    lines = [
        f"{key} {' '.join(format(x, digits[key]) for x in row)}"
        for key, rows in tables.items()
        for row in rows.tolist()
    ]
    corner = "{0}//{0}" if mesh.uv is None else "{0}/{0}/{0}"
    lines += [f"f {' '.join(corner.format(k + 1) for k in face)}" for face in mesh.faces.tolist()]
    with writing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", "ascii")


def _obj(file: BinaryIO) -> list[Mapping[str, Any]]:
    from trimesh.exchange.obj import load_obj

    return list(load_obj(file, skip_materials=True).get("geometry", {}).values())


def _ply(file: BinaryIO) -> list[Mapping[str, Any]]:
    from trimesh.exchange.ply import load_ply

    return [load_ply(file, skip_materials=True)]


def _stl(file: BinaryIO) -> list[Mapping[str, Any]]:
    from trimesh.exchange.stl import load_stl

    loaded = load_stl(file)
    return list(loaded["geometry"].values()) if "geometry" in loaded else [loaded]


def _off(file: BinaryIO) -> list[Mapping[str, Any]]:
    from trimesh.exchange.off import load_off

    return [load_off(file)]


def _part(geometry: Mapping[str, Any]) -> dict[str, Any]:
    from trimesh.geometry import triangulate_quads

    faces = geometry.get("faces")
    faces = np.empty((0, 3), np.int64) if faces is None or len(faces) == 0 else np.asarray(triangulate_quads(faces))
    uv = getattr(geometry.get("visual"), "uv", None)
    normals = geometry.get("vertex_normals")
    if normals is not None and not np.all(np.linalg.norm(normals, axis=-1) > 0):
        normals = None  # a file without normals may hold zeros in their place
    return {"vertices": np.asarray(geometry["vertices"], np.float64), "faces": faces, "uv": uv, "normals": normals}


def _joined(parts: list[dict[str, Any]], name: str) -> np.ndarray | None:
    if any(part[name] is None for part in parts):
        return None
    return np.concatenate([np.asarray(part[name], np.float64) for part in parts])
