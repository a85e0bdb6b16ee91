"""Light from all around: a picture of the surroundings, its layout, and how it stands in the world.

    E(n) = integral of L(w) max(n.w, 0) d omega

Each pixel's value is the radiance at its centre. Between centres `radiance` is bilinear, across the picture's seams
as well. Sums weigh a pixel with its exact solid angle, except the harmonics of a lat-long map, which use the weights
that are exact for band-limited maps.

Turning an environment turns its orientation and leaves the pixels alone. Not here: the layouts (`mappings.py`,
`discs.py`, `cubes.py`), where pictures point by the tools' conventions (`orientation.py`), how a budget of beams is
spent (`clusters.py`), pictures in other layouts (`resampling.py`), and environments known by their harmonics alone
(`harmonic.py`).
"""

from __future__ import annotations

import dataclasses
import math
from functools import cached_property
from typing import Any

import numpy as np

from .._kernels import environment as kernels
from ..arrays import Array, floats, frozen, is_numpy, like, namespace, to_numpy
from ..directions import require_unit
from ..errors import ArrayError, ParameterError
from .clusters import clusters
from .importance import Importance
from .mappings import LatLongMap, Mapping
from .model import Beams, Light
from .orientation import Orientation
from .resampling import averaged, moved

# Directions in blocks of this many values where harmonics are summed pixel by pixel.
_BLOCK = 4_000_000


@dataclasses.dataclass(frozen=True, eq=False)
class Environment(Light):
    """`image` (rows, columns), (rows, columns, 1) or (rows, columns, 3): linear radiance, finite, not negative.

    Single precision is kept, other dtypes become double. What a layout does not show (around a disc) may hold
    anything and counts as 0. Raises `ArrayError` for other shapes, NaN, infinite or negative radiance, and where the
    picture's aspect is not the layout's.

    A PyTorch or CuPy image is answered in kind by `radiance`, `harmonics`, `mean_radiance` and the irradiance of
    unbudgeted `beams`, and gradients reach it; sampling, budgets and resampling are NumPy's.
    """

    image: Array
    mapping: Mapping = dataclasses.field(default_factory=LatLongMap)
    orientation: Orientation = Orientation.GONIO

    def __post_init__(self) -> None:
        if not isinstance(self.mapping, Mapping) or not isinstance(self.orientation, Orientation):
            raise ParameterError(
                "Environment: pass a mapping such as LatLongMap() and an orientation such as Orientation.PANORAMA."
            )
        xp, image = floats(self.image)
        if image.ndim == 2:
            image = image[..., None]
        if image.ndim != 3 or image.shape[-1] not in (1, 3):
            raise ArrayError(
                f"Environment: image has shape {tuple(np.shape(self.image))}; it is (rows, columns), or (rows, "
                "columns, C) with C = 1 or 3. Drop an alpha channel with image[..., :3]."
            )
        self.orientation.matrix(self.mapping)
        solid = frozen(self.mapping.solid_angles(*image.shape[:2]))
        self.__dict__["solid_angles"] = solid  # the cached property's own place
        shown = solid > 0
        if not shown.all():
            image = xp.where(like(shown, image)[..., None] > 0, image, xp.zeros_like(image))
        good = xp.isfinite(image) & (image >= 0)
        if not bool(xp.all(good)):
            at = tuple(int(k) for k in np.argwhere(~to_numpy(good))[0])
            raise ArrayError(
                f"Environment: image[{', '.join(map(str, at))}] is {float(to_numpy(image)[at]):.6g}; radiance is "
                "finite and not negative. Mend the picture, or pass np.clip(image, 0, None) if that is meant."
            )
        object.__setattr__(self, "image", frozen(image, image.dtype))

    @property
    def distant(self) -> bool:
        return True

    @property
    def rows(self) -> int:
        return int(self.image.shape[0])

    @property
    def columns(self) -> int:
        return int(self.image.shape[1])

    @cached_property
    def turn(self) -> np.ndarray:
        """(3, 3): directions in the layout's own axes to the world's, w = turn @ own; determinant +1 or -1."""
        return self.orientation.matrix(self.mapping)

    @cached_property
    def solid_angles(self) -> np.ndarray:
        """Solid angle of each pixel in sr, (rows, columns)."""
        solid: np.ndarray = frozen(self.mapping.solid_angles(self.rows, self.columns))
        return solid

    def directions(self) -> tuple[np.ndarray, np.ndarray]:
        """World directions (rows, columns, 3) of the pixel centres, and which pixels show any (rows, columns)."""
        own, shown = self.mapping.directions(self.rows, self.columns)
        world: np.ndarray = own @ self.turn.T
        return world, shown

    @property
    def mean_radiance(self) -> Array:
        """Radiance averaged over all directions that the picture shows, (C,)."""
        xp = namespace(self.image)
        # In double precision: millions of pixels, of which a lamp may outshine the rest a thousandfold.
        image = xp.astype(self.image, xp.float64)
        weights = like(self.solid_angles / self.solid_angles.sum(), image)
        return xp.astype(xp.sum(image * weights[..., None], axis=(0, 1)), self.image.dtype)

    def radiance(self, w: Array) -> Array:
        """Radiance (..., C) arriving from the unit world directions `w` (..., 3), bilinear between pixel centres.

        Raises `DirectionError` where w is not unit.
        """
        require_unit(w, "w")
        if is_numpy(w, self.image):
            return self._look_up(floats(w)[1], self.turn)
        return self._radiance(w)

    def nearest(self, w: Array) -> Array:
        """Radiance (..., C) of the pixel in which each unit world direction `w` (..., 3) lies, not interpolated.

        Raises `DirectionError` where w is not unit.
        """
        require_unit(w, "w")
        if is_numpy(w, self.image):
            return self._look_up(floats(w)[1], self.turn, nearest=True)
        return self._nearest(w)

    def _look_up(self, w: np.ndarray, turn: np.ndarray, nearest: bool = False) -> np.ndarray:
        """By the loops: radiance (..., C) towards `w` (..., 3), whose direction in the layout's axes is turn^T w."""
        height, width = self.mapping.sheet_shape(self.rows, self.columns)
        flat = np.ascontiguousarray(w.reshape(-1, 3))
        out = np.empty((len(flat), self.image.shape[-1]), dtype=to_numpy(self.image[:0]).dtype)
        layout, texels = (self.mapping.kernel, self.mapping.parameter), to_numpy(self._atlas)
        kernels.look_up(*layout, height, width, texels, turn, flat, nearest, out)
        return out.reshape(*w.shape[:-1], -1)

    def _radiance(self, w: Array) -> Array:
        """`radiance` as array code."""
        xp, sheet, y, x, height, width = self._place(w)
        i, j = (xp.clip(xp.astype(k + 0.5, xp.int64), 0, n) for k, n in ((y, height), (x, width)))
        f, g = ((k + 0.5 - xp.astype(n, k.dtype))[..., None] for k, n in ((y, i), (x, j)))
        at = (sheet * (height + 2) + i) * (width + 2) + j
        top = self._texel(at) * (1 - g) + self._texel(at + 1) * g
        bottom = self._texel(at + width + 2) * (1 - g) + self._texel(at + width + 3) * g
        return top * (1 - f) + bottom * f

    def _nearest(self, w: Array) -> Array:
        """`nearest` as array code."""
        xp, sheet, y, x, height, width = self._place(w)
        i, j = (xp.clip(xp.astype(k, xp.int64), 0, n - 1) for k, n in ((y, height), (x, width)))
        return self._texel((sheet * (height + 2) + i + 1) * (width + 2) + j + 1)

    def _place(self, w: Array) -> tuple[Any, Array, Array, Array, int, int]:
        """(namespace, sheet, row, column, rows, columns of a sheet), of world directions."""
        xp, w = namespace(self.image), like(w, self.image)
        height, width = self.mapping.sheet_shape(self.rows, self.columns)
        sheet, u, v = self.mapping.locate(xp, w @ like(self.turn, w))
        return xp, sheet, v * height, u * width, height, width

    def _texel(self, at: Array) -> Array:
        xp = namespace(self.image)
        return xp.reshape(xp.take(self._atlas, xp.reshape(at, (-1,)), axis=0), (*at.shape, -1))

    @cached_property
    def _atlas(self) -> Array:
        """Texels of the sheets with ghosts around them, (sheets * (h + 2) * (w + 2), C)."""
        xp = namespace(self.image)
        height, width = self.mapping.sheet_shape(self.rows, self.columns)

        def index(k: np.ndarray) -> Array:
            # Through a float copy, since `like` brings floats to the image's device: exact below 2^53.
            return xp.astype(
                xp.reshape(like(k.astype(np.float64), xp.astype(self.image[:0], xp.float64)), (-1,)), xp.int64
            )

        pixels = xp.reshape(self.image, (self.rows * self.columns, -1))
        flat = xp.take(pixels, index(self.mapping.placement(self.rows, self.columns)), axis=0)
        corners = self.mapping.corners(height, width)
        if len(corners):
            meeting = xp.reshape(xp.take(flat, index(corners), axis=0), (len(corners), 3, -1))
            flat = xp.concat((flat, xp.mean(meeting, axis=1)), axis=0)
        return xp.take(flat, index(self.mapping.ghosts(height, width)), axis=0)

    def beams(self, positions: Array | None = None, budget: int | None = None) -> Beams:
        """A beam for each pixel that shows anything, or at most `budget` of them (see `clusters.py`).

        directions (K, 3), irradiance (K, C) = radiance x solid angle, distance infinite. Whatever the budget, the
        irradiances sum to the same. Raises `ParameterError` for a budget below 1.
        """
        if budget is not None and budget < 1:
            raise ParameterError(f"budget = {budget} is no number of beams; it is at least 1.")
        if budget is not None and budget in self._clustered:
            return self._clustered[budget]
        w, shown = self.directions()
        if budget is None or budget >= int(shown.sum()):
            at = np.flatnonzero(shown)
            xp = namespace(self.image)
            pixels = xp.reshape(self.image, (self.rows * self.columns, -1))
            irradiance = (pixels * like(self.solid_angles.reshape(-1, 1), self.image))[at.tolist()]
            directions = like(w.reshape(-1, 3)[at], self.image)
            return Beams(directions, irradiance, xp.full_like(directions[:, 0], math.inf))
        energy = to_numpy(self.image) * self.solid_angles[..., None]
        directions, irradiance = (like(x, self.image) for x in clusters(w, energy, budget))
        distance = namespace(directions).full_like(directions[:, 0], math.inf)
        beams = Beams(*(frozen(x, x.dtype) for x in (directions, irradiance, distance)))
        # Only the last budget is likely to be asked for again.
        self.__dict__["_clustered"] = {budget: beams}
        return beams

    @cached_property
    def _clustered(self) -> dict[int, Beams]:
        """The beams of the last budget that was asked for."""
        return {}

    @cached_property
    def _importance(self) -> Importance:
        own = Environment(to_numpy(self.image), self.mapping, self.orientation)
        if not isinstance(self.mapping, LatLongMap):
            height, _ = self.mapping.sheet_shape(self.rows, self.columns)
            own = own.resampled(LatLongMap(), max(2 * height if self.mapping.sheets == 6 else height, 2))
        return Importance.of(own.image, own.turn)

    def sample(self, u: Array) -> np.ndarray:
        """Unit world directions (..., 3) drawn by luminance x solid angle, from uniform `u` (..., 2) in [0, 1).

        Strata of u stay strata of the sphere's rows and columns. The density is `pdf`.
        """
        return self._importance.sample(to_numpy(u))

    def pdf(self, w: Array) -> np.ndarray:
        """Density of `sample` in 1/sr at unit world directions (..., 3) -> (...), positive everywhere."""
        require_unit(w, "w")
        return self._importance.pdf(to_numpy(w))

    def rotated(self, rotation: Array) -> Environment:
        """The environment turned by `rotation` (3, 3): what arrived from w arrives from R w. No pixel is resampled.

        Raises `DirectionError` where it is not a rotation.
        """
        return dataclasses.replace(self, orientation=self.orientation.rotated(rotation))

    def harmonics(self, degree: int) -> Array:
        """Real harmonic coefficients of the radiance in the world frame, ((degree + 1)^2, C); RH 4.13.

        Lat-long maps by `sphere.analysis` on their grid of centres, exact for maps band-limited below it; other
        layouts by the sum over pixels of radiance x Y_lm(centre) x solid angle.
        """
        if degree < 0:
            raise ParameterError(f"degree = {degree} is negative.")
        if isinstance(self.mapping, LatLongMap) and degree <= self.rows - 1:
            return self._harmonics_of_grid(degree)
        return self._harmonics_of_pixels(degree)

    def _harmonics_of_grid(self, degree: int) -> Array:
        from ..sphere.grids import LatLong
        from ..sphere.rotation import rotate
        from ..sphere.transform import analysis

        own = analysis(self.image, LatLong(self.rows, self.columns), degree)
        if np.allclose(self.turn, np.eye(3), atol=1e-12):
            return own
        turn = self.turn
        if np.linalg.det(turn) < 0:
            # A mirror is a turn after the reflection of every direction through the origin: (-1)^l.
            sign = np.repeat((-1.0) ** np.arange(degree + 1), 2 * np.arange(degree + 1) + 1)
            own, turn = own * like(sign[:, None], own), -turn
        return rotate(own, turn)

    def _harmonics_of_pixels(self, degree: int) -> Array:
        from ..sphere.harmonics import harmonics

        xp = namespace(self.image)
        w, shown = self.directions()
        step = max(_BLOCK // ((degree + 1) ** 2 * self.columns), 1)
        total: Any = 0.0
        for r in range(0, self.rows, step):
            rows = slice(r, r + step)
            basis = harmonics(degree, w[rows]) * (self.solid_angles[rows] * shown[rows])[..., None]
            basis = like(basis.reshape(-1, (degree + 1) ** 2), self.image)
            total = total + basis.T @ xp.reshape(self.image[rows], (-1, self.image.shape[-1]))
        return total

    def resampled(self, mapping: Mapping, rows: int, orientation: Orientation | None = None) -> Environment:
        """The same light in another layout of `rows` rows (and standing as `orientation` says; as now, if None).

        Where the new pixels are the old ones in other places (quarter turns, another order of a cube's faces), they
        are moved and keep their values. Otherwise each new pixel is the mean of the bilinear radiance over its solid
        angle, from at least two samples for each old pixel's width, so that no lamp falls through; energy is kept to
        about 1e-3 (the bilinear look-up spreads a lone bright pixel of a polar row unevenly).
        """
        orientation = self.orientation if orientation is None else orientation
        if mapping == self.mapping and rows == self.rows and orientation is self.orientation:
            return self
        shape = mapping.shape(rows)
        turn = self.turn.T @ orientation.matrix(mapping)
        image = moved(to_numpy(self.image), self.mapping, mapping, shape, turn)
        if image is None:
            finest = math.sqrt(float(np.max(self.solid_angles)))
            image = averaged(lambda w: self._look_up(w, turn.T), mapping, shape, finest)
        return Environment(like(image, self.image), mapping, orientation)
