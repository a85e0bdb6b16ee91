"""The light blurred by a lobe, summed over the pixels within it: for lobes so sharp that few are (RH 5.33).

    B(R) = sum over pixels p within the lobe of w_p k(R.p) L_p / sum of w_p k(R.p)         w_p its solid angle

The work is (texels) x (pixels in a lobe) where that of harmonics grows with the map and the degree, whatever the number
of texels: sharp lobes and small faces are sooner summed. The lobe ends where what is left of its integral has fallen to
the error. Pixels are as good as the harmonics of a map of as many rows: what aliases is what the series would leave
out.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from .._kernels import lobe_sums as kernels
from .lobes import Lobe

_ANGLES = 20_000  # at which a lobe is looked at
_LEAST, _MOST = 1 << 12, 1 << 17  # entries of its table, which is linear in the cosine


@lru_cache(maxsize=64)
def reach(lobe: Lobe, alpha: float, error: float) -> tuple[float, float]:
    """The angle to which a lobe counts, radians, and the part of its integral that lies beyond."""
    theta = np.linspace(0, 1, _ANGLES) ** 3 * (math.pi / 2)  # dense where sharp lobes are
    k = lobe(alpha, theta)
    whole = np.cumsum(k * np.sin(theta) * np.gradient(theta))
    beyond = np.clip(1 - whole / whole[-1], 0, None)
    end = int(np.argmax(beyond <= error))
    return float(theta[end]), float(beyond[end])


def within(rows: int, angle: float) -> float:
    """How many pixels of a map of so many rows lie within `angle` of a direction, on average."""
    return rows * rows * (1 - math.cos(angle))


def blurred(image: np.ndarray, lobe: Lobe, alpha: float, angle: float, R: np.ndarray) -> np.ndarray:
    """B (N, C) of a lat-long image (rows, columns, C) at unit R (N, 3) in its axes; the lobe ends at `angle`."""
    rows, columns, channels = image.shape
    theta = (np.arange(rows) + 0.5) * (math.pi / rows)
    phi = (np.arange(columns) + 0.5) * (2 * math.pi / columns)
    least = math.cos(angle)
    # 64 steps from the peak to the angle alpha. By the sine of half the angle: a cosine would lose what is sharp.
    steps = int(np.clip(64 * (angle / alpha) ** 2, _LEAST, _MOST))
    table = lobe(alpha, 2 * np.arcsin(math.sin(angle / 2) * np.sqrt(np.arange(steps + 2) / steps)))
    polar, around = (np.stack((np.cos(x), np.sin(x))) for x in (theta, phi))
    out = np.empty((len(R), channels), image.dtype)
    kernels.add(np.ascontiguousarray(image), polar, around, np.ascontiguousarray(R, np.float64), least, table, out)
    return out
