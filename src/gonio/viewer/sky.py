"""Directions in the unit disc, x right and y up, with circles of 30, 60 and 90 degrees from +z."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .plots import INK

LIGHT = "#d08a1c"


def draw_sky(axes: Any, directions: np.ndarray, title: str) -> None:
    """Draw `directions` (N, 3); those with z <= 0 are hollow."""
    ring = np.linspace(0, 2 * math.pi, 181)
    for degrees in (30, 60, 90):
        radius = math.sin(math.radians(degrees))
        axes.plot(radius * np.cos(ring), radius * np.sin(ring), color=INK, linewidth=0.6, alpha=0.6)
        axes.text(0, radius, f"{degrees}", color=INK, fontsize=6, ha="center", va="bottom")
    x, y, z = directions.T
    axes.scatter(x, y, s=18, c=np.where(z > 0, LIGHT, "none"), edgecolors=LIGHT, linewidths=0.8, zorder=3)
    axes.set(xlim=(-1.12, 1.12), ylim=(-1.12, 1.12), aspect="equal")
    axes.set_title(title, color=INK, fontsize=8)
    axes.set_axis_off()
