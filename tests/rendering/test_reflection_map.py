"""Facts about reflection maps."""

import numpy as np
import pytest

import gonio as gn
from gonio.rendering.reflection_map import degree_needed
from gonio.sphere import zonal


@pytest.fixture(scope="module")
def room():
    return gn.studio(64)


def test_a_reflection_map_is_the_integral_of_the_lobe_over_the_room(room, rng):
    s = 20.0
    blurred = gn.reflection_map(room, zonal.phong(60, s), rows=64, error=1e-4)
    R = gn.normalise(rng.normal(size=(50, 3)))
    beams = room.beams()
    lobe = (s + 1) / (2 * np.pi) * np.maximum(R @ beams.directions.T, 0) ** s
    brute = lobe @ beams.irradiance
    # The map is read bilinearly between rows .05 apart, of a lobe .2 wide: (.05 / .2)^2 / 8 or so of its swing.
    np.testing.assert_allclose(blurred.radiance(R), brute, atol=0.01 * brute.max())


def test_a_mirror_reflects_what_the_grid_carries(room):
    """Where nothing is blurred the light itself comes back, cut at the degree that the coefficients have."""
    with pytest.warns(gn.GonioWarning, match="end at degree 16"):
        blurred = gn.reflection_map(room, zonal.mirror(16), rows=64)
    cut = gn.synthesis(room.harmonics(16), gn.LatLong(64, 128))
    np.testing.assert_allclose(blurred.image, np.maximum(cut, 0), atol=1e-5)


def test_uniform_light_stays_what_it_is_under_a_lobe_of_unit_energy():
    sky = gn.Environment(np.full((16, 32, 3), 2.5))
    np.testing.assert_allclose(gn.reflection_map(sky, zonal.phong(15, 3.0), rows=16).image, 2.5, rtol=1e-12)


def test_sharper_lobes_need_higher_degrees():
    # exp(-l^2 / (2 s)) = .01 at l = sqrt(2 s log 100): 13.6 at s = 20 (RH 3.40), and the next integer keeps below.
    assert degree_needed(zonal.phong(100, 20.0), 0.01) in (12, 13)
    assert degree_needed(zonal.phong(100, 80.0), 0.01) > degree_needed(zonal.phong(100, 20.0), 0.01)


def test_a_lobe_sharper_than_the_rows_carry_is_refused(room):
    with pytest.raises(gn.GonioError, match="8 rows carry 7"):
        gn.reflection_map(room, zonal.phong(60, 100.0), rows=8)


@pytest.mark.parametrize("error", [0.0, 1.0, -1.0, np.nan])
def test_an_error_that_is_no_share_is_refused(room, error):
    with pytest.raises(gn.GonioError, match="between 0 and 1"):
        gn.reflection_map(room, zonal.phong(60, 20.0), rows=64, error=error)
