"""Facts about where pixels lie: heights whose slopes are those of the normals, seen from wherever."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import gonio as gn
from gonio.capture.photographs import Held
from gonio.capture.surface import surface_positions


def bump():
    y, x = np.mgrid[1:-1:41j, -1:1:41j]
    return gn.HeightField(4 * np.exp(-2 * (x * x + y * y)), 0.5)


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.7, -0.2, 1.1)])
def test_normals_alone_tell_where_pixels_lie_but_for_a_height(turn):
    relief, R = bump(), Rotation.from_rotvec(turn).as_matrix()
    above = relief.camera()
    pose = above.pose.copy()
    pose[:3] = R @ above.pose[:3]
    camera = dataclasses.replace(above, pose=pose)
    photographs = Held(np.ones((1, *relief.heights.shape, 3), np.float32))
    # Exact slopes; central differences have them to some hundredths of a texel.
    capture = gn.Capture(photographs, normals=relief.normals @ R.T, camera=camera)
    found = surface_positions(capture)
    off = found @ R - above.rays()[0] @ np.diag((1.0, 1, 0)) - relief.heights[..., None] * np.array((0.0, 0, 1))
    towards = R.T @ camera.forward
    np.testing.assert_allclose(np.cross(off - off[0, 0], towards), 0, atol=1e-9)
    assert np.std(off @ towards) < 0.02 * np.ptp(relief.heights)


def test_a_shape_is_believed_and_pixels_that_face_away_follow_their_neighbours():
    relief = bump()
    photographs = Held(np.ones((1, *relief.heights.shape, 3), np.float32))
    known = gn.Capture(photographs, shape=relief, camera=relief.camera())
    np.testing.assert_array_equal(surface_positions(known), known.positions)
    normals = relief.normals.copy()
    normals[20, 20] = (0, 0.6, -0.8)
    one_off = surface_positions(gn.Capture(photographs, normals=normals, camera=relief.camera()))
    assert one_off[20, 20, 2] in (one_off[19, 20, 2], one_off[21, 20, 2], one_off[20, 19, 2], one_off[20, 21, 2])


def test_what_tells_no_surface_is_refused():
    photographs = Held(np.ones((1, 4, 4, 3), np.float32))
    with pytest.raises(gn.GonioError, match="neither shape nor normals"):
        surface_positions(gn.Capture(photographs))
    up = np.broadcast_to((0.0, 0, 1), (4, 4, 3))
    with pytest.raises(gn.GonioError, match="no normal on the mask faces"):
        surface_positions(gn.Capture(photographs, normals=-up))
    near = gn.Pinhole.look_at((0, 0.1, 5), (0, 0, 0), 40, (4, 4))
    with pytest.raises(gn.GonioError, match="rectify"):
        surface_positions(gn.Capture(photographs, normals=up, camera=near))
