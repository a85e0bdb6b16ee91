"""Plain twins of `_kernels/row_pairs.py` and `_kernels/packing.py`."""

import numpy as np


def image(lines, rows):
    """The rows (rows, columns C) whose northern ones are sum + difference, and whose mirror images sum - difference."""
    channels = lines.shape[0] // 2
    even, odd = lines[:channels].transpose(1, 2, 0), lines[channels:].transpose(1, 2, 0)
    return np.concatenate((even + odd, (even - odd)[: rows // 2][::-1])).reshape(rows, -1)


def turn(quarter, of_sine, of_odd):
    """A quarter (..., columns / 4) continued around the turn with the signs of cos or sin(m phi), m even or odd."""
    sign = -1 if of_odd else 1  # cos(m (pi + phi)) = (-1)^m cos(m phi), and so the sine
    mirror = -1 if of_sine else 1
    half = np.concatenate((quarter, sign * mirror * quarter[..., ::-1]), axis=-1)
    return np.concatenate((half, sign * half), axis=-1)


def pack(flat, degree, g, norms, low, orders, steps):
    """(orders, steps, 4 C): even l - m as they are; odd ones as h of f_{l+1} = g_l h_l + g_{l+1} h_{l+2}, solved."""
    channels = flat.shape[1]
    packed = np.zeros((orders, steps, 4 * channels))
    for i in range(orders):
        m = low + i
        l = np.arange(m, degree + 1)
        z = norms[0, m] * flat[l * (l + 1) + m] + 1j * norms[1, m] * flat[l * (l + 1) - m]
        even, odd = z[0::2], z[1::2]
        n = odd.shape[0]
        at = m + 2 * np.arange(n)
        coupling = np.diag(g(at, m)) + np.diag(g(at + 1, m)[: n - 1], 1) if n else np.zeros((0, 0))
        odd = np.linalg.solve(coupling, odd)
        packed[i, : even.shape[0], : 2 * channels] = np.concatenate((even.real, even.imag), axis=1)
        packed[i, :n, 2 * channels :] = np.concatenate((odd.real, odd.imag), axis=1)
    return packed
