"""The adaptive parameterisation of Dupuy and Jakob 2018, one pair at a time in double precision.

The warp of section 4: a bilinear density on the unit square, its marginal over y and conditional over x, integrated
trapezoid by trapezoid. A slice is interpolated in density, hence in every integral of it.
"""

import math

import numpy as np


def place(n, u):
    """Index and fraction of u among n knots over [0, 1]."""
    x = min(max(u, 0.0), 1.0) * (n - 1)
    k = min(int(x), n - 2)
    return k, x - k


def bilinear(table, x, y):
    (row, fy), (column, fx) = place(table.shape[0], y), place(table.shape[1], x)
    box = table[row : row + 2, column : column + 2]
    return np.array([1 - fy, fy]) @ box @ np.array([1 - fx, fx])


def integral(values, u):
    """The integral from 0 to u of the line through `values` over [0, 1]."""
    k, f = place(len(values), u)
    whole = sum(0.5 * (values[j] + values[j + 1]) for j in range(k))
    last = values[k] + f * (values[k + 1] - values[k])
    return (whole + 0.5 * f * (values[k] + last)) / (len(values) - 1)


def unwarp(table, x, y):
    """The uniform point that is warped to (x, y) for the density `table`, and the normalised density there."""
    rows = np.array([integral(row, 1.0) for row in table])
    total = integral(rows, 1.0)
    r, f = place(len(rows), y)
    line = (1 - f) * table[r] + f * table[r + 1]
    return integral(line, x) / integral(line, 1.0), integral(rows, y) / total, bilinear(table, x, y) / total


def square(w):
    return math.sqrt(2 * math.atan2(math.hypot(w[0], w[1]), w[2]) / math.pi), math.atan2(w[1], w[0])


def slice_of(knots, tables, x):
    """`tables` (n, ...) interpolated at x, held at the ends."""
    if len(knots) == 1:
        return tables[0]
    k = int(np.clip(np.searchsorted(knots, x) - 1, 0, len(knots) - 2))
    f = min(max((x - knots[k]) / (knots[k + 1] - knots[k]), 0.0), 1.0)
    return (1 - f) * tables[k] + f * tables[k + 1]


def reflect(material, wi, wo):
    """(f, pdf) of an `AdaptiveTable`, straight from equations 10 and 15 of the paper."""
    wi, wo = np.array(wi, float), np.array(wo, float)
    phi = material.phi.astype(float)
    isotropic = len(phi) <= 2
    folds = 1 if isotropic else round(2 * math.pi / (phi[-1] - phi[0]))
    if folds > 1:
        sy = -1 if wo[1] >= 0 else 1
        sx = (-1 if wo[0] >= 0 else 1) if folds == 4 else sy
        wi[:2] *= sx, sy
        wo[:2] *= sx, sy
    m = (wi + wo) / np.linalg.norm(wi + wo)
    (uo, phi_o), (um, phi_m) = square(wo), square(m)
    vm = ((phi_m - (phi_o if isotropic else 0) + math.pi) / (2 * math.pi)) % 1.0
    theta_o = uo * uo * math.pi / 2

    def at_eye(tables):
        tables = tables.astype(float)
        return slice_of(material.theta.astype(float), slice_of(phi, tables, phi_o), theta_o)

    def normalised(tables):
        totals = np.array([[integral([integral(r, 1.0) for r in t], 1.0) for t in row] for row in tables.astype(float)])
        return tables / totals[..., None, None]

    x, y, density = unwarp(at_eye(normalised(material.vndf)), um, vm)
    rgb = np.array([bilinear(channel, x, y) for channel in at_eye(material.rgb)])
    if material.jacobian:
        area = bilinear(material.sigma.astype(float), uo, (phi_o + math.pi) / (2 * math.pi))
        rgb *= bilinear(material.ndf.astype(float), um, vm) / (4 * area)
    stretch = 2 * math.pi**2 * um * math.hypot(m[0], m[1]) * 4 * (wo @ m)
    pdf = density * bilinear(at_eye(normalised(material.luminance)), x, y) / stretch
    return np.maximum(rgb, 0) / wi[2], pdf
