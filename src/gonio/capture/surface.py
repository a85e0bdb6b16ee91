"""Where pixels lie in space: on the shape, or where only normals are known on a surface that has them.

    x = origin + (d - z texel) forward        origin of a pixel's ray, z the integral of normals (`integration.py`)

Slopes do not tell how high the whole stands, nor one part of it beside another: each connected part of the mask has
the mean depth d of where the capture's pixels meet the plane z = 0.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt

from ..cameras import Orthographic
from ..errors import ArrayError, ParameterError
from .integration import integrate_normals
from .model import Capture


def surface_positions(capture: Capture) -> np.ndarray:
    """Positions (rows, columns, 3) of the pixels, world, finite on the mask. Normals that face away from the camera
    count for nothing; their pixels are as high as the nearest others.

    Raises `ArrayError` where neither shape nor normals are known, `ParameterError` where only normals are and the
    camera is no orthographic one: slopes are then no heights.
    """
    if capture.shape is not None:
        return capture.positions
    if capture.normals is None:
        raise ArrayError("the capture has neither shape nor normals; photometric_stereo tells normals.")
    camera = capture.camera
    if not isinstance(camera, Orthographic):
        raise ParameterError(
            "normals are integrated as an orthographic camera sees them: rectify the photographs, or give the shape."
        )
    normals = capture.normals @ (camera.pose[:3, :3] * (1, -1, -1))  # x right, y up, z to the viewer
    facing = capture.mask & (normals[..., 2] > 0)
    if not facing.any():
        raise ArrayError("no normal on the mask faces the camera.")
    heights = integrate_normals(normals, facing).heights
    nearest = distance_transform_edt(~facing, return_distances=False, return_indices=True)
    origins, forward = camera.rays()[0], camera.forward
    level = np.mean((capture.positions - origins)[capture.mask] @ forward)
    return np.asarray(origins + (level - camera.pixel * heights[tuple(nearest)])[..., None] * forward)
