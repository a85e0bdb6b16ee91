"""How much of the facets light and eye both see: G(wi, wo), in [0, 1].

    S(k) = (k.n) / g(k),   g(k) = integral of (h.k)_+ D(h)                  (MS 5: for any distribution)

    Ashikhmin          G = S(wi) S(wo)                                      (MS 4)
    Smith              G = 1 / (1 + L(wi) + L(wo)),   L = 1 / S - 1         (height-correlated: Heitz 2014)
    VGroove            G = min(1, 2 (n.h)(n.wi) / (wi.h), 2 (n.h)(n.wo) / (wo.h))   (Torrance and Sparrow 1967)

Smith's masking is the one that lets every facet count once, so S is his for every distribution, not only where
closed forms are known; without correlation of heights his G is Ashikhmin's.

Models divide by the cosines, and both vanish at grazing angles, so the quantity computed is
`visibility` V = G / (4 cos theta_i cos theta_o), in which they cancel.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from typing import Any

from ..arrays import Array, floats
from ..directions import dot
from .ndf import NDF


class Shadowing(ABC):
    """A rule that gives G for any distribution of facets."""

    def G(self, ndf: NDF, wi: Array, wo: Array) -> Array:
        """The share (...) of facets facing wi + wo that both unit local directions (..., 3) see; zero below."""
        xp, wi, wo = floats(wi, wo)
        ci, co = wi[..., 2], wo[..., 2]
        above = (ci > 0) & (co > 0)
        ones = xp.ones_like(wi[..., 2:])
        up = xp.concat((xp.zeros_like(wi[..., :2]), ones), axis=-1)
        wi = xp.where(above[..., None], wi, up)
        wo = xp.where(above[..., None], wo, up)
        G = 4 * wi[..., 2] * wo[..., 2] * self.visibility(xp, ndf, wi, wo)
        return xp.where(above, G, xp.zeros_like(G))

    @abstractmethod
    def visibility(self, xp: Any, ndf: NDF, wi: Array, wo: Array) -> Array:
        """G / (4 cos theta_i cos theta_o), (...), for directions above the surface."""


@dataclasses.dataclass(frozen=True)
class Smith(Shadowing):
    """Smith's shadowing; `correlated`: light and eye reach high facets together (Heitz 2014), else independently."""

    correlated: bool = True

    def visibility(self, xp: Any, ndf: NDF, wi: Array, wo: Array) -> Array:
        gi, go = ndf.projected_area(wi), ndf.projected_area(wo)
        if not self.correlated:
            return 0.25 / (gi * go)
        ci, co = wi[..., 2], wo[..., 2]
        return 0.25 / (gi * co + go * ci - ci * co)


@dataclasses.dataclass(frozen=True)
class Ashikhmin(Shadowing):
    """The product of two directional terms, each from the distribution itself (Ashikhmin et al. 2000, MS 4-5)."""

    def visibility(self, xp: Any, ndf: NDF, wi: Array, wo: Array) -> Array:
        return 0.25 / (ndf.projected_area(wi) * ndf.projected_area(wo))


@dataclasses.dataclass(frozen=True)
class VGroove(Shadowing):
    """Facets are the sides of long V-shaped grooves: the G of Torrance and Sparrow, and of Cook and Torrance."""

    def visibility(self, xp: Any, ndf: NDF, wi: Array, wo: Array) -> Array:
        ci, co = wi[..., 2], wo[..., 2]
        # With h = wi + wo of length l: n.h = (ci + co) / l and wi.h = wo.h = l / 2.
        h = wi + wo
        groove = 4 * (ci + co) / dot(h, h)
        one = xp.ones_like(groove)
        shallow, steep = xp.minimum(ci, co), xp.maximum(ci, co)
        return 0.25 * xp.minimum(one / shallow, groove * one) / steep
