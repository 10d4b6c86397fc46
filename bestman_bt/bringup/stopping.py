"""Stopping time and distance of arms and bases at three speeds, compared with their promises."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from bestman_bt.bringup.brought_up_robot import SPEED, BroughtUpRobot
from bestman_bt.bringup.finding import CheckFinding, judged, not_applicable
from hal.api import Arm, MobileBase

SPEEDS = (0.05, 0.1, 0.2)
"""Shares of the joint's limit."""
BASE_SPEEDS = (0.05, 0.1, 0.2)
"""m/s, or what the base's limit is where that is less."""
SWING = 0.6
"""Radians of the first joint, at most."""
REST_TIME = 0.5
"""Seconds within which a robot is at rest after ``stop()``, by ``hal.api.Robot``."""
MEAN_SHARE, SPARE = 0.7, 0.005
"""Share of the way at full speed for ``REST_TIME`` that a stop may take, and radians or metres beside it."""
AT_REST, SLOWER = 0.01, 0.9
"""rad/s or m/s; share of the speed below which the arm has begun to brake."""
WATCHED, PERIOD, PATIENCE = 1.0, 0.004, 5.0


@dataclass(frozen=True)
class Stop:
    """One stop. ``speed``: at the stop, per second. ``latency``, ``rest``: seconds until it slowed down, and stood.

    ``way``: the stopping distance in ``unit``, rad or m.
    """

    unit: str
    speed: float
    latency: float
    rest: float
    way: float

    @property
    def longest_way(self) -> float:
        """Return the largest promised stopping distance, in the unit."""
        return MEAN_SHARE * REST_TIME * self.speed + SPARE

    @property
    def kept(self) -> bool:
        """Return whether the promise was kept."""
        return self.rest <= REST_TIME and self.way <= self.longest_way

    def __str__(self) -> str:
        """For people."""
        return (
            f"at {self.speed:.2f} {self.unit}/s slower after {1e3 * self.latency:.0f} ms, at rest after "
            f"{1e3 * self.rest:.0f} ms and {self.way:.3f} {self.unit} "
            f"(at most {1e3 * REST_TIME:.0f} ms, {self.longest_way:.3f} {self.unit})"
        )


def stopping(subject: BroughtUpRobot) -> Iterator[CheckFinding]:
    """The first joint of each arm swings, each base drives ahead, and the robot is stopped."""
    bases = subject.parts(MobileBase)
    if not subject.arms and not bases:
        yield not_applicable(subject.model.name, "no arm or base is behind a connection")
    for name, arm in subject.arms.items():
        here = arm.positions()
        yield _stops(name, SPEEDS, partial(_stopped, subject, arm))
        subject.finish(arm.move_to(here, SPEED))
    for name, base in bases.items():
        start = base.odometry()
        yield _stops(name, BASE_SPEEDS, partial(_base_stopped, subject, base))
        subject.finish(base.move_backward(float((start.inverse() @ base.odometry()).x)))


def _stops(name: str, speeds: tuple[float, ...], stop_at: Callable[[float], Stop | str]) -> CheckFinding:
    stops = []
    for speed in speeds:
        stop = stop_at(speed)
        if isinstance(stop, str):
            return judged(name, False, stop)
        stops.append(stop)
    figures = {
        f"{what}_at_{speed:g}": value
        for speed, stop in zip(speeds, stops, strict=True)
        for what, value in (("latency_s", stop.latency), ("rest_s", stop.rest), (f"way_{stop.unit}", stop.way))
    }
    return judged(name, all(stop.kept for stop in stops), "; ".join(map(str, stops)), **figures)


def _base_stopped(subject: BroughtUpRobot, base: MobileBase, speed: float) -> Stop | str:
    """Return the stop, or why there was none."""
    robot, asked = subject.robot, min(speed, base.model.part.max_vx)
    begun = robot.clock.now()
    while base.velocity().vx < SLOWER * asked:
        if robot.clock.now() - begun > PATIENCE:
            robot.stop()
            robot.clear_stop()
            return f"it did not reach {asked:.2f} m/s"
        base.set_velocity(asked, 0.0, 0.0)
        robot.clock.sleep(PERIOD)
    start, reached = base.odometry(), base.velocity().vx
    return _brought_to_rest(
        subject,
        "m",
        reached,
        lambda: abs(base.velocity().vx),
        lambda: float(np.linalg.norm(base.odometry().xy - start.xy)),
    )


def _stopped(subject: BroughtUpRobot, arm: Arm, share: float) -> Stop | str:
    """Return the stop, or why there was none."""
    robot, model = subject.robot, arm.model
    here, middle = arm.positions(), 0.5 * (model.lower[0] + model.upper[0])
    target = here.copy()
    target[0] = np.clip(here[0] + (SWING if here[0] <= middle else -SWING), model.lower[0], model.upper[0])
    asked = share * float(model.velocity[0])
    motion = arm.move_to(target, share)
    begun = robot.clock.now()
    while abs(float(arm.velocities()[0])) < SLOWER * asked:
        if motion.done or robot.clock.now() - begun > PATIENCE:
            robot.stop()
            robot.clear_stop()
            return f"it did not reach {asked:.2f} rad/s: {motion.failure or 'it is slower'}"
        robot.clock.sleep(PERIOD)
    reached, start = abs(float(arm.velocities()[0])), arm.positions()
    return _brought_to_rest(
        subject,
        "rad",
        reached,
        lambda: float(np.max(np.abs(arm.velocities()))),
        lambda: float(np.max(np.abs(arm.positions() - start))),
    )


def _brought_to_rest(
    subject: BroughtUpRobot, unit: str, reached: float, speed: Callable[[], float], way: Callable[[], float]
) -> Stop:
    """Stop the robot now, at the speed ``reached``, and watch."""
    robot, at = subject.robot, subject.robot.clock.now()
    robot.stop()
    latency, rest = 0.0, 0.0
    while (passed := robot.clock.now() - at) < WATCHED:
        now = speed()
        latency = passed if now > SLOWER * reached else latency
        rest = passed if now > AT_REST else rest
        robot.clock.sleep(PERIOD)
    stop = Stop(unit, reached, latency, rest, way())
    robot.clear_stop()
    return stop
