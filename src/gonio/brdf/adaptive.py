"""Measured reflectance in the adaptive parameterisation of Dupuy and Jakob 2018: the materials of EPFL's RGL.

    f(wi, wo) cos theta_i = rgb(x; wo) D(m) / (4 sigma(wo)),      x = W^-1(m; wo),   m = half vector

W(.; wo) takes uniform points of the unit square to facet normals m with the density of the visible ones, so that the
table rgb(.; wo) is nearly flat, and spends its cells where the reflectance is. A direction's place in the square is
(sqrt(2 theta/pi), (phi + pi)/(2 pi)). Tables depend on the direction in which RGL's `theta_i` and `phi_i` were
tabulated; as in Mitsuba that is the eye's, here wo. Measurements are not exactly reciprocal, and f is not made so.
Not here: files (`files/rgl.py`), and PyTorch or CuPy: look-ups run in compiled loops on NumPy arrays.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array, frozen, is_numpy, require_finite
from ..errors import ArrayError
from .model import BRDF

if TYPE_CHECKING:
    from .._kernels.adaptive import Tables, Warp


@dataclasses.dataclass(frozen=True, eq=False)
class AdaptiveTable(BRDF):
    """Tables over the eye's azimuths `phi` (P,) and elevations `theta` (T,), in radians, both rising.

    `ndf`, `sigma` (rows, columns): density of facets and area they show; columns go with theta, rows with phi.
    `vndf` (P, T, rows, columns): density of visible facets, up to scale; `luminance` (P, T, n, m): that of samples.
    `rgb` (P, T, C, n, m): the reflectance that is left, C = 1 or 3. Slightly negative values, from colours outside
    sRGB, are allowed; f is clipped at zero. Two azimuths or fewer mean an isotropic material, whose rows count from the
    eye's azimuth. Otherwise phi covers a whole turn, or a half or quarter one that begins at -pi and is mirrored.
    `jacobian` False: rgb holds f cos theta_i itself. `description`: words on the material.

    Raises `ArrayError` naming the field whose shape or values do not fit.
    """

    phi: Array
    theta: Array
    ndf: Array
    sigma: Array
    vndf: Array
    luminance: Array
    rgb: Array
    jacobian: bool = True
    description: str = ""

    def __post_init__(self) -> None:
        for field in ("phi", "theta", "ndf", "sigma", "vndf", "luminance", "rgb"):
            value = np.asarray(getattr(self, field))
            if value.dtype.kind != "f":
                raise ArrayError(f"{field} has dtype {value.dtype}; it holds floating numbers.")
            require_finite(value, field)
            object.__setattr__(self, field, frozen(value, np.float32))
        slices = (*self.phi.shape, *self.theta.shape)
        self._require_shape("phi", 1, ())
        self._require_shape("theta", 1, ())
        self._require_shape("ndf", 2, ())
        self._require_shape("sigma", 2, ())
        self._require_shape("vndf", 4, slices)
        self._require_shape("luminance", 4, slices)
        self._require_shape("rgb", 5, slices)
        if self.rgb.shape[2] not in (1, 3) or self.rgb.shape[3:] != self.luminance.shape[2:]:
            raise ArrayError(
                f"rgb has shape {self.rgb.shape}, luminance {self.luminance.shape}; expected (P, T, 1 or 3, n, m) "
                "and (P, T, n, m)."
            )
        for field, low, high in (("phi", -2 * math.pi, 2 * math.pi), ("theta", 0.0, math.pi / 2)):
            value = getattr(self, field)
            if np.any(np.diff(value) <= 0) or value[0] < low - 1e-3 or value[-1] > high + 1e-3:
                raise ArrayError(f"{field} must rise within [{low:.4g}, {high:.4g}], got {value}.")
        if not self.isotropic and self._folds not in (1, 2, 4):
            raise ArrayError(f"phi spans {np.ptp(self.phi):.4g}; a whole, half or quarter turn is known.")
        for field in ("ndf", "vndf", "luminance"):
            if getattr(self, field).min() < 0:
                raise ArrayError(f"{field} has a negative value, {getattr(self, field).min():g}.")
        if not self.sigma.min() > 0:
            raise ArrayError(f"sigma has a value that is not positive, {self.sigma.min():g}.")
        for field in ("vndf", "luminance"):
            empty = np.argwhere(getattr(self, field).sum(axis=(2, 3)) <= 0)
            if len(empty):
                raise ArrayError(f"{field}{[int(k) for k in empty[0]]} is zero throughout: no density at all.")

    def _require_shape(self, field: str, ndim: int, lead: tuple[int, ...]) -> None:
        shape = getattr(self, field).shape
        least = 1 if ndim == 1 else 2
        if len(shape) != ndim or shape[: len(lead)] != lead or min(shape[-2:]) < least:
            wanted = ", ".join([*map(str, lead), *(f"{least} or more",) * (ndim - len(lead))])
            raise ArrayError(f"{field} has shape {shape}; expected ({wanted}).")

    @property
    def isotropic(self) -> bool:
        """Whether f depends on the difference of azimuths only."""
        return len(self.phi) <= 2

    @property
    def _folds(self) -> int:
        return round(2 * math.pi / float(np.ptp(self.phi)))

    @functools.cached_property
    def _tables(self) -> Tables:
        from .._kernels.adaptive import Tables

        slices = len(self.phi) * len(self.theta)
        rgb = np.moveaxis(self.rgb.reshape(slices, *self.rgb.shape[2:]), 1, -1)
        return Tables(
            self.phi.astype(np.float64),
            self.theta.astype(np.float64),
            self.ndf,
            self.sigma,
            _warp_of(self.vndf.reshape(slices, *self.vndf.shape[2:])),
            _warp_of(self.luminance.reshape(slices, *self.luminance.shape[2:])),
            np.ascontiguousarray(rgb).ravel(),
            self.isotropic,
            1 if self.isotropic else self._folds,
            bool(self.jacobian),
        )

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        from .._kernels.adaptive import reflect

        wi, wo = _paired(wi, wo)
        f = np.empty((*wi.shape[:-1], self.rgb.shape[2]), wi.dtype)
        reflect(self._tables, wi.reshape(-1, 3), wo.reshape(-1, 3), f.reshape(-1, f.shape[-1]), np.empty(0, wi.dtype))
        return f

    def sample(self, wo: Array, u: Array) -> Array:
        """Directions `wi` (..., 3) drawn for `wo` (..., 3) by `u` (..., 3), nearly in proportion to f cos theta_i."""
        from .._kernels.adaptive import draw

        wo, u = _paired(wo, u)
        wi = np.empty(wo.shape, wo.dtype)
        draw(self._tables, wo.reshape(-1, 3), u.reshape(-1, 3)[:, 1:], wi.reshape(-1, 3))
        return wi

    def pdf(self, wi: Array, wo: Array) -> Array:
        """The density of `sample` in 1/sr: (..., 3), (..., 3) -> (...); zero where either lies below the surface."""
        from .._kernels.adaptive import reflect

        wi, wo = _paired(wi, wo)
        pdf = np.empty(wi.shape[:-1], wi.dtype)
        reflect(self._tables, wi.reshape(-1, 3), wo.reshape(-1, 3), np.empty((0, 1), wi.dtype), pdf.reshape(-1))
        return pdf


def _paired(a: Array, b: Array) -> tuple[np.ndarray, np.ndarray]:
    if not is_numpy(a, b):
        raise ArrayError("measured tables are looked up in NumPy arrays only. Bring the directions to NumPy first.")
    a, b = np.broadcast_arrays(np.asarray(a), np.asarray(b))
    kind = np.float32 if a.dtype == b.dtype == np.float32 else np.float64
    return np.ascontiguousarray(a, kind), np.ascontiguousarray(b, kind)


def _warp_of(values: np.ndarray) -> Warp:
    """The warp whose density is bilinear in each slice of `values` (S, rows, columns), with integral 1."""
    from .._kernels.adaptive import Warp

    conditional, rows = _running(values.astype(np.float64))
    marginal, total = _running(rows)
    cells = np.stack((values, conditional), axis=-1) / total[:, None, None, None]
    # Single precision keeps the tables in the cache; a running sum of 1 is then good to 6e-8.
    flat = (a.astype(np.float32).ravel() for a in (cells, rows / total[:, None], marginal / total[:, None]))
    return Warp(*values.shape[1:], *flat)


def _running(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The integral of the line through `values` over the last axis (unit length), up to each knot, and the whole."""
    sums = np.cumsum(0.5 * (values[..., 1:] + values[..., :-1]) / (values.shape[-1] - 1), axis=-1)
    sums = np.concatenate((np.zeros_like(values[..., :1]), sums), axis=-1)
    return sums, sums[..., -1]
