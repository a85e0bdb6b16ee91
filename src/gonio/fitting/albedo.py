"""The colour of each site, given what all share (RS 14, 8.1).

    a(x) = median over the samples of x of f, weighted by cos^2 theta_i             before anything is shared, RS 8.1
    a(x) = argmin over a of sum |f - a d(q)| cos theta_i                            after it

The second, beyond RS, is the median of f / d weighted by d cos theta_i: it knows which of a site's lights shine in its
highlight. Medians, since shadows and what d misses of highlights are outliers.
"""

from __future__ import annotations

import numpy as np

from .collecting import Table

DARKEST = 1e-3  # of the median reflectance that is above 0: below it noise is all there is
_LIT = 0.2  # sum of a site's squared cosines below which its colour may be noise


def albedo_of(table: Table, count: int, shared: np.ndarray | None = None) -> np.ndarray:
    """a (count, C) of all sites; shared: d at each sample (M, C), 1 where None.

    A site without samples has the median of all, one that light only grazes at most that; a black one is near black.
    """
    value = table.value if shared is None else table.value / np.maximum(shared, DARKEST * ordinary(shared))
    weights = table.wi[:, 2:] * (np.broadcast_to(table.wi[:, 2:], value.shape) if shared is None else shared)
    overall = ordinary(value)
    albedo = np.tile(overall, (count, 1))
    for c in range(albedo.shape[1]):
        order = np.lexsort((value[:, c], table.site))
        site, first, number = np.unique(table.site[order], return_index=True, return_counts=True)
        last = first + number
        total, light = _summed(weights[order, c]), _summed(table.wi[order, 2] ** 2)
        at = np.clip(np.searchsorted(total, (total[first] + total[last]) / 2) - 1, first, last - 1)
        found = np.maximum(value[order[at], c], DARKEST * overall[c])
        albedo[site, c] = np.where(light[last] - light[first] > _LIT, found, np.minimum(found, overall[c]))
    return albedo


def ordinary(value: np.ndarray) -> np.ndarray:
    """The median of what is above 0 in each channel (C,) of values (M, C), some of which are; in all where none is."""
    every = np.median(value[value > 0])
    return np.array([np.median(channel[channel > 0]) if (channel > 0).any() else every for channel in value.T])


def _summed(x: np.ndarray) -> np.ndarray:
    return np.concatenate(([0.0], np.cumsum(x)))
