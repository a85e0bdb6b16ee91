import numpy as np
import pytest

import gonio as gn
from gonio.errors import ArrayError, DirectionError, ParameterError


def test_a_directional_light_is_one_beam_of_its_irradiance_from_infinitely_far():
    beams = gn.Directional([0, 0.6, 0.8], [3, 2, 1]).beams()
    np.testing.assert_array_equal(beams.directions, [[0, 0.6, 0.8]])
    np.testing.assert_array_equal(beams.irradiance, [[3, 2, 1]])
    assert np.isinf(beams.distance).all()


def test_a_point_light_falls_with_the_square_of_distance():
    light = gn.Point([0, 0, 2], 8.0)
    beams = light.beams(np.array([[0, 0, 0], [0, 0, -2.0], [3, 0, -2]]))
    np.testing.assert_allclose(beams.irradiance[..., 0], [[2.0], [0.5], [8 / 25]], rtol=1e-15)
    np.testing.assert_allclose(beams.distance, [[2], [4], [5]], rtol=1e-15)
    np.testing.assert_allclose(beams.directions[2, 0], [-0.6, 0, 0.8], rtol=1e-15)


def test_a_point_light_sends_its_intensity_through_every_sphere_around_it(rng):
    # The integral of E d^2 over directions is 4 pi I whatever the radius: E d^2 = I at every point.
    light = gn.Point([1, 2, 3], [5, 6, 7])
    positions = rng.normal(size=(4, 5, 3))
    beams = light.beams(positions)
    assert beams.irradiance.shape == (4, 5, 1, 3)
    np.testing.assert_allclose(beams.irradiance * beams.distance[..., None] ** 2, np.full((4, 5, 1, 3), [5, 6, 7]))


def test_lights_add_and_gray_joins_colour():
    both = gn.Directional([0, 0, 1], 2.0) + gn.Point([0, 0, 1], [1, 2, 3]) + gn.Directional([1, 0, 0], 1.0)
    assert not both.distant and len(both.lights) == 3
    beams = both.beams(np.zeros((7, 3)))
    assert (
        beams.directions.shape == (7, 3, 3) and beams.irradiance.shape == (7, 3, 3) and beams.distance.shape == (7, 3)
    )
    np.testing.assert_array_equal(beams.irradiance[0], [[2, 2, 2], [1, 2, 3], [1, 1, 1]])


def test_distant_lights_need_no_positions_even_in_a_sum():
    beams = (gn.Directional([0, 0, 1]) + gn.Directional([1, 0, 0])).beams()
    assert beams.directions.shape == (2, 3)


def test_an_environment_in_a_sum_keeps_to_the_budget():
    room = gn.Environment(np.ones((8, 16, 3)))
    assert (room + gn.Directional([0, 0, 1])).beams(budget=11).directions.shape == (11, 3)


def test_tensors_are_answered_in_kind_and_carry_gradients():
    torch = pytest.importorskip("torch")
    intensity = torch.tensor([1.0, 2.0, 3.0], requires_grad=True)
    beams = gn.Point([0, 0, 2], intensity).beams(torch.zeros((4, 3)))
    assert beams.irradiance.dtype == torch.float32 and beams.irradiance.shape == (4, 1, 3)
    beams.irradiance.sum().backward()
    torch.testing.assert_close(intensity.grad, torch.ones(3))


@pytest.mark.parametrize(
    ("make", "error", "says"),
    [
        (lambda: gn.Directional([0, 0, 2]), DirectionError, "length 2"),
        (lambda: gn.Directional([0, 1]), ArrayError, "shape"),
        (lambda: gn.Directional([0, 0, 1], -1), ParameterError, "negative"),
        (lambda: gn.Directional([0, 0, 1], np.nan), ArrayError, "nan"),
        (lambda: gn.Point([0, 0, 1], [1, 2]), ArrayError, "number"),
        (lambda: gn.Point([0, 0, 1]).beams(), ParameterError, "positions"),
        (lambda: gn.Point([0, 0, 1]).beams([[0, 0, 1]]), ParameterError, "lies in the light"),
        (lambda: gn.Lights(()), ParameterError, "no light"),
        (lambda: gn.Lights((1,)), ParameterError, "not a light"),
    ],
)
def test_bad_lights_are_refused(make, error, says):
    with pytest.raises(error, match=says):
        make()
