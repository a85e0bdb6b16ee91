"""Look-ups in a table over half/difference angles: the fused loop of `brdf/table.py`, on raw arrays."""

from __future__ import annotations

import math

import numpy as np
from numba import njit


# The divisors are lengths that cannot vanish above the surface; Python's check of each division costs time.
@njit(cache=True, nogil=True, error_model="numpy")
def lookup(values: np.ndarray, wi: np.ndarray, wo: np.ndarray, nearest: bool, out: np.ndarray) -> None:
    """Fills `out` (n, C) with the table `values` (H, D, P, C) at local directions `wi`, `wo` (n, 3).

    Trilinear between the cells' centres, or the cell itself; zero where either direction lies below the surface.
    """
    H, D, P, C = values.shape
    half_pi = 0.5 * math.pi
    for k in range(wi.shape[0]):
        ix, iy, iz = wi[k, 0], wi[k, 1], wi[k, 2]
        ox, oy, oz = wo[k, 0], wo[k, 1], wo[k, 2]
        if iz <= 0 or oz <= 0:
            for c in range(C):
                out[k, c] = 0.0
            continue
        x, y, z = ix + ox, iy + oy, iz + oz
        scale = 1.0 / math.sqrt(x * x + y * y + z * z)
        x, y, z = x * scale, y * scale, z * scale
        sin_h = math.sqrt(x * x + y * y)
        cos_p, sin_p = 1.0, 0.0
        if sin_h > 0.0:
            cos_p, sin_p = x / sin_h, y / sin_h
        # wi seen from the frame whose pole is h: turned by -phi_h about z, then by -theta_h about y.
        along = cos_p * ix + sin_p * iy
        dx = z * along - sin_h * iz
        dy = cos_p * iy - sin_p * ix
        dz = sin_h * along + z * iz
        theta_h = math.atan2(sin_h, z)
        theta_d = math.atan2(math.sqrt(dx * dx + dy * dy), dz)
        phi_d = math.atan2(dy, dx)
        if phi_d < 0.0:
            phi_d += math.pi
        a = math.sqrt(theta_h / half_pi) * H
        b = theta_d / half_pi * D
        c_ = phi_d / math.pi * P
        if nearest:
            h0, d0, p0 = min(int(a), H - 1), min(int(b), D - 1), int(c_)
            p0 = p0 if p0 < P else 0
            for c in range(C):
                out[k, c] = values[h0, d0, p0, c]
            continue
        # Cells beyond theta_h = 0 and theta_d = 0 are the first ones themselves (a turn by pi), so clamping is exact.
        a = min(max(a - 0.5, 0.0), H - 1.0)
        b = min(max(b - 0.5, 0.0), D - 1.0)
        c_ = c_ - 0.5
        if c_ < 0.0:
            c_ += P
        h0, d0, p0 = int(a), int(b), int(c_)
        a, b, c_ = a - h0, b - d0, c_ - p0
        h1, d1 = min(h0 + 1, H - 1), min(d0 + 1, D - 1)
        p0 = p0 if p0 < P else 0
        p1 = p0 + 1 if p0 + 1 < P else 0
        for c in range(C):
            v00 = values[h0, d0, p0, c] * (1 - c_) + values[h0, d0, p1, c] * c_
            v01 = values[h0, d1, p0, c] * (1 - c_) + values[h0, d1, p1, c] * c_
            v10 = values[h1, d0, p0, c] * (1 - c_) + values[h1, d0, p1, c] * c_
            v11 = values[h1, d1, p0, c] * (1 - c_) + values[h1, d1, p1, c] * c_
            out[k, c] = (v00 * (1 - b) + v01 * b) * (1 - a) + (v10 * (1 - b) + v11 * b) * a
