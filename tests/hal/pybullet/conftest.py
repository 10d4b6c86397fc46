"""A scripted operator who knows the truth: for tests of the physics, not of skills."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from bestman_bt.manipulation.kinematics import DampedLeastSquares
from bestman_bt.messages import JointTrajectory, Pose
from bestman_bt.robot_model import ArmModel
from hal.api import Arm, Gripper, MobileBase, Motion, MotionStatus
from hal.pybullet import GroundTruth, PyBulletRobot

ABOVE, LIFT, GRASP_BELOW_TOP = 0.12, 0.15, 0.03


class Operator:
    """Grasps from above and moves the hand on straight vertical lines."""

    def __init__(self, robot: PyBulletRobot) -> None:
        self.robot, self.truth = robot, GroundTruth(robot)
        self.arm, self.gripper = robot.part("arm", Arm), robot.part("gripper", Gripper)
        self.base = robot.part("base", MobileBase)
        self.tool = robot.model.of(ArmModel)["arm"].tool_frame
        self._kinematics = DampedLeastSquares(robot.model, "arm")

    def finish(self, motion: Motion) -> None:
        while not motion.done:
            self.robot.clock.sleep(0.05)
        assert motion.status is MotionStatus.SUCCEEDED, motion.failure

    def reach_over(self, name: str) -> None:
        base_from_object = self.truth.base_pose().inverse() @ self.truth.object_pose(name)
        top_down = Pose.from_xyz_rpy((0, 0, 0), (0, 0, base_from_object.yaw + np.pi / 2)) @ Pose.from_xyz_rpy(
            (0, 0, 0), (np.pi, 0, 0)
        )
        above = Pose(base_from_object.position + np.array([0, 0, 0.05 - GRASP_BELOW_TOP + ABOVE]), top_down.quaternion)
        home = self.robot.model.posture("home", self.arm.joint_names)
        self.finish(self.arm.move_to(home, 0.5))
        positions = self._kinematics.solve(above, home, np.random.default_rng(0)).best
        self.finish(self.arm.move_to(positions, 0.5))

    def move_vertically(self, distance: float, duration: float = 1.5) -> None:
        start = self._kinematics.tool_pose(self.arm.positions())
        shares = np.linspace(0.0, 1.0, 21)
        path = [self.arm.positions()]
        for share in shares[1:]:
            pose = Pose(start.position + np.array([0, 0, share * distance]), start.quaternion)
            positions = self._kinematics.track(pose, path[-1])
            assert positions is not None
            path.append(positions)
        times = np.arccos(1.0 - 2.0 * shares) / np.pi * duration
        velocities = np.gradient(np.array(path), times, axis=0)
        velocities[0] = velocities[-1] = 0.0
        self.finish(self.arm.follow(JointTrajectory(self.arm.joint_names, times, np.array(path), velocities)))

    def grasp(self, name: str) -> None:
        self.reach_over(name)
        self.move_vertically(-ABOVE)
        self.finish(self.gripper.close())

    def in_hand(self, name: str) -> Pose:
        return self.truth.frame_pose(self.tool).inverse() @ self.truth.object_pose(name)


@pytest.fixture(scope="session")
def operator() -> Callable[[PyBulletRobot], Operator]:
    return Operator
