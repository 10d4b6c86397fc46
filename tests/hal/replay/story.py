"""A short program: the base turns and drives, the arm and the gripper move, the camera and the lidar look."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from bestman_bt.messages import LaserScan, Pose2D, RGBDImage
from hal.api import Arm, Camera, CommandRefusedError, Gripper, Lidar, MobileBase, Motion, MotionStatus, Robot


@dataclass
class Story:
    """What somebody saw who told a robot to do these things."""

    odometry: list[Pose2D]
    scans: list[LaserScan]
    images: list[RGBDImage]
    positions: list[np.ndarray]
    endings: list[tuple[float, MotionStatus]]


def act(robot: Robot) -> Story:
    """Always the same program."""
    base, arm = robot.part("base", MobileBase), robot.part("arm", Arm)
    gripper, camera, lidar = (
        robot.part("gripper", Gripper),
        robot.part("head_camera", Camera),
        robot.part("lidar", Lidar),
    )
    story = Story([], [], [], [], [])

    def wait(motion: Motion) -> None:
        start = robot.clock.now()
        while not motion.done:
            robot.clock.sleep(0.05)
            story.odometry.append(base.odometry())
            story.positions.append(arm.positions())
        story.endings.append((robot.clock.now() - start, motion.status))

    story.images.append(camera.capture())
    wait(base.rotate(0.3))
    story.scans.append(lidar.scan())
    with pytest.raises(CommandRefusedError, match="distance") as refused:
        base.move_forward(-1.0)
    assert refused.value.failure.part == "base"
    wait(base.move_backward(0.2))
    story.scans.append(lidar.scan())
    wait(arm.move_to(target(arm)))
    wait(gripper.move(0.02))
    base.set_velocity(0.2, 0.0, 0.0)
    robot.clock.sleep(0.5)
    story.images.append(camera.capture())
    return story


def target(arm: Arm) -> np.ndarray:
    middle = (arm.model.lower + arm.model.upper) / 2
    return np.asarray(arm.positions() + np.clip(middle - arm.positions(), -0.3, 0.3))
