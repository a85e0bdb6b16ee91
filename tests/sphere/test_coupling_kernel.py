"""The kernel that couples light and BRDF beside its plain twin."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from reference import coupling as plain

from gonio._kernels import coupling as kernels


@pytest.mark.parametrize(("first", "second"), [(3, 3), (1, 3), (3, 1)])
def test_the_kernel_sums_as_its_plain_twin(first, second, rng):
    light, kappa = rng.normal(size=(2, first, 16)), rng.normal(size=(3, 3, 4, second))
    weight = rng.normal(size=(3, 6, 36))
    out = np.empty((36, 9, 3))
    kernels.couple(light, kappa, weight, out)
    assert_allclose(out, plain.couple(light, kappa, weight), atol=1e-12)
