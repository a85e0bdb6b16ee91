"""The lights of a capture, one for each photograph, and what each sends to where.

    distant    wi_k, E_k the same at every point                           Directional
    near       wi = (P_k - x) / |P_k - x|,   E = I_k / |P_k - x|^2         Point, MS 8
    surveyed   one of these, with its falloff as it was measured           Uneven

They are the lights of the forward model, so that what is measured and what is rendered mean the same by them. Not here:
environment maps, under which no photograph has one direction; how bright lights are (`white.py`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..arrays import Array, to_numpy
from ..directions import require_unit
from ..errors import ArrayError, ParameterError
from ..lights.model import Light
from ..lights.points import Directional, Point
from ..lights.uneven import Uneven


class Arriving(NamedTuple):
    """What one light sends to S points: `direction` (S, 3), unit, towards it; `irradiance` (S, 3) on a plane that faces
    it; `distance` (S,), infinite where it is distant."""

    direction: np.ndarray
    irradiance: np.ndarray
    distance: np.ndarray


def distant_lights(directions: Array, irradiances: Array | None = None) -> tuple[Light, ...]:
    """N lights from unit `directions` (N, 3), of `irradiances` (N, 3) or (N,) > 0 on a plane that faces them; else 1.

    Raises `ArrayError` for other shapes or irradiances, `DirectionError` for directions that are not unit.
    """
    w = _rows(directions, "directions")
    require_unit(w, "directions")
    return tuple(
        Directional(direction, E) for direction, E in zip(w, _strengths(irradiances, w, "irradiances"), strict=True)
    )


def near_lights(
    positions: Array, intensities: Array | None = None, axis: Array | None = None, exponent: float = 1.0
) -> tuple[Light, ...]:
    """N lights at `positions` (N, 3), of `intensities` (N, 3) or (N,) > 0: the irradiance at distance 1; else 1.

    axis: (3,) or (N, 3), unit, where lamps point, with the intensity's fall off `exponent` as `Point` has it. Raises
    `ArrayError` for other shapes or intensities, `DirectionError` for an axis that is not unit.
    """
    places = _rows(positions, "positions")
    axes: Sequence[np.ndarray | None] = [None] * len(places)
    if axis is not None:
        given = to_numpy(axis).astype(np.float64)
        axes = list(_rows(np.broadcast_to(given, places.shape) if given.ndim == 1 else given, "axis"))
        if len(axes) != len(places):
            raise ArrayError(f"axis has shape {given.shape}; (3,) or {places.shape} is wanted.")
    strengths = _strengths(intensities, places, "intensities")
    return tuple(Point(p, strength, a, exponent) for p, strength, a in zip(places, strengths, axes, strict=True))


def directions_of(lights: Sequence[Light] | None) -> np.ndarray | None:
    """(N, 3), where all are known and distant; otherwise None."""
    if lights is None or not all(light.distant for light in lights):
        return None
    return np.concatenate([to_numpy(light.beams().directions) for light in lights]).astype(np.float64)


def is_near(light: Light) -> bool:
    """Whether it stands at a place, with a falloff that was measured or without."""
    return isinstance(light.light if isinstance(light, Uneven) else light, Point)


def arriving(light: Light, positions: np.ndarray) -> Arriving:
    """What `light` sends to `positions` (S, 3). Raises `ParameterError` where one lies in the light."""
    beams = light.beams(positions)
    shape = positions.shape
    direction, irradiance, distance = (to_numpy(a) for a in (beams.directions, beams.irradiance, beams.distance))
    return Arriving(
        np.broadcast_to(direction[..., 0, :], shape),
        np.broadcast_to(irradiance[..., 0, :], shape),
        np.broadcast_to(distance[..., 0], shape[:-1]),
    )


def arriving_from(lights: Sequence[Light], positions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What N lights send to `positions` (S, 3): directions and irradiances (N, S, 3), distances (N, S); S is 1 where
    all are distant, since one point stands for all then."""
    some = positions[:1] if all(light.distant for light in lights) else positions
    direction, irradiance, distance = zip(*(arriving(light, some) for light in lights), strict=True)
    return np.stack(direction), np.stack(irradiance), np.stack(distance)


def scaled(light: Light, factor: Array) -> Light:
    """The light `factor`, a number or (3,), times as bright."""
    f = to_numpy(factor)
    if isinstance(light, Directional):
        return dataclasses.replace(light, irradiance=light.irradiance * f)
    if isinstance(light, Point):
        return dataclasses.replace(light, intensity=light.intensity * f)
    if isinstance(light, Uneven):
        return dataclasses.replace(light, light=scaled(light.light, f))
    raise ParameterError(f"{type(light).__name__} is not Directional, Point or Uneven.")


def directions_from(lights: Sequence[Light], place: np.ndarray) -> np.ndarray:
    """(N, 3), unit: where each light stands, seen from `place` (3,)."""
    return np.concatenate([arriving(light, place[None]).direction for light in lights])


def span_space(directions: np.ndarray) -> bool:
    """Whether three or more directions (N, 3) lie in no plane, to a thousandth."""
    return len(directions) >= 3 and bool(np.linalg.svd(directions, compute_uv=False)[2] >= 1e-3)


def one_each(lights: Sequence[Light] | None, photographs: int) -> tuple[Light, ...] | None:
    """The lights, one for each photograph; None where unknown.

    Raises `ArrayError` for another number of them, `ParameterError` where a light is not one beam.
    """
    if lights is None:
        return None
    if len(lights) != photographs:
        raise ArrayError(f"{len(lights)} lights came for {photographs} photographs.")
    for k, light in enumerate(lights):
        if not isinstance(light, Directional | Point | Uneven):
            raise ParameterError(
                f"lights[{k}] is {type(light).__name__}; a photograph's light is Directional, Point or Uneven."
            )
    return tuple(lights)


def _rows(x: Array, name: str) -> np.ndarray:
    rows: np.ndarray = to_numpy(x).astype(np.float64)
    if rows.ndim != 2 or rows.shape[1] != 3 or not len(rows):
        raise ArrayError(f"{name} have shape {rows.shape}; (N, 3) is wanted.")
    return rows


def _strengths(given: Array | None, rows: np.ndarray, name: str) -> np.ndarray:
    values = np.ones(len(rows)) if given is None else to_numpy(given).astype(np.float64)
    if values.shape not in ((len(rows),), rows.shape):
        raise ArrayError(f"{name} have shape {values.shape}; {rows.shape} is wanted.")
    if not np.all(np.isfinite(values) & (values > 0)):
        raise ArrayError(f"{name} are not all positive numbers.")
    return values
