"""Calibrating a camera with a checkerboard, and where it stood: through OpenCV, whose calibration is used here only.

    pixel = project(K, distortion, [R t] X)                 X a corner on the board, [R t] the board in one photograph
    min over K, distortion and every [R t] of  sum |pixel - corner|^2                                   (Zhang 2000)

A corner is where four squares meet; those along the outside of the board, where squares end, do not count. They stand
row by row from the top left, and the board's frame has its origin in the middle of them: x right along a row, y up
against the rows, z towards the camera that sees the board.

    rows + columns odd     the board tells up from down: its top left corner square is black, and the one opposite white
    rows + columns even    it looks the same upside down: taken as it stands most nearly upright in the photograph

Pixel coordinates are gonio's, (x, y) = (column + 1/2, row + 1/2) at a pixel's centre. OpenCV counts centres from 0;
its corners are ours less 1/2, and its calibration, given ours, finds our principal point. Not here: boards of circles
or markers, boards that the photograph cuts off, fisheye lenses, several cameras.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence

import numpy as np
from scipy import ndimage

from ..arrays import Array, require_finite, to_numpy
from ..cameras import Pinhole
from ..errors import ArrayError, ParameterError

_SIDE = 1600  # pixels: larger photographs are shrunk for the search
_STEPS, _TINY = 200, 1e-12  # of OpenCV's Levenberg-Marquardt
_TERMS = (0, 1, 2, 4, 5)
# Standard deviation of a focal length, relative, beyond which the photographs do not tell it.
_UNKNOWN = 0.1


@dataclasses.dataclass(frozen=True)
class Board:
    """A checkerboard of `corners` = (rows, columns) inner corners, both >= 3; `square` is the side of a square > 0.

    A board of 10 x 7 squares has (6, 9) inner corners. square is in any unit, which is then that of all places.
    Raises `ParameterError` for others.
    """

    corners: tuple[int, int]
    square: float = 1.0

    def __post_init__(self) -> None:
        corners = tuple(self.corners)
        if len(corners) != 2 or any(int(n) != n or n < 3 for n in corners):
            raise ParameterError(
                f"Board: corners = {self.corners!r}; (rows, columns) of inner corners, >= 3, is wanted."
            )
        if not 0 < self.square < math.inf:
            raise ParameterError(f"Board: square = {self.square:g} is not a positive number.")
        object.__setattr__(self, "corners", (int(corners[0]), int(corners[1])))

    def points(self) -> np.ndarray:
        """The corners (rows * columns, 3) in the board's frame, row by row from the top left; z = 0."""
        rows, columns = self.corners
        x, y = np.meshgrid(np.arange(columns) - (columns - 1) / 2, (rows - 1) / 2 - np.arange(rows))
        return self.square * np.stack((x, y, np.zeros_like(x)), axis=-1).reshape(-1, 3)


@dataclasses.dataclass(frozen=True, eq=False)
class CameraCalibration:
    """What `calibrate_camera` answers.

    camera: the lens, standing at the origin. poses: (N, 4, 4), of the camera in the board's frame for each photograph,
    as `Pinhole` takes them. residual: (N,), rms distance in pixels between corners and their projections. error: (4,),
    standard deviations of fx, fy, cx, cy in pixels, as the residual tells them.
    """

    camera: Pinhole
    poses: np.ndarray
    residual: np.ndarray
    error: np.ndarray


def find_corners(image: Array, board: Board) -> np.ndarray:
    """The board's inner corners in a photograph, (rows * columns, 2), pixel coordinates (x, y) as `Board.points` stand.

    image: (rows, columns) or (rows, columns, C), radiance in any unit. Duda and Frese's detector finds the board, in an
    image brought to 8 bits; its corners are then placed in the radiance itself, where all gradients around point past
    them (Förstner and Gülch 1987): to some hundredths of a pixel where the board is sharp, in uneven light too.

    Raises `ArrayError` where no such board is seen whole.
    """
    import cv2

    gray = _gray(image)
    rows, columns = board.corners
    # A large photograph is searched small, and measured whole.
    block = max(1, math.ceil(max(gray.shape) / _SIDE))
    for codes in _codes(_shrunk(gray, block)):
        seen, found = cv2.findChessboardCornersSB(codes, (columns, rows), flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
        if seen and found is not None and len(found) == rows * columns:
            break
    else:
        raise ArrayError(
            f"image shows no checkerboard of {columns} x {rows} inner corners (where four squares meet). Count them "
            "again, columns x rows; the board must be seen whole with its white rim, sharp and evenly lit."
        )
    corners = found.reshape(rows, columns, 2) * float(block) + (block - 1) / 2
    steps = np.concatenate([np.linalg.norm(np.diff(corners, axis=k), axis=-1).ravel() for k in (0, 1)])
    window = int(np.clip(0.35 * steps.min(), 3, 11))  # of a corner, none of its neighbours
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-4)
    # Light that falls off across the board would draw corners towards it: each place against its own surroundings.
    # Differences of neighbours alias at a sharp edge: smoothed by a pixel, they place corners half again as well.
    margin, places = 2 * float(steps.max()), corners.reshape(-1, 2)
    left, top = (max(0, math.floor(c - margin)) for c in places.min(axis=0))
    right, bottom = (math.ceil(c + margin) + 1 for c in places.max(axis=0))
    near = _even(_scaled(gray[top:bottom, left:right]), 0.75 * margin)
    smooth = ndimage.gaussian_filter(near, 1.0, mode="nearest")
    first = np.ascontiguousarray((places - (left, top)).reshape(-1, 1, 2), dtype=np.float32)
    refined = cv2.cornerSubPix(smooth, first, (window, window), (-1, -1), criteria).reshape(rows, columns, 2)
    return _ordered(refined + np.array([left, top], np.float64), gray).reshape(-1, 2) + 0.5


def calibrate_camera(
    corners: Sequence[Array], board: Board, size: tuple[int, int], terms: int = 5
) -> CameraCalibration:
    """The camera that took photographs of `size` = (rows, columns) with `corners` (N, rows * columns, 2) of the board.

    Three or more photographs of the board, tilted by 30 degrees and more to different sides and filling the image by
    turns, all with the lens at one focus and zoom. terms: of the distortion, in OpenCV's order k1, k2, p1, p2, k3, as
    many as 0, 1, 2, 4 or 5; the others are 0. Few photographs tell few of them.

    Raises `ArrayError` where shapes are wrong or the photographs do not tell the focal length, `ParameterError` for
    other terms or where the distortion found folds the image over.
    """
    import cv2

    places = [_places(c, board, f"corners[{k}]") for k, c in enumerate(corners)]
    if len(places) < 3:
        raise ArrayError(f"corners of {len(places)} photographs; three or more, tilted to different sides, are wanted.")
    if terms not in _TERMS:
        raise ParameterError(f"terms = {terms}; 0, 1, 2, 4 or 5 terms of k1, k2, p1, p2, k3 are wanted.")
    rows, columns = Pinhole(size=size, fx=1, fy=1, cx=0, cy=0).size  # refused as a camera's would be
    flags = 0 if terms >= 4 else cv2.CALIB_ZERO_TANGENT_DIST
    for least, flag in ((1, cv2.CALIB_FIX_K1), (2, cv2.CALIB_FIX_K2), (5, cv2.CALIB_FIX_K3)):
        flags |= flag if terms < least else 0
    X = np.ascontiguousarray(board.points(), dtype=np.float32)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, _STEPS, _TINY)
    try:
        _, K, distortion, turns, shifts, deviations, *_ = cv2.calibrateCameraExtended(
            [X] * len(places), [p.astype(np.float32) for p in places], (columns, rows), None, None,
            flags=flags, criteria=criteria,
        )  # fmt: skip
    except cv2.error as refusal:
        raise ArrayError(f"the photographs tell no camera: {refusal.err}. Are their corners of one board?") from refusal
    fx, fy, cx, cy = (float(k) for k in (K[0, 0], K[1, 1], K[0, 2], K[1, 2]))
    error = np.asarray(deviations, dtype=np.float64).reshape(-1)[:4]
    if not (np.isfinite(K).all() and min(fx, fy) > 0 and (error[:2] < _UNKNOWN * np.array([fx, fy])).all()):
        raise ArrayError(
            f"the photographs do not tell the focal length: fx = {fx:.4g} +- {error[0]:.2g}, fy = {fy:.4g} +- "
            f"{error[1]:.2g} pixels. Tilt the board by 30 degrees and more, to different sides."
        )
    k1, k2, p1, p2, k3 = (float(k) for k in np.asarray(distortion).reshape(-1)[:5])
    try:
        camera = Pinhole(fx=fx, fy=fy, cx=cx, cy=cy, distortion=(k1, k2, p1, p2, k3), size=(rows, columns))
    except ParameterError as folded:
        raise ParameterError(f"{folded} Or photograph the board out to the corners of the image, too.") from folded
    poses = np.stack([_pose(turn, shift) for turn, shift in zip(turns, shifts, strict=True)])
    residual = np.array([_miss(camera, pose, board, p) for pose, p in zip(poses, places, strict=True)])
    if not np.isfinite(residual).all():
        k = int(np.argmin(np.isfinite(residual)))
        raise ArrayError(f"corners[{k}] are those of a board seen from behind: are they in the order of Board.points?")
    return CameraCalibration(camera, poses, residual, error)


def pose_of_board(corners: Array, board: Board, camera: Pinhole) -> np.ndarray:
    """The pose (4, 4) of `camera` in the board's frame, of one photograph's `corners` (rows * columns, 2).

    A plane seen from afar has two poses that look nearly alike (Collins and Bartoli 2014): the one that fits better is
    taken, after both are refined. Which way is up is told by the order of the corners, as `find_corners` gives it.

    Raises `ArrayError` where the shape is wrong or no pose puts the board before the camera.
    """
    import cv2

    if not isinstance(camera, Pinhole):
        raise ParameterError(f"camera is {type(camera).__name__}; a Pinhole is wanted, as calibrate_camera finds it.")
    places = _places(corners, board, "corners")
    K = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    distortion = np.array(camera.distortion)
    X = board.points()
    try:
        _, turns, shifts, _ = cv2.solvePnPGeneric(X, places, K, distortion, flags=cv2.SOLVEPNP_IPPE)
        criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, _STEPS, _TINY)
        poses = [
            _pose(*cv2.solvePnPRefineLM(X, places, K, distortion, turn, shift, criteria))
            for turn, shift in zip(turns, shifts, strict=True)
        ]
    except cv2.error as error:
        raise ArrayError(f"corners have no pose: {error.err}. Are they those of this board, in this camera?") from error
    misses = [_miss(camera, pose, board, places) for pose in poses]
    if not poses or not min(misses) < math.inf:
        raise ArrayError("corners have no pose before the camera. Are they those of this board, in this camera?")
    return poses[int(np.argmin(misses))]


def _pose(turn: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """The camera's pose (4, 4) in the board's frame, of OpenCV's rotation and translation of the board."""
    import cv2

    R = cv2.Rodrigues(np.asarray(turn, dtype=np.float64))[0]
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = R.T, -R.T @ np.asarray(shift, dtype=np.float64).reshape(3)
    return pose


def _miss(camera: Pinhole, pose: np.ndarray, board: Board, places: np.ndarray) -> float:
    """rms distance in pixels of the board's projections from `places`; infinite where it is not seen from its front."""
    if not (np.isfinite(pose).all() and pose[2, 3] > 0):
        return math.inf
    seen, _ = dataclasses.replace(camera, pose=pose).project(board.points())
    miss = float(np.mean(np.sum((seen - places) ** 2, axis=1)))
    return math.sqrt(miss) if math.isfinite(miss) else math.inf


def _places(corners: Array, board: Board, name: str) -> np.ndarray:
    places = to_numpy(corners).astype(np.float64)
    rows, columns = board.corners
    if places.shape != (rows * columns, 2):
        raise ArrayError(
            f"{name} has shape {places.shape}; a board of {rows} rows and {columns} columns has ({rows * columns}, 2)."
        )
    require_finite(places, name)
    return places


def _gray(image: Array) -> np.ndarray:
    """`image` checked, as the mean of its channels (rows, columns) float64."""
    values = to_numpy(image)
    if values.ndim not in (2, 3) or values.size == 0 or values.dtype.kind not in "fiu":
        raise ArrayError(
            f"image has shape {values.shape} and dtype {values.dtype}; expected numbers, (rows, columns) or "
            "(rows, columns, channels)."
        )
    require_finite(values, "image")
    values = values.astype(np.float64)
    return values if values.ndim == 2 else np.asarray(values.mean(axis=2))


def _scaled(gray: np.ndarray) -> np.ndarray:
    """`gray` from 0 at its darkest to 1 where but a hundredth is brighter, float32: a lamp in the image is cut off."""
    dark, bright = float(gray.min()), float(np.quantile(gray, 0.99))
    if not bright > dark:
        return np.zeros(gray.shape, np.float32)
    return np.asarray(((gray - dark) / (bright - dark)).clip(0, 1), dtype=np.float32)


def _shrunk(gray: np.ndarray, block: int) -> np.ndarray:
    """Means of `block` x `block` pixels; what is left over at the right and below is cut off."""
    rows, columns = (n // block for n in gray.shape)
    blocks = gray[: rows * block, : columns * block].reshape(rows, block, columns, block)
    return np.asarray(blocks.mean(axis=(1, 3)))


def _codes(gray: np.ndarray) -> Iterator[np.ndarray]:
    """`gray` in 8 bits: the whole by one curve, and if no board is seen so, each place against its surroundings."""
    scaled = _scaled(gray)
    yield np.rint(255 * np.sqrt(scaled)).astype(np.uint8)
    yield np.rint(255 * np.sqrt((_even(scaled, min(gray.shape) / 12) / 2.5).clip(0, 1))).astype(np.uint8)


def _even(scaled: np.ndarray, sigma: float) -> np.ndarray:
    """`scaled` over its mean around each place, with weights in the shape of a tent of that deviation."""
    width = max(3, round(sigma * math.sqrt(6)))
    around = ndimage.uniform_filter(ndimage.uniform_filter(scaled, width, mode="nearest"), width, mode="nearest")
    return np.asarray(scaled / np.maximum(around, 1e-3))


def _ordered(corners: np.ndarray, gray: np.ndarray) -> np.ndarray:
    """`corners` (rows, columns, 2), row 0 at the top of the board and column 0 at its left, seen from its front."""
    right, down = (np.diff(corners, axis=k).mean(axis=(0, 1)) for k in (1, 0))
    if right[0] * down[1] - right[1] * down[0] < 0:
        corners = corners[:, ::-1]
    rows, columns = corners.shape[:2]
    if (rows + columns) % 2:
        # The squares between corners are coloured by turns, and the first of them as the board's top left one.
        middles = (corners[:-1, :-1] + corners[1:, :-1] + corners[:-1, 1:] + corners[1:, 1:]) / 4
        values = ndimage.map_coordinates(gray, middles[..., ::-1].transpose(2, 0, 1), order=1, mode="nearest")
        odd = np.indices(values.shape).sum(axis=0) % 2 == 1
        return corners if values[~odd].mean() < values[odd].mean() else corners[::-1, ::-1]
    turned = [corners, corners[::-1, ::-1]]
    if rows == columns:
        turned += [np.rot90(corners, k) for k in (1, 3)]
    return max(turned, key=lambda c: float(np.diff(c, axis=1)[..., 0].mean()))
