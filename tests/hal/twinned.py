"""What tests share that reach a robot through its twins."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from hal.api import Arm, Motion, MotionErrorCode, Robot
from hal.conformance import CHECKS, LIFE_CHECKS
from hal.conformance.promises import MakeRobot
from hal.hardware.robot import HardwareRobot
from hal.parts.channels import ControlledPart
from hal.twins.process import TwinProcess

SLACK = 0.4
"""Seconds that a test gives on top of what is promised, because the machine is shared."""
WATCHDOG = 0.25 + SLACK
"""The robots' watchdog, seconds: a busy machine may leave a twin without a processor for a while."""
PATIENCE = 60.0
"""Seconds after which a test gives up on what has to come about, however busy the machine is."""


def twin_settings(twin: TwinProcess, **changes: Any) -> dict[str, Any]:
    """Settings of a robot's file that meets ``twin``, with the tests' watchdog; ``changes`` write ``__`` for a dot."""
    return {
        **twin.settings,
        "safety.watchdog": f"{WATCHDOG} s",
        **{name.replace("__", "."): value for name, value in changes.items()},
    }


@contextmanager
def disconnected(robot: Robot) -> Iterator[None]:
    """Leaves the controllers to another client meanwhile: some of them have one only."""
    robot.disconnect()
    try:
        yield
    finally:
        robot.connect()


@contextmanager
def client_program(code: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Python code in a process of its own, whose output is read; it is killed at the end in any case."""
    with subprocess.Popen([sys.executable, "-c", code, *arguments], stdout=subprocess.PIPE, text=True) as client:
        try:
            yield client
        finally:
            client.kill()


def wait_for(holds: Callable[[], bool], what: str) -> None:
    """Wait until something has come about."""
    deadline = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < deadline, f"not within {PATIENCE} s: {what}"
        time.sleep(0.005)


def ended(robot: HardwareRobot, motion: Motion) -> Motion:
    """Wait until a motion has ended."""
    wait_for(lambda: motion.done, "the motion ends")
    return motion


def arrived(robot: HardwareRobot, motion: Motion) -> None:
    """Wait until a motion has ended, at its goal."""
    failure = ended(robot, motion).failure
    assert failure is None, failure


def strike(robot: HardwareRobot, twin: TwinProcess, connection: str, fault: str, value: float | None = None) -> float:
    """Make a fault happen; when it has, seconds of the robot's clock."""
    twin.fault(connection, fault, value)
    return robot.clock.now()


def stopped_within(robot: HardwareRobot, motion: Motion, since: float, limit: float) -> MotionErrorCode:
    """The robot was told to stop within ``limit`` seconds, by its own record; what the motion has ended with."""
    # A fault may act before ``since``, when the twin answers; it is never so early as the motion's beginning.
    wait_for(lambda: motion.done and (robot.stopped_at or 0.0) > since - SLACK, "the robot stops")
    assert robot.stopped
    assert robot.stopped_at is not None
    assert robot.stopped_at - since < limit + SLACK
    assert motion.failure is not None
    return motion.failure.code


def swing_arm(robot: HardwareRobot, speed_scale: float) -> Motion:
    """A slow motion of the arm that is under way."""
    arm = robot.part("arm", Arm)
    here = arm.positions()
    motion = arm.move_to(here + np.array([0.8 if here[0] < 0 else -0.8, 0, 0, 0, 0, 0]), speed_scale)
    wait_for(lambda: motion.done or abs(arm.positions()[0] - here[0]) > 0.02, "the arm sets out")
    assert not motion.done, motion.failure
    return motion


def works_again(robot: HardwareRobot, begin: Callable[[HardwareRobot], Motion]) -> None:
    """The stop can be cleared, and then a motion gets under way."""
    robot.clear_stop()
    begin(robot).cancel()
    moving = [part for connection in robot.connections.values() for part in connection.parts.values()]
    wait_for(lambda: all(part.resting for part in moving if isinstance(part, ControlledPart)), "all parts come to rest")


def wait_in_twin(twin: TwinProcess, seconds: float) -> None:
    """Until so much time has passed in the world of the twins, which a busy machine may hold up."""
    end = twin.judge("time")["time"] + seconds
    wait_for(lambda: twin.judge("time")["time"] >= end, "time passes in the twin")


def arm_comes_to_rest(twin: TwinProcess) -> None:
    """Within 0.3 s from now, as the world of the twins counts them, and stays where it is then."""
    wait_in_twin(twin, 0.3)
    after = twin.judge("joints", "arm")
    wait_in_twin(twin, 0.3)
    later = twin.judge("joints", "arm")
    assert np.max(np.abs(after["velocities"])) < 0.01
    assert np.max(np.abs(np.subtract(later["positions"], after["positions"]))) < 1e-3


def why_checks_do_not_apply(make_robot: MakeRobot) -> set[str]:
    """The reasons that a robot gives; some checks apply."""
    robot = make_robot()
    reasons = {check.why_not(robot) for check in CHECKS + LIFE_CHECKS}
    assert None in reasons
    return {reason for reason in reasons if reason is not None}
