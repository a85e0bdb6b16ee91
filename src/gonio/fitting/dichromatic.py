"""Reflectance sharing with two parts: body and surface, each an interpolant of its own.

    f_k(x, q) = a_k(x) d_k(q) + g(q)       RS 14: k = R, G, B; d smooth, a a colour of each site, g grey

Dielectrics reflect light at their surface as it came, and coloured from within. Either part is smoother than both, and
each has as many centres as it needs: RS has 2,000 for d and 5,000 for g.

Not here: telling the parts of photographs from each other (`capture.parts`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable

from ..arrays import Array
from ..brdf.combine import Sum
from ..brdf.model import BRDF
from ..samples import ReflectanceSamples
from .model import Fit
from .rules import Rule
from .sharing import Scales, Shared, share_reflectance


@dataclasses.dataclass(frozen=True, eq=False)
class Dichromatic:
    """`material`, the sum of the two parts, whose parameters vary over S sites; the fits of each."""

    material: BRDF
    diffuse: Fit[Shared]
    specular: Fit[Shared]


def share_dichromatic(
    diffuse: Iterable[ReflectanceSamples],
    specular: Iterable[ReflectanceSamples],
    places: Array,
    *,
    regions: Array | None = None,
    centres: int = 2000,
    specular_centres: int = 5000,
    scales: tuple[Scales | None, Scales | None] = (None, None),
    logarithm: bool = True,
    folded: bool = True,
    smooth: bool = True,
    rule: Rule | None = None,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
    until: Callable[[], bool] | None = None,
) -> Dichromatic:
    """Both parts of the BRDF at S sites, from samples of either; the arguments are those of `share_reflectance`.

    scales: of the diffuse part and of the specular one. Raises as `share_reflectance` does.
    """
    total = centres + specular_centres

    def shared(
        part: Iterable[ReflectanceSamples], most: int, own: Scales | None, before: int, body: bool
    ) -> Fit[Shared]:
        return share_reflectance(
            part,
            places,
            regions=regions,
            centres=most,
            scales=own,
            texture=body,
            gray=not body,
            logarithm=logarithm,
            folded=folded,
            smooth=smooth,
            rule=rule,
            seed=seed,
            progress=None if progress is None else lambda done, _: progress(before + done, total),
            until=until,
        )

    body = shared(diffuse, centres, scales[0], 0, True)
    surface = shared(specular, specular_centres, scales[1], centres, False)
    return Dichromatic(Sum((body.value.material, surface.value.material)), body, surface)
