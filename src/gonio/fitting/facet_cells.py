"""Sites that are seen and lit nearly alike: cells of a sample, and the nodes at which their directions are known.

    s(x) = sum_k b_k(x) s_k,    s_k: slices made as if x were seen and lit as node k is;  b_k bilinear in x

Lights near a flat sample shine on each texel from elsewhere, so that an operator from lights to facets (`facet_slices`)
serves one place only. Between nodes what operators find differs by how far half vectors wander, and blended it errs by
the bend of reflectance over that distance, not by its slope. Of curved samples cells are sites whose normals are alike,
and a node is the one amidst them.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator
from typing import Protocol

import numpy as np

from ..directions import half_vector
from ..errors import ArrayError

_FLAT = 3e-3  # radians by which frames of a flat sample differ at most
_PROBES = 9  # along a side, where it is seen how fast half vectors wander
_MOST = 96  # nodes along a side
_FEWEST = 32  # sites of a cell of a curved sample
_LARGEST = 1024


class Slices(Protocol):
    """All lights at S sites: wi (S, N, 3), wo (S, 3), local; value (S, N, 3), NaN where unknown; weight (S, N)."""

    @property
    def wi(self) -> np.ndarray: ...
    @property
    def wo(self) -> np.ndarray: ...
    @property
    def value(self) -> np.ndarray: ...
    @property
    def weight(self) -> np.ndarray: ...


class Places(Protocol):
    """`positions` (S, 3) and `frames` (S, 3, 3) of S sites in the world."""

    @property
    def positions(self) -> np.ndarray: ...
    @property
    def frames(self) -> np.ndarray: ...


class Measured(Protocol):
    """Reflectance of sites under N lights, seen from one place."""

    @property
    def sites(self) -> Places: ...
    def __len__(self) -> int: ...
    def at(self, some: np.ndarray) -> Slices:
        """All lights at sites `some` (S,)."""

    def directions(self, positions: np.ndarray, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """wi (S, N, 3) and wo (S, 3), local, of any points."""


@dataclasses.dataclass(frozen=True, eq=False)
class Cell:
    """`sites` (S,) between `nodes` (K,), with the `shares` (S, K) of each, which sum to 1."""

    sites: np.ndarray
    nodes: np.ndarray
    shares: np.ndarray

    def parts(self) -> Iterator[Cell]:
        """The same in cells of few sites, whose tables take some ten megabytes."""
        for low in range(0, len(self.sites), _LARGEST):
            some = slice(low, low + _LARGEST)
            yield Cell(self.sites[some], self.nodes, self.shares[some])


@dataclasses.dataclass(frozen=True, eq=False)
class Joined:
    """Several samples, or one that was turned under the camera, as one larger sample (MS 4): their sites one after
    another."""

    parts: tuple[Measured, ...]

    @property
    def starts(self) -> np.ndarray:
        """(parts + 1,): the first site of each, and the number of all."""
        return np.cumsum([0, *(len(part) for part in self.parts)])

    def __len__(self) -> int:
        return int(self.starts[-1])

    def at(self, some: np.ndarray) -> Slices:
        """All lights at sites `some` (S,) of one of them."""
        starts = self.starts
        k = int(np.searchsorted(starts, some[0], side="right")) - 1
        return self.parts[k].at(some - starts[k])

    def blocks(self, size: int) -> list[np.ndarray]:
        """All sites, `size` of one part at a time."""
        ends = [(int(a), int(b)) for a, b in itertools.pairwise(self.starts)]
        return [np.arange(low, min(low + size, b)) for a, b in ends for low in range(a, b, size)]


@dataclasses.dataclass(frozen=True, eq=False)
class Cells:
    """`wi`, of each of J nodes (N, 3), and `wo` (J, 3), unit, local; the cells between them, neighbours one after
    another."""

    wi: tuple[np.ndarray, ...]
    wo: np.ndarray
    cells: tuple[Cell, ...]

    @classmethod
    def of(cls, measured: Joined, tolerance: float = 0.04) -> Cells:
        """Such that half vectors wander by `tolerance` radians at most from node to node, within 96 x 96 nodes.

        Raises `ArrayError` where there are no sites.
        """
        several = [cls._one(part, tolerance) for part in measured.parts]
        first = np.cumsum([0, *(len(one.wo) for one in several)])
        cells = [
            Cell(cell.sites + start, cell.nodes + node, cell.shares)
            for one, start, node in zip(several, measured.starts[:-1], first[:-1], strict=True)
            for cell in (part for whole in one.cells for part in whole.parts())
        ]
        return cls(
            tuple(wi for one in several for wi in one.wi), np.concatenate([one.wo for one in several]), tuple(cells)
        )

    @classmethod
    def _one(cls, measured: Measured, tolerance: float) -> Cells:
        places = measured.sites
        if not len(measured):
            raise ArrayError("there are no sites to divide into cells: the mask is empty.")
        mean = places.frames.mean(axis=0)
        flat = np.abs(places.frames - mean).max() < _FLAT
        return _lattice(measured, tolerance) if flat else _clusters(measured, tolerance)


def _lattice(measured: Measured, tolerance: float) -> Cells:
    positions, frame = measured.sites.positions, measured.sites.frames[0]
    origin = positions.mean(axis=0)
    local = (positions - origin) @ frame.T
    low, high = local[:, :2].min(axis=0), local[:, :2].max(axis=0)

    def lattice(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        u, v = (
            np.linspace(a, b, n) if n > 1 else np.array([(a + b) / 2])
            for a, b, n in zip(low, high, counts, strict=True)
        )
        x = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
        x = np.column_stack((x, np.full(len(x), local[:, 2].mean())))
        return measured.directions(origin + x @ frame, np.broadcast_to(frame, (len(x), 3, 3)))

    wi, wo = lattice(np.array([_PROBES, _PROBES]))
    h = half_vector(wi, wo[:, None]).reshape(_PROBES, _PROBES, -1, 3)
    wander = [float(np.linalg.norm(np.diff(h, axis=axis), axis=-1).max()) * (_PROBES - 1) for axis in (0, 1)]
    counts = np.minimum(np.ceil(np.array(wander) / tolerance).astype(int) + 1, _MOST)
    counts = np.where(np.array(wander) < 1e-6, 1, counts)
    wi, wo = lattice(counts)
    place = (local[:, :2] - low) / np.where(high > low, high - low, 1) * (counts - 1)
    corner = np.clip(np.floor(place).astype(int), 0, np.maximum(counts - 2, 0))
    part = place - corner
    number = corner[:, 0] * counts[1] + corner[:, 1]
    order = np.argsort(number, kind="stable")
    cells = []
    for sites in np.split(order, np.flatnonzero(np.diff(number[order])) + 1):
        (i, j), (u, v) = corner[sites[0]], part[sites].T
        beside = [(i + a, j + b) for a in range(min(2, counts[0])) for b in range(min(2, counts[1]))]
        shares = np.stack(
            [
                (u if a > i else 1 - u if counts[0] > 1 else 1)
                * (v if b > j else 1 - v if counts[1] > 1 else 1 + 0 * v)
                for a, b in beside
            ],
            axis=1,
        )
        cells.append(Cell(sites, np.array([a * counts[1] + b for a, b in beside]), shares))
    return Cells(tuple(wi), wo, tuple(cells))


def _clusters(measured: Measured, tolerance: float) -> Cells:
    """Halved at the median of what varies most, until half vectors of few lights are alike."""
    places = measured.sites
    count = measured.directions(places.positions[:1], places.frames[:1])[0].shape[1]
    lights = np.unique(np.linspace(0, count - 1, 8).astype(int))
    features = np.empty((len(measured), 3 * len(lights) + 3), np.float32)
    for low in range(0, len(features), 4096):
        some = slice(low, low + 4096)
        wi, wo = measured.directions(places.positions[some], places.frames[some])
        # Lights below the horizon of some sites are no half vectors: directions serve, at half their wandering.
        features[some] = np.concatenate((wi[:, lights].reshape(len(wo), -1), wo), axis=1) / 2
    done: list[np.ndarray] = []
    open_ = [np.arange(len(features))]
    while open_:
        sites = open_.pop()
        extent = np.ptp(features[sites], axis=0)
        widest = int(extent.argmax())
        if extent[widest] <= tolerance or len(sites) <= _FEWEST:
            done.append(sites)
            continue
        order = sites[np.argsort(features[sites, widest], kind="stable")]
        open_ += [order[len(order) // 2 :], order[: len(order) // 2]]
    amidst = []
    for sites in done:
        off = features[sites] - features[sites].mean(axis=0)
        amidst.append(sites[int(np.argmin(np.sum(off * off, axis=1)))])
    wi, wo = measured.directions(places.positions[amidst], places.frames[amidst])
    cells = tuple(Cell(np.sort(s), np.array([k]), np.ones((len(s), 1))) for k, s in enumerate(done))
    return Cells(tuple(wi), wo, cells)
