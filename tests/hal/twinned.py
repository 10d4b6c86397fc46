"""What tests share that reach a robot through its twins."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.robot_model import RobotModel, load_robot_model
from hal.api import Motion
from hal.hardware import HardwareRobot, IsolatedRobot
from hal.twins import TwinProcess

SLACK = 0.15
"""Seconds that a test gives on top of what is promised, because the machine is shared."""


def fixtures_of(robot_file: Path, sdk: str, extra: str, faults: dict[str, tuple[str, ...]]) -> tuple[Any, ...]:
    """Fixtures ``twin``, ``twin_model``, ``shared_robot``, ``isolated_robot`` and ``robot`` for a folder's conftest.

    ``sdk``: module without which all is skipped, ``extra``: which brings it. ``faults``: connection → what a test takes
    back on it when it has ended.
    """

    @pytest.fixture(scope="session")
    def twin() -> Iterator[TwinProcess]:
        pytest.importorskip(sdk, reason=f"the extra {extra} is not installed")
        with TwinProcess(robot_file, "pick_place_table", seed=1) as running:
            yield running

    @pytest.fixture(scope="session")
    def twin_model(twin: TwinProcess) -> RobotModel:
        return load_robot_model(robot_file, twin.settings)

    @pytest.fixture(scope="module")
    def shared_robot(twin_model: RobotModel) -> Iterator[HardwareRobot]:
        with HardwareRobot(twin_model) as robot:
            yield robot

    @pytest.fixture(scope="module")
    def isolated_robot(twin_model: RobotModel) -> Iterator[IsolatedRobot]:
        """As a program uses it: with its connections in a process of their own."""
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

    return twin, twin_model, shared_robot, isolated_robot, robot


def ended(robot: HardwareRobot, motion: Motion, limit: float) -> None:
    """Wait until a motion has ended: it has to within ``limit`` seconds."""
    start = time.monotonic()
    while not motion.done:
        assert time.monotonic() < start + limit + SLACK, f"the motion still runs after {limit} s"
        robot.clock.sleep(0.005)
