from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Box, Cylinder, Mesh, PlacedShape, Pose, Sphere, distance_to_shape

TETRAHEDRON = Mesh(
    np.array([[0.0, 0, 0], [0.2, 0, 0], [0, 0.2, 0], [0, 0, 0.4]]),
    np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
)


@pytest.mark.parametrize(
    ("shape", "point", "distance"),
    [
        (Box((0.2, 0.4, 0.6)), (0.4, 0.0, 0.0), 0.3),
        (Box((0.2, 0.4, 0.6)), (0.4, 0.6, 0.0), 0.5),
        (Box((0.2, 0.4, 0.6)), (0.09, -0.19, 0.29), 0.0),
        (Cylinder(0.1, 0.4), (0.3, 0.4, 0.0), 0.4),
        (Cylinder(0.1, 0.4), (0.0, 0.4, 0.6), 0.5),
        (Cylinder(0.1, 0.4), (0.05, 0.05, 0.1), 0.0),
        (Sphere(0.1), (0.0, 0.0, -0.25), 0.15),
        (TETRAHEDRON, (0.1, 0.1, 0.7), 0.3),
    ],
)
def test_distances_are_those_to_the_surface_and_zero_inside(shape, point, distance):
    assert distance_to_shape(np.array([point]), PlacedShape(shape, Pose())) == pytest.approx([distance])
    moved = Pose.from_xyz_rpy((1.0, -2.0, 0.5), (0.3, -0.2, math.pi / 3))
    assert distance_to_shape(moved.apply(np.array([point])), PlacedShape(shape, moved)) == pytest.approx([distance])
