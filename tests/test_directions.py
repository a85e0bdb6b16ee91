import numpy as np
import pytest

import gonio as gn
from gonio.directions import (
    cos_theta,
    cross,
    dot,
    from_half_difference,
    from_spherical,
    from_uvw,
    half_difference,
    half_vector,
    normalise,
    reflect,
    require_unit,
    spherical,
    uvw,
)


def close(actual, expected, atol=1e-14):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=atol)


def above(rng, count):
    """Random unit directions above the surface."""
    w = normalise(rng.normal(size=(count, 3)))
    return w * np.where(w[:, 2:] < 0, [[1, 1, -1]], 1)


@pytest.fixture
def pairs(rng):
    return above(rng, 200), above(rng, 200)


def turned_by(angle, w):
    c, s = np.cos(angle), np.sin(angle)
    return w @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


def test_dot_and_cross_are_those_of_numpy(pairs):
    wi, wo = pairs
    close(dot(wi, wo), np.sum(wi * wo, axis=1))
    close(cross(wi, wo), np.cross(wi, wo))


def test_spherical_coordinates_go_there_and_back(rng):
    w = normalise(rng.normal(size=(100, 3)))
    theta, phi = spherical(w)
    close(from_spherical(theta, phi), w)
    assert np.all((theta >= 0) & (theta <= np.pi) & (phi >= 0) & (phi < 2 * np.pi))


@pytest.mark.parametrize(
    ("w", "theta", "phi"),
    [
        ([0, 0, 1], 0, 0),
        ([0, 0, -1], np.pi, 0),
        ([1, 0, 0], np.pi / 2, 0),
        ([0, 1, 0], np.pi / 2, np.pi / 2),
        ([0, -1, 0], np.pi / 2, 3 * np.pi / 2),
        ([1, -1e-17, 0], np.pi / 2, 0),  # a turn less nothing is no turn
    ],
)
def test_theta_goes_from_z_and_phi_from_x_towards_y(w, theta, phi):
    close(spherical(w), [theta, phi])


def test_angles_near_a_pole_keep_their_digits():
    close(spherical(from_spherical(1e-9, 1.0)), [1e-9, 1.0], atol=1e-24 + 1e-15)
    assert spherical(from_spherical(1e-9, 1.0))[0] == pytest.approx(1e-9, rel=1e-14)


def test_normalise_survives_the_ends_of_the_range():
    close(normalise([[1e-300, 0, 0], [0, 3e300, 4e300]]), [[1, 0, 0], [0, 0.6, 0.8]])


def test_reflection_keeps_the_angle_and_is_its_own_inverse(pairs):
    w, n = pairs
    r = reflect(w, n)
    close(dot(r, n), dot(w, n))
    close(reflect(r, n), w)
    close(reflect(w), reflect(w, np.array([0.0, 0, 1])))


def test_half_vector_stands_midway(pairs):
    wi, wo = pairs
    h = half_vector(wi, wo)
    close(dot(h, h), 1)
    close(dot(h, wi), dot(h, wo))
    close(reflect(wi, h), wo)


def test_opposite_directions_have_the_normal_for_half_vector():
    close(half_vector([1, 0, 0], [-1, 0, 0]), [0, 0, 1])


def test_half_difference_goes_there_and_back(pairs):
    wi, wo = pairs
    theta_h, phi_h, theta_d, phi_d = half_difference(wi, wo)
    back_i, back_o = from_half_difference(theta_h, phi_h, theta_d, phi_d)
    close(back_i, wi, 1e-13)
    close(back_o, wo, 1e-13)


def test_half_and_difference_angles_are_those_of_the_half_vector(pairs):
    wi, wo = pairs
    h = half_vector(wi, wo)
    theta_h, phi_h, theta_d, _ = half_difference(wi, wo)
    close(np.cos(theta_h), cos_theta(h))
    close(np.stack((np.cos(phi_h), np.sin(phi_h))), h[:, :2].T / np.sin(theta_h), 1e-12)
    close(np.cos(theta_d), dot(h, wi))


def test_swapping_light_and_eye_adds_half_a_turn_to_phi_d(pairs):
    wi, wo = pairs
    theta_h, phi_h, theta_d, phi_d = half_difference(wi, wo)
    swapped = half_difference(wo, wi)
    close(swapped[:3], (theta_h, phi_h, theta_d), 1e-13)
    close(np.cos(swapped[3] - phi_d), -1, 1e-12)


def test_turning_the_surface_turns_phi_h_alone(pairs):
    wi, wo = pairs
    theta_h, phi_h, theta_d, phi_d = half_difference(wi, wo)
    turned = half_difference(turned_by(1.0, wi), turned_by(1.0, wo))
    close((turned[0], turned[2]), (theta_h, theta_d), 1e-13)
    close(np.cos(turned[1] - phi_h - 1.0), 1, 1e-12)
    close(np.cos(turned[3] - phi_d), 1, 1e-12)


def test_light_behind_the_eye_has_no_difference(rng):
    w = above(rng, 50)
    theta_h, phi_h, theta_d, _ = half_difference(w, w)
    close((theta_h, phi_h), spherical(w), 1e-12)
    # theta_d is the angle between vectors that agree to a rounding.
    close(theta_d, 0, 1e-15 * 10)
    close(uvw(w, w)[:, 2], 0, 1e-14)


def test_exactly_retroreflected_normal_light_has_all_angles_zero():
    close(half_difference([0, 0, 1], [0, 0, 1]), np.zeros(4), 0)
    close(uvw([0, 0, 1], [0, 0, 1]), np.zeros(3), 0)


def test_uvw_is_reciprocal_and_isotropic(pairs):
    wi, wo = pairs
    close(uvw(wo, wi), uvw(wi, wo), 1e-12)
    close(uvw(turned_by(0.7, wi), turned_by(0.7, wo)), uvw(wi, wo), 1e-12)


def test_uvw_goes_there_and_back(pairs):
    q = uvw(*pairs)
    assert np.all(np.hypot(q[:, 0], q[:, 1]) <= 1 + 1e-15)
    assert np.all((q[:, 2] >= 0) & (q[:, 2] <= 1))
    close(uvw(*from_uvw(q)), q, 1e-12)


def test_float32_stays_float32(pairs):
    wi, wo = (w.astype(np.float32) for w in pairs)
    for result in (normalise(wi), half_vector(wi, wo), reflect(wi), uvw(wi, wo), *half_difference(wi, wo)):
        assert result.dtype == np.float32


def test_torch_gives_what_numpy_gives(pairs):
    torch = pytest.importorskip("torch")
    wi, wo = pairs
    ti, to = torch.as_tensor(wi), torch.as_tensor(wo)
    for f in (half_vector, uvw, reflect, cross):
        close(f(ti, to).numpy(), f(wi, wo), 1e-13)
    for ours, theirs in zip(half_difference(ti, to), half_difference(wi, wo), strict=True):
        close(ours.numpy(), theirs, 1e-13)
    for ours, theirs in zip(from_uvw(uvw(ti, to)), from_uvw(uvw(wi, wo)), strict=True):
        close(ours.numpy(), theirs, 1e-13)
    assert half_vector(ti.float(), to.float()).dtype == torch.float32


@pytest.mark.parametrize("v", [[0, 0, 0], [np.nan, 0, 0], [np.inf, 0, 0]])
def test_a_vector_without_direction_is_refused_by_its_place(v):
    with pytest.raises(gn.GonioError, match=r"v\[1\] has no direction"):
        normalise([[1, 0, 0], v])


@pytest.mark.parametrize("length", [0.99, 1.01, np.nan])
def test_a_vector_that_is_not_unit_is_refused_by_its_place(length):
    require_unit(np.array([1.0, 0, 0], np.float32), "wi")
    with pytest.raises(gn.GonioError, match=r"wi\[0, 1\] has length"):
        require_unit([[[1, 0, 0], [0, 0, length]]], "wi")


@pytest.mark.parametrize("w", [1.0, [1.0, 0], np.zeros((3, 4))])
def test_components_must_come_last(w):
    with pytest.raises(gn.GonioError, match="components last"):
        spherical(w)


@pytest.mark.parametrize("function", [cross, half_vector, half_difference, reflect, uvw, gn.Lambert(0.5).f])
@pytest.mark.parametrize("shapes", [((2,), (3,)), ((3,), (4, 2)), ((4, 3), (5, 3))])
def test_pairs_that_do_not_fit_are_refused(function, shapes):
    a, b = (np.broadcast_to(np.eye(shape[-1])[-1], shape) for shape in shapes)
    with pytest.raises(gn.GonioError, match=r"components last|broadcast"):
        function(a, b)


@pytest.mark.parametrize("q", [[1, 1, 0], [0, 0, -0.1], [0, 0, 1.1], [np.nan, 0, 0]])
def test_uvw_outside_its_domain_is_refused(q):
    with pytest.raises(gn.GonioError, match="RS 7"):
        from_uvw(q)
