"""How many harmonics a reflected light field wants, and which (RH 5.5).

    B(n, wo) = g(theta_o) sum over l, m, p, q of L_lm rho_lpq D^l_mq Y_pq(wo)

expanded about the normal or the mirror direction, g = 1 or 1 / cos theta_o, whichever reaches the error with fewer
terms. rho_lpq is the least-squares fit over the exits that the eye can see, each weighed by what it fills of the
picture of a ball. What is left out is known before a map is made, since modes do not mix:

    residual = sum over l of Lambda_l^2 sum over m of abs(L_lm)^2 [residual of rho_lq(theta_o), all of it where l > F]

in the same measure, so that its root over that of all energy is the relative rms error of pictures of a ball, averaged
over views. RH projects on p instead (`mirror_transfer`) and bounds the error by RH 5.18 and 5.19.
"""

from __future__ import annotations

import dataclasses
import enum
import math

import numpy as np

from ..brdf.harmonic import ExitLobes, meridian
from ..errors import ParameterError
from ..lights.environment import Environment
from ..lights.mappings import LatLongMap
from ..sphere.wigner import big_lambda

HIGHEST_EXIT_DEGREE = 6
GRAZING = 0.1  # the least cos theta_o that B is divided by


def require_share(error: float) -> None:
    """Raises `ParameterError` where a relative error is not between 0 and 1."""
    if not 0 < error < 1:
        raise ParameterError(f"error = {error}; a relative error lies between 0 and 1.")


def on_grid(light: Environment) -> Environment:
    """The light as a lat-long map, whose harmonics are quick. Raises `ParameterError` where it is no environment."""
    if not isinstance(light, Environment):
        raise ParameterError(
            f"{type(light).__name__} is no Environment; add what directional lights reflect by itself."
        )
    if isinstance(light.mapping, LatLongMap):
        return light
    height, _ = light.mapping.sheet_shape(light.rows, light.columns)
    return light.resampled(LatLongMap(), max(2 * height, 16))


class About(enum.Enum):
    """The direction that light and eye are counted from."""

    NORMAL = "normal"
    MIRROR = "mirror"


@dataclasses.dataclass(frozen=True, eq=False)
class Expansion:
    """rho_lpq (F+1, P+1, P+1, C) about a direction; `exit_cosine`: of B cos theta_o rather than of B.

    residual: (C,), the energy of the light field that is left out.
    """

    about: About
    exit_cosine: bool
    transfer: np.ndarray
    residual: np.ndarray

    @property
    def degree(self) -> int:
        """F."""
        return len(self.transfer) - 1

    @property
    def exit_degree(self) -> int:
        """P."""
        return len(self.transfer[0]) - 1


def expansion(lobes: ExitLobes, power: np.ndarray, budget: float) -> Expansion:
    """The expansion with fewest terms that leaves out no more than `budget` of energy; if none does, the best.

    lobes: about the normal. power: (degree+1, C), the light's energy of each degree.
    """
    about = {About.NORMAL: lobes, About.MIRROR: lobes.about_mirror()}
    ways = [(axis, exit_cosine) for axis in About for exit_cosine in (False, True)]
    found: list[Expansion] = []
    for exit_degree in range(HIGHEST_EXIT_DEGREE + 1):
        found += [fitted(about[axis], axis, exit_cosine, exit_degree, power) for axis, exit_cosine in ways]
        best = min(found, key=lambda e: float(e.residual.sum()))
        if best.residual.sum() <= 0.7 * budget:  # the rest is for the degrees l that are cut
            break
    return _cut(best, about[best.about], power, max(budget, 1.02 * float(best.residual.sum())))


def fitted(lobes: ExitLobes, about: About, exit_cosine: bool, exit_degree: int, power: np.ndarray) -> Expansion:
    """rho_lpq to `exit_degree` that fit `lobes`, which are counted from `about`, best; with all their degrees l."""
    degrees, exits, _, channels = lobes.coefficients.shape
    root = np.sqrt(lobes.weight)
    basis = _basis(lobes, exit_degree, exit_cosine) * root[:, None, None]
    transfer = np.zeros((degrees, exit_degree + 1, exit_degree + 1, channels))
    carried = np.zeros((degrees, channels))
    for q in range(min(exit_degree, degrees - 1) + 1):
        target = (lobes.coefficients[:, :, q] * root[:, None]).transpose(1, 0, 2).reshape(exits, -1)
        orthonormal, triangle = np.linalg.qr(basis[:, q:, q])
        projected = orthonormal.T @ target
        transfer[:, q:, q] = np.linalg.solve(triangle, projected).reshape(-1, degrees, channels).swapaxes(0, 1)
        carried += (2 if q else 1) * np.sum(projected**2, axis=0).reshape(degrees, channels)
    left = light_field_energy(lobes, power) - np.sum(_scale(degrees - 1, power) * carried, axis=0)
    return Expansion(about, exit_cosine, transfer, np.maximum(left, 0))


def _cut(whole: Expansion, lobes: ExitLobes, power: np.ndarray, budget: float) -> Expansion:
    """The same with the fewest degrees l that keep to `budget`."""
    # The fit is a projection: a degree carries as much energy as goes with it.
    basis = _basis(lobes, whole.exit_degree, whole.exit_cosine)
    values = np.einsum("lpqc,kpq->lkqc", whole.transfer, basis, optimize=True)
    carried = _scale(whole.degree, power) * _energy(dataclasses.replace(lobes, coefficients=values))
    beyond = np.cumsum(carried[::-1], axis=0)[::-1]
    left = whole.residual + np.concatenate((beyond[1:], np.zeros_like(beyond[:1])))
    degree = int(np.argmax(left.sum(axis=1) <= budget))
    return dataclasses.replace(whole, transfer=whole.transfer[: degree + 1], residual=left[degree])


def _basis(lobes: ExitLobes, exit_degree: int, exit_cosine: bool) -> np.ndarray:
    """What each rho_lpq adds to rho_lq at the exits, (K, P+1, P+1)."""
    gain = 1 / np.maximum(lobes.cosine, GRAZING) if exit_cosine else np.ones_like(lobes.cosine)
    basis: np.ndarray = meridian(exit_degree, lobes.angle) * (math.sqrt(2 * math.pi) * gain)[:, None, None]
    return basis


def _energy(lobes: ExitLobes) -> np.ndarray:
    """Energy of each degree, (degree+1, C)."""
    both = np.where(np.arange(lobes.coefficients.shape[2]) > 0, 2.0, 1.0)
    energy: np.ndarray = np.einsum("k,q,lkqc->lc", lobes.weight, both, lobes.coefficients**2, optimize=True)
    return energy


def _scale(degree: int, power: np.ndarray) -> np.ndarray:
    scale: np.ndarray = big_lambda(degree)[:, None] ** 2 * power[: degree + 1]
    return scale


def light_field_energy(lobes: ExitLobes, power: np.ndarray) -> np.ndarray:
    """Energy of what is reflected, (C,), as far as the degrees of `power` (degree+1, C) tell."""
    energy: np.ndarray = np.sum(_scale(len(lobes.coefficients) - 1, power) * _energy(lobes), axis=0)
    return energy


def unseen(lobes: ExitLobes, power: np.ndarray) -> np.ndarray:
    """Energy reflected beyond the degrees at hand, (C,): the BRDF's, with the light going on as its last eighth."""
    degree = len(lobes.coefficients) - 1
    missing = np.maximum(lobes.weight @ lobes.energy - np.sum(_energy(lobes), axis=0), 0)
    going_on = np.mean(_scale(degree, power)[-(degree // 8 + 1) :], axis=0)
    beyond: np.ndarray = missing * going_on
    return beyond
