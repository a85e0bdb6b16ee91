"""The forward model: the radiance that surface points send to the eye under any light. There is no other.

    B(x, wo) = sum_k f(wi_k, wo) E_k max(n.wi_k, 0) V_k

over the beams of a light (`lights/model.py`): direction wi_k, irradiance E_k on a facing plane, visibility V_k.
Fitting and rendering both call `radiance`, so that they can disagree about nothing. Light that surfaces send to each
other is not here.

The work goes in blocks of sites and beams that fit the cache; beams that no site of a block can see are left out
first. Blocks are independent and each is summed in the beams' order: the result does not depend on `threads`.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeAlias, TypeVar

import numpy as np
from scipy import ndimage

from .arrays import Array, floats, is_numpy, like, namespace, require_finite, to_numpy
from .brdf.model import BRDF, Parametric
from .directions import dot, require_unit
from .errors import ArrayError, ParameterError
from .frames import require_rotation
from .lights.model import Beams, Light
from .threads import processors

# Pairs of a site and a beam in one block: their directions and values fit a core's cache.
PAIRS = 1 << 14
SITES = 256

# (positions (N, 3), directions (N, 3), distance (N,)) -> (N,), as NumPy arrays: 1 or True where light arrives.
Visibility: TypeAlias = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]

_Beams: TypeAlias = Callable[[slice], Beams]
Model = TypeVar("Model", bound=Parametric)


def radiance(
    brdf: BRDF,
    light: Light | Beams,
    frames: Array,
    wo: Array,
    positions: Array | None = None,
    *,
    visibility: Array | Visibility | None = None,
    budget: int | None = None,
    threads: int | None = None,
) -> Array:
    """B (..., C) that sites with `frames` (..., 3, 3) send along unit `wo` (..., 3), both in the world frame.

    `frames` hold s, t, n in their rows (`gn.frame`). Parameters of `brdf` may vary over the sites' axes (...).
    `positions` (..., 3) are needed where the light is near or `visibility` is a function. `visibility` is an array
    (..., K) in [0, 1] over the beams, or a function of points, directions and distances that says what arrives (for
    a shape: `lambda x, w, d: ~shape.occluded(x, w, d)`, from `lifted` points); all arrives where it is None.
    `budget` is the most beams taken of a light, `threads` the most threads (default: all processors).

    Library, device and dtype are those of `frames` and `wo`; tensors keep their gradients.
    Raises `ArrayError` for shapes that do not fit or values that are not finite, `DirectionError` for directions
    that are not unit and frames that are not rotations.
    """
    require_rotation(frames, "frames")
    require_unit(wo, "wo")
    xp, frames, wo = floats(frames, wo)
    sites = _sites(frames, wo)
    count = math.prod(sites)
    frames = xp.reshape(xp.broadcast_to(frames, (*sites, 3, 3)), (count, 3, 3))
    wo = xp.reshape(xp.broadcast_to(wo, (*sites, 3)), (count, 3))
    if positions is not None:
        positions = _flat(like(positions, frames), sites, (3,), "positions")
    distant = isinstance(light, Beams) or light.distant
    if positions is None and (not distant or callable(visibility)):
        raise ArrayError("positions are needed: the light is near, or visibility is traced from them.")
    if count == 0:
        return xp.reshape(xp.zeros_like(wo), (*sites, 3))

    beams = _beams(light, positions, budget, wo)
    rays = int(beams(slice(0, 1)).directions.shape[-2])
    if visibility is not None and not callable(visibility):
        visibility = _flat(like(visibility, frames), sites, (rays,), "visibility")
    brdf = varied(brdf, lambda value, axes: _flat(value, sites, tuple(value.shape[axes:]), "a parameter"))

    step = min(max(SITES, PAIRS // max(rays, 1)), count)
    parts = [slice(start, start + step) for start in range(0, count, step)]
    block = functools.partial(_block, xp, brdf, beams, frames, wo, positions, visibility)
    workers = min(len(parts), processors() if threads is None else threads)
    if workers > 1 and is_numpy(frames):
        with ThreadPoolExecutor(workers) as pool:
            found = list(pool.map(block, parts))
    else:
        found = [block(part) for part in parts]
    total = xp.concat(found, axis=0)
    return xp.reshape(total, (*sites, total.shape[-1]))


def varied(
    model: Model,
    change: Callable[[Array, int], Array],
    whole: Callable[[Parametric], Parametric | None] = lambda model: None,
) -> Model:
    """`model` with each parameter that varies over sites replaced by `change(value, axes)`; terms within it too.

    `axes` is how many leading axes of `value` are the sites'. A model or term that `whole` has an answer for is
    replaced by it as a whole. A model without such parameters is returned as it is.
    """
    if (instead := whole(model)) is not None:
        return instead  # type: ignore[return-value]
    changed: dict[str, Any] = {}
    for field in dataclasses.fields(model):  # type: ignore[arg-type]
        value = getattr(model, field.name)
        new = value
        if isinstance(value, Parametric):
            new = varied(value, change, whole)
        elif isinstance(value, tuple):
            new = tuple(varied(v, change, whole) if isinstance(v, Parametric) else v for v in value)
            new = value if all(a is b for a, b in zip(new, value, strict=True)) else new
        elif field.name in model.bounds and value is not None:
            axes = model.bounds[field.name].axes(value)
            new = change(value, axes) if axes > 0 else value
        if new is not value:
            changed[field.name] = new
    return dataclasses.replace(model, **changed) if changed else model  # type: ignore[type-var]


def textured(model: Model, uv: Array | None, width: Array | None = None) -> Model:
    """`model` at N sites with texture coordinates `uv` (N, 2): parameters that vary over two axes are textures.

    A texture is (rows, columns), or (rows, columns, C) of a colour, row 0 at v = 1; between texels' centres it is
    bilinear, beyond the outermost constant. `width` (N,), the root of each footprint's area in (u, v), is for terms
    with levels of averages (`FacetMixture.at`); other parameters are looked up at the point. Raises `ParameterError`
    for a parameter that varies over other axes, or where there is no uv to look it up by.
    """

    def looked_up(value: Array, axes: int) -> np.ndarray:
        texture = to_numpy(value)
        if axes != 2:
            raise ParameterError(f"a parameter of shape {texture.shape} is neither one value nor a texture (v, u).")
        if uv is None:
            raise ParameterError("the material has textures, but the shape no uv to look them up by.")
        rows, columns = texture.shape[:2]
        u, v = to_numpy(uv).T
        place = np.stack(((1 - v) * rows - 0.5, u * columns - 0.5))
        layers = np.moveaxis(texture.reshape(rows, columns, -1), -1, 0)
        found = [ndimage.map_coordinates(layer, place, order=1, mode="nearest") for layer in layers]
        return np.stack(found, axis=-1).reshape(-1, *texture.shape[2:])

    return varied(model, looked_up, lambda term: term.at(uv, width))


def _block(
    xp: Any,
    brdf: BRDF,
    beams: _Beams,
    frames: Array,
    wo: Array,
    positions: Array | None,
    visibility: Array | Visibility | None,
    part: slice,
) -> Array:
    """B (P, C) of the sites in `part`. Pairs have shape (K, P): beams first, so that sites' parameters broadcast."""
    brdf = varied(brdf, lambda value, axes: value[part])
    frames, wo = frames[part], wo[part]
    sites = wo.shape[0]
    wo = (frames @ wo[..., None])[..., 0]
    beam = beams(part)
    directions, irradiance, distance = beam.directions, beam.irradiance, beam.distance
    seen = None if visibility is None or callable(visibility) else xp.permute_dims(visibility[part], (1, 0))
    distant = directions.ndim == 2
    if distant:
        kept = _above(xp, directions, frames[:, 2, :])
        if kept is not None:
            directions, irradiance, distance = directions[kept], irradiance[kept], distance[kept]
            seen = None if seen is None else seen[kept]
        axes = xp.permute_dims(xp.reshape(frames, (3 * sites, 3)), (1, 0))
    else:
        directions, irradiance = xp.permute_dims(directions, (1, 0, 2)), xp.permute_dims(irradiance, (1, 0, 2))
        distance = xp.permute_dims(distance, (1, 0))
    total = xp.zeros_like(wo[..., :1])
    step = max(1, PAIRS // sites)
    for start in range(0, directions.shape[0], step):
        some = slice(start, start + step)
        w = directions[some]
        if distant:
            wi = xp.reshape(w @ axes, (w.shape[0], sites, 3))
        else:
            wi = (frames @ w[..., None])[..., 0]
        weight = xp.clip(wi[..., 2], 0.0, None)
        if seen is not None:
            weight = weight * seen[some]
        elif callable(visibility):
            weight = weight * _arriving(visibility, positions[part], w, distance[some], weight)  # type: ignore[index]
        f = brdf.evaluate(xp, wi, wo)
        total = total + _summed(xp, f, weight, irradiance[some])
    return total


def _summed(xp: Any, f: Array, weight: Array, E: Array) -> Array:
    """sum_k f_k weight_k E_k, (P, C), of f (K, P, C), weight (K, P) and E (K, C) for all sites or (K, P, C)."""
    if E.ndim == 3:
        return xp.sum(f * weight[..., None] * E, axis=0)
    # One matrix product a channel: no temporary of the size of f and E together.
    if f.shape[-1] == 1:
        return xp.permute_dims(xp.permute_dims(E, (1, 0)) @ (f[..., 0] * weight), (1, 0))
    colours = range(f.shape[-1])
    return xp.stack(tuple(E[:, c % E.shape[-1]] @ (f[..., c] * weight) for c in colours), axis=-1)


def _above(xp: Any, directions: Array, normals: Array) -> Array | None:
    """Which of the beams (K, 3) stand above the horizon of any of the normals (P, 3); None where it does not pay."""
    axis = xp.sum(normals, axis=0)
    length = xp.sqrt(dot(axis, axis))
    if directions.shape[0] < 16 or float(length) < 0.5 * normals.shape[0]:
        return None
    # All normals lie in a cone about their mean: beyond its half angle below the horizon nothing is lit.
    axis = axis / length
    cosine = xp.min(xp.clip(normals @ axis, 0.0, 1.0))
    return directions @ axis > -(xp.sqrt(1 - cosine * cosine) + 1e-3)


def _arriving(visible: Visibility, positions: Array, w: Array, distance: Array, weight: Array) -> Array:
    """V (K, P) for the pairs that `weight` (K, P) says are lit, 0 for the others, where nothing is traced."""
    pairs = to_numpy(weight) > 0
    beam, site = np.nonzero(pairs)
    towards, far = to_numpy(w), to_numpy(distance)
    near = towards.ndim == 3
    arrives = np.zeros(pairs.shape)
    arrives[pairs] = visible(
        to_numpy(positions)[site],
        towards[beam, site] if near else towards[beam],
        far[beam, site] if near else far[beam],
    )
    return like(arrives, weight)


def _beams(light: Light | Beams, positions: Array | None, budget: int | None, reference: Array) -> _Beams:
    """The beams at the sites of a slice, as arrays like `reference`; made once where they are the same for all."""
    if not isinstance(light, Beams) and not light.distant:
        return lambda part: _checked(light.beams(None if positions is None else positions[part], budget), reference)
    common = _checked(light if isinstance(light, Beams) else light.beams(budget=budget), reference)
    if common.directions.ndim != 2:
        raise ArrayError(f"beams of shape {tuple(common.directions.shape)}: pass the light itself where it is near.")
    return lambda part: common


def _sites(frames: Array, wo: Array) -> tuple[int, ...]:
    try:
        return np.broadcast_shapes(tuple(frames.shape[:-2]), tuple(wo.shape[:-1]))
    except ValueError as error:
        raise ArrayError(
            f"frames {tuple(frames.shape)} and wo {tuple(wo.shape)} do not belong to the same sites."
        ) from error


def _flat(x: Array, sites: tuple[int, ...], tail: tuple[int, ...], name: str) -> Array:
    """`x` broadcast to (*sites, *tail), with the sites' axes made one."""
    xp = namespace(x)
    try:
        x = xp.broadcast_to(x, (*sites, *tail))
    except (ValueError, RuntimeError) as error:
        raise ArrayError(f"{name} of shape {tuple(x.shape)} does not fit; {(*sites, *tail)} is wanted.") from error
    return xp.reshape(x, (-1, *tail))


def _checked(beams: Beams, reference: Array) -> Beams:
    """The beams as arrays of the sites' library and dtype."""
    require_finite(beams.irradiance, "the light's irradiance")
    require_unit(beams.directions, "the light's directions")
    return Beams(*(like(x, reference) for x in (beams.directions, beams.irradiance, beams.distance)))
