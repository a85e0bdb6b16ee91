"""Reflection maps: what a lobe of fixed shape about the mirror direction R reflects, for every R (RH 5.6, 3.2.6).

    B(R) = sum_lm A_l L_lm Y_lm(R)         A_l of the lobe, from `sphere.zonal`

One map then serves every surface point and view: look it up at R = reflect(wo, n). Exact for lobes that depend on the
angle to R alone (Phong, RH 3.36). Lobes that change with the view need the maps of RH 5.4: `shrm.py`.
"""

from __future__ import annotations

import warnings

from ..arrays import Array, floats, like
from ..errors import AccuracyWarning, ParameterError
from ..lights.environment import Environment
from ..lights.mappings import LatLongMap
from ..sphere.grids import LatLong
from ..sphere.transform import synthesis
from ..sphere.zonal import convolve
from .orders import require_share


def degree_needed(A: Array, error: float) -> int:
    """The least degree beyond which abs(A_l) stays below `error` times A_0: where the series of a lobe may end."""
    require_share(error)
    _, A = floats(A)
    kept = [l for l in range(A.shape[0]) if abs(float(A[l])) >= error * abs(float(A[0]))]
    return max(kept, default=0)


def reflection_map(light: Environment, A: Array, rows: int, error: float = 0.01) -> Environment:
    """The lat-long map (rows, 2 rows) of what a lobe with coefficients `A` (L + 1,) reflects along each direction R.

    The series ends where A_l falls below `error` of A_0. What rings below zero is cut to zero.

    Raises `ParameterError` where `rows` carries fewer degrees than that, or `A` ends before it.
    """
    _, A = floats(A)
    degree = degree_needed(A, error)
    grid = LatLong(rows, 2 * rows)
    if degree > grid.highest_degree:
        raise ParameterError(f"the lobe needs degree {degree}; {rows} rows carry {grid.highest_degree}.")
    if degree == A.shape[0] - 1 and degree > 0:
        warnings.warn(
            f"the lobe's coefficients end at degree {degree} before they fall to {error:g}.",
            AccuracyWarning,
            stacklevel=2,
        )
    coefficients = light.harmonics(degree)
    xp, coefficients = floats(coefficients)
    B = synthesis(convolve(coefficients, like(A, coefficients)[: degree + 1]), grid)
    return Environment(xp.maximum(B, xp.zeros_like(B)), LatLongMap())
