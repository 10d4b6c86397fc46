"""The kinematic chain of a camera in a robot model: its carrier, its mount and the joints that move it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.perception.calibration.head_camera import HeadAxes
from bestman_bt.registry import suggestion
from bestman_bt.robot_model.model import ArmModel, JointGroupModel, RobotModel
from bestman_bt.robot_model.sensor_parts import CameraPart


@dataclass(frozen=True)
class Joint:
    """A joint of the URDF."""

    name: str
    parent: str
    child: str
    axis: tuple[float, float, float]


class RobotChain:
    """The chain from the base to one camera. Raises ConfigurationError if the robot has no such camera."""

    def __init__(self, robot: RobotModel, camera: str) -> None:
        if camera not in robot.of(CameraPart):
            message = f"robot {robot.name!r} has no camera {camera!r}; {suggestion(camera, list(robot.of(CameraPart)))}"
            raise ConfigurationError([Problem("camera", None, "", message)])
        self.robot, self.camera = robot, camera
        self.kinematics = ForwardKinematics(robot)
        self.optical_frame = robot.of(CameraPart)[camera].optical_frame
        self.intrinsics: CameraIntrinsics = robot.of(CameraPart)[camera].intrinsics

    @cached_property
    def _joint_of(self) -> Mapping[str, Joint]:
        """Child link → the joint above it."""
        joints = {}
        for element in ET.fromstring(self.robot.urdf).findall("joint"):
            parent, child, axis = element.find("parent"), element.find("child"), element.find("axis")
            assert parent is not None
            assert child is not None
            x, y, z = (float(v) for v in (axis.get("xyz", "1 0 0") if axis is not None else "1 0 0").split())
            name = child.get("link", "")
            joints[name] = Joint(element.get("name", ""), parent.get("link", ""), name, (x, y, z))
        return joints

    @cached_property
    def carrier(self) -> str:
        """The link that the camera is mounted on."""
        return self._mount(self.camera).parent

    @cached_property
    def head(self) -> str | None:
        """The name of the joint group (pan-tilt) that moves the camera, or None."""
        moving = set(self.joints_to(self.carrier))
        groups = self.robot.of(JointGroupModel).items()
        return next((name for name, group in groups if moving & set(group.joint_names)), None)

    @cached_property
    def arm(self) -> str | None:
        """The name of the arm that carries the camera, or None."""
        moving = set(self.joints_to(self.carrier))
        return next((name for name, arm in self.robot.of(ArmModel).items() if moving & set(arm.joint_names)), None)

    def joints_to(self, link: str) -> list[str]:
        """Return the names of the joints from the root to a link, in order."""
        names: list[str] = []
        while link in self._joint_of:
            joint = self._joint_of[link]
            names.insert(0, joint.name)
            link = joint.parent
        return names

    def carrier_from_camera(self) -> Pose:
        """The pose of the camera's optical frame on its carrier, according to the model."""
        return self.kinematics.pose(self.optical_frame, {}, self.carrier)

    def head_root(self, head: str) -> str:
        """Return the first link of the head, which is mounted on the robot."""
        return self._mount(head).child

    def head_axes(self, head: str) -> HeadAxes:
        """Return the axes of the first and the last joint of the head, in the frames that ``HeadAxes`` names."""
        names = [
            name for name in self.joints_to(self.carrier) if name in self.robot.of(JointGroupModel)[head].joint_names
        ]
        by_name = {joint.name: joint for joint in self._joint_of.values()}
        pan, tilt = by_name[names[0]], by_name[names[-1]]
        in_mount = self.kinematics.pose(pan.child, {}, self.head_root(head)).rotation @ np.array(pan.axis)
        in_carrier = self.kinematics.pose(tilt.child, {}, self.carrier).rotation @ np.array(tilt.axis)
        return HeadAxes(_triple(in_mount), _triple(in_carrier))

    def camera_mount(self, carrier_from_camera: Pose) -> dict[str, list[float]]:
        """Return ``xyz`` and ``rpy`` of the camera for the robot file, from the pose of its optical frame on the
        carrier.
        """
        root = self._mount(self.camera).child
        return written(carrier_from_camera @ self.kinematics.pose(self.optical_frame, {}, root).inverse())

    def head_mount(self, head: str, base_from_head: Pose) -> dict[str, list[float]]:
        """Return ``xyz`` and ``rpy`` of the head for the robot file, from the pose of its first link in the base."""
        return written(self.kinematics.pose(self._mount(head).parent, {}).inverse() @ base_from_head)

    def _mount(self, part: str) -> Joint:
        name = f"{part}_mount_joint"
        found = next((joint for joint in self._joint_of.values() if joint.name == name), None)
        if found is None:
            message = f"part {part!r} of robot {self.robot.name!r} is not mounted on anything"
            raise ConfigurationError([Problem("camera", None, "", message)])
        return found


def written(pose: Pose) -> dict[str, list[float]]:
    """Return a pose as written to a robot file: metres to a micrometre, radians to a microradian."""
    return {
        "xyz": [round(float(value), 6) for value in pose.position],
        "rpy": [round(float(value), 6) for value in pose.roll_pitch_yaw],
    }


def _triple(vector: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in vector)
    return x, y, z
