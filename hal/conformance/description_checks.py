"""Checks that a robot's description before connecting agrees with its model."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np

from bestman_bt.robot_model.model import BaseModel, GripperModel, JointedModel
from hal.api import Camera, ForceTorque, Gripper, Imu, JointGroup, Lidar, MobileBase, Robot, Tactile, UnknownPartError
from hal.conformance.subject import BASES, GRIPPERS, GROUPS, Check, ConformanceError, parts_of, require, require_refusal


def the_description_can_be_read_before_connecting(robot: Robot) -> None:
    """Check the model, the names of the parts, and the properties of cameras."""
    require(robot.model is not None, "the robot model should be there before connect()")
    require(len(robot.parts) > 0, "a robot should have parts before connect()")
    for name, part in robot.parts.items():
        require(part.name == name, f"the part {name!r} has the name {part.name!r}")
    for camera in parts_of(robot, Camera):
        require(
            camera.intrinsics.width > 0 and camera.intrinsics.fx > 0.0,
            f"{camera.name} should report image size and focal lengths",
        )


def every_part_of_the_model_is_there_or_unsupported(robot: Robot) -> None:
    """Check that a driver lists each missing part in ``unsupported``, with the reason."""
    declared = robot.unsupported
    silent = [name for name in robot.model.parts if name not in robot.parts and not declared.get(name)]
    require(not silent, f"the model lists {', '.join(silent)}, which the robot has not and does not declare missing")


def joints_have_the_limits_of_the_model(robot: Robot) -> None:
    """Check names, order, and limits in radians or metres; only effort and velocity limits may be lower than the
    model's."""
    for group in parts_of(robot, JointGroup):
        reported, model = group.model, robot.model.of(JointedModel).get(group.name)
        if model is None:
            raise ConformanceError(f"the model has no joints called {group.name!r}")
        require(group.joint_names == model.joint_names, f"{group.name} has the joints {group.joint_names}")
        ends = bool(np.allclose([reported.lower, reported.upper], [model.lower, model.upper], rtol=0.0, atol=1e-6))
        require(
            ends, f"{group.name} says [{reported.lower}, {reported.upper}]; its model [{model.lower}, {model.upper}]"
        )
        slower = bool(np.all((reported.velocity > 0.0) & (reported.velocity <= model.velocity + 1e-9)))
        require(slower, f"{group.name} says {reported.velocity} of its speeds; its model {model.velocity}")
        require(
            bool(np.all(reported.acceleration > 0.0)), f"{group.name} says {reported.acceleration} of its accelerations"
        )
        require(bool(np.all(reported.effort > 0.0)), f"{group.name} says {reported.effort} of its efforts")


def a_base_is_as_the_model_says(robot: Robot) -> None:
    """Check speeds in m/s and rad/s, a footprint in metres, and a command timeout."""
    for base in parts_of(robot, MobileBase):
        described, model = base.model, robot.model.of(BaseModel).get(base.name)
        if model is None:
            raise ConformanceError(f"the model has no base called {base.name!r}")
        for what in ("max_vx", "max_vy", "max_wz", "max_acceleration", "max_angular_acceleration"):
            value, limit = getattr(described.part, what), getattr(model.part, what)
            require(0.0 <= value <= limit + 1e-9, f"{base.name} says {what} = {value}, its model {limit}")
        require(described.part.max_vx > 0.0, f"{base.name} should be able to drive")
        require(0.0 < base.command_timeout <= 1.0, f"{base.name} lapses after {base.command_timeout} s")
        same = np.shape(described.footprint) == np.shape(model.footprint)
        require(same and np.allclose(described.footprint, model.footprint), f"{base.name} has another footprint")


def a_gripper_is_as_the_model_says(robot: Robot) -> None:
    """Check widths in metres, speed in m/s, force in newtons."""
    for gripper in parts_of(robot, Gripper):
        described, model = gripper.model, robot.model.of(GripperModel).get(gripper.name)
        if model is None:
            raise ConformanceError(f"the model has no gripper called {gripper.name!r}")
        widths = (described.part.min_width, described.max_width)
        require(widths[1] > widths[0], f"{gripper.name} should open")
        same = np.allclose(widths, (model.part.min_width, model.max_width), rtol=0.0, atol=1e-6)
        require(bool(same), f"{gripper.name} says {widths} m, its model {model.part.min_width}, {model.max_width} m")
        for what in ("max_speed", "max_force"):
            value, limit = getattr(described.part, what), getattr(model.part, what)
            require(0.0 < value <= limit + 1e-9, f"{gripper.name} says {what} = {value}, its model {limit}")


def frames_are_those_of_the_model(robot: Robot) -> None:
    """Check that every sensor measures in a link of the URDF."""
    links = {link.get("name") for link in ElementTree.fromstring(robot.model.urdf).iter("link")}
    frames = {camera.name: camera.optical_frame for camera in parts_of(robot, Camera)}
    others: list[Lidar | ForceTorque | Imu | Tactile] = [
        *parts_of(robot, Lidar),
        *parts_of(robot, ForceTorque),
        *parts_of(robot, Imu),
        *parts_of(robot, Tactile),
    ]
    frames |= {sensor.name: sensor.frame for sensor in others}
    for name, frame in frames.items():
        require(frame in links, f"{name} measures in {frame!r}, which is not a link of the robot's model")


def an_unknown_part_is_refused_with_the_names_there_are(robot: Robot) -> None:
    """Check that an unknown name, or a part of another type, is refused with the list of parts."""
    name, part = next(iter(robot.parts.items()))
    require_refusal(lambda: robot.part("no_such_part", JointGroup), UnknownPartError, "an unknown part", (name,))
    other = Camera if not isinstance(part, Camera) else JointGroup
    require_refusal(lambda: robot.part(name, other), UnknownPartError, "a part of another kind")


DESCRIPTION_CHECKS = (
    Check(the_description_can_be_read_before_connecting),
    Check(every_part_of_the_model_is_there_or_unsupported),
    Check(joints_have_the_limits_of_the_model, GROUPS),
    Check(a_base_is_as_the_model_says, BASES),
    Check(a_gripper_is_as_the_model_says, GRIPPERS),
    Check(frames_are_those_of_the_model),
    Check(an_unknown_part_is_refused_with_the_names_there_are),
)
