"""The reflectance of chosen pixels of a shared material, to look at: RS's figures 15 and 16.

disc      log f over (theta_h, phi_d) at theta_d = 5 degrees, as a polar map       RS 15: what was never seen is bare
curves    f over theta_h at phi_d = 90 degrees, for several theta_d                dotted where it is not to be trusted
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..brdf.model import BRDF
from ..directions import from_half_difference
from ..lights.points import Directional
from ..reflection import textured
from ..rendering.relight import Relightable, relight
from ..rendering.tonemap import clipped, tone_map
from .figures import COLOURS, blank, exposed, save
from .plots import INK

_TRUSTED = math.exp(-1)
_DIFFERENCES = (5.0, 30.0, 60.0)


def spread_pixels(mask: np.ndarray, count: int = 3) -> list[tuple[int, int]]:
    """`count` pixels (row, column) well within `mask` (rows, columns), far from each other."""
    at = np.argwhere(mask)
    low, high = np.quantile(at, (0.15, 0.85), axis=0)
    within = ((at >= low) & (at <= high)).all(axis=1)
    at = at[within] if within.any() else at
    chosen = [at[np.argmin(((at - at.mean(axis=0)) ** 2).sum(axis=1))]]
    while len(chosen) < min(count, len(at)):
        away = np.min([((at - one) ** 2).sum(axis=1) for one in chosen], axis=0)
        chosen.append(at[np.argmax(away)])
    return [(int(row), int(column)) for row, column in chosen]


def lobes_picture(path: str | Path, thing: Relightable, pixels: Sequence[tuple[int, int]]) -> Path:
    """Write a PNG: the view with `pixels` (row, column) of its mask marked, and for each of them a disc and curves."""
    uv = thing.view.uv
    assert uv is not None  # a Relightable's runs over its pixels
    material = textured(thing.material, uv[tuple(np.transpose(pixels))])
    figure = blank(4.2 + 2.5 * len(pixels), 5.4)
    grid = figure.add_gridspec(2, 1 + len(pixels), width_ratios=[1.7, *[1.0] * len(pixels)])
    _view(figure.add_subplot(grid[:, 0]), thing, pixels)
    phi, theta = np.meshgrid(np.linspace(0, 2 * np.pi, 97), np.radians(np.linspace(0.5, 80, 80)))
    discs, trust = _seen(material, len(pixels), theta, math.radians(5), phi)
    shown = np.where(trust > _TRUSTED, np.log10(np.maximum(discs, 1e-6)), np.nan)
    known = shown[np.isfinite(shown)]
    bounds = np.quantile(known, (0.02, 0.995)) if known.size else (-1.0, 1.0)
    theta_h = np.radians(np.linspace(0.2, 80, 160))
    curves = [_seen(material, len(pixels), theta_h, math.radians(theta_d), np.pi / 2) for theta_d in _DIFFERENCES]
    for k, colour in enumerate(COLOURS[: len(pixels)]):
        axes = figure.add_subplot(grid[0, k + 1], projection="polar")
        drawn = axes.pcolormesh(phi, np.degrees(theta), shown[k], vmin=bounds[0], vmax=bounds[1], cmap="viridis")
        axes.set_rticks((30, 60), labels=("30", "60"))
        axes.set_xticks([])
        axes.tick_params(colors=INK, labelsize=7)
        axes.spines[:].set_color(colour)
        axes.set_title(f"pixel {pixels[k][0]}, {pixels[k][1]}", color=colour, fontsize=9)
        axes = figure.add_subplot(grid[1, k + 1])
        for theta_d, shade, (f, trusted) in zip(_DIFFERENCES, (1.0, 0.65, 0.4), curves, strict=True):
            x, sure, look = np.degrees(theta_h), trusted[k] > _TRUSTED, {"color": colour, "alpha": shade}
            axes.semilogy(x, np.where(sure, np.nan, f[k]), ":", **look)
            axes.semilogy(x, np.where(sure, f[k], np.nan), linewidth=1.6, label=f"{theta_d:g}", **look)
        axes.set_ylim(10 ** (bounds[0] - 0.3), 10 ** (bounds[1] + 0.3))
        axes.set_xlabel("theta_h, degrees", color=INK, fontsize=8)
        axes.tick_params(which="both", colors=INK, labelsize=7)
        axes.spines[:].set_color(INK)
        legend = axes.legend(title="theta_d", fontsize=7, title_fontsize=7, labelcolor=INK, frameon=False)
        legend.get_title().set_color(INK)
    bar = figure.colorbar(drawn, ax=figure.axes[1::2], fraction=0.03)
    bar.set_label("log10 f, theta_d = 5 degrees", color=INK, fontsize=8)
    bar.ax.tick_params(colors=INK, labelsize=7)
    return save(figure, path)


def _view(axes: Any, thing: Relightable, pixels: Sequence[tuple[int, int]]) -> None:
    wo = thing.view.wo[thing.view.mask].mean(axis=0)
    image = relight(thing, Directional(wo / np.linalg.norm(wo), [math.pi] * 3))
    axes.imshow(tone_map(exposed(image), clipped))
    for (row, column), colour in zip(pixels, COLOURS, strict=False):
        axes.plot(column, row, "o", color=colour, markersize=9, markeredgecolor="white")
    axes.set_axis_off()


def _seen(
    material: BRDF, count: int, theta_h: np.ndarray, theta_d: float, phi_d: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray]:
    """The mean of f over channels at `count` sites, and its confidence, (count, ...); NaN below the horizon."""
    wi, wo = from_half_difference(theta_h, 0.0, theta_d, phi_d)
    shape = wi.shape[:-1]
    wi, wo = wi.reshape(-1, 1, 3), wo.reshape(-1, 1, 3)
    above = (wi[..., 2] > 0) & (wo[..., 2] > 0)
    f = np.broadcast_to(material.f(wi, wo).mean(axis=-1), (len(wi), count))
    trust = np.broadcast_to(material.confidence(wi, wo), f.shape)
    f, trust = (np.where(above, x, np.nan).T.reshape(count, *shape) for x in (f, trust))
    return f, trust
