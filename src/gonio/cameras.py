"""Cameras: which ray each pixel looks along, and where a point is seen.

    camera axes        x right, y down, z forward, as OpenCV has them; `pose` takes camera coordinates to the world
    pixel coordinates  (x, y) = (column + 1/2, row + 1/2) at a pixel's centre; the image is [0, columns] x [0, rows]
    pinhole            x = fx a + cx, y = fy b + cy;   (a, b) = distort(X / Z, Y / Z)
    distort            a = p g + 2 p1 p q + p2 (r^2 + 2 p^2),   b = q g + p1 (r^2 + 2 q^2) + 2 p2 p q,
                       g = 1 + k1 r^2 + k2 r^4 + k3 r^6,   r^2 = p^2 + q^2        (Brown 1966, as OpenCV writes it)

The world is z up. OpenCV itself counts pixel centres from 0: a principal point that its calibration found is ours less
1/2. COLMAP's and NeRF's count as ours. Not here: fisheye lenses, rolling shutters, and calibration.
"""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from .arrays import Array, frozen, require_finite, to_numpy
from .directions import normalise
from .errors import ArrayError, ParameterError
from .frames import require_rotation

NEWTON_STEPS = 60


def look_at(eye: Array, target: Array, up: Array = (0.0, 0.0, 1.0)) -> np.ndarray:
    """The pose (4, 4), camera to world, of a camera at `eye` (3,) that looks to `target` (3,), `up` (3,) upwards.

    Raises `ParameterError` where `up` lies along the line of sight, `DirectionError` where eye and target coincide.
    """
    eye, target, up = (np.asarray(v, dtype=np.float64) for v in (eye, target, up))
    for name, v in (("eye", eye), ("target", target), ("up", up)):
        if v.shape != (3,):
            raise ArrayError(f"{name} has shape {v.shape}; a point or direction here is (3,).")
        require_finite(v, name)
    forward = normalise(target - eye, "target - eye")
    right = np.cross(forward, normalise(up, "up"))
    if np.linalg.norm(right) < 1e-6:
        raise ParameterError(f"up = {up.tolist()} lies along the line of sight; give an up that leans away from it.")
    right = normalise(right)
    pose = np.eye(4)
    pose[:3] = np.stack((right, np.cross(forward, right), forward, eye), axis=1)
    return pose


def from_opengl(matrix: Array) -> np.ndarray:
    """Our pose from OpenGL's camera-to-world matrix (4, 4) or (3, 4): x right, y up, z back (NeRF, glTF)."""
    return _pose(matrix, "matrix") @ np.diag([1.0, -1.0, -1.0, 1.0])


def to_opengl(pose: Array) -> np.ndarray:
    """OpenGL's camera-to-world matrix (4, 4) of our `pose`: the inverse of `from_opengl`."""
    return from_opengl(pose)  # turning y and z about is its own inverse


def from_colmap(quaternion: Array, translation: Array) -> np.ndarray:
    """Our pose from COLMAP's world-to-camera `quaternion` (w, x, y, z) and `translation` (3,) (images.txt)."""
    q = np.asarray(quaternion, dtype=np.float64)
    t = np.asarray(translation, dtype=np.float64)
    if q.shape != (4,) or t.shape != (3,):
        raise ArrayError(f"COLMAP's quaternion is (4,) and its translation (3,), got {q.shape} and {t.shape}.")
    require_finite(q, "quaternion")
    require_finite(t, "translation")
    if abs(np.linalg.norm(q) - 1) > 1e-3:
        raise ParameterError(f"quaternion has length {np.linalg.norm(q):.6g}; a rotation's is 1.")
    w, x, y, z = q / np.linalg.norm(q)
    to_camera = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    pose = np.eye(4)
    pose[:3, :3] = to_camera.T
    pose[:3, 3] = -to_camera.T @ t
    return pose


def to_colmap(pose: Array) -> tuple[np.ndarray, np.ndarray]:
    """COLMAP's world-to-camera quaternion (w, x, y, z), w >= 0, and translation (3,) of our `pose`."""
    from scipy.spatial.transform import Rotation

    pose = _pose(pose, "pose")
    to_camera = pose[:3, :3].T
    x, y, z, w = Rotation.from_matrix(to_camera).as_quat(canonical=True)
    return np.array([w, x, y, z]), -to_camera @ pose[:3, 3]


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Camera(ABC):
    """An image of `size` = (rows, columns) pixels, taken from `pose` (4, 4): camera to world, axes as above."""

    size: tuple[int, int]
    pose: Array = dataclasses.field(default_factory=lambda: np.eye(4))

    def __post_init__(self) -> None:
        size = tuple(self.size)
        if len(size) != 2 or any(int(n) != n or n < 1 for n in size):
            raise ParameterError(f"{type(self).__name__}: size = {self.size!r} is not (rows, columns), both >= 1.")
        object.__setattr__(self, "size", (int(size[0]), int(size[1])))
        object.__setattr__(self, "pose", frozen(_pose(self.pose, f"{type(self).__name__}: pose")))

    @property
    def position(self) -> np.ndarray:
        """Where the camera stands in the world (3,); of an orthographic one, the middle of its image."""
        return np.asarray(self.pose[:3, 3])

    @property
    def forward(self) -> np.ndarray:
        """The direction (3,) in which the camera looks."""
        return np.asarray(self.pose[:3, 2])

    def pixels(self) -> np.ndarray:
        """The centres (rows, columns, 2) of all pixels, (x, y) = (column + 1/2, row + 1/2)."""
        rows, columns = self.size
        x, y = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5)
        return np.stack((x, y), axis=-1)

    @abstractmethod
    def rays(self, pixels: Array | None = None) -> tuple[np.ndarray, np.ndarray]:
        """(origins, directions) in the world, each (..., 3), unit directions away from the camera.

        `pixels` (..., 2) are pixel coordinates (x, y); all pixel centres (rows, columns, 2) where none are given.
        """

    @abstractmethod
    def project(self, points: Array) -> tuple[np.ndarray, np.ndarray]:
        """(pixels (..., 2), depth (...)) of world `points` (..., 3); depth is the distance along `forward`.

        Pixels may lie outside the image. They are NaN where the camera cannot see in that direction at all.
        """

    @abstractmethod
    def towards(self, points: Array) -> np.ndarray:
        """The vectors (..., 3) from world `points` (..., 3) to the eye; to its plane, where rays are parallel."""

    def _in_camera(self, points: Array) -> np.ndarray:
        points = to_numpy(points).astype(np.float64, copy=False)
        if points.ndim == 0 or points.shape[-1] != 3:
            raise ArrayError(f"points has shape {points.shape}; points are (..., 3), components last.")
        local: np.ndarray = (points - self.position) @ self.pose[:3, :3]
        return local

    def _centres(self, pixels: Array | None) -> np.ndarray:
        if pixels is None:
            return self.pixels()
        pixels = to_numpy(pixels).astype(np.float64, copy=False)
        if pixels.ndim == 0 or pixels.shape[-1] != 2:
            raise ArrayError(f"pixels has shape {pixels.shape}; pixel coordinates are (..., 2), x then y.")
        return pixels


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Orthographic(Camera):
    """Parallel rays; a pixel is a square of `pixel` world units, and the image's middle lies on the camera's axis."""

    pixel: float

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive(self, "pixel")

    def rays(self, pixels: Array | None = None) -> tuple[np.ndarray, np.ndarray]:
        rows, columns = self.size
        offset = (self._centres(pixels) - (columns / 2, rows / 2)) * self.pixel
        origins = self.position + offset @ self.pose[:3, :2].T
        return origins, np.broadcast_to(self.forward, origins.shape)

    def project(self, points: Array) -> tuple[np.ndarray, np.ndarray]:
        local = self._in_camera(points)
        rows, columns = self.size
        return local[..., :2] / self.pixel + (columns / 2, rows / 2), local[..., 2]

    def towards(self, points: Array) -> np.ndarray:
        return np.asarray(-self._in_camera(points)[..., 2:] * self.forward)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Pinhole(Camera):
    """Rays through one point. `fx, fy, cx, cy` in pixels; `distortion` = (k1, k2, p1, p2, k3), OpenCV's order.

    Raises `ParameterError` where the distortion folds the image over: some pixel then sees two directions, or none.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive(self, "fx")
        _require_positive(self, "fy")
        terms = tuple(float(k) for k in self.distortion)
        if len(terms) != 5 or not all(map(math.isfinite, (*terms, self.cx, self.cy))):
            raise ParameterError(
                f"Pinhole: distortion = {self.distortion!r}, cx = {self.cx}, cy = {self.cy}: "
                "five finite terms k1, k2, p1, p2, k3 and a finite principal point are asked for."
            )
        object.__setattr__(self, "distortion", terms)
        if any(terms):
            rows, columns = self.size
            x, y = np.linspace(0, columns, 65), np.linspace(0, rows, 65)
            edges = [np.stack(np.broadcast_arrays(a, b), axis=-1) for a, b in ((x, 0), (x, rows), (0, y), (columns, y))]
            self.rays(np.concatenate(edges))  # the lens folds first where it looks farthest out: refused here

    @classmethod
    def look_at(
        cls, eye: Array, target: Array, field_of_view: float, size: tuple[int, int], up: Array = (0.0, 0.0, 1.0)
    ) -> Pinhole:
        """A camera at `eye` (3,) that looks to `target` (3,), with square pixels and a centred principal point.

        `field_of_view` is vertical, in degrees, in (0, 180); `size` is (rows, columns).
        """
        if not 0 < field_of_view < 180:
            raise ParameterError(f"field_of_view = {field_of_view} lies outside (0, 180) degrees.")
        rows, columns = size
        focal = rows / (2 * math.tan(math.radians(field_of_view) / 2))
        pose = look_at(eye, target, up)
        return cls(fx=focal, fy=focal, cx=columns / 2, cy=rows / 2, size=size, pose=pose)

    def rays(self, pixels: Array | None = None) -> tuple[np.ndarray, np.ndarray]:
        plane = (self._centres(pixels) - (self.cx, self.cy)) / (self.fx, self.fy)
        if any(self.distortion):
            plane = self._undistorted(plane)
        directions = plane @ self.pose[:3, :2].T + self.forward
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        return np.broadcast_to(self.position, directions.shape), directions

    def project(self, points: Array) -> tuple[np.ndarray, np.ndarray]:
        local = self._in_camera(points)
        depth = local[..., 2]
        ahead = depth > 0
        plane = local[..., :2] / np.where(ahead, depth, np.nan)[..., None]
        if any(self.distortion):
            # Past the fold the polynomial turns back and would show points in the image that the lens cannot see.
            seen = (np.sum(plane**2, axis=-1) < self._fold()) & (self._slope(plane)[3] > 0)
            plane = np.where(seen[..., None], self._distorted(plane), np.nan)
        return plane * (self.fx, self.fy) + (self.cx, self.cy), depth

    def towards(self, points: Array) -> np.ndarray:
        return np.asarray(-self._in_camera(points) @ self.pose[:3, :3].T)

    def _distorted(self, plane: np.ndarray) -> np.ndarray:
        k1, k2, p1, p2, k3 = self.distortion
        p, q = plane[..., 0], plane[..., 1]
        r2 = p * p + q * q
        g = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        a = p * g + 2 * p1 * p * q + p2 * (r2 + 2 * p * p)
        b = q * g + p1 * (r2 + 2 * q * q) + 2 * p2 * p * q
        return np.stack((a, b), axis=-1)

    def _slope(self, plane: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """da/dp, da/dq = db/dp, db/dq, and their determinant, which is positive up to the fold."""
        k1, k2, p1, p2, k3 = self.distortion
        p, q = plane[..., 0], plane[..., 1]
        r2 = p * p + q * q
        g = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        dg = 2 * k1 + r2 * (4 * k2 + r2 * 6 * k3)  # (1/r) dg/dr
        pp = g + p * p * dg + 2 * p1 * q + 6 * p2 * p
        pq = p * q * dg + 2 * p1 * p + 2 * p2 * q
        qq = g + q * q * dg + 6 * p1 * q + 2 * p2 * p
        return pp, pq, qq, pp * qq - pq * pq

    def _fold(self) -> float:
        """r^2 where the radial part first turns back: the least positive root of d(r g)/dr = 0."""
        k1, k2, _, _, k3 = self.distortion
        roots = np.roots([7 * k3, 5 * k2, 3 * k1, 1])
        real = roots[(np.abs(roots.imag) < 1e-9 * (1 + np.abs(roots.real))) & (roots.real > 0)].real
        return float(real.min()) if real.size else math.inf

    def _undistorted(self, plane: np.ndarray) -> np.ndarray:
        """The (p, q) whose distortion is `plane` (..., 2), by Newton steps that are halved until they come nearer."""
        flat = plane.reshape(-1, 2)
        out = np.empty_like(flat)
        fold = self._fold()
        # Blocks keep the temporaries of a photograph of many megapixels in the cache.
        for start in range(0, len(flat), 1 << 16):
            goal = flat[start : start + (1 << 16)]
            at = goal * min(1.0, math.sqrt(0.5 * fold) / max(float(np.abs(goal).max()), 1e-12))
            miss = self._distorted(at) - goal
            for _ in range(NEWTON_STEPS):
                pp, pq, qq, det = self._slope(at)
                step = np.stack((qq * miss[:, 0] - pq * miss[:, 1], pp * miss[:, 1] - pq * miss[:, 0]), axis=-1)
                step /= np.where(np.abs(det) > 1e-12, det, 1e-12)[:, None]
                scale = np.ones((len(at), 1))
                for _ in range(12):
                    trial = at - scale * step
                    left = self._distorted(trial) - goal
                    worse = (left * left).sum(axis=-1) > (miss * miss).sum(axis=-1)
                    if not worse.any():
                        break
                    scale[worse] /= 2
                at, miss = np.where(worse[:, None], at, trial), np.where(worse[:, None], miss, left)
                if np.abs(miss).max() < 1e-12:
                    break
            reached = (np.abs(miss).max(axis=-1) < 1e-9) & ((at * at).sum(axis=-1) < fold) & (self._slope(at)[3] > 0)
            if not reached.all():
                x, y = goal[~reached][0] * (self.fx, self.fy) + (self.cx, self.cy)
                raise ParameterError(
                    f"Pinhole: distortion = {self.distortion} folds over before pixel ({x:.1f}, {y:.1f}), "
                    "which no direction reaches. Calibrate with fewer terms, or crop the image."
                )
            out[start : start + (1 << 16)] = at
        return out.reshape(plane.shape)


def _pose(matrix: Array, name: str) -> np.ndarray:
    """`matrix` (4, 4) or (3, 4) checked to be a rotation and a place: (4, 4) float64."""
    given = np.asarray(to_numpy(matrix), dtype=np.float64)
    if given.shape not in ((3, 4), (4, 4)):
        raise ArrayError(f"{name} has shape {given.shape}; a pose is (4, 4), or (3, 4) without its last row.")
    if given.shape == (4, 4) and not np.allclose(given[3], (0, 0, 0, 1)):
        raise ParameterError(f"{name} has the last row {given[3].tolist()}; a pose has (0, 0, 0, 1). Is it transposed?")
    require_finite(given, name)
    require_rotation(given[:3, :3], name)
    pose = np.eye(4)
    pose[:3] = given[:3]
    return pose


def _require_positive(camera: Any, name: str) -> None:
    value = float(getattr(camera, name))
    if not (math.isfinite(value) and value > 0):
        raise ParameterError(f"{type(camera).__name__}: {name} = {value:g} is not a positive number.")
    object.__setattr__(camera, name, value)
