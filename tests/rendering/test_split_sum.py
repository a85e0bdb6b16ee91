"""Facts about the split-sum table."""

import numpy as np
import pytest

import gonio as gn
from gonio.rendering.split_sum import split_sum


@pytest.mark.parametrize("correlated", [True, False])
def test_it_is_the_albedo_of_ggx_with_schlicks_fresnel(correlated):
    size, f0 = 6, np.array([0.0, 0.04, 1.0])
    table = split_sum(size, gn.Smith(correlated))
    at = (np.arange(size) + 0.5) / size
    wo = np.stack((np.sqrt(1 - at**2), np.zeros(size), at), axis=-1)
    for row, roughness in zip(table, at, strict=True):
        facets = gn.Microfacet(gn.GGX(roughness**2), gn.Schlick(f0), gn.Smith(correlated))
        # Another quadrature, over the numbers of the model's sampler; itself good to some 1e-5.
        expected = gn.albedo(facets, wo, tolerance=5e-5)
        np.testing.assert_allclose(row[:, :1] * f0 + row[:, 1:], expected, atol=1e-4)


def test_a_mirror_reflects_by_schlick():
    size = 64
    table = split_sum(size)
    c = (np.arange(size) + 0.5) / size
    # alpha = 6e-5, and facets that lean by so much change a mirror's F by 5 alpha, G by alpha / n.wo.
    np.testing.assert_allclose(table[0, :, 1], (1 - c) ** 5, atol=5e-4)
    np.testing.assert_allclose(table[0].sum(axis=-1), 1, atol=5e-4)


def test_nothing_gains_energy_and_what_is_lost_grows_with_roughness_seen_from_above():
    total = split_sum(24).sum(axis=-1)
    assert total.max() <= 1 + 1e-4
    # Towards grazing views it does not: the roughest facets there lose less again.
    assert np.all(np.diff(total[:, 12:], axis=0) < 1e-4)


def test_facets_at_one_height_shadow_more_where_their_heights_do_not_count():
    # G with correlated heights is never less (Heitz 2014).
    assert np.all(split_sum(16) >= split_sum(16, gn.Smith(correlated=False)) - 1e-6)


def test_its_shape_and_kind():
    table = split_sum(4)
    assert (table.shape, table.dtype) == ((4, 4, 2), np.float32)


@pytest.mark.parametrize("size", [0, -1, 2.5, True])
def test_a_size_without_texels_is_refused(size):
    with pytest.raises(gn.GonioError, match="no number of texels"):
        split_sum(size)
