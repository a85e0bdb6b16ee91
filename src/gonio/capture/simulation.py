"""Captures of what is known: photographs as a camera would take them, made by the forward model.

    code = floor(min(g E + noise, 1) (2^bits - 1) + 1/2),   variance of the noise = gain g E + read^2

E radiance by brute force (`reflection.radiance`, with shadow rays where asked for), g the exposure, noise and gain in
units of the brightest code. Photographs are made when they are asked for, each from its own seed, so that a thousand
take no memory and always come out the same. The directions that the capture tells may be off from the true ones.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ..arrays import to_numpy
from ..brdf.model import BRDF
from ..cameras import Camera, Orthographic, look_at
from ..directions import normalise, require_unit
from ..errors import ArrayError, ParameterError
from ..lights.points import Directional
from ..reflection import radiance
from ..shapes.view import Shape, View
from .model import Capture
from .photographs import Photograph, Photographs


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
    """What `sensor` records of `material` on what `view` saw, under one light after the other."""

    def __init__(
        self,
        shape: Shape,
        material: BRDF,
        view: View,
        directions: np.ndarray,
        intensities: np.ndarray,
        sensor: Sensor,
        shadows: bool,
        seed: int,
    ) -> None:
        self.shape, self.material, self.view, self.sensor = shape, material, view, sensor
        self.directions, self.intensities, self.shadows, self.seed = directions, intensities, shadows, seed
        self.names = tuple(f"photo{k:0{len(str(len(directions) - 1))}}.png" for k in range(len(directions)))
        rows, columns = view.mask.shape
        self.size = rows, columns

    def truth(self, k: int) -> np.ndarray:
        """Radiance without camera, (rows, columns, 3): black where nothing is."""
        view, mask = self.view, self.view.mask
        image = np.zeros((*mask.shape, 3))
        light = Directional(self.directions[k], self.intensities[k])

        def arriving(x: np.ndarray, w: np.ndarray, distance: np.ndarray) -> np.ndarray:
            return ~self.shape.occluded(x, w, distance)

        image[mask] = to_numpy(
            radiance(
                self.material,
                light,
                view.frames[mask],
                view.wo[mask],
                view.lifted[mask],
                visibility=arriving if self.shadows else None,
            )
        )
        return image

    def read(self, k: int) -> Photograph:
        sensor, rng = self.sensor, np.random.default_rng((self.seed, k))
        code = sensor.exposure * self.truth(k)
        if sensor.gain or sensor.read:
            code = code + rng.normal(size=code.shape) * np.sqrt(sensor.gain * code + sensor.read**2)
        code = np.clip(code, 0, 1)
        if sensor.bits is not None:
            steps = 2**sensor.bits - 1
            code = np.floor(code * steps + 0.5) / steps
        return Photograph((code / sensor.exposure).astype(np.float32), np.asarray((code >= 1).any(axis=2)))


def simulate(
    shape: Shape,
    material: BRDF,
    directions: np.ndarray,
    camera: Camera | None = None,
    intensities: np.ndarray | None = None,
    sensor: Sensor | None = None,
    *,
    shadows: bool = False,
    misaligned: float = 0.0,
    seed: int = 0,
) -> Capture:
    """The capture of `shape` with `material` under lights from unit `directions` (N, 3), with its normals and mask.

    camera: orthographic from +z, 256 pixels along the longer side, where None; it has to look along -z. intensities
    (N, 3): the lights' irradiance, pi where None, so that white is 1. sensor: without noise or codes where None.
    misaligned: degrees rms by which the directions that the capture tells are off. seed: of noise and misalignment.

    Raises `DirectionError` for directions that are not unit, `ArrayError` where the camera sees nothing of the shape or
    shapes do not fit, `ParameterError` for a camera that looks elsewhere.
    """
    directions = np.asarray(directions, dtype=np.float64)
    if directions.ndim != 2 or directions.shape[1] != 3 or not len(directions):
        raise ArrayError(f"directions have shape {directions.shape}; (N, 3) is wanted.")
    require_unit(directions, "directions")
    lights = np.full((len(directions), 3), math.pi) if intensities is None else np.asarray(intensities, np.float64)
    if lights.shape != directions.shape:
        raise ArrayError(f"intensities have shape {lights.shape}; {directions.shape} is wanted.")
    if not (math.isfinite(misaligned) and misaligned >= 0):
        raise ParameterError(f"misaligned = {misaligned}; degrees >= 0 are wanted.")
    camera = from_above(shape, 256) if camera is None else camera
    if not np.allclose(camera.forward, [0, 0, -1], atol=1e-6):
        raise ParameterError("the camera of a capture looks along -z; from_above(shape, size) makes one.")
    view = shape.view(camera)
    if not view.mask.any():
        raise ArrayError("the camera sees nothing of the shape.")
    photographs = SimulatedPhotographs(
        shape, material, view, directions, lights, Sensor() if sensor is None else sensor, shadows, seed
    )
    told = directions
    if misaligned:
        # Two components across the direction, each a root of a half of it.
        across = np.random.default_rng((seed, len(directions))).normal(size=directions.shape)
        across -= (across * directions).sum(axis=1, keepdims=True) * directions
        told = normalise(directions + across * (math.radians(misaligned) / math.sqrt(2)))
    normals = np.where(view.mask[..., None], view.normal, 0.0)
    return Capture(photographs, told, lights, view.mask, normals, "simulated")


def from_above(shape: Shape, size: int) -> Orthographic:
    """An orthographic camera over the shape, x right and y up, with `size` pixels along the longer side."""
    low, high = shape.bounds
    middle, extent = (low + high) / 2, high - low
    pixel = 1.04 * float(max(extent[:2])) / size
    rows, columns = (max(1, math.ceil(1.04 * extent[k] / pixel)) for k in (1, 0))
    eye = (middle[0], middle[1], high[2] + float(max(extent)) + 1)
    return Orthographic(pixel=pixel, size=(rows, columns), pose=look_at(eye, middle, up=(0, 1, 0)))
