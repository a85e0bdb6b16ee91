"""Pictures of one environment in another layout, or standing another way.

    L'(texel) = sum_k L(w_k) d_k / sum_k d_k,    w_k on a grid within the texel, d = solid angle per area of the sheet

The grid is at least twice as fine as the source's pixels, so that no lamp falls through. Where the new pixels are the
old ones in other places they are moved instead, and keep their values.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from .mappings import Mapping

# Samples in a block: what is made of them stays in the cache.
_BLOCK = 1 << 14


def averaged(
    look: Callable[[np.ndarray], np.ndarray], mapping: Mapping, shape: tuple[int, int], finest: float
) -> np.ndarray:
    """Picture (rows, columns, C) of the mean of `look` over each pixel; `finest` is the width of its detail in radians.

    look: radiance (n, C) towards directions (n, 3) in the axes of `mapping`.
    """
    height, width = mapping.sheet_shape(*shape)
    solid = mapping.sheet_solid_angles(height, width)
    n = max(math.ceil(2 * math.sqrt(float(solid.max())) / finest - 1e-9), 2)
    within = (np.arange(n) + 0.5) / n
    u = (np.arange(width) + within[:, None, None]) / width
    step = max(_BLOCK // (n * width), 1)
    sheets = []
    for sheet in range(mapping.sheets):
        for r in range(0, height, step):
            rows = np.arange(r, min(r + step, height))[:, None]
            total, weight = 0.0, 0.0
            for offset in within:
                v = (rows + offset) / height
                w = mapping.direct(sheet, u, v)
                # A texel without any sample inside the disc still gets its rim's radiance.
                density = np.maximum(mapping.density(u, v), 1e-30)[..., None]
                total = total + (look(w.reshape(-1, 3)).reshape(*w.shape[:-1], -1) * density).sum(axis=0)
                weight = weight + density.sum(axis=0)
            sheets.append(np.where(solid[r : r + step, :, None] > 0, total / weight, 0.0))
    image = np.zeros((shape[0] * shape[1], sheets[0].shape[-1]))
    image[mapping.placement(*shape).reshape(-1)] = np.concatenate(sheets).reshape(-1, image.shape[-1])
    return image.reshape(*shape, -1)


def moved(
    pixels: np.ndarray, source: Mapping, mapping: Mapping, shape: tuple[int, int], turn: np.ndarray
) -> np.ndarray | None:
    """`pixels` (rows, columns, C) of `source` in their places on `mapping`, where every new pixel covers exactly one.

    None where they do not. turn (3, 3) takes the new layout's own axes to the old one's.
    """
    rows, columns = pixels.shape[:2]
    height, width = mapping.sheet_shape(*shape)
    few = (np.array([[height // 2], [height // 3]]) + 0.5) / height, (np.array([width // 2, width // 3]) + 0.5) / width
    at = np.stack(source.pixels(mapping.direct(0, few[1], few[0]) @ turn.T, rows, columns)) - 0.5
    if np.max(np.abs(at - np.rint(at))) > 1e-6:
        return None  # as in most cases, before all pixels are looked at
    old, new = source.solid_angles(rows, columns), mapping.solid_angles(*shape)
    shown = new > 0
    if np.count_nonzero(shown) != np.count_nonzero(old):
        return None
    own, _ = mapping.directions(*shape)
    at = np.stack(source.pixels(own[shown] @ turn.T, rows, columns))
    row, column = np.clip(at.astype(np.int64), 0, [[rows - 1], [columns - 1]])
    # Pixels cut by a rim stand for its nearest point, not for their centres.
    whole = old[row, column] > 0.99 * np.median(old)
    off = np.abs(at - 0.5 - [row, column])[:, whole | (source.sheets == 1)]
    if np.max(off) > 1e-6 or not np.allclose(old[row, column], new[shown], rtol=1e-6):
        return None
    there = np.zeros((*shape, pixels.shape[-1]), dtype=pixels.dtype)
    there[shown] = pixels[row, column]
    return there
