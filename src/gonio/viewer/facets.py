"""A material of facets, to look at: its maps, and at chosen pixels what MS's figure 5 shows.

D over (h_x, h_y), orthographic, log colours over three decades; within the dashed line it is told by own data
S over (k_x, k_y), cos theta / g, the part of a facet that is not shadowed
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import to_numpy
from ..brdf.facet_mixture import FacetMixture
from ..rendering.relight import Relightable
from ..rendering.tonemap import clipped, tone_map
from .figures import COLOURS, blank, colour_bar, exposed, save
from .plots import INK

_MOST = 400  # pixels of a map along its longer side
_SIDE = 161  # of a disc
_OWN = 0.99  # of trust, bilinear between knots
_GRAZING = math.radians(75)  # what S is beyond does not set its colours
_GOLDEN = (math.sqrt(5) - 1) / 2


def facets_picture(path: str | Path, thing: Relightable, pixels: Sequence[tuple[int, int]]) -> Path:
    """Write a PNG: k_d, k_s, eta and the nearest representative over the view of `thing`, whose material is a
    FacetMixture, and D and S at `pixels` (row, column) of its mask."""
    uv, material = thing.view.uv, thing.material
    assert uv is not None  # a Relightable's runs over its pixels
    assert isinstance(material, FacetMixture)
    figure = blank(5.8 + 2.1 * len(pixels), 5.0)
    grid = figure.add_gridspec(2, 2 + len(pixels), width_ratios=[1.25, 1.25, *[1.0] * len(pixels)])
    _maps(figure, [figure.add_subplot(grid[k // 2, k % 2]) for k in range(4)], material, thing, pixels)

    sites = material.at(uv[tuple(np.transpose(pixels))])
    line = np.linspace(-1, 1, _SIDE)
    x, y = np.meshgrid(line, line)
    within = x * x + y * y < 1
    h = np.stack((x, y, np.sqrt(np.where(within, 1 - x * x - y * y, 1))), axis=-1)[within][:, None]
    of = {"D": sites.D(h), "S": sites.S(h), "trust": sites.confidence(h, h)}
    discs: dict[str, np.ndarray] = {name: np.full((len(pixels), _SIDE, _SIDE), np.nan) for name in of}
    for name, values in of.items():
        discs[name][:, within] = np.broadcast_to(values, (len(h), len(pixels))).T
    top = math.log10(float(np.nanmax(discs["D"])))
    with np.errstate(divide="ignore"):
        logarithm = np.log10(discs["D"])
    logarithm = np.where(within, np.maximum(logarithm, top - 3), np.nan)
    least = math.floor(10 * float(discs["S"][:, x * x + y * y < math.sin(_GRAZING) ** 2].min())) / 10
    for name, shown, low, high, colours, row in (
        ("log10 D, 1/sr", logarithm, top - 3, top, "viridis", 0),
        ("S", discs["S"], min(least, 0.9), 1.0, "cividis", 1),
    ):
        panels = [figure.add_subplot(grid[row, 2 + k]) for k in range(len(pixels))]
        for k, axes in enumerate(panels):
            extent = (-1, 1, -1, 1)
            drawn = axes.imshow(shown[k], origin="lower", extent=extent, vmin=low, vmax=high, cmap=colours)
            if row == 0:
                axes.set_title(f"pixel {pixels[k][0]}, {pixels[k][1]}", color=COLOURS[k], fontsize=9)
                trust = discs["trust"][k]
                if np.nanmin(trust) < _OWN < np.nanmax(trust):
                    axes.contour(x, y, trust, [_OWN], colors="black", linewidths=1.8)
                    axes.contour(x, y, trust, [_OWN], colors="white", linewidths=1.4, linestyles=[(0, (4, 4))])
            axes.plot(np.cos(2 * np.pi * line), np.sin(2 * np.pi * line), color=COLOURS[k], linewidth=1.2)
            axes.set_xlim(-1.04, 1.04)
            axes.set_ylim(-1.04, 1.04)
            axes.set_axis_off()
        colour_bar(figure, drawn, panels[-1], name)
    return save(figure, path)


def _maps(
    figure: Any, panels: list[Any], material: FacetMixture, thing: Relightable, pixels: Sequence[tuple[int, int]]
) -> None:
    step = math.ceil(max(thing.view.mask.shape) / _MOST)
    mask, uv = thing.view.mask[::step, ::step], thing.view.uv
    assert uv is not None
    sites = material.at(uv[::step, ::step][mask])
    nearest = np.take_along_axis(sites.indices, sites.weights.argmax(axis=-1, keepdims=True), axis=-1)[..., 0]
    nearest = np.broadcast_to(nearest, int(np.count_nonzero(mask)))
    maps = {
        "k_d": _coloured(sites.k_d, mask),
        "k_s": _coloured(sites.k_s, mask),
        "eta": _spread(sites.eta, mask, np.nan),
        f"nearest of {len(material.basis.tables)}": _spread(_category(nearest), mask, 0.0),
    }
    for axes, (name, image) in zip(panels, maps.items(), strict=True):
        rows, columns = (step * n - 0.5 for n in mask.shape)
        shown = axes.imshow(image, cmap="magma", extent=(-0.5, columns, rows, -0.5))
        axes.set_title(name, color=INK, fontsize=9)
        axes.set_axis_off()
        if name == "eta":
            colour_bar(figure, shown, axes, "")
        for (row, column), colour in zip(pixels, COLOURS, strict=False):
            axes.plot(column, row, "o", color=colour, markersize=6, markeredgecolor="white")


def _coloured(colour: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """An image to look at of a colour (..., C) at the sites of `mask`."""
    image = _spread(np.broadcast_to(to_numpy(colour), (int(np.count_nonzero(mask)), 3)), mask, 0.0)
    return np.concatenate((tone_map(exposed(image), clipped), mask[..., None]), axis=-1)


def _spread(values: np.ndarray, mask: np.ndarray, elsewhere: float) -> np.ndarray:
    """`values` (N, ...), or the same for all, at the sites of `mask`."""
    values = to_numpy(values)
    image = np.full((*mask.shape, *values.shape[1:]), elsewhere)
    image[mask] = values
    return image


def _category(number: np.ndarray) -> np.ndarray:
    """Opaque colours (N, 4) that tell numbers (N,) apart: hues a golden section apart, in three shades."""
    hue = (number * _GOLDEN % 1.0)[:, None]
    shade = np.array([0.95, 0.7, 0.45])[number % 3][:, None]
    colour = shade * (0.25 + 0.75 * np.clip(abs(6 * ((hue - [0, 1 / 3, 2 / 3]) % 1.0) - 3) - 1, 0, 1))
    return np.concatenate((colour, np.ones_like(hue)), axis=-1)
