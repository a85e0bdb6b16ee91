"""How facets are turned: distributions D(h) of facet normals, and the area that facets show to a direction.

    integral of (n.h) D(h) d omega_h = 1                                (the facets cover the ground they stand on)
    g(w) = integral of (w.h)_+ D(h) d omega_h                           (the area seen from w, on unit ground; MS 5)

    Beckmann  D = exp(-e) / (pi a_x a_y (n.h)^4),   e = ((h_x/a_x)^2 + (h_y/a_y)^2) / h_z^2
    GGX       D = 1 / (pi a_x a_y ((h_x/a_x)^2 + (h_y/a_y)^2 + h_z^2)^2)          (Trowbridge and Reitz, Walter 2007)

h is drawn in proportion to what is seen from wo, (wo.h)_+ D(h) / g(wo): GGX after Heitz 2018, Beckmann by inverting
the marginal of visible slopes (Heitz and d'Eon 2014). Tabulated distributions stand in `ndf_table.py`.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from abc import ABC, abstractmethod
from typing import Any, ClassVar

from ..arrays import Array, floats, like, special
from ..directions import cross, dot, normalise
from .model import Bounds, Parametric
from .projected_area import AreaTable
from .sampling import cosine_direction


class NDF(Parametric, ABC):
    """A distribution of facet normals in the local frame, n = (0, 0, 1). Subclasses say `D`; the rest follows."""

    @abstractmethod
    def D(self, h: Array) -> Array:
        """The density in 1/sr at unit `h` (..., 3) -> (...); zero below the surface."""

    def projected_area(self, w: Array) -> Array:
        """g(w) = integral of (w.h)_+ D(h), (...), for unit local `w` (..., 3) above the surface.

        The default reads a table that is made from `D` when first needed, good to 4e-4 in the mean.
        """
        return self._areas(w)

    @functools.cached_property
    def _areas(self) -> AreaTable:
        return AreaTable.of(self.D)

    def sample(self, wo: Array, u: Array) -> Array:
        """Facet normals (..., 3) for `wo` (..., 3) from uniform numbers `u` (..., 2); their density is `pdf`.

        The default draws by the cosine, which suits every distribution and flatters none.
        """
        xp, wo, u = floats(wo, u)
        return cosine_direction(u) + xp.zeros_like(wo)

    def pdf(self, h: Array, wo: Array) -> Array:
        """The density of `sample` in 1/sr: (..., 3), (..., 3) -> (...)."""
        xp, h, wo = floats(h, wo)
        cosine = h[..., 2] + xp.zeros_like(wo[..., 2])
        return xp.clip(cosine, 0.0, None) / math.pi


@dataclasses.dataclass(frozen=True, eq=False)
class Slopes(NDF):
    """Distributions whose slopes are stretched by alpha: along s by `alpha`, along t by `alpha_y` (default: alike)."""

    alpha: Array = 0.3
    alpha_y: Array | None = None

    bounds: ClassVar[dict[str, Bounds]] = {"alpha": Bounds(1e-4, 4.0), "alpha_y": Bounds(1e-4, 4.0)}

    def widths(self) -> tuple[Array, Array]:
        """(alpha_x, alpha_y), each (...)."""
        return self.alpha, self.alpha if self.alpha_y is None else self.alpha_y

    def pdf(self, h: Array, wo: Array) -> Array:
        xp, h, wo = floats(h, wo)
        return xp.clip(dot(wo, h), 0.0, None) * self.D(h) / self.projected_area(wo)

    def sample(self, wo: Array, u: Array) -> Array:
        xp, wo, u = floats(wo, u)
        ax, ay = (like(alpha, wo) for alpha in self.widths())
        # Stretched to alpha = 1 the surface is isotropic; normals stretch by the inverse transpose.
        shape = xp.zeros_like(wo[..., 2] * ax * ay * u[..., 0])
        view = normalise(xp.stack((ax * wo[..., 0] + shape, ay * wo[..., 1] + shape, wo[..., 2] + shape), axis=-1))
        h = self._visible(xp, view, u)
        return normalise(xp.stack((ax * h[..., 0], ay * h[..., 1], xp.clip(h[..., 2], 1e-7, None)), axis=-1))

    @abstractmethod
    def _visible(self, xp: Any, wo: Array, u: Array) -> Array:
        """Normals (..., 3), of any length, of the facets with alpha = 1 that `wo` (..., 3) sees."""


class GGX(Slopes):
    """Trowbridge and Reitz's facets of half ellipsoids: `alpha` (...) along s and `alpha_y` along t, in [1e-4, 4].

    alpha is the width of the slopes; roughness in glTF and Disney is its square root.
    """

    def D(self, h: Array) -> Array:
        xp, h = floats(h)
        ax, ay = (like(alpha, h) for alpha in self.widths())
        t = (h[..., 0] / ax) ** 2 + (h[..., 1] / ay) ** 2 + h[..., 2] ** 2
        D = 1 / (math.pi * ax * ay * t * t)
        return xp.where(h[..., 2] > 0, D, xp.zeros_like(D))

    def projected_area(self, w: Array) -> Array:
        xp, w = floats(w)
        ax, ay = (like(alpha, w) for alpha in self.widths())
        x, y, z = ax * w[..., 0], ay * w[..., 1], w[..., 2]
        return 0.5 * (z + xp.sqrt(x * x + y * y + z * z))

    def _visible(self, xp: Any, wo: Array, u: Array) -> Array:
        # A half sphere seen from wo is a disc of which one half is squeezed (Heitz 2018).
        x, y, z = wo[..., 0], wo[..., 1], wo[..., 2]
        flat = xp.hypot(x, y)
        upright = flat < 1e-7
        flat = xp.where(upright, xp.ones_like(flat), flat)
        o = xp.zeros_like(flat)
        first = xp.stack((xp.where(upright, o + 1, -y / flat), xp.where(upright, o, x / flat), o), axis=-1)
        second = cross(wo, first)
        r, phi = xp.sqrt(u[..., 0]), 2 * math.pi * u[..., 1]
        p, q = r * xp.cos(phi), r * xp.sin(phi)
        s = 0.5 * (1 + z)
        q = (1 - s) * xp.sqrt(xp.clip(1 - p * p, 0.0, None)) + s * q
        up = xp.sqrt(xp.clip(1 - p * p - q * q, 0.0, None))
        return p[..., None] * first + q[..., None] * second + up[..., None] * wo


class Beckmann(Slopes):
    """Facets whose slopes are normally distributed: `alpha` (...) along s and `alpha_y` along t, in [1e-4, 4].

    alpha is sqrt(2) times the standard deviation of the slopes.
    """

    def D(self, h: Array) -> Array:
        xp, h = floats(h)
        ax, ay = (like(alpha, h) for alpha in self.widths())
        up = h[..., 2] > 0
        z = xp.where(up, h[..., 2], xp.ones_like(h[..., 2]))
        e = ((h[..., 0] / ax) ** 2 + (h[..., 1] / ay) ** 2) / (z * z)
        # The exponential wins against z^-4 by far: at e = 80 nothing is left to be told from zero.
        lit = up & (e < 80)
        D = xp.exp(-xp.where(lit, e, xp.zeros_like(e))) / (math.pi * ax * ay * xp.where(lit, z, xp.ones_like(z)) ** 4)
        return xp.where(lit, D, xp.zeros_like(D))

    def projected_area(self, w: Array) -> Array:
        xp, w = floats(w)
        ax, ay = (like(alpha, w) for alpha in self.widths())
        x, y, z = ax * w[..., 0], ay * w[..., 1], w[..., 2]
        s = xp.sqrt(xp.clip(x * x + y * y, xp.finfo(w.dtype).tiny ** 0.5, None))
        a = z / s
        return 0.5 * (z * (1 + special(w).erf(a)) + s * xp.exp(-xp.clip(a * a, None, 80.0)) / math.sqrt(math.pi))

    def _visible(self, xp: Any, wo: Array, u: Array) -> Array:
        # Slopes p along the view and q across it. With x = erf(p), c = cot theta_o and k = 1/sqrt(pi) the p that are
        # seen have the distribution (c (1 + x) + k exp(-p^2)) / (c (1 + erf c) + k exp(-c^2)), x in (-1, erf c).
        erf, erfinv = special(wo).erf, special(wo).erfinv
        x, y, z = wo[..., 0], wo[..., 1], wo[..., 2]
        tiny = xp.finfo(wo.dtype).eps
        flat = xp.sqrt(xp.clip(x * x + y * y, tiny**2, None))
        c = xp.clip(z / flat, -4.0, 1 / tiny)
        k = 1 / math.sqrt(math.pi)
        u0 = xp.clip(u[..., 0], tiny, 1 - tiny)
        edge = -1 + 2 * tiny
        top = xp.clip(erf(c), edge + tiny, 1 - tiny)
        goal = u0 * (c * (1 + erf(c)) + k * xp.exp(-c * c))
        low, high = xp.full_like(top, edge), top
        x_ = top - (1 + top) * erf(xp.sqrt(-xp.log(u0)))
        for _ in range(12):  # Newton's steps, kept within a bracket that closes
            x_ = xp.where((x_ > low) & (x_ < high), x_, 0.5 * (low + high))
            p = erfinv(x_)
            miss = c * (1 + x_) + k * xp.exp(-p * p) - goal
            low, high = xp.where(miss < 0, x_, low), xp.where(miss < 0, high, x_)
            x_ = x_ - miss / xp.clip(c - p, tiny, None)
        p = erfinv(xp.clip(x_, low, high))
        q = erfinv(xp.clip(2 * u[..., 1] - 1, edge, -edge))
        cos, sin = x / flat, y / flat
        # A view straight down has no azimuth: any will do.
        cos = xp.where(x * x + y * y > tiny**2, cos, xp.ones_like(cos))
        return xp.stack((-(cos * p - sin * q), -(sin * p + cos * q), xp.ones_like(p)), axis=-1)
