"""Facets whose distribution at every texel is a sparse mixture of a few complete tabulated ones: what example-based
microfacet synthesis makes (MS 5.3, 6).

    f = k_d / pi + k_s D(h) F(h.o; eta) / (F(1; eta) 4 g(i) g(o))         MS 6; S = cos theta / g (MS 5): cosines cancel
    D = max(sum_j w_j D_j, 0),   g(k) = max(sum_j w_j g_j(k), cos theta_k),   sum_j w_j = 1                       MS 18

D_j is bilinear as in `ndf_table.py`, g_j at tan(theta/2) = 1 - (1 - r)^2, r = 0 .. 1 in 32 steps, and 48 azimuths: of
its series to degree 12 (`facet_areas.py`) that misses, relative rms over z and at most, .0009 and .002 for cloth of
slopes .3; .001 and .007 for .3 by .6. The least index is 1.01, since F(1; 1) = 0.

h is drawn from one component, chosen by max(w_j, 0), as `ndf_table.py` draws it. Not here: how tables and mixtures are
found (`fitting`).
"""

from __future__ import annotations

import dataclasses
import functools
import math
import sys
import threading
from typing import Any, ClassVar

import numpy as np

from .._kernels import facet_mixture as kernels
from ..arrays import Array, floats, frozen, is_numpy, like, namespace, to_numpy
from ..directions import dot, from_spherical, half_vector, spherical
from ..errors import ParameterError
from .diffuse import Lambert
from .facet_areas import FacetAreas
from .fresnel import dielectric
from .model import BRDF, Bounds
from .ndf_table import _bracket, _place
from .pairs import through
from .polar_grid import PolarGrid
from .sampling import cosine_direction, facet_between, mirrored

_AREAS = (33, 48)  # directions that g is tabulated for
_TABLES = 256  # at once, where coefficients are found
_PAIRS = 1 << 18  # of an index and a weight at once, where texels are averaged
_KEPT = 64  # pairs of a texel of the coarser levels
_LEAST = 1.01  # index
_MAKING = threading.Lock()  # of levels

# Of a component, composed in the time that one pair of directions takes to gather from its two tables: 7 ns.
_KNOTS = 60


@dataclasses.dataclass(frozen=True, eq=False)
class FacetBasis:
    """M complete distributions: `tables` (M, rows, columns) of D >= 0 in 1/sr at the knots of `grid`, held in single
    precision, each of integral (n.h) D = 1. A tensor is held as it is, where it is.

    `trust` (M, rows, columns), whole numbers of 0 to 255 held in a byte, says how far photographs tell D at a knot: 255
    by the texel's own data, about half by those of other texels turned, 0 where it is filled; None where it is unknown.

    Raises `ParameterError` for other shapes, values that are negative or not finite, or another integral.
    """

    grid: PolarGrid
    tables: Array
    trust: Array | None = None

    def __post_init__(self) -> None:
        _require_tables(self.grid, self.tables)
        if self.trust is not None:
            _require_trust(self.trust, tuple(np.shape(self.tables)))
            object.__setattr__(self, "trust", frozen(self.trust, np.uint8))
        tables = frozen(self.tables, np.float32)
        xp = namespace(tables)
        mass = to_numpy(_masses(xp, self.grid, tables))
        off = np.flatnonzero(~(np.abs(mass - 1) <= 1e-3))
        if len(off):
            raise ParameterError(
                f"FacetBasis: tables[{off[0]}] has integral (n.h) D = {mass[off[0]]:.6g}; that of complete ones is 1. "
                "FacetBasis.of(grid, tables) divides by it."
            )
        object.__setattr__(self, "tables", tables)

    @classmethod
    def of(cls, grid: PolarGrid, tables: Array, trust: Array | None = None) -> FacetBasis:
        """`tables`, each divided by its integral. Raises `ParameterError` where one is zero throughout."""
        _require_tables(grid, tables)
        xp, tables = floats(tables)
        mass = _masses(xp, grid, tables)
        if not bool(xp.all(mass > 0)):
            raise ParameterError(
                f"FacetBasis: tables[{int(np.argmin(to_numpy(mass)))}] is zero throughout: no facets to normalise."
            )
        return cls(grid, tables / xp.astype(mass, tables.dtype)[:, None, None], trust)

    @functools.cached_property
    def areas(self) -> Array:
        """g_j (M, 33, 48), float32, at the directions that the head of this file names; 6.2 KiB a table."""
        rows, columns = _AREAS
        theta = 2 * np.arctan(1 - (1 - np.linspace(0, 1, rows)) ** 2)
        directions = from_spherical(theta[:, None], 2 * math.pi * np.arange(columns) / columns).reshape(-1, 3)
        shown = FacetAreas(self.grid, max(2, min(12, (self.grid.columns - 1) // 4 * 2)))
        xp = namespace(self.tables)
        blocks = (self.tables[k : k + _TABLES] for k in range(0, len(self.tables), _TABLES))
        found = xp.concat([shown.areas(shown.coefficients(block), directions) for block in blocks], axis=0)
        return xp.reshape(found, (-1, rows, columns))

    @functools.cached_property
    def _sampler(self) -> _Sampler:
        tables = to_numpy(self.tables)
        q = np.sin(self.grid.theta) ** 2
        means = tables.mean(axis=2, dtype=np.float64)
        marginal = np.zeros_like(means)
        np.cumsum(np.diff(q) * 0.5 * (means[:, 1:] + means[:, :-1]), axis=1, out=marginal[:, 1:])
        sums = np.zeros((*means.shape, self.grid.columns + 1), np.float32)
        np.cumsum(0.5 * (tables + np.roll(tables, -1, axis=2)), axis=2, out=sums[..., 1:])
        # d omega (n.h) = dq dphi / 2
        return _Sampler(q, means, marginal, sums, math.pi * marginal[:, -1])


@dataclasses.dataclass(frozen=True, eq=False)
class _Sampler:
    """As of one table (`ndf_table.py`), for each."""

    q: np.ndarray  # (R,) sin^2 theta of the rows
    means: np.ndarray  # (M, R) of D along each row
    marginal: np.ndarray  # (M, R) the integral over q up to each row
    sums: np.ndarray  # (M, R, C + 1) along each row up to each column
    masses: np.ndarray  # (M,) the integrals of (n.h) D'


@dataclasses.dataclass(frozen=True, eq=False)
class FacetMixture(BRDF):
    """Mixtures `weights` (..., k) of the tables `indices` (..., k) of `basis`; colours `k_d` and `k_s` (..., C) >= 0,
    relative index `eta` (...) in [1, 10].

    (...) is () of one BRDF, (N,) of sites, (rows, columns) of a texture, for each of them the same or (). Weights sum
    to 1 and may be negative; pairs of weight 0 cost nothing. Held as int32 and float32: 8 bytes a pair.

    Raises `ParameterError` for what lies outside its range or does not fit.
    """

    basis: FacetBasis
    indices: Array
    weights: Array
    k_d: Array = 0.0
    k_s: Array = 1.0
    eta: Array = 1.5

    bounds: ClassVar[dict[str, Bounds]] = {
        "indices": Bounds(0, 2**31 - 1, own=1, dtype=np.int32),
        "weights": Bounds(-1e6, 1e6, own=1, dtype=np.float32),
        "k_d": Bounds(0.0, sys.float_info.max, colour=True),
        "k_s": Bounds(0.0, sys.float_info.max, colour=True),
        "eta": Bounds(1.0, 10.0),
    }

    def __post_init__(self) -> None:
        if not isinstance(self.basis, FacetBasis):
            raise ParameterError(f"FacetMixture: basis = {self.basis!r:.60} is no FacetBasis.")
        try:
            given, count = to_numpy(self.indices), len(self.basis.tables)
        except ValueError as error:
            raise ParameterError("FacetMixture: indices is not an array of numbers in even rows.") from error
        if given.dtype.kind not in "iu":
            raise ParameterError(f"FacetMixture: indices has dtype {given.dtype}; tables are counted in whole numbers.")
        if (off := given[(given < 0) | (given >= count)]).size:
            raise ParameterError(f"FacetMixture: indices = {off[0]}; basis has tables 0 to {count - 1}.")
        super().__post_init__()
        indices, weights = self.indices, self.weights
        if indices.ndim < 1 or weights.ndim < 1 or indices.shape[-1] != weights.shape[-1] or not indices.shape[-1]:
            raise ParameterError(
                f"FacetMixture: indices {tuple(indices.shape)} and weights {tuple(weights.shape)} are not (..., k) of "
                "the same k >= 1. Fill up with weights of 0."
            )
        leads = {name: lead for name, lead in self._leads().items() if lead}
        if len(set(leads.values())) > 1:
            told = ", ".join(f"{name} {lead}" for name, lead in leads.items())
            raise ParameterError(f"FacetMixture: sites' axes are the same for all that have any, not {told}.")
        xp = namespace(weights)
        total = xp.sum(weights, axis=-1)
        if not bool(xp.all(xp.abs(total - 1) <= 1e-3)):
            worst = to_numpy(total).ravel()
            worst = worst[np.abs(worst - 1) > 1e-3][0]
            raise ParameterError(
                f"FacetMixture: weights sum to {worst:.6g}; divide them by their sum, so that it is 1."
            )

    def _leads(self) -> dict[str, tuple[int, ...]]:
        """The sites' axes of each parameter."""
        return {
            name: tuple(getattr(self, name).shape[: bound.axes(getattr(self, name))])
            for name, bound in self.bounds.items()
        }

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        above = ((wi[..., 2] > 0) & (wo[..., 2] > 0))[..., None]
        up = xp.concat((xp.zeros_like(wi[..., :2]), xp.ones_like(wi[..., 2:])), axis=-1)
        # Below the surface the terms have no meaning and may divide by zero; the answer there is cut out later.
        wi, wo = xp.where(above, wi, up), xp.where(above, wo, up)
        h = half_vector(wi, wo)
        lobe = self._distribution(xp, h) / (4 * self._area(xp, wi) * self._area(xp, wo)) * self._facing(xp, dot(wo, h))
        return like(self.k_d, wi) / math.pi + like(self.k_s, wi) * lobe[..., None]

    def D(self, h: Array) -> Array:
        """D of MS 18 (...) in 1/sr at unit local h (..., 3); 0 below the surface."""
        xp, h = floats(h)
        D = self._distribution(xp, h)
        return xp.where(h[..., 2] > 0, D, xp.zeros_like(D))

    def S(self, k: Array) -> Array:
        """The shadowing cos theta / g (...) in [0, 1] at unit local k (..., 3); 0 below the surface."""
        xp, k = floats(k)
        above = k[..., 2] > 0
        up = xp.concat((xp.zeros_like(k[..., :2]), xp.ones_like(k[..., 2:])), axis=-1)
        g = self._area(xp, xp.where(above[..., None], k, up))
        return xp.where(above, k[..., 2] / g, xp.zeros_like(g))

    def _distribution(self, xp: Any, h: Array) -> Array:
        theta, phi = spherical(h)
        row, r = self._rows(xp, theta)
        return xp.clip(self._mixed(xp, self.basis.tables, like(self.weights, h), r, row - r, phi), 0.0, None)

    def _compiled(self, wi: Array, wo: Array) -> Array:
        indices, weights = to_numpy(self.indices), to_numpy(self.weights).astype(np.float32, copy=False)
        k = indices.shape[-1]
        lead = max(indices.shape[:-1], weights.shape[:-1], key=len)
        grid, tables, areas = self.basis.grid, to_numpy(self.basis.tables), to_numpy(self.basis.areas)
        flat = [np.ascontiguousarray(np.broadcast_to(x, (*lead, k))).reshape(-1, k) for x in (indices, weights)]
        flat = [x.view() for x in (tables.reshape(len(tables), -1), areas.reshape(len(areas), -1), *flat)]
        for x in flat:
            x.flags.writeable = False  # of the view only: one loop for all input
        tables, areas, indices, weights = flat
        knots = tables.shape[1] + areas.shape[1]
        # Composed, a pair gathers once instead of k times.
        enough = math.ceil(knots / _KNOTS * k / (k - 1)) if k > 1 else sys.maxsize
        scratch = np.empty(tables.shape[1], np.float32), np.empty(areas.shape[1], np.float32)
        sizes, warp = (*grid.shape, *_AREAS), float(grid.warp)

        def kernel(wi: Any, wo: Any, p: Any, steps: Any, out: Any) -> None:
            kernels.facet_mixture(wi, wo, p, steps, out, tables, areas, sizes, warp, indices, weights, enough, *scratch)

        numbers = np.arange(len(indices)).reshape(*lead, 1)
        eta = np.maximum(to_numpy(self.eta), _LEAST)[..., None]
        specular = to_numpy(self.k_s) / (4 * ((eta - 1) / (eta + 1)) ** 2)
        return through(kernel, wi, wo, (numbers, to_numpy(self.k_d) / math.pi, specular, eta))

    def lobes(self) -> tuple[BRDF, ...]:
        return Lambert(1.0) * self.k_d, dataclasses.replace(self, k_d=0.0)

    def _strength(self, xp: Any, wo: Array) -> Array:
        matte, glossy = self._parts(xp, wo)
        return matte + glossy

    def _parts(self, xp: Any, wo: Array) -> tuple[Array, Array]:
        glossy = self._mean(xp, self.k_s, wo) * self._facing(xp, xp.clip(wo[..., 2], 0.0, 1.0))
        return self._mean(xp, self.k_d, wo) + xp.zeros_like(glossy), glossy

    def _matte_share(self, xp: Any, wo: Array) -> Array:
        matte, glossy = self._parts(xp, wo)
        total = matte + glossy
        return xp.where(total > 0, matte / xp.where(total > 0, total, xp.ones_like(total)), xp.ones_like(total))

    def _chances(self, xp: Any, reference: Array) -> Array:
        """Of each pair to be drawn from, (..., k); they sum to 1."""
        positive = xp.clip(like(self.weights, reference), 0.0, None)
        return positive / xp.sum(positive, axis=-1, keepdims=True)

    def sample(self, wo: Array, u: Array) -> Array:
        xp, wo, u = floats(wo, u)
        share = self._matte_share(xp, wo)
        # The part of u_0 that fell on the facets is stretched to [0, 1) again, to choose among the tables.
        rest = (u[..., 0] - share) / xp.where(share < 1, 1 - share, xp.ones_like(share))
        rest = xp.clip(rest, 0.0, 1.0 - 2.0**-24)
        running = xp.cumulative_sum(self._chances(xp, u), axis=-1)
        # A table that is never drawn adds nothing, so that the first to pass is one that may be.
        passed = running <= rest[..., None] * running[..., -1:]
        at = xp.sum(xp.astype(passed, xp.int64), axis=-1, keepdims=True)
        indices = self._indices(xp, u)
        shape = np.broadcast_shapes(tuple(at.shape[:-1]), tuple(indices.shape[:-1]))
        indices, at = xp.broadcast_to(indices, (*shape, indices.shape[-1])), xp.broadcast_to(at, (*shape, 1))
        table = xp.take_along_axis(indices, at, axis=-1)[..., 0]
        glossy = mirrored(wo, self._facet(xp, table, u[..., 1:]))
        matte = (u[..., 0] < share)[..., None]
        return xp.where(matte, cosine_direction(u[..., 1:]) + xp.zeros_like(glossy), glossy)

    def _facet(self, xp: Any, table: Array, u: Array) -> Array:
        """h (..., 3) drawn from the table numbered `table` (...) by `u` (..., 2)."""
        s, (rows, columns) = self.basis._sampler, self.basis.grid.shape
        marginal, means, sums, values = (
            _reader(xp, x, u) for x in (s.marginal, s.means, s.sums, to_numpy(self.basis.tables))
        )
        first = table * rows
        goal = u[..., 0] * marginal(first + rows - 1)
        r = _bracket(xp, lambda k: marginal(first + k), rows - 1, goal)
        q = like(s.q, u)
        width = q[r + 1] - q[r]
        row = first + r
        part = _place(xp, (goal - marginal(row)) / width, means(row), means(row + 1))

        def before(c: Array) -> Array:
            at = row * (columns + 1) + c
            return (1 - part) * sums(at) + part * sums(at + columns + 1)

        goal = u[..., 1] * before(xp.full_like(r, columns))
        c = _bracket(xp, before, columns, goal)

        def edge(c: Array) -> Array:
            at = row * columns + c % columns
            return (1 - part) * values(at) + part * values(at + columns)

        turn = (xp.astype(c, u.dtype) + _place(xp, goal - before(c), edge(c), edge(c + 1))) * (2 * math.pi / columns)
        square = q[r] + part * width
        sine, up = xp.sqrt(square), xp.sqrt(xp.clip(1 - square, 0.0, None))
        return xp.stack((sine * xp.cos(turn), sine * xp.sin(turn), up), axis=-1)

    def pdf(self, wi: Array, wo: Array) -> Array:
        xp, wi, wo = floats(wi, wo)
        h = facet_between(wi, wo)
        theta, phi = spherical(h)
        _, r = self._rows(xp, theta)
        s, at = self.basis._sampler, xp.astype(r, xp.int64)
        q = like(s.q, h)
        part = xp.clip((xp.sin(theta) ** 2 - q[at]) / (q[at + 1] - q[at]), 0.0, 1.0)
        chances = self._chances(xp, h) / _reader(xp, s.masses, h)(self._indices(xp, h))
        glossy = self._mixed(xp, self.basis.tables, chances, r, part, phi) * xp.clip(h[..., 2], 0.0, None)
        glossy = glossy / (4 * xp.clip(xp.abs(dot(wo, h)), xp.finfo(wo.dtype).eps, None))
        matte = self._matte_share(xp, wo)
        return matte * super().pdf(wi, wo) + (1 - matte) * glossy

    def confidence(self, wi: Array, wo: Array) -> Array:
        """sum_j max(w_j, 0) trust_j(h) / 255 over sum_j max(w_j, 0), bilinear as D_j is; 1 where trust is unknown."""
        if self.basis.trust is None:
            return super().confidence(wi, wo)
        xp, wi, wo = floats(wi, wo)
        h = facet_between(wi, wo)
        theta, phi = spherical(h)
        row, r = self._rows(xp, theta)
        return self._mixed(xp, self.basis.trust, self._chances(xp, h), r, row - r, phi) / 255

    def _indices(self, xp: Any, reference: Array) -> Array:
        return xp.astype(like(self.indices, reference), xp.int64)

    def _facing(self, xp: Any, cosine: Array) -> Array:
        """F(cosine) / F(1), (...)."""
        eta = xp.clip(like(self.eta, cosine), _LEAST, None)
        return dielectric(xp, eta, xp.clip(cosine, 0.0, 1.0)) / ((eta - 1) / (eta + 1)) ** 2

    def _rows(self, xp: Any, theta: Array) -> tuple[Array, Array]:
        """The row of the grid, and the whole one before it."""
        rows, warp = self.basis.grid.rows, self.basis.grid.warp
        row = xp.clip(theta * (2 / math.pi), 0.0, 1.0) ** (1 / warp) * (rows - 1)
        return row, xp.clip(xp.floor(row), 0.0, rows - 2.0)

    def _area(self, xp: Any, w: Array) -> Array:
        """g (...) at directions above the surface."""
        half = xp.sqrt(w[..., 0] ** 2 + w[..., 1] ** 2) / (1 + w[..., 2])
        row = (1 - xp.sqrt(xp.clip(1 - half, 0.0, None))) * (_AREAS[0] - 1)
        r = xp.clip(xp.floor(row), 0.0, _AREAS[0] - 2.0)
        _, phi = spherical(w)
        return xp.maximum(self._mixed(xp, self.basis.areas, like(self.weights, w), r, row - r, phi), w[..., 2])

    def _mixed(self, xp: Any, tables: Array, weights: Array, r: Array, part: Array, phi: Array) -> Array:
        """sum_j w_j of `tables` (M, R, C) between rows r and r + 1 at `part`, linear in phi."""
        _, rows, columns = tables.shape
        column = phi * (columns / (2 * math.pi))
        c = xp.clip(xp.floor(column), 0.0, columns - 1.0)
        fraction = column - c
        c, r = xp.astype(c, xp.int64), xp.astype(r, xp.int64)
        beside = (c + 1) % columns
        read, indices = _reader(xp, tables, phi), self._indices(xp, phi)
        value = xp.zeros_like(phi)
        for j in range(indices.shape[-1]):
            at = (indices[..., j] * rows + r) * columns
            upper = (1 - fraction) * read(at + c) + fraction * read(at + beside)
            lower = (1 - fraction) * read(at + columns + c) + fraction * read(at + columns + beside)
            value = value + weights[..., j] * ((1 - part) * upper + part * lower)
        return value

    def at(self, uv: Array | None, width: Array | None = None) -> FacetMixture:
        """The mixtures at N sites of a texture with coordinates `uv` (N, 2), row 0 at v = 1; itself where it is none.

        k_s D, k_d and k_s are bilinear between texels' centres (by the mean of k_s over its channels), eta is weighted
        by k_s; beyond the outermost centres all are constant. `width` (N,) >= 0 is the root of the footprint's area in
        (u, v), sqrt(rows columns) times as many texels: beyond 1 the level of averages over 2 x 2 texels is taken whose
        texels are nearest to it in size.

        Raises `ParameterError` where the parameters vary over other axes, or there is no uv to look them up by.
        """
        lead = max(self._leads().values(), key=len)
        if not lead:
            return self
        if len(lead) != 2:
            raise ParameterError(f"FacetMixture: sites' axes {lead} are neither none nor those of a texture (v, u).")
        if uv is None:
            raise ParameterError("the material has textures, but the shape no uv to look them up by.")
        u, v = to_numpy(uv).astype(np.float64, copy=False).T
        place = np.stack(((1 - v) * lead[0], u * lead[1]), axis=-1)
        levels: tuple[FacetMixture, ...] = (self,)
        level = np.zeros(len(place), np.int64)
        if width is not None:
            width = np.broadcast_to(to_numpy(width), level.shape)
            if not np.all((width >= 0) & np.isfinite(width)):
                raise ParameterError("FacetMixture: width is a footprint in parts of the texture, finite and >= 0.")
            wanted = np.rint(np.log2(np.maximum(width * math.sqrt(math.prod(lead)), 1))).astype(np.int64)
            if wanted.any():
                with _MAKING:  # one of the threads that ask makes them
                    levels = (self, *self._coarser)
            level = np.minimum(wanted, len(levels) - 1)
        order = np.argsort(level, kind="stable")
        kept = max(_KEPT, 4 * self.indices.shape[-1])
        found = [part for n in np.unique(level) for part in levels[n]._bilinear(place[level == n] / 2**n - 0.5, kept)]
        sites = _Texels.joined(found or self._bilinear(place, kept))
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        return dataclasses.replace(self, **{name: getattr(sites, name)[back] for name in self.bounds})

    def _bilinear(self, place: np.ndarray, kept: int) -> list[_Texels]:
        """At `place` (N, 2), counted in texels from the centre of the first; in parts."""
        texture = _Texels.of(self)
        last = np.array(texture.eta.shape) - 1
        step = max(1, _PAIRS // (4 * self.indices.shape[-1]))
        parts = []
        for start in range(0, max(len(place), 1), step):
            at = np.clip(place[start : start + step], 0, last)
            low = np.floor(at).astype(np.int64)
            (top, left), (bottom, right) = low.T, np.minimum(low + 1, last).T
            row, column = np.stack((top, top, bottom, bottom), axis=-1), np.stack((left, right, left, right), axis=-1)
            y, x = (at - low).T
            shares = np.stack(((1 - y) * (1 - x), (1 - y) * x, y * (1 - x), y * x), axis=-1)
            parts.append(texture.averaged(row, column, shares, kept))
        return parts

    @functools.cached_property
    def _coarser(self) -> tuple[FacetMixture, ...]:
        """The levels beyond the texture itself, each of half its rows and columns, down to one texel."""
        found: list[FacetMixture] = []
        level = self
        # With few pairs sixteen texels' suffice: the levels take 2.4 times the texture's memory at most.
        kept = min(_KEPT, 16 * self.indices.shape[-1])
        while math.prod(_Texels.of(level).eta.shape) > 1:
            level = level._halved(kept)
            found.append(level)
        return tuple(found)

    def _halved(self, kept: int) -> FacetMixture:
        texture = _Texels.of(self)
        rows, columns = texture.eta.shape
        half = (rows + 1) // 2, (columns + 1) // 2
        # Beyond its last row and column a texture is constant.
        near, far = 2 * np.arange(half[1]), np.minimum(2 * np.arange(half[1]) + 1, columns - 1)
        column = np.stack((near, far, near, far), axis=-1)
        step = max(1, _PAIRS // (4 * half[1] * self.indices.shape[-1]))
        parts = []
        for start in range(0, half[0], step):
            top = 2 * np.arange(start, min(start + step, half[0]))[:, None]
            bottom = np.minimum(top + 1, rows - 1)
            row = np.stack((top, top, bottom, bottom), axis=-1)
            row, four = (np.broadcast_to(x, (len(top), half[1], 4)).reshape(-1, 4) for x in (row, column))
            parts.append(texture.averaged(row, four, np.full((1, 4), 0.25), kept))
        flat = ((name, getattr(_Texels.joined(parts), name)) for name in self.bounds)
        return dataclasses.replace(self, **{name: x.reshape(*half, *x.shape[1:]) for name, x in flat})


@dataclasses.dataclass(frozen=True, eq=False)
class _Texels:
    """The parameters of texels, all with the same leading axes."""

    indices: np.ndarray
    weights: np.ndarray
    k_d: np.ndarray
    k_s: np.ndarray
    eta: np.ndarray

    @classmethod
    def of(cls, mixture: FacetMixture) -> _Texels:
        lead = max(mixture._leads().values(), key=len)
        values = {}
        for name, bound in mixture.bounds.items():
            value = to_numpy(getattr(mixture, name))
            own = value.shape[bound.axes(value) :] or (() if name == "eta" else (1,))
            values[name] = np.broadcast_to(value, (*lead, *own))
        return cls(**values)

    @classmethod
    def joined(cls, parts: list[_Texels]) -> _Texels:
        """One after the other; where a part has fewer pairs, they are filled up."""
        k = max(part.indices.shape[-1] for part in parts)
        values = {}
        for field in dataclasses.fields(cls):
            given = [getattr(part, field.name) for part in parts]
            if field.name in ("indices", "weights"):
                given = [np.pad(x, ((0, 0), (0, k - x.shape[-1]))) for x in given]
            values[field.name] = np.concatenate(given)
        return cls(**values)

    def averaged(self, row: np.ndarray, column: np.ndarray, shares: np.ndarray, kept: int) -> _Texels:
        """Sums of the texels at `row` and `column` (N, n) of a texture, weighed by `shares` (N, n), which sum to 1."""
        k_d, k_s, eta = self.k_d[row, column], self.k_s[row, column], self.eta[row, column]
        strength = shares * k_s.mean(axis=-1)
        total = strength.sum(axis=-1, keepdims=True)
        # k_s D is what adds up. Where nothing shines its shape does not matter.
        relative = np.where(total > 0, strength / np.where(total > 0, total, 1), shares)
        pairs = len(row), row.shape[1] * self.indices.shape[-1]
        weights = (relative[..., None] * self.weights[row, column]).reshape(pairs)
        indices = self.indices[row, column].reshape(pairs)
        return _Texels(
            *_merged(indices, weights, kept),
            (shares[..., None] * k_d).sum(axis=-2),
            (shares[..., None] * k_s).sum(axis=-2),
            (relative * eta).sum(axis=-1),
        )


def _merged(indices: np.ndarray, weights: np.ndarray, kept: int) -> tuple[np.ndarray, np.ndarray]:
    """Pairs (N, k) with those of the same index added up, the `kept` of greatest weight, in sum what all were."""
    count, k = indices.shape
    if count == 0:
        return indices[:, :1], weights[:, :1]
    # Numbers are sorted sooner than their places: the place of a pair is the low part of its number.
    bits = max(k - 1, 1).bit_length()
    numbers = np.sort((indices.astype(np.int64) << bits) | np.arange(k), axis=1)
    weights = np.take_along_axis(weights, numbers & ((1 << bits) - 1), axis=1)
    indices = numbers >> bits
    first = np.ones(indices.shape, bool)
    first[:, 1:] = indices[:, 1:] != indices[:, :-1]
    starts = np.flatnonzero(first)
    place = starts // k, (np.cumsum(first, axis=1) - 1).ravel()[starts]
    width = int(place[1].max()) + 1
    found: np.ndarray = np.zeros((count, width), np.int32)
    sums: np.ndarray = np.zeros((count, width))
    found[place] = indices.ravel()[starts]
    sums[place] = np.add.reduceat(weights.ravel(), starts)
    if width <= kept:
        return found, sums
    total = sums.sum(axis=1, keepdims=True)
    greatest = np.argpartition(-np.abs(sums), kept - 1, axis=1)[:, :kept]
    sums = np.take_along_axis(sums, greatest, axis=1)
    return np.take_along_axis(found, greatest, axis=1), sums * (total / sums.sum(axis=1, keepdims=True))


def _require_tables(grid: PolarGrid, tables: Array) -> None:
    if not isinstance(grid, PolarGrid):
        raise ParameterError(f"FacetBasis: grid = {grid!r:.60} is no PolarGrid.")
    shape = tuple(np.shape(tables))
    if len(shape) != 3 or shape[0] < 1 or shape[1:] != grid.shape:
        raise ParameterError(f"FacetBasis: tables has shape {shape}; the grid wants (M, {grid.rows}, {grid.columns}).")
    xp = namespace(tables)
    tables = tables if hasattr(tables, "dtype") else np.asarray(tables)
    if not bool(xp.all((tables >= 0) & xp.isfinite(tables))):
        values = to_numpy(tables)
        at = np.argwhere(~((values >= 0) & np.isfinite(values)))[0]
        raise ParameterError(f"FacetBasis: tables{at.tolist()} = {values[tuple(at)]:.6g}; D is finite and >= 0.")


def _require_trust(trust: Array, shape: tuple[int, ...]) -> None:
    values = to_numpy(trust)
    if values.shape != shape:
        raise ParameterError(f"FacetBasis: trust has shape {values.shape}; that of the tables is {shape}.")
    if values.dtype.kind not in "iuf":
        raise ParameterError(f"FacetBasis: trust has dtype {values.dtype}; whole numbers of 0 to 255 are wanted.")
    off = values[~((values >= 0) & (values <= 255) & (values == np.trunc(values)))]
    if off.size:
        raise ParameterError(f"FacetBasis: trust = {off[0]:.6g}; it is a whole number of 0 (filled) to 255 (own data).")


def _masses(xp: Any, grid: PolarGrid, tables: Array) -> Array:
    """The integral of (n.h) D of each table, (M,)."""
    rows = xp.sum(tables, axis=-1, dtype=xp.float64)
    return xp.sum(rows * like(grid.projected, rows), axis=-1)


def _reader(xp: Any, table: Array, reference: Array) -> Any:
    """Reads entries of the flat `table` as numbers like `reference`: what is read is converted, not the table."""
    table = to_numpy(table) if is_numpy(reference) else like(table, reference)
    flat = xp.reshape(table, (-1,))
    return lambda at: xp.astype(flat[at], reference.dtype, copy=False)
