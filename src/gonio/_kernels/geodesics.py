"""Waves that run over triangles from one vertex, and points that settle at given distances from others.

Only lengths of edges come in: both loops are about distances, and know nothing of where the surface lies.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

_SAME = 1e-10  # of a distance: nearer than this two ways are equally long


@njit(cache=True, nogil=True, error_model="numpy")
def march(source, faces, lengths, start, corners, bends, time, origin, heap, slot):  # type: ignore[no-untyped-def]
    """Fills `time` (V,), the distance along the surface from vertex `source`; infinity where nothing leads there.

    faces, lengths: (F, 3), vertices, and the edge across from each. corners[start[v]:start[v + 1]]: 3 f + k where v is
    corner k of face f. bends (V,), whether ways may bend at a vertex. origin (V,), heap (V,), slot (V,) are
    room to work in: the vertex at which the way to each bent last, the queue of vertices and each one's place in it.
    """
    time[:] = np.inf
    origin[:] = source
    slot[:] = -1
    time[source] = 0.0
    size = _rise(source, time, heap, slot, 0)
    while size > 0:
        v = heap[0]
        size -= 1
        slot[v] = -1
        if size > 0:
            _sink(heap[size], time, heap, slot, size)
        for i in range(start[v], start[v + 1]):
            f, k = corners[i] // 3, corners[i] % 3
            ka, kb = (k + 1) % 3, (k + 2) % 3
            a, b = faces[f, ka], faces[f, kb]
            va, vb, ab = lengths[f, kb], lengths[f, ka], lengths[f, k]
            # Each of the other two, by way of v and through the edge between v and the third.
            bent = v if bends[v] else origin[v]
            if _shorter(time[v] + va, bent, a, time, origin):
                size = _rise(a, time, heap, slot, size)
            if _shorter(time[v] + vb, bent, b, time, origin):
                size = _rise(b, time, heap, slot, size)
            bent = _common(v, b, time, origin)
            if bent >= 0 and _shorter(_across(time[v], time[b], time[bent], vb, va, ab), bent, a, time, origin):
                size = _rise(a, time, heap, slot, size)
            bent = _common(v, a, time, origin)
            if bent >= 0 and _shorter(_across(time[v], time[a], time[bent], va, vb, ab), bent, b, time, origin):
                size = _rise(b, time, heap, slot, size)


@njit(cache=True, nogil=True, error_model="numpy")
def _common(a, b, time, origin):  # type: ignore[no-untyped-def]
    """Where the ways to a and b bent last, if one of them went on from where the other did; -1 otherwise."""
    a, b = origin[a], origin[b]
    if time[a] > time[b]:
        a, b = b, a
    while b != a and time[b] > time[a]:
        b = origin[b]
    return a if a == b else -1


@njit(cache=True, nogil=True, error_model="numpy")
def _across(p, q, before, base, pc, qc):  # type: ignore[no-untyped-def]
    """The distance of corner c, when p and q are those of the ends of the edge `base` across from it and all ways came
    straight from one point at `before`; infinity where the straight way does not pass through the edge."""
    if not math.isfinite(p + q):
        return np.inf
    p, q = p - before, q - before
    along = (p * p - q * q + base * base) / (2 * base)
    below = p * p - along * along
    if below < -1e-6 * base * base:
        return np.inf
    x = (pc * pc - qc * qc + base * base) / (2 * base)
    y, below = math.sqrt(max(pc * pc - x * x, 0.0)), math.sqrt(max(below, 0.0))
    through = along * y + x * below
    slack = 1e-9 * base * (y + below)
    if through < -slack or through > base * (y + below) + slack:
        return np.inf
    return before + math.sqrt((x - along) ** 2 + (y + below) ** 2)


@njit(cache=True, nogil=True, error_model="numpy")
def _shorter(there, bent, v, time, origin):  # type: ignore[no-untyped-def]
    """Takes the way to v if it is shorter, or as long and bent earlier; whether it did."""
    same = _SAME * time[v] if math.isfinite(time[v]) else 0.0
    earlier = there < np.inf and there <= time[v] + same and time[bent] < time[origin[v]] - same
    if there < time[v] - same or earlier:
        time[v], origin[v] = min(there, time[v]), bent
        return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def _rise(v, time, heap, slot, size):  # type: ignore[no-untyped-def]
    """Puts v into the queue, or forward in it; its size after that."""
    i = slot[v]
    if i < 0:
        i = size
        size += 1
    while i > 0:
        parent = (i - 1) // 2
        if time[heap[parent]] <= time[v]:
            break
        heap[i] = heap[parent]
        slot[heap[i]] = i
        i = parent
    heap[i], slot[v] = v, i
    return size


@njit(cache=True, nogil=True, error_model="numpy")
def _sink(v, time, heap, slot, size):  # type: ignore[no-untyped-def]
    """Puts v at the head of the queue, and back in it behind all that are nearer."""
    i = 0
    while 2 * i + 1 < size:
        child = 2 * i + 1
        if child + 1 < size and time[heap[child + 1]] < time[heap[child]]:
            child += 1
        if time[v] <= time[heap[child]]:
            break
        heap[i] = heap[child]
        slot[heap[i]] = i
        i = child
    heap[i], slot[v] = v, i


@njit(cache=True, nogil=True, error_model="numpy")
def settle(points, anchors, distances, near, steps):  # type: ignore[no-untyped-def]
    """Moves each of `points` (N, 2) to less sum over k of (|x - a_k| - d_k)^2 / (d_k^2 + near^2), for `anchors` (M, 2)
    that stand and `distances` (N, M). By majorisation (SMACOF), which never climbs."""
    for n in range(points.shape[0]):
        x, y = points[n]
        for _ in range(steps):
            total, to_x, to_y = 0.0, 0.0, 0.0
            for k in range(anchors.shape[0]):
                d = distances[n, k]
                off_x, off_y = x - anchors[k, 0], y - anchors[k, 1]
                far = math.sqrt(off_x * off_x + off_y * off_y)
                w = 1 / (d * d + near * near)
                stretch = d / far if far > 0 else 0.0
                total += w
                to_x += w * (anchors[k, 0] + stretch * off_x)
                to_y += w * (anchors[k, 1] + stretch * off_y)
            x, y = to_x / total, to_y / total
        points[n, 0], points[n, 1] = x, y
