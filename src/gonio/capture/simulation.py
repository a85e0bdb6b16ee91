"""Captures of what is known: photographs as a camera would take them, made by the forward model.

    code = floor(min(g E + noise, 1) (2^bits - 1) + 1/2),   variance of the noise = gain g E + read^2

E radiance by brute force (`reflection.radiance`, with shadow rays where asked for), g the exposure, noise and gain in
units of the brightest code. Photographs are made when they are asked for, each from its own seed, so that a thousand
take no memory and always come out the same. The lights that the capture tells may be off from the true ones. Not here:
light that surfaces send to each other, lenses out of focus.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from ..arrays import frozen, to_numpy
from ..brdf.model import BRDF
from ..cameras import Camera, Orthographic, look_at
from ..directions import normalise
from ..errors import ArrayError, ParameterError
from ..lights.model import Light
from ..lights.points import Directional, Point
from ..lights.uneven import Uneven
from ..reflection import radiance, textured
from ..shapes.mesh import Mesh
from ..shapes.view import Shape, View
from .model import Capture
from .photographs import Photograph, Photographs
from .turntable import Turntable


@dataclasses.dataclass(frozen=True)
class Sensor:
    """exposure > 0: code per radiance, 1 is the brightest. gain, read >= 0: noise, in units of it. bits: 1 to 24, or
    None for codes that are not rounded."""

    exposure: float = 1.0
    gain: float = 0.0
    read: float = 0.0
    bits: int | None = None

    def __post_init__(self) -> None:
        if not (0 < self.exposure < math.inf and 0 <= self.gain < math.inf and 0 <= self.read < math.inf):
            raise ParameterError(f"{self} has numbers that are negative or not finite, or no exposure.")
        if self.bits is not None and not 1 <= self.bits <= 24:
            raise ParameterError(f"Sensor: bits = {self.bits} lies outside [1, 24].")


class SimulatedPhotographs(Photographs):
    """What `sensor` records of `shape` with `material`: photograph k by cameras[k] under lights[k].

    Parameters of the material that vary over two axes are textures of the shape's uv, bilinear.
    """

    def __init__(
        self,
        shape: Shape,
        material: BRDF,
        cameras: Sequence[Camera],
        lights: Sequence[Light],
        sensor: Sensor,
        shadows: bool,
        seed: int,
    ) -> None:
        self.shape, self.material, self.sensor = shape, material, sensor
        self.cameras, self.lights, self.shadows, self.seed = tuple(cameras), tuple(lights), shadows, seed
        self.names = tuple(f"photo{k:0{len(str(len(lights) - 1))}}.png" for k in range(len(lights)))
        self.size = self.cameras[0].size
        self._seen: tuple[Camera, View, BRDF] | None = None
        self._truth: tuple[int, np.ndarray] | None = None

    def view(self, k: int) -> View:
        """What camera k sees of the shape."""
        return self._scene(k)[0]

    def truth(self, k: int) -> np.ndarray:
        """Radiance without sensor, (rows, columns, 3): black where nothing is."""
        if self._truth is None or self._truth[0] != k:
            self._truth = k, frozen(self._radiance(k))
        return self._truth[1]

    def _radiance(self, k: int) -> np.ndarray:
        view, material = self._scene(k)
        mask = view.mask
        image = np.zeros((*mask.shape, 3))

        def arriving(x: np.ndarray, w: np.ndarray, distance: np.ndarray) -> np.ndarray:
            return ~self.shape.occluded(x, w, distance)

        if mask.any():
            image[mask] = to_numpy(
                radiance(
                    material,
                    self.lights[k],
                    view.frames[mask],
                    view.wo[mask],
                    view.lifted[mask] if self.shadows else view.position[mask],
                    visibility=arriving if self.shadows else None,
                )
            )
        return image

    def read(self, k: int) -> Photograph:
        return self.exposed(k, self.sensor)

    def exposed(self, k: int, sensor: Sensor) -> Photograph:
        """Photograph k by another sensor, or another exposure of the same one, with noise of its own."""
        rng = np.random.default_rng((self.seed, k, int(np.float64(sensor.exposure).view(np.uint64))))
        code = sensor.exposure * self.truth(k)
        if sensor.gain or sensor.read:
            code = code + rng.normal(size=code.shape) * np.sqrt(sensor.gain * code + sensor.read**2)
        code = np.clip(code, 0, 1)
        if sensor.bits is not None:
            steps = 2**sensor.bits - 1
            code = np.floor(code * steps + 0.5) / steps
        return Photograph((code / sensor.exposure).astype(np.float32), np.asarray((code >= 1).any(axis=2)))

    def _scene(self, k: int) -> tuple[View, BRDF]:
        """What camera k sees, and the material there: kept while the camera stays."""
        camera = self.cameras[k]
        if self._seen is None or self._seen[0] is not camera:
            view = self.shape.view(camera)
            uv = None if view.uv is None else view.uv[view.mask]
            self._seen = camera, view, textured(self.material, uv)
        return self._seen[1:]


def simulate(
    shape: Shape,
    material: BRDF,
    lights: Sequence[Light],
    camera: Camera | None = None,
    sensor: Sensor | None = None,
    *,
    shadows: bool = False,
    misaligned: float = 0.0,
    seed: int = 0,
) -> Capture:
    """The capture of `shape` with `material` from one place, a photograph under each of the N `lights`, with its truth.

    material: where its parameters vary over two axes, they are textures over the shape's uv. lights: of any kind; where
    they are environments, the capture does not tell them. Distant ones of irradiance pi make white 1. camera:
    orthographic from +z, 256 pixels along the longer side, where None. sensor: without noise or codes where None.
    shadows: those that the shape casts. misaligned: degrees rms by which the lights that the capture tells are off, as
    seen from the middle of the shape. seed: of noise and misalignment.

    Raises `ArrayError` where there is no light or the camera sees nothing of the shape, `ParameterError` for a texture
    on a shape without uv.
    """
    lights = _some(lights)
    camera = from_above(shape, 256) if camera is None else camera
    photographs = SimulatedPhotographs(
        shape, material, [camera] * len(lights), lights, Sensor() if sensor is None else sensor, shadows, seed
    )
    view = photographs.view(0)
    if not view.mask.any():
        raise ArrayError("the camera sees nothing of the shape.")
    normals = np.where(view.mask[..., None], view.normal, 0.0)
    told = _told(lights, shape, misaligned, seed)
    return Capture(photographs, told, view.mask, normals, shape, camera, layout="simulated")


def simulate_turntable(
    shape: Mesh,
    material: BRDF,
    lights: Light | Sequence[Light],
    cameras: Sequence[Camera],
    sensor: Sensor | None = None,
    *,
    shadows: bool = False,
    misaligned: float = 0.0,
    seed: int = 0,
) -> Turntable:
    """Photographs of a mesh by each of `cameras`, under one of the `lights` each, or all under the same one.

    Arguments and errors are those of `simulate`; cameras are of one size.
    """
    every = (lights,) * len(cameras) if isinstance(lights, Light) else _some(lights)
    if len(every) != len(cameras) or not every:
        raise ArrayError(f"{len(every)} lights came for {len(cameras)} cameras.")
    if any(camera.size != cameras[0].size for camera in cameras):
        raise ArrayError("cameras are not all of one size.")
    photographs = SimulatedPhotographs(
        shape, material, cameras, every, Sensor() if sensor is None else sensor, shadows, seed
    )
    return Turntable(
        photographs, tuple(cameras), shape, _told(every, shape, misaligned, seed), layout="simulated turntable"
    )


def _some(lights: Sequence[Light]) -> tuple[Light, ...]:
    lights = tuple(lights)
    if not lights:
        raise ArrayError("no light was given: a capture has a photograph for each.")
    for k, light in enumerate(lights):
        if not isinstance(light, Light):
            raise ArrayError(f"lights[{k}] is {type(light).__name__}; distant_lights(directions) makes lights.")
    return lights


def _told(lights: tuple[Light, ...], shape: Shape, misaligned: float, seed: int) -> tuple[Light, ...] | None:
    """The lights as the capture tells them: turned a little about the middle of the shape, None where they are many."""
    if not (math.isfinite(misaligned) and misaligned >= 0):
        raise ParameterError(f"misaligned = {misaligned}; degrees >= 0 are wanted.")
    low, high = shape.bounds
    middle, rng = (low + high) / 2, np.random.default_rng((seed, len(lights)))

    def turned(offset: np.ndarray) -> np.ndarray:
        length = float(np.linalg.norm(offset))
        # Two components across the direction, each a root of a half of it.
        across = rng.normal(size=3)
        across -= (across @ offset) / length**2 * offset
        direction: np.ndarray = normalise(offset / length + across * (math.radians(misaligned) / math.sqrt(2)))
        return length * direction

    def off(light: Light) -> Light | None:
        if isinstance(light, Uneven):
            bare = off(light.light)
            return None if bare is None else dataclasses.replace(light, light=bare)
        if isinstance(light, Directional):
            return dataclasses.replace(light, direction=turned(light.direction)) if misaligned else light
        if isinstance(light, Point):
            place = middle + turned(light.position - middle) if misaligned else light.position
            return dataclasses.replace(light, position=place)
        return None

    told = [off(light) for light in lights]
    return None if any(light is None for light in told) else tuple(told)  # type: ignore[arg-type]


def from_above(shape: Shape, size: int) -> Orthographic:
    """An orthographic camera over the shape, x right and y up, with `size` pixels along the longer side."""
    low, high = shape.bounds
    middle, extent = (low + high) / 2, high - low
    pixel = 1.04 * float(max(extent[:2])) / size
    rows, columns = (max(1, math.ceil(1.04 * extent[k] / pixel)) for k in (1, 0))
    eye = (middle[0], middle[1], high[2] + float(max(extent)) + 1)
    return Orthographic(pixel=pixel, size=(rows, columns), pose=look_at(eye, middle, up=(0, 1, 0)))
