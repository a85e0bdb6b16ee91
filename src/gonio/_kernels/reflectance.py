"""Photographs to reflectance: the loops of `capture/sampling.py`, on raw arrays.

radiance (N, S, 3), known (N, S): photograph k of site s. frames (S, 3, 3), rows s, t, n. direction and irradiance
(N, 1 or S, 3): of the lights, at every site where they are near.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def brightness(radiance, known, irradiance, total, count):  # type: ignore[no-untyped-def]
    """Add to `total` (S,) the channels' means of radiance over irradiance, where known, and to `count` how many."""
    last = irradiance.shape[1] - 1
    for k in range(radiance.shape[0]):
        for s in range(radiance.shape[1]):
            if known[k, s]:
                E = irradiance[k, min(s, last)]
                if E[0] > 0 and E[1] > 0 and E[2] > 0:
                    value = radiance[k, s, 0] / E[0] + radiance[k, s, 1] / E[1] + radiance[k, s, 2] / E[2]
                    total[s] += value / 3
                    count[s] += 1


@njit(cache=True, nogil=True, error_model="numpy")
def reflect(  # type: ignore[no-untyped-def]
    radiance, known, facing, frames, direction, irradiance, dark, floor, wi, value, weight
):
    """Fill wi (S, N, 3), value (S, N, 3) and weight (S, N): f = I / (E n.wi), and (E n.wi)^2 of the channels' mean E.

    value is NaN and weight 0 where the site does not face the eye, `facing` (1 or N, S), or the light, is not known,
    radiance is below `dark`, or over irradiance below `floor` (S,), the means of the channels.
    """
    last, views = irradiance.shape[1] - 1, facing.shape[0] - 1
    for s in range(radiance.shape[1]):
        for k in range(radiance.shape[0]):
            E, w = irradiance[k, min(s, last)], direction[k, min(s, last)]
            cosine = frames[s, 2, 0] * w[0] + frames[s, 2, 1] * w[1] + frames[s, 2, 2] * w[2]
            for i in range(2):
                wi[s, k, i] = frames[s, i, 0] * w[0] + frames[s, i, 1] * w[1] + frames[s, i, 2] * w[2]
            wi[s, k, 2] = cosine
            value[s, k, 0], value[s, k, 1], value[s, k, 2], weight[s, k] = np.nan, np.nan, np.nan, 0.0
            if not (known[k, s] and facing[min(k, views), s] and cosine > 0 and E[0] > 0 and E[1] > 0 and E[2] > 0):
                continue
            red, green, blue = radiance[k, s, 0], radiance[k, s, 1], radiance[k, s, 2]
            if red + green + blue < 3 * dark or red / E[0] + green / E[1] + blue / E[2] < 3 * floor[s]:
                continue
            value[s, k, 0], value[s, k, 1], value[s, k, 2] = (
                red / (E[0] * cosine),
                green / (E[1] * cosine),
                blue / (E[2] * cosine),
            )
            weight[s, k] = ((E[0] + E[1] + E[2]) / 3 * cosine) ** 2


@njit(cache=True, nogil=True, error_model="numpy")
def gather(wi, wo, value, weight, at, wi_at, wo_at, value_at, weight_at):  # type: ignore[no-untyped-def]
    """Fill `at` (K,) with the sites of S whose weight is not 0, and the others with what wi, wo, value (S, 3) and
    weight (S,) are there."""
    k = 0
    for s in range(weight.size):
        if weight[s] != 0:
            at[k], weight_at[k] = s, weight[s]
            for i in range(3):
                wi_at[k, i], wo_at[k, i], value_at[k, i] = wi[s, i], wo[s, i], value[s, i]
            k += 1
