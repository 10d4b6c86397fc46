from __future__ import annotations

import math

import numpy as np

from bestman_bt.messages import Box, Cylinder, PlacedShape, Pose
from bestman_bt.perception.pose_estimation.model_surface import sample_shape
from bestman_bt.perception.view_planning import hidden_by_shapes, unobstructed


def test_of_a_box_the_faces_towards_the_eye_are_seen() -> None:
    points, normals = sample_shape(Box((0.1, 0.1, 0.1)), 0.004)
    eyes = np.array([[1.0, 0.0, 0.0], [0.7, 0.0, 0.7]])
    seen = unobstructed(points, normals, eyes, 0.008)
    np.testing.assert_array_equal(seen[0], normals[:, 0] > 0.5)
    np.testing.assert_array_equal(seen[1], (normals[:, 0] > 0.5) | (normals[:, 2] > 0.5))


def test_what_stands_behind_a_part_of_the_same_body_is_not_seen() -> None:
    front, front_normals = sample_shape(Box((0.02, 0.2, 0.2)), 0.004)
    back, back_normals = sample_shape(Box((0.02, 0.1, 0.1)), 0.004)
    points = np.concatenate([front + np.array([0.1, 0.0, 0.0]), back])
    normals = np.concatenate([front_normals, back_normals])
    seen = unobstructed(points, normals, np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]), 0.008)
    assert not seen[0, len(front) :].any()
    assert seen[1, len(front) :].any()


def test_a_shape_between_hides_and_one_beside_or_behind_does_not() -> None:
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.5, 0.0]])
    eyes = np.array([[1.0, 0.0, 0.0]])
    half_way = PlacedShape(Box((0.1, 0.2, 0.2)), Pose.from_xyz_rpy((0.5, 0.0, 0.0), (0, 0, 0.7)))
    behind = PlacedShape(Cylinder(0.1, 0.5), Pose(np.array([-0.5, 0.0, 0.0])))
    beyond_the_eye = PlacedShape(Box((0.1, 0.2, 0.2)), Pose(np.array([1.5, 0.0, 0.0])))
    np.testing.assert_array_equal(hidden_by_shapes(points, eyes, [half_way]), [[True, False]])
    assert not hidden_by_shapes(points, eyes, [behind, beyond_the_eye]).any()


def test_each_eye_has_its_own_line_of_sight() -> None:
    wall = PlacedShape(Box((0.02, 1.0, 1.0)), Pose(np.array([0.5, 0.0, 0.0])))
    angles = np.arange(8) * math.pi / 4
    eyes = np.stack([np.cos(angles), np.sin(angles), np.zeros(8)], axis=1)
    hidden = hidden_by_shapes(np.zeros((1, 3)), eyes, [wall])[:, 0]
    # At 45° the ray leaves past the wall's edge, at (0.5, 0.5).
    assert hidden[0]
    assert not hidden[2:7].any()
