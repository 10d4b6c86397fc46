from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from bestman_bt.control.arm.arm_controller import ArmController
from bestman_bt.control.gripper import GripperController
from bestman_bt.control.head import HeadController
from bestman_bt.control.inertial import FusedOdometry
from bestman_bt.control.joint_state import JointStateSensor
from bestman_bt.control.lidar import LidarSensor
from bestman_bt.control.wheeled.base_controller import BaseController
from bestman_bt.control.wheeled.localisation_cycle import LocalisationCycle
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import Box, PlacedShape, Pose, Pose2D
from bestman_bt.navigation.local_planning.pure_pursuit import PurePursuit
from bestman_bt.navigation.localization.ekf import WheelOdometry
from bestman_bt.navigation.localization.scan_to_map import ScanToMap
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.sensor_parts import CameraPart
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.scene.scene import FurnitureModel, PlacedFurniture, World
from bestman_bt.world_model.semantic_map import SemanticMap
from bestman_bt.world_model.world_model import BasePose, WorldModel
from hal.api import Arm, Gripper, JointGroup, Lidar, MobileBase
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.robot import SimulatedRobot
from tests.default_engine import DefaultRobot


@dataclass
class Simulated:
    """A robot in physics with its controllers, and the truth to judge them by."""

    robot: SimulatedRobot
    truth: GroundTruth
    world: WorldModel
    base: BaseController
    arm: ArmController
    gripper: GripperController
    head: HeadController
    kinematics: ForwardKinematics
    joints: JointStateSensor

    @property
    def true_pose(self) -> Pose2D:
        return self.truth.base_pose().to_pose2d()

    def wait(self, handle, limit=60.0, each=None):
        """Let time pass until the action ends; ``each`` is called every 50 ms."""
        clock = self.robot.clock
        end = clock.now() + limit
        while not handle.done and clock.now() < end:
            clock.sleep(0.05)
            if each is not None:
                each()
        return handle

    def touched(self) -> list[str]:
        """What of the robot's body has been touched by something other than the floor."""
        return [f"{contact.first} on {contact.second}" for contact in self.robot.audit_record().contacts]


@pytest.fixture(scope="session")
def model() -> RobotModel:
    return load_robot_model("diff_panda")


@pytest.fixture
def simulate(model):
    """Builds simulated robots: ``simulate(seed)`` in the kitchen, or in another world; all end with the test."""
    robots = []

    def build(seed: int = 1, world: World | None = None, semantic: SemanticMap | None = None) -> Simulated:
        world = world or draw_world(load_scene("kitchen"), seed)
        robot = DefaultRobot(model, world, seed=seed)
        robot.connect()
        robots.append(robot)
        truth = GroundTruth(robot)
        error = np.random.default_rng(seed).uniform(-1.0, 1.0, 3) * [0.03, 0.03, 0.021]
        start = world.robot_start
        believed = Pose2D(start.x + error[0], start.y + error[1], start.theta + error[2])
        semantic = semantic or semantic_map(world)
        belief = WorldModel(semantic, base=BasePose(believed, 0.02, 0.012, 0.0))
        kinematics = ForwardKinematics(model)
        joints = JointStateSensor(robot.parts, model)
        base_part = robot.part("base", MobileBase)
        localisation = LocalisationCycle(
            robot.clock,
            LidarSensor(robot.part("lidar", Lidar), kinematics),
            ScanToMap(semantic),
            FusedOdometry(base_part, robot.clock, WheelOdometry()),
            belief,
        )
        base = BaseController(base_part, localisation, PurePursuit())
        base.start()
        robot.clock.sleep(0.5)
        return Simulated(
            robot,
            truth,
            belief,
            base,
            ArmController(robot.part("arm", Arm), robot.clock),
            GripperController(robot.part("gripper", Gripper)),
            HeadController(
                robot.part("head", JointGroup), kinematics, joints, model.of(CameraPart)["head_camera"].optical_frame
            ),
            kinematics,
            joints,
        )

    yield build
    for robot in robots:
        robot.disconnect()


@pytest.fixture
def world_with_bar(model) -> World:
    """The kitchen with a fixed bar, 30 mm thick, between the fingers of the robot where it starts."""
    world = draw_world(load_scene("kitchen"), 1)
    base_from_tool = ForwardKinematics(model).pose(model.of(ArmModel)["arm"].tool_frame, model.postures["carry"])
    place = world.robot_start.to_pose() @ base_from_tool
    part = PlacedShape(Box((0.03, 0.03, 0.06)), Pose(np.array([0.0, 0.0, place.position[2] - 0.02])))
    bar = FurnitureModel("bar", (0.03, 0.03), (part,), ((0.5, 0.5, 0.5, 1.0),), ())
    # The hand points down, so that its yaw is that of its x axis.
    axis = place.rotation[:, 0]
    pose = Pose2D(float(place.position[0]), float(place.position[1]), float(np.arctan2(axis[1], axis[0])))
    return replace(world, furniture=(*world.furniture, PlacedFurniture("bar", bar, pose, pose)))
