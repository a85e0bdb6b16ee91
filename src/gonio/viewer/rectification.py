"""A flat sample in its photograph and brought to its grid, to look at."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..capture.rectification import Rectified
from ..rendering.tonemap import clipped, tone_map
from .figures import blank, save
from .plots import INK

_LINES = 9  # across the grid and down, its outline among them


def rectified_picture(
    path: str | Path,
    texels: Rectified,
    photograph: np.ndarray,
    rectified: np.ndarray,
    corners: np.ndarray | None = None,
) -> Path:
    """Write a PNG of a `photograph` (rows, columns, 3) with the grid, beside it `rectified` (rows, columns, 3).

    corners (N, 2): a board's, in the photograph. Both pictures are exposed alike.
    """
    (rows, columns), (height, width) = texels.size, photograph.shape[:2]
    bright = float(np.quantile(rectified.max(axis=2), 0.98))
    exposure = 0.8 / bright if bright > 0 else 1.0
    side = 4.6
    widths = (side * width / height, side * columns / rows)
    figure = blank(sum(widths), side + 0.4)
    left, right = figure.subplots(1, 2, width_ratios=widths)
    left.imshow(tone_map(exposure * photograph, clipped), extent=(0, width, height, 0))
    # Lines that are straight in the plane are bent where the lens distorts.
    top_left, top_right, bottom_right, bottom_left = texels.grid.corners
    along, at = np.linspace(0, 1, 65)[:, None], np.linspace(0, 1, _LINES)
    for k, t in enumerate(at):
        for a, b, c, d in (
            (top_left, top_right, bottom_left, bottom_right),
            (top_left, bottom_left, top_right, bottom_right),
        ):
            start, end = a + t * (c - a), b + t * (d - b)
            x, y = texels.seen(start + along * (end - start)).T
            left.plot(x, y, color="#d08a1c", linewidth=1.4 if k in (0, _LINES - 1) else 0.5)
    if corners is not None:
        left.scatter(corners[:, 0], corners[:, 1], s=12, facecolors="none", edgecolors="#e0218a", linewidths=0.8)
    left.set(xlim=(0, width), ylim=(height, 0))
    left.set_title("photograph and grid", color=INK, fontsize=8)
    right.imshow(tone_map(exposure * rectified, clipped))
    right.set_title(f"{columns} x {rows} texels of {texels.grid.texel:.4g}", color=INK, fontsize=8)
    for axes in (left, right):
        axes.set_axis_off()
    return save(figure, path)
