"""Normals and heights of a matte relief under lamps that are near: each tells the other where lights come from.

    z_0 = 0;   n_i = photometric stereo with lights as seen from (x, y, z_i);   z_(i+1) = heights of n_i

until heights change by less than a tenth of a texel, rms. Slopes do not tell how high the whole stands: the mean over
the mask is that of the capture's positions, the plane z = 0 where it has no shape. Not here: perspective of the eye,
through which higher parts look larger.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from ..cameras import Orthographic
from ..errors import ParameterError
from ..shapes.heightfield import HeightField
from .integration import Integration, integrate_normals
from .model import Capture
from .photometric_stereo import Relief, photometric_stereo

_ROUNDS = 16
_STILL = 0.1  # texels
_FLOOR = np.radians(0.1)  # errors of normals are not believed below it


@dataclasses.dataclass(frozen=True, eq=False)
class NearRelief:
    """`relief` and its `surface`, heights in texels; `converged`, and the `reason` why rounds ended."""

    relief: Relief
    surface: Integration
    converged: bool
    reason: str


def heights_of(relief: Relief) -> Integration:
    """The heights, in texels, of a relief's normals, each weighted by how well it is known; NaN where none faces up."""
    known = np.isfinite(relief.error) & (relief.normals[..., 2] > 0)
    return integrate_normals(relief.normals, known, 1 / (relief.error**2 + _FLOOR**2))


def near_photometric_stereo(
    capture: Capture, robust: bool = True, progress: Callable[[int, int], None] | None = None
) -> NearRelief:
    """Normals and heights that agree with lights near the object. Arguments and errors are those of
    `photometric_stereo`; the photographs are read once a round, of which there are at most sixteen.

    Raises `ParameterError` where the camera is not orthographic from above, the shape of whose pixels heights are.
    """
    camera = capture.camera
    if not isinstance(camera, Orthographic) or not np.allclose(camera.forward, (0, 0, -1)):
        raise ParameterError("near lights want a camera straight above; bring the photographs to the plane: rectify.")
    mean = float(np.mean(capture.positions[capture.mask][:, 2])) / camera.pixel
    before = np.full(capture.mask.shape, mean)
    level = HeightField(before * camera.pixel, camera.pixel)
    scene = dataclasses.replace(capture, normals=None, shape=level)
    for number in range(_ROUNDS):
        relief = photometric_stereo(scene, robust, _round(progress, number))
        surface = heights_of(relief)
        after = mean + np.where(np.isfinite(surface.heights), surface.heights, np.nanmin(surface.heights))
        change = float(np.sqrt(np.mean((after - before)[capture.mask] ** 2)))
        if change < _STILL:
            return NearRelief(relief, surface, True, f"heights were still to {change:.2g} texels in round {number + 1}")
        before = after
        shape = HeightField(after * camera.pixel, camera.pixel)
        scene = dataclasses.replace(capture, normals=None, shape=shape)
    reason = f"heights still changed by {change:.2g} texels in round {_ROUNDS}"
    return NearRelief(relief, surface, False, reason)


def _round(progress: Callable[[int, int], None] | None, number: int) -> Callable[[int, int], None] | None:
    """Tells `progress` of one round, of as many as may come."""
    if progress is None:
        return None
    return lambda done, total: progress(number * total + done, _ROUNDS * total)
