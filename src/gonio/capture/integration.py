"""Integration: heights from normals, seen orthographically with square pixels one unit apart.

    p = dz/dcolumn = -n_x / n_z,    q = dz/drow = n_y / n_z     x to the right, y up (against the rows), z to the viewer

    least  sum over edges (a, b) of  w_ab (z_b - z_a - (p_a + p_b) / 2)^2,      1 / w_ab = (1 / w_a + 1 / w_b) / 2

An edge joins two neighbours of the mask along a row; down a column q stands for p. This is Poisson's equation with
natural boundaries (Horn and Brooks 1986), by the trapezium rule, which is exact for quadratic surfaces.

The normal equations are solved by conjugate gradients, with one cycle of multigrid as preconditioner: aggregates of
3 x 3 pixels, as far as strong edges join them, with smoothed interpolation (Vanek, Mandel and Brezina 1996). So no
aggregate reaches over edges that the weights all but cut, and they cost few iterations.

Not here: perspective, prior depths, and depth discontinuities, which are bent into slopes: cut the mask there.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from ..arrays import Array, frozen, to_numpy
from ..directions import UNIT_TOLERANCE
from ..errors import ArrayError

_STEEPEST = 20.0  # at occluding contours n_z goes to 0, and there one pixel's slope says nothing of the next
_LEAST_WEIGHT = 1e-6  # of the largest: below it an edge only lays in what nothing else determines
_TOLERANCE = 1e-10  # of the heights, in the norm that is minimised
_MOST_ITERATIONS = 500
_STRONG = 0.08  # an edge is, with at least this part of the geometric mean of its ends' diagonals
_DENSE = 300  # unknowns that are solved for directly


@dataclasses.dataclass(frozen=True, eq=False)
class Integration:
    """`heights` (rows, columns) in pixels towards the viewer, of mean 0 over each 4-connected component of the mask;
    `residual` (rows, columns), over the edges of a pixel the rms of the height differences less the mean slopes of
    their two ends: large where the normals are not those of one surface. Both NaN outside the mask.
    `converged`, and the `reason` why the solve ended."""

    heights: np.ndarray
    residual: np.ndarray
    converged: bool
    reason: str


def integrate_normals(normals: Array, mask: Array | None = None, weights: Array | None = None) -> Integration:
    """Heights whose slopes are nearest to those of `normals` in the sense of weighted least squares.

    normals (rows, columns, 3), unit, x to the right, y up, z > 0 to the viewer; mask (rows, columns) of booleans, the
    pixels that count, otherwise all whose normal is finite; weights (rows, columns), finite and >= 0, confidence in
    each normal (1 / variance of its slopes), of which only ratios matter. Pixels without weight are laid in by their
    own normals and do not pull at the others by more than 1e-6. Slopes are cut at 20 to either side.

    Raises `ArrayError` for other shapes and types, an empty mask and, inside the mask, normals that are NaN, not unit
    or face away, and weights that are negative, not finite, or 0 throughout.
    """
    field = _Field(normals, mask)
    w = np.ones(len(field.a))
    if weights is not None:
        confidence = field.weights(weights)
        from_a, from_b = confidence[field.a], confidence[field.b]
        total = from_a + from_b
        w = np.maximum(2 * from_a * from_b / np.where(total > 0, total, 1), _LEAST_WEIGHT)
    heights, iterations, converged = field.solve(w)
    reached = "reached" if converged else "not reached"
    reason = f"a relative residual of {_TOLERANCE:g} was {reached} in {iterations} iterations"
    return field.result(heights, converged, reason)


class _Field:
    """Pixels of the mask in one row, n of them, and the edges a -> b between neighbours, along rows, then columns."""

    def __init__(self, normals: Array, mask: Array | None) -> None:
        v = np.asarray(to_numpy(normals))
        if v.ndim != 3 or v.shape[-1] != 3 or v.dtype.kind not in "fiu":
            raise ArrayError(f"normals have shape {v.shape} and dtype {v.dtype}; real (rows, columns, 3) are wanted.")
        self.mask = np.isfinite(v).all(axis=-1) if mask is None else np.asarray(to_numpy(mask))
        if self.mask.shape != v.shape[:2] or self.mask.dtype != bool:
            raise ArrayError(
                f"mask has shape {self.mask.shape} and dtype {self.mask.dtype}; booleans of the normals' shape "
                f"{v.shape[:2]} are wanted."
            )
        if not self.mask.any():
            raise ArrayError("the mask is empty: there is no normal to integrate.")
        self.at = np.argwhere(self.mask).astype(np.int32)
        self.n = len(self.at)
        inside = v[self.mask].astype(np.float64)
        self._refuse(~np.isfinite(inside).all(axis=1), inside, "is not finite: leave it out of the mask.")
        length = np.linalg.norm(inside, axis=1)
        self._refuse(
            np.abs(length - 1) > UNIT_TOLERANCE,
            inside,
            "is not a unit vector: normalise it, or leave it out by a mask.",
        )
        self._refuse(
            inside[:, 2] <= 0,
            inside,
            "faces away from the viewer (z <= 0): bring normals to x right, y up, z towards the viewer, or leave it "
            "out by a mask.",
        )
        index = np.zeros(self.mask.shape, np.int32)
        index[self.mask] = np.arange(self.n)
        across, along = self.mask[:, :-1] & self.mask[:, 1:], self.mask[:-1] & self.mask[1:]
        self.a = np.concatenate((index[:, :-1][across], index[:-1][along]))
        self.b = np.concatenate((index[:, 1:][across], index[1:][along]))
        right, down = np.clip((-inside[:, 0], inside[:, 1]) / inside[:, 2], -_STEEPEST, _STEEPEST)
        along_rows = np.arange(len(self.a)) < np.count_nonzero(across)
        self.slopes = np.where(along_rows, right[self.a] + right[self.b], down[self.a] + down[self.b]) / 2

    def weights(self, weights: Array) -> np.ndarray:
        """Weights of the pixels, the largest of which is 1."""
        w = np.asarray(to_numpy(weights))
        if w.shape != self.mask.shape or w.dtype.kind not in "fiub":
            raise ArrayError(
                f"weights have shape {w.shape} and dtype {w.dtype}; real ones of the normals' shape {self.mask.shape} "
                "are wanted."
            )
        inside = w[self.mask].astype(np.float64)
        bad = ~(np.isfinite(inside) & (inside >= 0))
        if bad.any():
            k = int(bad.argmax())
            raise ArrayError(f"weights{self.at[k].tolist()} = {inside[k]:g}: finite weights >= 0 are wanted.")
        if not inside.any():
            raise ArrayError("weights are 0 throughout the mask: no normal counts.")
        return np.asarray(inside / inside.max())

    def solve(self, w: np.ndarray) -> tuple[np.ndarray, int, bool]:
        """Least sum w (z_b - z_a - slopes)^2: z, the iterations, whether they converged."""
        from scipy.sparse import coo_array

        a, b, n = self.a, self.b, self.n
        diagonal = np.bincount(a, w, n) + np.bincount(b, w, n)
        every = np.arange(n, dtype=np.int32)
        rows, columns = np.concatenate((a, b, every)), np.concatenate((b, a, every))
        A = coo_array((np.concatenate((-w, -w, diagonal)), (rows, columns)), shape=(n, n)).tocsr()
        flow = w * self.slopes
        return _conjugate_gradients(A, np.bincount(b, flow, n) - np.bincount(a, flow, n), _Multigrid(A, self.at))

    def result(self, heights: np.ndarray, converged: bool, reason: str) -> Integration:
        from scipy.ndimage import label

        component = label(self.mask)[0][self.mask]
        mean = np.bincount(component, heights) / np.maximum(np.bincount(component), 1)
        off = (heights[self.b] - heights[self.a] - self.slopes) ** 2
        edges = np.bincount(self.a, minlength=self.n) + np.bincount(self.b, minlength=self.n)
        squares = np.bincount(self.a, off, self.n) + np.bincount(self.b, off, self.n)
        return Integration(
            self._image(heights - mean[component]),
            self._image(np.sqrt(squares / np.maximum(edges, 1))),
            converged,
            reason,
        )

    def _image(self, values: np.ndarray) -> np.ndarray:
        image = np.full(self.mask.shape, np.nan)
        image[self.mask] = values
        return np.asarray(frozen(image))

    def _refuse(self, bad: np.ndarray, inside: np.ndarray, why: str) -> None:
        if bad.any():
            k = int(bad.argmax())
            raise ArrayError(f"normals{self.at[k].tolist()} = {inside[k].round(4).tolist()} {why}")


class _Multigrid:
    """One V-cycle for A (n, n), sparse, symmetric, semi-definite with the constants of each component as null space;
    `at` (n, 2) are the places of the unknowns. Symmetric itself, as conjugate gradients need it."""

    def __init__(self, A: Any, at: np.ndarray) -> None:
        self.levels: list[tuple[Any, Any, Any, np.ndarray]] = []
        strong = _STRONG
        while A.shape[0] > _DENSE:
            P, at, kept = _interpolation(A, at, strong)
            R = P.T.tocsr()
            row_sums = np.asarray(abs(A).sum(axis=1)).ravel()
            # On Laplacians Jacobi's with the factor 2/3. The sums of absolute values bound the spectrum on any level.
            damped = np.divide(4 / 3, row_sums, out=np.zeros_like(row_sums), where=row_sums > 0)
            coarse = (R @ (A @ P)).tocsr()
            # A component that has become one unknown is solved: its constant is free, and rounding all it would add.
            joined = np.diff(coarse.indptr) > 1
            if not joined.all():
                P, R, coarse, at = P[:, joined], R[joined], coarse[joined][:, joined], at[joined]
            self.levels.append((A, P, R, damped))
            if kept > 0.5:
                strong /= 2
            A = coarse
        values, vectors = np.linalg.eigh(A.toarray())
        solid = values > 1e-12 * values.max(initial=0)
        self.inverse = (vectors[:, solid] / values[solid]) @ vectors[:, solid].T

    def __call__(self, r: np.ndarray, level: int = 0) -> np.ndarray:
        if level == len(self.levels):
            return np.asarray(self.inverse @ r)
        A, P, R, damped = self.levels[level]
        x = damped * r
        x += damped * (r - A @ x)
        x += P @ self(R @ (r - A @ x), level + 1)
        x += damped * (r - A @ x)
        return np.asarray(x + damped * (r - A @ x))


def _interpolation(A: Any, at: np.ndarray, strong: float) -> tuple[Any, np.ndarray, float]:
    """From aggregates to the n unknowns (n, m), the places (m, 2) of the aggregates on a grid of a third, and m / n."""
    from scipy.sparse import coo_array, csr_array, diags_array
    from scipy.sparse.csgraph import connected_components

    n = A.shape[0]
    diagonal, columns = A.diagonal(), A.indices
    rows = np.repeat(np.arange(n, dtype=columns.dtype), np.diff(A.indptr))
    joins = (rows != columns) & (-A.data >= strong * np.sqrt(diagonal[rows] * diagonal[columns]))
    rows, columns, strength = rows[joins], columns[joins], -A.data[joins]
    block = at // 3
    within = (block[rows] == block[columns]).all(axis=1)
    graph = coo_array((np.ones(np.count_nonzero(within)), (rows[within], columns[within])), shape=(n, n))
    m, label = connected_components(graph.tocsr(), directed=False)
    aggregates = csr_array((np.ones(n), label.astype(np.int32), np.arange(n + 1, dtype=np.int32)), shape=(n, m))
    # One step of Jacobi on the strong edges alone, so that nothing is smoothed across weak ones.
    degree = np.bincount(rows, strength, n)
    share = np.where(degree > 0, 2 / 3, 0)
    edges = coo_array((strength * share[rows] / degree[rows], (rows, columns)), shape=(n, n)).tocsr()
    places = np.empty((m, 2), at.dtype)
    places[label] = block
    return (diags_array(1 - share) @ aggregates + edges @ aggregates).tocsr(), places, m / n


def _conjugate_gradients(A: Any, b: np.ndarray, precondition: _Multigrid) -> tuple[np.ndarray, int, bool]:
    """A x = b: x, the iterations, and whether the residual fell to `_TOLERANCE` of b in the preconditioned norm."""
    x, r = np.zeros_like(b), b.copy()
    z = precondition(r)
    p, length = z.copy(), float(r @ z)
    goal = _TOLERANCE**2 * length
    for iterations in range(_MOST_ITERATIONS):
        if length <= goal:
            return x, iterations, True
        Ap = A @ p
        step = length / float(p @ Ap)
        x += step * p
        r -= step * Ap
        z = precondition(r)
        before, length = length, float(r @ z)
        p = z + (length / before) * p
    return x, _MOST_ITERATIONS, length <= goal
