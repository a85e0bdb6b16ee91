"""Sums over the rows of an image against a few functions of theta, in one pass over the image.

    sums[p, i] = sum over r of functions[p, r] (image[r, i] +- image[r, i + width] +- (the same of the mirror row))

The four combinations of signs are the planes: 0 even about the equator and over half a turn, 1 even and odd, 2 odd and
even, 3 odd and odd. Two rows and their mirror images are taken at once, in pieces that stay in the first cache.
"""

from __future__ import annotations

import numpy as np
from numba import njit

_PIECE = 512

# Sums may be fused so that they vectorise; NaN and infinity still spread as they should.
_FAST = {"contract", "nsz"}


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _planes(north, north_on, south, south_on, planes):  # type: ignore[no-untyped-def]
    even_even, even_odd, odd_even, odd_odd = planes[0], planes[1], planes[2], planes[3]
    for i in range(north.size):
        a, b, c, d = north[i], north_on[i], south[i], south_on[i]
        even_even[i] = (a + b) + (c + d)
        even_odd[i] = (a - b) + (c - d)
        odd_even[i] = (a + b) - (c + d)
        odd_odd[i] = (a - b) - (c - d)


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _add(total, first, factor, second, other):  # type: ignore[no-untyped-def]
    for i in range(total.size):
        total[i] += factor * first[i] + other * second[i]


@njit(cache=True, nogil=True, error_model="numpy")
def moments(image, functions, plane, sums):  # type: ignore[no-untyped-def]
    """Fill `sums` (functions, width) from `image` (rows, 2 width), `functions` (functions, northern rows).

    `plane` (functions,) names the combination of signs for each function. The equator of an odd number of rows is its
    own mirror image, so its factor is to be halved. An odd number of northern rows takes an empty partner.
    """
    rows, width = image.shape[0], image.shape[1] // 2
    half = functions.shape[1]
    first, second = np.zeros((4, _PIECE), image.dtype), np.zeros((4, _PIECE), image.dtype)
    zero = image.dtype.type(0)
    sums[:] = 0
    for r in range(0, half, 2):
        pair = r + 1 < half
        for low in range(0, width, _PIECE):
            n = min(_PIECE, width - low)
            near, far = image[r], image[rows - 1 - r]
            a, b = slice(low, low + n), slice(low + width, low + width + n)
            _planes(near[a], near[b], far[a], far[b], first)
            if pair:
                near, far = image[r + 1], image[rows - 2 - r]
                _planes(near[a], near[b], far[a], far[b], second)
            for p in range(plane.size):
                other = functions[p, r + 1] if pair else zero
                _add(sums[p, low : low + n], first[plane[p]], functions[p, r], second[plane[p]], other)


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _scale_and_add(plane, factor, wave):  # type: ignore[no-untyped-def]
    for i in range(wave.size):
        plane[i] += factor * wave[i]


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _rows(planes, north, north_on, south, south_on):  # type: ignore[no-untyped-def]
    even_even, even_odd, odd_even, odd_odd = planes[0], planes[1], planes[2], planes[3]
    for i in range(north.size):
        a, b, c, d = even_even[i], even_odd[i], odd_even[i], odd_odd[i]
        south[i] = (a + b) - (c + d)
        south_on[i] = (a - b) - (c - d)
        north[i] = (a + b) + (c + d)
        north_on[i] = (a - b) + (c - d)


@njit(cache=True, nogil=True, error_model="numpy")
def spread(waves, functions, plane, image):  # type: ignore[no-untyped-def]
    """Fill `image` (rows, 2 width) from `waves` (functions, width): `moments` transposed.

    The equator of an odd number of rows is written once, as the northern row.
    """
    rows, width = image.shape[0], image.shape[1] // 2
    planes = np.empty((4, _PIECE), image.dtype)
    for r in range(functions.shape[1]):
        near, far = image[r], image[rows - 1 - r]
        for low in range(0, width, _PIECE):
            n = min(_PIECE, width - low)
            a, b = slice(low, low + n), slice(low + width, low + width + n)
            planes[:] = 0
            for p in range(plane.size):
                _scale_and_add(planes[plane[p]], functions[p, r], waves[p, low : low + n])
            _rows(planes, near[a], near[b], far[a], far[b])
