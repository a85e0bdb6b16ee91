"""Wigner's d by its explicit sum (Wigner 1931), and rotations of real coefficients by it: slow, exact for small l."""

from math import cos, factorial, sin, sqrt

import numpy as np


def wigner_d(l, angle):
    """d^l_mk(angle), rows m and columns k = -l..l."""
    d = np.zeros((2 * l + 1, 2 * l + 1))
    c, s = cos(angle / 2), sin(angle / 2)
    for m in range(-l, l + 1):
        for k in range(-l, l + 1):
            root = sqrt(factorial(l + m) * factorial(l - m) * factorial(l + k) * factorial(l - k))
            for n in range(max(0, k - m), min(l + k, l - m) + 1):
                below = factorial(l + k - n) * factorial(n) * factorial(m - k + n) * factorial(l - m - n)
                d[m + l, k + l] += (
                    (-1) ** (m - k + n) * root / below * c ** (2 * l + k - m - 2 * n) * s ** (m - k + 2 * n)
                )
    return d


def rotate(coefficients, alpha, beta, gamma):
    """Real coefficients (n,) of the function turned by R_z(beta) R_y(alpha) R_z(gamma), by way of the complex ones."""
    degree = round(sqrt(len(coefficients))) - 1
    turned = np.empty(len(coefficients))
    for l in range(degree + 1):
        real = coefficients[l * l : (l + 1) ** 2]
        f = np.empty(2 * l + 1, dtype=complex)
        for m in range(1, l + 1):
            f[l + m] = (-1) ** m * (real[l + m] - 1j * real[l - m]) / sqrt(2)
            f[l - m] = (real[l + m] + 1j * real[l - m]) / sqrt(2)
        f[l] = real[l]
        m = np.arange(-l, l + 1)
        f = np.exp(-1j * m * beta) * (wigner_d(l, alpha) @ (np.exp(-1j * m * gamma) * f))
        part = turned[l * l : (l + 1) ** 2]
        for m in range(1, l + 1):
            part[l + m] = (-1) ** m * sqrt(2) * f[l + m].real
            part[l - m] = -((-1) ** m) * sqrt(2) * f[l + m].imag
        part[l] = f[l].real
    return turned
