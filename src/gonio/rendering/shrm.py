"""Spherical harmonic reflection maps: what an isotropic BRDF makes of an environment, for all normals and views.

RH 5.4:

    B(n, wo) = sum over lobes of g(theta_o) sum over p, s of b_ps(a) Y_ps(wo),     a = n or the mirror direction of wo

wo is in the world's frame (the global form of RH 5.11), so that for a distant eye the sum over p, s is one reflection
map (RH 5.35). Each lobe of the BRDF is expanded by itself, about what suits it; `orders.py` chooses about what, and how
far. Maps are made from their coefficients (`sphere/reflected.py`), which are what is kept, turned and written.

Shadows, near light and light between surfaces are not here.
"""

from __future__ import annotations

import dataclasses
import math
import warnings
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from .._kernels import expansion as kernels
from ..arrays import Array, floats, frozen, is_numpy, like, require_broadcast, to_numpy
from ..brdf.harmonic import ExitLobes, exit_lobes
from ..brdf.model import BRDF
from ..directions import dot, from_spherical, reflect, require_unit
from ..errors import AccuracyWarning, PhysicsWarning
from ..lights.environment import Environment
from ..sphere import splines
from ..sphere.grids import LatLong
from ..sphere.harmonics import degree_of, degrees_and_orders, harmonics, power_spectrum
from ..sphere.reflected import world_coefficients
from ..sphere.rotation import rotate
from ..sphere.transform import synthesis
from .orders import GRAZING, About, expansion, light_field_energy, on_grid, require_share, unseen

_DEGREES = 32, 128  # harmonics of the light at first, and at most
_EXITS = 48  # angles at which a BRDF is looked at


@dataclasses.dataclass(frozen=True, eq=False)
class ReflectedLobe:
    """What one lobe of a BRDF reflects. coefficients: ((J+1)^2, (P+1)^2, C), real harmonics of a and of wo.

    `exit_cosine`: they are those of B cos theta_o. `degree`: F, the light's; J = F + P.
    """

    coefficients: Array
    about: About
    exit_cosine: bool

    @property
    def exit_degree(self) -> int:
        """P."""
        return math.isqrt(self.coefficients.shape[1]) - 1

    @property
    def degree(self) -> int:
        """F."""
        return degree_of(self.coefficients) - self.exit_degree

    def radiance(self, n: Array, wo: Array) -> Array:
        """B (N, C) at unit normals and directions to the eye (N, 3); arrays of any library, by the series itself."""
        _, n, wo = floats(n, wo)
        return self.series(n, wo, harmonics(self.exit_degree, wo))

    def series(self, n: Array, wo: Array, eye: Array) -> Array:
        """The same with `eye` (N, (P+1)^2) in place of the harmonics of wo."""
        c = like(self.coefficients, n) if is_numpy(self.coefficients) else self.coefficients
        facing = harmonics(degree_of(c), self.axis(n, wo))
        terms = (facing @ c.reshape(c.shape[0], -1)).reshape(-1, *c.shape[1:])
        return self._gain(n, wo)[:, None] * (eye[:, :, None] * terms).sum(axis=1)

    def axis(self, n: Array, wo: Array) -> Array:
        """The direction a that it stands about, (N, 3)."""
        return reflect(wo, n) if self.about is About.MIRROR else n

    def maps(self, rows: int) -> np.ndarray:
        """b_ps on a lat-long grid, (rows, 2 rows, (P+1)^2, C)."""
        c = to_numpy(self.coefficients)
        flat = synthesis(c.reshape(c.shape[0], -1), LatLong(rows, 2 * rows))
        return to_numpy(flat).reshape(rows, 2 * rows, *c.shape[1:])

    def seen_from(self, wo: Array, rows: int) -> np.ndarray:
        """sum of b_ps Y_ps(wo) for one distant eye, (rows, 2 rows, C): B by a, without g. RH 5.35."""
        c = to_numpy(self.coefficients)
        one = np.einsum("jtc,t->jc", c, harmonics(self.exit_degree, to_numpy(wo)))
        return to_numpy(synthesis(one.astype(c.dtype), LatLong(rows, 2 * rows)))

    def rotated(self, rotation: Array) -> ReflectedLobe:
        """Turned with its light: B'(R n, R wo) = B(n, wo)."""
        c = self.coefficients
        terms = c.shape[1]
        facing = rotate(c.reshape(c.shape[0], -1), rotation).reshape(c.shape)
        both = rotate(facing.swapaxes(0, 1).reshape(terms, -1), rotation)
        return dataclasses.replace(self, coefficients=both.reshape(terms, c.shape[0], -1).swapaxes(0, 1))

    def _gain(self, n: Array, wo: Array) -> Array:
        xp, cosine = floats(dot(n, wo))
        return 1 / xp.clip(cosine, GRAZING, None) if self.exit_cosine else xp.ones_like(cosine)

    @cached_property
    def _rows(self) -> int:
        """Rows between whose splines look-ups miss .2 % rms of what the maps hold, or as many as carry them."""
        degree = degree_of(self.coefficients)
        j = degrees_and_orders(degree)[0]
        energy = (to_numpy(self.coefficients).astype(np.float64) ** 2).sum(axis=(1, 2))
        rows = 4 * (degree // 4 + 2)
        while np.sum(energy * splines.relative_error(j, rows) ** 2) > 0.002**2 * np.sum(energy):
            rows += 4
        return rows

    @cached_property
    def _sheet(self) -> np.ndarray:
        """The maps as splines."""
        c = to_numpy(self.coefficients)
        return splines.sheet(c.reshape(c.shape[0], -1), self._rows)

    def _look_up(self, n: np.ndarray, wo: np.ndarray, eyes: np.ndarray) -> np.ndarray:
        out = np.empty((len(n), self.coefficients.shape[2]), self._sheet.dtype)
        axis = np.ascontiguousarray(self.axis(n, wo), dtype=np.float64)
        gain = np.broadcast_to(self._gain(n, wo), len(n)).astype(np.float64)
        degree = self.exit_degree
        where = self._sheet, splines.BORDER, 2 * self._rows
        kernels.look_up(*where, degree, recursion(degree), axis, eyes, gain, out)
        return out


@dataclasses.dataclass(frozen=True, eq=False)
class SHRM:
    """The reflected light field of a BRDF under an environment, by its lobes.

    `error`: relative rms of pictures of a ball, averaged over views, that the series leave out (`orders.py`); look-ups
    add .002. `made`: how it was made, in words.
    """

    lobes: tuple[ReflectedLobe, ...]
    error: float
    made: str = ""

    def radiance(self, n: Array, wo: Array) -> Array:
        """B (..., C) at unit world normals n and directions wo to the eye, (..., 3) each, broadcast; one wo is far.

        NumPy arrays are looked up in the maps; those of other libraries take the series itself, which is slower and
        carries gradients. 0 where the eye is below the surface. A series may fall below 0 where little light is
        reflected; it is cut there, which only brings it nearer to the truth.

        Raises `DirectionError` where n or wo are not unit, `ArrayError` where they do not broadcast.
        """
        require_unit(n, "n")
        require_unit(wo, "wo")
        xp, n, wo = floats(n, wo)
        require_broadcast(n=n, wo=wo)
        far = wo.ndim == 1 or math.prod(wo.shape[:-1]) == 1
        eye = xp.reshape(wo, (-1, 3))[:1, :]
        n, wo = xp.broadcast_arrays(n, wo)
        shape = n.shape[:-1]
        n, wo = xp.reshape(n, (-1, 3)), xp.reshape(wo, (-1, 3))
        total: Any = 0.0
        for lobe in self.lobes:
            if is_numpy(n, wo, lobe.coefficients):
                eyes = np.ascontiguousarray(eye if far else wo, dtype=np.float64)
                total = total + lobe._look_up(n, wo, eyes)
            else:
                total = total + lobe.radiance(n, wo)
        seen = (dot(n, wo) > 0)[:, None]
        return xp.reshape(xp.where(seen & (total > 0), total, xp.zeros_like(total)), (*shape, -1))

    def rotated(self, rotation: Array) -> SHRM:
        """The light turned by `rotation` (3, 3): B'(R n, R wo) = B(n, wo). Raises `DirectionError` if it is none."""
        return dataclasses.replace(self, lobes=tuple(lobe.rotated(rotation) for lobe in self.lobes))


def prefilter(light: Environment, brdf: BRDF, error: float = 0.01) -> SHRM:
    """The SHRM of an isotropic BRDF, measured ones included, under `light`, with degrees chosen by `error`.

    `error` is the relative rms of pictures of a ball that the series may leave out; `SHRM.error` tells what they do.
    Warns with `AccuracyWarning` where it is not reached with P = 6 and F = 128, or with the light's own rows: mostly by
    glossy lobes whose Fresnel reflection is strongest at grazing angles, where lobes change fastest; with
    `PhysicsWarning` of a BRDF that reflects more than it receives, or is not reciprocal. It is taken as it is.

    Raises `ParameterError` for an error that is not between 0 and 1, for a BRDF that is not isotropic or whose
    parameters vary, and for lights that are no environments.
    """
    require_share(error)
    light = on_grid(light)
    models = brdf.lobes()
    highest = min(_DEGREES[1], light.rows - 1)
    degree = min(_DEGREES[0], highest)
    while True:
        coefficients = to_numpy(light.harmonics(degree))
        power = power_spectrum(coefficients.astype(np.float64))
        seen = [exit_lobes(model, degree, _EXITS) for model in models]
        energy = sum(float(np.sum(light_field_energy(lobes, power))) for lobes in seen)
        beyond = [float(np.sum(unseen(lobes, power))) for lobes in seen]
        # What lobes leave out may add up: each has its part of the error, not of its square.
        budget = (error / len(models)) ** 2 * energy
        chosen = [expansion(lobes, power, max(budget - left, 0.0)) for lobes, left in zip(seen, beyond, strict=True)]
        residual = [float(e.residual.sum()) for e in chosen]
        # More degrees of the light are of use where they, not those of the exits, are what is missing.
        if degree == highest or sum(beyond) <= max(0.1 * budget, 0.3 * sum(residual)):
            break
        degree = min(2 * degree, highest)
    _warn_of(brdf, seen)
    left_out = sum(math.sqrt(both) for both in np.add(residual, beyond))
    reached = left_out / math.sqrt(energy) if energy > 0 else 0.0
    if reached > error:
        warnings.warn(
            f"the series leave out {reached:.2g} of the reflected light, rms, where {error:g} was asked for.",
            AccuracyWarning,
            stacklevel=2,
        )
    parts = []
    for e in chosen:
        c = world_coefficients(coefficients[: (e.degree + 1) ** 2], e.transfer.astype(coefficients.dtype))
        parts.append(ReflectedLobe(frozen(c, c.dtype), e.about, e.exit_cosine))
    return SHRM(tuple(parts), reached, f"{type(brdf).__name__}, error {error:g}")


def _warn_of(brdf: BRDF, seen: list[ExitLobes]) -> None:
    """Warn of a BRDF that cannot be, from its lobes about the normal and from a few pairs of directions."""
    # rho_00(theta_o) is the albedo there times sqrt(2 pi) Y_00.
    albedo = math.sqrt(2) * np.sum([np.broadcast_to(x.coefficients[0, :, 0], (_EXITS, 3)) for x in seen], axis=0)
    worst = np.unravel_index(int(np.argmax(albedo)), albedo.shape)
    if albedo[worst] > 1.02:
        angle = math.degrees(math.acos(seen[0].cosine[worst[0]]))
        warnings.warn(
            f"{type(brdf).__name__} reflects {albedo[worst]:.3g} times what it receives, seen {angle:.0f} degrees off "
            "the normal.",
            PhysicsWarning,
            stacklevel=3,
        )
    theta, phi = np.meshgrid((0.2, 0.6, 1.0, 1.3), (0.0, 1.0, 2.5), indexing="ij")
    wi, wo = from_spherical(theta, phi).reshape(-1, 3), from_spherical(theta.T, phi.T + 0.7).reshape(-1, 3)
    one, other = to_numpy(brdf.f(wi, wo)), to_numpy(brdf.f(wo, wi))
    # Measured materials are some per cent off.
    if not np.allclose(one, other, rtol=0.2, atol=1e-3 * float(np.max(one))):
        warnings.warn(
            f"{type(brdf).__name__} is not reciprocal: f changes when light and eye change places.",
            PhysicsWarning,
            stacklevel=3,
        )


@lru_cache(maxsize=8)
def recursion(degree: int) -> np.ndarray:
    """a, b and d of `_kernels/expansion.py`, (3, (degree + 1)^2), at index l (l + 1) + m, m >= 0."""
    factors = np.zeros((3, (degree + 1) ** 2))
    diagonal = math.sqrt(0.25 / math.pi)
    for m in range(degree + 1):
        factors[2, m * (m + 1) + m] = diagonal * (math.sqrt(2) if m else 1)
        diagonal *= math.sqrt((2 * m + 3) / (2 * m + 2))
        for l in range(m + 1, degree + 1):
            at = l * (l + 1) + m
            factors[0, at] = math.sqrt((4 * l * l - 1) / (l * l - m * m))
            if l > m + 1:
                factors[1, at] = math.sqrt((2 * l + 1) * ((l - 1) ** 2 - m * m) / ((2 * l - 3) * (l * l - m * m)))
    return factors
