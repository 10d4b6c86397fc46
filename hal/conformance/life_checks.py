"""What a robot owes before, at the beginning and at the end of a connection; these checks get it disconnected."""

# mypy: disable-error-code="type-abstract"
from __future__ import annotations

from functools import partial

from hal.api import (
    Camera,
    ForceTorque,
    Gripper,
    JointGroup,
    Lidar,
    MobileBase,
    MotionErrorCode,
    MotionStatus,
    NotConnectedError,
    Robot,
    UnknownPartError,
)
from hal.conformance.requirement import require, require_refusal
from hal.conformance.subject import GROUPS, Check, first, nearby, parts_of


def the_description_can_be_read_before_connecting(robot: Robot) -> None:
    """Limits, joints, frames, ranges, the model."""
    require(robot.model is not None, "the robot model should be there before connect()")
    require(len(robot.parts) > 0, "a robot should have parts before connect()")
    for name, part in robot.parts.items():
        require(part.name == name, f"the part {name!r} calls itself {part.name!r}")
    for group in parts_of(robot, JointGroup):
        require(len(group.joint_names) == len(group.limits) > 0, f"{group.name} should have limits for each joint")
        require(all(limit.lower < limit.upper for limit in group.limits), f"{group.name} has an empty range")
    for base in parts_of(robot, MobileBase):
        require(base.description.max_vx > 0.0, f"{base.name} should be able to drive")
        require(base.description.command_timeout > 0.0, f"{base.name} should have a dead-man timeout")
    for gripper in parts_of(robot, Gripper):
        require(gripper.description.max_width > gripper.description.min_width, f"{gripper.name} should open")
    for camera in parts_of(robot, Camera):
        require(camera.intrinsics.width > 0 and bool(camera.optical_frame), f"{camera.name} should describe itself")


def nothing_works_without_a_connection(robot: Robot) -> None:
    """Reading and commanding raise NotConnectedError; stopping does no harm."""
    for group in parts_of(robot, JointGroup):
        require_refusal(group.positions, NotConnectedError, f"{group.name}.positions()", (group.name,))
        at = [limit.lower for limit in group.limits]
        require_refusal(partial(group.move_to, at), NotConnectedError, f"{group.name}.move_to()")
    for base in parts_of(robot, MobileBase):
        require_refusal(base.odometry, NotConnectedError, f"{base.name}.odometry()", (base.name,))
        require_refusal(partial(base.set_velocity, 0, 0, 0), NotConnectedError, "set_velocity()")
    for gripper in parts_of(robot, Gripper):
        require_refusal(gripper.width, NotConnectedError, f"{gripper.name}.width()", (gripper.name,))
        require_refusal(gripper.open, NotConnectedError, f"{gripper.name}.open()")
    for camera in parts_of(robot, Camera):
        require_refusal(camera.capture, NotConnectedError, f"{camera.name}.capture()", (camera.name,))
    for lidar in parts_of(robot, Lidar):
        require_refusal(lidar.scan, NotConnectedError, f"{lidar.name}.scan()", (lidar.name,))
    for sensor in parts_of(robot, ForceTorque):
        require_refusal(sensor.wrench, NotConnectedError, f"{sensor.name}.wrench()", (sensor.name,))
    for part in robot.parts.values():
        part.stop()


def connecting_and_disconnecting_are_idempotent(robot: Robot) -> None:
    """Twice is as good as once; time never goes back."""
    robot.disconnect()
    robot.connect()
    robot.connect()
    robot.clock.sleep(0.1)
    now = robot.clock.now()
    robot.disconnect()
    robot.disconnect()
    nothing_works_without_a_connection(robot)
    with robot:
        require(robot.clock.now() >= now, "time should not go back when the robot connects again")
        for group in parts_of(robot, JointGroup):
            group.positions()


def disconnecting_ends_motions(robot: Robot) -> None:
    """A motion that was under way has failed, and says why."""
    with robot:
        group = first(robot, JointGroup)
        motion = group.move_to(nearby(group), 0.2)
    code = motion.error.code if motion.error else None
    require(motion.status is MotionStatus.FAILED, f"a motion cut off by disconnect() is {motion.status}, not FAILED")
    require(code is MotionErrorCode.DISCONNECTED, f"its error code is {code}, not DISCONNECTED")


def an_unknown_part_is_refused_with_the_names_there_are(robot: Robot) -> None:
    """Also a part of another kind."""
    name = next(iter(robot.parts))
    require_refusal(lambda: robot.part("no_such_part", JointGroup), UnknownPartError, "an unknown part", (name,))
    for lidar in parts_of(robot, Lidar):
        require_refusal(partial(robot.part, lidar.name, MobileBase), UnknownPartError, "a wrong kind")


LIFE_CHECKS = (
    Check("the description can be read before connecting", the_description_can_be_read_before_connecting),
    Check("nothing works without a connection", nothing_works_without_a_connection),
    Check("connecting and disconnecting are idempotent", connecting_and_disconnecting_are_idempotent),
    Check("disconnecting ends motions", disconnecting_ends_motions, GROUPS),
    Check("an unknown part is refused with the names there are", an_unknown_part_is_refused_with_the_names_there_are),
)
