"""Controllers and sensors for skills, over the parts of a connected robot; each is created on first use."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from behaviours.parts import MissingPartError, PartKind, parts_by_kind
from bestman_bt.control.arm.arm_controller import ArmController
from bestman_bt.control.arm.arm_coordinator import ArmCoordinator
from bestman_bt.control.gripper import GripperController
from bestman_bt.control.head import HeadController
from bestman_bt.control.inertial import FusedOdometry, GyroHeading
from bestman_bt.control.joint_state import JointStateSensor
from bestman_bt.control.lidar import LidarSensor
from bestman_bt.control.motion import Confirm
from bestman_bt.control.rgbd import RGBDSensor
from bestman_bt.control.touch import TactileSensor, WristWrench
from bestman_bt.control.wheeled.base_controller import BaseController
from bestman_bt.control.wheeled.collision_monitor import CollisionMonitor
from bestman_bt.control.wheeled.localisation_cycle import LocalisationCycle
from bestman_bt.manipulation.kinematics.link_hulls import ArmBodies, ForwardKinematics
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.urdf_tree import arm_of
from bestman_bt.runtime.algorithms import SLOTS, Algorithms
from bestman_bt.world_model.world_model import WorldModel
from hal.api import Arm, Bumper, Camera, ForceTorque, Gripper, Imu, JointGroup, Lidar, MobileBase, Part, Robot, Tactile

PartType = TypeVar("PartType", bound=Part)

OF_AN_ARM = frozenset(("arm", "gripper", "wrist_camera", "tactile", "wrist_wrench"))
"""Attributes of a ``SkillContext`` that each arm has separately."""


class RobotParts:
    """The robot's side of a ``SkillContext``. ``kinds``: kind → names of the robot's parts.

    ``default_arm``: the arm of skills that do not name one; empty if there is none.
    """

    def __init__(
        self, robot: Robot, model: RobotModel, world: WorldModel, algorithms: Algorithms, confirm: Confirm | None = None
    ) -> None:
        self.confirm = confirm
        self.robot, self.model, self.world, self.algorithms = robot, model, world, algorithms
        self.kinds = parts_by_kind(model, robot.parts)
        self.default_arm = model.arm_named() if model.default_arm or len(model.arm_names) == 1 else ""
        self._of_arms: dict[str, _ArmParts] = {}

    def made(self, attribute: str, arm: str) -> Any:
        """Return an attribute of a ``SkillContext``, created on first use; ``arm``: for attributes that each arm
        has.
        """
        if attribute in SLOTS:
            return self.algorithms.of_arm(attribute, arm)
        if attribute not in OF_AN_ARM:
            return getattr(self, attribute)
        if arm not in self._of_arms:
            self._of_arms[arm] = _ArmParts(self, arm)
        return getattr(self._of_arms[arm], attribute)

    @cached_property
    def base(self) -> BaseController:
        """The controller that drives the base and localises it by its lidar."""
        base, imu = self.first("base", MobileBase), next(iter(self.all(Imu)), None)
        gyro = None
        if imu is not None:
            x, y, z = self.forward.pose(imu.frame, {}).rotation[2].tolist()
            gyro = GyroHeading(imu, self.robot.clock, (x, y, z))
        localisation = LocalisationCycle(
            self.robot.clock,
            LidarSensor(self.first("lidar", Lidar), self.forward),
            self.algorithms.localization,
            FusedOdometry(base, self.robot.clock, self.algorithms.odometry, gyro),
            self.world,
        )
        monitor = CollisionMonitor(base.model, self.all(Bumper))
        return BaseController(base, localisation, self.algorithms.local_planning, monitor=monitor, confirm=self.confirm)

    @cached_property
    def head(self) -> HeadController:
        """The controller that turns the head's ``camera``."""
        group, optical_frame = self.first("head", JointGroup), self._camera.optical_frame
        return HeadController(group, self.forward, self.joints, optical_frame, confirm=self.confirm)

    @cached_property
    def camera(self) -> RGBDSensor:
        """The first camera that no arm carries, else the one on the hand."""
        return self.sensor(self._camera)

    @cached_property
    def joints(self) -> JointStateSensor:
        """The sensor that reads the encoders of all joints."""
        return JointStateSensor(self.robot.parts, self.model)

    @cached_property
    def arm_coordinator(self) -> ArmCoordinator | None:
        """The coordinator that prevents collisions between several arms, or None for one arm."""
        several = len(self.model.arm_names) > 1
        return ArmCoordinator(self.model, self.joints, self.world, self.robot.clock) if several else None

    @cached_property
    def forward(self) -> ForwardKinematics:
        """Forward kinematics of the whole robot."""
        return ForwardKinematics(self.model)

    @property
    def _camera(self) -> Camera:
        on_hand = self.kinds.get("wrist_camera", ())
        elsewhere = [part for part in self.all(Camera) if part.name not in on_hand]
        return elsewhere[0] if elsewhere else self.first("camera", Camera)

    def sensor(self, camera: Camera) -> RGBDSensor:
        """Return the sensor that takes views through a camera."""
        driven = bool(self.kinds.get("base") and self.kinds.get("lidar"))
        base_at = (lambda stamp: self.base.pose_at(stamp)) if driven else None
        return RGBDSensor(camera, self.forward, self.joints, self.world, self.robot.clock, base_at)

    def all(self, part_type: type[PartType]) -> list[PartType]:
        """Return all parts of a type."""
        return [part for part in self.robot.parts.values() if isinstance(part, part_type)]

    def first(self, kind: PartKind, part_type: type[PartType], arm: str = "") -> PartType:
        """Return the first part of a kind; with several arms, that of ``arm``.

        Raises MissingPartError listing the parts that the robot has.
        """
        found = self.of_arm(kind, part_type, arm)
        if not found:
            whose = f" on arm {arm}" if len(self.model.arm_names) > 1 and arm else ""
            raise MissingPartError(
                f"robot {self.model.name} has no {kind}{whose}; it has {', '.join(self.kinds) or 'nothing'}"
            )
        return found[0]

    def of_arm(self, kind: PartKind, part_type: type[PartType], arm: str) -> list[PartType]:
        """Return the parts of a kind; with several arms, those of ``arm``, unless it is empty."""
        names = self.kinds.get(kind, ())
        if arm and len(self.model.arm_names) > 1:
            names = tuple(name for name in names if arm_of(self.model, name) == arm)
        return [part for name in names if isinstance(part := self.robot.parts[name], part_type)]


class _ArmParts:
    """The controllers of one arm and the sensors of its hand, for skills."""

    def __init__(self, parts: RobotParts, arm: str) -> None:
        self._parts, self._arm = parts, arm

    @cached_property
    def arm(self) -> ArmController:
        """Moves the arm."""
        parts = self._parts
        arm = parts.first("arm", Arm, self._arm)
        kinematics = parts.algorithms.of_arm("kinematics", self._arm)
        return ArmController(
            arm,
            parts.robot.clock,
            kinematics=kinematics,
            wrist=self.wrist_wrench,
            coordinator=parts.arm_coordinator,
            confirm=parts.confirm,
            bodies=self._bodies_at if parts.confirm is not None else None,
        )

    def _bodies_at(self, positions: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Return the corners (N, 3) of all bodies that move with the arm at ``positions``, in the map frame."""
        parts = self._parts
        joints = dict(parts.joints.positions()) | dict(
            zip(parts.model.of(ArmModel)[self._arm].joint_names, positions.tolist(), strict=True)
        )
        bodies = self._bodies.at(joints, parts.world.hands.get(self._arm))
        base = parts.world.base.pose
        return [np.column_stack([base.apply(corners[:, :2]), corners[:, 2]]) for corners in bodies]

    @cached_property
    def _bodies(self) -> ArmBodies:
        return ArmBodies(self._parts.model, self._arm)

    @cached_property
    def gripper(self) -> GripperController:
        """Opens and closes the gripper of the arm."""
        gripper = self._parts.first("gripper", Gripper, self._arm)
        return GripperController(gripper, confirm=self._parts.confirm)

    @cached_property
    def wrist_camera(self) -> RGBDSensor | None:
        """On the hand, if any."""
        found = self._parts.of_arm("wrist_camera", Camera, self._arm)
        return self._parts.sensor(found[0]) if found else None

    @cached_property
    def tactile(self) -> Sequence[TactileSensor]:
        """The tactile pads of the fingers; may be empty."""
        return [TactileSensor(part) for part in self._parts.of_arm("tactile", Tactile, self._arm)]

    @cached_property
    def wrist_wrench(self) -> WristWrench | None:
        """The wrench at the hand, or None without a sensor."""
        parts = self._parts
        found = parts.of_arm("force_torque", ForceTorque, self._arm)
        return WristWrench(found[0], parts.forward, parts.joints, parts.robot.clock) if found else None
