"""Plain twin of `_kernels/reflectance.py`, with whole arrays."""

import numpy as np


def reflect(radiance, known, facing, frames, direction, irradiance, dark, floor):
    """wi, value, weight of radiance (N, S, 3); the lights (N, S, 3); facing and known (N, S)."""
    wi = np.einsum("sij,ksj->ski", frames, direction)
    cosine = wi[..., 2]
    over = np.swapaxes(radiance / np.where(irradiance > 0, irradiance, np.nan), 0, 1)
    lit = known.T & facing.T & (cosine > 0) & (irradiance > 0).all(axis=2).T
    lit &= (dark <= radiance.mean(axis=2).T) & (np.nan_to_num(over.mean(axis=2)) >= floor[:, None])
    value = np.where(lit[..., None], over / cosine[..., None], np.nan)
    return wi, value, np.where(lit, (irradiance.mean(axis=2).T * cosine) ** 2, 0)


def brightness(radiance, known, irradiance):
    """Sum and number of the known means, (S,)."""
    lit = known & (irradiance > 0).all(axis=2)
    over = (radiance / np.where(irradiance > 0, irradiance, 1)).mean(axis=2)
    return np.where(lit, over, 0).sum(axis=0), lit.sum(axis=0)


def gather(wi, wo, value, weight):
    """Sites whose weight is not 0, and what wi, wo, value and weight are there."""
    at = np.flatnonzero(weight)
    return at, wi[at], wo[at], value[at], weight[at]
