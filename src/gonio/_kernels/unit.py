"""Whether directions are unit vectors: the check that every public BRDF makes, at a fraction of what the BRDF costs."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def are_unit(w, tolerance):  # type: ignore[no-untyped-def]
    """Whether the squared lengths of all `w` (n, 3) are within `tolerance` of 1; NaN is not."""
    good = True
    for i in range(w.shape[0]):
        x, y, z = np.float64(w[i, 0]), np.float64(w[i, 1]), np.float64(w[i, 2])
        good &= abs(x * x + y * y + z * z - 1) <= tolerance
    return good
