"""Radial functions fitted by the plain twin, and directions to try them at."""

import numpy as np
from reference import radial as twin

from gonio.brdf.radial import Interpolant
from gonio.directions import from_spherical


def directions(rng, n, lowest=0.05):
    return from_spherical(np.arccos(rng.uniform(lowest, 1, n)), rng.uniform(0, 2 * np.pi, n))


def interpolant(rng, d, channels=1, n=120, limits=None):
    """Fitted to smooth values with a bump: its coefficients cancel as those of real fits do."""
    centres = rng.uniform(-1, 1, (n, d))
    scales = rng.uniform(0.2, 1.5, d)
    slope = rng.normal(size=(d, channels))
    values = np.sin(3 * centres @ slope) + 5 * np.exp(-8 * np.sum(centres**2, axis=1, keepdims=True))
    return Interpolant(centres, scales, *twin.fitted(centres, scales, values), limits)
