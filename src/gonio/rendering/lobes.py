"""The lobes about the mirror direction R by which real-time engines blur their environment maps.

    ggx      k = D(h) (R.w)_+,   n = v = R, h halfway between R and w                        (Karis 2013)
    phong    k = (R.w)_+^s,      s = (1 + 1 / alpha^2) / 2                                   (RH 6.7 where narrow)

each divided by its integral over the sphere. A lobe is a function of alpha and of the angles theta = acos(R.w), up to a
factor. At alpha = 1 both are the cosine of a matte surface. `spectrum` says to which degree a lobe has to be known:
under a lamp that is a point what lies beyond degree L is, relative to the rms of the whole,

    error^2 = sum over l > L of (2l+1) A_l^2 / sum over l of (2l+1) A_l^2,   sum_l (2l+1) A_l^2 = 4 pi integral of k^2

No lamp that is broader errs by more, as long as its power for each coefficient falls with the degree.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from ..arrays import frozen
from ..brdf.ndf import GGX
from ..sphere import zonal

Lobe = Callable[[float, np.ndarray], np.ndarray]  # (alpha, theta (N,) in [0, pi/2]) -> (N,)


def ggx(alpha: float, theta: np.ndarray) -> np.ndarray:
    """D(h) cos theta of Trowbridge and Reitz's facets: `theta` (N,) -> (N,)."""
    h = np.stack((np.sin(theta / 2), np.zeros_like(theta), np.cos(theta / 2)), axis=-1)
    lobe: np.ndarray = GGX(alpha).D(h) * np.cos(theta)
    return lobe


def phong(alpha: float, theta: np.ndarray) -> np.ndarray:
    """cos^s theta, as wide where narrow as what Beckmann's facets of this alpha reflect: `theta` (N,) -> (N,)."""
    lobe: np.ndarray = np.cos(theta).clip(0) ** (0.5 + 0.5 / alpha**2)
    return lobe


@lru_cache(maxsize=64)
def spectrum(lobe: Lobe, alpha: float, error: float, highest: int) -> tuple[np.ndarray, float]:
    """(A_l (degree + 1,) with A_0 = 1, error): the shortest that stays below `error`, or to degree `highest`."""
    degree = min(32, highest)
    whole = 4 * math.pi * zonal.coefficients(0, lambda theta: lobe(alpha, theta) ** 2, math.pi / 2)[0]
    while True:
        A = zonal.coefficients(degree, lambda theta: lobe(alpha, theta), math.pi / 2)
        # Rounding leaves a sum of squares short of the whole by 1e-13 or so: errors below 1e-6 are not told apart.
        beyond = np.sqrt(np.clip(1 - np.cumsum((2 * np.arange(degree + 1) + 1) * A**2) / whole, 1e-13, None))
        good = np.flatnonzero(beyond <= error)
        if good.size or degree == highest:
            last = int(good[0]) if good.size else highest
            return frozen(A[: last + 1] / A[0]), float(beyond[last])
        degree = min(2 * degree, highest)
