"""Interpolation of scattered values by radial functions, where centres are added as one goes (RS 9-11).

    s(q) = P(q) c + sum_i lambda_i |M (q - q_i)|,      P(q) = (1, M q),      M = diag(scales)

    (Psi - rho I) lambda + P c = g,      P^T lambda = 0,      Psi_ij = |M (q_i - q_j)|,      rho >= 0

rho = 0 interpolates; rho > 0 is RS's stiffness, which lets the surface pass beside the values by rho lambda_i. It is
subtracted, since Psi is negative definite on the lambda with P^T lambda = 0: there rho I - Psi is positive definite.

d + 1 of the centres, the anchors T, carry the condition away. With a(q) = P(q) P_T^-1 all else is a system of

    kappa(q, q') = -|q - q'| + a(q) Psi_T(q') + Psi_T(q) a(q') - a(q) (Psi_TT - rho I) a(q') + rho [q is q']

which is positive definite, so that a block of centres adds rows to its Cholesky factor and changes none. Those rows are
Newton's: they tell what a candidate's residual would be after each centre that is added, before any is.

Not here: other radial functions, polynomials of other orders, iterative or fast multipole solvers. Direct ones serve to
some 20,000 centres.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import solve_triangular
from scipy.spatial.distance import cdist

from ..arrays import Array, require_finite, to_numpy
from ..brdf.radial import Interpolant
from ..errors import MEMORY_LIMIT, ArrayError, MemoryLimitError, ParameterError

_FLAT = 1e-5  # of the extent, less is rounding: half angles in single precision are as exact
_SAME = 1e-11  # of the largest kappa: a pivot below it is one centre given twice
_BLOCK = 192  # rows solved at once; products of blocks do the rest


class RadialSystem:
    """The system of centres added so far, in float64. Memory is 8 N^2 bytes, of which half is touched.

    scales: (d,) > 0, the diagonal of M. rho: >= 0, in units of M q.
    most: how many centres room is made for at first; it grows beyond.
    Raises `ParameterError` where scales or rho lie outside, `MemoryLimitError` where `most` centres need too much.
    """

    def __init__(self, scales: Array | Sequence[float], rho: float = 0.0, most: int = 256) -> None:
        self.scales = np.array(to_numpy(scales), dtype=np.float64)
        if self.scales.ndim != 1 or not self.scales.size or not (np.isfinite(self.scales) & (self.scales > 0)).all():
            raise ParameterError(
                f"scales are {self.scales.tolist()}; one finite scale > 0 for each coordinate is wanted."
            )
        if not 0 <= rho < np.inf:
            raise ParameterError(f"rho is {rho:g}; a stiffness lies in [0, inf).")
        self.rho = float(rho)
        self.count = 0
        self._most = most
        _require_memory(most)

    def add(self, points: Array, values: Array) -> np.ndarray:
        """Add centres (b, d), unscaled, with values (b, C); True (b,) for each that was taken.

        What is a centre already is left out where rho = 0, since it makes the system singular. The first call brings
        the anchors, and so raises `ArrayError` where its points lie in a plane: drop a coordinate then.
        """
        q, g = self._checked(points, values)
        if self.count == 0:
            return self._begin(q, g)
        taken = self._extend(q, g)
        self.count += int(np.count_nonzero(taken))
        return taken

    def solve(self) -> Interpolant:
        """The interpolant of all centres, in the order of their coming."""
        if self.count == 0:
            raise ArrayError("there are no centres yet: add some, d + 1 at least.")
        n = self.count - self._anchors.size
        mu = _backward(self._L[:n, :n], self._y[:n])
        weights = np.concatenate((self._a[:n].T @ mu, -mu))
        polynomial = (
            self._g_T - cdist(self._T, self.scaled_centres) @ weights + self.rho * weights[: self._anchors.size]
        )
        polynomial = self._inverse_T @ polynomial
        # The basis was (1, (M q - middle) / extent).
        polynomial[1:] /= self._extent[:, None]
        polynomial[0] -= self._middle @ polynomial[1:]
        order = np.argsort(self._order, kind="stable")
        centres = self.scaled_centres[order] / self.scales
        return Interpolant(centres, self.scales, weights[order], polynomial, rho=self.rho)

    def candidates(self, points: Array, values: Array) -> Candidates:
        """Candidates (m, d) with values (m, C), and their residuals now and after each that is picked."""
        if self.count == 0:
            raise ArrayError("there are no centres yet: add some, d + 1 at least.")
        q, g = self._checked(points, values)
        left, right, difference = self._projected(q, g)
        n = self.count - self._anchors.size
        rows = _forward(self._L[:n, :n], self._kernel(slice(0, n), q, right))
        schur = left @ right.T - cdist(q, q) - rows.T @ rows
        schur[np.diag_indices_from(schur)] += self.rho
        return Candidates(difference - rows.T @ self._y[:n], schur, _SAME * self._largest)

    def _checked(self, points: Array, values: Array) -> tuple[np.ndarray, np.ndarray]:
        q = np.asarray(to_numpy(points), dtype=np.float64)
        g = np.asarray(to_numpy(values), dtype=np.float64)
        d = self.scales.size
        if q.ndim != 2 or q.shape[1] != d or g.ndim != 2 or len(g) != len(q):
            raise ArrayError(f"points and values have shapes {q.shape} and {g.shape}; expected (b, {d}) and (b, C).")
        if self.count and g.shape[1] != self._g_T.shape[1]:
            raise ArrayError(f"values have {g.shape[1]} channels; those before have {self._g_T.shape[1]}.")
        require_finite(q, "points")
        require_finite(g, "values")
        return q * self.scales, g

    def _begin(self, q: np.ndarray, g: np.ndarray) -> np.ndarray:
        chosen = anchors(q)
        low, high = q.min(axis=0), q.max(axis=0)
        self._middle, self._extent = (low + high) / 2, (high - low) / 2
        self._anchors, self._T, self._g_T = chosen, q[chosen], g[chosen]
        self._inverse_T = np.linalg.inv(self._basis(self._T))
        self._inner = cdist(self._T, self._T) - self.rho * np.eye(chosen.size)
        self._largest = 0.0
        d, channels = self.scales.size, g.shape[1]
        size = max(self._most, 1)
        self._L = np.empty((size, size))
        self._y, self._q = np.empty((size, channels)), np.empty((size, d))
        self._a, self._left = np.empty((size, d + 1)), np.empty((size, 2 * d + 2))
        self.count = chosen.size
        others = np.setdiff1d(np.arange(len(q)), chosen)
        taken = np.ones(len(q), bool)
        if others.size:
            taken[others] = self._extend(q[others], g[others])
        self.count = int(np.count_nonzero(taken))
        # Inside, anchors stand first; outside, centres stand as they came.
        place = np.cumsum(taken) - 1
        self._first = np.concatenate((place[chosen], place[others[taken[others]]]))
        return taken

    @property
    def _order(self) -> np.ndarray:
        """Where each centre stands outside."""
        return np.concatenate((self._first, np.arange(self._first.size, self.count)))

    @property
    def scaled_centres(self) -> np.ndarray:
        """M q of all centres (N, d), anchors first."""
        return np.concatenate((self._T, self._q[: self.count - self._anchors.size]))

    def _basis(self, q: np.ndarray) -> np.ndarray:
        return np.concatenate((np.ones((len(q), 1)), (q - self._middle) / self._extent), axis=1)

    def _projected(self, q: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """kappa(q, q') = left(q) . right(q') - |q - q'|, both (b, 2 d + 2); g less the plane through the anchors."""
        a = self._basis(q) @ self._inverse_T
        to_T = cdist(q, self._T)
        left = np.concatenate((a, to_T), axis=1)
        right = np.concatenate((to_T - a @ self._inner, a), axis=1)
        return left, right, g - a @ self._g_T

    def _kernel(self, rows: slice, q: np.ndarray, right: np.ndarray) -> np.ndarray:
        kernel: np.ndarray = self._left[rows] @ right.T
        kernel -= cdist(self._q[rows], q)
        return kernel

    def _extend(self, q: np.ndarray, g: np.ndarray) -> np.ndarray:
        """New rows of the factor: which were taken (b,)."""
        n = self.count - self._anchors.size
        left, right, difference = self._projected(q, g)
        rows = _forward(self._L[:n, :n], self._kernel(slice(0, n), q, right))
        schur = left @ right.T - cdist(q, q)
        schur[np.diag_indices_from(schur)] += self.rho
        self._largest = max(self._largest, float(schur.diagonal().max(initial=0)))
        schur -= rows.T @ rows
        taken, factor = _cholesky(schur, _SAME * self._largest)
        b = len(factor)
        self._reserve(n + b)
        rows = rows[:, taken]
        self._L[n : n + b, :n], self._L[n : n + b, n : n + b] = rows.T, factor
        rest = difference[taken] - rows.T @ self._y[:n]
        self._y[n : n + b] = solve_triangular(factor, rest, lower=True, check_finite=False) if b else rest
        self._q[n : n + b], self._left[n : n + b] = q[taken], left[taken]
        self._a[n : n + b] = left[taken, : self._anchors.size]
        return taken

    def _reserve(self, size: int) -> None:
        if size <= len(self._L):
            return
        size = max(size, 2 * len(self._L))
        _require_memory(size)
        for name in ("_L", "_y", "_q", "_a", "_left"):
            old = getattr(self, name)
            new = np.empty((size, size if name == "_L" else old.shape[1]))
            new[: len(old), : old.shape[1]] = old
            setattr(self, name, new)


class Candidates:
    """What `RadialSystem.candidates` found: `residuals` (m, C) less the interpolant, kept up to date by `pick`;
    `free` (m,), False for those picked and those that coincide with a centre."""

    def __init__(self, residuals: np.ndarray, schur: np.ndarray, same: float) -> None:
        self.residuals = residuals
        self._schur, self._same = schur, same
        self._pivots = schur.diagonal().copy()
        self._rows = np.empty((0, len(schur)))
        self._count = 0
        self.free = self._pivots > same

    def pick(self, j: int) -> None:
        """Let candidate j be a centre: the residuals of all become what they are with it."""
        if not self.free[j]:
            raise ArrayError(f"candidate {j} is a centre already, or coincides with one.")
        k = self._count
        if k == len(self._rows):
            self._rows = np.concatenate((self._rows, np.empty((max(16, k), len(self._schur)))))
        root = np.sqrt(self._pivots[j])
        row = (self._schur[j] - self._rows[:k, j] @ self._rows[:k]) / root
        self._rows[k] = row
        self._count += 1
        self._pivots -= row * row
        self.residuals -= row[:, None] * (self.residuals[j] / root)
        self.free[j] = False
        self.free &= self._pivots > self._same


def anchors(points: np.ndarray) -> np.ndarray:
    """d + 1 of the points (M, d) that span space well: QR by rows of (1, q), with pivots.

    Raises `ArrayError` where the points lie in a plane, and names the coordinate to drop.
    """
    d = points.shape[1]
    if len(points) <= d:
        raise ArrayError(f"{len(points)} points do not span {d} dimensions: {d + 1} at least are wanted.")
    low, high = points.min(axis=0), points.max(axis=0)
    extent = (high - low) / 2
    flat = extent <= _FLAT * np.maximum(np.abs(low), np.abs(high))
    if flat.any():
        raise ArrayError(_coplanar(int(flat.argmax()), "is constant over"))
    rest = np.concatenate((np.ones((1, len(points))), ((points - (low + high) / 2) / extent).T))
    chosen = np.empty(d + 1, np.intp)
    spanned = np.empty((d + 1, d + 1))
    for k in range(d + 1):
        lengths = np.einsum("ij,ij->j", rest, rest)
        chosen[k] = lengths.argmax()
        if lengths[chosen[k]] < _FLAT**2:
            # Across what is spanned there is nothing: the coordinate with the largest part in it follows from others.
            across = np.linalg.svd(spanned[:k])[2][-1]
            raise ArrayError(_coplanar(int(np.abs(across[1:]).argmax()), "is a linear function of the others at"))
        spanned[k] = rest[:, chosen[k]] / np.sqrt(lengths[chosen[k]])
        rest -= spanned[k][:, None] * (spanned[k] @ rest)
    return chosen


def _coplanar(coordinate: int, why: str) -> str:
    return (
        f"coordinate {coordinate} {why} all points, which lie in a plane: the linear part is undetermined across it. "
        "Drop that coordinate (w, where one light and an orthographic camera made one image, as RS 15 does), or add "
        "images."
    )


def _require_memory(count: int) -> None:
    if 8 * count * count > MEMORY_LIMIT:
        raise MemoryLimitError(
            f"{count} centres need {8e-9 * count * count:.1f} GB of at most {MEMORY_LIMIT / 1e9:g}: fewer do as a rule."
        )


def _forward(L: np.ndarray, b: np.ndarray) -> np.ndarray:
    """L^-1 b in place. By blocks, since LAPACK would copy a factor that stands in a larger array."""
    for low in range(0, len(L), _BLOCK):
        some = slice(low, min(low + _BLOCK, len(L)))
        if low:
            b[some] -= L[some, :low] @ b[:low]
        b[some] = solve_triangular(L[some, some], b[some], lower=True, check_finite=False)
    return b


def _backward(L: np.ndarray, b: np.ndarray) -> np.ndarray:
    """L^-T b."""
    x = b.copy()
    for low in reversed(range(0, len(L), _BLOCK)):
        some = slice(low, min(low + _BLOCK, len(L)))
        if some.stop < len(L):
            x[some] -= L[some.stop :, some].T @ x[some.stop :]
        x[some] = solve_triangular(L[some, some], x[some], lower=True, trans="T", check_finite=False)
    return x


def _cholesky(A: np.ndarray, floor: float) -> tuple[np.ndarray, np.ndarray]:
    """Which rows have pivots above `floor` given those before, and the factor of these."""
    taken = np.ones(len(A), bool)
    try:
        factor = np.linalg.cholesky(A)
        if (factor.diagonal() ** 2 > floor).all():
            return taken, factor
    except np.linalg.LinAlgError:
        pass
    factor = np.zeros_like(A)
    for k in range(len(A)):
        before = np.flatnonzero(taken[:k])
        row = factor[k, before]
        pivot = A[k, k] - row @ row
        taken[k] = pivot > floor
        if taken[k]:
            factor[k, k] = np.sqrt(pivot)
            factor[k + 1 :, k] = (A[k + 1 :, k] - factor[k + 1 :, before] @ row) / factor[k, k]
    return taken, factor[np.ix_(taken, taken)]
