"""How soon and within which distance the arm stands after a stop, at three speeds, against what is promised."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.bringup.brought_up_robot import SPEED, BroughtUpRobot
from bestman_bt.bringup.finding import Finding, judged, not_applicable
from hal.api import Arm

SPEEDS = (0.05, 0.1, 0.2)
"""Shares of the joint's limit."""
SWING = 0.6
"""Radians of the first joint, at most."""
REST_TIME = 0.5
"""Seconds within which a robot is at rest after ``stop()``, by ``hal.api.Robot``."""
MEAN_SHARE, SPARE = 0.7, 0.005
"""Share of the way at full speed for ``REST_TIME`` that a stop may take, and radians beside it."""
AT_REST, SLOWER = 0.01, 0.9
"""rad/s; share of the speed below which the arm has begun to brake."""
WATCHED, PERIOD, PATIENCE = 1.0, 0.004, 5.0


@dataclass(frozen=True)
class Stop:
    """``speed``: rad/s at the stop. ``latency``, ``rest``: seconds until it was slower, and stood. ``way``: rad."""

    speed: float
    latency: float
    rest: float
    way: float

    @property
    def longest_way(self) -> float:
        """Radians."""
        return MEAN_SHARE * REST_TIME * self.speed + SPARE

    @property
    def kept(self) -> bool:
        """Whether the promise was."""
        return self.rest <= REST_TIME and self.way <= self.longest_way

    def __str__(self) -> str:
        """For people."""
        return (
            f"at {self.speed:.2f} rad/s slower after {1e3 * self.latency:.0f} ms, at rest after "
            f"{1e3 * self.rest:.0f} ms and {self.way:.3f} rad "
            f"(at most {1e3 * REST_TIME:.0f} ms, {self.longest_way:.3f} rad)"
        )


def stopping(subject: BroughtUpRobot) -> Iterator[Finding]:
    """The first joint of each arm swings, and the robot is stopped."""
    if not subject.arms:
        yield not_applicable(subject.model.name, "no arm is behind a connection")
    for name, arm in subject.arms.items():
        here = arm.positions()
        stops = []
        for share in SPEEDS:
            stop = _stopped(subject, arm, share)
            if isinstance(stop, str):
                yield judged(name, False, stop)
                return
            stops.append(stop)
        subject.finish(arm.move_to(here, SPEED))
        figures = {
            f"{what}_at_{share:g}": value
            for share, stop in zip(SPEEDS, stops, strict=True)
            for what, value in (("latency_s", stop.latency), ("rest_s", stop.rest), ("way_rad", stop.way))
        }
        yield judged(name, all(stop.kept for stop in stops), "; ".join(map(str, stops)), **figures)


def _stopped(subject: BroughtUpRobot, arm: Arm, share: float) -> Stop | str:
    """The stop, or why there was none."""
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
    speed, start, at = abs(float(arm.velocities()[0])), arm.positions(), robot.clock.now()
    robot.stop()
    latency, rest = 0.0, 0.0
    while (passed := robot.clock.now() - at) < WATCHED:
        velocity: NDArray[np.float64] = arm.velocities()
        if abs(float(velocity[0])) > SLOWER * speed:
            latency = passed
        if float(np.max(np.abs(velocity))) > AT_REST:
            rest = passed
        robot.clock.sleep(PERIOD)
    way = float(np.max(np.abs(arm.positions() - start)))
    robot.clear_stop()
    return Stop(speed, latency, rest, way)
