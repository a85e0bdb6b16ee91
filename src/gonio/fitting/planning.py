"""What photographs of a known shape will tell of its reflectance, said before they are taken: RS 3, of a real capture.

    dtheta       mean angle between neighbouring lights      a, b with no third c: c . (a + b) > 1 + a . b
    dalpha       mean angle between the normals of pixels eight apart, an eighth of it
    highlight    s of exp(-theta_h^2 / (2 s^2)): 2.6 / Omega_theta          texture    pixels a period: 2 pi / Omega_x
    N lights     over a cap of angle a, evenly: 4 pi (1 - cos a) / (sqrt(3) dtheta^2)

RS has lights on an arc; on the sky those are neighbours that have no third in the circle which has them at its ends
(Gabriel and Sokal 1969). On an arc it is each and the next, on a lattice the nearest, and of lights scattered at random
the mean is that of a square lattice as dense: the nearest alone are half as far, and tell nothing of the gaps.
Normals of pixels side by side would tell of noise and of rounding: a degree of noise is more than a ball of a hundred
pixels turns in one. Where a surface is rough in truth, it is as if smooth: its pixels' normals fill the same angles in
another order. Frequencies in space are per pixel, alpha = dalpha x, so that flat and curved surfaces compare; RS 6 is
then Omega_x Omega_theta < pi^2 / dtheta whatever the curvature.

Not here: shadows that a shape casts, noise, and hollows, which show a highlight more than once (RS 8).
"""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from ..arrays import Array, require_finite, to_numpy
from ..directions import normalise, require_unit
from ..errors import ArrayError, DirectionError, ParameterError
from .collecting import SINGLE
from .resolution import Band, flat_band, shared_band, textured_band

_TOLD = 2.6  # Omega s below which 99 % of a lobe's spectrum lies
_SAME = 3  # decimals to which two lights are one
_LEAPS = 0.95  # the part of steps between pixels that are no leap from one surface to another
_SPREAD = 0.95  # the part of normals that a surface's turn is of
_STRIDES = (8, 4, 2, 1)  # pixels over which normals turn; fewer only on what is smaller
_LEVEL, _STILL = 1e-4, 1e-6  # radians that normals turn by rounding, on the whole and from pixel to pixel


@dataclasses.dataclass(frozen=True)
class Told:
    """What samples tell: frequencies within `band`, in space per pixel."""

    band: Band

    @property
    def highlight(self) -> float:
        """The width s, radians, of the narrowest lobe; infinite where none is told."""
        return _TOLD / self.band.angle if self.band.angle > 0 else math.inf

    @property
    def texture(self) -> float:
        """The shortest period, pixels; infinite where no change in space is told."""
        return 2 * math.pi / self.band.space if self.band.space > 0 else math.inf


class Needed(NamedTuple):
    """How many photographs are enough, shared and with each pixel by itself; None where no number is."""

    shared: int | None
    alone: int | None


@dataclasses.dataclass(frozen=True)
class Plan:
    """What N `photographs` tell; angles are radians.

    dtheta: the mean angle between neighbouring lights, infinite for one. dalpha: that by which normals turn from pixel
    to pixel, along rows or columns, whichever is more. turn: twice the angle from their mean within which 95 % of
    normals lie. theta_d: the least and greatest of what is lit. lit: parts of the pixels that face 1, 2, 3 or more
    lights. reach: the angle of the farthest light from the eye.
    """

    photographs: int
    dtheta: float
    dalpha: float
    turn: float
    theta_d: tuple[float, float]
    lit: tuple[float, float, float]
    reach: float

    @property
    def flat(self) -> bool:
        """Whether RS 1 holds: no pixel sees under one light the half angle that another sees under the next."""
        return _flat(self.turn, self.dalpha, self.dtheta)

    @property
    def single(self) -> bool:
        """Whether all photographs are of one theta_d, so that w is dropped (RS 15)."""
        return (self.theta_d[1] - self.theta_d[0]) * 2 / math.pi < SINGLE

    @property
    def shared(self) -> Told | None:
        """RS 5; None for a flat surface, whose pixels have no angles to share."""
        return None if self.flat else _shared(self.dalpha, self.dtheta)

    @property
    def alone(self) -> Told:
        """Each pixel by itself: RS 4, RS 1 where flat."""
        return _alone(self.flat, self.dtheta)

    @property
    def cap(self) -> float:
        """The angle from the eye within which `photographs_for` places lights: the reach of these; pi / 2 of fewer than
        three, which tell nothing of it."""
        return self.reach if self.photographs > 2 else math.pi / 2

    def photographs_for(self, highlight: float = math.inf, texture: float = math.inf) -> Needed:
        """How many lights, evenly over the `cap`, tell lobes as narrow as `highlight` > 0, radians, and textures of a
        period of `texture` >= 2 pixels; where not given, they may be as broad as they like.

        Raises `ParameterError` for other arguments.
        """
        if not highlight > 0:
            raise ParameterError(f"highlight = {highlight:g} is not a positive angle.")
        if not texture >= 2:
            raise ParameterError(f"texture = {texture:g}: a period is two pixels or more.")
        shared = alone = None
        if self.dalpha > _STILL:
            # Nearly flat surfaces share nothing until lights are dense enough for their little turn.
            dtheta = min(texture * self.dalpha, 2 * self.turn if self.flat else math.inf)
            told = _shared(self.dalpha, dtheta)
            if told.highlight <= highlight and told.texture <= texture * (1 + 1e-9):
                shared = self._lights(dtheta)
        dtheta = 2 * math.pi * highlight / _TOLD
        flat = _flat(self.turn, self.dalpha, dtheta) if math.isfinite(dtheta) else self.flat
        if _alone(flat, dtheta).texture <= texture:
            alone = self._lights(dtheta)
        return Needed(shared, alone)

    def _lights(self, dtheta: float) -> int:
        if math.isinf(dtheta):
            return 1
        return max(2, math.ceil(4 * math.pi * (1 - math.cos(self.cap)) / (math.sqrt(3) * dtheta**2)))


def plan_sharing(normals: Array, lights: Array, wo: Array = (0.0, 0.0, 1.0), mask: Array | None = None) -> Plan:
    """What photographs of a shape under `lights` tell, by RS 3.

    normals: (rows, columns, 3), unit on the mask. lights: (N, 3), unit, from the surface, one a photograph; of near
    ones, as the middle of the surface has them. wo: to the eye, unit, (3,) or (rows, columns, 3). mask: (rows, columns)
    bool; otherwise where normals are finite and not 0.

    Raises `ArrayError` for shapes that do not fit and masks without two neighbouring pixels, `DirectionError` for
    directions that are not unit and where no pixel is lit.
    """
    n, inside = _checked(normals, mask)
    w = to_numpy(lights).astype(np.float64)
    if w.ndim != 2 or w.shape[1] != 3 or not len(w):
        raise ArrayError(f"lights have shape {w.shape}; (N, 3) is wanted.")
    require_unit(w, "lights")
    w = normalise(w)
    eye = to_numpy(wo).astype(np.float64)
    if eye.shape not in ((3,), n.shape):
        raise ArrayError(f"wo has shape {eye.shape}; (3,) or {n.shape} is wanted.")
    facing = n[inside]
    eye = eye[inside] if eye.ndim == 3 else eye[None]
    require_unit(eye, "wo")
    middle = normalise(eye.mean(axis=0))
    mean = facing.mean(axis=0)
    if not np.linalg.norm(mean) > _LEVEL:
        raise DirectionError("normals point everywhere alike: give those that one camera sees.")
    count, bounds = np.zeros(len(facing), int), []
    seen = np.sum(facing * eye, axis=1) > 0
    for light in w:
        lit = facing @ light > 0
        count += lit
        lit &= seen
        if lit.any():
            theta_d = _between(light, eye if len(eye) == 1 else eye[lit]) / 2
            bounds += [theta_d.min(), theta_d.max()]
    if not bounds:
        raise DirectionError("no pixel that faces the eye faces a light: are lights directions from the surface?")
    pairs = neighbours(w)
    return Plan(
        photographs=len(w),
        dtheta=float(_between(w[pairs[:, 0]], w[pairs[:, 1]]).mean()) if len(pairs) else math.inf,
        dalpha=_turning(n, inside),
        turn=2 * float(np.quantile(_between(normalise(mean), facing), _SPREAD)),
        theta_d=(float(min(bounds)), float(max(bounds))),
        lit=tuple(float(np.mean(count >= k)) for k in (1, 2, 3)),  # type: ignore[arg-type]
        reach=float(_between(middle, w).max()),
    )


def neighbours(lights: np.ndarray) -> np.ndarray:
    """Pairs (P, 2) of the unit `lights` (N, 3) that have no third in the circle between them; of lights that are the
    same the first counts."""
    first = np.sort(np.unique(np.round(lights, _SAME), axis=0, return_index=True)[1])
    w = lights[first]
    cosine, pairs = w @ w.T, []
    for i in range(len(w) - 1):
        # c lies within where c . m > cos(half the angle), m = (a + b) / |a + b| and |a + b| = 2 cos(half of it).
        free = ~np.any((w[i] + w[i + 1 :]) @ w.T > 1 + cosine[i, i + 1 :, None] + 1e-9, axis=1)
        pairs += [(first[i], first[j]) for j in i + 1 + np.flatnonzero(free)]
    return np.array(pairs, int).reshape(-1, 2)


def _flat(turn: float, dalpha: float, dtheta: float) -> bool:
    # One photograph is of all half angles that there are on the surface: there is no next one to reach.
    return dalpha <= _STILL or turn < (dtheta / 2 if math.isfinite(dtheta) else _LEVEL)


def _shared(dalpha: float, dtheta: float) -> Told:
    band = shared_band(dalpha, dtheta)
    # RS has lights far apart beside pixels; where they are not, pixels are what limits texture.
    return Told(Band(min(band.space * dalpha, math.pi / 2), band.angle))


def _alone(flat: bool, dtheta: float) -> Told:
    return Told(flat_band(1.0, dtheta) if flat else textured_band(1.0, dtheta))


def _turning(n: np.ndarray, inside: np.ndarray) -> float:
    """dalpha. Not by medians, which would be 0 for normals in few bits."""
    for stride in _STRIDES:
        means = []
        for m, on in ((n, inside), (n.swapaxes(0, 1), inside.T)):
            both = on[stride:] & on[:-stride]
            if both.any():
                angles = _between(m[stride:][both], m[:-stride][both])
                means.append(float(angles[angles <= np.quantile(angles, _LEAPS)].mean()) / stride)
        if means:
            return max(means)
    raise ArrayError("no two neighbouring pixels are on the mask: how far normals turn is unknown.")


def _between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles between unit vectors; arccos loses the small ones."""
    chord = np.sqrt(np.sum((a - b) ** 2, axis=-1))
    return np.asarray(2 * np.arcsin(np.minimum(chord / 2, 1)))


def _checked(normals: Array, mask: Array | None) -> tuple[np.ndarray, np.ndarray]:
    n = to_numpy(normals).astype(np.float64)
    if n.ndim != 3 or n.shape[2] != 3:
        raise ArrayError(f"normals have shape {n.shape}; (rows, columns, 3) is wanted.")
    inside = np.any(np.isfinite(n) & (n != 0), axis=2) if mask is None else to_numpy(mask)
    if inside.shape != n.shape[:2] or inside.dtype != bool:
        raise ArrayError(f"mask has shape {inside.shape} and dtype {inside.dtype}; bool {n.shape[:2]} is wanted.")
    if not inside.any():
        raise ArrayError("no pixel is on the mask.")
    require_finite(n[inside], "normals on the mask")
    require_unit(n[inside], "normals on the mask")
    n[inside] = normalise(n[inside])
    return n, inside
