"""The controllers and sensors that skills use, over the parts of a connected robot; each is made on first use."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TypeVar

from behaviours.context import Algorithms
from behaviours.parts import MissingPartError, PartKind, parts_by_kind
from bestman_bt.control.arm import ArmController
from bestman_bt.control.force_torque import WristWrench
from bestman_bt.control.gripper import GripperController
from bestman_bt.control.head import HeadController
from bestman_bt.control.inertial import FusedOdometry, GyroHeading
from bestman_bt.control.joint_state import JointStateSensor
from bestman_bt.control.lidar import LidarSensor
from bestman_bt.control.rgbd import RGBDSensor
from bestman_bt.control.tactile import TactileSensor
from bestman_bt.control.wheeled import BaseController, CollisionMonitor
from bestman_bt.manipulation.kinematics import ForwardKinematics
from bestman_bt.robot_model import RobotModel
from bestman_bt.world_model import WorldModel
from hal.api import (
    Arm,
    Bumper,
    Camera,
    ForceTorque,
    Gripper,
    Imu,
    JointGroup,
    Lidar,
    MobileBase,
    Part,
    Robot,
    Tactile,
)

PartType = TypeVar("PartType", bound=Part)


class RobotParts:
    """What a ``SkillContext`` has of a robot. ``kinds``: what the robot has, kind → names of its parts."""

    def __init__(self, robot: Robot, model: RobotModel, world: WorldModel, algorithms: Algorithms) -> None:
        self._robot, self._model, self._world, self._algorithms = robot, model, world, algorithms
        self.kinds = parts_by_kind(model, robot.parts)

    @cached_property
    def base(self) -> BaseController:
        """Drives the base and knows where it is, by its lidar."""
        base, imu = self._first("base", MobileBase), next(iter(self._all(Imu)), None)
        gyro = None
        if imu is not None:
            x, y, z = self._forward.pose(imu.frame, {}).rotation[2].tolist()
            gyro = GyroHeading(imu, self._robot.clock, (x, y, z))
        return BaseController(
            base,
            self._robot.clock,
            LidarSensor(self._first("lidar", Lidar), self._forward),
            self._algorithms.localization,
            self._algorithms.local_planning,
            self._world,
            odometry=FusedOdometry(base, self._robot.clock, self._algorithms.odometry, gyro),
            monitor=CollisionMonitor(base.description, self._all(Bumper)),
        )

    @cached_property
    def arm(self) -> ArmController:
        """Moves the first arm."""
        arm = self._first("arm", Arm)
        return ArmController(arm, self._robot.clock, kinematics=self._algorithms.kinematics, wrist=self.wrist_wrench)

    @cached_property
    def gripper(self) -> GripperController:
        """Opens and closes the first gripper."""
        return GripperController(self._first("gripper", Gripper))

    @cached_property
    def head(self) -> HeadController:
        """Turns ``camera``."""
        group, optical_frame = self._first("head", JointGroup), self._camera.optical_frame
        return HeadController(group, self._forward, self.joints, optical_frame)

    @cached_property
    def camera(self) -> RGBDSensor:
        """The first camera that no arm carries; else the one on the hand."""
        return self._sensor(self._camera)

    @cached_property
    def wrist_camera(self) -> RGBDSensor | None:
        """On the hand, where there is one."""
        return self._sensor(self._first("wrist_camera", Camera)) if "wrist_camera" in self.kinds else None

    @cached_property
    def tactile(self) -> Sequence[TactileSensor]:
        """Pads of the fingers, which may be none."""
        return [TactileSensor(part) for part in self._all(Tactile)]

    @cached_property
    def joints(self) -> JointStateSensor:
        """The encoders of all joints."""
        return JointStateSensor(self._robot.parts, self._model)

    @cached_property
    def wrist_wrench(self) -> WristWrench | None:
        """What touches the hand, where there is a sensor."""
        sensor = next(iter(self._all(ForceTorque)), None)
        return None if sensor is None else WristWrench(sensor, self._forward, self.joints, self._robot.clock)

    @cached_property
    def _forward(self) -> ForwardKinematics:
        return ForwardKinematics(self._model)

    @property
    def _camera(self) -> Camera:
        on_hand = self.kinds.get("wrist_camera", ())
        elsewhere = [part for part in self._all(Camera) if part.name not in on_hand]
        return elsewhere[0] if elsewhere else self._first("camera", Camera)

    def _sensor(self, camera: Camera) -> RGBDSensor:
        return RGBDSensor(camera, self._forward, self.joints, self._world, self._robot.clock)

    def _all(self, part_type: type[PartType]) -> list[PartType]:
        return [part for part in self._robot.parts.values() if isinstance(part, part_type)]

    def _first(self, kind: PartKind, part_type: type[PartType]) -> PartType:
        """The first part of a kind; MissingPartError names what there is instead."""
        named = [self._robot.parts[name] for name in self.kinds.get(kind, ())]
        found = next((part for part in named if isinstance(part, part_type)), None)
        if found is None:
            raise MissingPartError(
                f"robot {self._model.name} has no {kind}; it has {', '.join(self.kinds) or 'nothing'}"
            )
        return found
