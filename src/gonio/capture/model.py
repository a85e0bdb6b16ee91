"""What was photographed from one place, and what is known about it: the value that all that follows starts from.

    pixel (row, column)    x = (column + 1/2 - columns/2) texel,   y = (rows/2 - row - 1/2) texel,   z = 0

This is the frame where nothing else is said: x right, y up, z towards the camera, so that a sample lying flat faces
+z, in texels. A camera sees its own pixels' rays meet the shape, or where none is given the plane z = 0. The eye may
stand elsewhere than the camera whose pixels these are: photographs brought to a sample's plane have texels in a square
grid, and were taken from `eye`.

Not here: reading one (`files/captures.py`), photographs from several places (`turntable.py`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import distance_transform_edt

from ..arrays import Array, frozen, require_finite, to_numpy
from ..brdf.model import BRDF
from ..cameras import Camera, Orthographic
from ..directions import normalise, require_unit
from ..errors import ArrayError
from ..frames import frame
from ..lights.model import Light
from ..reflection import varied
from ..shapes.view import Shape, View
from .lighting import directions_of, one_each
from .photographs import Chosen, Photographs
from .sites import Observation, Sites

if TYPE_CHECKING:
    from ..samples import RadianceSamples
    from .sampling import Reflectance


@dataclasses.dataclass(frozen=True, eq=False)
class Capture:
    """`photographs`, N of (rows, columns).

    lights: N, one for each photograph (`distant_lights`, `near_lights`); None where unknown. Their strengths are
        relative, and 1 where not told. mask: (rows, columns) bool, where the object is. normals: (rows, columns, 3),
        unit on the mask; where not given, those of the shape. shape: in the world, as far as it is known: it says where
        pixels lie and what it shades. camera: that of the pixels; straight above, far away, with texels of 1, where not
        given. eye: (3,), where the camera stood if not where `camera` has it. layout: how it was found. findings: what
        was not as it should be, and what was done about it.

    Raises `ArrayError` where shapes do not fit, `DirectionError` for normals that are not unit.
    """

    photographs: Photographs
    lights: tuple[Light, ...] | None = None
    mask: Array = None
    normals: Array | None = None
    shape: Shape | None = None
    camera: Camera = None  # type: ignore[assignment]  # it is one once made
    eye: Array | None = None
    layout: str = ""
    findings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n, size = len(self.photographs), tuple(self.photographs.size)
        object.__setattr__(self, "lights", one_each(self.lights, n))
        camera: Camera | None = self.camera
        if camera is None:
            object.__setattr__(self, "camera", above(size))
        if self.camera.size != size:
            raise ArrayError(f"the camera has {self.camera.size} pixels, the photographs {size}.")
        if self.eye is not None:
            eye = frozen(to_numpy(self.eye), np.dtype(np.float64))
            _require_shape("eye", eye, (3,))
            require_finite(eye, "eye")
            object.__setattr__(self, "eye", eye)
        mask = np.ones(size, bool) if self.mask is None else to_numpy(self.mask).astype(bool)
        _require_shape("mask", mask, size)
        if self.shape is not None:
            mask = mask & self._view.mask
        if not mask.any():
            raise ArrayError("mask is empty: no pixel is on the object.")
        object.__setattr__(self, "mask", frozen(mask, np.dtype(bool)))
        normals = self.normals
        if normals is None and self.shape is not None:
            normals = np.where(mask[..., None], self._view.normal, 0.0)
        if normals is not None:
            normals = frozen(to_numpy(normals), np.dtype(np.float32))
            _require_shape("normals", normals, (*size, 3))
            require_unit(normals[mask], "normals on the mask")
            object.__setattr__(self, "normals", normals)

    @property
    def directions(self) -> np.ndarray | None:
        """(N, 3), unit, towards the lights, where they are known and distant; otherwise None."""
        return directions_of(self.lights)

    @cached_property
    def positions(self) -> np.ndarray:
        """(rows, columns, 3): where pixels see the shape, or the plane z = 0 where none is given; NaN where nothing."""
        if self.shape is not None:
            return self._view.position
        origins, directions = self.camera.rays()
        with np.errstate(divide="ignore", invalid="ignore"):
            t = -origins[..., 2:] / directions[..., 2:]
            positions: np.ndarray = np.where(t > 0, origins + t * directions, np.nan)
        return positions

    @cached_property
    def sites(self) -> Sites:
        """The pixels of the mask, along its rows. Raises `ArrayError` where normals are unknown."""
        if self.normals is None:
            raise ArrayError(
                "the capture's shape is unknown: give normals, as by dataclasses.replace(capture, normals=...) from "
                "photometric_stereo(capture).normals."
            )
        mask, n = self.mask, self.normals[self.mask].astype(np.float64)
        positions = self.positions[mask]
        require_finite(positions, "positions on the mask")
        if self.shape is None:
            return Sites(positions, positions, frame(n))
        frames, tangent = np.asarray(frame(n)), self._view.tangent[mask]
        # Where a texture gives no direction, or a normal of a map lies along it, any will do.
        across = np.linalg.norm(np.cross(n, tangent), axis=1) > 1e-3
        frames[across] = frame(n[across], tangent[across])
        return Sites(positions, self._view.lifted[mask], frames)

    @cached_property
    def view(self) -> View:
        """What the camera sees, as renderers have it: uv runs over the pixels, so that maps of the photographs' size
        are its textures. Raises `ArrayError` where normals are unknown."""
        sites, mask = self.sites, self.mask
        rows, columns = mask.shape
        row, column = np.nonzero(mask)
        return View.of(
            mask,
            position=sites.positions,
            lifted=sites.lifted,
            geometric=sites.frames[:, 2],
            normal=sites.frames[:, 2],
            tangent=sites.frames[:, 0],
            uv=np.stack(((column + 0.5) / columns, 1 - (row + 0.5) / rows), axis=-1),
            wo=self._to_eye,
            distance=np.linalg.norm(self.camera.towards(sites.positions), axis=-1),
        )

    def select(self, which: Sequence[int]) -> Capture:
        """The same with the photographs numbered `which` alone. Raises `ArrayError` where there is no such one."""
        n = len(self.photographs)
        if not len(which) or not all(-n <= k < n for k in which):
            raise ArrayError(f"photographs {list(which)} of {n}: give one or more of 0 to {n - 1}.")
        lights = None if self.lights is None else tuple(self.lights[k] for k in which)
        return dataclasses.replace(self, photographs=Chosen(self.photographs, which), lights=lights)

    def textures(self, material: BRDF) -> BRDF:
        """`material`, whose parameters vary over the sites, with those as textures over the pixels of `view`; beyond
        the mask they are those of the nearest site. Raises `ArrayError` where they vary over other sites."""
        count = int(np.count_nonzero(self.mask))
        nearest = distance_transform_edt(~self.mask, return_distances=False, return_indices=True)

        def spread(value: Array, axes: int) -> np.ndarray:
            values = to_numpy(value)
            if len(values) != count:
                raise ArrayError(f"a parameter has shape {values.shape}; {count} sites are on the mask.")
            over = np.zeros((*self.mask.shape, *values.shape[1:]), values.dtype)
            over[self.mask] = values
            return np.asarray(over[tuple(nearest)])

        return varied(material, spread)

    def observe(self, k: int) -> Observation:
        """What photograph k tells of every site."""
        radiance, clipped = self.photographs.pick(k, self._pixels)
        return Observation(radiance, ~clipped, self._to_eye)

    def observe_all(self, some: np.ndarray) -> Observation:
        """What every photograph tells of sites `some` (S,): radiance (N, S, 3), known (N, S)."""
        radiance, clipped = self.photographs.pixels(self._pixels[some])
        return Observation(radiance, ~clipped, self._to_eye[some])

    def reflectance(self, least: float = 0.0, dark: float = 0.0, shadows: bool = True) -> Reflectance:
        """f(wi, wo) at every pixel of the mask under every light, streamed: `sampling.Reflectance`.

        least: in [0, 1), the part of a pixel's mean below which a photograph is left out (MS 9: .05). dark: >= 0, the
        radiance below which it is. shadows: leave out what the shape shades, where one is given.
        Raises `ArrayError` where lights or normals are unknown, `ParameterError` for another `least` or `dark`.
        """
        from .sampling import Reflectance

        return Reflectance(self, least, dark, shadows)

    def radiance(self) -> Iterator[RadianceSamples]:
        """B(n, wo) at every pixel of the mask, whatever the light, a block for each photograph: `sampling.radiance`.

        Raises `ArrayError` where normals are unknown.
        """
        from .sampling import radiance

        return radiance(self)

    def mean(self) -> np.ndarray:
        """The mean of all photographs, (rows, columns, 3)."""
        total = np.zeros((*self.photographs.size, 3))
        for k in range(len(self.photographs)):
            total += self.photographs.read(k).radiance
        return (total / len(self.photographs)).astype(np.float32)

    @cached_property
    def _view(self) -> View:
        assert self.shape is not None
        return self.shape.view(self.camera)

    @cached_property
    def _pixels(self) -> np.ndarray:
        """Those of the sites, (S,), counted along rows."""
        return np.flatnonzero(self.mask)

    def towards_eye(self, positions: np.ndarray) -> np.ndarray:
        """wo (S, 3), unit, from any `positions` (S, 3)."""
        to = self.camera.towards(positions) if self.eye is None else self.eye - positions
        towards: np.ndarray = normalise(to, "the way from positions to the eye")
        return towards

    @cached_property
    def _to_eye(self) -> np.ndarray:
        """wo at the sites, (S, 3)."""
        if self.eye is not None:
            return self.towards_eye(self.positions[self.mask])
        return -self.camera.rays()[1][self.mask]


def above(size: tuple[int, ...], texel: float = 1.0) -> Orthographic:
    """The camera straight above, far away, whose `size` (rows, columns) pixels are squares of `texel` about (0, 0)."""
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[2, 3] = 16 * max(size) * texel
    return Orthographic(pixel=texel, size=(size[0], size[1]), pose=pose)


def _require_shape(name: str, array: np.ndarray, shape: tuple[int, ...]) -> None:
    if array.shape != shape:
        raise ArrayError(f"{name} has shape {array.shape}; {shape} is wanted.")
