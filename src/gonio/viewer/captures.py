"""Captures to look at: contact sheets with their lights, and what photometric stereo made of them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ..capture.circles import Circle
from ..capture.lighting import directions_from, is_near
from ..capture.model import Capture
from ..capture.photometric_stereo import Relief
from ..capture.turntable import Turntable
from ..directions import normalise
from ..rendering.tonemap import clipped, tone_map
from .figures import blank, exposed, save
from .plots import INK
from .sky import draw_sky

_MOST = 30  # photographs on a sheet, evenly chosen
_SIDE = 160  # pixels of one


def contact_sheet(path: str | Path, capture: Capture | Turntable) -> Path:
    """Write a PNG of the photographs, all exposed alike, beside the directions of their lights, seen from +z: from the
    camera, where it stands above. Of photographs from many places it is those of the cameras."""
    chosen = np.unique(np.linspace(0, len(capture.photographs) - 1, _MOST).astype(int))
    thumbs = [_thumb(capture.photographs.read(int(k)).radiance) for k in chosen]
    bright = float(np.quantile(np.stack([thumb.max(axis=2) for thumb in thumbs]), 0.98))
    title, towards = _towards(capture)
    across = math.ceil(math.sqrt(1.5 * len(thumbs)))
    down = math.ceil(len(thumbs) / across)
    # A row is as high as its photographs with their numbers; what the plot beside needs more is left free below.
    high = down * (1.15 * thumbs[0].shape[0] / thumbs[0].shape[1] + 0.2)
    rest = max(4.4 - high, 0.01) if towards is not None else 0.01
    figure = blank(1.15 * across + (4.4 if towards is not None else 0.4), high + rest)
    parts = figure.add_gridspec(
        2, 2, width_ratios=(1.15 * across, 4.2 if towards is not None else 0.2), height_ratios=(high, rest)
    )
    grid = parts[0, 0].subgridspec(down, across, hspace=0.25, wspace=0.05)
    for place, k, thumb in zip(grid, chosen, thumbs, strict=False):
        axes = figure.add_subplot(place)
        axes.imshow(tone_map(thumb * (0.8 / bright) if bright > 0 else thumb, clipped))
        axes.set_title(f"{k}", color=INK, fontsize=7, pad=2)
        axes.set_axis_off()
    if towards is not None:
        _directions(figure.add_subplot(parts[:, 1]), towards, chosen, title)
    return save(figure, path)


def ball_picture(
    path: str | Path, image: np.ndarray, circle: Circle, highlights: np.ndarray, directions: np.ndarray
) -> Path:
    """Write a PNG of a mirror ball (rows, columns, 3), its outline and highlights (N, 2), beside the lights (N, 3)."""
    figure = blank(9.4, 4.6)
    left, right = figure.subplots(1, 2)
    left.imshow(tone_map(exposed(image), clipped), extent=(0, image.shape[1], image.shape[0], 0))
    turn, (row, column) = np.linspace(0, 2 * math.pi, 181), circle.centre
    left.plot(column + circle.radius * np.cos(turn), row + circle.radius * np.sin(turn), color="#d08a1c", linewidth=1.2)
    left.scatter(highlights[:, 1], highlights[:, 0], s=22, facecolors="none", edgecolors="#e0218a", linewidths=1.0)
    margin = 1.2 * circle.radius
    left.set(xlim=(column - margin, column + margin), ylim=(row + margin, row - margin))
    left.set_title("outline and highlights", color=INK, fontsize=8)
    left.set_axis_off()
    _directions(right, directions, np.arange(len(directions)), "lights")
    return save(figure, path)


def relief_picture(path: str | Path, relief: Relief, heights: np.ndarray | None = None) -> Path:
    """Write a PNG of normals, albedo, residual, standard error and, where given, heights (rows, columns)."""
    rows, columns = relief.used.shape
    panels: list[tuple[str, np.ndarray, dict[str, Any]]] = [
        ("normals", np.where(np.isfinite(relief.normals), 0.5 * relief.normals + 0.5, 1).clip(0, 1), {}),
        ("albedo, relative", tone_map(exposed(np.nan_to_num(relief.albedo)), clipped), {}),
        ("residual, % of albedo", 100 * relief.residual, {"cmap": "magma"}),
        ("standard error of the normal, degrees", np.degrees(relief.error), {"cmap": "magma"}),
        ("photographs that count", np.where(relief.used > 0, relief.used, np.nan), {"cmap": "viridis"}),
    ]
    if heights is not None:
        panels.append(("heights, pixels", heights, {"cmap": "viridis"}))
    across = 3
    side = 4.0
    figure = blank(across * side, math.ceil(len(panels) / across) * (side * rows / columns + 0.5))
    for k, (title, image, style) in enumerate(panels):
        axes = figure.add_subplot(math.ceil(len(panels) / across), across, k + 1)
        if image.ndim == 2:
            low, high = np.nanquantile(image, (0.01, 0.99)) if np.isfinite(image).any() else (0.0, 1.0)
            shown = axes.imshow(image, vmin=low, vmax=max(high, low + 1e-9), **style)
            bar = figure.colorbar(shown, ax=axes, fraction=0.04 * rows / columns, pad=0.02)
            bar.ax.tick_params(colors=INK, labelsize=7)
            bar.outline.set_edgecolor(INK)
        else:
            axes.imshow(image)
        axes.set_title(title, color=INK, fontsize=9)
        axes.set_axis_off()
    return save(figure, path)


def _towards(capture: Capture | Turntable) -> tuple[str, np.ndarray | None]:
    """Where the lights stand, or the cameras: as seen from the middle of what is photographed, (N, 3)."""
    if isinstance(capture, Turntable):
        middle = np.zeros(3) if capture.shape is None else sum(capture.shape.bounds) / 2
        return "cameras", normalise(np.stack([camera.towards(middle) for camera in capture.cameras]))
    if capture.lights is None:
        return "", None
    near = "near lights" if any(map(is_near, capture.lights)) else "lights"
    return near, directions_from(capture.lights, np.nanmean(capture.positions[capture.mask], axis=0))


def _directions(axes: Any, directions: Any, chosen: np.ndarray, title: str) -> None:
    """The sky, with the numbers of those that are `chosen`."""
    draw_sky(axes, directions, f"{len(directions)} {title}, degrees from +z")
    for k in chosen:
        axes.annotate(f"{k}", directions[k, :2], textcoords="offset points", xytext=(3, 2), color=INK, fontsize=6)


def _thumb(image: np.ndarray) -> np.ndarray:
    """An image of at most `_SIDE` pixels each way, each the mean of a block."""
    step = max(1, math.ceil(max(image.shape[:2]) / _SIDE))
    rows, columns = (n // step * step for n in image.shape[:2])
    blocks = image[:rows, :columns].reshape(rows // step, step, columns // step, step, 3)
    thumb: np.ndarray = blocks.mean(axis=(1, 3))
    return thumb
