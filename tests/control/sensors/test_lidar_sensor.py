from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.control.lidar import LidarSensor
from bestman_bt.navigation.localization.scan_to_map import cast_rays
from bestman_bt.scene.map_of_world import semantic_map


@pytest.fixture(scope="module")
def sensor(robot, kinematics) -> LidarSensor:
    return LidarSensor(robot.parts["lidar"], kinematics)


def test_points_lie_on_the_walls_seen_from_the_true_pose(sensor, truth, world):
    points = truth.base_pose().to_pose2d().apply(sensor.points())
    walls = semantic_map(world).walls
    start, along = walls[:, :2], walls[:, 2:] - walls[:, :2]
    share = np.clip(np.einsum("psd,sd->ps", points[:, None] - start, along) / np.sum(along**2, axis=1), 0, 1)
    distance = np.linalg.norm(points[:, None] - start - share[..., None] * along, axis=2).min(axis=1)
    assert np.mean(distance < 0.04) > 0.7


def test_ranges_agree_with_ray_casting_in_the_map(sensor, truth, world):
    scan = sensor.scan()
    pose = truth.base_pose().to_pose2d() @ sensor.base_from_lidar
    expected, _ = cast_rays(semantic_map(world).walls, pose, scan.angles)
    both = np.isfinite(scan.ranges) & np.isfinite(expected)
    assert np.median(np.abs(scan.ranges[both] - expected[both])) < 0.015
