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
Arrays of other libraries are answered in kind, but for `factor`, which rests on decompositions.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ..arrays import Array, floats, is_numpy, like, namespace
from ..directions import require_unit
from ..errors import ArrayError, ParameterError
from .harmonics import complex_harmonics, degree_of, degrees_and_orders, power_spectrum
from .wigner import big_lambda, wigner_D


@dataclasses.dataclass(frozen=True, eq=False)
class Deconvolved:
    """`value`, zero where it cannot be known, and `known`: for each degree l (and channel) whether it can."""

    value: Array
    known: Array


@dataclasses.dataclass(frozen=True, eq=False)
class Factored:
    """`light` and reciprocal `transfer`, zero where they cannot be known, and `known`: for each degree l (and channel).

    The scale is not known ever: light has L_00 = 1 / Lambda_0, that of radiance 1 / sqrt(4 pi) everywhere.
    """

    light: np.ndarray
    transfer: np.ndarray
    known: np.ndarray


def reflect(light: Array, transfer: Array) -> Array:
    """B_lmpq of an isotropic BRDF: RH 2.55, 2.59 where `transfer` holds both cosines, 2.57 where axis 1 is theta_o.

    Degrees that `transfer` lacks, or `light` lacks, are zero and left out: F is the lower of the two.
    """
    xp = namespace(light, transfer)
    light, transfer = _coefficients(xp, light, 1), _coefficients(xp, transfer, 3)
    degree = min(degree_of(light), transfer.shape[0] - 1)
    l = _degrees(light, degree)
    light, transfer = _with_channels(light[: (degree + 1) ** 2, ...], transfer, 1, 3)
    scale = like(big_lambda(degree)[degrees_and_orders(degree)[0]], xp.real(transfer))
    return _spread(scale, transfer.ndim) * _spread(light, transfer.ndim) * xp.take(transfer, l, axis=0)


def reflect_anisotropic(light: Array, transfer: Array) -> Array:
    """B_lmnpq of any BRDF: RH 2.43; or 2.44 where axis 1 of `transfer`, the (p, q), is any set of exit directions."""
    xp = namespace(light, transfer)
    light, transfer = _coefficients(xp, light, 1), _coefficients(xp, transfer, 2)
    degree = min(degree_of(light), degree_of(transfer))
    light, transfer = _with_channels(light, transfer, 1, 2)
    blocks = []
    for l in range(degree + 1):
        part = slice(l * l, (l + 1) ** 2)
        scale = math.sqrt(8 * math.pi**2 / (2 * l + 1))
        product = scale * light[part, ...][:, None, None, ...] * transfer[None, part, ...]
        blocks.append(product.reshape(-1, *product.shape[2:]))
    return xp.concat(blocks, axis=0)


def radiance(field: Array, alpha: Array, beta: Array, wo: Array) -> Array:
    """B at normals (alpha, beta) and local exit directions wo (..., 3), broadcast -> (...) or (..., C). RH 2.54.

    Angles in radians. The field is complex only by rounding where light and BRDF are real; the real part is returned.
    """
    xp = namespace(field, alpha, beta, wo)
    field = _coefficients(xp, field, 3)
    degree, exit_degree, highest = degree_of(field), field.shape[1] - 1, field.shape[2] - 1
    dtype, field = xp.real(field).dtype, xp.astype(field, xp.complex128)
    (alpha, beta), wo, shape = _points(field, wo, alpha, beta)
    harmonic = complex_harmonics(exit_degree, wo)
    total = xp.zeros((alpha.shape[0], *field.shape[3:]), dtype=xp.float64, device=field.device)
    for l in range(degree + 1):
        D = wigner_D(l, alpha, beta) * math.sqrt((2 * l + 1) / (4 * math.pi))
        part = field[l * l : (l + 1) ** 2, ...]
        for q in range(-min(l, highest), min(l, highest) + 1):
            orders = xp.asarray([p * (p + 1) + q for p in range(abs(q), exit_degree + 1)], device=field.device)
            exits = xp.tensordot(xp.take(harmonic, orders, axis=1), part[:, abs(q) :, abs(q), ...], axes=([1], [1]))
            total = total + xp.real(xp.sum(_meet(D[:, :, l + q], exits) * exits, axis=1))
    return xp.astype(total.reshape((*shape, *field.shape[3:])), dtype)


def radiance_anisotropic(field: Array, alpha: Array, beta: Array, gamma: Array, wo: Array) -> Array:
    """B in frames R_z(beta) R_y(alpha) R_z(gamma) towards local wo (..., 3): (...) or (..., C). RH 2.42."""
    xp = namespace(field, alpha, beta, gamma, wo)
    field = _coefficients(xp, field, 2)
    degree, exit_degree = _degree_of_field(field), degree_of(field[0, ...])
    dtype, field = xp.real(field).dtype, xp.astype(field, xp.complex128)
    (alpha, beta, gamma), wo, shape = _points(field, wo, alpha, beta, gamma)
    harmonic = complex_harmonics(exit_degree, wo)
    total = xp.zeros((alpha.shape[0], *field.shape[2:]), dtype=xp.float64, device=field.device)
    start = 0
    for l in range(degree + 1):
        n = 2 * l + 1
        D = wigner_D(l, alpha, beta, gamma).reshape(-1, n * n) * math.sqrt(n / (8 * math.pi**2))
        exits = xp.tensordot(harmonic, field[start : start + n * n, ...], axes=([1], [1]))
        total = total + xp.real(xp.sum(_meet(D, exits) * exits, axis=1))
        start += n * n
    return xp.astype(total.reshape((*shape, *field.shape[2:])), dtype)


def brdf_from_light(field: Array, light: Array, level: float = 1e-6) -> Deconvolved:
    """rho_lpq, (F+1, P+1, Q+1[, C]), from a reflected light field and its light: RH 2.64.

    All m of a degree serve, by least squares, since any may vanish. A degree whose light lies below `level` of the
    strongest, the root of the sum over m of abs(L_lm)^2, says nothing about the BRDF: it is masked.
    """
    xp = namespace(field, light)
    field, light = _coefficients(xp, field, 3), _coefficients(xp, light, 1)
    degree = _common_degree(field, light)
    light, field = _with_channels(light, field, 1, 3)
    energy = power_spectrum(light)
    known = _above(xp, xp.sqrt(energy), level)
    scale = _meet(like(big_lambda(degree), energy), energy)
    divisor = xp.where(known, scale * energy, xp.ones_like(energy))
    products = xp.real(xp.conj(_spread(light, field.ndim)) * field)
    inner = [xp.sum(products[l * l : (l + 1) ** 2, ...], axis=0) for l in range(degree + 1)]
    value = xp.stack(inner, axis=0) / _spread(divisor, field.ndim)
    return Deconvolved(xp.where(_spread(known, field.ndim), value, xp.zeros_like(value)), known)


def light_from_brdf(field: Array, transfer: Array, level: float = 1e-6) -> Deconvolved:
    """L_lm, ((F+1)^2[, C]), from a reflected light field and the BRDF: RH 2.65.

    All (p, q) serve, by least squares. A degree that the BRDF passes with less than `level` of its strongest, the
    root of the sum over p, q of rho_lpq^2, is lost in reflection (odd l > 1 of Lambert's): it is masked.
    """
    xp = namespace(field, transfer)
    field, transfer = _coefficients(xp, field, 3), _coefficients(xp, transfer, 3)
    degree = degree_of(field)
    if tuple(transfer.shape[:3]) != (degree + 1, *field.shape[1:3]):
        raise ArrayError(
            f"transfer has shape {tuple(transfer.shape)}, which does not meet the field's {tuple(field.shape)}."
        )
    field, transfer = _with_channels(field, transfer, 3, 3)
    weight = like(_both_signs(transfer.shape[2], transfer.ndim), xp.real(transfer))
    energy = xp.sum(weight * xp.abs(transfer) ** 2, axis=(1, 2))
    known = _above(xp, xp.sqrt(energy), level)
    l = _degrees(field, degree)
    inner = xp.sum(weight * xp.take(xp.conj(transfer), l, axis=0) * field, axis=(1, 2))
    scale = _meet(like(big_lambda(degree), energy), energy)
    divisor = xp.where(known, scale * energy, xp.ones_like(energy))
    value = inner / xp.take(divisor, l, axis=0)
    return Deconvolved(xp.where(xp.take(known, l, axis=0), value, xp.zeros_like(value)), known)


def factor(field: Array, level: float = 1e-6) -> Factored:
    """Light and BRDF from a reflected light field alone, up to one scale a channel: RH 2.68.

    `field` is B~_lmpq of a reciprocal BRDF (both cosines taken in). Within each degree l it is a product of L_lm and
    rho~_lpq, of which only the scale is open; rho~_lpq = rho~_plq ties the scales of l and p together. RH uses
    p = q = 0, which dies by l = 3 for glossy BRDFs; here every pair l, p and every q count, each by its strength.

    Degrees that no chain of pairs stronger than `level` of the strongest ties to l = 0 are masked: those of a mirror
    (all but 0), and those above P. Raises `ArrayError` where there is no light at l = 0.
    """
    if not is_numpy(field):
        raise ArrayError("factor takes NumPy arrays; `gonio.arrays.to_numpy` makes them.")
    field = _coefficients(np, field, 3)
    if field.ndim == 3:
        return _factor(field, level)
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


def _above(xp: Array, strength: Array, level: float) -> Array:
    if not 0 < level < 1:
        raise ParameterError(f"level = {level:.6g} is not in (0, 1).")
    return (strength > level * xp.max(strength, axis=0)) & (strength > 0)


def _coefficients(xp: Array, given: Array, axes: int) -> Array:
    x = xp.asarray(given) if is_numpy(given) else given
    if x.ndim not in (axes, axes + 1) or not xp.isdtype(x.dtype, "numeric"):
        raise ArrayError(
            f"coefficients have shape {tuple(x.shape)}, dtype {x.dtype}; expected {axes} axes, and one of channels."
        )
    x = xp.astype(x, xp.float64) if xp.isdtype(x.dtype, "integral") else x
    if not bool(xp.all(xp.isfinite(x))):
        raise ArrayError("coefficients are not all finite. Mask or mend such entries before passing them.")
    return x


def _degrees(x: Array, degree: int) -> Array:
    """l of each coefficient, to take entries of arrays such as `x` by."""
    return namespace(x).asarray(degrees_and_orders(degree)[0], device=x.device)


def _degree_of_field(field: Array) -> int:
    degree = int(np.cbrt(0.75 * field.shape[0]) + 0.5) - 1
    if (degree + 1) * (2 * degree + 1) * (2 * degree + 3) != 3 * field.shape[0]:
        raise ArrayError(f"an anisotropic field has shape {tuple(field.shape)}; axis 0 holds 1, 10, 35, ... (l, m, n).")
    return degree


def _common_degree(field: Array, light: Array) -> int:
    degree = degree_of(field)
    if degree_of(light) != degree:
        raise ArrayError(f"light has degree {degree_of(light)}, the field {degree}; cut the higher one.")
    return degree


def _with_channels(a: Array, b: Array, axes_a: int, axes_b: int) -> tuple[Array, Array]:
    """Both with channels where either has them."""
    if a.ndim > axes_a or b.ndim > axes_b:
        a, b = (x[..., None] if x.ndim == axes else x for x, axes in ((a, axes_a), (b, axes_b)))
        if a.shape[-1] != b.shape[-1] and 1 not in (a.shape[-1], b.shape[-1]):
            raise ArrayError(f"{a.shape[-1]} channels do not meet {b.shape[-1]}.")
    return a, b


def _spread(x: Array, ndim: int) -> Array:
    """(N,) or (N, C) -> (N, 1, ..., 1[, C]) of `ndim` axes."""
    return x.reshape(x.shape[0], *(1,) * (ndim - x.ndim), *x.shape[1:])


def _meet(x: Array, other: Array) -> Array:
    """`x` with as many axes as `other`, the new ones last."""
    return x.reshape(*x.shape, *(1,) * (other.ndim - x.ndim))


def _points(field: Array, wo: Array, *angles: Array) -> tuple[list[Array], Array, tuple[int, ...]]:
    """Flat float64 angles and directions of the field's library, and the shape they broadcast to."""
    require_unit(wo, "wo")
    xp, _, wo, *around = floats(field.real, wo, *angles)
    shape = np.broadcast_shapes(*(tuple(a.shape) for a in around), tuple(wo.shape[:-1]))
    flat = [xp.astype(xp.broadcast_to(a, shape).reshape(-1), xp.float64) for a in around]
    return flat, xp.astype(xp.broadcast_to(wo, (*shape, 3)).reshape(-1, 3), xp.float64), shape
