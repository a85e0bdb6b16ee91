"""The sum over degrees that couples light and BRDF to what is reflected: the loop of `sphere/reflected.py`.

    c_jM of p, s = sum over i of weight[i, (p, s), (j, M)] kappa[p, i, l] L_l,M+s,     l = j - p + 2 i

With the weights' signs and roots as there, Re and -Im of sum over j, M of c_jM Y_jM are the real B_ps and B_p,-s.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

# Sums may be fused so that they vectorise; NaN and infinity still spread as they should.
_FAST = {"contract", "nsz"}


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _add(factor, weight, light, sums):  # type: ignore[no-untyped-def]
    real, imaginary, a, b = sums[0], sums[1], light[0], light[1]
    for i in range(weight.size):
        w = factor * weight[i]
        real[i] += w * a[i]
        imaginary[i] += w * b[i]


@njit(cache=True, nogil=True, error_model="numpy")
def couple(light, kappa, weight, out):  # type: ignore[no-untyped-def]
    """Fill `out` ((J+1)^2, (P+1)^2, C), real, all of one dtype.

    light: (2, C, (F+1)^2), real and imaginary parts in the complex harmonics. kappa: (P+1, P+1, F+1, C). weight: (P+1,
    sets of p and s >= 0, (J+1)^2). Of light and kappa either C may be 1.
    """
    exits, degree, channels = kappa.shape[0], kappa.shape[2] - 1, out.shape[2]
    highest = degree + exits - 1
    half = out.dtype.type(math.sqrt(0.5))
    sums = np.empty((channels, 2, 2 * highest + 1), out.dtype)
    for j in range(highest + 1):
        centre, k = j * (j + 1), -1
        for p in range(exits):
            for s in range(p + 1):
                k += 1
                sums[:, :, : 2 * j + 1] = 0
                for i in range(p + 1):
                    l = j - p + 2 * i
                    low, high = max(-j, -l - s), min(j, l - s) + 1
                    if 0 <= l <= degree and low < high:
                        at = l * (l + 1) + s
                        for c in range(channels):
                            factor = kappa[p, i, l, c if kappa.shape[3] > 1 else 0]
                            source = light[:, c if light.shape[1] > 1 else 0, at + low : at + high]
                            to = sums[c, :, j + low : j + high]
                            _add(factor, weight[i, k, centre + low : centre + high], source, to)
                ahead, back = p * (p + 1) + s, p * (p + 1) - s
                for c in range(channels):
                    real, imaginary = sums[c, 0], sums[c, 1]
                    if s > 0:
                        out[centre, back, c] = -imaginary[j]
                    out[centre, ahead, c] = real[j]
                    sign = -half
                    for M in range(1, j + 1):
                        # 2 Re has the complex coefficients c_M + (-1)^M conj c_-M, 2 i Im those with a minus.
                        a, b = sign * real[j + M], sign * imaginary[j + M]
                        x, y = half * real[j - M], half * imaginary[j - M]
                        if s > 0:
                            out[centre + M, back, c] = -b - y
                            out[centre - M, back, c] = x - a
                        out[centre + M, ahead, c] = a + x
                        out[centre - M, ahead, c] = y - b
                        sign = -sign
