"""Checks of bases: metres and radians in the base frame, distances and turns by odometry, command timeout."""

from __future__ import annotations

import math

from bestman_bt.messages import Pose2D, wrap_angle
from hal.api import MobileBase, MotionStatus, Robot
from hal.conformance.subject import BASES, Check, each, finish, require, require_rest

REFRESH = 0.1
DRIVE_TIME = 1.0


@each(MobileBase)
def velocities_of_a_base_lapse(robot: Robot, base: MobileBase) -> None:
    """Check that without a new command the base stops after its command timeout, and not earlier."""
    description = base.model.part
    speed = description.max_vx / 2
    base.set_velocity(speed, 0.0, 0.0)
    robot.clock.sleep(0.8 * base.command_timeout)
    require(base.velocity().vx > 0.02, f"within its timeout the base drives at {base.velocity().vx:.3f} m/s")
    robot.clock.sleep(0.2 * base.command_timeout + speed / description.max_acceleration + 0.3)
    require_rest(robot, "the dead-man timeout")


@each(MobileBase)
def a_base_moves_in_its_own_frame(robot: Robot, base: MobileBase) -> None:
    """Check directions and units: x ahead, y to the left, counter-clockwise positive; metres and radians.

    The motion continues while the command is repeated, in the base frame at any heading in ``odom``.
    """
    limits = base.model.part
    asked = [(min(0.15, limits.max_vx / 2), 0.0, 0.0), (0.0, 0.0, min(0.5, limits.max_wz / 2))]
    if limits.max_vy > 0.0:
        asked.append((0.0, min(0.15, limits.max_vy / 2), 0.0))
    for direction in (1.0, -1.0):
        for vx, vy, wz in asked:
            velocity = (direction * vx, direction * vy, direction * wz)
            _drive(robot, base, velocity, DRIVE_TIME / 2)
            start, begin, said = base.odometry(), robot.clock.now(), base.velocity()
            _drive(robot, base, velocity, DRIVE_TIME)
            took = robot.clock.now() - begin
            moved = start.inverse() @ base.odometry()
            base.set_velocity(0.0, 0.0, 0.0)
            robot.clock.sleep(0.5)
            _require_way(moved, velocity, took)
            reported = (said.vx, said.vy, said.wz)
            off = max(abs(a - b) for a, b in zip(reported, velocity, strict=True))
            require(off < 0.05 + 0.2 * max(map(abs, velocity)), f"asked for {velocity}, velocity() returns {reported}")


@each(MobileBase)
def a_base_drives_and_turns_by_odometry(robot: Robot, base: MobileBase) -> None:
    """Check half a metre back and forth and a quarter turn, within 1 cm and 1 degree of the base's own odometry."""
    start = base.odometry()
    for command, argument, (x, theta) in (
        (base.move_backward, 0.5, (-0.5, 0.0)),
        (base.move_forward, 0.5, (0.0, 0.0)),
        (base.rotate, 1.57, (0.0, 1.57)),
        (base.rotate, -1.57, (0.0, 0.0)),
    ):
        motion = command(argument)
        finish(robot, motion)
        require(motion.status is MotionStatus.SUCCEEDED, f"{command.__name__} ended {motion.status}: {motion.failure}")
        robot.clock.sleep(0.3)
        at = start.inverse() @ base.odometry()
        require(
            abs(at.x - x) < 0.01 and abs(at.y) < 0.01 and abs(at.theta - theta) < 0.0175,
            f"after {command.__name__}({argument}) odometry reports {at}",
        )


@each(MobileBase)
def a_motion_of_a_base_can_be_cancelled(robot: Robot, base: MobileBase) -> None:
    """Check that a cancelled motion ends immediately, and that the base comes to rest and accepts the next command."""
    motion = base.rotate(2.0)
    robot.clock.sleep(0.4)
    motion.cancel()
    require(motion.status is MotionStatus.CANCELED, f"right after cancel() a motion is {motion.status}")
    require_rest(robot, "cancel()")
    back = base.rotate(-0.1)
    finish(robot, back)
    require(back.status is MotionStatus.SUCCEEDED, f"after a cancelled one a motion ended {back.status}")


def _drive(robot: Robot, base: MobileBase, velocity: tuple[float, float, float], duration: float) -> None:
    """Repeat a velocity for a while, often enough for the dead-man."""
    every = min(REFRESH, base.command_timeout / 4)
    for _ in range(math.ceil(duration / every)):
        base.set_velocity(*velocity)
        robot.clock.sleep(every)


def _require_way(moved: Pose2D, velocity: tuple[float, float, float], took: float) -> None:
    """Check that odometry agrees with the velocity times its duration, to a fifth and 2 cm or 0.05 rad."""
    vx, vy, wz = velocity
    turned = wrap_angle(moved.theta - wz * took)
    right = (
        abs(moved.x - vx * took) < 0.02 + 0.2 * abs(vx) * took
        and abs(moved.y - vy * took) < 0.02 + 0.2 * abs(vy) * took
        and abs(turned) < 0.05 + 0.2 * abs(wz) * took
    )
    require(right, f"{took:.2f} s at (vx, vy, wz) = {velocity} moved the base by {moved}")


BASE_CHECKS = (
    Check(velocities_of_a_base_lapse, BASES, commands=True),
    Check(a_base_moves_in_its_own_frame, BASES, commands=True),
    Check(a_base_drives_and_turns_by_odometry, BASES, commands=True),
    Check(a_motion_of_a_base_can_be_cancelled, BASES, commands=True),
)
