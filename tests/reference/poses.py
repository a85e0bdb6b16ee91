"""Where points are seen by the definitions of COLMAP and NeRF, and files that say so; what tests of poses share."""

import json
import struct

import numpy as np
from scipy.spatial.transform import Rotation

POINTS = np.array([[0.1, 0.2, 0.05], [-0.3, 0.1, 0.2], [0.25, -0.2, -0.1]])  # near the origin, seen by every camera
EXACT = {"rtol": 0, "atol": 1e-9}  # pixels: 1e-16 of some thousand, with the rounding of a few products
# COLMAP's lens models: number, parameters.
MODELS = {
    "SIMPLE_PINHOLE": (0, (900.5, 410.25, 305.5)),
    "PINHOLE": (1, (900.5, 880.25, 410.25, 305.5)),
    "SIMPLE_RADIAL": (2, (900.5, 410.25, 305.5, -0.08)),
    "RADIAL": (3, (900.5, 410.25, 305.5, -0.08, 0.03)),
    "OPENCV": (4, (900.5, 880.25, 410.25, 305.5, -0.08, 0.03, 0.002, -0.001)),
}
LENS = {"fl_x": 900.5, "fl_y": 880.25, "cx": 410.25, "cy": 305.5, "w": 800, "h": 600}


def world_to_camera(k):
    """A rotation (OpenCV's axes) and translation of a camera that stands 4 away and looks about to the origin."""
    rotation = Rotation.from_euler("xyz", (0.3 + 0.2 * k, -0.2 + 0.7 * k, 0.1 * k))
    return rotation, np.array([0.1 * k, -0.05, 4.0])


def by_colmap(model, parameters, rotation, translation):
    """Pixels of POINTS by COLMAP's definition of its lens models."""
    u, v, w = (POINTS @ rotation.as_matrix().T + translation).T
    u, v = u / w, v / w
    r2 = u * u + v * v
    du = dv = 0
    if model in ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"):
        f, cx, cy, *k = parameters
        fx = fy = f
        radial = sum(term * r2 ** (n + 1) for n, term in enumerate(k))
    else:
        fx, fy, cx, cy, *k = parameters
        k1, k2, p1, p2 = k or (0, 0, 0, 0)
        radial = k1 * r2 + k2 * r2 * r2
        du = 2 * p1 * u * v + p2 * (r2 + 2 * u * u)
        dv = 2 * p2 * u * v + p1 * (r2 + 2 * v * v)
    return np.stack((fx * (u + u * radial + du) + cx, fy * (v + v * radial + dv) + cy), axis=-1)


def quaternion(rotation):
    x, y, z, w = rotation.as_quat()
    return w, x, y, z


def text_model(folder):
    """One photograph for each lens model, points in every other one, and a name with a space."""
    folder.mkdir()
    cameras, images = (
        [f"# Camera list\n# Number of cameras: {len(MODELS)}\n"],
        ["# Image list\n# Number of images: 5\n"],
    )
    for k, (model, (_, parameters)) in enumerate(MODELS.items()):
        rotation, translation = world_to_camera(k)
        cameras.append(f"{10 * k + 3} {model} 800 600 {' '.join(map(repr, parameters))}\n")
        pose = " ".join(repr(float(x)) for x in (*quaternion(rotation), *translation))
        images.append(f"{k + 1} {pose} {10 * k + 3} views/{model} {k}.jpg\n")
        images.append("\n" if k % 2 else "12.5 30.25 -1 100.0 200.5 77\n")
    (folder / "cameras.txt").write_text("".join(cameras))
    (folder / "images.txt").write_text("".join(images))
    return folder


def binary_model(folder, models=tuple(MODELS)):
    """The same as `text_model`, or some of it."""
    folder.mkdir()
    cameras, images = struct.pack("<Q", len(models)), struct.pack("<Q", len(models))
    for k, model in enumerate(models):
        number, parameters = MODELS[model]
        rotation, translation = world_to_camera(k)
        cameras += struct.pack(f"<iiQQ{len(parameters)}d", 10 * k + 3, number, 800, 600, *parameters)
        images += struct.pack("<i7di", k + 1, *quaternion(rotation), *translation, 10 * k + 3)
        images += f"views/{model} {k}.jpg".encode() + b"\0"
        points = [] if k % 2 else [(12.5, 30.25, -1), (100.0, 200.5, 77)]
        images += struct.pack("<Q", len(points)) + b"".join(struct.pack("<ddq", *point) for point in points)
    (folder / "cameras.bin").write_bytes(cameras)
    (folder / "images.bin").write_bytes(images)
    return folder


def camera_to_world(k):
    """The same camera for NeRF: the inverse, with y and z of the camera turned about."""
    rotation, translation = world_to_camera(k)
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.as_matrix()
    matrix[:3, 3] = translation
    matrix = np.linalg.inv(matrix)
    matrix[:, 1:3] *= -1
    return matrix


def by_nerf(matrix, fl_x, fl_y, cx, cy, k1=0.0, k2=0.0, p1=0.0, p2=0.0, k3=0.0):
    """Pixels of POINTS by NeRF's definition: the camera looks along -z with y up, pixels count downwards."""
    x, y, z, _ = np.linalg.inv(matrix) @ np.concatenate((POINTS, np.ones((3, 1))), axis=1).T
    u, v = x / -z, -y / -z
    r2 = u * u + v * v
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    a = u * radial + 2 * p1 * u * v + p2 * (r2 + 2 * u * u)
    b = v * radial + 2 * p2 * u * v + p1 * (r2 + 2 * v * v)
    return np.stack((fl_x * a + cx, fl_y * b + cy), axis=-1)


def transforms(path, frames=None, **fields):
    """A transforms.json of two frames, or of those given."""
    if frames is None:
        frames = [{"file_path": f"./images/{k}.png", "transform_matrix": camera_to_world(k).tolist()} for k in range(2)]
    path.write_text(json.dumps({**fields, "frames": frames}))
    return path
