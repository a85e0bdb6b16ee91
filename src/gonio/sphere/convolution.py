"""Reflection as convolution: coefficients of light times those of the BRDF are those of the reflected light field.

    isotropic    B_lmpq = Lambda_l L_lm rho_lpq                                               (RH 2.55; 2.59 with rho~)
                 B_lmq(theta_o) = Lambda_l L_lm rho_lq(theta_o)                               (RH 2.57)
    anisotropic  B_lmnpq = sqrt(8 pi^2 / (2l+1)) L_lm rho_ln,pq                               (RH 2.43)
                 B_lmn(theta_o, phi_o) = sqrt(8 pi^2 / (2l+1)) L_lm rho_ln(theta_o, phi_o)    (RH 2.44)

and the way back: the BRDF from light (RH 2.64), the light from a BRDF (2.65), both from the light field alone (2.68).
For radially symmetric BRDFs (RH 2.62) see `zonal.convolve`, in flatland (2.24) `flatland.py`.

Layouts, C channels last or absent:
    light        ((F+1)^2,) or ((F+1)^2, C)             complex L_lm, `index` order (`complex_from_real` of a light's)
    transfer     (F+1, P+1, Q+1) or (F+1, P+1, Q+1, C)  rho_lpq, q = 0..Q: isotropic BRDFs have rho_lp,-q = rho_lpq
    field        ((F+1)^2, P+1, Q+1) or (..., C)        B_lmpq, q = 0..Q, B_lmp,-q = B_lmpq
    anisotropic  transfer ((F+1)^2, (P+1)^2[, C]); field (count of (l, m, n), (P+1)^2[, C]), l by l, m slower than n
Where p is replaced by samples of theta_o (2.57), f_l,-q = (-1)^q f_lq. Coefficients of BRDFs: `brdf/harmonic.py`.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ..arrays import Array
from ..directions import require_unit
from ..errors import ArrayError, ParameterError
from .harmonics import complex_harmonics, degree_of, degrees_and_orders
from .wigner import big_lambda, wigner_D


@dataclasses.dataclass(frozen=True, eq=False)
class Deconvolved:
    """`value`, zero where it cannot be known, and `known`: for each degree l (and channel) whether it can."""

    value: np.ndarray
    known: np.ndarray


@dataclasses.dataclass(frozen=True, eq=False)
class Factored:
    """`light` and reciprocal `transfer`, zero where they cannot be known, and `known`: for each degree l (and channel).

    The scale is not known ever: light has L_00 = 1 / Lambda_0, that of radiance 1 / sqrt(4 pi) everywhere.
    """

    light: np.ndarray
    transfer: np.ndarray
    known: np.ndarray


def reflect(light: Array, transfer: Array) -> np.ndarray:
    """B_lmpq of an isotropic BRDF: RH 2.55, 2.59 where `transfer` holds both cosines, 2.57 where axis 1 is theta_o.

    Degrees that `transfer` lacks, or `light` lacks, are zero and left out: F is the lower of the two.
    """
    light, transfer = _coefficients(light, 1), _coefficients(transfer, 3)
    degree = min(degree_of(light), transfer.shape[0] - 1)
    l, _ = degrees_and_orders(degree)
    light, transfer = _with_channels(light[: l.size], transfer, 1, 3)
    field: np.ndarray = _spread(big_lambda(degree)[l], transfer.ndim) * _spread(light, transfer.ndim) * transfer[l]
    return field


def reflect_anisotropic(light: Array, transfer: Array) -> np.ndarray:
    """B_lmnpq of any BRDF: RH 2.43; or 2.44 where axis 1 of `transfer`, the (p, q), is any set of exit directions."""
    light, transfer = _coefficients(light, 1), _coefficients(transfer, 2)
    degree = min(degree_of(light), degree_of(transfer))
    light, transfer = _with_channels(light, transfer, 1, 2)
    blocks = []
    for l in range(degree + 1):
        part = slice(l * l, (l + 1) ** 2)
        scale = math.sqrt(8 * math.pi**2 / (2 * l + 1))
        product = scale * light[part][:, None, None] * transfer[None, part]
        blocks.append(product.reshape(-1, *transfer.shape[1:]))
    return np.concatenate(blocks)


def radiance(field: Array, alpha: Array, beta: Array, wo: Array) -> np.ndarray:
    """B at normals (alpha, beta) and local exit directions wo (..., 3), broadcast -> (...) or (..., C). RH 2.54.

    Angles in radians. The field is complex only by rounding where light and BRDF are real; the real part is returned.
    """
    field = _coefficients(field, 3)
    degree, exit_degree, highest = degree_of(field), field.shape[1] - 1, field.shape[2] - 1
    alpha, beta, wo, shape = _points(alpha, beta, wo)
    harmonic = complex_harmonics(exit_degree, wo)
    total: np.ndarray = np.zeros((len(alpha), *field.shape[3:]))
    for l in range(degree + 1):
        D = wigner_D(l, alpha, beta) / big_lambda(l)[l]
        part = field[l * l : (l + 1) ** 2]
        for q in range(-min(l, highest), min(l, highest) + 1):
            orders = [p * (p + 1) + q for p in range(abs(q), exit_degree + 1)]
            exits = np.einsum("kp,mp...->km...", harmonic[:, orders], part[:, abs(q) :, abs(q)])
            total = total + np.einsum("km,km...->k...", D[:, :, l + q], exits).real
    return total.reshape((*shape, *field.shape[3:]))


def radiance_anisotropic(field: Array, alpha: Array, beta: Array, gamma: Array, wo: Array) -> np.ndarray:
    """B in frames R_z(beta) R_y(alpha) R_z(gamma) towards local wo (..., 3): (...) or (..., C). RH 2.42."""
    field = _coefficients(field, 2)
    exit_degree = degree_of(field[0])
    alpha, beta, gamma, wo, shape = _points(alpha, beta, wo, gamma)
    harmonic = complex_harmonics(exit_degree, wo)
    total: np.ndarray = np.zeros((len(alpha), *field.shape[2:]))
    start = 0
    for l in range(_degree_of_field(field) + 1):
        n = 2 * l + 1
        D = wigner_D(l, alpha, beta, gamma).reshape(len(alpha), -1) * math.sqrt(n / (8 * math.pi**2))
        exits = np.einsum("kp,mp...->km...", harmonic, field[start : start + n * n])
        total = total + np.einsum("km,km...->k...", D, exits).real
        start += n * n
    return total.reshape((*shape, *field.shape[2:]))


def brdf_from_light(field: Array, light: Array, level: float = 1e-6) -> Deconvolved:
    """rho_lpq, (F+1, P+1, Q+1[, C]), from a reflected light field and its light: RH 2.64.

    All m of a degree serve, by least squares, since any may vanish. A degree whose light lies below `level` of the
    strongest, the root of the sum over m of abs(L_lm)^2, says nothing about the BRDF: it is masked.
    """
    field, light = _coefficients(field, 3), _coefficients(light, 1)
    degree = _common_degree(field, light)
    light, field = _with_channels(light, field, 1, 3)
    value: np.ndarray = np.zeros((degree + 1, *field.shape[1:]))
    energy = _by_degree(np.abs(light) ** 2, degree)
    known = _above(np.sqrt(energy), level)
    for l in range(degree + 1):
        part = slice(l * l, (l + 1) ** 2)
        inner = np.sum(np.conj(_spread(light[part], field.ndim)) * field[part], axis=0).real
        value[l] = np.where(known[l], inner / np.where(known[l], big_lambda(l)[l] * energy[l], 1), 0)
    return Deconvolved(value, known)


def light_from_brdf(field: Array, transfer: Array, level: float = 1e-6) -> Deconvolved:
    """L_lm, ((F+1)^2[, C]), from a reflected light field and the BRDF: RH 2.65.

    All (p, q) serve, by least squares. A degree that the BRDF passes with less than `level` of its strongest, the
    root of the sum over p, q of rho_lpq^2, is lost in reflection (odd l > 1 of Lambert's): it is masked.
    """
    field, transfer = _coefficients(field, 3), _coefficients(transfer, 3)
    degree = degree_of(field)
    if transfer.shape[:3] != (degree + 1, *field.shape[1:3]):
        raise ArrayError(f"transfer has shape {transfer.shape}, which does not meet the field's {field.shape}.")
    field, transfer = _with_channels(field, transfer, 3, 3)
    weight = _both_signs(transfer.shape[2], transfer.ndim)
    energy = np.sum(weight * np.abs(transfer) ** 2, axis=(1, 2))
    known = _above(np.sqrt(energy), level)
    l, _ = degrees_and_orders(degree)
    inner = np.sum(weight * np.conj(transfer)[l] * field, axis=(1, 2))
    divisor = np.where(known, _spread(big_lambda(degree), energy.ndim) * energy, 1)
    return Deconvolved(np.where(known[l], inner / divisor[l], 0), known)


def factor(field: Array, level: float = 1e-6) -> Factored:
    """Light and BRDF from a reflected light field alone, up to one scale a channel: RH 2.68.

    `field` is B~_lmpq of a reciprocal BRDF (both cosines taken in). Within each degree l it is a product of L_lm and
    rho~_lpq, of which only the scale is open; rho~_lpq = rho~_plq ties the scales of l and p together. RH uses
    p = q = 0, which dies by l = 3 for glossy BRDFs; here every pair l, p and every q count, each by its strength.

    Degrees that no chain of pairs stronger than `level` of the strongest ties to l = 0 are masked: those of a mirror
    (all but 0), and those above P. Raises `ArrayError` where there is no light at l = 0.
    """
    field = _coefficients(field, 3)
    if field.ndim == 3:
        one = _factor(field, level)
        return Factored(one.light, one.transfer, one.known)
    each = [_factor(field[..., c], level) for c in range(field.shape[-1])]
    light, transfer, known = (
        np.stack([getattr(one, name) for one in each], axis=-1) for name in ("light", "transfer", "known")
    )
    return Factored(light, transfer, known)


def _factor(field: np.ndarray, level: float) -> Factored:
    degree, exits, orders = degree_of(field), field.shape[1], field.shape[2]
    weight = _both_signs(orders, 2)
    light = np.zeros(field.shape[0], dtype=np.complex128)
    parts = np.zeros((degree + 1, exits, orders))
    for l in range(degree + 1):
        part = slice(l * l, (l + 1) ** 2)
        rows = (field[part] * np.sqrt(weight) / big_lambda(l)[l]).reshape(2 * l + 1, -1)
        u, strength, v = np.linalg.svd(rows, full_matrices=False)
        # rho~ is real: the phase that the decomposition leaves open makes it so.
        phase = np.exp(0.5j * np.angle(np.sum(v[0] ** 2)))
        light[part] = u[:, 0] * phase
        parts[l] = (strength[0] * v[0] * np.conj(phase)).real.reshape(exits, orders) / np.sqrt(weight)
    light, parts = _unit_light(light, parts)
    if not np.linalg.norm(parts[0]) > 0:
        raise ArrayError("the field is zero at l = 0: no light, or a BRDF that reflects none; nothing can be factored.")
    scale, known = _scales(parts, weight, level)
    each, _ = degrees_and_orders(degree)
    divisor = np.where(known, scale, 1)
    light = np.where(known[each], light / divisor[each], 0)
    return Factored(light, np.where(known, scale, 0)[:, None, None] * parts, known)


def _unit_light(light: np.ndarray, parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The scale of l = 0 put so that L_00 = 1 / Lambda_0."""
    scale = light[0].real * big_lambda(0)[0]
    light[0] = 1 / big_lambda(0)[0]
    parts[0] = parts[0] * scale
    return light, parts


def _scales(parts: np.ndarray, weight: np.ndarray, level: float) -> tuple[np.ndarray, np.ndarray]:
    """x_l with x_l a_lpq = x_p a_plq as nearly as can be, x_0 = 1, and which l are tied to 0."""
    count = parts.shape[0]
    n = min(count, parts.shape[1])
    squared = np.sum(weight * parts[:n, :n] ** 2, axis=2)  # (l, p): strength of a_lp.
    tied = np.minimum(squared, squared.T) > level**2 * np.max(squared)
    known = np.zeros(count, dtype=bool)
    known[0] = True
    for _ in range(n):
        known[:n] |= np.any(tied & known[:n], axis=1)
    members = np.flatnonzero(known)
    # The normal equations of sum over pairs l < p of weight (x_l a_lpq - x_p a_plq)^2.
    square = squared[np.ix_(members, members)]
    products = np.einsum("lpq,plq->lp", weight * parts[:n, :n], parts[:n, :n])[np.ix_(members, members)]
    normal = np.diag(np.sum(square, axis=1)) - products
    scale = np.ones(count)
    if len(members) > 1:
        scale[members[1:]] = np.linalg.solve(normal[1:, 1:], -normal[1:, 0])
    return scale, known


def _both_signs(count: int, ndim: int) -> np.ndarray:
    """1 for q = 0 and 2 for q > 0, which stands for -q too; shaped to meet q on axis 1 of 2 or axis 2 of 3 and more."""
    weight: np.ndarray = np.where(np.arange(count) > 0, 2.0, 1.0).reshape((count, 1) if ndim == 4 else (count,))
    return weight


def _by_degree(values: np.ndarray, degree: int) -> np.ndarray:
    sums: np.ndarray = np.stack([np.sum(values[l * l : (l + 1) ** 2], axis=0) for l in range(degree + 1)])
    return sums


def _above(strength: np.ndarray, level: float) -> np.ndarray:
    if not 0 < level < 1:
        raise ParameterError(f"level = {level:.6g} is not in (0, 1).")
    above: np.ndarray = (strength > level * np.max(strength, axis=0)) & (strength > 0)
    return above


def _coefficients(given: Array, axes: int) -> np.ndarray:
    x: np.ndarray = np.asarray(given)
    if x.ndim not in (axes, axes + 1) or x.dtype.kind not in "fiuc":
        raise ArrayError(
            f"coefficients have shape {x.shape}, dtype {x.dtype}; expected {axes} axes, and one of channels."
        )
    if not np.all(np.isfinite(x)):
        raise ArrayError("coefficients are not all finite. Mask or mend such entries before passing them.")
    return x


def _degree_of_field(field: np.ndarray) -> int:
    degree = int(np.cbrt(0.75 * field.shape[0]) + 0.5) - 1
    if (degree + 1) * (2 * degree + 1) * (2 * degree + 3) != 3 * field.shape[0]:
        raise ArrayError(f"an anisotropic field has shape {field.shape}; axis 0 holds 1, 10, 35, ... (l, m, n).")
    return degree


def _common_degree(field: np.ndarray, light: np.ndarray) -> int:
    degree = degree_of(field)
    if degree_of(light) != degree:
        raise ArrayError(f"light has degree {degree_of(light)}, the field {degree}; cut the higher one.")
    return degree


def _with_channels(a: np.ndarray, b: np.ndarray, axes_a: int, axes_b: int) -> tuple[np.ndarray, np.ndarray]:
    """Both with channels where either has them."""
    if a.ndim > axes_a or b.ndim > axes_b:
        a, b = (x[..., None] if x.ndim == axes else x for x, axes in ((a, axes_a), (b, axes_b)))
        if a.shape[-1] != b.shape[-1] and 1 not in (a.shape[-1], b.shape[-1]):
            raise ArrayError(f"{a.shape[-1]} channels do not meet {b.shape[-1]}.")
    return a, b


def _spread(x: np.ndarray, ndim: int) -> np.ndarray:
    """(N,) or (N, C) -> (N, 1, ..., 1[, C]) of `ndim` axes, where ndim > 3 has channels."""
    if x.ndim == 1:
        return x.reshape(-1, *(1,) * (ndim - 1))
    return x.reshape(x.shape[0], *(1,) * (ndim - 2), x.shape[1])


def _points(alpha: Array, beta: Array, wo: Array, gamma: Array | None = None) -> tuple[Array, ...]:
    """Flat float64 angles and directions, and the shape they broadcast to."""
    require_unit(wo, "wo")
    wo = np.asarray(wo, dtype=np.float64)
    angles = [np.asarray(a, dtype=np.float64) for a in (alpha, beta, gamma) if a is not None]
    shape = np.broadcast_shapes(*(a.shape for a in angles), wo.shape[:-1])
    flat = (np.broadcast_to(a, shape).reshape(-1) for a in angles)
    return *flat, np.broadcast_to(wo, (*shape, 3)).reshape(-1, 3), shape
