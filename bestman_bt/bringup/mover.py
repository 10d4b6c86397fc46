"""Program that repeats small motions of the robot until it is killed; used by the bring-up steps that kill its
processes."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np

from bestman_bt.robot_model.compose import load_robot_model
from hal.api import JointGroup, MobileBase, MotionStatus, RobotError
from hal.hardware.isolated_robot import IsolatedRobot

SWING, SWING_SPEED = 0.2, 0.15
"""Amplitude, radians, and speed, rad/s, of the first joint."""
CREEP = 0.05
"""m/s of the base."""
PERIOD = 0.02


def main() -> None:
    """Move one part: arguments ``name part``, the robot's settings on standard input; prints positions as JSON
    lines.
    """
    name, part_name = sys.argv[1:]
    settings: dict[str, Any] = json.loads(sys.stdin.readline())
    with suppress(RobotError), IsolatedRobot(load_robot_model(name, settings)) as robot:  # its processes are killed
        part = robot.parts[part_name]
        steps = _drive(part) if isinstance(part, MobileBase) else _swing(robot.part(part_name, JointGroup))
        for at in steps:
            sys.stdout.write(json.dumps({"at": at}) + "\n")
            sys.stdout.flush()
            robot.clock.sleep(PERIOD)


def _swing(group: JointGroup) -> Iterator[list[float]]:
    here = group.positions()
    side = SWING if here[0] <= 0.5 * (group.model.lower[0] + group.model.upper[0]) else -SWING
    scale = float(np.clip(SWING_SPEED / group.model.velocity[0], 0.005, 1.0))
    target = here.copy()
    while True:
        target[0] = here[0] + side if target[0] == here[0] else here[0]
        motion = group.move_to(target, scale)
        while not motion.done:
            yield group.positions().tolist()
        if motion.status is not MotionStatus.SUCCEEDED:
            return


def _drive(base: MobileBase) -> Iterator[list[float]]:
    while True:
        base.set_velocity(CREEP, 0.0, 0.0)
        at = base.odometry()
        yield [at.x, at.y]
