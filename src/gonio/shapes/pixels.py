"""A mesh of the pixels that see a surface: what is known of its shape from there.

Neighbouring pixels span triangles, except over leaps in depth: edges some times as long as most are. Of many pixels
every second, third, ... in rows and columns is a vertex, joined to the next where no pixel between is missing and no
step between leaps. uv runs over the pixels as `View`'s does, so that maps of their size are textures.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array, require_finite, to_numpy
from ..errors import ArrayError, ParameterError
from .mesh import Mesh

LEAP = 10.0  # times the usual edge: where orthographic pixels see a plane, one tilted by 84 degrees
_STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))  # from a pixel to its neighbours, in rows and columns


def pixel_mesh(
    positions: Array, mask: Array, normals: Array | None = None, most: int | None = None, leap: float = LEAP
) -> Mesh:
    """Triangles between the pixels of `mask` (rows, columns) at `positions` (rows, columns, 3).

    normals: (rows, columns, 3), unit on the mask; those of the triangles where not given. most: >= 4, of the mesh's
    vertices, about; a vertex for each pixel where not given. leap: > 1, times the median edge, beyond which an edge is
    no surface.

    Raises `ArrayError` where the shapes do not fit, positions on the mask are not finite, or no three neighbouring
    pixels are on it; `ParameterError` for another `most` or `leap`.
    """
    if (most is not None and most < 4) or not leap > 1:
        raise ParameterError(f"most = {most}, leap = {leap:g}: at least 4 vertices and a leap above 1 are wanted.")
    p, mask = _checked(positions, mask)
    rows, columns = mask.shape
    step = 1 if most is None else max(1, int(np.ceil(np.sqrt(np.count_nonzero(mask) / most))))
    used, index = np.unique(_faces(p, mask, step, leap), return_inverse=True)
    row, column = np.divmod(used, columns)
    uv = np.stack(((column + 0.5) / columns, 1 - (row + 0.5) / rows), axis=-1)
    shading = None if normals is None else to_numpy(normals).reshape(-1, 3)[used]
    return Mesh(p.reshape(-1, 3)[used], index.reshape(-1, 3), uv, shading)


def _checked(positions: Array, mask: Array) -> tuple[np.ndarray, np.ndarray]:
    p, inside = to_numpy(positions), to_numpy(mask)
    if p.ndim != 3 or p.shape[2] != 3 or inside.shape != p.shape[:2] or inside.dtype != bool:
        raise ArrayError(
            f"positions have shape {p.shape}, mask {inside.shape} and dtype {inside.dtype}; (rows, columns, 3) and "
            "booleans (rows, columns) are wanted."
        )
    p = np.where(inside[..., None], p, 0.0)
    require_finite(p, "positions")
    return p, inside


def _faces(p: np.ndarray, mask: np.ndarray, step: int, leap: float) -> np.ndarray:
    """Triangles (F, 3), as numbers of pixels, between neighbours of every so-manieth one."""
    joined = _joined(p, mask, leap)
    row, column = np.ix_(np.arange(0, mask.shape[0] - step, step), np.arange(0, mask.shape[1] - step, step))

    def joins(k: int, down: int = 0, right: int = 0) -> np.ndarray:
        """Whether the pixels so far down and right of each are joined to the next by `step` steps of kind k."""
        y, x = _STEPS[k]
        return np.asarray(np.all([joined[k, row + down + t * y, column + right + t * x] for t in range(step)], axis=0))

    top, bottom, left, right = joins(0), joins(0, down=step), joins(1), joins(1, right=step)
    falling, rising = joins(2), joins(3, right=step)
    flat = p.reshape(-1, 3)
    nw = row * mask.shape[1] + column
    ne, sw = nw + step, nw + step * mask.shape[1]
    se = sw + step
    # The shorter diagonal, or the only one.
    falls, rises = np.linalg.norm(flat[se] - flat[nw], axis=-1), np.linalg.norm(flat[sw] - flat[ne], axis=-1)
    fall = falling & (~rising | (falls <= rises))
    rise = rising & ~fall
    faces = np.concatenate(
        [
            np.stack(corners, axis=-1)[good]
            for corners, good in (
                ((nw, sw, se), fall & left & bottom),
                ((nw, se, ne), fall & top & right),
                ((nw, sw, ne), rise & left & top),
                ((sw, se, ne), rise & bottom & right),
            )
        ]
    )
    if not len(faces):
        raise ArrayError("no three neighbouring pixels of the mask lie on one surface: the mask is dust, or all leaps.")
    return faces


def _joined(p: np.ndarray, mask: np.ndarray, leap: float) -> np.ndarray:
    """Whether each pixel and its neighbour by each of the steps are on the mask, with no leap between: (4, rows,
    columns)."""
    rows, columns = mask.shape
    lengths = np.full((len(_STEPS), rows, columns), np.inf)
    for length, (down, right) in zip(lengths, _STEPS, strict=True):
        here = np.s_[: rows - down, max(-right, 0) : columns - max(right, 0)]
        there = np.s_[down:, max(right, 0) : columns + min(right, 0)]
        span = np.linalg.norm(p[there] - p[here], axis=-1)
        length[here] = np.where(mask[here] & mask[there], span / np.hypot(down, right), np.inf)
    along = lengths[:2][np.isfinite(lengths[:2])]
    return np.asarray(lengths <= leap * np.median(along)) if along.size else np.zeros(lengths.shape, bool)
