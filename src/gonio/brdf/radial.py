"""A BRDF of radial functions about scattered centres: what reflectance sharing fits (RS 7, 9, 11-13, 15).

    s(q) = p(M q) + sum_i lambda_i |M (q - q_i)|            q: (x, y, u, v, w), or some of them; p linear, M diagonal
    f = exp(s)   or   max(s, 0)

(u, v, w) are the angles of RS 7 (`directions.uvw`), in which f is isotropic and reciprocal by construction; (x, y) is
the place on the surface, left out where the material is the same everywhere. Folded, v becomes abs(v): isotropic
materials are bilaterally symmetric too, which more than halves the error of a fit. Flat, w is left out, for fits to one
photograph (RS 15). The logarithm keeps f positive and fits highlights by far better.

At theta_d = 0, light behind the eye, phi_d has no meaning: (u, v) may lie anywhere on a circle of radius sin theta_h.
`uvw` takes phi_d = 0 at the point itself, but beside it every phi_d occurs. f is finite there whatever was fitted;
it is nearly one value on the circle where the fit entered such samples at several angles, as `fitting` does at eight.

Evaluation is in single precision, which leaves some 1e-6 of the range of s where fits are sane (solve in double).
Not here: fits (`fitting`), functions other than the distance, importance sampling (directions fall by the cosine).
"""

from __future__ import annotations

import dataclasses
import functools
import math
import sys
from typing import Any, ClassVar

import numpy as np

from .._kernels import radial as kernels
from ..arrays import Array, floats, is_numpy, like, require_broadcast, require_finite, to_numpy
from ..directions import uvw
from ..errors import ArrayError, ParameterError
from .coverage import Coverage
from .model import BRDF, Bounds
from .pairs import through

_PAIRS = 1 << 22  # of points and centres at once, where there is no kernel: some 16 MB for each temporary


@dataclasses.dataclass(frozen=True, eq=False)
class Interpolant:
    """s(q): `centres` (N, d), d = 2 to 6; `scales` (d,) > 0, the diagonal of M; `coefficients` (N, C), C = 1 or 3.

    `polynomial` (d + 1, C) is the constant, then what multiplies M q. s is held within `limits` (2, C), the range of
    the data, so that beyond the centres it stays finite; None holds nothing. All are kept in double precision.
    `rho` >= 0 is the stiffness that they were solved with (RS 10), for who goes on from there.

    Raises `ArrayError` where shapes do not fit or entries are not finite, `ParameterError` for scales that are not
    positive or limits that are crossed.
    """

    centres: Array
    scales: Array
    coefficients: Array
    polynomial: Array
    limits: Array = None
    rho: float = 0.0

    def __post_init__(self) -> None:
        for name in ("centres", "scales", "coefficients", "polynomial", "limits"):
            value = getattr(self, name)
            if name == "limits" and value is None:
                continue
            array = np.array(to_numpy(value), dtype=np.float64)
            require_finite(array, name)
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if self.centres.ndim != 2 or not 2 <= self.centres.shape[1] <= 6 or len(self.centres) == 0:
            raise ArrayError(f"centres has shape {self.centres.shape}; expected (N, d), d = 2 to 6.")
        if self.coefficients.ndim != 2 or self.coefficients.shape[1] not in (1, 3):
            raise ArrayError(f"coefficients has shape {self.coefficients.shape}; expected (N, 1 or 3).")
        n, d = self.centres.shape
        channels = self.coefficients.shape[1]
        wanted = {"scales": (d,), "coefficients": (n, channels), "polynomial": (d + 1, channels)}
        if self.limits is not None:
            wanted["limits"] = (2, channels)
        for name, shape in wanted.items():
            if getattr(self, name).shape != shape:
                raise ArrayError(
                    f"{name} has shape {getattr(self, name).shape}; {n} centres in {d} dimensions want {shape}."
                )
        if self.scales.min() <= 0:
            raise ParameterError(f"Interpolant: a scale is {self.scales.min():.6g}; all are positive.")
        if self.limits is not None and np.any(self.limits[0] > self.limits[1]):
            raise ParameterError("Interpolant: the lower of the limits lies above the upper.")
        if not 0 <= self.rho < math.inf:
            raise ParameterError(f"Interpolant: rho = {self.rho!r} is not a number >= 0.")

    def __call__(self, q: Array) -> Array:
        """s at `q` (..., d) -> (..., C), in the library and dtype of `q`; NumPy's is evaluated in single precision.

        Raises `ArrayError` where q has another number of coordinates.
        """
        xp, q = floats(q)
        d, channels = self.centres.shape[1], self.coefficients.shape[1]
        if q.ndim == 0 or q.shape[-1] != d:
            raise ArrayError(f"q has shape {tuple(q.shape)}; expected (..., {d}).")
        lead = tuple(q.shape[:-1])
        flat = xp.reshape(q, (math.prod(lead), d))
        if is_numpy(q):
            blocks, polynomial, origin, limits = self._packed
            out = np.empty((len(flat), channels), q.dtype)
            kernels.evaluate_packed((flat * self.scales - origin).astype(np.float32), blocks, polynomial, out)
            return np.clip(out, *limits, out=out).astype(q.dtype, copy=False).reshape(*lead, channels)
        step = max(1, _PAIRS // len(self.centres))
        parts = [self._summed(xp, flat[k : k + step]) for k in range(0, flat.shape[0], step)]
        s = xp.concat(parts, axis=0) if parts else xp.zeros_like(flat[:, :channels])
        return xp.reshape(s, (*lead, channels))

    def _summed(self, xp: Any, q: Array) -> Array:
        """s (P, C) at `q` (P, d) in array code."""
        origin = self._packed[2]
        q = q * like(self.scales, q) - like(origin, q)
        centres = like(self.centres * self.scales - origin, q)
        square = xp.zeros_like(q[:, :1])
        for a in range(q.shape[1]):
            square = square + (q[:, a, None] - centres[:, a]) ** 2
        # A touch more than nothing, so that the gradient at a centre is zero and not 0/0.
        r = xp.sqrt(square + 1e-30)
        polynomial = like(self._packed[1], q)
        s = r @ like(self.coefficients, q) + q @ polynomial[1:] + polynomial[0]
        if self.limits is None:
            return s
        low, high = like(self.limits, q)
        return xp.minimum(xp.maximum(s, low), high)

    @functools.cached_property
    def _packed(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The blocks of the kernel, the polynomial and the origin about the centres' mean, and limits."""
        # About the mean, since single precision counts distances in parts of the coordinates.
        scaled = self.centres * self.scales
        origin = scaled.mean(axis=0)
        polynomial = self.polynomial.copy()
        polynomial[0] += origin @ polynomial[1:]
        limits = self.limits
        if limits is None:
            limits = np.repeat([[-np.inf], [np.inf]], polynomial.shape[1], axis=1)
        return kernels.packed(scaled - origin, self.coefficients), polynomial, origin, limits


@dataclasses.dataclass(frozen=True, eq=False)
class Radial(BRDF):
    """f of an `interpolant` whose coordinates are (x, y) where given, u, v, and w unless `flat`, in this order.

    `logarithm`: it is log f, held below 80; otherwise f, cut at zero. `folded`: v is abs(v). `x`, `y`: numbers or
    (...), which may vary over sites and be textures, in the units of the fit; both or none. `coverage`: of the samples
    that it was fitted to, if known.

    Raises `ParameterError` where the interpolant has another number of coordinates, or one of x and y is missing.
    """

    interpolant: Interpolant
    logarithm: bool = True
    folded: bool = True
    flat: bool = False
    x: Array = None
    y: Array = None
    coverage: Coverage | None = None

    bounds: ClassVar[dict[str, Bounds]] = {name: Bounds(-sys.float_info.max, sys.float_info.max) for name in ("x", "y")}

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.x is None) != (self.y is None):
            raise ParameterError("Radial: x and y are given both, or neither.")
        names = (() if self.x is None else ("x", "y")) + (("u", "v") if self.flat else ("u", "v", "w"))
        d = self.interpolant.centres.shape[1]
        if d != len(names):
            raise ParameterError(f"Radial: the interpolant has {d} coordinates; ({', '.join(names)}) are wanted.")
        if self.coverage is not None and self.coverage.points.shape[1] != d:
            raise ParameterError(f"Radial: the coverage has {self.coverage.points.shape[1]} coordinates, not {d}.")
        if self.x is not None:
            require_broadcast(x=self.x, y=self.y)

    def coordinates(self, wi: Array, wo: Array) -> Array:
        """q (..., d) of unit local directions (..., 3), (..., 3), broadcast with x and y."""
        xp, wi, wo = floats(wi, wo)
        angles = uvw(wi, wo)
        u, v, w = angles[..., 0], angles[..., 1], angles[..., 2]
        q = (u, xp.abs(v) if self.folded else v) + (() if self.flat else (w,))
        if self.x is not None:
            q = (like(self.x, u), like(self.y, u), *q)
        return xp.stack(xp.broadcast_arrays(*q), axis=-1)

    def confidence(self, wi: Array, wo: Array) -> Array:
        """By the distance to the nearest sample (`coverage`); 1 where the samples are not known."""
        if self.coverage is None:
            return super().confidence(wi, wo)
        return self.coverage.confidence(self.coordinates(wi, wo))

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        s = self.interpolant(self.coordinates(wi, wo))
        zero = xp.zeros_like(s)
        if self.logarithm:
            return xp.exp(xp.minimum(s, zero + kernels.LARGEST))
        return xp.maximum(s, zero)

    def _compiled(self, wi: Array, wo: Array) -> Array:
        blocks, polynomial, origin, limits = self.interpolant._packed
        flags = (self.x is not None, bool(self.logarithm), bool(self.folded), bool(self.flat))

        def kernel(wi: Any, wo: Any, p: Any, steps: Any, out: Any) -> None:
            kernels.reflect(wi, wo, p, steps, out, blocks, polynomial, self.interpolant.scales, origin, limits, flags)

        # The zeros say how many channels there are; the kernel reads only what stands before them.
        places = self._lanes("x", "y") if self.x is not None else ()
        return through(kernel, wi, wo, (*places, np.zeros(polynomial.shape[1])))
