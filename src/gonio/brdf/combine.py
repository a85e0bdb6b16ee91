"""Sums and multiples of BRDFs: `Lambert(0.4) + 0.2 * Phong(...)`.

    f = sum_k f_k          f = factor f_1

A sum draws its directions from one of its terms, chosen in proportion to what each roughly reflects at wo, and its
density is the mixture's. Its albedo is the sum of albedos.
"""

from __future__ import annotations

import dataclasses
import functools
import operator
import sys
from typing import Any, ClassVar

import numpy as np

from ..arrays import Array, floats, is_numpy, like
from ..errors import ParameterError
from .model import BRDF, Bounds


@dataclasses.dataclass(frozen=True, eq=False)
class Sum(BRDF):
    """The sum of `terms`; a term that is itself a sum is dissolved into its terms."""

    terms: tuple[BRDF, ...]

    def __post_init__(self) -> None:
        terms: tuple[BRDF, ...] = ()
        for term in self.terms:
            if not isinstance(term, BRDF):
                raise ParameterError(f"Sum: {term!r:.60} is not a BRDF.")
            terms += term.terms if isinstance(term, Sum) else (term,)
        if not terms:
            raise ParameterError("Sum: no terms.")
        object.__setattr__(self, "terms", terms)

    def evaluate(self, xp: Any, wi: Array, wo: Array) -> Array:
        first, *others = self.terms
        total = first.evaluate(xp, wi, wo)
        for term in others:
            value = term.evaluate(xp, wi, wo)
            if is_numpy(total) and np.broadcast_shapes(total.shape, value.shape) == total.shape:
                total += value  # in place: fresh memory costs more than the addition
            else:
                total = total + value
        return total

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        return functools.reduce(operator.add, (term._f(xp, wi, wo) for term in self.terms))

    def confidence(self, wi: Array, wo: Array) -> Array:
        """The mean of the terms', each weighted by what it reflects."""
        xp, wi, wo = floats(wi, wo)
        strengths = [xp.mean(term.evaluate(xp, wi, wo), axis=-1) for term in self.terms]
        trusted = [s * term.confidence(wi, wo) for s, term in zip(strengths, self.terms, strict=True)]
        total = functools.reduce(operator.add, strengths)
        return xp.where(total > 0, functools.reduce(operator.add, trusted) / xp.where(total > 0, total, 1.0), 1.0)

    def lobes(self) -> tuple[BRDF, ...]:
        return tuple(lobe for term in self.terms for lobe in term.lobes())

    def _strength(self, xp: Any, wo: Array) -> Array:
        return functools.reduce(operator.add, (term._strength(xp, wo) for term in self.terms))

    def _shares(self, xp: Any, wo: Array) -> tuple[Array, ...]:
        """The probability (...) of each term; they sum to one."""
        strengths = [term._strength(xp, wo) for term in self.terms]
        total = functools.reduce(operator.add, strengths)
        dark = total <= 0  # nothing is reflected: any choice is right
        safe = xp.where(dark, xp.ones_like(total), total)
        return tuple(xp.where(dark, xp.ones_like(total) / len(strengths), s / safe) for s in strengths)

    def sample(self, wo: Array, u: Array) -> Array:
        xp, wo, u = floats(wo, u)
        choice, rest = u[..., 0], u[..., 1:]
        start = xp.zeros_like(choice)
        wi = None
        for term, share in zip(self.terms, self._shares(xp, wo), strict=True):
            # The part of u_0 that fell on this term is stretched to [0, 1) again, for the lobes within it.
            inner = (choice - start) / xp.where(share > 0, share, xp.ones_like(share))
            inner = xp.clip(inner, 0.0, 1.0 - 2.0**-24)
            drawn = term.sample(wo, xp.concat((inner[..., None], rest + xp.zeros_like(inner[..., None])), axis=-1))
            wi = drawn if wi is None else xp.where((choice >= start)[..., None], drawn, wi)
            start = start + share
        return wi

    def pdf(self, wi: Array, wo: Array) -> Array:
        xp, wi, wo = floats(wi, wo)
        shares = self._shares(xp, wo)
        parts = (share * term.pdf(wi, wo) for term, share in zip(self.terms, shares, strict=True))
        return functools.reduce(operator.add, parts)


@dataclasses.dataclass(frozen=True, eq=False)
class Scaled(BRDF):
    """`model` times `factor` >= 0, a number or (..., C)."""

    model: BRDF
    factor: Array

    bounds: ClassVar[dict[str, Bounds]] = {"factor": Bounds(0.0, sys.float_info.max, colour=True)}

    def evaluate(self, xp: Any, wi: Array, wo: Array) -> Array:
        if is_numpy(self.factor) and not np.any(self.factor):  # as beside the sites of a region
            return like(self.factor, wi) * xp.zeros_like((wi + wo)[..., :1])
        return like(self.factor, wi) * self.model.evaluate(xp, wi, wo)

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        return like(self.factor, wi) * self.model._f(xp, wi, wo)

    def confidence(self, wi: Array, wo: Array) -> Array:
        return self.model.confidence(wi, wo)

    def lobes(self) -> tuple[BRDF, ...]:
        return tuple(Scaled(lobe, self.factor) for lobe in self.model.lobes())

    def _strength(self, xp: Any, wo: Array) -> Array:
        return self._mean(xp, self.factor, wo) * self.model._strength(xp, wo)

    def sample(self, wo: Array, u: Array) -> Array:
        return self.model.sample(wo, u)

    def pdf(self, wi: Array, wo: Array) -> Array:
        return self.model.pdf(wi, wo)
