"""What a camera saw once, under any other light: sites, normals and reflectance are known, and nothing is traced.

    B(x) = sum_k f(x, wi_k, wo) E_k max(n.wi_k, 0)          at the pixels of a view
    the same, each f times its confidence, over B           how far to trust it

Not here: shadows that the shape casts, and other places of the eye: `render` with `surface`, which is what is known of
the shape from where it was seen.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Array, to_numpy
from ..brdf.model import BRDF
from ..directions import normalise
from ..errors import ArrayError
from ..frames import frame
from ..lights.model import Light
from ..reflection import radiance, textured
from ..shapes.mesh import Mesh
from ..shapes.pixels import pixel_mesh
from ..shapes.view import View
from .image import FEWEST, MOST, beams_wanted

_SITES = 1 << 14  # between two words of progress


@dataclasses.dataclass(frozen=True, eq=False)
class Relightable:
    """`view`, what a camera sees at its pixels; `material` over its uv; `shape`, a mesh with the same uv, if known."""

    view: View
    material: BRDF
    shape: Mesh | None = None

    def __post_init__(self) -> None:
        if self.view.mask.ndim != 2 or not self.view.mask.any():
            raise ArrayError(f"view has a mask of shape {self.view.mask.shape}; pixels (rows, columns), some seen.")

    @cached_property
    def surface(self) -> Mesh:
        """`shape`, and where that is unknown the mesh of the pixels, with the same uv; leaps in depth are cut."""
        if self.shape is not None:
            return self.shape
        return pixel_mesh(self.view.position, self.view.mask, self.view.normal)

    @cached_property
    def axes(self) -> np.ndarray:
        """Rows (3, 3), unit, world: right, up and towards the eye, as the picture of the view has them."""
        mask = self.view.mask
        pixels = np.argwhere(mask)
        slopes = np.linalg.lstsq(pixels - pixels.mean(axis=0), self.view.position[mask], rcond=None)[0]
        towards = normalise(self.view.wo[mask].mean(axis=0), "the mean of wo")
        return np.asarray(frame(towards, slopes[1]))


def relight(
    thing: Relightable,
    light: Light,
    samples: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """The radiance (rows, columns, 3), float32, of every pixel that sees something, 0 elsewhere.

    samples: the most beams of the light, what the material's lobes want where None. progress(done, total): pixels.
    """
    view = thing.view
    mask = view.mask
    if samples is None:
        samples = min(max(beams_wanted(thing.material), FEWEST), MOST)
    at = np.flatnonzero(mask)
    image = np.zeros((mask.size, 3), np.float32)
    frames, wo = view.frames.reshape(-1, 3, 3), view.wo.reshape(-1, 3)
    lifted = view.lifted.reshape(-1, 3)
    uv = None if view.uv is None else view.uv.reshape(-1, 2)
    for low in range(0, at.size, _SITES):
        some = at[low : low + _SITES]
        material = textured(thing.material, None if uv is None else uv[some])
        image[some] = to_numpy(radiance(material, light, frames[some], wo[some], lifted[some], budget=samples))
        if progress is not None:
            progress(low + some.size, at.size)
    return image.reshape(*mask.shape, 3)


def relit_confidence(
    thing: Relightable,
    light: Light,
    samples: int = FEWEST,
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """How far to trust what `relight` answers, (rows, columns) in [0, 1]: the mean confidence of the light that makes
    up a pixel; 1 where it is black, 0 where nothing is seen. samples, progress: as there, with fewer beams."""
    trusted = Relightable(thing.view, _Trusted(thing.material), thing.shape)
    part = relight(trusted, light, samples, progress).mean(axis=2)
    whole = relight(thing, light, samples).mean(axis=2)
    return np.where(whole > 0, part / np.where(whole > 0, whole, 1), thing.view.mask).astype(np.float32)


@dataclasses.dataclass(frozen=True, eq=False)
class _Trusted(BRDF):
    """`model` as far as it can be trusted."""

    model: BRDF

    def evaluate(self, xp: Any, wi: Array, wo: Array) -> Array:
        return self.model.evaluate(xp, wi, wo) * self.model.confidence(wi, wo)[..., None]

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        return self.model._f(xp, wi, wo) * self.model.confidence(wi, wo)[..., None]
