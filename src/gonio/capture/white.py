"""How bright each light is, and of what colour, from photographs of a flat white target under the same lights.

    E_k = pi I_k / (albedo n.l_k)                I_k the median radiance of the target under light k

Where the target lies flat under the camera n = (0, 0, 1). Distant lights: falloff across the target is not here, and
spreads I_k about its median.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Array, to_numpy
from ..directions import require_unit
from ..errors import ArrayError, ParameterError
from .model import Capture

_CLIPPED = 0.01  # of the target: more, and the light is brighter than can be told


def intensities_of_white(target: Capture, albedo: Array = 1.0, normal: Array = (0.0, 0.0, 1.0)) -> np.ndarray:
    """The irradiance of each light on a plane that faces it, (N, 3), in the units of the photographs.

    target: with lights' directions, its mask on the white. albedo: of the target, in (0, 1], a number or (3,).
    `dataclasses.replace(capture, intensities=...)` takes them over; reflectance is then in 1/sr.

    Raises `ArrayError` where directions are unknown, a light does not reach the target, or more than 1 % of it is
    clipped or black; `ParameterError` for another albedo.
    """
    rho = to_numpy(albedo).astype(np.float64)
    if rho.shape not in ((), (3,)) or not np.all((rho > 0) & (rho <= 1)):
        raise ParameterError(f"albedo = {albedo!r:.60}; a number or three, in (0, 1], are wanted.")
    if target.directions is None:
        raise ArrayError("the target's lights are unknown: give their directions.")
    require_unit(normal, "normal")
    cosine = target.directions @ to_numpy(normal).astype(np.float64)
    found = np.empty((len(target.photographs), 3))
    for k, name in enumerate(target.photographs.names):
        radiance, clipped = target.photographs.read(k)
        if not cosine[k] > 0:
            raise ArrayError(f"{name}: the light stands below the white target.")
        if np.mean(clipped[target.mask]) > _CLIPPED:
            raise ArrayError(f"{name}: {np.mean(clipped[target.mask]):.0%} of the white is clipped: expose less.")
        median = np.median(radiance[target.mask], axis=0)
        if not np.all(median > 0):
            raise ArrayError(f"{name}: the white is black. Was the light on?")
        found[k] = math.pi * median / (rho * cosine[k])
    return found
