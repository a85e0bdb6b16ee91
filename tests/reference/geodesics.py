"""Distances over triangles and points at distances from others, as plainly as they can be said."""

import numpy as np


def unfolded(points, a, b, c, p, q):
    """The distance of vertex c from the point at p from a and q from b, beyond the edge ab: in the plane of the three,
    a at the origin and b to its right; infinity where the straight way does not meet the edge."""
    A, B, C = points[[a, b, c]]
    right = (B - A) / np.linalg.norm(B - A)
    base, x = np.linalg.norm(B - A), (C - A) @ right
    y = np.linalg.norm(C - A - x * right)
    along = (p * p - q * q + base * base) / (2 * base)
    if p * p < along * along:
        return np.inf
    below = np.sqrt(p * p - along * along)
    met = along + (x - along) * below / (y + below)
    return np.hypot(x - along, y + below) if 0 <= met <= base else np.inf


def distances(points, faces, source):
    """(V,), where no way bends: every face's three corners, each by the other two, until nothing is shorter."""
    t = np.full(len(points), np.inf)
    t[source] = 0
    changed = True
    while changed:
        changed = False
        for face in faces:
            for k in range(3):
                a, b, c = np.roll(face, -k)
                ways = [t[v] + np.linalg.norm(points[c] - points[v]) for v in (a, b)]
                if np.isfinite(t[a] + t[b]):
                    ways.append(unfolded(points, a, b, c, t[a], t[b]))
                if min(ways) < t[c] * (1 - 1e-10):
                    t[c], changed = min(ways), True
    return t


def settled(point, anchors, distances, near, steps):
    """Where one point (2,) comes to in so many steps of SMACOF."""
    w = 1 / (distances**2 + near**2)
    for _ in range(steps):
        off = point - anchors
        towards = anchors + distances[:, None] * off / np.linalg.norm(off, axis=1, keepdims=True)
        point = w @ towards / w.sum()
    return point
