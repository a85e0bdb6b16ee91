"""Images of a shape with one reflectance under any light, by the forward model of `reflection.py`.

    pixel = mean over its rays of  B(x, wo) where the ray meets the shape,  L(ray) where it does not

Light comes straight from the light's beams: an environment map as so many of them that cover it, the same for every
pixel and every run, so that there is no noise. Light between surfaces is not here.

The image is made in tiles, on threads; memory stays bounded by the tiles in work, whatever the image and the samples.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed

import numpy as np

from ..arrays import to_numpy
from ..brdf.model import BRDF
from ..cameras import Camera
from ..errors import MEMORY_LIMIT, AccuracyWarning, ArrayError, MemoryLimitError, ParameterError
from ..lights.environment import Environment
from ..lights.model import Beams, Light
from ..lights.points import Lights
from ..reflection import radiance, textured
from ..shapes.view import Shape
from ..threads import processors

# Neighbouring pixels have neighbouring normals, so that a small tile leaves out nearly half the sky at once; with few
# beams larger tiles waste less on their making.
TILE = 16
LARGEST_TILE = 128
PAIRS = 1 << 21
# Beams taken where the caller names no number, whatever the material wants.
FEWEST, MOST = 256, 8192


def render(
    shape: Shape,
    material: BRDF,
    light: Light,
    camera: Camera,
    *,
    shadows: bool = False,
    samples: int | None = None,
    supersample: int = 1,
    background: bool = True,
    progress: Callable[[int, int], None] | None = None,
    threads: int | None = None,
    out: np.ndarray | None = None,
) -> np.ndarray:
    """The radiance (rows, columns, 3), linear float32, that `camera` sees of `shape`.

    Parameters of `material` that vary over two axes are textures of the shape's uv (`reflection.textured`).

    `shadows` traces whether the shape stands between its points and the light. `samples` is the most beams taken of
    the light for each ray; None takes what the material's narrowest lobe wants (`beams_wanted`), from 256 to 8,192.
    `supersample` is the rays a pixel along each side. Where nothing is met, environments are seen if `background`,
    and black otherwise; `shape.view(camera).mask` tells the two apart.

    `progress(done, total)` is called in pixels, from the calling thread, after each tile. Ctrl-C, and whatever
    `progress` raises, ends the work soon and passes through; finished tiles stand in `out` (rows, columns, 3)
    float32 where one is given, which is then also what is returned.

    Warns with `AccuracyWarning` where an environment is thinned to fewer beams than the material wants. Raises
    `ParameterError` for counts that are not whole numbers from one up, `ArrayError` for an `out` that does not fit,
    `MemoryLimitError` before an image beyond the limit is made.
    """
    environments = [part for part in light.parts if isinstance(part, Environment)]
    wanted = beams_wanted(material) if environments else 1
    if samples is None:
        samples = min(max(wanted, FEWEST), MOST)
    counts = {"samples": samples, "supersample": supersample, "threads": 1 if threads is None else threads}
    for name, value in counts.items():
        if not isinstance(value, int | np.integer) or value < 1:
            raise ParameterError(f"{name} = {value} is not a whole number >= 1.")
    rows, columns = camera.size
    if out is None:
        if 12 * rows * columns > MEMORY_LIMIT:
            raise MemoryLimitError(
                f"an image of {rows} x {columns} takes {12e-9 * rows * columns:.1f} GB, the limit is "
                f"{1e-9 * MEMORY_LIMIT:g}. Ask for fewer pixels, or pass `out`, which may be a numpy.memmap."
            )
        out = np.zeros((rows, columns, 3), dtype=np.float32)
    elif out.shape != (rows, columns, 3) or out.dtype != np.float32:
        raise ArrayError(f"out is {out.dtype} {out.shape}; float32 {(rows, columns, 3)} is wanted.")
    shape.trace(*camera.rays(np.array([[0.5, 0.5]])))  # builds the ray tracer, before threads would each build one
    sources = _sources(light, samples)
    if samples < wanted and any(samples < part.rows * part.columns for part in environments):
        warnings.warn(
            f"the material's narrowest lobe wants about {wanted} beams to see the light whole; with samples={samples} "
            "it may show it in dots. Pass more samples.",
            AccuracyWarning,
            stacklevel=2,
        )
    beams = sum(s.irradiance.shape[-2] if isinstance(s, Beams) else samples for s in sources)
    edge = _edge(beams * supersample**2)

    def tile(corner: tuple[int, int]) -> int:
        r, c = corner
        some = (slice(r, min(r + edge, rows)), slice(c, min(c + edge, columns)))
        x, y = (
            np.arange(part.start * supersample, part.stop * supersample) / supersample + 0.5 / supersample
            for part in (some[1], some[0])
        )
        rays = camera.rays(np.stack(np.meshgrid(x, y), axis=-1))
        colour = _seen(shape, material, light, sources, rays, shadows, samples, background)
        shown = colour.reshape(len(y) // supersample, supersample, len(x) // supersample, supersample, 3)
        out[some] = shown.mean(axis=(1, 3))
        return (some[0].stop - r) * (some[1].stop - c)

    corners = [(r, c) for r in range(0, rows, edge) for c in range(0, columns, edge)]
    done = 0
    pool = ThreadPoolExecutor(processors() if threads is None else threads)
    try:
        for finished in as_completed([pool.submit(tile, corner) for corner in corners]):
            done += finished.result()
            if progress is not None:
                progress(done, rows * columns)
    finally:
        pool.shutdown(cancel_futures=True)
    return out


def beams_wanted(material: BRDF) -> int:
    """How many beams of an environment the narrowest lobe of `material` wants, so as not to tell one from the next.

    K beams lie sqrt(4 pi / K) apart, and a lobe of density p is some sqrt(1 / p) wide: four beams across it are enough
    to the eye. p is the median of 512 samples of a lobe, at normal incidence and at 45 degrees.
    """
    k = np.arange(512)[:, None]
    u = (k * (0.8191725134, 0.6710436067, 0.5497004779)) % 1.0  # Roberts' sequence: even in three dimensions
    material = textured(material, u[:, :2])  # of textures, a texel for each sample
    densest = 0.0
    for wo in (np.array([0.0, 0.0, 1.0]), np.array([math.sqrt(0.5), 0.0, math.sqrt(0.5)])):
        for lobe in material.lobes():
            wi = lobe.sample(wo, u)
            densest = max(densest, float(np.median(to_numpy(lobe.pdf(wi, wo)))))
    return math.ceil(16 * 4 * math.pi * densest)


def _sources(light: Light, samples: int) -> list[Light | Beams]:
    """The beams of all distant lights, made once for the whole image, and the near lights, whose beams differ."""
    near = tuple(part for part in light.parts if not part.distant)
    far = tuple(part for part in light.parts if part.distant)
    sources: list[Light | Beams] = [Lights(near)] if near else []
    return [*sources, Lights(far).beams(budget=max(samples - len(near), 1))] if far else sources


def _seen(
    shape: Shape,
    material: BRDF,
    light: Light,
    sources: list[Light | Beams],
    rays: tuple[np.ndarray, np.ndarray],
    shadows: bool,
    samples: int,
    background: bool,
) -> np.ndarray:
    """What the rays (..., 3) see: (..., 3)."""
    view = shape.trace(*rays)
    m = view.mask
    colour = np.zeros((*m.shape, 3))
    if background and not m.all():
        colour[~m] = _beyond(light, rays[1][~m])
    if m.any():

        def arriving(x: np.ndarray, w: np.ndarray, distance: np.ndarray) -> np.ndarray:
            return ~shape.occluded(x, w, distance)

        sites = view.frames[m], view.wo[m], view.lifted[m]
        visibility = arriving if shadows else None
        where = (None, None) if view.uv is None else (view.uv[m], _footprint(view.uv)[m])
        looked_up = textured(material, *where)
        for source in sources:
            colour[m] += radiance(looked_up, source, *sites, visibility=visibility, budget=samples, threads=1)
    return colour


def _footprint(uv: np.ndarray) -> np.ndarray:
    """The root of the area in (u, v) between neighbouring rays (rows, columns), of their `uv` (rows, columns, 2).

    Along rows and columns the nearer of both neighbours counts, modulo 1: no leap at outlines and seams, and steps of
    more than half a texture are not told. 0 where uv is NaN, or there is no neighbour.
    """
    steps = []
    for axis in (0, 1):
        apart = np.diff(uv, axis=axis)
        apart = np.where(np.isfinite(apart), apart - np.rint(apart), np.inf)
        none = np.full_like(uv[:1] if axis == 0 else uv[:, :1], np.inf)
        before, after = np.concatenate((none, apart), axis), np.concatenate((apart, none), axis)
        nearest = np.where(abs(before).max(-1, keepdims=True) < abs(after).max(-1, keepdims=True), before, after)
        steps.append(np.where(np.isfinite(nearest), nearest, 0.0))
    down, right = steps
    area = abs(down[..., 0] * right[..., 1] - down[..., 1] * right[..., 0])
    return np.asarray(np.sqrt(area))


def _beyond(light: Light, w: np.ndarray) -> np.ndarray | float:
    """Radiance (N, C) that arrives along `w` (N, 3) from beyond the shape; lights without extent are not seen."""
    environments = (part for part in light.parts if isinstance(part, Environment))
    return sum((to_numpy(part.radiance(w)) for part in environments), 0.0)


def _edge(pairs: int) -> int:
    """The tile's side in pixels, a power of two, where each pixel takes `pairs` pairs of a point and a beam."""
    return int(min(max(2 ** round(math.log2(max(PAIRS / pairs, 1)) / 2), TILE), LARGEST_TILE))
