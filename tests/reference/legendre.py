"""Plain twin of `_kernels/legendre.py`, and the functions it sums straight from their definitions."""

from math import comb, factorial

import numpy as np


def three_term(start, level, a, b, scale, t):
    """scale_i P_i(t) (steps, rings) of one order: P_0 = start 2^(512 level), P_{i+1} = (a t + b) P_i - P_{i-1}."""
    now, last = start * 2.0 ** (512.0 * level), np.zeros_like(start)
    table = []
    for i in range(a.size):
        table.append(scale[i] * now)
        now, last = (a[i] * t + b[i]) * now - last, now
    return np.array(table)


def synthesise(coefficients, start, level, a, b, scale, t):
    """sum_i coefficients[m, i, k] P_i(m, t_r), (orders, channels, rings)."""
    tables = [three_term(start[m], level[m], a[m], b[m], scale[m], t) for m in range(len(a))]
    return np.stack([coefficients[m].T @ table for m, table in enumerate(tables)])


def analyse(rings, start, level, a, b, scale, t):
    """sum_r rings[m, k, r] P_i(m, t_r), (orders, steps, channels)."""
    tables = [three_term(start[m], level[m], a[m], b[m], scale[m], t) for m in range(len(a))]
    return np.stack([table @ rings[m].T for m, table in enumerate(tables)])


def spin_weighted(spin, l, m, theta, phi):
    """sY_lm by the sum of Goldberg et al. 1967 (3.1), with the sign (-1)^m of today's usage."""
    norm = factorial(l + m) * factorial(l - m) * (2 * l + 1) / (4 * np.pi * factorial(l + spin) * factorial(l - spin))
    total = sum(
        comb(l - spin, r)
        * comb(l + spin, r + spin - m)
        * (-1.0) ** (l - r - spin)
        # cot^(2r + s - m) sin^2l of theta / 2, without a division by zero
        * np.cos(theta / 2) ** (2 * r + spin - m)
        * np.sin(theta / 2) ** (2 * l - 2 * r - spin + m)
        for r in range(max(0, m - spin), min(l - spin, l + m) + 1)
    )
    return (-1.0) ** m * np.sqrt(norm) * total * np.exp(1j * m * phi)
