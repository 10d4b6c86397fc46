"""Calibration of the turning slip of a base: the factor on its apparent track, measured by a gyroscope in turns in
place.

A. Mandow et al., "Experimental kinematics for wheeled skid-steer mobile robots", 2007: wheels that are dragged over the
floor make the base turn as if its track were wider, by a factor that holds for one floor, load and speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bestman_bt.control.inertial import GyroHeading
from bestman_bt.messages import wrap_angle
from hal.api import Clock, MobileBase

REST = 1.0
"""Seconds at rest before each turn, in which the gyroscope's bias is learned."""


@dataclass(frozen=True)
class TurningSlip:
    """A measured slip factor. ``value``: for ``turning_slip`` of the base's description. ``left``, ``right``: for both
    directions.

    ``before``: mean error of the current odometry in both turns, radians.
    """

    value: float
    left: float
    right: float
    before: float


def measure_turning_slip(
    base: MobileBase,
    gyro: GyroHeading,
    clock: Clock,
    present: float,
    angle: float = 2.0 * math.pi,
    speed: float = 0.5,
) -> TurningSlip:
    """Turn a base left and right and measure its slip; ``present``: the factor currently used by its odometry.

    Blocks, with exclusive use of the base, until it has finished. Floor, load and speed should be those of normal
    operation; a wrong factor changes the speed of turning, so repeat the measurement with the result. ``angle``:
    radians of each turn by odometry, ``speed``: fraction of the maximum turning speed. Raises the errors of the base's
    commands.
    """
    ways = [_turn(base, gyro, clock, side * angle, speed) for side in (1.0, -1.0)]
    left, right = (present * counted / turned for counted, turned in ways)
    before = sum(abs(counted - turned) for counted, turned in ways) / 2.0
    return TurningSlip((left + right) / 2.0, left, right, before)


def _turn(base: MobileBase, gyro: GyroHeading, clock: Clock, angle: float, share: float) -> tuple[float, float]:
    """Return the angles of one turn by odometry and by gyroscope, radians."""
    gyro.begin()
    clock.sleep(REST)
    gyro.level()
    heading, counted = base.odometry().theta, 0.0
    speed = math.copysign(share * base.model.part.max_wz, angle)
    brake = speed**2 / (2.0 * base.model.part.max_angular_acceleration)
    while abs(counted) < abs(angle) - brake:
        base.set_velocity(0.0, 0.0, speed)
        clock.sleep(0.05)
        counted, heading = counted + wrap_angle(base.odometry().theta - heading), base.odometry().theta
    base.set_velocity(0.0, 0.0, 0.0)
    clock.sleep(abs(speed) / base.model.part.max_angular_acceleration + 1.0)
    counted += wrap_angle(base.odometry().theta - heading)
    turned = gyro.heading
    gyro.end()
    return counted, turned
