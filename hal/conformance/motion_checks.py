"""What motions owe: they arrive, can be cancelled and superseded, and their end is final."""

# mypy: disable-error-code="type-abstract"
from __future__ import annotations

import numpy as np

from bestman_bt.messages import JointTrajectory
from hal.api import (
    Arm,
    Camera,
    ForceTorque,
    Gripper,
    JointGroup,
    Lidar,
    MobileBase,
    MotionErrorCode,
    MotionStatus,
    Robot,
)
from hal.conformance.requirement import require
from hal.conformance.subject import (
    ARMS,
    BASES,
    GRIPPERS,
    GROUPS,
    Check,
    finish,
    first,
    nearby,
    parts_of,
    require_rest,
)


def joints_arrive_within_their_limits(robot: Robot) -> None:
    """Every group reaches its target and never exceeds its speed limits by more than 5 %."""
    for group in parts_of(robot, JointGroup):
        target = nearby(group)
        motion = group.move_to(target)
        require(motion.status is MotionStatus.RUNNING and motion.error is None, "a new motion should be RUNNING")
        fastest = np.zeros(len(target))
        while not motion.done:
            robot.clock.sleep(0.02)
            fastest = np.maximum(fastest, np.abs(group.velocities()))
        require(
            motion.status is MotionStatus.SUCCEEDED, f"{group.name}.move_to() ended {motion.status}: {motion.error}"
        )
        error = float(np.max(np.abs(group.positions() - target)))
        require(error < 0.01, f"{group.name} is {error:.4f} off its target")
        limits = np.array([limit.velocity for limit in group.limits])
        require(bool(np.all(fastest <= 1.05 * limits)), f"{group.name} moved at {fastest}, its limits are {limits}")


def commands_do_not_block(robot: Robot) -> None:
    """A command returns before the motion has got anywhere."""
    start = robot.clock.now()
    group = first(robot, JointGroup)
    group.move_to(nearby(group), 0.1)
    passed = robot.clock.now() - start
    require(passed < 0.05, f"move_to() took {passed:.3f} s of the robot's time")


def a_cancelled_motion_comes_to_rest(robot: Robot) -> None:
    """Its status is CANCELED, and stays so."""
    group = first(robot, JointGroup)
    motion = group.move_to(nearby(group), 0.5)
    robot.clock.sleep(0.2)
    motion.cancel()
    require_rest(robot, "cancel()")
    motion.cancel()
    require(motion.status is MotionStatus.CANCELED, f"a cancelled motion is {motion.status}")


def a_newer_command_takes_over(robot: Robot) -> None:
    """The older motion is cancelled as superseded, the newer one arrives."""
    group = first(robot, JointGroup)
    start = group.positions()
    older = group.move_to(nearby(group), 0.5)
    robot.clock.sleep(0.2)
    newer = group.move_to(start, 0.5)
    code = older.error.code if older.error else None
    require(older.status is MotionStatus.CANCELED, f"a superseded motion is {older.status}, not CANCELED")
    require(code is MotionErrorCode.SUPERSEDED, f"its error code is {code}, not SUPERSEDED")
    finish(robot, newer)
    require(newer.status is MotionStatus.SUCCEEDED, f"the newer motion ended {newer.status}: {newer.error}")
    error = float(np.max(np.abs(group.positions() - start)))
    require(error < 0.01, f"the newer motion ended {error:.4f} off its target")
    older.cancel()
    robot.clock.sleep(0.2)
    require(newer.status is MotionStatus.SUCCEEDED, "cancelling an ended motion should do nothing")


def set_points_are_held(robot: Robot) -> None:
    """Positions and velocities by ``command``; a velocity of zero stops."""
    group = first(robot, JointGroup)
    target = nearby(group, 0.1)
    group.command(positions=target)
    robot.clock.sleep(1.5)
    error = float(np.max(np.abs(group.positions() - target)))
    require(error < 0.01, f"{group.name} is {error:.4f} off its commanded positions")
    speed = np.zeros(len(target))
    speed[0] = 0.1 if target[0] < (group.limits[0].lower + group.limits[0].upper) / 2 else -0.1
    group.command(velocities=speed)
    robot.clock.sleep(1.0)
    moved = float(group.positions()[0] - target[0])
    require(abs(moved - speed[0]) < 0.03, f"{group.name} moved {moved:.3f} in 1 s at {speed[0]} per second")
    group.command(velocities=np.zeros(len(target)))
    require_rest(robot, "a velocity of zero")


def trajectories_are_followed(robot: Robot) -> None:
    """In the time that they say, near the samples on the way."""
    arm = first(robot, Arm)
    start, end = arm.positions(), nearby(arm, 0.2)
    times = np.linspace(0.0, 1.0, 21)
    share = 3 * times**2 - 2 * times**3
    rate = 6 * times - 6 * times**2
    trajectory = JointTrajectory(
        arm.joint_names, times, start + share[:, None] * (end - start), rate[:, None] * (end - start)
    )
    motion, begin = arm.follow(trajectory), robot.clock.now()
    robot.clock.sleep(0.5)
    expected, _ = trajectory.sample(robot.clock.now() - begin)
    error = float(np.max(np.abs(arm.positions() - expected)))
    require(error < 0.02, f"half way the arm is {error:.4f} rad off the trajectory")
    finish(robot, motion)
    took = robot.clock.now() - begin
    require(motion.status is MotionStatus.SUCCEEDED, f"follow() ended {motion.status}: {motion.error}")
    require(0.9 < took < 2.0, f"a trajectory of 1 s took {took:.2f} s")


def set_points_are_streamed(robot: Robot) -> None:
    """At 20 Hz, slowly."""
    arm = first(robot, Arm)
    start, end = arm.positions(), nearby(arm, 0.1)
    for share in np.linspace(0.05, 1.0, 20):
        arm.servo(start + share * (end - start))
        robot.clock.sleep(0.05)
    robot.clock.sleep(0.2)
    error = float(np.max(np.abs(arm.positions() - end)))
    require(error < 0.01, f"the arm is {error:.4f} rad off the last streamed set-point")


def velocities_of_a_base_lapse(robot: Robot) -> None:
    """The dead-man: without a new command the base stops by itself."""
    base = first(robot, MobileBase)
    description = base.description
    speed = description.max_vx / 2
    base.set_velocity(speed, 0.0, 0.0)
    robot.clock.sleep(description.command_timeout + speed / description.max_acceleration + 0.3)
    require_rest(robot, "the dead-man timeout")


def a_base_drives_and_turns_by_odometry(robot: Robot) -> None:
    """Half a metre back and forth and a quarter turn, within 1 cm and 1 degree of its own odometry."""
    base = first(robot, MobileBase)
    start = base.odometry()
    for command, argument, (x, theta) in (
        (base.move_backward, 0.5, (-0.5, 0.0)),
        (base.move_forward, 0.5, (0.0, 0.0)),
        (base.rotate, 1.57, (0.0, 1.57)),
        (base.rotate, -1.57, (0.0, 0.0)),
    ):
        motion = command(argument)
        finish(robot, motion)
        require(motion.status is MotionStatus.SUCCEEDED, f"{command.__name__} ended {motion.status}: {motion.error}")
        robot.clock.sleep(0.3)
        at = start.inverse() @ base.odometry()
        require(
            abs(at.x - x) < 0.01 and abs(at.y) < 0.01 and abs(at.theta - theta) < 0.0175,
            f"after {command.__name__}({argument}) odometry says {at}",
        )


def a_gripper_opens_and_closes(robot: Robot) -> None:
    """To the widths asked; closed on nothing, it is empty."""
    gripper = first(robot, Gripper)
    limits = gripper.description
    middle = (limits.min_width + limits.max_width) / 2
    for motion, width, empty in (
        (gripper.open, limits.max_width, False),
        (gripper.close, limits.min_width, True),
        (lambda: gripper.move(middle), middle, False),
    ):
        handle = motion()
        finish(robot, handle)
        state = gripper.state()
        require(handle.status is MotionStatus.SUCCEEDED, f"the gripper's motion ended {handle.status}: {handle.error}")
        require(abs(gripper.width() - width) < 0.003, f"the width is {gripper.width():.4f}, asked were {width:.4f}")
        require(state.at_target and not state.moving and not state.object_held, f"unexpected state {state}")
        require(state.empty == empty, f"at width {width} the state is {state}")


def sensors_deliver(robot: Robot) -> None:
    """Images and scans of the described size, stamped now."""
    now = robot.clock.now()
    for camera in parts_of(robot, Camera):
        image = camera.capture()
        k = camera.intrinsics
        require(image.rgb.shape == (k.height, k.width, 3), f"{camera.name} gave an image of shape {image.rgb.shape}")
        require(abs(image.stamp - now) < 1.0, f"{camera.name} stamped {image.stamp}, it is {now}")
        require(bool(np.any(image.depth > 0)), f"{camera.name} saw no depth at all")
    for lidar in parts_of(robot, Lidar):
        scan = lidar.scan()
        hit = scan.ranges[np.isfinite(scan.ranges)]
        require(len(scan.ranges) > 0, f"{lidar.name} gave an empty scan")
        inside = bool(np.all((hit >= scan.range_min) & (hit <= scan.range_max)))
        require(inside, f"{lidar.name} gave ranges outside [{scan.range_min}, {scan.range_max}]")
    for sensor in parts_of(robot, ForceTorque):
        wrench = sensor.wrench()
        require(abs(wrench.stamp - now) < 1.0, f"{sensor.name} stamped {wrench.stamp}")


MOTION_CHECKS = (
    Check("joints arrive within their limits", joints_arrive_within_their_limits, GROUPS),
    Check("commands do not block", commands_do_not_block, GROUPS),
    Check("a cancelled motion comes to rest", a_cancelled_motion_comes_to_rest, GROUPS),
    Check("a newer command takes over", a_newer_command_takes_over, GROUPS),
    Check("set-points are held", set_points_are_held, GROUPS),
    Check("trajectories are followed", trajectories_are_followed, ARMS),
    Check("set-points are streamed", set_points_are_streamed, ARMS),
    Check("velocities of a base lapse", velocities_of_a_base_lapse, BASES),
    Check("a base drives and turns by odometry", a_base_drives_and_turns_by_odometry, BASES),
    Check("a gripper opens and closes", a_gripper_opens_and_closes, GRIPPERS),
    Check("sensors deliver", sensors_deliver),
)
