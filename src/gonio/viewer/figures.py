"""Blank figures to draw on, and how they are kept: PNG with a transparent ground, whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..files.whole import writing

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
