"""Look-ups in a half/difference table, one pair at a time, straight from Rusinkiewicz 1998 and MERL's layout."""

import math

import numpy as np


def angles(wi, wo):
    """(theta_h, theta_d, phi_d), phi_d in [0, pi): wi is turned by -phi_h about z, then by -theta_h about y."""
    h = np.add(wi, wo) / np.linalg.norm(np.add(wi, wo))
    theta_h, phi_h = math.acos(min(h[2], 1.0)), math.atan2(h[1], h[0])
    c, s = math.cos(phi_h), math.sin(phi_h)
    about_z = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    c, s = math.cos(theta_h), math.sin(theta_h)
    about_y = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    d = about_y @ about_z @ wi
    return theta_h, math.acos(min(d[2], 1.0)), math.atan2(d[1], d[0]) % math.pi


def nearest(values, wi, wo):
    """The cell that MERL's own reader finds: the integer part of each index."""
    H, D, P, _ = values.shape
    theta_h, theta_d, phi_d = angles(wi, wo)
    j = int(math.sqrt(theta_h / (math.pi / 2)) * H)
    return values[min(j, H - 1), min(int(theta_d / (math.pi / 2) * D), D - 1), int(phi_d / math.pi * P) % P]


def trilinear(values, wi, wo):
    """The sum over eight cells, each weighted by the opposite box; centres stand at + 1/2."""
    H, D, P, C = values.shape
    theta_h, theta_d, phi_d = angles(wi, wo)
    x = np.array([math.sqrt(theta_h / (math.pi / 2)) * H, theta_d / (math.pi / 2) * D, phi_d / math.pi * P]) - 0.5
    low = np.floor(x).astype(int)
    total = np.zeros(C)
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, x - low, 1 - (x - low)))
        j, k, m = low + corner
        total += weight * values[min(max(j, 0), H - 1), min(max(k, 0), D - 1), m % P]
    return total
