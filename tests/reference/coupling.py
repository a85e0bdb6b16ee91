"""Plain twin of `_kernels/coupling.py`."""

import numpy as np


def couple(light, kappa, light_at, kappa_at, weight):
    """sum over i of weight[i] kappa[kappa_at[i]] light[light_at[i]], (sets, places, C)."""
    return np.sum(weight[..., None] * kappa[kappa_at] * light[light_at], axis=0)
