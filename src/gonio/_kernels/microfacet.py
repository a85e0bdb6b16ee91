"""D G F / (4 cos theta_i cos theta_o) for Beckmann and GGX, pair by pair; the formulas stand in `brdf/`.

h = wi + wo is not normalised: its length l goes into D as l^4, and wi.h / l = l / 2. g(w) is the area that facets show
to w, and G / (cos theta_i cos theta_o) is written with it, so that grazing angles stay finite (`brdf/shadowing.py`).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .brdf import dielectric

BECKMANN, GGX = range(2)
CORRELATED, SEPARABLE, GROOVE = range(3)
DIELECTRIC, CONDUCTOR, SCHLICK = range(3)


@njit(cache=True, nogil=True, error_model="numpy")
def microfacet(wi, wo, p, steps, out, ndf, shadowing, fresnel):  # type: ignore[no-untyped-def]
    """Parameters: alpha_x, alpha_y, and the Fresnel term's two (eta; eta, k; f0)."""
    rows, columns, channels = out.shape
    last_o = last_p = -1
    go = 0.0
    for i in range(rows):
        for j in range(columns):
            a = i * steps[0] + j * steps[1]
            b = i * steps[2] + j * steps[3]
            q = i * steps[4] + j * steps[5]
            iz, oz = np.float64(wi[a + 2]), np.float64(wo[b + 2])
            value = cosine = 0.0
            if iz > 0 and oz > 0:
                ix, iy, ox, oy = np.float64(wi[a]), np.float64(wi[a + 1]), np.float64(wo[b]), np.float64(wo[b + 1])
                ax, ay = p[q], p[q + 1]
                x, y, z = ix + ox, iy + oy, iz + oz
                l2 = x * x + y * y + z * z
                cosine = min(0.5 * math.sqrt(l2), 1.0)
                value = _facets(ndf, x, y, z, l2, ax, ay)
                if value > 0:
                    if shadowing == GROOVE:
                        value *= 0.25 * min(1 / min(iz, oz), 4 * z / l2) / max(iz, oz)
                    else:
                        if b != last_o or q != last_p:  # one view, many lights: its area is known
                            go = _area(ndf, ox, oy, oz, ax, ay)
                            last_o, last_p = b, q
                        gi = _area(ndf, ix, iy, iz, ax, ay)
                        if shadowing == CORRELATED:
                            value *= 0.25 / (gi * oz + go * iz - iz * oz)
                        else:
                            value *= 0.25 / (gi * go)
            for c in range(channels):
                out[i, j, c] = value * _reflected(fresnel, cosine, p[q + 4 * c + 2], p[q + 4 * c + 3])


@njit(cache=True, nogil=True, error_model="numpy")
def _facets(ndf, x, y, z, l2, ax, ay):  # type: ignore[no-untyped-def]
    """D at (x, y, z) / sqrt(l2)."""
    inverse = 1 / (ax * ay)
    x, y = x * ay * inverse, y * ax * inverse
    z2 = z * z
    e = x * x + y * y
    if ndf == GGX:
        t = l2 / (e + z2)
        return inverse * t * t / math.pi
    if e > 700 * z2:
        return 0.0
    t = 1 / z2
    return math.exp(-e * t) * (l2 * t) ** 2 * inverse / math.pi


@njit(cache=True, nogil=True, error_model="numpy")
def _area(ndf, x, y, z, ax, ay):  # type: ignore[no-untyped-def]
    """g(w)."""
    x, y = x * ax, y * ay
    s = x * x + y * y
    if ndf == GGX:
        return 0.5 * (z + math.sqrt(s + z * z))
    # g = z + s/2 exp(-a^2) w(a), a = z/s: one exponential instead of two and an error function.
    s = max(math.sqrt(s), 1e-150)
    r = 1 / (s * (s + 0.5 * z))
    a = z * (s + 0.5 * z) * r
    return z + 0.5 * s * _hidden(s * s * r) * math.exp(-a * a)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _hidden(t):  # type: ignore[no-untyped-def]
    """w(a) = 1/sqrt(pi) - a erfcx(a) at t = 1 / (1 + a/2).

    A polynomial through w at 80 Chebyshev nodes of a in [0, 6], beyond which the exponential leaves nothing of it; g
    comes out to 2e-11 of itself. In pairs, then pairs of pairs: half as long a chain as Horner's.
    """
    t2 = t * t
    t4 = t2 * t2
    low = (-1.8629820313448286e-05 + 0.00052510026574242863 * t) + (0.06381900448248834 + 0.19231756253363669 * t) * t2
    middle = (-0.07618341016244301 + 1.1096655268461069 * t) + (-2.2811051081681866 + 4.3527457693174565 * t) * t2
    high = (-5.6487856138741606 + 4.5061822553234698 * t) + (-2.1794642662404211 + 0.59590897210807381 * t) * t2
    return low + t4 * (middle + t4 * (high + t4 * -0.071417579073061316))


@njit(cache=True, nogil=True, error_model="numpy")
def _reflected(fresnel, c, first, second):  # type: ignore[no-untyped-def]
    """F at the cosine c."""
    if fresnel == DIELECTRIC:
        return dielectric(c, first)
    if fresnel == SCHLICK:
        m = 1 - c
        m2 = m * m
        return first + (1 - first) * m2 * m2 * m
    c2 = c * c
    s2 = 1 - c2
    t = first * first - second * second - s2
    m = math.sqrt(t * t + 4 * first * first * second * second)
    ac = math.sqrt(max(0.5 * (m + t), 0.0)) * c
    s_part, top = m + c2, c2 * m + s2 * s2
    low = max((s_part + 2 * ac) * (top + 2 * ac * s2), 1e-300)
    return (s_part - 2 * ac) * top / low
