"""Distributions of facets from what one view shows of them: the part of MS 5.1.

    rho(h) = D(h) F(h.o) / (4 g(i) g(o)),    i = 2 (h.o) h - o,    h in Omega = {h: i.n > 0}       MS 2-5, 10, 11
    D <- 4 rho g(i) g(o) / F,    g <- areas of D completed,    k_s <- integral of (n.h) D completed,    D <- D / k_s

g is the area that facets show (`brdf/facet_areas.py`; S = cos / g), and wants D where no light tells it. How that is
completed is a value:

    Symmetric()     D(h) = D(h turned by pi), as surfaces without a preferred sense have it: the nearest to the truth
    Ringed()        the greatest g of each ring of theta, D = 0 outside: the paper's, S constrained to its least
    Bare()          D = 0 outside: Ngan et al. 2005, which the paper departs from

MS 11 prints 4 pi for 4 and leaves F out, which costs far more than it seems; and D grows or collapses by a factor at
every turn unless it is normalised. F is of a clear dielectric, over its value at normal incidence, which k_s holds.

Not here: diffuse light, which has been taken off; what lies outside Omega (`turned`), and eta.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.sparse import csr_array

from ..arrays import Array, require_finite, to_numpy
from ..brdf.facet_areas import FacetAreas
from ..brdf.fresnel import dielectric
from ..errors import ArrayError, ParameterError
from .facet_domain import Domain

_SITES = 256  # at once
_RINGS = 33  # linear between them, g is 3e-4 off


@dataclasses.dataclass(frozen=True)
class Completion:
    """How D is taken to go on where no light tells it, for the area that facets show."""

    def sources(self, known: np.ndarray) -> np.ndarray:
        """The knot, counted along rows, from which each has its value, (rows, columns); -1 where that is 0."""
        return np.where(known, np.arange(known.size).reshape(known.shape), -1)

    def areas(self, facets: FacetAreas, coefficients: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """g (T, K) at `directions` (K, 3)."""
        return np.asarray(facets.areas(coefficients, directions))


class Symmetric(Completion):
    """By a turn of pi, where that is known; by 0 elsewhere."""

    def sources(self, known: np.ndarray) -> np.ndarray:
        own = super().sources(known)
        return np.where(known, own, np.roll(own, known.shape[1] // 2, axis=1))


class Ringed(Completion):
    """By 0, and g by its greatest around the normal: on rings, and linear in theta between them."""

    def areas(self, facets: FacetAreas, coefficients: np.ndarray, directions: np.ndarray) -> np.ndarray:
        theta = np.linspace(0, np.pi / 2, _RINGS)
        place = np.arccos(np.clip(directions[:, 2], 0, 1)) / theta[1]
        low = np.minimum(place.astype(int), _RINGS - 2)
        part = (place - low).astype(coefficients.dtype)
        g = np.asarray(facets.turned_least(coefficients, np.cos(theta)))
        return np.asarray((1 - part) * g[:, low] + part * g[:, low + 1])


class Bare(Completion):
    """By 0."""


@dataclasses.dataclass(frozen=True, eq=False)
class PartialNDFs:
    """D `tables` (T, rows, columns), 0 outside the domain; `k_s` (T,), what they are multiplied by; `still` (T,), by
    what part D still changed in the last turn, rms."""

    tables: np.ndarray
    k_s: np.ndarray
    still: np.ndarray


def fit_partial_ndfs(
    slices: Array,
    domain: Domain,
    eta: float | Array = 1.5,
    completion: Completion | None = None,
    turns: int = 6,
    degree: int = 8,
) -> PartialNDFs:
    """D and k_s of T texels from `slices` (T, rows, columns) of what their facets reflect, rho in 1/sr at the grid's
    half vectors; outside the domain, and where it is not known, they are not looked at (NaN will do).

    eta: the refractive index, one or (T,), >= 1. completion: `Symmetric()` where None. turns: >= 1. degree: of the
    harmonics of g.

    Raises `ArrayError` where slices do not fit or are not finite within the domain, `ParameterError` for other eta and
    turns. Negative values, which diffuse light taken off leaves, count as 0; texels without any have k_s = 0.
    """
    grid = domain.grid
    rho = to_numpy(slices)
    if rho.ndim != 3 or rho.shape[1:] != grid.shape:
        raise ArrayError(f"slices have shape {rho.shape}; (texels, {grid.rows}, {grid.columns}) is wanted.")
    index = np.broadcast_to(to_numpy(eta).astype(np.float64), (len(rho),))
    if not (np.isfinite(index).all() and index.min() >= 1):
        raise ParameterError(f"eta has {index.min():g} and {index.max():g} as its ends; numbers >= 1 are wanted.")
    if turns < 1:
        raise ParameterError(f"turns = {turns}; one or more are wanted.")
    known = domain.confidence > 0
    require_finite(rho[:, known], "slices within the domain")
    model = _Model(domain, completion or Symmetric(), FacetAreas(grid, degree))
    tables = np.zeros(rho.shape, np.float32)
    k_s, still = np.zeros((2, len(rho)))
    for low in range(0, len(rho), _SITES):
        some = slice(low, low + _SITES)
        tables[some, known], k_s[some], still[some] = model.fitted(rho[some][:, known], index[some], turns)
    return PartialNDFs(tables, k_s, still)


class _Model:
    """What is the same for all texels. D is (T, K), at the K knots of the domain; everything else of it is linear."""

    def __init__(self, domain: Domain, completion: Completion, facets: FacetAreas) -> None:
        grid, known = facets.grid, domain.confidence > 0
        self.completion, self.facets = completion, facets
        self.cosines = np.append(np.clip(domain.cosines[known], 0, 1), 1.0)
        self.directions = np.concatenate((domain.lights[known], domain.wo[None]))
        sources = completion.sources(known).reshape(-1)
        # Each knot has its value from one that is known, or none: so does what is linear in them.
        filled = np.flatnonzero(sources >= 0)
        place = np.cumsum(known) - 1
        shape = np.count_nonzero(known), known.size
        gather = csr_array((np.ones(len(filled), np.float32), (place[sources[filled]], filled)), shape=shape)
        of_knots = facets.of_knots.reshape(known.size, -1)
        self.coefficients = gather @ of_knots
        self.mass = gather @ np.repeat(grid.projected, grid.columns).astype(np.float32)[:, None]

    def fitted(self, rho: np.ndarray, eta: np.ndarray, turns: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """D, k_s (T,) and by how much D still changed (T,), from rho (T, K) and eta (T,)."""
        index = eta[:1] if (eta == eta[0]).all() else eta
        F = dielectric(np, index[:, None], self.cosines)
        measured = (4 * np.maximum(rho, 0) * (F[:, -1:] / F[:, :-1])).astype(np.float32)
        # What shows least is the ground itself: g >= cos, whatever the harmonics leave out.
        least = self.directions[:, 2].astype(np.float32)
        g = np.broadcast_to(least, (len(rho), len(least)))
        D = np.zeros_like(measured)
        k_s = still = np.zeros(len(rho))
        for _ in range(turns):
            before = D
            D = measured * g[:, :-1] * g[:, -1:]
            k_s = (D @ self.mass)[:, 0]
            D /= np.where(k_s > 0, k_s, 1)[:, None]
            g = np.maximum(self.completion.areas(self.facets, D @ self.coefficients, self.directions), least)
            size = np.maximum(np.linalg.norm(D, axis=1), 1e-30)
            still = np.linalg.norm(D - before, axis=1) / size
        return D, k_s, still
