"""Coefficients of a BRDF in spherical harmonics of the incident and the outgoing direction, by quadrature.

    rho^(wi, wo) = f cos theta_i = sum of rho_ln,pq conj Y_ln(wi) Y_pq(wo)                              (RH 2.38)
    isotropic: n = q alone, rho_lpq = rho_lp,-q                                                         (RH 2.47, 2.53)
    rho^ = sum of rho_lq(theta_o) conj Y_lq(wi) exp(i q phi_o) / sqrt(2 pi)                             (RH 2.56)

`reciprocal` takes the cosine of theta_o in as well: rho~ (RH 2.58), and rho~_lpq = rho~_plq. f vanishes below the
surface, so that coefficients fall off slowly in p where it does not vanish at grazing. Layouts are those of
`sphere/convolution.py`. The quadrature is Gauss's in cos theta over the upper half and equal steps in phi: a lobe
narrower than its spacing, about pi / (2 samples), is missed.

About the mirror direction R of wo in place of the normal (RH 2.3.4, 5.3.1) glossy BRDFs hardly depend on where the eye
is. Then wi and wo are counted from R, with x towards wo: the same light field, in which the normal stands theta_o off
R, and wo 2 theta_o. The coefficients turn with it, rho_lk about R = sum over q of d^l_kq(theta_o) rho_lq about n; the
exit angle 2 theta_o runs to pi, and sin(2 theta_o) d(2 theta_o) weighs it as the picture of a ball does.

NumPy only: evaluating the BRDF takes half to seven tenths of the time. BRDFs whose parameters are arrays of another
library are refused, since gradients would end here.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from ..arrays import Array, is_numpy
from ..directions import from_spherical
from ..errors import ArrayError, ParameterError
from ..sphere.harmonics import complex_harmonics, harmonics, require_degree
from ..sphere.wigner import wigner_d
from .model import BRDF

_BLOCK = 1 << 18  # BRDF values at a time: a few megabytes


def transfer(
    brdf: BRDF, degree: int, exit_degree: int, *, reciprocal: bool = False, samples: int | None = None
) -> np.ndarray:
    """rho_lpq of an isotropic BRDF: (degree+1, exit_degree+1, min+1, C), l, p, q = 0..min(degree, exit_degree).

    `samples` in theta a side, four times as many in phi; by default twice the degrees and 16 more. RH 2.53, 2.58.
    Raises `ParameterError` where f changes when both directions turn about the normal.
    """
    require_degree(exit_degree, "exit_degree")
    samples = _samples(samples, degree, exit_degree)
    theta, cosine, weight = _polar(samples)
    measure = weight * cosine if reciprocal else weight
    highest = min(degree, exit_degree)
    at_exits = _at_exits(brdf, degree, theta, samples)[0][:, :, : highest + 1]
    orders = meridian(exit_degree, theta)
    result = np.empty((degree + 1, exit_degree + 1, highest + 1, at_exits.shape[-1]))
    for q in range(highest + 1):
        result[:, :, q] = np.einsum("lkc,kp->lpc", at_exits[:, :, q], measure[:, None] * orders[:, :, q])
    return result * math.sqrt(2 * math.pi)


def transfer_at(brdf: BRDF, degree: int, theta_o: Array, *, samples: int | None = None) -> np.ndarray:
    """rho_lq(theta_o) of an isotropic BRDF at angles theta_o (K,): (degree+1, K, degree+1, C), q = 0..degree. RH 2.56.

    rho_l,-q = (-1)^q rho_lq. Raises as `transfer` does.
    """
    _require_numpy(theta_o, "theta_o")
    theta_o = np.asarray(theta_o, dtype=np.float64)
    if theta_o.ndim != 1 or not np.all((theta_o >= 0) & (theta_o <= math.pi / 2)):
        raise ParameterError("theta_o is not a list of angles in [0, pi/2].")
    return _at_exits(brdf, degree, theta_o, _samples(samples, degree, 0))[0]


@dataclasses.dataclass(frozen=True, eq=False)
class ExitLobes:
    """What a BRDF reflects at K exit angles, as harmonics of where the light is: rho_lq(theta_o) of RH 2.56.

    angle: (K,) from the axis to wo, radians. cosine: (K,) of theta_o. weight: (K,), summing to 2: how much of the
    picture of a ball each exit angle fills. coefficients: (degree+1, K, degree+1, C), q = 0..degree.
    energy: (K, C), 2 pi times the integral of (f cos theta_i)^2 over wi: all rho_lq^2, q of both signs, summed.
    """

    angle: np.ndarray
    cosine: np.ndarray
    weight: np.ndarray
    coefficients: np.ndarray
    energy: np.ndarray

    def about_mirror(self) -> ExitLobes:
        """The same, of lobes about the normal, counted from the mirror direction. RH 2.3.4."""
        return dataclasses.replace(
            self, angle=2 * self.angle, coefficients=_about_mirror(self.coefficients, self.angle)
        )


def exit_lobes(brdf: BRDF, degree: int, exits: int, *, samples: int | None = None) -> ExitLobes:
    """The lobes of an isotropic BRDF about the normal, at Gauss's nodes in cos(2 theta_o). Raises as `transfer`."""
    nodes, weight = np.polynomial.legendre.leggauss(exits)
    theta = np.arccos(nodes) / 2
    coefficients, energy = _at_exits(brdf, degree, theta, _samples(samples, degree, 0))
    return ExitLobes(theta, np.cos(theta), weight, coefficients, energy)


def mirror_transfer(
    brdf: BRDF, degree: int, exit_degree: int, *, reciprocal: bool = False, samples: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """rho_lpq about the mirror direction, (degree+1, exit_degree+1, min+1, C), and the BRDF's energy (C,). RH 5.18.

    Of the energy, the integral of rho^2 over both spheres, the sum of rho_lpq^2, q of both signs, is the part that
    these degrees carry. `reciprocal` takes cos theta_o in, as RH 5.34 does. Raises as `transfer` does.
    """
    require_degree(exit_degree, "exit_degree")
    lobes = exit_lobes(brdf, degree, max(4 * exit_degree, 48), samples=samples).about_mirror()
    factor = lobes.cosine if reciprocal else np.ones_like(lobes.cosine)
    highest = min(degree, exit_degree)
    orders = meridian(exit_degree, lobes.angle)[:, :, : highest + 1]
    turned = lobes.coefficients[:, :, : highest + 1]
    rho = np.einsum("lkqc,k,kpq->lpqc", turned, lobes.weight * factor, orders, optimize=True) * math.sqrt(2 * math.pi)
    return rho, (lobes.weight * factor**2) @ lobes.energy


def anisotropic_transfer(
    brdf: BRDF, degree: int, exit_degree: int, *, reciprocal: bool = False, samples: int | None = None
) -> np.ndarray:
    """rho_ln,pq of any BRDF: ((degree+1)^2, (exit_degree+1)^2, C) complex. RH 2.38.

    rho~_ln,pq = conj rho~_pq,ln for a reciprocal BRDF.
    """
    require_degree(exit_degree, "exit_degree")
    _require_numpy(brdf, type(brdf).__name__)
    samples = _samples(samples, degree, exit_degree)
    theta, _, weight = _polar(samples)
    phi = (np.arange(2 * samples) + 0.5) * (math.pi / samples)
    w = from_spherical(theta[:, None], phi).reshape(-1, 3)
    measure = np.repeat(weight * (math.pi / samples), phi.size)
    incident = complex_harmonics(degree, w) * (measure * w[:, 2])[:, None]
    leaving = np.conj(complex_harmonics(exit_degree, w)) * (measure * (w[:, 2] if reciprocal else 1))[:, None]
    total: np.ndarray | None = None
    step = max(1, _BLOCK // len(w))
    for start in range(0, len(w), step):
        part = slice(start, start + step)
        f = brdf.f(w[:, None], w[None, part])
        block = np.stack([incident.T @ f[..., c] @ leaving[part] for c in range(f.shape[-1])], axis=-1)
        total = block if total is None else total + block
    assert total is not None
    return total


def mirror(degree: int) -> np.ndarray:
    """rho_lpq = (-1)^q delta_lp, q = 0..l, of a mirror on the whole sphere: (degree+1, degree+1, degree+1). RH 3.23.

    A mirror's BRDF is no function, so it has no model. Over the upper half alone the harmonics are not orthogonal
    and delta_lp does not hold; B is right all the same where the light comes from above the surface.
    """
    require_degree(degree)
    l = np.arange(degree + 1)
    same = (l[:, None] == l)[:, :, None] & (l <= l[:, None, None])
    coefficients: np.ndarray = np.where(same, (-1.0) ** l, 0.0)
    return coefficients


def _at_exits(brdf: BRDF, degree: int, theta_o: np.ndarray, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """rho_lq(theta_o), (degree+1, K, degree+1, C), and 2 pi times the integral of (f cos theta_i)^2 over wi, (K, C)."""
    require_degree(degree)
    _require_numpy(brdf, type(brdf).__name__)
    _require_isotropic(brdf)
    theta, cosine, weight = _polar(samples)
    count = 4 * samples
    # f depends on abs(phi_o - phi_i): cosines of q phi are all it takes.
    phi = np.arange(count) * (2 * math.pi / count)
    waves = np.cos(np.arange(degree + 1)[:, None] * phi) * (2 * math.pi / count)
    wi = from_spherical(theta[:, None], phi)
    wo = from_spherical(theta_o, 0.0)
    incident = meridian(degree, theta) * (weight * cosine)[:, None, None]
    parts, energies = [], []
    step = max(1, _BLOCK // (count * samples))
    for start in range(0, len(wo), step):
        f = brdf.f(wi, wo[start : start + step, None, None])
        parts.append(np.einsum("qj,kijc->kiqc", waves, f, optimize=True))
        energies.append(np.einsum("i,kijc,kijc->kc", weight * cosine**2, f, f, optimize=True))
    spectra = np.concatenate(parts)
    result: np.ndarray = np.einsum("ilq,kiqc->lkqc", incident, spectra, optimize=True)
    return result * math.sqrt(2 * math.pi), np.concatenate(energies) * (4 * math.pi**2 / count)


def _about_mirror(at_exits: np.ndarray, theta_o: np.ndarray) -> np.ndarray:
    """rho_lq(theta_o), (degree+1, K, degree+1, C), about R."""
    turned = np.zeros_like(at_exits)
    for l in range(at_exits.shape[0]):
        q = np.arange(-l, l + 1)
        both = at_exits[l][:, np.abs(q)] * np.where(q < 0, (-1.0) ** q, 1.0)[:, None]
        turned[l, :, : l + 1] = wigner_d(l, theta_o)[:, l:] @ both
    return turned


def meridian(degree: int, theta: np.ndarray) -> np.ndarray:
    """Y_lq(theta, 0) of the complex harmonics, real there: angles (N,) -> (N, degree+1, degree+1), zero where q > l."""
    real = harmonics(degree, from_spherical(theta, 0.0))
    table = np.zeros((len(theta), degree + 1, degree + 1))
    for l in range(degree + 1):
        table[:, l, : l + 1] = real[:, l * (l + 1) : (l + 1) ** 2]
    q = np.arange(1, degree + 1)
    table[:, :, 1:] *= (-1.0) ** q * math.sqrt(0.5)
    return table


def _polar(samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """theta, cos theta and weights of Gauss's rule in cos theta over [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(samples)
    cosine = (nodes + 1) / 2
    return np.arccos(cosine), cosine, weights / 2


def _samples(samples: int | None, degree: int, exit_degree: int) -> int:
    require_degree(degree)
    if samples is None:
        return 2 * max(degree, exit_degree) + 16
    if samples < max(degree, exit_degree) + 1:
        raise ParameterError(
            f"samples = {samples} cannot carry degree {max(degree, exit_degree)}; give more than that."
        )
    return samples


def _require_numpy(value: Any, name: str) -> None:
    """Raises `ArrayError` where `value`, or a model's parameter in it, is an array of another library."""
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            _require_numpy(getattr(value, field.name), f"{name}.{field.name}")
    elif isinstance(value, tuple):
        for part in value:
            _require_numpy(part, name)
    elif not is_numpy(value):
        raise ArrayError(f"{name} is no NumPy array; coefficients of BRDFs carry no gradients. Use arrays.to_numpy.")


def _require_isotropic(brdf: BRDF) -> None:
    theta = np.array([0.3, 0.9, 1.3])
    turn = np.array([0.0, 0.7, 2.0])[:, None]
    f = brdf.f(from_spherical(theta, turn), from_spherical(theta[::-1] - 0.1, turn + 1.0))
    mirrored = brdf.f(from_spherical(theta, turn), from_spherical(theta[::-1] - 0.1, turn - 1.0))
    if not (np.allclose(f, f[:1], rtol=1e-4) and np.allclose(f, mirrored, rtol=1e-4)):
        raise ParameterError(
            f"{type(brdf).__name__} is not isotropic: it changes when both directions turn or are mirrored. "
            "Use anisotropic_transfer."
        )
