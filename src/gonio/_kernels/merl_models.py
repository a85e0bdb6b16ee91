"""The models that are published as fits to MERL's materials, pair by pair: `brdf/merl_models.py` has the formulas.

As in `brdf.py`: either precision in, double within. With h = wi + wo of length l, 1 - cos theta_h and tan^2 theta_h
come from the horizontal part of h, which does not cancel for narrow highlights.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .brdf import dielectric


@njit(cache=True, nogil=True, error_model="numpy")
def abc(wi, wo, p, steps, out):  # type: ignore[no-untyped-def]
    """Parameters: kd, A, B, C, ior."""
    rows, columns, channels = out.shape
    for i in range(rows):
        for j in range(columns):
            a = i * steps[0] + j * steps[1]
            b = i * steps[2] + j * steps[3]
            q = i * steps[4] + j * steps[5]
            iz, oz = np.float64(wi[a + 2]), np.float64(wo[b + 2])
            matte = lobe = 0.0
            if iz > 0 and oz > 0:
                x, y, z = np.float64(wi[a]) + wo[b], np.float64(wi[a + 1]) + wo[b + 1], iz + oz
                flat = x * x + y * y
                l2 = flat + z * z
                l = math.sqrt(l2)
                beyond = flat / (l * (l + z))  # 1 - cos theta_h
                # G = min(1, 2 (z / l) min(iz, oz) / (l / 2)), cos theta_d = l / 2
                hidden = min(1.0, 4 * z * min(iz, oz) / l2) / (iz * oz)
                matte = 1 / math.pi
                lobe = hidden * matte * dielectric(min(0.5 * l, 1.0), p[q + 4]) * (1 + p[q + 2] * beyond) ** -p[q + 3]
            for c in range(channels):
                out[i, j, c] = p[q + 5 * c] * matte + p[q + 5 * c + 1] * lobe


@njit(cache=True, nogil=True, error_model="numpy")
def shifted_gamma(wi, wo, p, steps, out):  # type: ignore[no-untyped-def]
    """Parameters: kd, ks N, alpha, p, f0, f1, L, c, k, theta_0."""
    rows, columns, channels = out.shape
    for i in range(rows):
        for j in range(columns):
            a = i * steps[0] + j * steps[1]
            b = i * steps[2] + j * steps[3]
            q = i * steps[4] + j * steps[5]
            iz, oz = np.float64(wi[a + 2]), np.float64(wo[b + 2])
            if not (iz > 0 and oz > 0):
                out[i, j] = 0
                continue
            x, y, z = np.float64(wi[a]) + wo[b], np.float64(wi[a + 1]) + wo[b + 1], iz + oz
            flat, square = x * x + y * y, z * z
            l2 = flat + square
            cd = min(0.5 * math.sqrt(l2), 1.0)
            grazing = (1 - cd) ** 5
            rise = (l2 / square) ** 2 / (math.pi * iz * oz)
            theta_i, theta_o = math.acos(min(iz, 1.0)), math.acos(min(oz, 1.0))
            for c in range(channels):
                k = q + 10 * c
                t = p[k + 2] + flat / (square * p[k + 2])
                lobe = 0.0
                if t < 700:
                    F = p[k + 4] - p[k + 5] * cd + (1 - p[k + 4]) * grazing
                    seen = _seen(theta_i, p[k + 6], p[k + 7], p[k + 8], p[k + 9])
                    seen *= _seen(theta_o, p[k + 6], p[k + 7], p[k + 8], p[k + 9])
                    lobe = p[k + 1] * rise * math.exp(-t) * t ** -p[k + 3] * F * seen
                out[i, j, c] = max(p[k] + lobe, 0.0) / math.pi


@njit(cache=True, nogil=True, error_model="numpy")
def _seen(theta, L, c, k, theta_0):  # type: ignore[no-untyped-def]
    """G of one direction, in [0, 1]."""
    beyond = theta - theta_0
    if beyond <= 0:
        return 1.0
    return min(max(1 - L * math.expm1(min(c * beyond**k, 80.0)), 0.0), 1.0)
