"""Every ray against every triangle (Moeller and Trumbore 1997): the twin of the ray tracers."""

import numpy as np


def intersect(origins, directions, corners):
    """(t, face) of the first triangle of `corners` (F, 3, 3) that each ray (N, 3) meets; (inf, -1) where none."""
    a, e1, e2 = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(directions[:, None], e2)
    det = np.sum(e1 * p, axis=-1)
    s = origins[:, None] - a
    q = np.cross(s, e1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.sum(s * p, axis=-1) / det
        v = np.sum(directions[:, None] * q, axis=-1) / det
        t = np.sum(e2 * q, axis=-1) / det
    met = (det != 0) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    t = np.where(met, t, np.inf)
    face = t.argmin(axis=1)
    nearest = t[np.arange(len(t)), face]
    return nearest, np.where(np.isfinite(nearest), face, -1)
