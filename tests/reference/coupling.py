"""Plain twin of `_kernels/coupling.py`."""

import math

import numpy as np


def couple(light, kappa, weight):
    """Real coefficients of Re and -Im of the sums, one at a time; Y_j,-M = (-1)^M conj Y_jM."""
    exits, degree = kappa.shape[0], kappa.shape[2] - 1
    L = np.broadcast_to(light[0].T + 1j * light[1].T, (light.shape[2], max(light.shape[1], kappa.shape[3])))
    out = np.zeros((weight.shape[2], exits**2, L.shape[1]))
    sets = [(p, s) for p in range(exits) for s in range(p + 1)]
    for j in range(degree + exits):
        for k, (p, s) in enumerate(sets):
            for M in range(-j, j + 1):
                for i in range(p + 1):
                    l = j - p + 2 * i
                    if 0 <= l <= degree and abs(M + s) <= l:
                        c = weight[i, k, j * (j + 1) + M] * kappa[p, i, l] * L[l * (l + 1) + M + s]
                        # Y_jM = (-1)^M (y_M + i y_-M) / sqrt2, Y_j,-M = (y_M - i y_-M) / sqrt2 in real harmonics y
                        norm = (-1.0) ** max(M, 0) / (math.sqrt(2) if M else 1)
                        for y, part in ((abs(M), norm), (-abs(M), norm * 1j * np.sign(M))):
                            out[j * (j + 1) + y, p * (p + 1) + s] += (c * part).real
                            if s:
                                out[j * (j + 1) + y, p * (p + 1) - s] -= (c * part).imag
    return out
