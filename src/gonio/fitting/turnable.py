"""Partial distributions of facets made ready for comparison at all turns about the normal (MS 13).

    D >= 0 with the confidence W >= 0 of each knot, 0 outside the domain Omega;    V = sqrt(W),  M = (W > 0)

On a polar grid a turn shifts the columns, and integrals over products of one and another turned are products of their
Fourier transforms along columns, summed over rows. Those of V D, V D^2, M D, V and M are what distances are made of
(`turned.py`); those of V and M once for each W that differs, which is once for all as a rule.

D is scaled to integral 1 over its domain and W to integral 1, since neither unit tells in distances.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import numpy as np
from scipy import fft

from ..arrays import Array, frozen, require_finite, to_numpy
from ..brdf.polar_grid import PolarGrid
from ..errors import MEMORY_LIMIT, ArrayError, MemoryLimitError, ParameterError


@dataclasses.dataclass(frozen=True, eq=False)
class Turnable:
    """n distributions whose transforms are made once. Made by `of`.

    weights: (rows,) sr a knot. D: (n, rows, columns) of integral 1 over their domains, or 0 throughout.
    V, M: (U, rows, columns), of the U confidences that differ. which: (n,) which of them is whose.
    """

    weights: np.ndarray
    D: np.ndarray
    V: np.ndarray
    M: np.ndarray
    which: np.ndarray

    @classmethod
    def of(cls, tables: Array, confidence: Array, grid: PolarGrid, dtype: Any = np.float64) -> Turnable:
        """`tables` (n, rows, columns) of D >= 0 at the knots of `grid`, in any unit, and W >= 0 of all (rows, columns)
        or of each (n, rows, columns), 0 outside its domain, where D is not looked at (NaN will do).

        dtype: of the transforms, float64 or float32, which takes half of the time.
        Raises `ArrayError` where they do not fit, are not finite or negative, `MemoryLimitError` for too many.
        """
        dtype = np.dtype(dtype)
        if dtype not in (np.float32, np.float64):
            raise ArrayError(f"dtype is {dtype}; float64 or float32 is wanted.")
        D, W = to_numpy(tables), to_numpy(confidence)
        if D.ndim != 3 or D.shape[1:] != grid.shape:
            raise ArrayError(f"tables have shape {D.shape}; (n, {grid.rows}, {grid.columns}) is wanted.")
        if W.shape not in (D.shape, grid.shape):
            raise ArrayError(f"confidence has shape {W.shape}; {grid.shape} or {D.shape} is wanted.")
        require_finite(W, "confidence")
        if W.size and W.min() < 0:
            raise ArrayError(f"confidence has {W.min():g}; W >= 0 is wanted, 0 outside the domain.")
        # D and its three transforms, which have half the columns and are complex; V, M and theirs.
        need = 4 * dtype.itemsize * (D.size + W.size)
        if need > MEMORY_LIMIT:
            raise MemoryLimitError(
                f"{len(D)} distributions need {1e-9 * need:.1f} GB of at most {MEMORY_LIMIT / 1e9:g}: take some at "
                "once, or representatives."
            )
        W, which = _distinct(W.reshape(-1, *grid.shape))
        which = np.broadcast_to(which, len(D))
        inside = W > 0
        D = np.where(inside[which], D, 0).astype(np.float64)
        require_finite(D, "tables within the domain")
        if D.size and D.min() < 0:
            raise ArrayError(f"tables have {D.min():g} within the domain; D >= 0 is wanted: clip what noise left.")
        w = grid.solid_angles[:, None]
        D /= _positive(np.sum(D * w, axis=(1, 2), keepdims=True))
        V = np.sqrt(W / _positive(np.sum(W * w, axis=(1, 2), keepdims=True)))
        return cls(grid.solid_angles, frozen(D, dtype), frozen(V, dtype), frozen(inside, dtype), which)

    def __len__(self) -> int:
        return len(self.D)

    def part(self, some: np.ndarray) -> Turnable:
        """Those numbered `some` (m,)."""
        return dataclasses.replace(self, D=self.D[some], which=self.which[some])

    @property
    def columns(self) -> int:
        """As many turns there are."""
        return int(self.D.shape[2])

    @property
    def dtype(self) -> np.dtype:
        """float64 or float32."""
        return self.D.dtype

    def coarser(self, times: int) -> Turnable:
        """Means over `times` rows by `times` columns; M becomes the part of a block that is within the domain.

        Raises `ParameterError` where `times` does not divide the columns.
        """
        if times < 1 or self.columns % times or self.columns < 3 * times:
            raise ParameterError(
                f"coarse = {times}; what divides {self.columns} columns and leaves 3 or more is wanted: 1 takes all."
            )
        starts = np.arange(0, len(self.weights), times)
        weights = np.add.reduceat(self.weights, starts) * times

        def means(x: np.ndarray) -> np.ndarray:
            sums = x.reshape(*x.shape[:2], -1, times).sum(axis=3, dtype=np.float64) * self.weights[:, None]
            return np.asarray(np.add.reduceat(sums, starts, axis=1) / weights[:, None])

        M = means(self.M)
        D = means(self.D) / _positive(M)[self.which]
        D, V, M = (frozen(x, self.dtype) for x in (D, means(self.V), M))
        return Turnable(weights, D, V, M, self.which)

    @functools.cached_property
    def spectra(self) -> Spectra:
        """Made when first asked for."""
        # The root of w in both factors makes a Turnable serve as either.
        w = np.sqrt(self.weights)[:, None].astype(self.dtype)

        def transformed(x: np.ndarray) -> np.ndarray:
            # Rows last, since they are summed over.
            return np.ascontiguousarray(fft.rfft(x * w, axis=-1).swapaxes(1, 2))

        area = _positive(np.sum(self.M * self.weights[:, None], axis=(1, 2)))
        which = None if len(self.V) == 1 else self.which
        V_D = self.V[self.which]
        V_D *= self.D
        once = transformed(V_D)
        V_D *= self.D
        return Spectra(
            once,
            transformed(V_D),
            transformed(self.M[self.which] * self.D),
            transformed(self.V),
            transformed(self.M),
            area.astype(self.dtype),
            which,
            self.columns,
        )


@dataclasses.dataclass(frozen=True, eq=False)
class Spectra:
    """Transforms (n, orders, rows) of V D, V D^2 and M D, and (U, orders, rows) of V and M, all times the root of w;
    and the area (U,) of M in sr, 1 for 0.

    which: (n,) into those; None where they are one, or one for each. Batches may stand before.
    """

    VD: np.ndarray
    VDD: np.ndarray
    MD: np.ndarray
    V: np.ndarray
    M: np.ndarray
    area: np.ndarray
    which: np.ndarray | None
    columns: int

    def part(self, some: Any) -> Spectra:
        """Those of a slice, or of indices with a batch before."""
        V, M, area, which = self.V, self.M, self.area, self.which
        if which is None:
            if len(V) > 1:
                V, M, area = V[some], M[some], area[some]
            elif not isinstance(some, slice):
                V, M, area = V[None], M[None], area[None]
        else:
            used, which = which[some], None
            if used.ndim == 1:
                different, places = np.unique(used, return_inverse=True)
                if len(different) < len(used):
                    used, which = different, places
                if len(used) == 1:
                    which = None
            V, M, area = V[used], M[used], area[used]
        return Spectra(self.VD[some], self.VDD[some], self.MD[some], V, M, area, which, self.columns)


def require_alike(first: Turnable, second: Turnable) -> None:
    """Raises `ArrayError` where grids or precisions differ."""
    a, b = ((t.dtype.name, t.D.shape[1:], t.weights) for t in (first, second))
    if a[:2] != b[:2] or not np.array_equal(a[2], b[2]):
        raise ArrayError(f"first is {a[0]} on {a[1]}, second {b[0]} on {b[1]}: one grid and precision is wanted.")


def _distinct(W: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The W (U, rows, columns) that differ, and which each is (n,)."""
    seen: dict[bytes, int] = {}
    which = np.array([seen.setdefault(one.tobytes(), len(seen)) for one in W], int)
    _, first = np.unique(which, return_index=True)
    return W[first].astype(np.float64), which


def _positive(x: np.ndarray) -> np.ndarray:
    """x, and 1 for 0, to divide by."""
    return np.where(x > 0, x, 1)
