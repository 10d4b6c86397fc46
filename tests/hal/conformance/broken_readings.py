"""Clocks and sensors that break a promise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from bestman_bt.messages import Pose2D
from hal.conformance.subject import COMMANDS
from tests.hal.conformance.changed_robot import Break, changed, of, wrapped

HAND = "forces are those of the hand"


def a_clock_that_oversleeps_short_sleeps(robot: Any) -> None:
    wrapped(robot.clock, "sleep", lambda do, duration: do(0.005 if 0.0 < duration < 0.0035 else duration))


def a_simulated_clock_that_is_slow_in_short_sleeps(robot: Any) -> None:
    """By as little as a busy machine may be late, which simulated time never is."""
    wrapped(robot.clock, "sleep", lambda do, duration: do(1.08 * duration if 0.0 < duration < 0.0035 else duration))


def a_clock_that_goes_back(robot: Any) -> None:
    """Asked twice in an instant, the second answer is earlier."""
    last = [0.0]

    def now(do: Any) -> float:
        again, last[0] = do() == last[0], do()
        return last[0] - 0.001 if again and last[0] > 0.15 else last[0]

    wrapped(robot.clock, "now", now)


def a_clock_that_sleeps_for_ever_if_asked(robot: Any) -> None:
    wrapped(robot.clock, "sleep", lambda do, duration: do(duration) if np.isfinite(duration) else None)


def a_clock_that_calls_at_once(robot: Any) -> None:
    def every(do: Any, period: float, call: Callable[[], None]) -> Any:
        call()
        return do(period, call)

    wrapped(robot.clock, "every", every)


def unsteady_odometry(robot: Any) -> None:
    def odometry(do: Any) -> Pose2D:
        at = do()
        return Pose2D(at.x, at.y, at.theta + 0.006 * (int(2 * robot.clock.now() + 1e-6) % 2))

    wrapped(robot.parts["base"], "odometry", odometry)


def in_millimetres(image: Any) -> Any:
    return replace(image, depth=1000 * image.depth)


def in_millimetres_and_degrees(scan: Any) -> Any:
    """Consistently: the ranges are within those that it tells."""
    lengths = {name: 1000 * getattr(scan, name) for name in ("ranges", "range_min", "range_max")}
    angles = {name: np.degrees(getattr(scan, name)) for name in ("angle_min", "angle_increment")}
    return replace(scan, **lengths, **angles)


def lazy(robot: Any) -> None:
    """It could, but says that it takes no commands."""
    changed(robot, unsupported=property(lambda self: {COMMANDS: "too much work"}))


def in_multiples_of_gravity(reading: Any) -> Any:
    return replace(reading, linear_acceleration=reading.linear_acceleration / 9.81)


BROKEN: list[tuple[str, Break]] = [
    ("sleeping takes the time asked", a_clock_that_oversleeps_short_sleeps),
    ("sleeping takes the time asked", a_simulated_clock_that_is_slow_in_short_sleeps),
    ("time never goes back", a_clock_that_goes_back),
    ("impossible sleeps are refused", a_clock_that_sleeps_for_ever_if_asked),
    ("periodic calls come on time", a_clock_that_calls_at_once),
    ("joints are read in radians metres and newtons", of("arm", "efforts", lambda do: np.nan * do())),
    ("a base at rest stays where it is", unsteady_odometry),
    ("cameras give images as described", of("head_camera", "capture", lambda do: in_millimetres(do()))),
    ("lidars give ranges within theirs", of("lidar", "scan", lambda do: replace(do(), range_max=1.0))),
    ("lidars give ranges within theirs", of("lidar", "scan", lambda do: in_millimetres_and_degrees(do()))),
    (
        "lidars give ranges within theirs",
        of("lidar", "scan", lambda do: replace(do(), angle_increment=np.degrees(do().angle_increment))),
    ),
    ("joints are read in radians metres and newtons", of("head", "efforts", lambda do: do() + 1e6)),
    (HAND, of("wrist_force_torque", "wrench", lambda do: replace(do(), force=np.full(3, np.nan)))),
    (HAND, of("wrist_force_torque", "wrench", lambda do: replace(do(), force=np.array([0.0, 0.0, -1000.0])))),
    (HAND, of("wrist_force_torque", "wrench", lambda do: replace(do(), torque=np.array([500.0, 0.0, 0.0])))),
    ("who declares commands missing takes none", lazy),
    ("inertial units feel gravity", of("imu", "read", lambda do: in_multiples_of_gravity(do()))),
    ("pads tell forces taxel by taxel", of("pad", "read", lambda do: replace(do(), shear=np.zeros((2, 2))))),
    ("bumpers tell zones that they have", of("bumper", "read", lambda do: replace(do(), pressed=(12,)))),
    ("batteries tell their charge", of("battery", "read", lambda do: replace(do(), charge=100.0))),
    ("readings are stamped", of("lidar", "scan", lambda do: replace(do(), stamp=0.0))),
]
