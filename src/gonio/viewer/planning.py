"""What photographs tell, to look at: the boxes of RS 1, 4 and 5 under the hyperbola of RS 6, and the lights' sky.

The plane is that of RS's figure 5, one quarter of it and logarithmic: fine textures to the right, sharp highlights up.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ..fitting.planning import Plan, Told, neighbours
from .figures import blank, save
from .plots import INK
from .sky import LIGHT, draw_sky

_TICKS = [digit * 10.0**k for k in range(-4, 6) for digit in (1, 2, 5)]
_SHARED, _ALONE, _ASKED = "#2f7fd0", "#2a9d5a", "#e0218a"


def planning_picture(
    path: str | Path, plan: Plan, lights: np.ndarray, highlight: float = math.inf, texture: float = math.inf
) -> Path:
    """Write a PNG: what `plan` says is told, with what is asked for, `highlight` in radians and `texture` in pixels,
    beside its `lights` (N, 3), seen from +z, with lines between neighbours."""
    figure = blank(9.6, 4.6)
    left, right = figure.subplots(1, 2)
    _plane(left, plan, math.degrees(highlight), texture)
    _sky(right, lights, plan)
    return save(figure, path)


def _plane(axes: Any, plan: Plan, highlight: float, texture: float) -> None:
    shown = [(told, name, colour) for told, name, colour in _boxes(plan) if told is not None]
    widths = [60.0, highlight, *(math.degrees(told.highlight) for told, _, _ in shown)]
    periods = [20.0, texture, *(told.texture for told, _, _ in shown)]
    low, fine = 0.4 * min(widths), 1.2
    broad, coarse = (2.5 * max(x for x in values if math.isfinite(x)) for values in (widths, periods))
    for told, name, colour in shown:
        # What is not told at all is a line at the edge of the plane.
        x, y = min(told.texture, coarse), min(math.degrees(told.highlight), broad)
        axes.fill([coarse, x, x, coarse], [broad, broad, y, y], color=colour, alpha=0.25, linewidth=0)
        axes.plot([coarse, x, x], [y, y, broad], color=colour, linewidth=1.6, label=name, clip_on=False, zorder=4)
    if not plan.flat and math.isfinite(plan.dtheta):
        # Omega_x Omega_theta = pi^2 / dtheta, of periods and widths
        period = np.geomspace(fine, coarse, 50)
        width = np.degrees(2.6 * plan.dtheta * 2 / math.pi / period)
        axes.plot(period, width, color=INK, linestyle="--", linewidth=1.0, label="RS 6")
    if math.isfinite(min(highlight, texture)):
        x, y = min(texture, coarse), min(highlight, broad)
        axes.plot([x], [y], "o", color=_ASKED, markersize=7, label="asked for", clip_on=False, zorder=5)
    axes.set(xscale="log", yscale="log", xlim=(coarse, fine), ylim=(broad, low))
    for axis, (far, near) in ((axes.xaxis, (coarse, fine)), (axes.yaxis, (broad, low))):
        axis.set_ticks([tick for tick in _TICKS if near < tick < far])
        axis.set_ticks([], minor=True)
        axis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_xlabel("texture, pixels a period", color=INK, fontsize=8)
    axes.set_ylabel("width of a highlight, degrees", color=INK, fontsize=8)
    axes.tick_params(which="both", colors=INK, labelsize=7)
    axes.spines[:].set_color(INK)
    axes.legend(loc="upper right", fontsize=7, labelcolor=INK, frameon=False)


def _boxes(plan: Plan) -> list[tuple[Told | None, str, str]]:
    alone = "each pixel alone, flat, RS 1" if plan.flat else "each pixel alone, RS 4"
    return [(plan.shared, "shared, RS 5", _SHARED), (plan.alone, alone, _ALONE)]


def _sky(axes: Any, lights: np.ndarray, plan: Plan) -> None:
    for pair in neighbours(lights):
        axes.plot(*lights[pair, :2].T, color=LIGHT, linewidth=0.8, alpha=0.5)
    apart = f", {math.degrees(plan.dtheta):.2g} degrees apart" if math.isfinite(plan.dtheta) else ""
    draw_sky(axes, lights, f"{len(lights)} light{'s' if len(lights) > 1 else ''}{apart}")
