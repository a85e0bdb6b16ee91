"""A flat sample photographed at an angle, brought to a square grid of texels in its own plane.

    texel (i, j)    X = centre + texel (j - (columns - 1)/2, (rows - 1)/2 - i, 0)        row 0 at the top, z = 0
    pixel           p = project(X) of a camera with its distortion, or (p, 1) ~ H (x, y, 1) of a homography
    radiance        the mean over n x m places of the texel of what the photograph has there, bilinear between pixels

n and m are the fewest with which places lie no farther apart than pixels anywhere on the grid. So where the photograph
is finer than the grid, texels are means over their footprints and nothing aliases; where it is coarser, n = m = 1 and
values lie between those of four pixels, never above or below them, as those of cubics do near a highlight. Bilinear is
off by 1/8 of a second difference of the pixels at most, each way. The weights are the same for all photographs, and are
held as one sparse matrix. Radiance does not change with distance or tilt: nothing is multiplied.

The plane's frame is z up, towards the camera; x right, y up. The camera's pose is in it, as `pose_of_board` finds it.
Not here: relief, which a single plane shows displaced towards the camera; vignetting (`exposure`); finding the corners.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from ..arrays import Array, frozen, require_finite, to_numpy
from ..cameras import Pinhole
from ..errors import ArrayError, ParameterError
from ..lights.model import Light
from ..lights.points import Directional, Point
from .photographs import Photograph, Photographs

_DEGENERATE = 1e-6  # of singular values: below that, three of four points lie on a line
_MOST = 256  # places each way of a texel
_NOTHING = 1e-6  # the weight of a pixel that rounding alone brings in
_BLOCK = 1 << 20  # places that are worked on at once, some 100 bytes each


@dataclasses.dataclass(frozen=True)
class Grid:
    """`size` = (rows, columns) square texels of side `texel`, about `centre` (x, y), in the plane z = 0.

    Raises `ParameterError` for a size below 1, a texel that is not positive, or a centre that is not finite.
    """

    size: tuple[int, int]
    texel: float
    centre: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        size, centre = tuple(self.size), tuple(float(x) for x in self.centre)
        if len(size) != 2 or any(int(n) != n or n < 1 for n in size):
            raise ParameterError(f"Grid: size = {self.size!r} is not (rows, columns), both >= 1.")
        if not 0 < self.texel < math.inf:
            raise ParameterError(f"Grid: texel = {self.texel:g} is not a positive length.")
        if len(centre) != 2 or not all(map(math.isfinite, centre)):
            raise ParameterError(f"Grid: centre = {self.centre!r} is not a place (x, y).")
        object.__setattr__(self, "size", (int(size[0]), int(size[1])))
        object.__setattr__(self, "centre", centre)

    @property
    def corners(self) -> np.ndarray:
        """The outline's corners (4, 2), x and y: top left, top right, bottom right, bottom left."""
        half = np.array(self.size[::-1]) * (self.texel / 2)
        return self.centre + half * [(-1, 1), (1, 1), (1, -1), (-1, -1)]

    def positions(self) -> np.ndarray:
        """The texels' centres (rows, columns, 3) in the plane's frame."""
        rows, columns = self.size
        places = self._places(np.arange(rows), np.arange(columns))
        return np.concatenate((places, np.zeros((rows, columns, 1))), axis=-1)

    def _places(self, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """x and y (R, C, 2) at `row` (R,) and `column` (C,), whole at the texels' centres."""
        rows, columns = self.size
        x = self.centre[0] + self.texel * (column - (columns - 1) / 2)
        y = self.centre[1] + self.texel * ((rows - 1) / 2 - row)
        return np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1)


def homography_of_points(image_points: Array, plane_points: Array) -> np.ndarray:
    """H (3, 3) with (image, 1) ~ H (plane, 1), of points (4 or more, 2) on both, pixel coordinates x, y on the image.

    Exact for four; for more, least squares in the equations x (h3.p) = h1.p, y (h3.p) = h2.p, points centred and scaled
    first (Hartley 1997), which is within a few percent of least squares in pixels. A lens's distortion is not in it.
    H is scaled so that h3.p is 1 in the mean over the plane's points, and it is positive at all of them.

    Raises `ArrayError` where shapes differ, three of four points lie on a line, or the points are in another order on
    the image than on the plane, seen from its front.
    """
    image, plane = (to_numpy(p).astype(np.float64) for p in (image_points, plane_points))
    for name, points in (("image_points", image), ("plane_points", plane)):
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 4:
            raise ArrayError(f"{name} has shape {points.shape}; four points or more, (N, 2), are wanted.")
        require_finite(points, name)
    if len(image) != len(plane):
        raise ArrayError(f"{len(image)} points on the image, but {len(plane)} on the plane.")
    (p, S), (q, T) = _normalised(plane, "plane_points"), _normalised(image, "image_points")
    zero = np.zeros_like(p)
    equations = np.vstack((np.hstack((p, zero, -q[:, :1] * p)), np.hstack((zero, p, -q[:, 1:2] * p))))
    _, sizes, basis = np.linalg.svd(equations)
    normalised = basis[-1].reshape(3, 3)
    if sizes[7] < _DEGENERATE * sizes[0] or np.linalg.cond(normalised) > 1 / _DEGENERATE:
        raise ArrayError("the points tell no homography: three of four lie on a line. Take the corners of a square.")
    H: np.ndarray = np.linalg.inv(T) @ normalised @ S
    w = np.column_stack((plane, np.ones(len(plane)))) @ H[2]
    H = H / w.mean()
    if not (w * w[0] > 0).all() or not np.linalg.det(H) < 0:
        raise ArrayError(
            "the points run in another order on the image than on the plane, whose y is up. Give both in one order: "
            "top left, top right, bottom right, bottom left."
        )
    return H


@dataclasses.dataclass(frozen=True, eq=False)
class Rectified(Photographs):
    """`photographs` resampled at the texels of `grid`, in the same order; a `Photographs` itself, read one at a time.

    view: a `Pinhole` of the photographs' size, standing in the plane's frame above z = 0; or a homography (3, 3) from
    the plane's x, y to pixel coordinates, as `homography_of_points` answers. A texel is clipped where any pixel that it
    takes light from is. `samples`: (n, m), places for each texel down and across.

    Raises `ParameterError` where the view is of another size or sees the plane from behind, or the photograph does not
    show all of the grid, `ArrayError` where a homography is none.
    """

    photographs: Photographs
    grid: Grid
    view: Pinhole | Array
    samples: tuple[int, int] = dataclasses.field(init=False)
    _weights: Any = dataclasses.field(init=False, repr=False)

    def __post_init__(self) -> None:
        if isinstance(self.view, Pinhole):
            if self.view.size != tuple(self.photographs.size):
                raise ParameterError(
                    f"view has {self.view.size} pixels, the photographs {tuple(self.photographs.size)} rows and "
                    "columns. Calibrate with photographs of the same size, not cropped or turned."
                )
            if not self.view.position[2] > 0:
                raise ParameterError(
                    f"view stands at {self.view.position.round(4).tolist()}, behind the plane z = 0. Its pose is in "
                    "the plane's frame, z towards the camera."
                )
        else:
            H = frozen(to_numpy(self.view), np.dtype(np.float64))
            if H.shape != (3, 3):
                raise ArrayError(f"view has shape {H.shape}; a Pinhole or a homography (3, 3) is wanted.")
            require_finite(H, "view")
            object.__setattr__(self, "view", H)
        object.__setattr__(self, "names", tuple(self.photographs.names))
        object.__setattr__(self, "size", self.grid.size)
        # Centres first: a view along the plane, which sees no end of it, would ask for places without end.
        self._require_seen(sum(self._unseen(p, here, 1, 1) for here, p in self._blocks(1, 1)))
        object.__setattr__(self, "samples", self._samples())
        object.__setattr__(self, "_weights", self._weighed())

    def read(self, k: int) -> Photograph:
        radiance, clipped = self.photographs.read(k)
        rows, columns = self.size
        # Channel by channel: for a matrix of as many columns SciPy's product is several times slower.
        texels = np.stack([self._weights @ np.ascontiguousarray(c) for c in radiance.reshape(-1, 3).T], axis=-1)
        marked = self._weights @ clipped.reshape(-1).astype(np.float32) > 0 if clipped.any() else np.zeros(len(texels))
        return Photograph(texels.reshape(rows, columns, 3), marked.astype(bool).reshape(rows, columns))

    def pixels(self, at: np.ndarray, progress: Callable[[int, int], None] | None = None) -> Photograph:
        some = self._weights[at]
        used, index = np.unique(some.indices, return_inverse=True)
        radiance, clipped = self.photographs.pixels(used, progress)
        weights = type(some)((some.data, index.astype(np.int32), some.indptr), shape=(len(at), len(used)))
        return Photograph(
            np.stack([weights @ photograph for photograph in radiance]),
            np.stack([weights @ marked.astype(np.float32) > 0 for marked in clipped]),
        )

    def covered(self, mask: np.ndarray) -> np.ndarray:
        """The texels (rows, columns) that take light from nothing but pixels of `mask` (rows, columns) bool."""
        outside = ~np.asarray(mask, dtype=bool)
        if outside.shape != tuple(self.photographs.size):
            raise ArrayError(f"mask has shape {outside.shape}; the photographs have {tuple(self.photographs.size)}.")
        return np.asarray(self._weights @ outside.reshape(-1).astype(np.float32) == 0).reshape(self.size)

    def seen(self, places: np.ndarray) -> np.ndarray:
        """Pixel coordinates (..., 2) of `places` (..., 2) in the plane; NaN where the view does not look."""
        if isinstance(self.view, Pinhole):
            return self.view.project(np.concatenate((places, np.zeros_like(places[..., :1])), axis=-1))[0]
        w = places @ self.view[2, :2] + self.view[2, 2]
        pixels = places @ self.view[:2, :2].T + self.view[:2, 2]
        return np.asarray(pixels / np.where(w > 0, w, np.nan)[..., None])

    def _blocks(self, n: int, m: int) -> Iterator[tuple[int, np.ndarray]]:
        """n x m places of every texel in the photograph, some rows of texels at a time: how many, and x, y."""
        rows, columns = self.grid.size
        column = (np.arange(columns * m) + 0.5) / m - 0.5
        step = max(1, _BLOCK // (columns * m * n))
        for first in range(0, rows, step):
            here = min(step, rows - first)
            row = (np.arange(first * n, (first + here) * n) + 0.5) / n - 0.5
            yield here, self.seen(self.grid._places(row, column))

    def _unseen(self, p: np.ndarray, here: int, n: int, m: int) -> int:
        """How many of the texels of a block lie outside the photograph in part. Raises where they are mirrored."""
        height, width = self.photographs.size
        if (_turn(p) < 0).any():
            raise ParameterError("view shows the plane from behind, mirrored: y is up in the plane and down in images.")
        inside = ((p >= 0) & (p <= (width, height))).all(axis=-1)  # not where NaN
        return int(np.count_nonzero(~inside.reshape(here, n, -1, m).all(axis=(1, 3))))

    def _require_seen(self, unseen: int) -> None:
        rows, columns = self.grid.size
        if unseen:
            raise ParameterError(
                f"the photograph does not show {unseen / (rows * columns):.1%} of the grid's {columns} x {rows} "
                "texels. Make the grid smaller or move its centre."
            )

    def _samples(self) -> tuple[int, int]:
        """How many places a texel needs, down and across, so that they are at most a pixel apart."""
        # A view is smooth: what a pixel is anywhere is told by some texels.
        rows, columns = (np.unique(np.linspace(0, n - 1, 33).astype(int)) for n in self.grid.size)
        across = [self.seen(self.grid._places(rows, columns + s)) for s in (-0.5, 0.5)]
        down = [self.seen(self.grid._places(rows + s, columns)) for s in (-0.5, 0.5)]
        lengths = [np.linalg.norm(b - a, axis=-1) for a, b in (down, across)]
        # A hair more than a pixel, as rounding has it, is a pixel.
        n, m = (max(1, math.ceil(np.max(length, where=np.isfinite(length), initial=0) - 1e-6)) for length in lengths)
        if max(n, m) > _MOST:
            raise ParameterError(f"texels are up to {max(n, m)} pixels long; {_MOST} are allowed. Make them smaller.")
        return n, m

    def _weighed(self) -> Any:
        """The weights of pixels in texels, sparse (rows * columns, pixels), float32."""
        from scipy import sparse

        (_, columns), (n, m) = self.grid.size, self.samples
        parts, unseen = [], 0
        for here, p in self._blocks(n, m):
            unseen += self._unseen(p, here, n, m)
            if unseen:
                continue  # all are counted before it is said
            texel = (np.arange(here * n)[:, None] // n) * columns + np.arange(columns * m) // m
            parts.append(_bilinear(p, self.photographs.size, texel, here * columns, n * m))
        self._require_seen(unseen)
        return sparse.vstack(parts, format="csr") if len(parts) > 1 else parts[0]


def moved_lights(lights: Sequence[Light], pose: Array) -> tuple[Light, ...]:
    """`lights` told in one frame, in another, where the first has `pose` (4, 4): a camera's lights in the plane's.

    Raises `ParameterError` for lights that are neither `Directional` nor `Point`, whose falloff belongs to one plane.
    """
    to = to_numpy(pose).astype(np.float64)
    moved: list[Light] = []
    for k, light in enumerate(lights):
        if isinstance(light, Directional):
            moved.append(dataclasses.replace(light, direction=to[:3, :3] @ to_numpy(light.direction)))
        elif isinstance(light, Point):
            axis = None if light.axis is None else to[:3, :3] @ to_numpy(light.axis)
            moved.append(dataclasses.replace(light, position=to[:3] @ (*to_numpy(light.position), 1.0), axis=axis))
        else:
            raise ParameterError(f"lights[{k}] is {type(light).__name__}; Directional and Point can be moved.")
    return tuple(moved)


def _bilinear(p: np.ndarray, size: tuple[int, int], texel: np.ndarray, texels: int, count: int) -> Any:
    """Weights (texels, pixels) of places `p` (..., 2), the mean over `count` of which is a texel, numbered `texel`."""
    from scipy import sparse

    (height, width), entries = size, []
    # Up to half a pixel from the frame, the outermost pixels' value holds.
    x, y = (p[..., c].clip(0.5, n - 0.5) - 0.5 for c, n in ((0, width), (1, height)))
    left, top = (np.minimum(np.floor(v), max(n - 2, 0)).astype(np.int64) for v, n in ((x, width), (y, height)))
    u, v = x - left, y - top
    for down, right in ((0, 0), (0, 1), (1, 0), (1, 1)):
        weight = (v if down else 1 - v) * (u if right else 1 - u) / count
        taken = weight > _NOTHING / count
        at = (top + down) * width + left + right
        entries.append((weight[taken].astype(np.float32), texel[taken], at[taken]))
    weights, rows, columns = (np.concatenate(part) for part in zip(*entries, strict=True))
    return sparse.coo_array((weights, (rows, columns)), shape=(texels, height * width)).tocsr()


def _turn(p: np.ndarray) -> np.ndarray:
    """Negative where a step right and then a step down on the grid turn against those on the image."""
    across, down = np.diff(p[:-1], axis=1), np.diff(p[:, :-1], axis=0)
    return np.asarray(across[..., 0] * down[..., 1] - across[..., 1] * down[..., 0])


def _normalised(points: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Homogeneous `points` (N, 3) about 0 at a mean distance of sqrt 2, and the matrix that brought them there."""
    middle = points.mean(axis=0)
    spread = float(np.linalg.norm(points - middle, axis=1).mean())
    if not spread > 0:
        raise ArrayError(f"{name} are all one point.")
    s = math.sqrt(2) / spread
    to = np.array([[s, 0, -s * middle[0]], [0, s, -s * middle[1]], [0, 0, 1]])
    return np.column_stack((points, np.ones(len(points)))) @ to.T, to
