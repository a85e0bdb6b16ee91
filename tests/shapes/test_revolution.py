"""Facts about surfaces of revolution."""

import numpy as np
import pytest

import gonio as gn
from gonio.shapes.revolution import revolve, vase


def volume(mesh):
    """Of a closed mesh with outward faces: the sum of signed tetrahedra to the origin."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


def test_a_turned_half_circle_is_a_sphere_with_outward_faces():
    theta = np.linspace(np.pi, 0, 201)
    mesh = revolve(np.stack((np.abs(np.sin(theta)), np.cos(theta)), axis=-1), 400)
    # Chords cut the sphere by a relative (step^2) / 4 or so: 200 steps of pi/200.
    assert volume(mesh) == pytest.approx(4 * np.pi / 3, rel=2e-4)
    np.testing.assert_allclose(mesh.normals, mesh.vertices, atol=1e-2)


def test_a_cylinder_has_square_texture_coordinates():
    mesh = revolve([(1.0, 0.0), (1.0, 1.0), (1.0, 2.0)], 64)
    np.testing.assert_allclose(np.unique(mesh.uv[:, 1]), (0, 0.5, 1))
    assert mesh.uv[:, 0].min() == 0
    assert mesh.uv[:, 0].max() == 1


def test_the_vase_is_about_two_units_high_and_its_normals_agree_with_its_faces():
    mesh = vase(96)
    low, high = mesh.bounds
    assert high[2] - low[2] == pytest.approx(2, abs=0.05)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    geometric = np.cross(b - a, c - a)
    smooth = mesh.normals[mesh.faces].sum(axis=1)
    assert np.mean(np.einsum("fi,fi->f", geometric, smooth) > 0) > 0.999


@pytest.mark.parametrize("profile", [[(1.0, 0.0)], [(-1.0, 0.0), (1.0, 1.0)], [(np.nan, 0.0), (1.0, 1.0)]])
def test_a_profile_that_is_none_is_refused(profile):
    with pytest.raises(gn.GonioError, match="profile"):
        revolve(profile)
