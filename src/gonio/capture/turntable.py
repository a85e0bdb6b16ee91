"""Photographs of a known shape from many places: a turntable, a camera carried round, a gantry.

    pixel of site x in photograph k        p = project_k(x)
    seen there                             n.wo > 0, nothing of the shape between x and the eye
    radiance                               bilinear between the four pixels about p; clipped where one of them is

The four pixels have to see the surface about x: each of their rays meets the shape where it meets the plane of x, to
half of its distance from x. So no radiance is mixed over an edge with what lies behind.

Sites are points of the shape, in the world of the cameras: the vertices of a mesh, or texels over its uv. Where the
object turns and the camera stands, cameras are told as seen from the object, and so are lights. Not here: finding the
cameras (COLMAP does), shapes that are off: there the rim is painted with background, which a smaller `grazing` leaves
out.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from ..cameras import Camera
from ..directions import normalise
from ..errors import ArrayError, ParameterError
from ..frames import frame
from ..lights.model import Light
from ..shapes.atlas import atlas
from ..shapes.mesh import Mesh
from ..shapes.view import View
from .lighting import directions_of, one_each
from .photographs import Photographs
from .sites import Observation, Sites

if TYPE_CHECKING:
    from ..samples import RadianceSamples
    from .sampling import Reflectance


@dataclasses.dataclass(frozen=True, eq=False)
class Turntable:
    """`photographs`, N of one size, and `cameras`, one for each, in the world of the shape.

    shape: a mesh, None where unknown. texels: sites are its vertices where None, otherwise the texels of a map of its
        uv with so many (rows, columns). lights: N, in the same world, or None where unknown. grazing: the angle of
        view, degrees from the normal, beyond which a site does not count as seen.

    Raises `ArrayError` where numbers or sizes do not fit, `ParameterError` for texels of a shape without uv, or another
    angle.
    """

    photographs: Photographs
    cameras: tuple[Camera, ...]
    shape: Mesh | None = None
    lights: tuple[Light, ...] | None = None
    texels: tuple[int, int] | None = None
    grazing: float = 80.0
    layout: str = ""
    findings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n, size = len(self.photographs), tuple(self.photographs.size)
        object.__setattr__(self, "cameras", tuple(self.cameras))
        if len(self.cameras) != n:
            raise ArrayError(f"{len(self.cameras)} cameras came for {n} photographs.")
        for k, camera in enumerate(self.cameras):
            if camera.size != size:
                raise ArrayError(f"cameras[{k}] has {camera.size} pixels, the photographs {size}.")
        object.__setattr__(self, "lights", one_each(self.lights, n))
        if not 0 < self.grazing <= 90:
            raise ParameterError(f"grazing = {self.grazing:g} lies outside (0, 90] degrees.")
        if self.texels is not None and (self.shape is None or self.shape.uv is None):
            raise ParameterError("texels want a shape with uv; without them sites are the vertices.")

    @property
    def directions(self) -> np.ndarray | None:
        """(N, 3), unit, towards the lights, where they are known and distant; otherwise None."""
        return directions_of(self.lights)

    @cached_property
    def mask(self) -> np.ndarray:
        """(rows, columns) bool: the texels that some face covers, whose rows the sites are counted along."""
        if self.texels is None or self.shape is None:
            raise ArrayError("sites are vertices, which have no mask: give texels.")
        return self._atlas.mask

    @cached_property
    def sites(self) -> Sites:
        """The vertices, or the texels of the mask along its rows. Raises `ArrayError` where the shape is unknown."""
        if self.shape is None:
            raise ArrayError("the capture's shape is unknown: dataclasses.replace(capture, shape=read_mesh(...)).")
        if self.texels is not None:
            view = self._atlas
            return Sites(view.position[view.mask], view.lifted[view.mask], view.frames[view.mask])
        normals = np.asarray(self.shape.normals, dtype=np.float64)
        low, high = self.shape.bounds
        positions = np.asarray(self.shape.vertices, dtype=np.float64)
        # Off the faces about a vertex by what single precision may take away from it.
        lifted = positions + 1e-5 * float(np.max(high - low)) * normals
        return Sites(positions, lifted, np.asarray(frame(normals)))

    def towards_eye(self, positions: np.ndarray) -> np.ndarray:
        raise ArrayError("photographs are from many places: no one direction is to the eye. Take those from one place.")

    def observe(self, k: int) -> Observation:
        """What photograph k tells of every site."""
        return self._observe(k, self.sites)

    def observe_all(self, some: np.ndarray) -> Observation:
        """What every photograph tells of sites `some` (S,): radiance (N, S, 3), known (N, S), wo (N, S, 3)."""
        sites = self.sites[some]
        every = [self._observe(k, sites) for k in range(len(self.photographs))]
        return Observation(*(np.stack(parts) for parts in zip(*every, strict=True)))

    def reflectance(self, least: float = 0.0, dark: float = 0.0, shadows: bool = True) -> Reflectance:
        """f(wi, wo) at every site from every photograph that sees it, streamed, as `Capture.reflectance`."""
        from .sampling import Reflectance

        return Reflectance(self, least, dark, shadows)

    def radiance(self) -> Iterator[RadianceSamples]:
        """B(n, wo) at every site from every photograph that sees it, whatever the light, as `Capture.radiance`."""
        from .sampling import radiance

        return radiance(self)

    @cached_property
    def _atlas(self) -> View:
        assert self.shape is not None and self.texels is not None
        return atlas(self.shape, self.texels)

    def _observe(self, k: int, sites: Sites) -> Observation:
        camera, shape = self.cameras[k], self.shape
        assert shape is not None
        seen, pixels, wo = self._seen(camera, shape, sites)
        image, clipped = self.photographs.read(k)
        radiance = np.zeros((len(sites), 3), np.float32)
        # Pixel centres lie at + 1/2, arrays count them from 0.
        place = pixels[seen, ::-1].T - 0.5
        for channel in range(3):
            radiance[seen, channel] = ndimage.map_coordinates(image[..., channel], place, order=1, mode="nearest")
        touched = ndimage.map_coordinates(clipped.astype(np.float32), place, order=1, mode="nearest") > 0
        seen[seen] = ~touched
        return Observation(radiance, seen, wo)

    def _seen(self, camera: Camera, shape: Mesh, sites: Sites) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Which sites camera sees, where in its image (S, 2), and wo (S, 3)."""
        pixels, depth = camera.project(sites.positions)
        rows, columns = camera.size
        with np.errstate(invalid="ignore"):
            inside = (depth > 0) & (pixels >= 0.5).all(axis=-1) & (pixels <= (columns - 0.5, rows - 0.5)).all(axis=-1)
        towards = camera.towards(sites.positions)
        wo, distance = normalise(towards), np.linalg.norm(towards, axis=-1)
        seen = inside & (np.sum(sites.frames[:, 2] * wo, axis=-1) > math.cos(math.radians(self.grazing)))
        seen[seen] = ~shape.occluded(sites.lifted[seen], wo[seen], distance[seen])
        seen[seen] = _alone(camera, shape, pixels[seen], sites.positions[seen], sites.frames[seen, 2])
        return seen, pixels, wo


def _alone(camera: Camera, shape: Mesh, pixels: np.ndarray, x: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Whether the four pixels about `pixels` (S, 2) all see the surface about x (S, 3), with normals n (S, 3)."""
    corner = np.floor(pixels - 0.5)[:, None] + 0.5 + np.array([(0, 0), (1, 0), (0, 1), (1, 1)])
    corner = np.minimum(corner, np.array(camera.size[::-1]) - 0.5)
    # Sites share pixels: each is traced once.
    wanted, place = np.unique(corner.reshape(-1, 2), axis=0, return_inverse=True)
    origins, directions = camera.rays(wanted)
    met = shape.trace(origins, directions).distance
    o, d, t = (array[place.reshape(len(x), 4)] for array in (origins, directions, met))
    with np.errstate(divide="ignore", invalid="ignore"):
        plane = np.sum((x[:, None] - o) * n[:, None], axis=-1) / np.sum(d * n[:, None], axis=-1)
        across = np.linalg.norm(o + plane[..., None] * d - x[:, None], axis=-1)
        alone: np.ndarray = (np.abs(t - plane) < 0.5 * across + 1e-6 * np.abs(plane)).all(axis=1)
    return alone
