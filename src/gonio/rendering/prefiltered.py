"""Images of a shape from maps made beforehand: a look-up for each ray where `image.py` sums over beams of light.

    pixel = mean over its rays of  B(n, wo) of the maps where the ray meets the shape,  L(ray) where it does not

Without shadows, as the maps are.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from ..arrays import to_numpy
from ..cameras import Camera, Pinhole
from ..directions import normalise
from ..errors import MEMORY_LIMIT, MemoryLimitError, ParameterError
from ..lights.environment import Environment
from ..shapes.analytic import Sphere
from ..shapes.view import Shape
from ..threads import processors
from .shrm import SHRM

_RAYS = 1 << 17  # at once: their fields are some twenty megabytes


def render_prefiltered(
    shape: Shape,
    maps: SHRM,
    camera: Camera,
    *,
    background: Environment | None = None,
    supersample: int = 1,
    threads: int | None = None,
) -> np.ndarray:
    """The radiance (rows, columns, 3), linear float32, that `camera` sees of `shape` whose light field is `maps`.

    `supersample` is the rays a pixel along each side. Where nothing is met `background` is seen, or black.
    Raises `ParameterError` for counts that are not whole numbers from one up, `MemoryLimitError` before an image beyond
    the limit is made.
    """
    for name, value in {"supersample": supersample, "threads": 1 if threads is None else threads}.items():
        if not isinstance(value, int | np.integer) or value < 1:
            raise ParameterError(f"{name} = {value} is not a whole number >= 1.")
    rows, columns = camera.size
    if 12 * rows * columns > MEMORY_LIMIT:
        raise MemoryLimitError(f"an image of {rows} x {columns} exceeds the memory limit. Ask for fewer pixels.")
    image = np.zeros((rows, columns, 3), np.float32)
    shape.trace(*camera.rays(np.array([[0.5, 0.5]])))  # builds the ray tracer, before threads would each build one
    maps.radiance(np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0]))  # and the maps
    step = max(1, _RAYS // (columns * supersample**2))
    x = np.arange(columns * supersample) / supersample + 0.5 / supersample

    def band(low: int) -> None:
        some = slice(low, min(low + step, rows))
        y = np.arange(some.start * supersample, some.stop * supersample) / supersample + 0.5 / supersample
        origins, directions = camera.rays(np.stack(np.meshgrid(x, y), axis=-1))
        view = shape.trace(origins, directions)
        m = view.mask
        colour = np.zeros((*m.shape, 3), np.float32)
        if m.any():
            colour[m] = maps.radiance(view.normal[m], view.wo[m])
        if background is not None and not m.all():
            colour[~m] = to_numpy(background.radiance(directions[~m]))
        image[some] = colour.reshape(len(y) // supersample, supersample, columns, supersample, 3).mean(axis=(1, 3))

    with ThreadPoolExecutor(processors() if threads is None else threads) as pool:
        for _ in pool.map(band, range(0, rows, step)):
            pass
    return image


def balls(maps: SHRM, background: Environment | None = None, size: int = 200) -> np.ndarray:
    """A ball seen from four sides and from above, to look at: (size, 5 size, 3)."""
    eyes = ((0.0, -1.0, 0.3), (1.0, 0.0, 0.3), (0.0, 1.0, 0.3), (-1.0, 0.0, 0.3), (0.0, -0.3, 1.0))
    images = []
    for eye in eyes:
        camera = Pinhole.look_at(eye=5 * normalise(eye), target=(0, 0, 0), field_of_view=27, size=(size, size))
        images.append(render_prefiltered(Sphere(), maps, camera, background=background, supersample=2))
    return np.concatenate(images, axis=1)
