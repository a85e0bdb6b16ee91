"""Samples of many photographs as one table, as reflectance sharing takes them.

    q = (x, y, u, |v|, w)       of RS 7; |v| where folded, without (x, y) where there are no places

At theta_d = 0 phi_d has no meaning: such samples enter at eight angles, folded at five.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from ..arrays import Array, require_finite, to_numpy
from ..directions import uvw
from ..errors import ArrayError
from ..samples import ReflectanceSamples

SINGLE = 1e-3  # range of w within which photographs are of one theta_d
_MOST = 1_100_000  # samples that are looked at: more tell no more
_BACK = 0.01  # theta_d, radians, below which phi_d has no meaning


@dataclasses.dataclass(frozen=True, eq=False)
class Table:
    """M samples: wi, wo, value (M, 3) or (M, C); site, group (M,), the photograph; place (M, 2) or None."""

    wi: np.ndarray
    wo: np.ndarray
    value: np.ndarray
    site: np.ndarray
    group: np.ndarray
    place: np.ndarray | None

    def __len__(self) -> int:
        return len(self.site)

    def __getitem__(self, some: np.ndarray) -> Table:
        place = None if self.place is None else self.place[some]
        return Table(self.wi[some], self.wo[some], self.value[some], self.site[some], self.group[some], place)


def collected(samples: Iterable[ReflectanceSamples], places: Array | None, seed: int) -> Table:
    """All samples, or evenly chosen ones of them where they are more than `_MOST`; those that are negative as 0."""
    rng, kept, share, total = np.random.default_rng(seed), [], 1.0, 0
    for number, block in enumerate(samples):
        draw = rng.random(len(block))
        some = draw < share
        kept.append((draw[some], block.wi[some], block.wo[some], block.value[some], block.site[some], number))
        total += int(np.count_nonzero(some))
        while total > _MOST:
            share /= 2
            kept = [_thinned(part, share) for part in kept]
            total = sum(len(part[0]) for part in kept)
    if not total:
        raise ArrayError("there are no samples. Do the lights belong to these photographs, and do they face the shape?")
    wi, wo, value, site = (np.concatenate([part[k] for part in kept]) for k in range(1, 5))
    group = np.concatenate([np.full(len(part[0]), part[5]) for part in kept])
    if not (value > 0).any():
        raise ArrayError("no sample is above 0: the photographs are black where lights reach the shape.")
    place = None
    if places is not None:
        at = to_numpy(places).astype(np.float64)
        if at.ndim != 2 or at.shape[1] != 2 or len(at) <= site.max():
            raise ArrayError(f"places have shape {at.shape}; ({site.max() + 1} or more sites, 2) is wanted.")
        require_finite(at, "places")
        place = at[site]
    return Table(wi, wo, np.maximum(value, 0), site, group, place)


def _thinned(part: tuple[Any, ...], share: float) -> tuple[Any, ...]:
    """Of a block's arrays, where the first, drawn for each sample, lies below `share`; its number."""
    keep = part[0] < share
    return (*(x[keep] for x in part[:5]), part[5])


def entered(table: Table, folded: bool) -> tuple[np.ndarray, np.ndarray]:
    """q (M, d), and the sample that each is of (M,): those at theta_d = 0 come at all angles."""
    angles = uvw(table.wi, table.wo)
    back = np.flatnonzero(angles[:, 2] < _BACK * 2 / math.pi)
    s, w = np.hypot(angles[back, 0], angles[back, 1]), angles[back, 2]
    angles[back] = np.stack((s, 0 * s, w), axis=-1)
    parts, at = [angles], [np.arange(len(angles))]
    # By eighths of a circle; folded, half of it is all there is.
    for turn in range(1, 5 if folded else 8):
        phi = turn * math.pi / 4
        parts.append(np.stack((s * math.cos(phi), s * math.sin(phi), w), axis=-1))
        at.append(back)
    q, sample = np.concatenate(parts), np.concatenate(at)
    if folded:
        q[:, 1] = np.abs(q[:, 1])
    if table.place is not None:
        q = np.concatenate((table.place[sample], q), axis=1)
    return q, sample
