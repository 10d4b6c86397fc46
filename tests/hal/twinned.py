"""What tests share that reach a robot through its twins."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bestman_bt.robot_model import RobotModel, load_robot_model
from hal.api import Arm, CommandRefusedError, Motion, MotionErrorCode, MotionStatus, NotConnectedError, Robot
from hal.conformance import CHECKS, LIFE_CHECKS
from hal.conformance.promises import MakeRobot
from hal.hardware import ConnectionFailedError, HardwareRobot, IsolatedRobot
from hal.twins import TwinProcess

SLACK = 0.15
"""Seconds that a test gives on top of what is promised, because the machine is shared."""


def fixtures_of(robot_file: Path, sdk: str, extra: str, faults: dict[str, tuple[str, ...]]) -> tuple[Any, ...]:
    """Fixtures ``twin``, ``twin_model``, ``make_robot``, ``shared_robot``, ``isolated_robot``, ``robot`` of a conftest.

    ``sdk``: module without which all is skipped, ``extra``: which brings it. ``faults``: connection → what a test takes
    back on it when it has ended.
    """

    @pytest.fixture(scope="module")
    def twin() -> Iterator[TwinProcess]:
        # `make test` installs it; another installation may be without the vendor's SDK.
        pytest.importorskip(sdk, reason=f"the extra {extra} is not installed")
        with TwinProcess(robot_file, "pick_place_table", seed=1) as running:
            yield running

    @pytest.fixture(scope="module")
    def twin_model(twin: TwinProcess) -> RobotModel:
        return load_robot_model(robot_file, twin.settings)

    @pytest.fixture(scope="module")
    def make_robot(twin_model: RobotModel) -> MakeRobot:
        """For the promises of hal.conformance: as a program uses it."""
        return partial(IsolatedRobot, twin_model)

    @pytest.fixture(scope="module")
    def shared_robot(twin_model: RobotModel) -> Iterator[HardwareRobot]:
        with HardwareRobot(twin_model) as robot:
            yield robot

    @pytest.fixture(scope="module")
    def isolated_robot(twin_model: RobotModel) -> Iterator[IsolatedRobot]:
        """With its connections in a process of their own."""
        with IsolatedRobot(twin_model) as robot:
            yield robot

    @pytest.fixture
    def robot(shared_robot: HardwareRobot, twin: TwinProcess) -> Iterator[HardwareRobot]:
        """Connected and well; faults that a test makes are taken back."""
        yield shared_robot
        for connection, names in faults.items():
            for name in names:
                twin.fault(connection, name)
        shared_robot.clear_stop()

    return twin, twin_model, make_robot, shared_robot, isolated_robot, robot


@contextmanager
def disconnected(robot: Robot) -> Iterator[None]:
    """Leaves the controllers to another client meanwhile: some of them have one only."""
    robot.disconnect()
    try:
        yield
    finally:
        robot.connect()


def ended(robot: HardwareRobot, motion: Motion, limit: float = 20.0) -> Motion:
    """Wait until a motion has ended: it has to within ``limit`` seconds."""
    start = time.monotonic()
    while not motion.done:
        assert time.monotonic() < start + limit + SLACK, f"the motion still runs after {limit} s"
        robot.clock.sleep(0.005)
    return motion


def swing_arm(robot: HardwareRobot, speed_scale: float) -> Motion:
    """A slow motion of the arm that is well under way."""
    arm = robot.part("arm", Arm)
    here = arm.positions()
    motion = arm.move_to(here + np.array([0.8 if here[0] < 0 else -0.8, 0, 0, 0, 0, 0]), speed_scale)
    robot.clock.sleep(0.4)
    assert not motion.done, motion.error
    return motion


def works_again(robot: HardwareRobot, begin: Callable[[HardwareRobot], Motion]) -> None:
    """The stop can be cleared, and then a motion gets under way."""
    robot.clear_stop()
    begin(robot).cancel()
    robot.clock.sleep(0.5)


def fails_with_its_number(
    robot: HardwareRobot, motion: Motion, connection: str, code: MotionErrorCode, number: str
) -> None:
    """A controller's fault fails the arm's motion with the vendor's number, and stops the robot for that reason."""
    ended(robot, motion, 0.1)
    assert motion.status is MotionStatus.FAILED
    assert motion.error is not None
    assert motion.error.code is code
    assert number in motion.error.text
    robot.clock.sleep(0.05)
    assert robot.stopped
    assert robot.faults[connection].vendor_code == number
    assert number in robot.diagnostics()[connection]
    with pytest.raises(CommandRefusedError, match=number):
        robot.part("arm", Arm).move_to(robot.part("arm", Arm).positions())


def stays_stopped_while_away(
    robot: HardwareRobot, twin: TwinProcess, connection: str, part: str, read: Callable[[], object]
) -> None:
    """While a controller is lost its part reads nothing, and the stop cannot be cleared, in words without addresses."""
    assert robot.stopped
    with pytest.raises(NotConnectedError, match=part):
        read()
    with pytest.raises(ConnectionFailedError, match=connection) as refusal:
        robot.clear_stop()
    assert twin.addresses[connection] not in str(refusal.value)
    assert robot.stopped


def arm_comes_to_rest(twin: TwinProcess) -> None:
    """Within 0.3 s from now, and stays where it is then."""
    time.sleep(0.3)
    after = twin.judge("joints", "arm")
    time.sleep(0.3)
    later = twin.judge("joints", "arm")
    assert np.max(np.abs(after["velocities"])) < 0.01
    assert np.max(np.abs(np.subtract(later["positions"], after["positions"]))) < 1e-3


def why_checks_do_not_apply(make_robot: MakeRobot) -> set[str]:
    """The reasons that a robot gives; some checks apply."""
    robot = make_robot()
    reasons = {check.why_not(robot) for check in CHECKS + LIFE_CHECKS}
    assert None in reasons
    return {reason for reason in reasons if reason is not None}
