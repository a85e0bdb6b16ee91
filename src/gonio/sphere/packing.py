"""Coefficients in the order of the public functions <-> in the order of the sums over theta.

    flat     ((degree + 1)^2, C)            index(l, m)
    packed   (degree + 1, steps, 4 C)       order abs(m), step of the recursion, then four parts of C real channels:
             real harmonics   even l - m: cos, sin; odd l - m: cos, sin, as factors of cos theta times even functions
             spin             at m: Re, Im; at -m: Re, Im

`unpack` is the transpose of `pack`, and `unpack_spin` that of `pack_spin`.
"""

from __future__ import annotations

import dataclasses
import math
from functools import lru_cache

import numpy as np

from .._kernels.legendre import EIGHT
from ..arrays import Array, like, namespace
from .harmonics import degrees_and_orders
from .legendre import odd_factors


@dataclasses.dataclass(frozen=True, eq=False)
class _Places:
    """Where each packed entry lies among the flat ones, (orders, steps, parts), and each flat one among the packed.

    One past the end stands for 0.
    """

    flat: np.ndarray
    packed: np.ndarray


def pack(flat: Array, degree: int) -> Array:
    """Coefficients in the real harmonics, packed."""
    xp = namespace(flat)
    places = _folded_places(degree)
    packed = _taken(flat, places.flat).reshape(*places.flat.shape[:2], -1) * like(root_two(degree), flat)[:, None, None]
    half = 2 * flat.shape[1]
    inverse, coupling = (like(x, flat)[..., None] for x in odd_factors(degree, packed.shape[1]))
    odd: list[Array] = []
    for i in reversed(range(packed.shape[1])):
        given = packed[:, i, half:]
        odd.append(inverse[i] * (given - coupling[i] * odd[-1] if odd else given))
    return xp.concat((packed[..., :half], xp.stack(odd[::-1], axis=1)), axis=-1)


def unpack(packed: Array, degree: int) -> Array:
    """Coefficients in the real harmonics, from packed sums."""
    xp = namespace(packed)
    half = packed.shape[2] // 2
    inverse, coupling = (like(x, packed)[..., None] for x in odd_factors(degree, packed.shape[1]))
    odd: list[Array] = []
    for i in range(packed.shape[1]):
        total = packed[:, i, half:]
        odd.append(inverse[i] * (total - coupling[i - 1] * odd[-1] if odd else total))
    packed = (
        xp.concat((packed[..., :half], xp.stack(odd, axis=1)), axis=-1) * like(root_two(degree), packed)[:, None, None]
    )
    return xp.take(packed.reshape(-1, half // 2), _indices(_folded_places(degree).packed, packed), axis=0)


def pack_spin(flat: Array, degree: int, spin: int) -> Array:
    """Complex coefficients in the harmonics of `spin`, packed."""
    xp = namespace(flat)
    places = _spin_places(degree, spin)
    taken = _taken(flat, places.flat) * like(_spin_signs(degree, spin), xp.real(flat))
    parts = xp.stack((xp.real(taken), xp.imag(taken)), axis=-2)
    return parts.reshape(*places.flat.shape[:2], -1)


def unpack_spin(packed: Array, degree: int, spin: int) -> Array:
    """Complex coefficients in the harmonics of `spin`, from packed sums."""
    xp = namespace(packed)
    orders, steps, channels = packed.shape
    parts = packed.reshape(orders, steps, 2, 2, channels // 4)
    values = (parts[..., 0, :] + 1j * parts[..., 1, :]) * like(_spin_signs(degree, spin), packed)
    values = values.reshape(-1, channels // 4)
    padded = xp.concat((values, xp.zeros_like(values[:1, :])), axis=0)
    return xp.take(padded, _indices(_spin_places(degree, spin).packed, packed), axis=0)


def _taken(flat: Array, places: np.ndarray) -> Array:
    """flat at `places` (...,) -> (..., C), with 0 at one past the end."""
    xp = namespace(flat)
    padded = xp.concat((flat, xp.zeros_like(flat[:1, :])), axis=0)
    return xp.take(padded, _indices(places, flat), axis=0).reshape(*places.shape, flat.shape[1])


def _indices(places: np.ndarray, reference: Array) -> Array:
    return namespace(reference).asarray(places.ravel(), device=reference.device)


def root_two(degree: int) -> np.ndarray:
    """The norm of the real harmonics beside the complex ones: 1 at m = 0, else sqrt2; (orders,)."""
    return np.where(np.arange(degree + 1) > 0, math.sqrt(2), 1.0)


@lru_cache(maxsize=8)
def _folded_places(degree: int) -> _Places:
    l, m = degrees_and_orders(degree)
    step, odd = np.divmod(l - np.abs(m), 2)
    return _places(degree, degree // 2 + 1, 4, (np.abs(m), step, 2 * odd + (m < 0)), np.arange(l.size))


@lru_cache(maxsize=8)
def _spin_places(degree: int, spin: int) -> _Places:
    l, m = degrees_and_orders(degree)
    exists = l >= abs(spin)
    step = np.where(exists, l - np.maximum(np.abs(m), abs(spin)), 0)
    places = _places(
        degree, degree - abs(spin) + 1, 2, tuple(x[exists] for x in (np.abs(m), step, m < 0)), np.flatnonzero(exists)
    )
    packed = np.full(l.size, places.flat.size)
    packed[exists] = places.packed
    return _Places(places.flat, packed)


def _places(degree: int, steps: int, parts: int, at: tuple[np.ndarray, ...], flat: np.ndarray) -> _Places:
    shape = (degree + 1, -(-steps // EIGHT) * EIGHT, parts)
    places = np.full(shape, (degree + 1) ** 2)
    places[tuple(x.astype(np.intp) for x in at)] = flat
    return _Places(places, np.ravel_multi_index(tuple(x.astype(np.intp) for x in at), shape))


@lru_cache(maxsize=8)
def _spin_signs(degree: int, spin: int) -> np.ndarray:
    """(-1)^s at m and (-1)^l at -m, (orders, steps, 2, 1): what sY_lm has beside lambda_lm."""
    orders, steps, _ = _spin_places(degree, spin).flat.shape
    l = np.maximum(np.arange(orders)[:, None], abs(spin)) + np.arange(steps)
    return np.stack((np.full(l.shape, (-1.0) ** spin), (-1.0) ** l), axis=-1)[..., None]
