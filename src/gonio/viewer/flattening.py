"""A mesh laid flat, to look at: what became of lengths, and of circles."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..shapes.flattening import Flattened
from ..shapes.geodesics import geodesic_distances
from .figures import blank, save
from .plots import INK

_RINGS = 10
_SIDE = 6.0  # inches, the longer side


def flattening_picture(path: str | Path, flat: Flattened) -> Path:
    """Write a PNG of the mesh in the plane: faces coloured by what lengths on them were multiplied by, in the
    direction that suffered most; over them lines of equal distance along the surface from the middle of each part,
    which are circles where distances were kept."""
    from matplotlib.colors import LogNorm
    from matplotlib.tri import Triangulation

    used = np.flatnonzero(flat.part >= 0)
    index = np.full(len(flat.part), -1)
    index[used] = np.arange(len(used))
    x, y = flat.coordinates[used].T
    width, height = np.ptp(x), np.ptp(y)
    scale = _SIDE / max(width, height)
    figure = blank(width * scale + 1.4, max(height * scale, 1.6) + 0.5)
    axes = figure.add_subplot()
    plane = Triangulation(x, y, index[flat.mesh.faces])
    worst = _worst(flat.stretch)
    reach = float(np.clip(np.quantile(np.maximum(worst, 1 / worst), 0.98), 1.05, 10.0))
    norm = LogNorm(1 / reach, reach)
    drawn = axes.tripcolor(plane, worst, cmap="RdBu_r", norm=norm, rasterized=True)
    distance = _from_middles(flat)[used]
    axes.tricontour(
        plane, distance, levels=np.linspace(0, distance.max(), _RINGS + 2)[1:-1], colors="#333333", linewidths=0.7
    )
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title(f"distances {100 * flat.distortion:.2g} % off, rms", color=INK, fontsize=9)
    ticks = (1 / reach, 1.0, reach)
    bar = figure.colorbar(drawn, ax=axes, shrink=0.7, ticks=ticks, format=lambda value, _: f"{value:.2f}")
    bar.ax.minorticks_off()
    bar.ax.tick_params(colors=INK, labelsize=7)
    bar.set_label("lengths are multiplied by", color=INK, fontsize=8)
    bar.outline.set_edgecolor(INK)
    return save(figure, path)


def _worst(stretch: np.ndarray) -> np.ndarray:
    """Of each face's two singular values (F, 2) the one that is farther from 1, as a factor."""
    largest, least = np.maximum(np.abs(stretch), 1e-3).T
    return np.asarray(np.where(largest * least > 1, largest, least))


def _from_middles(flat: Flattened) -> np.ndarray:
    """Distances (V,) along the surface, each part's from its vertex nearest to its middle in the plane."""
    middles = []
    for part in range(flat.part.max() + 1):
        own = np.flatnonzero(flat.part == part)
        x = flat.coordinates[own]
        middles.append(own[np.argmin(np.linalg.norm(x - (x.min(axis=0) + x.max(axis=0)) / 2, axis=1))])
    nearest = np.full(len(flat.part), np.inf)
    for middle in middles:
        nearest = np.minimum(nearest, geodesic_distances(flat.mesh, [middle], flat.welded)[0])
    return nearest
