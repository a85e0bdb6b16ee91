"""Plain twin of `_kernels/lobe_sums.py`."""

import numpy as np


def add(image, directions, lobe, angle):
    """Means of image (rows, 2 rows, C) about directions (N, 3), weighed by sin theta and lobe(angle to them)."""
    rows, columns, channels = image.shape
    theta, phi = (np.arange(rows) + 0.5) * np.pi / rows, (np.arange(columns) + 0.5) * 2 * np.pi / columns
    sine = np.sin(theta)[:, None]
    w = np.stack((sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)[:, None] + 0 * phi), axis=-1).reshape(-1, 3)
    out = []
    for R in directions:
        far = np.arctan2(np.linalg.norm(np.cross(w, R), axis=-1), w @ R)
        weight = np.where(far <= angle, lobe(far), 0) * np.repeat(sine[:, 0], columns)
        nearest = np.eye(len(far))[np.argmin(far)]
        weight = weight if weight.sum() > 0 else nearest
        out.append(weight @ image.reshape(-1, channels) / weight.sum())
    return np.array(out)
