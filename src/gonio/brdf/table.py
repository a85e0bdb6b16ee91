"""An isotropic BRDF tabulated over half/difference angles, the coordinates of the MERL measurements.

    theta_h = pi/2 ((j + 1/2)/H)^2,   theta_d = pi/2 (k + 1/2)/D,   phi_d = pi (m + 1/2)/P       the cells' centres

Rusinkiewicz 1998 and Matusik et al. 2003: rows crowd towards theta_h = 0, where highlights stand; phi_d in [0, pi),
since exchanging wi and wo adds pi, so every table is reciprocal. Look-ups are trilinear between the centres, or take
the cell that holds the angles, as MERL's own reader does. Cells that were never measured, and those that lie below
the surface, are filled from the nearest measured cell along theta_h (where there is none, along theta_d), so that
look-ups beside them stay sane. Not here: files (`files/merl.py`), importance sampling (directions fall by the cosine).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..arrays import Array, is_numpy, like, require_finite, to_numpy
from ..directions import from_half_difference, half_difference
from ..errors import ArrayError, ParameterError
from .model import BRDF

MERL_SHAPE = (90, 90, 180)


@dataclasses.dataclass(frozen=True, eq=False)
class HalfDifferenceTable(BRDF):
    """`values` (H, D, P, C) in 1/sr at the centres of the cells of (theta_h, theta_d, phi_d), C = 1 or 3.

    `valid` (H, D, P) tells the cells whose values were measured; the others are filled, whatever they hold. Without
    it all are. Held in single precision. `nearest` takes the cell itself where the default interpolates.

    Raises `ArrayError` where a valid cell is negative, infinite or NaN, no cell is valid, or shapes do not fit.
    """

    values: Array
    valid: Array = None
    nearest: bool = False

    def __post_init__(self) -> None:
        values = np.array(to_numpy(self.values), dtype=np.float32)
        if values.ndim != 4 or values.shape[-1] not in (1, 3) or 0 in values.shape:
            raise ArrayError(f"values has shape {values.shape}; a table is (theta_h, theta_d, phi_d, 1 or 3).")
        valid = np.ones(values.shape[:3], bool) if self.valid is None else np.array(to_numpy(self.valid), dtype=bool)
        if valid.shape != values.shape[:3]:
            raise ArrayError(f"valid has shape {valid.shape}; values has {values.shape[:3]} cells.")
        if not valid.any():
            raise ArrayError("no cell of the table is valid, so there is nothing to look up.")
        values[~valid] = 0
        require_finite(values, "values")
        if values.min() < 0:
            at = tuple(int(k) for k in np.argwhere(values < 0)[0])
            raise ArrayError(f"values{list(at)} is {values[at]:.6g}. Mark unmeasured cells in `valid`.")
        _fill(values, valid)
        for name, array in (("values", values), ("valid", valid)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @classmethod
    def of(cls, model: BRDF, shape: tuple[int, int, int] = MERL_SHAPE) -> HalfDifferenceTable:
        """The table of an isotropic `model` with `shape` cells in (theta_h, theta_d, phi_d), sampled at their centres.

        Raises `ParameterError` where the model is anisotropic, or its parameters vary from site to site.
        """
        blocks, masks = [], []
        for angles in _rows(shape):
            theta_h, theta_d, phi_d = angles
            above = _above(theta_h, theta_d, phi_d)
            # Directions below the surface say nothing; the normal's own value stands in until the cell is filled.
            sane = [np.where(above, a, 0.0) for a in angles]
            f = to_numpy(model.f(*from_half_difference(sane[0], 0.0, sane[1], sane[2])))
            if f.shape[:-1] != above.shape:
                raise ParameterError(f"f has shape {f.shape}; a table holds one BRDF, not one for each site.")
            turned = to_numpy(model.f(*from_half_difference(sane[0], 1.0, sane[1], sane[2])))
            if not np.allclose(f, turned, rtol=1e-3, atol=1e-6 * float(f.max())):
                raise ParameterError("f changes with phi_h: a half/difference table holds isotropic BRDFs only.")
            blocks.append(f.astype(np.float32))
            masks.append(above)
        return cls(np.stack(blocks), np.stack(masks))

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        if is_numpy(wi, wo):
            from .._kernels.half_difference import lookup

            wi, wo = np.broadcast_arrays(wi, wo)
            out = np.empty((*wi.shape[:-1], self.values.shape[-1]), wi.dtype)
            lookup(
                self.values, wi.reshape(-1, 3), wo.reshape(-1, 3), self.nearest, out.reshape(-1, self.values.shape[-1])
            )
            return out
        return self._gathered(xp, wi, wo)

    def _gathered(self, xp: Any, wi: Array, wo: Array) -> Array:
        """`_f` in array code, for the libraries that have no kernel."""
        theta_h, _, theta_d, phi_d = half_difference(wi, wo)
        H, D, P, C = self.values.shape
        x = (xp.sqrt(theta_h * (2 / math.pi)) * H, theta_d * (2 * D / math.pi), phi_d * (P / math.pi))
        table = xp.reshape(like(self.values, theta_h), (H * D * P, C))

        def cell(h: Array, d: Array, p: Array) -> Array:
            h = xp.clip(h, 0, H - 1)
            d = xp.clip(d, 0, D - 1)
            flat = xp.astype((h * D + d) * P + p - P * xp.floor(p / P), xp.int64)
            return table[flat]

        if self.nearest:
            return cell(*(xp.floor(a) for a in x))
        value = xp.zeros_like(theta_h)[..., None]
        low = [xp.floor(a - 0.5) for a in x]
        weight = [a - 0.5 - b for a, b in zip(x, low, strict=True)]
        for corner in range(8):
            bits = [(corner >> k) & 1 for k in range(3)]
            wh, wd, wp = (part if bit else 1 - part for bit, part in zip(bits, weight, strict=True))
            value = value + (wh * wd * wp)[..., None] * cell(*(b + bit for b, bit in zip(low, bits, strict=True)))
        return value


def above_surface(shape: tuple[int, int, int]) -> np.ndarray:
    """The cells (H, D, P) of a table whose centres have both directions above the surface."""
    return np.stack([_above(*angles) for angles in _rows(shape)])


def _rows(shape: tuple[int, int, int]) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """(theta_h, theta_d, phi_d) of the centres, one row of theta_h at a time: each (D, P)."""
    H, D, P = shape
    theta_d, phi_d = np.meshgrid(
        (np.arange(D) + 0.5) * (math.pi / 2 / D), (np.arange(P) + 0.5) * (math.pi / P), indexing="ij"
    )
    for j in range(H):
        yield np.full((D, P), math.pi / 2 * ((j + 0.5) / H) ** 2), theta_d, phi_d


def _above(theta_h: np.ndarray, theta_d: np.ndarray, phi_d: np.ndarray) -> np.ndarray:
    # The heights of wi and wo are cos theta_h cos theta_d -+ sin theta_h sin theta_d cos phi_d.
    lean = np.abs(np.sin(theta_h) * np.sin(theta_d) * np.cos(phi_d))
    above: np.ndarray = np.cos(theta_h) * np.cos(theta_d) > lean
    return above


def _fill(values: np.ndarray, valid: np.ndarray) -> None:
    """Gives each invalid cell the value of the nearest valid one along theta_h, then along theta_d, in place."""
    known = valid
    for axis in (0, 1, 2):
        n = known.shape[axis]
        at = np.arange(n).reshape([-1 if k == axis else 1 for k in range(3)])
        below = np.maximum.accumulate(np.where(known, at, -n), axis=axis)
        above = np.flip(np.minimum.accumulate(np.flip(np.where(known, at, 2 * n), axis), axis=axis), axis)
        source = np.where(at - below <= above - at, below, above)
        found = (source >= 0) & (source < n)
        values[...] = np.take_along_axis(values, np.where(found, source, at)[..., None], axis=axis)
        known = found
