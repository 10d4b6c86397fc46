"""Checks of sensors: readings in SI units, as described by the model, with stamps of the robot's clock."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from bestman_bt.messages import GRAVITY
from bestman_bt.robot_model.model import JointedModel
from bestman_bt.robot_model.sensor_parts import LidarPart, MountedForceTorque
from hal.api import (
    Battery,
    Bumper,
    Camera,
    CommandRefusedError,
    ForceTorque,
    Gripper,
    Imu,
    JointGroup,
    Lidar,
    MobileBase,
    Robot,
    Sensor,
    Tactile,
)
from hal.conformance.subject import (
    BASES,
    COMMANDS,
    GRIPPERS,
    GROUPS,
    Check,
    mass_on,
    parts_of,
    require,
    require_refusal,
)

OLDEST = 1.0
"""Maximum age of a reading when it is requested, seconds."""
AHEAD = 0.01
"""Seconds that a stamp may be ahead of the robot's clock, for rounding."""
FARTHEST = 100.0
"""Largest plausible depth, metres; larger values are in another unit."""
OVERSHOOT = 0.05
"""Radians or metres that a joint may be beyond its limits."""
EFFORT_MARGIN = 1.5
"""Largest effort reported by a motor at rest, as a multiple of the model's limit: controllers estimate it from
currents.
"""
SAME = 0.1
"""Relative difference allowed between a lidar's reported values and the model; a wrong unit causes a larger one."""
HAND_MARGIN, TOUCH = 2.0, (10.0, 3.0)
"""Limits of the wrench of a wrist at rest: a factor on the carried weight, and an offset in newtons and newton
metres.
"""
HAND_LENGTH = 0.5
"""Maximum distance from a wrist to the centre of mass of its load, metres."""


def joints_are_read_in_radians_metres_and_newtons(robot: Robot) -> None:
    """Check that readings are finite, one per joint and within the limits; at rest, velocities are zero."""
    for group in parts_of(robot, JointGroup):
        readings = {"positions": group.positions(), "velocities": group.velocities(), "efforts": group.efforts()}
        for what, values in readings.items():
            right = np.shape(values) == (len(group.joint_names),) and bool(np.all(np.isfinite(values)))
            require(right, f"{group.name}.{what}() gave {values}")
        rows = zip(group.joint_names, group.model.lower, group.model.upper, readings["positions"], strict=True)
        for joint, lower, upper, at in rows:
            inside = lower - OVERSHOOT <= at <= upper + OVERSHOOT
            require(inside, f"{joint} is at {at:.4f}, its limits are [{lower:.4f}, {upper:.4f}]")
        strongest = robot.model.of(JointedModel)[group.name].effort
        for joint, effort, most in zip(group.joint_names, readings["efforts"], strongest, strict=True):
            possible = abs(effort) <= EFFORT_MARGIN * most
            require(bool(possible), f"{joint} is at rest with an effort of {effort:.4g}, its motor has {most:.4g}")
        fastest = float(np.max(np.abs(readings["velocities"])))
        require(fastest < 0.05, f"{group.name} moves at {fastest:.4f} while it is at rest")


def a_gripper_reads_metres(robot: Robot) -> None:
    """Check that the width is within the range of the model."""
    for gripper in parts_of(robot, Gripper):
        width, closed, opened = gripper.width(), gripper.model.part.min_width, gripper.model.max_width
        inside = closed - 0.005 <= width <= opened + 0.005
        require(inside, f"{gripper.name} is {width} m wide, it can be {closed} to {opened} m")


def a_base_at_rest_stays_where_it_is(robot: Robot) -> None:
    """Check that odometry and velocity of a base at rest stay constant for half a second."""
    for base in parts_of(robot, MobileBase):
        before = base.odometry()
        robot.clock.sleep(0.5)
        moved, velocity = before.inverse() @ base.odometry(), base.velocity()
        still = abs(moved.x) + abs(moved.y) < 0.005 and abs(moved.theta) < 0.005
        require(still, f"{base.name} stands, and its odometry went from {before} by {moved}")
        require(
            abs(velocity.vx) + abs(velocity.vy) + abs(velocity.wz) < 0.03,
            f"{base.name} is at rest and reports {velocity}",
        )


def cameras_give_images_as_described(robot: Robot) -> None:
    """Check that colour and depth have the model's size, with depth in metres."""
    for camera in parts_of(robot, Camera):
        image, k = camera.capture(), camera.intrinsics
        require(image.rgb.shape == (k.height, k.width, 3), f"{camera.name} gave an image of shape {image.rgb.shape}")
        require(image.intrinsics == k, f"{camera.name} describes {k}, its image {image.intrinsics}")
        seen = image.depth[np.isfinite(image.depth) & (image.depth > 0.0)]
        require(len(seen) > 0, f"{camera.name} saw no depth at all")
        require(float(np.max(seen)) < FARTHEST, f"{camera.name} gave a depth of {np.max(seen):.1f}, in metres")


def lidars_give_ranges_within_theirs(robot: Robot) -> None:
    """Check that ranges are metres within the scan's limits, inf without a hit; limits and angles are the model's."""
    for lidar in parts_of(robot, Lidar):
        scan = lidar.scan()
        require(len(scan.ranges) > 0, f"{lidar.name} gave an empty scan")
        require(not np.any(np.isnan(scan.ranges)), f"{lidar.name} gave ranges that are not numbers")
        hit = scan.ranges[np.isfinite(scan.ranges)]
        inside = bool(np.all((hit >= scan.range_min) & (hit <= scan.range_max)))
        require(inside, f"{lidar.name} gave ranges outside [{scan.range_min}, {scan.range_max}]")
        require(scan.angle_increment != 0.0, f"{lidar.name} reports no angle between its beams")
        model = robot.model.of(LidarPart)[lidar.name]
        same = abs(scan.range_max - model.range_max) <= SAME * model.range_max
        require(same, f"{lidar.name} reports range_max = {scan.range_max} m, its model {model.range_max} m")
        span, described = abs(scan.angle_increment) * len(scan.ranges), model.angle_max - model.angle_min
        words = f"{lidar.name} looks over {span:.4g} rad from {scan.angle_min:.4g}, its model over {described:.4g} rad"
        require(abs(span - described) <= SAME * described and abs(scan.angle_min) <= math.tau + SAME, words)


def forces_are_those_of_the_hand(robot: Robot) -> None:
    """Check force and torque, (3,) N and N m: at rest not much more than the weight that the sensor carries."""
    for sensor in parts_of(robot, ForceTorque):
        wrench = sensor.wrench()
        for what, values in (("force", wrench.force), ("torque", wrench.torque)):
            right = np.shape(values) == (3,) and bool(np.all(np.isfinite(values)))
            require(right, f"{sensor.name} gave the {what} {values}")
        mounted = robot.model.of(MountedForceTorque)[sensor.name]
        weight = GRAVITY * mass_on(robot.model, mounted.joints)
        for what, values, more, offset, reach in (
            ("force", wrench.force, TOUCH[0], mounted.part.offset_force, 1.0),
            ("torque", wrench.torque, TOUCH[1], mounted.part.offset_torque, HAND_LENGTH),
        ):
            felt, most = float(np.linalg.norm(values)), HAND_MARGIN * weight * reach + more + 5 * offset
            words = f"{sensor.name} is at rest and reports a {what} of {felt:.4g}; the weight on it is {weight:.3g} N"
            require(felt <= most, words)


def inertial_units_feel_gravity(robot: Robot) -> None:
    """Check that a unit at rest measures 9.81 m/s² and no angular velocity."""
    for imu in parts_of(robot, Imu):
        reading = imu.read()
        felt, turning = np.linalg.norm(reading.linear_acceleration), np.linalg.norm(reading.angular_velocity)
        require(bool(abs(felt - GRAVITY) < 0.1 * GRAVITY), f"{imu.name} is at rest and measures {felt:.3f} m/s²")
        require(bool(turning < 0.1), f"{imu.name} is at rest and turns at {turning:.3f} rad/s")


def pads_tell_forces_taxel_by_taxel(robot: Robot) -> None:
    """Check for each taxel a pressure and a shear, newtons, and the sliding speed of a touching object, m/s."""
    for pad in parts_of(robot, Tactile):
        reading, shape = pad.read(), np.shape(pad.read().pressure)
        right = len(shape) == 2 and np.shape(reading.shear) == (*shape, 2) and np.shape(reading.sliding) == (2,)
        require(right, f"{pad.name} gave pressures {shape}, shears {np.shape(reading.shear)}")
        finite = all(bool(np.all(np.isfinite(values))) for values in (reading.pressure, reading.shear, reading.sliding))
        require(finite, f"{pad.name} returned a value that is not a number")


def bumpers_tell_zones_that_they_have(robot: Robot) -> None:
    """Check that there is at least one zone, and that none is pressed without an obstacle."""
    for bumper in parts_of(robot, Bumper):
        require(len(bumper.zones) > 0, f"{bumper.name} has no zones")
        pressed = bumper.read().pressed
        require(not pressed, f"nothing touches {bumper.name}, and zones {pressed} are pressed")


def batteries_tell_their_charge(robot: Robot) -> None:
    """Check a charge from 0 to 1, and a voltage."""
    for battery in parts_of(robot, Battery):
        reading = battery.read()
        require(0.0 <= reading.charge <= 1.0, f"{battery.name} has a charge of {reading.charge}; 0 to 1 is possible")
        sound = 0.0 < reading.voltage < 1000.0 and bool(np.isfinite(reading.current))
        require(sound, f"{battery.name} reports {reading.voltage} V and {reading.current} A")


def who_declares_commands_missing_takes_none(robot: Robot) -> None:
    """Check that a robot that declares commands unsupported refuses them."""
    if COMMANDS in robot.unsupported:
        for group in parts_of(robot, JointGroup):
            here = group.positions()
            require_refusal(
                partial(group.move_to, here), CommandRefusedError, f"{group.name}.move_to(), declared missing"
            )
        for base in parts_of(robot, MobileBase):
            require_refusal(partial(base.rotate, 0.1), CommandRefusedError, f"{base.name}.rotate(), declared missing")


def readings_are_stamped(robot: Robot) -> None:
    """Check stamps of the robot's clock: never in the future, less than a second old, and increasing."""
    for name, stamp in _stamped(robot):
        asked, first, now = robot.clock.now(), stamp(), robot.clock.now()
        words = f"{name} stamped {first:.3f}, it was asked at {asked:.3f} and answered at {now:.3f}"
        require(asked - OLDEST <= first <= now + AHEAD, words)
        deadline, last = now + 2 * OLDEST, first
        while last <= first:
            require(robot.clock.now() < deadline, f"{name} has delivered no new reading since {first:.3f}")
            robot.clock.sleep(0.1)
            newer = stamp()
            require(newer >= last, f"{name} went back from {last:.3f} to {newer:.3f}")
            last = newer


def _stamped(robot: Robot) -> list[tuple[str, Callable[[], float]]]:
    """Name → when its latest reading was taken."""
    found: list[tuple[str, Callable[[], float]]] = []
    for kind, stamp in (
        (Camera, lambda camera: camera.capture().stamp),
        (Lidar, lambda lidar: lidar.scan().stamp),
        (ForceTorque, lambda wrist: wrist.wrench().stamp),
        (Imu, lambda imu: imu.read().stamp),
        (Tactile, lambda pad: pad.read().stamp),
        (Bumper, lambda bumper: bumper.read().stamp),
        (Battery, lambda battery: battery.read().stamp),
    ):
        found += [(sensor.name, partial(stamp, sensor)) for sensor in parts_of(robot, kind)]
    return found


SENSOR_CHECKS = (
    Check(joints_are_read_in_radians_metres_and_newtons, GROUPS),
    Check(a_gripper_reads_metres, GRIPPERS),
    Check(a_base_at_rest_stays_where_it_is, BASES),
    Check(cameras_give_images_as_described, (Camera,)),
    Check(lidars_give_ranges_within_theirs, (Lidar,)),
    Check(forces_are_those_of_the_hand, (ForceTorque,)),
    Check(inertial_units_feel_gravity, (Imu,)),
    Check(pads_tell_forces_taxel_by_taxel, (Tactile,)),
    Check(bumpers_tell_zones_that_they_have, (Bumper,)),
    Check(batteries_tell_their_charge, (Battery,)),
    Check(who_declares_commands_missing_takes_none),
    Check(readings_are_stamped, (Sensor,)),
)
