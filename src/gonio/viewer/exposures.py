"""Merged exposures to look at: the response they were decoded by, the radiance, and how well it is known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..capture.exposure import Merged, Response
from ..rendering.tonemap import tone_map
from .figures import blank, save
from .plots import INK

_CHANNELS = {1: (INK,), 3: ("#d04a3c", "#3a9a4c", "#4a74d0")}
_SATURATED = (0.88, 0.13, 0.54)
_SIDE = 1200  # pixels of an image that is drawn


def merged_picture(path: str | Path, merged: Merged, response: Response) -> Path:
    """Write a PNG of the response, the radiance (saturated pixels magenta), and its relative standard deviation."""
    step = max(1, -(-max(merged.saturated.shape) // _SIDE))
    radiance, variance, saturated = (x[::step, ::step] for x in (merged.radiance, merged.variance, merged.saturated))
    rows, columns = saturated.shape
    figure = blank(13.2, max(3.2, 4.4 * rows / columns + 0.5))
    left, middle, right = figure.subplots(1, 3, width_ratios=(0.8, 1, 1.1))
    _response(left, response)
    shown = np.array(tone_map(radiance.clip(0), exposure=None))
    shown[saturated] = _SATURATED
    middle.imshow(shown.clip(0, 1))
    middle.set_title(f"radiance; {merged.saturated.mean():.2%} saturated", color=INK, fontsize=9)
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = 100 * np.sqrt(variance.mean(axis=2)) / radiance.mean(axis=2)
    relative[~np.isfinite(relative)] = np.nan
    low, high = np.nanquantile(relative, (0.01, 0.99)) if np.isfinite(relative).any() else (0.0, 1.0)
    drawn = right.imshow(relative, vmin=low, vmax=max(high, low + 1e-9), cmap="magma")
    bar = figure.colorbar(drawn, ax=right, fraction=0.04 * rows / columns, pad=0.02)
    bar.ax.tick_params(colors=INK, labelsize=7)
    bar.outline.set_edgecolor(INK)
    right.set_title("standard deviation, % of the radiance", color=INK, fontsize=9)
    for axes in (middle, right):
        axes.set_axis_off()
    return save(figure, path)


def _response(axes: Any, response: Response) -> None:
    """Exposure of each level, logarithmic."""
    g = response.log_exposure
    codes = response.step * (np.arange(len(g)) + 0.5) - 0.5
    for curve, colour in zip(g.T, _CHANNELS[g.shape[1]], strict=True):
        axes.semilogy(codes, np.exp(np.where(np.isfinite(curve), curve, np.nan)), color=colour, linewidth=1.5)
    axes.set_ylim(max(1e-5, float(np.exp(g[np.isfinite(g)].min())) / 2), 2)
    residual = f"; residual {response.residual:.1%} rms" if response.residual else ""
    axes.set_title(f"response{residual}", color=INK, fontsize=9)
    axes.set_xlabel("code", color=INK, fontsize=8)
    axes.set_ylabel("exposure, of full scale", color=INK, fontsize=8)
    axes.grid(color=INK, alpha=0.3)
    axes.spines[:].set_color(INK)
    axes.tick_params(colors=INK, labelsize=7)
    axes.set_facecolor("none")
