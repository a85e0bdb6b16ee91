"""What a camera saw once, under any other light: sites, normals and reflectance are known, and nothing is traced.

    B(x) = sum_k f(x, wi_k, wo) E_k max(n.wi_k, 0)          at the pixels of a view
    the same, each f times its confidence, over B           how far to trust it

and, where photographs of the view were kept, what they show beyond the model (`residuals.py`).

Not here: other places of the eye: `render` with `surface`, which is what is known of the shape from where it was seen.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Array, to_numpy
from ..brdf.model import BRDF
from ..directions import normalise
from ..errors import MEMORY_LIMIT, ArrayError, MemoryLimitError, ParameterError
from ..frames import frame
from ..lights.model import Light
from ..reflection import radiance, textured
from ..shapes.mesh import Mesh
from ..shapes.pixels import pixel_mesh
from ..shapes.view import View
from .image import FEWEST, MOST, beams_wanted
from .residuals import Residuals

_SITES = 1 << 14  # between two words of progress


@dataclasses.dataclass(frozen=True, eq=False)
class Relightable:
    """`view`, what a camera sees at its pixels; `material` over its uv; `shape`, a mesh with the same uv, if known;
    `residuals`, what photographs of the view show beyond the material, if they are kept."""

    view: View
    material: BRDF
    shape: Mesh | None = None
    residuals: Residuals | None = None

    def __post_init__(self) -> None:
        if self.view.mask.ndim != 2 or not self.view.mask.any():
            raise ArrayError(f"view has a mask of shape {self.view.mask.shape}; pixels (rows, columns), some seen.")
        if self.residuals is not None and self.residuals.images.shape[1] != np.count_nonzero(self.view.mask):
            raise ArrayError(
                f"residuals are of {self.residuals.images.shape[1]} pixels, the view sees "
                f"{np.count_nonzero(self.view.mask)}."
            )

    @cached_property
    def surface(self) -> Mesh:
        """`shape`, and where that is unknown the mesh of the pixels, with the same uv; leaps in depth are cut."""
        if self.shape is not None:
            return self.shape
        return pixel_mesh(self.view.position, self.view.mask, self.view.normal)

    @property
    def caster(self) -> Mesh | None:
        """What casts shadows: `shape`, where it is known and no residuals hold the shadows that there were."""
        return self.shape if self.residuals is None else None

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
    shadows: bool = False,
) -> np.ndarray:
    """The radiance (rows, columns, 3), float32, of every pixel that sees something, 0 elsewhere.

    samples: the most beams of the light, what the material's lobes want where None. progress(done, total): pixels.
    shadows: those that `thing.caster` casts.
    Near lights go without residuals, and nothing is below 0 with them.
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
    shape = thing.caster if shadows else None

    def arriving(x: np.ndarray, w: np.ndarray, distance: np.ndarray) -> np.ndarray:
        assert shape is not None
        return ~shape.occluded(x, w, distance)

    visibility = None if shape is None else arriving
    for low in range(0, at.size, _SITES):
        some = at[low : low + _SITES]
        material = textured(thing.material, None if uv is None else uv[some])
        where = frames[some], wo[some], lifted[some]
        image[some] = to_numpy(radiance(material, light, *where, visibility=visibility, budget=samples))
        if progress is not None:
            progress(low + some.size, at.size)
    if thing.residuals is not None:
        image[at] = np.maximum(image[at] + thing.residuals.under(light, samples), 0)
    return image.reshape(*mask.shape, 3)


def with_residuals(
    thing: Relightable, lights: Sequence[Light], photographs: Iterable[tuple[np.ndarray, np.ndarray]]
) -> Relightable:
    """`thing`, that looks as `photographs` of its view do under their `lights`, nearly, and nearer between them.

    photographs: radiance (rows, columns, 3) and whether it is clipped (rows, columns), where nothing is known; one for
    each light, directional. They are read one at a time, and take 12 bytes a pixel each.

    Raises `ArrayError` where they do not fit, `ParameterError` for lights that are near, or no single direction, or
    dark, `MemoryLimitError` for more than 4 GB.
    """
    mask = thing.view.mask
    if 12 * len(lights) * np.count_nonzero(mask) > MEMORY_LIMIT:
        raise MemoryLimitError(
            f"residuals of {len(lights)} photographs with {np.count_nonzero(mask)} pixels take more than "
            f"{MEMORY_LIMIT / 1e9:g} GB; keep fewer of them."
        )
    bare = dataclasses.replace(thing, residuals=None)
    directions, images, levels = [], [], []
    for k, (light, (photograph, clipped)) in enumerate(zip(lights, photographs, strict=True)):
        beams = light.beams() if light.distant else None
        if beams is None or len(beams.directions) != 1 or not np.all(to_numpy(beams.irradiance) > 0):
            raise ParameterError(f"lights[{k}] is no directional light with irradiance above 0: residuals want such.")
        if photograph.shape != (*mask.shape, 3) or clipped.shape != mask.shape:
            raise ArrayError(f"photographs[{k}] has shape {photograph.shape}; {(*mask.shape, 3)} is wanted.")
        strength = to_numpy(beams.irradiance)[0]
        left = np.where(clipped[..., None], 0, photograph - relight(bare, light))[mask] / strength
        directions.append(to_numpy(beams.directions)[0])
        images.append(left.astype(np.float32))
        levels.append(max(float(np.sqrt(np.mean((photograph[mask] / strength) ** 2))), 1e-30))
    residuals = Residuals.of(np.array(directions), np.array(images), np.array(levels))
    return dataclasses.replace(thing, residuals=residuals)


def relit_confidence(
    thing: Relightable,
    light: Light,
    samples: int = FEWEST,
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """How far to trust what `relight` answers, (rows, columns) in [0, 1]: the mean confidence of the light that makes
    up a pixel; 1 where it is black, 0 where nothing is seen. samples, progress: as there, with fewer beams."""
    trusted, bare = (Relightable(thing.view, model) for model in (_Trusted(thing.material), thing.material))
    part = relight(trusted, light, samples, progress).mean(axis=2)
    whole = relight(bare, light, samples).mean(axis=2)
    return np.where(whole > 0, part / np.where(whole > 0, whole, 1), thing.view.mask).astype(np.float32)


@dataclasses.dataclass(frozen=True, eq=False)
class _Trusted(BRDF):
    """`model` as far as it can be trusted."""

    model: BRDF

    def evaluate(self, xp: Any, wi: Array, wo: Array) -> Array:
        return self.model.evaluate(xp, wi, wo) * self.model.confidence(wi, wo)[..., None]

    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        return self.model._f(xp, wi, wo) * self.model.confidence(wi, wo)[..., None]
