"""Plain twin of `fitting/turned.py`: MS 15, one pair and one turn at a time."""

import numpy as np


def distance(D1, W1, D2, W2, w, turn):
    """The distance of (D1, W1) from (D2, W2) turned by `turn` columns, and the part of its domain that lies within the
    first's; w (rows,) the solid angle of a row's knots."""
    rows, columns = D1.shape
    s1 = s2 = domain = overlap = 0.0
    for r in range(rows):
        for c in range(columns):
            from_c = (c - turn) % columns
            domain += w[r] * (W2[r, from_c] > 0)
            if W1[r, c] * W2[r, from_c] > 0:
                s1 += w[r] * D1[r, c]
                s2 += w[r] * D2[r, from_c]
                overlap += w[r]
    if s1 == 0 or s2 == 0:
        return np.inf, overlap / domain if domain else 0.0
    above = below = 0.0
    for r in range(rows):
        for c in range(columns):
            from_c = (c - turn) % columns
            if W1[r, c] * W2[r, from_c] > 0:
                weight = w[r] * np.sqrt(W1[r, c] * W2[r, from_c])
                above += weight * (D1[r, c] / s1 - D2[r, from_c] / s2) ** 2
                below += weight
    return above / below, overlap / domain


def distances(D1, W1, D2, W2, w):
    """Those of all pairs at all turns, and the parts: both (A, B, columns)."""
    columns = D1.shape[2]
    found = [[[distance(d1, w1, d2, w2, w, k) for k in range(columns)] for d2, w2 in zip(D2, W2, strict=True)]
             for d1, w1 in zip(D1, W1, strict=True)]  # fmt: skip
    found = np.array(found)
    return found[..., 0], found[..., 1]
