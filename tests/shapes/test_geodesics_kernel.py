"""The kernels of distances along a mesh, and of points that settle, beside their plain twins."""

import numpy as np
from numpy.testing import assert_allclose
from reference import geodesics as plain

import gonio as gn
from gonio._kernels import geodesics as kernels
from gonio.shapes.geodesics import Metric


def test_the_wave_arrives_when_its_plain_twin_says(rng):
    y, x = np.mgrid[0:6.0, 0:7.0]
    mesh = gn.HeightField(np.cos(x) + 0.5 * np.sin(2 * y) + 0.2 * rng.random(x.shape)).mesh
    metric = Metric.of(mesh, welded=False)
    straight = np.zeros(len(metric), bool)
    for source in (0, 24):
        time = np.empty(len(metric))
        rooms = np.empty((3, len(metric)), np.int64)
        kernels.march(source, metric.faces, metric.lengths, metric.start, metric.corners, straight, time, *rooms)
        # Ways that meet at a vertex, equally long to a rounding, may go on from either.
        assert_allclose(time, plain.distances(mesh.vertices, mesh.faces, source), rtol=1e-7)


def test_points_settle_where_their_plain_twins_do(rng):
    points, anchors = rng.normal(size=(9, 2)), rng.normal(size=(5, 2))
    distances = rng.random((9, 5))
    moved = points.copy()
    kernels.settle(moved, anchors, distances, 0.3, 7)
    for k in range(9):
        assert_allclose(moved[k], plain.settled(points[k], anchors, distances[k], 0.3, 7), rtol=1e-10)
