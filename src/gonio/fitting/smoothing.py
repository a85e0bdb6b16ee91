"""Radial functions fitted to many more samples than there are centres: what noise and outliers cannot pull.

    least over lambda, c of  (N / sum w^2) sum_i w_i^2 |g_i - s(q_i)|^2  -  rho lambda^T Psi lambda,     P^T lambda = 0

An interpolant goes through the values at its centres (RS 10), and the greedy choice makes centres of the worst samples:
in photographs those are shadows, edges and noise. Here the centres say only where the surface may bend. The penalty is
that of RS 10, for as many samples as centres: rho means the same there and here.

Solved by normal equations, in float64, with the constraint taken out by d + 1 anchors, as in `radial_basis`. Some
twenty samples a centre are enough, drawn evenly.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.distance import cdist

from ..arrays import to_numpy
from ..brdf.radial import Interpolant
from .radial_basis import anchors

_EACH = 20  # samples for each centre
_WORK = 1e11  # products that may be summed before fewer samples are taken, to no less than four a centre
_BLOCK = 4096
_RIDGE = 1e-10  # of the diagonal's mean: what rounding leaves of directions that no sample tells about


def smoothed(
    interpolant: Interpolant, points: np.ndarray, values: np.ndarray, weights: np.ndarray, seed: int = 0
) -> Interpolant:
    """The interpolant with its coefficients refitted to samples, as stiff as it is: points (M, d), values (M, C),
    weights (M,) >= 0."""
    C = to_numpy(interpolant.centres) * interpolant.scales
    n, p = len(C), C.shape[1] + 1
    m = int(min(len(points), max(4 * n, min(_EACH * n, _WORK / n**2))))
    some = np.random.default_rng(seed).permutation(len(points))[:m]
    Q, g, w = points[some] * interpolant.scales, values[some], weights[some]
    w = w * np.sqrt(n / np.sum(w**2))
    # About the middle, as large as 1, since places may lie far from their origin.
    middle, extent = (C.max(axis=0) + C.min(axis=0)) / 2, np.ptp(C, axis=0) / 2
    P = np.column_stack((np.ones(n), (C - middle) / extent))
    T = anchors(C)
    rest = np.setdiff1d(np.arange(n), T)
    A = np.linalg.solve(P[T].T, P[rest].T).T
    gram, moment = np.zeros((n, n)), np.zeros((n, g.shape[1]))
    for low in range(0, m, _BLOCK):
        q = Q[low : low + _BLOCK]
        R = cdist(q, C)
        plane = np.ones(len(q)), (q - middle) / extent
        basis = np.column_stack((R[:, rest] - R[:, T] @ A.T, *plane)) * w[low : low + _BLOCK, None]
        gram += basis.T @ basis
        moment += basis.T @ (g[low : low + _BLOCK] * w[low : low + _BLOCK, None])
    Psi = cdist(C, C)
    across = A @ Psi[np.ix_(T, rest)]
    bent = Psi[np.ix_(rest, rest)] - across - across.T + A @ Psi[np.ix_(T, T)] @ A.T
    gram[: n - p, : n - p] -= interpolant.rho * bent
    gram[np.diag_indices(n)] += _RIDGE * np.trace(gram) / n
    x = cho_solve(cho_factor(gram, overwrite_a=True), moment)
    coefficients = np.empty((n, g.shape[1]))
    coefficients[rest], coefficients[T] = x[: n - p], -A.T @ x[: n - p]
    polynomial = x[n - p :]
    polynomial[1:] /= extent[:, None]
    polynomial[0] -= middle @ polynomial[1:]
    return dataclasses.replace(interpolant, coefficients=coefficients, polynomial=polynomial)
