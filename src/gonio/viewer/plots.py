"""Plots of reflectance, drawn by matplotlib without a window, legible on light and on dark paper."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..arrays import to_numpy
from ..brdf.model import BRDF
from ..colour import luminance
from ..directions import from_spherical
from ..files.whole import writing

# Grey that stands on white and on black with equal contrast, for everything that is not data.
INK = "#888888"


def lobes(path: str | Path, brdfs: Mapping[str, BRDF], theta_i: float = 45.0) -> Path:
    """Write a PNG of f cos theta_o in the plane of incidence, a polar curve for each model, light at `theta_i` degrees.

    The radius is logarithmic, from a thousandth of the greatest value; the light's direction is marked.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    angle = np.linspace(-89.9, 89.9, 1441)
    # The light stands at the left, so that mirrors send it to the right.
    wo = from_spherical(np.radians(np.abs(angle)), np.where(angle < 0, np.pi, 0.0))
    wi = from_spherical(np.radians(theta_i), np.pi)
    curves = {}
    for name, brdf in brdfs.items():
        f = to_numpy(brdf.f(wi, wo))
        curves[name] = to_numpy(luminance(np.broadcast_to(f, (*f.shape[:-1], 3)))) * wo[:, 2]
    top = max(float(curve.max()) for curve in curves.values())
    if not top > 0:
        top = 1.0

    figure = Figure(figsize=(9.0, 3.6), dpi=110)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.04, -0.08, 0.6, 1.14), projection="polar")
    axes.set(theta_zero_location="N", theta_direction=-1, thetamin=-90, thetamax=90, rmin=-3, rmax=0.05)
    for name, curve in curves.items():
        axes.plot(np.radians(angle), np.log10(np.maximum(curve / top, 1e-3)), label=name, linewidth=1.6)
    axes.plot([-np.radians(theta_i)] * 2, (-3, 0.05), color=INK, linestyle=":", linewidth=1.2)
    axes.set_yticks((-2, -1, 0), labels=("1/100", "1/10", "1"))
    axes.grid(color=INK, alpha=0.35)
    axes.spines[:].set_color(INK)
    axes.tick_params(colors=INK)
    figure.legend(loc="center right", frameon=False, labelcolor=INK, fontsize=9)
    with writing(Path(path)) as temporary:
        figure.savefig(temporary, transparent=True)
    return Path(path)
