"""A bounding-volume hierarchy over triangles: built by the binned surface-area heuristic, walked with a stack.

Nodes lie in depth-first order. An inner node's left child is the next node and `link` its right child, `count` 0;
a leaf's triangles are `link ... link + count`. Boxes: (2, 3) low and high. Sources: Wald 2007 (binned building);
the triangle test is Embree's Pluecker form, in which two triangles evaluate a shared edge to the same number with
opposite sign, so that no ray slips between them. That holds only without fastmath.
"""

from __future__ import annotations

import numpy as np
from numba import njit

BINS = 16
LEAF = 4  # at most this many triangles stay together unless the heuristic says so
MOST = 16  # and never more than this many
STEEP = 48  # below this depth halves are split by count, so that no stack outgrows DEPTH
DEPTH = 96


@njit(cache=True, nogil=True)
def build(corners, boxes, link, count, order):
    """Fills `boxes` (2F, 2, 3), `link` (2F,), `count` (2F,), `order` (F,) for `corners` (F, 3, 3); returns how many."""
    faces = corners.shape[0]
    centre = np.empty((faces, 3))
    for i in range(faces):
        order[i] = i
        for a in range(3):
            low = min(corners[i, 0, a], corners[i, 1, a], corners[i, 2, a])
            high = max(corners[i, 0, a], corners[i, 1, a], corners[i, 2, a])
            centre[i, a] = 0.5 * (low + high)
    stack = np.empty((DEPTH, 4), dtype=np.int64)
    bin_box = np.empty((BINS, 2, 3))
    bin_count = np.empty(BINS, dtype=np.int64)
    right_area = np.empty(BINS)
    right_count = np.empty(BINS, dtype=np.int64)
    grown = np.empty((2, 3))
    low_c = np.empty(3)
    high_c = np.empty(3)
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = 0, faces, 0, -1
    top, nodes = 1, 0
    while top > 0:
        top -= 1
        begin, end, depth, parent = stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3]
        node = nodes
        nodes += 1
        if parent >= 0:
            link[parent] = node
        for a in range(3):
            boxes[node, 0, a], boxes[node, 1, a] = np.inf, -np.inf
            low_c[a], high_c[a] = np.inf, -np.inf
        for k in range(begin, end):
            i = order[k]
            for a in range(3):
                for v in range(3):
                    boxes[node, 0, a] = min(boxes[node, 0, a], corners[i, v, a])
                    boxes[node, 1, a] = max(boxes[node, 1, a], corners[i, v, a])
                low_c[a] = min(low_c[a], centre[i, a])
                high_c[a] = max(high_c[a], centre[i, a])
        n = end - begin
        axis = 0
        for a in range(1, 3):
            if high_c[a] - low_c[a] > high_c[axis] - low_c[axis]:
                axis = a
        extent = high_c[axis] - low_c[axis]
        if n <= LEAF or (extent <= 0 and n <= MOST):
            link[node], count[node] = begin, n
            continue
        middle = begin + n // 2
        if extent > 0 and depth < STEEP:
            _reset(bin_box, bin_count)
            for k in range(begin, end):
                i = order[k]
                b = min(BINS - 1, int(BINS * (centre[i, axis] - low_c[axis]) / extent))
                bin_count[b] += 1
                for a in range(3):
                    for v in range(3):
                        bin_box[b, 0, a] = min(bin_box[b, 0, a], corners[i, v, a])
                        bin_box[b, 1, a] = max(bin_box[b, 1, a], corners[i, v, a])
            _clear(grown)
            total = 0
            for b in range(BINS - 1, 0, -1):
                _grow(grown, bin_box[b])
                total += bin_count[b]
                right_area[b], right_count[b] = _area(grown), total
            _clear(grown)
            total = 0
            best, cut = np.inf, -1
            for b in range(1, BINS):
                _grow(grown, bin_box[b - 1])
                total += bin_count[b - 1]
                if total > 0 and right_count[b] > 0:
                    cost = total * _area(grown) + right_count[b] * right_area[b]
                    if cost < best:
                        best, cut = cost, b
            if n <= MOST and best >= (n - 1) * _area(boxes[node]):  # a step down costs about one triangle
                link[node], count[node] = begin, n
                continue
            left, right = begin, end - 1
            while left <= right:
                i = order[left]
                if min(BINS - 1, int(BINS * (centre[i, axis] - low_c[axis]) / extent)) < cut:
                    left += 1
                else:
                    order[left], order[right] = order[right], i
                    right -= 1
            middle = left
        count[node] = 0
        stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = middle, end, depth + 1, node
        stack[top + 1, 0], stack[top + 1, 1], stack[top + 1, 2], stack[top + 1, 3] = begin, middle, depth + 1, -1
        top += 2
    return nodes


@njit(cache=True, nogil=True)
def closest(origins, directions, boxes, link, count, corners, primitive):
    """`primitive` (N,): the place in `corners` of the first triangle each ray meets at t > 0, -1 where none."""
    stack = np.empty(DEPTH, dtype=np.int64)
    for r in range(origins.shape[0]):
        primitive[r] = _walk(origins[r], directions[r], np.inf, False, boxes, link, count, corners, stack)


@njit(cache=True, nogil=True)
def blocked(origins, directions, far, boxes, link, count, corners, hit):
    """`hit` (N,): whether a ray meets any triangle at 0 < t < far."""
    stack = np.empty(DEPTH, dtype=np.int64)
    for r in range(origins.shape[0]):
        hit[r] = _walk(origins[r], directions[r], far[r], True, boxes, link, count, corners, stack) >= 0


@njit(cache=True, nogil=True)
def _walk(o, d, far, first, boxes, link, count, corners, stack):
    # A direction of nearly zero gets a large inverse in place of infinity, since 0 * inf would be NaN.
    ix = 1 / d[0] if abs(d[0]) > 1e-30 else 1e30
    iy = 1 / d[1] if abs(d[1]) > 1e-30 else 1e30
    iz = 1 / d[2] if abs(d[2]) > 1e-30 else 1e30
    found = -1
    node, top = 0, 0
    if _enters(boxes[0], o, ix, iy, iz, far) == np.inf:
        return found
    while True:
        if count[node] > 0:
            for k in range(link[node], link[node] + count[node]):
                t = _meets(o, d, corners[k])
                if 0 < t < far:
                    far, found = t, k
                    if first:
                        return found
            node = -1
        else:
            near, other = node + 1, link[node]
            enter_near = _enters(boxes[near], o, ix, iy, iz, far)
            enter_other = _enters(boxes[other], o, ix, iy, iz, far)
            if enter_other < enter_near:
                near, other = other, near
                enter_near, enter_other = enter_other, enter_near
            node = near if enter_near < np.inf else -1
            if enter_other < np.inf:
                stack[top] = other
                top += 1
        while node < 0:
            if top == 0:
                return found
            top -= 1
            node = stack[top]
            if _enters(boxes[node], o, ix, iy, iz, far) == np.inf:  # something nearer was found meanwhile
                node = -1


@njit(cache=True, nogil=True)
def _enters(box, o, ix, iy, iz, far):
    """Where the ray enters the box, infinite where it passes by. Rounded outwards: 1 + 2 gamma_3 (Ize 2013)."""
    x0, x1 = (box[0, 0] - o[0]) * ix, (box[1, 0] - o[0]) * ix
    y0, y1 = (box[0, 1] - o[1]) * iy, (box[1, 1] - o[1]) * iy
    z0, z1 = (box[0, 2] - o[2]) * iz, (box[1, 2] - o[2]) * iz
    enter = max(max(min(x0, x1), min(y0, y1)), max(min(z0, z1), 0.0))
    leave = min(min(max(x0, x1), max(y0, y1)), min(max(z0, z1), far)) * (1 + 1e-15)
    return enter if enter <= leave else np.inf


@njit(cache=True, nogil=True)
def _meets(o, d, tri):
    """t of the ray with the triangle, from either side; -1 where it passes by."""
    ax, ay, az = tri[0, 0] - o[0], tri[0, 1] - o[1], tri[0, 2] - o[2]
    bx, by, bz = tri[1, 0] - o[0], tri[1, 1] - o[1], tri[1, 2] - o[2]
    cx, cy, cz = tri[2, 0] - o[0], tri[2, 1] - o[1], tri[2, 2] - o[2]
    u = _side(cx - ax, cy - ay, cz - az, cx + ax, cy + ay, cz + az, d)
    v = _side(ax - bx, ay - by, az - bz, ax + bx, ay + by, az + bz, d)
    w = _side(bx - cx, by - cy, bz - cz, bx + cx, by + cy, bz + cz, d)
    if min(u, v, w) < 0 and max(u, v, w) > 0:
        return -1.0
    e1x, e1y, e1z = bx - ax, by - ay, bz - az
    e2x, e2y, e2z = cx - ax, cy - ay, cz - az
    nx, ny, nz = e1y * e2z - e1z * e2y, e1z * e2x - e1x * e2z, e1x * e2y - e1y * e2x
    slope = nx * d[0] + ny * d[1] + nz * d[2]
    if slope == 0:
        return -1.0
    return (nx * ax + ny * ay + nz * az) / slope


@njit(cache=True, nogil=True)
def _side(ex, ey, ez, sx, sy, sz, d):
    return (ey * sz - ez * sy) * d[0] + (ez * sx - ex * sz) * d[1] + (ex * sy - ey * sx) * d[2]


@njit(cache=True, nogil=True)
def _reset(bin_box, bin_count):
    for b in range(BINS):
        bin_count[b] = 0
        _clear(bin_box[b])


@njit(cache=True, nogil=True)
def _clear(box):
    for a in range(3):
        box[0, a], box[1, a] = np.inf, -np.inf


@njit(cache=True, nogil=True)
def _grow(box, other):
    for a in range(3):
        box[0, a] = min(box[0, a], other[0, a])
        box[1, a] = max(box[1, a], other[1, a])


@njit(cache=True, nogil=True)
def _area(box):
    """Half the area of the box, 0 for an empty one."""
    x, y, z = box[1, 0] - box[0, 0], box[1, 1] - box[0, 1], box[1, 2] - box[0, 2]
    return x * y + y * z + z * x if x >= 0 else 0.0
