"""How strong each light is, and of what colour, from photographs of a white target under the same lights.

    I = s albedo / pi E(x) n.wi(x),   s = argmin sum |I - s p|,   p = albedo / pi E(x) n.wi(x)
    log I / p = log s + a_1 x + a_2 y + a_3 x^2 + a_4 x y + a_5 y^2        falloff, told too

E of the light as it is told, inverse square included where it is near. s is the median of I / p, weighted by p: so that
dust, scratches and the frames of patches do not count. Not here: what the lens leaves towards the corners
(`Flattened`), and light that the target's surroundings send back.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Array, to_numpy
from ..errors import ArrayError, ParameterError
from ..lights.model import Light
from ..lights.uneven import Uneven, quadratic
from .lighting import Arriving, arriving, scaled
from .model import Capture

_CLIPPED = 0.01  # of the target: more, and the light is brighter than can be told
_REACHED = 0.1  # of the target: less, and the light stands below it
_PIXELS = 1 << 16  # that a falloff is fitted to, at most
_ROUNDS = 50  # of reweighting, at most


def lights_of_white(target: Capture, albedo: Array = 1.0, falloff: bool = False) -> tuple[Light, ...]:
    """The lights of `target`, each with its strength (3,) in the units of the photographs: reflectance is then in 1/sr.

    target: with its lights, distant or near, and its mask on the white; flat and facing +z where its normals are not
        known. albedo: in (0, 1], a number, (3,), or (rows, columns, 3) for coloured patches, NaN where not to be used.
    falloff: fit also how each light falls off over x and y from what it is told to do, as `Uneven`; what light is told
        to be uneven already is corrected. The strength is then that at x = y = 0.

    `dataclasses.replace(capture, lights=lights_of_white(target))` takes them over.

    Raises `ArrayError` where lights are unknown, one does not reach the target, more than 1 % of it is clipped, it is
    black, or too small to tell a falloff; `ParameterError` for another albedo.
    """
    if target.lights is None:
        raise ArrayError("the target's lights are unknown: give them, as distant_lights(directions).")
    rho = _albedo(albedo, target)
    used = np.isfinite(rho).all(axis=1)
    positions = target.positions[target.mask]
    normals = np.array([0.0, 0.0, 1.0]) if target.normals is None else target.normals[target.mask].astype(np.float64)
    return tuple(
        _found(target, k, arriving(light, positions), positions, normals, rho, used, falloff)
        for k, light in enumerate(target.lights)
    )


def _found(
    target: Capture,
    k: int,
    light: Arriving,
    positions: np.ndarray,
    normals: np.ndarray,
    rho: np.ndarray,
    used: np.ndarray,
    falloff: bool,
) -> Light:
    """Light k, which sends `light` to the pixels of the mask, with the strength that the white shows."""
    assert target.lights is not None
    told, name = target.lights[k], target.photographs.names[k]
    radiance, clipped = (image[target.mask] for image in target.photographs.read(k))
    cosine = np.sum(light.direction * normals, axis=1)
    lit = used & (cosine > 0) & (light.irradiance > 0).all(axis=1)
    if not lit.sum() > _REACHED * used.sum():
        raise ArrayError(f"{name}: the light stands below the white target, or is told to be dark.")
    if np.mean(clipped[used]) > _CLIPPED:
        raise ArrayError(f"{name}: {np.mean(clipped[used]):.0%} of the white is clipped: expose less.")
    lit &= ~clipped
    seen = radiance[lit].astype(np.float64)
    foreseen = rho[lit] / math.pi * light.irradiance[lit] * cosine[lit, None]
    strength = np.array([weighted_median(seen[:, c] / foreseen[:, c], foreseen[:, c]) for c in range(3)])
    if not np.all(strength > 0):
        raise ArrayError(f"{name}: the white is black. Was the light on?")
    if not falloff:
        return scaled(told, strength)
    some = np.random.default_rng(0).permutation(len(seen))[:_PIXELS]
    coefficients = _falloff(positions[lit][some], seen[some], foreseen[some], strength, name)
    base = told
    if isinstance(told, Uneven):
        base, coefficients = told.light, coefficients + to_numpy(told.falloff)
    strength = np.exp(coefficients[:, 0])
    coefficients[:, 0] = 0
    return Uneven(scaled(base, strength), coefficients)


def weighted_median(x: np.ndarray, weights: np.ndarray) -> float:
    """The m for which the sum of weights |x - m| is least; x, weights (S,), S > 0."""
    order = np.argsort(x)
    total = np.cumsum(weights[order])
    return float(x[order][np.searchsorted(total, total[-1] / 2)])


def _falloff(
    positions: np.ndarray, seen: np.ndarray, foreseen: np.ndarray, strength: np.ndarray, name: str
) -> np.ndarray:
    """(3, 6), a_0 the logarithm of the strength, from `seen` and `foreseen` (S, 3) at `positions` (S, 3).

    Least squares of the logarithms, which sensor noise spreads by 1 / foreseen; what fits badly loses its weight (Geman
    and McClure 1987).
    """
    # About its middle and in its own extent, or squares of hundreds of texels drown what they are added to.
    middle = (positions.min(axis=0) + positions.max(axis=0)) / 2
    extent = float(np.ptp(positions[:, :2], axis=0).max()) / 2
    terms = quadratic(np, (positions - middle) / (extent or 1.0))
    spread = np.linalg.svd(terms / math.sqrt(len(terms)), compute_uv=False)
    if len(terms) < 6 or spread[-1] < 1e-3:
        raise ArrayError(f"{name}: the white lies in too few places, or along a line: a falloff wants an area.")
    found = np.zeros((3, 6))
    for c in range(3):
        bright = seen[:, c] > 0
        a, y = terms[bright], np.log(seen[bright, c] / foreseen[bright, c])
        exact = foreseen[bright, c] / foreseen[bright, c].mean()
        fit = np.array([math.log(strength[c]), 0, 0, 0, 0, 0])
        for _ in range(_ROUNDS):
            miss, before = (y - a @ fit) * exact, fit
            scale = max(1.4826 * float(np.median(np.abs(miss))), 1e-9)
            weights = (exact / (1 + (miss / (3 * scale)) ** 2)) ** 2
            fit = np.linalg.lstsq(a * np.sqrt(weights)[:, None], y * np.sqrt(weights), rcond=None)[0]
            if np.abs(fit - before).max() < 1e-7:
                break
        found[c] = _in_world(fit, middle[0], middle[1], extent)
    return found


def _in_world(a: np.ndarray, x0: float, y0: float, extent: float) -> np.ndarray:
    """Coefficients over x, y of the quadratic with coefficients `a` (6,) over (x - x0) / extent, (y - y0) / extent."""
    b = a / extent ** np.array([0, 1, 1, 2, 2, 2])
    return np.array(
        (
            b[0] - b[1] * x0 - b[2] * y0 + b[3] * x0**2 + b[4] * x0 * y0 + b[5] * y0**2,
            b[1] - 2 * b[3] * x0 - b[4] * y0,
            b[2] - 2 * b[5] * y0 - b[4] * x0,
            *b[3:],
        )
    )


def _albedo(albedo: Array, target: Capture) -> np.ndarray:
    """(S, 3) on the mask, NaN where not to be used."""
    rho = to_numpy(albedo).astype(np.float64)
    size = target.mask.shape
    if rho.shape not in ((), (3,), (*size, 3)):
        raise ParameterError(f"albedo has shape {rho.shape}; a number, (3,) or {(*size, 3)} is wanted.")
    rho = np.broadcast_to(rho, (*size, 3))[target.mask]
    known = rho[np.isfinite(rho).all(axis=1)]
    if not known.size:
        raise ParameterError("albedo is NaN everywhere on the mask: no pixel is left to tell the lights.")
    if not np.all((known > 0) & (known <= 1)):
        raise ParameterError(f"albedo = {known[~((known > 0) & (known <= 1))][0]:g}; it lies in (0, 1].")
    return rho
