"""How much a smooth facet reflects at an angle: F(c), c = cosine between light and facet normal.

    Fresnel      F = (g-c)^2 / (2 (g+c)^2) (1 + (c(g+c) - 1)^2 / (c(g-c) + 1)^2),   g^2 = eta^2 + c^2 - 1     (MS 3)
    Conductor    the same for a complex index eta + i k
    Schlick      F = f0 + (1 - f0) (1 - c)^5                                         (Schlick 1994)

All are for unpolarised light coming from air (or whatever eta is relative to). Not here: thin films, polarisation.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from typing import Any, ClassVar

from ..arrays import Array, floats, like
from .model import Bounds, Parametric


class Reflectance(Parametric, ABC):
    """What a facet reflects, as a function of the cosine: called, it answers F (..., C) for cosines (...)."""

    def __call__(self, cosine: Array) -> Array:
        """F in [0, 1], (..., C), for cosines (...) in [0, 1]; cosines outside are taken to the nearest end."""
        xp, cosine = floats(cosine)
        return self._F(xp, xp.clip(cosine, 0.0, 1.0)[..., None])

    @abstractmethod
    def _F(self, xp: Any, c: Array) -> Array:
        """F for cosines (..., 1) in [0, 1] -> (..., C)."""


@dataclasses.dataclass(frozen=True, eq=False)
class Fresnel(Reflectance):
    """Clear dielectrics of relative refractive index `eta` in [1, 10]: a number or (..., C)."""

    eta: Array = 1.5

    bounds: ClassVar[dict[str, Bounds]] = {"eta": Bounds(1.0, 10.0, colour=True)}

    def _F(self, xp: Any, c: Array) -> Array:
        return dielectric(xp, like(self.eta, c), c)


def dielectric(xp: Any, eta: Array, c: Array) -> Array:
    """F of clear dielectrics of index `eta` >= 1 at cosines `c` in [0, 1], broadcast."""
    # c = 0 with eta = 1 is 0 / 0: light that runs along a facet of nothing. Nothing reflects nothing.
    tiny = xp.finfo(c.dtype).tiny ** 0.5
    g = xp.sqrt(xp.clip(eta * eta - 1 + c * c, tiny, None))
    s = (g - c) / (g + c)
    p = (c * (g + c) - 1) / (c * (g - c) + 1)
    return 0.5 * s * s * (1 + p * p)


@dataclasses.dataclass(frozen=True, eq=False)
class Conductor(Reflectance):
    """Metals of complex refractive index `eta` + i `k`, each in [0, 20]: numbers or (..., C)."""

    eta: Array
    k: Array

    bounds: ClassVar[dict[str, Bounds]] = {
        "eta": Bounds(0.0, 20.0, colour=True),
        "k": Bounds(0.0, 20.0, colour=True),
    }

    def _F(self, xp: Any, c: Array) -> Array:
        eta, k = like(self.eta, c), like(self.k, c)
        c2 = c * c
        s2 = 1 - c2
        # (a + i b)^2 = (eta + i k)^2 - sin^2: the wave in the metal.
        t = eta * eta - k * k - s2
        m = xp.sqrt(t * t + 4 * eta * eta * k * k)
        a = xp.sqrt(xp.clip(0.5 * (m + t), 0.0, None))
        tiny = xp.finfo(c.dtype).tiny
        s = (m + c2 - 2 * a * c) / xp.clip(m + c2 + 2 * a * c, tiny, None)
        top = c2 * m + s2 * s2
        p = (top - 2 * a * c * s2) / xp.clip(top + 2 * a * c * s2, tiny, None)
        return 0.5 * s * (1 + p)


@dataclasses.dataclass(frozen=True, eq=False)
class Schlick(Reflectance):
    """Schlick's curve through `f0` in [0, 1] at normal incidence, a number or (..., C), and 1 at grazing."""

    f0: Array = 0.04

    bounds: ClassVar[dict[str, Bounds]] = {"f0": Bounds(0.0, 1.0, colour=True)}

    def _F(self, xp: Any, c: Array) -> Array:
        f0 = like(self.f0, c)
        return f0 + (1 - f0) * (1 - c) ** 5
