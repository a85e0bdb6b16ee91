"""Products of Wigner's functions as sums of single ones: Clebsch and Gordan's coefficients.

    D^l_mq D^p_-s,-q = sum over j of <l m p -s | j m-s> <l q p -q | j 0> D^j_m-s,0        abs(l - p) <= j <= l + p

By Racah's sum, with logarithms of factorials in the longest floats there are; p is small, so that few terms cancel.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np


def clebsch_gordan(l: np.ndarray, m: np.ndarray, p: int, s: np.ndarray, j: np.ndarray) -> np.ndarray:
    """<l m p s | j m+s> of Condon and Shortley's signs, broadcast over integer arrays; 0 where it does not exist.

    Right to 1e-14 for l up to some hundreds where long doubles have 64 bits of mantissa, to 1e-13 elsewhere.
    """
    l, m, s, j = np.broadcast_arrays(l, m, s, j)
    M = m + s
    exists = (l >= 0) & (j >= np.abs(l - p)) & (j <= l + p) & (np.abs(m) <= l) & (np.abs(s) <= p) & (np.abs(M) <= j)
    total = np.zeros(l.shape, np.longdouble)
    if not exists.any():
        return total.astype(np.float64)
    l, m, s, j, M = (x[exists] for x in (l, m, s, j, M))
    log = _log_factorials(int(np.max(l + j)) + 4 * p + 1)
    root = 0.5 * (
        np.log((2 * j + 1).astype(np.longdouble))
        + (log[l + p - j] + log[l - p + j] + log[p + j - l] - log[l + p + j + 1])
        + (log[l + m] + log[l - m] + log[p + s] + log[p - s] + log[j + M] + log[j - M])
    )
    found = np.zeros(l.shape, np.longdouble)
    for k in range(2 * p + 1):
        parts = (l + p - j - k, l - m - k, p + s - k, j - p + m + k, j - l - s + k)
        real = np.all([part >= 0 for part in parts], axis=0)
        term = np.exp(root - log[k] - sum(log[np.maximum(part, 0)] for part in parts))
        found += np.where(real, (-1) ** k * term, 0)
    total[exists] = found
    return total.astype(np.float64)


@lru_cache(maxsize=4)
def _log_factorials(highest: int) -> np.ndarray:
    """log n! for n = 0..highest."""
    n = np.maximum(np.arange(highest + 1), 1).astype(np.longdouble)
    logarithms: np.ndarray = np.cumsum(np.log(n))
    return logarithms
