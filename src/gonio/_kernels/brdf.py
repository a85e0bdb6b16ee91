"""BRDFs of one lobe, pair by pair; the formulas stand in `brdf/`. How the arrays are walked: `brdf/pairs.py`.

All loops take single or double precision and reckon in double, which costs nothing: their time goes to powers,
exponentials and roots. No fastmath: what is zero, infinite or NaN matters here.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

LAMBERT, OREN_NAYAR, PHONG, MODIFIED_PHONG, BLINN_PHONG, WARD, BOUNDED_WARD = range(7)


@njit(cache=True, nogil=True, error_model="numpy")
def one_colour(wi, wo, p, steps, out, model):  # type: ignore[no-untyped-def]
    """f = colour x lobe; parameters: colour, a, b (what a and b mean: `_lobe`)."""
    rows, columns, channels = out.shape
    for i in range(rows):
        for j in range(columns):
            a = i * steps[0] + j * steps[1]
            b = i * steps[2] + j * steps[3]
            q = i * steps[4] + j * steps[5]
            iz, oz = np.float64(wi[a + 2]), np.float64(wo[b + 2])
            value = 0.0
            if iz > 0 and oz > 0:
                ix, iy, ox, oy = np.float64(wi[a]), np.float64(wi[a + 1]), np.float64(wo[b]), np.float64(wo[b + 1])
                value = _lobe(model, ix, iy, iz, ox, oy, oz, p[q + 1], p[q + 2])
            for c in range(channels):
                out[i, j, c] = p[q + 3 * c] * value


@njit(cache=True, nogil=True, error_model="numpy")
def _lobe(model, ix, iy, iz, ox, oy, oz, a, b):  # type: ignore[no-untyped-def]
    if model == LAMBERT:
        return 1 / math.pi
    if model == OREN_NAYAR:  # a, b: A / pi and B / pi of the model
        return a + b * max(ix * ox + iy * oy, 0.0) / max(iz, oz)
    if model in (PHONG, MODIFIED_PHONG):  # a: exponent, b: what the lobe is multiplied by
        cosine = iz * oz - ix * ox - iy * oy
        if cosine <= 0:
            return 0.0
        lobe = b * cosine**a
        return lobe / iz if model == PHONG else lobe
    x, y, z = ix + ox, iy + oy, iz + oz
    if model == BLINN_PHONG:
        return b * (z * z / (x * x + y * y + z * z)) ** (0.5 * a)
    # Ward; a, b: 1 / alpha_x and 1 / alpha_y
    x2 = (x * a) ** 2 + (y * b) ** 2
    z2 = z * z
    if x2 > 700 * z2:
        return 0.0
    lobe = math.exp(-x2 / z2) * a * b / math.pi
    if model == WARD:
        return 0.25 * lobe / math.sqrt(iz * oz)
    return lobe * (x * x + y * y + z2) / (z2 * z2)


@njit(cache=True, nogil=True, error_model="numpy")
def lafortune(wi, wo, p, steps, out):  # type: ignore[no-untyped-def]
    """Parameters: C_x, C_y, C_z, n."""
    rows, columns, channels = out.shape
    for i in range(rows):
        for j in range(columns):
            a = i * steps[0] + j * steps[1]
            b = i * steps[2] + j * steps[3]
            q = i * steps[4] + j * steps[5]
            iz, oz = np.float64(wi[a + 2]), np.float64(wo[b + 2])
            lit = iz > 0 and oz > 0
            x, y, z = wi[a] * np.float64(wo[b]), wi[a + 1] * np.float64(wo[b + 1]), iz * oz
            for c in range(channels):
                k = q + 4 * c
                cosine = p[k] * x + p[k + 1] * y + p[k + 2] * z
                out[i, j, c] = cosine ** p[k + 3] if lit and cosine > 0 else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def kajiya_kay(wi, wo, p, steps, out):  # type: ignore[no-untyped-def]
    """Parameters: what the diffuse and the specular term are multiplied by, s."""
    rows, columns, channels = out.shape
    for i in range(rows):
        for j in range(columns):
            a = i * steps[0] + j * steps[1]
            b = i * steps[2] + j * steps[3]
            q = i * steps[4] + j * steps[5]
            iz, oz = np.float64(wi[a + 2]), np.float64(wo[b + 2])
            diffuse = specular = 0.0
            if iz > 0 and oz > 0:
                ix, iy, ox, oy = np.float64(wi[a]), np.float64(wi[a + 1]), np.float64(wo[b]), np.float64(wo[b + 1])
                diffuse = math.sqrt(iy * iy + iz * iz)
                cosine = diffuse * math.sqrt(oy * oy + oz * oz) - ix * ox
                if cosine > 0:
                    specular = cosine ** p[q + 2]
            for c in range(channels):
                out[i, j, c] = p[q + 3 * c] * diffuse + p[q + 3 * c + 1] * specular


@njit(cache=True, nogil=True, error_model="numpy")
def torrance_sparrow(wi, wo, p, steps, out):  # type: ignore[no-untyped-def]
    """Parameters: K_d / pi, K_s / (4 pi sigma^2 F(mu, 0)), mu, 1 / sigma."""
    rows, columns, channels = out.shape
    for i in range(rows):
        for j in range(columns):
            a = i * steps[0] + j * steps[1]
            b = i * steps[2] + j * steps[3]
            q = i * steps[4] + j * steps[5]
            iz, oz = np.float64(wi[a + 2]), np.float64(wo[b + 2])
            diffuse = specular = 0.0
            if iz > 0 and oz > 0:
                diffuse = 1.0
                x, y, z = np.float64(wi[a]) + wo[b], np.float64(wi[a + 1]) + wo[b + 1], iz + oz
                t = math.atan2(math.sqrt(x * x + y * y), z) * p[q + 3]
                if t < 26:
                    specular = dielectric(min(oz, 1.0), p[q + 2]) * math.exp(-t * t) / (iz * oz)
            for c in range(channels):
                out[i, j, c] = p[q + 4 * c] * diffuse + p[q + 4 * c + 1] * specular


@njit(cache=True, nogil=True, error_model="numpy")
def dielectric(c, eta):  # type: ignore[no-untyped-def]
    """MS 3 at a cosine in [0, 1]."""
    g = math.sqrt(max(eta * eta - 1 + c * c, 1e-300))
    # Both quotients of MS 3 over one denominator: divisions are what these loops wait for.
    near, far = g - c, g + c
    up, down = c * far - 1, c * near + 1
    quotient = near / (far * down)
    return 0.5 * quotient * quotient * (down * down + up * up)
