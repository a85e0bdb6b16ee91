"""The nine coefficients of light as handles with names: its moments, which an artist turns (RH 4.3.3).

    L(w) = ambient + 3 vector.w + 7.5 w^T axes w        to degree 2, with means over all directions
    ambient = mean of L,   vector = mean of w L,   axes = mean of (w w^T - 1/3) L

The vector points to where more light comes from; it is as long as the ambient light where that is a lamp, and short
where light comes from all around. The eigenvectors of `axes` are the lines along which light is brighter, or darker,
from both ends. All turn as vectors and matrices do, and lights add: blends of lights are blends of their moments.
"""

from __future__ import annotations

import dataclasses
import math

from ..arrays import Array, floats, namespace
from ..errors import ArrayError

# Norms of the harmonics of RH 4.5: of x, y, z, and half of those of xy, yz, xz.
_FIRST, _SECOND = math.sqrt(3 / (4 * math.pi)), math.sqrt(15 / (16 * math.pi))


@dataclasses.dataclass(frozen=True, eq=False)
class Moments:
    """ambient (C,), vector (C, 3) and axes (C, 3, 3) of light; changed by `dataclasses.replace`."""

    ambient: Array
    vector: Array
    axes: Array

    @classmethod
    def of(cls, coefficients: Array) -> Moments:
        """From coefficients in the real harmonics, (9, C). Raises `ArrayError` for other shapes."""
        xp, L = floats(coefficients)
        if L.ndim != 2 or L.shape[0] != 9:
            raise ArrayError(f"coefficients have shape {tuple(L.shape)}; nine of them, (9, C), have these moments.")
        L00, L1m1, L10, L11, L2m2, L2m1, L20, L21, L22 = (L[k, :] for k in range(9))
        vector = xp.stack((L11, L1m1, L10), axis=-1) * (_FIRST / 3)
        p, q = _SECOND / 7.5, _SECOND / math.sqrt(3) / 7.5
        rows = (
            (p * L22 - q * L20, p * L2m2, p * L21),
            (p * L2m2, -p * L22 - q * L20, p * L2m1),
            (p * L21, p * L2m1, 2 * q * L20),
        )
        axes = xp.stack(tuple(xp.stack(row, axis=-1) for row in rows), axis=-2)
        return cls(L00 / math.sqrt(4 * math.pi), vector, axes)

    def coefficients(self) -> Array:
        """In the real harmonics, (9, C). What of `axes` is not symmetric and without trace has no say."""
        xp, ambient, d, Q = floats(self.ambient, self.vector, self.axes)
        if ambient.ndim != 1 or tuple(d.shape) != (len(ambient), 3) or tuple(Q.shape) != (len(ambient), 3, 3):
            raise ArrayError(
                f"moments have shapes {tuple(ambient.shape)}, {tuple(d.shape)} and {tuple(Q.shape)}; they are (C,), "
                "(C, 3) and (C, 3, 3)."
            )
        Q = (Q + xp.matrix_transpose(Q)) / 2
        p, q = _SECOND / 7.5, _SECOND / math.sqrt(3) / 7.5
        first = d * (3 / _FIRST)
        x, y, z = Q[:, 0, 0], Q[:, 1, 1], Q[:, 2, 2]
        return xp.stack(
            (
                ambient * math.sqrt(4 * math.pi),
                first[:, 1],
                first[:, 2],
                first[:, 0],
                Q[:, 0, 1] / p,
                Q[:, 1, 2] / p,
                (2 * z - x - y) / (6 * q),
                Q[:, 0, 2] / p,
                (x - y) / (2 * p),
            ),
            axis=0,
        )

    def rotated(self, rotation: Array) -> Moments:
        """The light turned by `rotation` (3, 3): what came from w comes from R w."""
        _, R, d, Q = floats(rotation, self.vector, self.axes)
        return Moments(self.ambient, d @ R.T, R @ Q @ R.T)

    def blended(self, other: Moments, share: float) -> Moments:
        """(1 - share) of this light and `share` of the other: the moments of both lights, dimmed and added."""
        pairs = zip(dataclasses.astuple(self), dataclasses.astuple(other), strict=True)
        return Moments(*((1 - share) * a + share * b for a, b in pairs))

    @property
    def one_sidedness(self) -> Array:
        """(C,): 0 for light that is even in the first degree, 1 for a lamp."""
        xp = namespace(self.vector)
        return xp.sqrt(xp.sum(self.vector**2, axis=-1)) / self.ambient
