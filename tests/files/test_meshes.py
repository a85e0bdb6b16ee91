"""Meshes from files."""

import numpy as np
import pytest

import gonio as gn
from gonio.errors import FileError

pytest.importorskip("trimesh")

QUAD = """\
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 0.6 0.8
f 1/1/1 2/2/1 3/3/1 4/4/1
"""


def area(mesh):
    a, b, c = mesh.vertices[mesh.faces].swapaxes(0, 1)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=-1).sum()


def volume(mesh):
    """Signed: positive where faces are counter-clockwise seen from outside."""
    a, b, c = mesh.vertices[mesh.faces].swapaxes(0, 1)
    return np.sum(a * np.cross(b, c)) / 6


def test_positions_uv_and_normals_are_those_of_the_file(tmp_path):
    (tmp_path / "a.obj").write_text(QUAD)
    mesh = gn.read_mesh(tmp_path / "a.obj")
    assert mesh.faces.shape == (2, 3) and area(mesh) == pytest.approx(1)
    np.testing.assert_array_equal(mesh.vertices[:, :2], mesh.uv)  # the quad's texture is its plan
    np.testing.assert_allclose(mesh.normals, np.tile([0, 0.6, 0.8], (4, 1)), atol=1e-15)


def test_faces_of_five_and_more_are_cut_into_triangles(tmp_path):
    angle = 2 * np.pi * np.arange(6) / 6
    for count, expected in ((5, 3), (6, 4)):
        lines = [f"v {np.cos(a):.17g} {np.sin(a):.17g} 0" for a in angle[:count]]
        (tmp_path / "a.obj").write_text("\n".join([*lines, "f " + " ".join(str(k + 1) for k in range(count))]) + "\n")
        mesh = gn.read_mesh(tmp_path / "a.obj")
        assert len(mesh.faces) == expected
        x, y = np.cos(angle[:count]), np.sin(angle[:count])
        assert area(mesh) == pytest.approx(abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2)  # shoelace


def test_a_vertex_with_two_texture_coordinates_becomes_two(tmp_path):
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt .5 0\nvt 0 .5\nvt 1 1\nvt .7 1\nvt 1 .7\n"
    (tmp_path / "a.obj").write_text(corners + "f 1/1 2/2 3/3\nf 4/4 3/5 2/6\n")
    mesh = gn.read_mesh(tmp_path / "a.obj")
    assert len(mesh.vertices) == 6 and len(mesh.uv) == 6
    np.testing.assert_allclose(mesh.normals, np.tile([0, 0, 1.0], (6, 1)), atol=1e-15)


def test_objects_of_one_file_become_one_mesh(tmp_path):
    other = "v 0 0 5\nv 1 0 5\nv 0 1 5\n"
    (tmp_path / "a.obj").write_text(QUAD + "o second\n" + other + "f 5 6 7\n")
    mesh = gn.read_mesh(tmp_path / "a.obj")
    assert area(mesh) == pytest.approx(1.5)
    assert mesh.uv is None  # the second has none


@pytest.mark.parametrize("suffix", ["ply", "stl", "off"])
def test_formats_agree_on_the_surface(tmp_path, suffix):
    trimesh = pytest.importorskip("trimesh")
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=2.0)
    sphere.export(tmp_path / f"a.{suffix}")
    mesh = gn.read_mesh(tmp_path / f"a.{suffix}")
    assert area(mesh) == pytest.approx(sphere.area, rel=1e-5)  # STL is single precision
    assert volume(mesh) == pytest.approx(sphere.volume, rel=1e-5)
    # Smooth normals of a sphere point away from its centre; at this fineness to some hundredths.
    np.testing.assert_allclose(mesh.normals, mesh.vertices / 2.0, atol=0.02)


def test_spot_is_closed_and_has_a_texture(data):
    mesh = gn.read_mesh(data / "meshes" / "spot.obj")
    assert mesh.faces.shape == (5856, 3)
    assert len(mesh.uv) == (data / "meshes" / "spot.obj").read_text().count(
        "\nvt "
    )  # no corner shared, none split twice
    places, merged = np.unique(mesh.vertices, axis=0, return_inverse=True)
    edges = np.sort(merged.reshape(-1)[mesh.faces][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=-1)
    found, times = np.unique(edges, axis=0, return_counts=True)
    assert np.all(times == 2)  # closed
    assert len(places) - len(found) + len(mesh.faces) == 2  # Euler: a sphere, pulled into a cow
    assert volume(mesh) > 0


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.obj", "v 0 0 0\nv 1 0 0\nf 1 2 9\n", r"a\.obj"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "holds no faces"),
        ("a.obj", "hello\n", "holds no faces"),
        ("a.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", r"a\.obj: Mesh: vertices.* is nan"),
        ("a.ply", "ply\nformat ascii 1.0\nelement vertex 999999999999\nproperty float x\nend_header\n", r"a\.ply"),
        ("a.stl", "\0" * 80 + "\xff\xff\xff\x7f", r"a\.stl"),
        ("a.off", "OFF\n999999999 999999999 0\n", r"a\.off"),
        ("a.glb", "glTF", r"read from \.obj, \.ply, \.stl and \.off, not \.glb"),
        ("a.ply", "", "is empty"),
    ],
)
def test_what_is_no_mesh_is_refused_by_name(tmp_path, name, text, message):
    (tmp_path / name).write_bytes(text.encode("latin-1"))
    with pytest.raises(FileError, match=message):
        gn.read_mesh(tmp_path / name)
    with pytest.raises(FileError, match="does not exist"):
        gn.read_mesh(tmp_path / "none.obj")


SMALL = gn.vase(12)
WRITTEN = {
    "with uv": SMALL,
    "without": gn.Mesh(SMALL.vertices, SMALL.faces),
    "of facets": gn.Mesh(
        SMALL.vertices[SMALL.faces[:90]].reshape(-1, 3),
        np.arange(270).reshape(-1, 3),
        normals=np.repeat(np.cross([[1.0, 2, 3]], SMALL.vertices[:90] + 2), 3, axis=0),
    ),
    "far away": gn.Mesh(SMALL.vertices + np.array([4e5, -5e6, 100]), SMALL.faces, SMALL.uv, SMALL.normals),
}


@pytest.mark.parametrize("name", WRITTEN)
def test_meshes_come_back_as_they_were_written(tmp_path, name):
    mesh = WRITTEN[name]
    gn.write_mesh(tmp_path / "a.obj", mesh)
    again = gn.read_mesh(tmp_path / "a.obj")
    # Vertices keep their order; those that no face has are left out.
    used = np.unique(mesh.faces)
    np.testing.assert_array_equal(used[again.faces], mesh.faces)
    size = np.ptp(mesh.vertices, axis=0).max()
    np.testing.assert_allclose(again.vertices, mesh.vertices[used], rtol=0, atol=1e-8 * size)
    np.testing.assert_allclose(again.normals, mesh.normals[used], atol=1e-8)
    assert (again.uv is None) == (mesh.uv is None)
    if mesh.uv is not None:
        np.testing.assert_allclose(again.uv, mesh.uv[used], atol=1e-8)


def test_meshes_are_written_as_obj_alone_and_whole_or_not_at_all(tmp_path):
    for name, message in (("a.ply", r"written as \.obj, not \.ply"), ("a", "not without suffix")):
        with pytest.raises(FileError, match=message):
            gn.write_mesh(tmp_path / name, SMALL)
    with pytest.raises(FileError, match=r"nowhere"):
        gn.write_mesh(tmp_path / "nowhere" / "a.obj", SMALL)
    assert list(tmp_path.iterdir()) == []
