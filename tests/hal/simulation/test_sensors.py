"""What cameras and lidars see is what is there, up to their noise."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from bestman_bt.messages import Pose, Pose2D
from bestman_bt.robot_model.model import BaseModel
from bestman_bt.robot_model.sensor_parts import CameraPart, LidarPart
from hal.api import Camera, JointGroup, Lidar
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.guards import ReadPurpose
from tests.default_engine import DefaultRobot

TABLE_TOP = 0.75


@pytest.fixture(scope="module")
def robot(robot_model, table_worlds):
    with DefaultRobot(robot_model, table_worlds["box"], seed=2) as robot:
        yield robot


@pytest.fixture(scope="module")
def truth(robot) -> GroundTruth:
    return GroundTruth(robot)


@pytest.fixture(scope="module")
def cloud(robot, truth) -> np.ndarray:
    """Points of one image in the map frame, (N, 3), and their colours."""
    head = robot.part("head", JointGroup)
    motion = head.move_to([-0.1, 0.8])
    while not motion.done:
        robot.clock.sleep(0.05)
    camera = robot.part("head_camera", Camera)
    image = camera.capture()
    points = image.points().reshape(-1, 3)
    known = np.isfinite(points[:, 2])
    return np.column_stack(
        [truth.frame_pose(camera.optical_frame).apply(points[known]), image.rgb.reshape(-1, 3)[known]]
    )


def test_the_table_is_seen_at_its_height(cloud) -> None:
    near = cloud[(np.abs(cloud[:, 2] - TABLE_TOP) < 0.02) & (np.abs(cloud[:, 0] - 0.85) < 0.2) & (cloud[:, 1] > 0.05)]
    assert len(near) > 5000
    assert np.median(near[:, 2]) == pytest.approx(TABLE_TOP, abs=0.0015)
    assert 0.0005 < np.std(near[:, 2]) < 0.006


def test_the_object_is_seen_where_it_stands(cloud, truth) -> None:
    pose: Pose = truth.object_pose("box")
    local = pose.inverse().apply(cloud[:, :3])
    top = local[(np.abs(local[:, 2] - 0.05) < 0.003) & (np.abs(local[:, 0]) < 0.05) & (np.abs(local[:, 1]) < 0.06)]
    lower, upper = np.percentile(top[:, :2], 1, axis=0), np.percentile(top[:, :2], 99, axis=0)
    assert (lower + upper) / 2 == pytest.approx([0.0, 0.0], abs=0.003)
    assert upper - lower == pytest.approx([0.04, 0.06], abs=0.006)


def test_colours_are_those_of_the_object(cloud, truth) -> None:
    local = truth.object_pose("box").inverse().apply(cloud[:, :3])
    on_top = cloud[(np.abs(local[:, 2] - 0.05) < 0.006) & (np.abs(local[:, 0]) < 0.015) & (np.abs(local[:, 1]) < 0.02)]
    red, green, blue = np.median(on_top[:, 3:], axis=0)
    assert red > 2 * green
    assert red > 2 * blue


def test_what_is_too_near_for_its_depth_hides_what_is_behind_it(robot) -> None:
    reader = robot.simulation.reader(ReadPurpose.SENSOR)
    camera = robot.model.of(CameraPart)["head_camera"]

    def from_above(height: float) -> tuple[np.ndarray, np.ndarray]:
        map_from_optical = Pose.from_xyz_rpy((0.85, 0.2, TABLE_TOP + height), (np.pi, 0.0, 0.0))
        return reader.depth_image(map_from_optical, camera.intrinsics, 0.3, camera.far)

    far_colour, far_depth = from_above(0.31)
    near_colour, near_depth = from_above(0.29)
    assert far_depth[240, 320] == pytest.approx(0.31, abs=0.001)
    assert near_depth[240, 320] == 0.0
    assert near_colour[240, 320] == pytest.approx(far_colour[240, 320], abs=3)


def test_the_lidar_measures_the_walls(standing_robot) -> None:
    scan = standing_robot.part("lidar", Lidar).scan()
    reader = standing_robot.simulation.reader(ReadPurpose.SENSOR)
    pose = standing_robot.simulation.link_pose(reader, standing_robot.parts["lidar"].frame)
    points = pose.apply(np.column_stack([scan.points(), np.zeros(len(scan.points()))]))
    distance = np.min(np.abs(np.abs(points[:, :2]) - 2.95), axis=1)
    assert np.isfinite(scan.ranges).mean() > 0.95
    assert np.median(distance) < 0.02
    assert np.percentile(distance, 95) < 0.04


def test_the_lidar_does_not_see_its_own_robot(robot_model, empty_world) -> None:
    near_sighted = dataclasses.replace(robot_model.of(LidarPart)["lidar"], range_min=0.01, range_max=1.5)
    model = dataclasses.replace(robot_model, parts={**robot_model.parts, "lidar": near_sighted})
    with DefaultRobot(model, empty_world, seed=2) as robot:
        assert not np.isfinite(robot.part("lidar", Lidar).scan().ranges).any()


def test_a_lidar_in_a_base_sees_what_is_a_finger_away_from_the_base(robot_model, empty_world) -> None:
    front = max(x for x, _ in robot_model.of(BaseModel)["base"].footprint)
    gap = 0.02
    start = Pose2D(2.95 - front - gap, 0.0, 0.0)  # the wall's face is at 2.95 m
    exact = dataclasses.replace(robot_model.of(LidarPart)["lidar"], noise=0.0)
    model = dataclasses.replace(robot_model, parts={**robot_model.parts, "lidar": exact})
    with DefaultRobot(model, dataclasses.replace(empty_world, robot_start=start), seed=2) as robot:
        scan = robot.part("lidar", Lidar).scan()
        ahead = scan.ranges[np.abs(scan.angles) < 0.1] * np.cos(scan.angles[np.abs(scan.angles) < 0.1])
        assert ahead == pytest.approx(front + gap, abs=0.005)


@pytest.mark.slow
def test_each_image_has_noise_of_its_own(robot) -> None:
    camera = robot.part("head_camera", Camera)
    robot.clock.sleep(2.0)  # the head rests
    first = camera.capture()
    robot.clock.sleep(0.05)
    second = camera.capture()
    assert np.array_equal(first.rgb, second.rgb)
    assert not np.array_equal(first.depth, second.depth)


@pytest.mark.slow
def test_a_late_image_of_a_head_that_turns_shows_nothing_of_the_robot_in_a_wrong_place(
    robot_model, empty_world
) -> None:
    late = dataclasses.replace(robot_model.of(CameraPart)["head_camera"], latency=0.2)
    model = dataclasses.replace(robot_model, parts={**robot_model.parts, "head_camera": late})
    with DefaultRobot(model, empty_world, seed=2) as robot:
        head, camera = robot.part("head", JointGroup), robot.part("head_camera", Camera)

        def robot_in_view() -> int:
            """Pixels of what is nearer than any of the floor."""
            depth = camera.capture().depth
            return int(((depth > 0.0) & (depth < 0.9)).sum())

        head.move_to([0.0, 1.1])
        robot.clock.sleep(3.0)
        assert robot_in_view() > 500
        head.move_to([0.8, 1.1])
        robot.clock.sleep(0.6)
        assert robot_in_view() == 0
