"""A few beams for a whole map: pixels joined so that any smooth function of direction integrates nearly the same.

    cost of a rectangle A = sum over A of e |d - c|^2 = E - |M|^2 / E,    E = sum e,  M = sum e d,  c = M / E

e is a pixel's luminance times its solid angle, d its direction. Each cluster becomes one beam along its centroid c
with the exact energy of its pixels, so that what is linear in d is right, and the cost is the second-order error
of what is not. The most costly rectangle of the picture is cut in two where that saves most, again and again: five
summed-area tables give the cost of any rectangle from four look-ups each. A pixel like the sun is soon all but alone.

Median cuts (Debevec 2005) split by energy, and have no notion of how far apart the joined pixels lie.
"""

from __future__ import annotations

import heapq

import numpy as np


def clusters(w: np.ndarray, energy: np.ndarray, budget: int) -> tuple[np.ndarray, np.ndarray]:
    """(directions (K, 3), irradiance (K, C)), K <= budget, from directions (rows, columns, 3) and energies (..., C)."""
    rows, columns, channels = energy.shape
    light = energy @ (np.array([0.2126, 0.7152, 0.0722]) if channels == 3 else np.ones(1))
    table = np.zeros((rows + 1, columns + 1, 4 + channels))
    table[1:, 1:, 0] = light
    table[1:, 1:, 1:4] = light[..., None] * w
    table[1:, 1:, 4:] = energy
    np.cumsum(table, axis=0, out=table)
    np.cumsum(table, axis=1, out=table)

    def sums(r0: int, r1: int, c0: int, c1: int) -> np.ndarray:
        total: np.ndarray = table[r1, c1] - table[r0, c1] - table[r1, c0] + table[r0, c0]
        return total

    def cost(moments: np.ndarray) -> np.ndarray:
        e, m = moments[..., 0], moments[..., 1:4]
        spread: np.ndarray = e - (m * m).sum(axis=-1) / np.where(e > 0, e, 1.0)
        return np.where(e > 0, np.maximum(spread, 0.0), 0.0)

    def cut(box: tuple[int, int, int, int]) -> tuple[tuple[int, int, int, int], tuple[int, int, int, int]] | None:
        r0, r1, c0, c1 = box
        best, halves = np.inf, None
        corner = table[[r0, r0, r1, r1], [c0, c1, c0, c1], :4]
        if r1 - r0 > 1:
            upper = table[r0 + 1 : r1, c1, :4] - table[r0 + 1 : r1, c0, :4] - corner[1] + corner[0]
            both = cost(upper) + cost(corner[3] - corner[2] - corner[1] + corner[0] - upper)
            k = int(both.argmin())
            best, halves = float(both[k]), ((r0, r0 + 1 + k, c0, c1), (r0 + 1 + k, r1, c0, c1))
        if c1 - c0 > 1:
            left = table[r1, c0 + 1 : c1, :4] - table[r0, c0 + 1 : c1, :4] - corner[2] + corner[0]
            both = cost(left) + cost(corner[3] - corner[2] - corner[1] + corner[0] - left)
            k = int(both.argmin())
            if float(both[k]) < best:
                halves = ((r0, r1, c0, c0 + 1 + k), (r0, r1, c0 + 1 + k, c1))
        return halves

    whole = (0, rows, 0, columns)
    heap = [(-float(cost(sums(*whole))), whole)]
    done: list[tuple[int, int, int, int]] = []
    while heap and len(heap) + len(done) < budget:
        negative, box = heapq.heappop(heap)
        halves = cut(box) if negative < 0 else None
        if halves is None:
            done.append(box)
            continue
        for half in halves:
            heapq.heappush(heap, (-float(cost(sums(*half))), half))
    boxes = [*done, *(box for _, box in heap)]
    moments = np.stack([_exact(w, light, energy, box) for box in boxes])
    moments = moments[moments[:, 0] > 0] if (moments[:, 0] > 0).any() else moments[:1]
    centre = moments[:, 1:4]
    length = np.linalg.norm(centre, axis=-1, keepdims=True)
    # Opposite lamps of equal strength have no centroid; any direction is as good.
    directions = np.where(length > 0, centre / np.where(length > 0, length, 1.0), np.array([0.0, 0.0, 1.0]))
    return directions, moments[:, 4:]


def _exact(w: np.ndarray, light: np.ndarray, energy: np.ndarray, box: tuple[int, int, int, int]) -> np.ndarray:
    """Sums over a rectangle, not by tables: differences of large sums would lose the digits of dark ones."""
    at = np.s_[box[0] : box[1], box[2] : box[3]]
    e = light[at]
    return np.concatenate(([e.sum()], np.tensordot(e, w[at], 2), energy[at].sum(axis=(0, 1))))
