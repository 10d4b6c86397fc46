"""Checks of a robot before, at the start and at the end of a connection; they receive it disconnected."""

from __future__ import annotations

from functools import partial

import numpy as np

from hal.api import (
    Arm,
    Battery,
    Camera,
    CommandRefusedError,
    ForceTorque,
    Gripper,
    Imu,
    JointGroup,
    Lidar,
    MobileBase,
    MotionErrorCode,
    MotionStatus,
    NotConnectedError,
    Robot,
    Tactile,
)
from hal.conformance.subject import (
    BASES,
    GROUPS,
    Check,
    finish,
    first,
    nearby,
    parts_of,
    require,
    require_refusal,
    require_rest,
)


def nothing_works_without_a_connection(robot: Robot) -> None:
    """Check that reading and commanding raise NotConnectedError, and that stopping is harmless."""
    for group in parts_of(robot, JointGroup):
        require_refusal(group.positions, NotConnectedError, f"{group.name}.positions()", (group.name,))
        require_refusal(group.velocities, NotConnectedError, f"{group.name}.velocities()", (group.name,))
        at = group.model.lower
        require_refusal(partial(group.move_to, at), NotConnectedError, f"{group.name}.move_to()")
        require_refusal(partial(group.command, at), NotConnectedError, f"{group.name}.command()")
        if isinstance(group, Arm):
            require_refusal(partial(group.servo, at), NotConnectedError, f"{group.name}.servo()")
    for base in parts_of(robot, MobileBase):
        require_refusal(base.odometry, NotConnectedError, f"{base.name}.odometry()", (base.name,))
        require_refusal(base.velocity, NotConnectedError, f"{base.name}.velocity()", (base.name,))
        require_refusal(partial(base.set_velocity, 0, 0, 0), NotConnectedError, "set_velocity()")
        require_refusal(partial(base.rotate, 0.1), NotConnectedError, "rotate()")
    for gripper in parts_of(robot, Gripper):
        require_refusal(gripper.width, NotConnectedError, f"{gripper.name}.width()", (gripper.name,))
        require_refusal(gripper.open, NotConnectedError, f"{gripper.name}.open()")
    for camera in parts_of(robot, Camera):
        require_refusal(camera.capture, NotConnectedError, f"{camera.name}.capture()", (camera.name,))
    for lidar in parts_of(robot, Lidar):
        require_refusal(lidar.scan, NotConnectedError, f"{lidar.name}.scan()", (lidar.name,))
    for sensor in parts_of(robot, ForceTorque):
        require_refusal(sensor.wrench, NotConnectedError, f"{sensor.name}.wrench()", (sensor.name,))
    others: list[Imu | Tactile | Battery] = [
        *parts_of(robot, Imu),
        *parts_of(robot, Tactile),
        *parts_of(robot, Battery),
    ]
    for other in others:
        require_refusal(other.read, NotConnectedError, f"{other.name}.read()", (other.name,))
    for part in robot.parts.values():
        part.stop()


def connecting_and_disconnecting_are_idempotent(robot: Robot) -> None:
    """Check that ``connect()`` and ``disconnect()`` are idempotent and the clock is monotonic."""
    robot.disconnect()
    robot.connect()
    robot.connect()
    robot.clock.sleep(0.1)
    now = robot.clock.now()
    robot.disconnect()
    robot.disconnect()
    with robot:
        require(robot.clock.now() >= now, "time should not go back when the robot connects again")
        for group in parts_of(robot, JointGroup):
            group.positions()


def nothing_works_after_disconnecting(robot: Robot) -> None:
    """Check that disconnected parts refuse reads and commands, as before connecting."""
    with robot:
        robot.clock.sleep(0.1)
    nothing_works_without_a_connection(robot)


def a_robot_that_connects_again_takes_commands(robot: Robot) -> None:
    """Check that a robot accepts commands after a reconnection."""
    with robot:
        robot.clock.sleep(0.1)
    with robot:
        group = first(robot, JointGroup)
        target = nearby(robot, group, 0.1)
        motion = group.move_to(target)
        finish(robot, motion)
        require(motion.status is MotionStatus.SUCCEEDED, f"after connecting again a motion ended {motion.status}")
        error = float(np.max(np.abs(group.positions() - target)))
        require(error < 0.01, f"after connecting again {group.name} ended {error:.4f} off its target")


def a_robot_that_connects_again_stands_still(robot: Robot) -> None:
    """Check that a robot is at rest after a reconnection, whatever it did before."""
    with robot:
        for base in parts_of(robot, MobileBase):
            base.set_velocity(base.model.part.max_vx / 4, 0.0, 0.0)
        robot.clock.sleep(0.2)
    with robot:
        require_rest(robot, "connecting again")


def disconnecting_ends_motions(robot: Robot) -> None:
    """Check that a running motion fails with a reason, and cannot be cancelled afterwards."""
    with robot:
        group = first(robot, JointGroup)
        motion = group.move_to(nearby(robot, group), 0.2)
    motion.cancel()
    code = motion.failure.code if motion.failure else None
    require(motion.status is MotionStatus.FAILED, f"a motion cut off by disconnect() is {motion.status}, not FAILED")
    require(code is MotionErrorCode.DISCONNECTED, f"its error code is {code}, not DISCONNECTED")


def a_stop_is_kept_across_connections(robot: Robot) -> None:
    """Check that a stop stays latched until it is cleared, even without a connection."""
    robot.stop()
    with robot:
        require(robot.stopped, "a stop from before connect() should stay latched")
        for group in parts_of(robot, JointGroup):
            here = group.positions()
            require_refusal(partial(group.move_to, here), CommandRefusedError, "move_to() of a stopped robot")
    require(robot.stopped, "a stop should stay latched after disconnect()")
    robot.clear_stop()
    require(not robot.stopped, "clear_stop() should work without a connection")


CONNECTION_CHECKS = (
    Check(nothing_works_without_a_connection),
    Check(connecting_and_disconnecting_are_idempotent),
    Check(nothing_works_after_disconnecting),
    Check(a_robot_that_connects_again_takes_commands, GROUPS, commands=True),
    Check(a_robot_that_connects_again_stands_still, BASES, commands=True),
    Check(disconnecting_ends_motions, GROUPS, commands=True),
    Check(a_stop_is_kept_across_connections),
)
