"""The robot, the small worlds and the operator who knows the truth that the tests of the hardware layer share."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.messages import Box, Cylinder, JointTrajectory, ObjectModel, PlacedShape, Pose, Pose2D
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.scene.scene import FurnitureModel, PlacedFurniture, PlacedObject, Surface, Wall, World
from hal.api import Arm, Gripper, MobileBase, Motion, MotionStatus
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.robot import SimulatedRobot
from tests.default_engine import DefaultRobot

TABLE_TOP = 0.75
ABOVE, LIFT, GRASP_BELOW_TOP = 0.12, 0.15, 0.03
SHAPES = {"box": Box((0.04, 0.06, 0.10)), "can": Cylinder(0.033, 0.10)}


@pytest.fixture(scope="session")
def robot_model() -> RobotModel:
    return load_robot_model("diff_panda")


@pytest.fixture(scope="session")
def empty_world() -> World:
    """Four walls, 3 m away from the robot."""
    corners = ((-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0))
    walls = tuple(Wall(a, b, 1.2, 0.1) for a, b in zip(corners, corners[1:] + corners[:1], strict=True))
    return World("empty", 0, walls, (), (), Pose2D(0.0, 0.0, 0.0), {})


@pytest.fixture(scope="session")
def table_worlds(empty_world: World) -> dict[str, World]:
    """A table in front of the robot with one object on it, by the name of the object."""
    top = PlacedShape(Box((0.8, 1.2, 0.03)), Pose.from_xyz_rpy((0.0, 0.0, TABLE_TOP - 0.015)))
    surface = Surface("top", Pose.from_xyz_rpy((0.0, 0.0, TABLE_TOP)), (0.8, 1.2))
    model = FurnitureModel("table", (0.8, 1.2), (top,), ((0.6, 0.4, 0.25, 1.0),), (surface,))
    table = PlacedFurniture("table", model, Pose2D(0.85, 0.0, 0.0), Pose2D(0.86, 0.01, 0.01))
    worlds = {}
    for name, shape in SHAPES.items():
        solid = ObjectModel(name, (0.8, 0.2, 0.2), 0.2, 0.8, (PlacedShape(shape, Pose()),))
        placed = PlacedObject(name, solid, Pose.from_xyz_rpy((0.65, -0.1, TABLE_TOP + 0.051), (0.0, 0.0, 0.3)))
        worlds[name] = World("table", 0, empty_world.walls, (table,), (placed,), Pose2D(0.0, 0.0, 0.0), {})
    return worlds


@pytest.fixture(scope="session")
def standing_robot(robot_model: RobotModel, empty_world: World) -> Iterator[SimulatedRobot]:
    """A connected robot in the empty world, shared by tests that leave it standing still."""
    with DefaultRobot(robot_model, empty_world, seed=1) as robot:
        yield robot


class Operator:
    """Grasps from above and moves the hand on straight vertical lines."""

    def __init__(self, robot: SimulatedRobot) -> None:
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
def operator() -> Callable[[SimulatedRobot], Operator]:
    return Operator
