"""Facts about the mesh of a view's pixels: it is the surface that was seen, and maps of the pixels are its textures."""

import numpy as np
import pytest

import gonio as gn
from gonio.shapes.pixels import pixel_mesh


def relief():
    y, x = np.mgrid[1:-1:21j, -1:1:31j]
    return gn.HeightField(2 * np.cos(x) * np.cos(2 * y))


def test_pixels_of_a_height_field_are_vertices_of_a_mesh_that_faces_the_camera():
    field = relief()
    view = field.view(field.camera())
    mesh = pixel_mesh(view.position, view.mask, view.normal)
    np.testing.assert_array_equal(mesh.vertices, view.position.reshape(-1, 3))
    assert len(mesh.faces) == 2 * 20 * 30
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()
    np.testing.assert_allclose(mesh.normals, view.normal.reshape(-1, 3), atol=1e-6)


def test_its_uv_are_those_of_maps_of_the_pixels():
    field = relief()
    mesh = pixel_mesh(field.view(field.camera()).position, np.ones(field.heights.shape, bool))
    seen = mesh.view(field.camera())
    texture = np.random.default_rng(1).random((*seen.mask.shape, 3))
    inside = np.zeros_like(seen.mask)
    inside[1:-1, 1:-1] = True
    image = gn.radiance(
        gn.reflection.textured(gn.Lambert(texture), seen.uv[inside]),
        gn.Directional([0, 0, 1], np.pi),
        seen.frames[inside],
        seen.wo[inside],
        seen.position[inside],
    )
    np.testing.assert_allclose(image / seen.normal[inside][:, 2:], texture[inside], atol=1e-5)


def test_holes_and_leaps_stay_open():
    mask = np.ones((9, 9), bool)
    mask[4, 4] = False
    y, x = np.mgrid[0:9.0, 0:9.0]
    flat = np.stack((x, -y, np.zeros_like(x)), axis=-1)
    # A pixel short, six of its triangles are gone and the two that join its neighbours beside the diagonals come.
    assert len(pixel_mesh(flat, mask).faces) == 128 - 8 + 4
    flat[:, 5:, 2] = 30
    torn = pixel_mesh(flat, np.ones((9, 9), bool))
    assert len(torn.faces) == 2 * 8 * (4 + 3)
    assert not np.ptp(torn.vertices[torn.faces][..., 2], axis=1).any()


def test_what_spans_no_triangle_is_refused():
    with pytest.raises(gn.GonioError, match="no three neighbouring"):
        pixel_mesh(np.zeros((3, 3, 3)), np.zeros((3, 3), bool))
