"""What tests share that reach a robot through its twins."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import RobotModel
from hal.api import Arm, CommandRefusedError, Motion, MotionErrorCode, MotionStatus, NotConnectedError, Robot
from hal.conformance import CHECKS, LIFE_CHECKS
from hal.conformance.promises import MakeRobot
from hal.hardware.isolated_robot import IsolatedRobot
from hal.hardware.robot import HardwareRobot
from hal.parts.channels import ControlledPart
from hal.parts.part_connection import ConnectionFailedError
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
        return load_robot_model(robot_file, twin_settings(twin))

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


def fails_with_its_number(
    robot: HardwareRobot, motion: Motion, since: float, connection: str, code: MotionErrorCode, number: str
) -> None:
    """A controller's fault fails the arm's motion with the vendor's number, and stops the robot for that reason."""
    assert stopped_within(robot, motion, since, 0.1) is code
    assert motion.status is MotionStatus.FAILED
    assert number in str(motion.failure)
    assert robot.faults[connection].vendor_code == number
    assert number in robot.diagnostics()[connection]
    with pytest.raises(CommandRefusedError, match=number):
        robot.part("arm", Arm).move_to(robot.part("arm", Arm).positions())


def stays_stopped_until_somebody_has_looked(
    robot: HardwareRobot, robot_file: Path, twin: TwinProcess, monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    """Neither ``clear_stop()`` nor connecting anew clears it; ``bestman-bt robot release`` does, and logs who."""
    with pytest.raises(ConnectionFailedError, match="bestman-bt robot release"):
        robot.clear_stop()
    robot.disconnect()
    with pytest.raises(ConnectionFailedError, match="bestman-bt robot release"):
        robot.connect()
    assert robot.stopped
    connection = "arm_controller"
    monkeypatch.setenv("XDG_STATE_HOME", str(folder))
    settings = (f"robot.connections.{name}.address={at}" for name, at in twin.addresses.items())
    command = ["robot", "release", str(robot_file), *(word for one in settings for word in ("--set", one))]
    refused = subprocess.run(
        [sys.executable, "-m", "bestman_bt.cli.main", *command],
        capture_output=True,
        text=True,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    assert refused.returncode == 2
    assert "--yes" in refused.stderr
    assert robot.connections[connection].held() is not None
    told = subprocess.run(
        [sys.executable, "-m", "bestman_bt.cli.main", *command, "--yes", "--json"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert told.returncode == 0, told.stderr
    (line,) = (folder / "bestman-bt" / "releases.jsonl").read_text().splitlines()
    assert json.loads(line) == json.loads(told.stdout)["released"][0]
    assert json.loads(line)["controller"] == connection
    assert twin.addresses[connection] not in told.stdout + told.stderr + line
    robot.connect()


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
