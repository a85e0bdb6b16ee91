import math

import numpy as np
import pytest

import gonio as gn
from gonio.fitting import validation
from gonio.fitting.centres import choose_centres
from gonio.fitting.rules import Lookahead, Spread
from gonio.fitting.validation import choose_scales


def sphere(images, size, farthest=75.0, alpha=0.3, albedo=0.3):
    """Orthographic images of a sphere of GGX over Lambert, lights to 2 `farthest` from the eye: (u, |v|, w), log f,
    cos theta_i, the image."""
    x, y = np.meshgrid(*[np.linspace(-1, 1, size)] * 2)
    inside = x * x + y * y < 0.98
    x, y = x[inside], y[inside]
    normals = np.stack((x, y, np.sqrt(1 - x * x - y * y)), axis=-1)
    # The frame of each normal, in which eye and light are what they are on a table.
    t = gn.normalise(np.cross([0.3, 1, 0.2], normals))
    frames = np.stack((t, np.cross(normals, t), normals), axis=-2)
    material = gn.Lambert(albedo) + gn.Microfacet(gn.GGX(alpha))
    parts = []
    for k, theta_d in enumerate(np.radians(np.linspace(2, farthest, images))):
        wi = frames @ np.array([math.sin(2 * theta_d), 0, math.cos(2 * theta_d)])
        wo = frames @ np.array([0.0, 0, 1])
        seen = (wi[:, 2] > 0.05) & (wo[:, 2] > 0.05)
        wi, wo = wi[seen], wo[seen]
        q = gn.uvw(wi, wo)
        q[:, 1] = np.abs(q[:, 1])
        f = material.f(wi, wo)[:, :1]
        parts.append((q, np.log(f), wi[:, 2], np.full(len(q), k)))
    return [np.concatenate(column) for column in zip(*parts, strict=True)]


def rms(left, weights):
    return math.sqrt(np.sum((left * weights[:, None]) ** 2) / np.sum(weights**2) / left.shape[1])


@pytest.fixture(scope="module")
def images():
    return sphere(10, 50)


def test_with_a_stiffness_found_by_itself_five_percent_of_noise_leave_less_than_two(rng):
    """RS 10's regularised system; without it centres are chosen for their noise, and all of it is left."""
    q, g, w, image = sphere(10, 60)
    noisy = g + np.log1p(0.05 * rng.normal(size=g.shape))
    found = choose_scales(q, noisy, image, w, grid=(0.25, 0.5, 1.0), centres=200)
    assert found.rho > 0
    errors = []
    for rho in (0, found.rho):
        s = choose_centres(q, noisy, w, found.scales, rho, Spread(0.1), 1200).interpolant
        errors.append(rms(g - s(q), w))
    assert errors[1] < 0.02 and errors[1] < 0.5 * errors[0]


def test_without_noise_the_least_stiffness_is_found(images):
    q, g, w, image = images
    assert choose_scales(q, g, image, w, centres=100).rho <= 0.003


def test_the_scales_found_err_little_more_than_the_best_at_images_between(images):
    q, g, w, image = images
    found = choose_scales(q, g, image, w, stiffness=(0.0, 0.1), centres=150)
    there, expected, weights, _ = sphere(9, 40, farthest=71.0)

    def error(scale):
        s = choose_centres(q, g, w, [1, 1, scale], 0, Spread(0.1), 300).interpolant
        return rms(expected - s(there), weights)

    errors = {scale: error(scale) for scale in (1 / 16, 1 / 4, 1 / 2, 1, 2)}
    assert error(found.scales[2]) < 1.3 * min(errors.values()) < 0.3 * errors[1 / 16]
    assert found.error == found.table[:, -1].min()


def test_coordinates_that_share_a_scale_are_sought_together(rng):
    """A function of (u, v, w) alone, seen in few images and many places: places want a small scale."""
    q = rng.random((2000, 5))
    group = rng.integers(0, 6, 2000)
    q[:, 4] = group / 6
    q[:, 2:4] = 2 * q[:, 2:4] - 1
    g = np.log(0.05 + np.exp(-3 * np.sum(q[:, 2:4] ** 2, axis=1) + q[:, 4]))[:, None]
    found = choose_scales(q, g, group, grid=(1 / 16, 1 / 8, 1 / 4, 1), stiffness=(0.0,), centres=80)
    assert found.scales[0] == found.scales[1] <= 1 / 8
    assert found.scales[2] == found.scales[3] == 1
    assert found.table.shape[1] == 6 and found.table[:, 0].min() < 1 / 4
    alone = choose_scales(q, g, group, stiffness=(0.0,), centres=30, together=((4,),))
    assert alone.scales[0] == 1


def test_the_same_arguments_give_the_same_answer():
    q, g, w, image = sphere(5, 40)
    first, second = (choose_scales(q, g, image, w, stiffness=(0.0, 0.1), centres=40, seed=3) for _ in range(2))
    np.testing.assert_array_equal(first.table, second.table)
    np.testing.assert_array_equal(first.stiffness, second.stiffness)


def test_many_groups_are_left_out_a_few_at_a_time(rng, monkeypatch):
    q = rng.random((2000, 2))
    held = []
    monkeypatch.setattr(
        validation, "choose_centres", lambda *a: held.append(len(a[0])) or choose_centres(*a), raising=True
    )
    choose_scales(q, np.sin(5 * q[:, :1]), np.arange(2000) // 50, stiffness=(0.0,), centres=20, rule=Lookahead(0.2))
    # No axis is sought for (u, v): once without each of eight folds of five groups, and twice for the stiffness.
    assert sorted(held) == [1750] * 8 + [2000] * 2


Q = np.random.default_rng(1).random((60, 3))
G = Q[:, :1]
IMAGE = np.arange(60) % 3
TWO = np.concatenate((Q[:, :2], IMAGE[:, None] % 2), axis=1)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"groups": IMAGE[:5]}, gn.errors.ArrayError, r"expected \(M, d\)"),
        ({"groups": 0 * IMAGE}, gn.errors.ArrayError, "one group"),
        ({"points": TWO, "groups": IMAGE % 2}, gn.errors.ArrayError, "plane.*or add images"),
        ({"grid": [1, 0.5]}, gn.errors.ParameterError, "ascending"),
        ({"stiffness": [-1]}, gn.errors.ParameterError, "stiffness"),
        ({"together": [[0], [0]]}, gn.errors.ParameterError, "distinct"),
        ({"together": [[3]]}, gn.errors.ParameterError, "distinct coordinates of 3"),
        ({"points": np.random.default_rng(1).random((60, 6))}, gn.errors.ParameterError, "6 coordinates"),
    ],
)
def test_what_cannot_be_validated_is_refused_by_name(change, error, message):
    with pytest.raises(error, match=message):
        choose_scales(**{"points": Q, "values": G, "groups": IMAGE} | change)
