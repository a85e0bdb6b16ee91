"""Mixtures of tabulated facet distributions one pair of directions at a time, straight from MS 5, 6 and 18."""

import math

from reference import brdf as plain


def between(table, row, phi):
    """`table` (rows, columns) at a row, which need not be whole, and an azimuth: bilinear, periodic."""
    rows, columns = table.shape
    column = phi % (2 * math.pi) / (2 * math.pi) * columns
    r, c = min(int(row), rows - 2), int(column) % columns
    v, u = row - r, column - int(column)
    total = 0.0
    for i, a in ((r, 1 - v), (r + 1, v)):
        for j, b in ((c, 1 - u), ((c + 1) % columns, u)):
            total += a * b * float(table[i, j])
    return total


def distribution(h, tables, warp, indices, weights):
    """D of MS 18."""
    row = (math.acos(min(h[2], 1.0)) / (math.pi / 2)) ** (1 / warp) * (tables.shape[1] - 1)
    phi = math.atan2(h[1], h[0])
    return max(sum(w * between(tables[j], row, phi) for j, w in zip(indices, weights, strict=True)), 0.0)


def area(k, areas, indices, weights):
    """g of MS 18, from tables of the g_j."""
    half = math.tan(math.acos(k[2]) / 2)
    row = (1 - math.sqrt(1 - half)) * (areas.shape[1] - 1)
    phi = math.atan2(k[1], k[0])
    return max(sum(w * between(areas[j], row, phi) for j, w in zip(indices, weights, strict=True)), float(k[2]))


def value(wi, wo, tables, areas, warp, indices, weights, k_d, k_s, eta):
    """MS 6 of one channel; the cosines of MS 4 and 5 are left in."""
    *_, h = plain.angles(wi, wo)
    D = distribution(h, tables, warp, indices, weights)
    S = [w[2] / area(w, areas, indices, weights) for w in (wi, wo)]
    cosine = sum(a * b for a, b in zip(h, wo, strict=True))
    F = plain.fresnel(cosine, eta) / plain.fresnel(1.0, eta)
    return k_d / math.pi + k_s * D * S[0] * S[1] * F / (4 * wi[2] * wo[2])
