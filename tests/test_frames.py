import numpy as np
import pytest

import gonio as gn
from gonio.directions import from_spherical, normalise
from gonio.frames import (
    euler,
    euler_angles,
    frame,
    require_rotation,
    rotation_y,
    rotation_z,
    to_local,
    to_world,
)


def close(actual, expected, atol=1e-14):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=atol)


@pytest.fixture
def normals(rng):
    n = normalise(rng.normal(size=(100, 3)))
    # the poles, and the seam z = 0 of the branchless construction, from both sides
    return np.concatenate([n, [[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, -1, 0], normalise([1, 0, -1e-17])]])


def is_rotation(R):
    close(R @ np.swapaxes(R, -1, -2), np.broadcast_to(np.eye(3), R.shape))
    close(np.linalg.det(R), 1)


def test_a_frame_is_a_rotation_with_the_normal_last(normals):
    F = frame(normals)
    is_rotation(F)
    close(F[:, 2], normals, 0)


def test_the_frame_of_plus_z_is_the_identity():
    close(frame([0.0, 0, 1]), np.eye(3), 0)


def test_s_points_along_the_tangent_as_far_as_it_is_perpendicular(normals, rng):
    tangent = rng.normal(size=normals.shape)
    F = frame(normals, tangent)
    is_rotation(F)
    close(F[:, 2], normals, 0)
    assert np.all(np.sum(F[:, 0] * tangent, axis=1) > 0)
    close(np.sum(F[:, 1] * tangent, axis=1), 0, 1e-13)


def test_one_tangent_serves_many_normals():
    n = np.array([[0, 0, 1.0], [0, 1.0, 0]])
    close(frame(n, [1.0, 0, 0])[:, 0], [[1, 0, 0], [1, 0, 0]])


def test_local_and_world_are_inverses(normals, rng):
    w = normalise(rng.normal(size=normals.shape))
    F = frame(normals)
    close(to_world(F, to_local(F, w)), w)
    close(to_local(F, normals), np.broadcast_to([0, 0, 1], normals.shape))


def test_rotations_turn_the_way_they_say():
    close(rotation_z(np.pi / 2) @ [1, 0, 0], [0, 1, 0])
    close(rotation_y(np.pi / 2) @ [0, 0, 1], [1, 0, 0])


def test_euler_takes_the_normal_to_alpha_beta(rng):
    alpha, beta, gamma = rng.uniform(0, [[np.pi], [2 * np.pi], [2 * np.pi]], (3, 50))
    R = euler(alpha, beta, gamma)
    is_rotation(R)
    close(R @ [0, 0, 1], from_spherical(alpha, beta))
    close(R, rotation_z(beta) @ rotation_y(alpha) @ rotation_z(gamma))


@pytest.mark.parametrize("alpha", [0, 1e-9, 1e-3, 1.0, np.pi / 2, np.pi - 1e-9, np.pi])
def test_euler_angles_give_the_rotation_back(alpha, rng):
    R = euler(alpha, *rng.uniform(0, 2 * np.pi, (2, 20)))
    # Below sin alpha = 1e-7 the angle beta is given to gamma, which moves directions by no more than that.
    close(euler(*euler_angles(R)), R, 1e-13 if np.sin(alpha) > 1e-7 or np.sin(alpha) < 1e-12 else 1e-8)


def test_torch_gives_what_numpy_gives(normals):
    torch = pytest.importorskip("torch")
    n = torch.as_tensor(normals)
    close(frame(n).numpy(), frame(normals), 0)
    close(to_local(frame(n), n).numpy(), to_local(frame(normals), normals))
    for ours, theirs in zip(euler_angles(frame(n)), euler_angles(frame(normals)), strict=True):
        close(ours.numpy(), theirs)
    assert frame(n.float()).dtype == torch.float32


def test_normals_that_are_not_unit_are_refused():
    with pytest.raises(gn.GonioError, match="n has length 2"):
        frame([0, 0, 2.0])


@pytest.mark.parametrize("tangent", [[0, 0, 1.0], [0, 0, -3.0], [0, 0, 0.0]])
def test_a_tangent_along_the_normal_is_refused(tangent):
    with pytest.raises(gn.GonioError, match="parallel"):
        frame([0, 0, 1.0], tangent)


def test_matrices_that_are_no_rotations_are_refused():
    with pytest.raises(gn.GonioError, match="orthonormal"):
        require_rotation(2 * np.eye(3), "R")
    with pytest.raises(gn.GonioError, match="mirrors"):
        require_rotation(np.diag([1.0, 1, -1]), "R")
    with pytest.raises(gn.GonioError, match="shape"):
        euler_angles(np.eye(2))
