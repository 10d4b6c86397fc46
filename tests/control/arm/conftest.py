"""A robot that stands before one piece of furniture, its open hand in front of the handle."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import pytest

from bestman_bt.control.arm.arm_controller import ArmController
from bestman_bt.control.gripper import GripperController
from bestman_bt.control.joint_state import JointStateSensor
from bestman_bt.control.touch import WristWrench
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import Handle, Pose, Pose2D
from bestman_bt.scene.furniture_file import read_furniture
from bestman_bt.scene.scene import PlacedFurniture, World
from hal.api import Arm, ForceTorque, Gripper
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.robot import SimulatedRobot
from tests.default_engine import DefaultRobot

BEFORE = 0.06  # metres that the hand starts in front of the handle
TURN_OVER = Pose(np.zeros(3), np.array([0.0, 0.0, 1.0, 0.0]))


@dataclass
class AtHandle:
    """``handle``: the true one, in the robot's base frame."""

    robot: SimulatedRobot
    truth: GroundTruth
    arm: ArmController
    gripper: GripperController
    wrist: WristWrench
    handle: Handle
    joint: str

    @property
    def opened(self) -> float:
        return self.truth.articulation_position(self.joint)

    def wait(self, handle, limit=40.0):
        end = self.robot.clock.now() + limit
        while not handle.done and self.robot.clock.now() < end:
            self.robot.clock.sleep(0.05)
        return handle

    def grasp(self, force=40.0) -> None:
        self.robot.clock.sleep(0.3)
        self.wrist.tare()
        self.robot.clock.sleep(0.4)
        self.wait(self.arm.move_until(-self.handle.outward, 0.05, BEFORE, 15.0))
        self.wait(self.gripper.close(force))
        self.robot.clock.sleep(0.3)


@pytest.fixture
def stand_before(model):
    """``stand_before("fridge/upper_door", stand, ...)``: furniture at the origin, its front faces -x."""
    robots = []

    def build(joint, stand, elevation=0.0, friction=None, finger_friction=None, flip=False, seed=1) -> AtHandle:
        name, _, door = joint.partition("/")
        piece = read_furniture(name)
        doors = tuple(
            dataclasses.replace(a, friction=friction) if friction is not None and a.name == door else a
            for a in piece.articulations
        )
        piece = dataclasses.replace(piece, articulations=doors)
        handle = next(a for a in doors if a.name == door).handle.seen_from(Pose(np.array([0.0, 0.0, elevation])))
        handle = handle.seen_from(stand.to_pose().inverse())
        x = np.cross(handle.pose.rotation[:, 1], -handle.outward)
        matrix = np.eye(4)
        matrix[:3] = np.column_stack([x, handle.pose.rotation[:, 1], -handle.outward, handle.pose.position])
        grasp = Pose.from_matrix(matrix)
        grasp = grasp @ TURN_OVER if flip else grasp
        before = Pose(grasp.position + BEFORE * handle.outward, grasp.quaternion)
        kinematics = DampedLeastSquares(model)
        names = kinematics.joint_names
        start = kinematics.solve(before, model.posture("home", names), np.random.default_rng(0)).best
        postures = {**model.postures, "carry": {**model.postures["carry"], **dict(zip(names, start, strict=True))}}
        placed = PlacedFurniture(name, piece, Pose2D(0, 0, 0), Pose2D(0, 0, 0), elevation=elevation)
        world = World("before_furniture", seed, (), (placed,), (), stand, {})
        world = dataclasses.replace(world, finger_friction=finger_friction)
        robot = DefaultRobot(dataclasses.replace(model, postures=postures), world, seed=seed)
        robot.connect()
        robots.append(robot)
        joints = JointStateSensor(robot.parts, model)
        sensor = robot.part("wrist_force_torque", ForceTorque)
        wrist = WristWrench(sensor, ForwardKinematics(model), joints, robot.clock)
        arm = ArmController(robot.part("arm", Arm), robot.clock, kinematics=kinematics, wrist=wrist)
        gripper = GripperController(robot.part("gripper", Gripper))
        return AtHandle(robot, GroundTruth(robot), arm, gripper, wrist, handle, joint)

    yield build
    for robot in robots:
        robot.disconnect()
