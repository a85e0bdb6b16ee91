"""Radial functions one point at a time, straight from RS 7, 9, 10 and 11, in double precision."""

import math

import numpy as np
from reference import half_difference


def coordinates(wi, wo, folded=False, flat=False, place=()):
    """(x, y, u, v, w) of RS 7 and 13."""
    theta_h, theta_d, phi_d = half_difference.angles(wi, wo)
    v = math.sin(theta_h) * math.sin(2 * phi_d)
    q = [*place, math.sin(theta_h) * math.cos(2 * phi_d), abs(v) if folded else v]
    return np.array(q if flat else [*q, 2 * theta_d / math.pi])


def value(q, centres, scales, coefficients, polynomial):
    """RS 9 with RS 11: the polynomial of M q, and the distances in turn."""
    total = np.array(polynomial[0], dtype=float)
    for a in range(len(q)):
        total += polynomial[a + 1] * scales[a] * q[a]
    for centre, weight in zip(centres, coefficients, strict=True):
        total += weight * math.sqrt(sum((scales[a] * (q[a] - centre[a])) ** 2 for a in range(len(q))))
    return total


def fitted(centres, scales, values):
    """(coefficients, polynomial) of RS 10, by one dense solve."""
    n, d = centres.shape
    scaled = centres * scales
    matrix = np.zeros((n + d + 1, n + d + 1))
    for i in range(n):
        matrix[i, :n] = np.linalg.norm(scaled[i] - scaled, axis=1)
    matrix[:n, n] = matrix[n, :n] = 1
    matrix[:n, n + 1 :] = scaled
    matrix[n + 1 :, :n] = scaled.T
    found = np.linalg.solve(matrix, np.concatenate((values, np.zeros((d + 1, values.shape[1])))))
    return found[:n], found[n:]
