"""Blank figures to draw on, and how they are kept: PNG with a transparent ground, whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..files.whole import writing
from .plots import INK

# Of places that are marked in one panel and drawn in others.
COLOURS = ("#d0381c", "#2f7fd0", "#2a9d5a", "#a05ad0", "#d08a1c", "#8a8a1c")


def blank(width: float, height: float) -> Any:
    """A figure of so many inches, without window or toolkit."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Any, path: str | Path) -> Path:
    """Write the figure as a PNG; answers its path."""
    with writing(Path(path)) as temporary:
        figure.savefig(temporary, transparent=True)
    return Path(path)


def exposed(image: np.ndarray) -> np.ndarray:
    """The image (rows, columns, 3) so bright that all but 2 % of it lies below .8."""
    bright = float(np.quantile(image.max(axis=2), 0.98))
    return image * (0.8 / bright) if bright > 0 else image


def colour_bar(figure: Any, drawn: Any, axes: Any, name: str) -> None:
    """Beside `axes`, of what is `drawn` in them."""
    bar = figure.colorbar(drawn, ax=axes, fraction=0.046, pad=0.02)
    bar.set_label(name, color=INK, fontsize=8)
    bar.ax.tick_params(colors=INK, labelsize=7)
    bar.outline.set_edgecolor(INK)
