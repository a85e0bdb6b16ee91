"""What was fitted to photographs predicts, to look at."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..rendering.tonemap import clipped, tone_map
from .figures import blank, colour_bar, save
from .plots import INK


def sharing_picture(
    path: str | Path,
    names: Sequence[str],
    shown: Sequence[tuple[np.ndarray, np.ndarray, float]],
    history: Sequence[tuple[int, float]] = (),
    residual: np.ndarray | None = None,
) -> Path:
    """Write a PNG: for each of `shown` (photograph, prediction, relative rms) both, equally exposed, with four times
    their difference about gray; below them the residual as centres were added, `history`, or a map of the relative
    rms `residual` (rows, columns), NaN where there is none."""
    rows, columns = shown[0][0].shape[:2]
    side = 3.2
    figure = blank(3 * side, len(shown) * (side * rows / columns + 0.4) + 2.6)
    grid = figure.add_gridspec(len(shown) + 1, 3, height_ratios=[*[side * rows / columns + 0.4] * len(shown), 2.4])
    for k, (name, (photograph, image, off)) in enumerate(zip(names, shown, strict=True)):
        lit = photograph.max(axis=2)[photograph.max(axis=2) > 0]
        bright = float(np.quantile(lit, 0.98)) if lit.size else 1.0
        panels = {
            name: tone_map(photograph * (0.8 / bright), clipped),
            f"predicted, {100 * off:.1f} % off": tone_map(image * (0.8 / bright), clipped),
            "4 x difference": (0.5 + 2 * (image - photograph) / bright).clip(0, 1),
        }
        for column, (title, panel) in enumerate(panels.items()):
            axes = figure.add_subplot(grid[k, column])
            axes.imshow(panel)
            axes.set_title(title, color=INK, fontsize=8)
            axes.set_axis_off()
    if residual is not None:
        axes = figure.add_subplot(grid[len(shown), 0])
        drawn = axes.imshow(100 * residual, cmap="magma", vmin=0)
        axes.set_title("residual of each pixel, %", color=INK, fontsize=8)
        axes.set_axis_off()
        colour_bar(figure, drawn, axes, "")
        return save(figure, path)
    axes = figure.add_subplot(grid[len(shown), :])
    count, left = np.array(history).T if len(history) else (np.array([1.0]), np.array([1.0]))
    axes.loglog(count, left, color="#d08a1c", marker=".", linewidth=1.2)
    axes.set_xlabel("centres", color=INK, fontsize=8)
    axes.set_ylabel("rms residual", color=INK, fontsize=8)
    axes.tick_params(which="both", colors=INK, labelsize=7)
    for spine in axes.spines.values():
        spine.set_edgecolor(INK)
    return save(figure, path)
