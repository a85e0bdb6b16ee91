"""Directions drawn where a lat-long map is bright.

    p(texel) = 0.99 luminance x solid angle / their sum + 0.01 solid angle / (4 pi);   uniform within the texel

The luminance is the mean of the bilinear radiance over the texel (weights 1/8, 3/4, 1/8 along each axis), so that
p > 0 wherever the radiance is, and the one in a hundred spread evenly bounds the weights of dark places.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np


@dataclasses.dataclass(frozen=True, eq=False)
class Importance:
    """`cumulative` (rows * columns + 1,): the distribution over texels, row by row; `turn` (3, 3): own to world."""

    rows: int
    columns: int
    cumulative: np.ndarray
    turn: np.ndarray

    @classmethod
    def of(cls, image: np.ndarray, turn: np.ndarray) -> Importance:
        """From a lat-long picture (rows, columns, C) of radiance."""
        rows, columns, channels = image.shape
        light = image.astype(np.float64) @ (np.array([0.2126, 0.7152, 0.0722]) if channels == 3 else np.ones(1))
        light = 0.75 * light + 0.125 * (np.roll(light, 1, 1) + np.roll(light, -1, 1))
        half = columns // 2
        above = np.concatenate((np.roll(light[:1], half, 1), light[:-1]))
        below = np.concatenate((light[1:], np.roll(light[-1:], half, 1)))
        light = 0.75 * light + 0.125 * (above + below)
        edge = np.cos(np.linspace(0, math.pi, rows + 1))
        solid = np.repeat(((edge[:-1] - edge[1:]) * (2 * math.pi / columns))[:, None], columns, axis=1)
        weight = light * solid
        total = weight.sum()
        even = solid / (4 * math.pi)
        p = 0.99 * weight / total + 0.01 * even if total > 0 else even
        cumulative = np.concatenate(([0.0], np.cumsum(p)))
        return cls(rows, columns, cumulative / cumulative[-1], turn)

    def sample(self, u: np.ndarray) -> np.ndarray:
        """World directions (..., 3) from u (..., 2) in [0, 1): u[..., 0] chooses the row, u[..., 1] the column."""
        rows, columns = self.rows, self.columns
        u = np.asarray(u, np.float64)
        starts = self.cumulative[::columns]
        row = np.clip(np.searchsorted(starts, u[..., 0], side="right") - 1, 0, rows - 1)
        v = (u[..., 0] - starts[row]) / (starts[row + 1] - starts[row])
        target = starts[row] + u[..., 1] * (starts[row + 1] - starts[row])
        texel = np.searchsorted(self.cumulative, target, side="right") - 1
        texel = np.clip(texel, row * columns, (row + 1) * columns - 1)
        low, high = self.cumulative[texel], self.cumulative[texel + 1]
        phi = (texel - row * columns + np.clip((target - low) / (high - low), 0, 1)) * (2 * math.pi / columns)
        top, bottom = np.cos(row * (math.pi / rows)), np.cos((row + 1) * (math.pi / rows))
        z = top + np.clip(v, 0, 1) * (bottom - top)
        s = np.sqrt(np.maximum(1 - z * z, 0.0))
        own = np.stack((s * np.cos(phi), s * np.sin(phi), z), axis=-1)
        w: np.ndarray = own @ self.turn.T
        return w

    def pdf(self, w: np.ndarray) -> np.ndarray:
        """Density of `sample` in 1/sr: (..., 3) -> (...)."""
        own = np.asarray(w, np.float64) @ self.turn
        rows, columns = self.rows, self.columns
        theta = np.arctan2(np.hypot(own[..., 0], own[..., 1]), own[..., 2])
        row = np.clip((theta * (rows / math.pi)).astype(np.int64), 0, rows - 1)
        phi = np.mod(np.arctan2(own[..., 1], own[..., 0]), 2 * math.pi)
        column = np.clip((phi * (columns / (2 * math.pi))).astype(np.int64), 0, columns - 1)
        texel = row * columns + column
        p = self.cumulative[texel + 1] - self.cumulative[texel]
        band = np.cos(row * (math.pi / rows)) - np.cos((row + 1) * (math.pi / rows))
        density: np.ndarray = p / (band * (2 * math.pi / columns))
        return density
