"""An xArm's twin in a process of its own, and the robot that the vendor's SDK reaches through it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from bestman_bt.robot_model import RobotModel, load_robot_model
from hal.hardware import HardwareRobot, IsolatedRobot
from hal.twins import TwinProcess

ROBOT = Path(__file__).parent / "xarm6_on_a_base.yaml"


@pytest.fixture(scope="session")
def twin() -> Iterator[TwinProcess]:
    pytest.importorskip("xarm", reason="the extra xarm is not installed")
    with TwinProcess(ROBOT, "pick_place_table", seed=1) as running:
        yield running


@pytest.fixture(scope="session")
def xarm_model(twin: TwinProcess) -> RobotModel:
    return load_robot_model(ROBOT, twin.settings)


@pytest.fixture(scope="session")
def shared_robot(xarm_model: RobotModel) -> Iterator[HardwareRobot]:
    with HardwareRobot(xarm_model) as robot:
        yield robot


@pytest.fixture(scope="session")
def isolated_robot(xarm_model: RobotModel) -> Iterator[IsolatedRobot]:
    """As a program uses it: with its connections in a process of their own."""
    with IsolatedRobot(xarm_model) as robot:
        yield robot


@pytest.fixture
def robot(shared_robot: HardwareRobot, twin: TwinProcess) -> Iterator[HardwareRobot]:
    """Connected and well; faults that a test makes are taken back."""
    yield shared_robot
    twin.fault("arm_controller", "restore")
    twin.fault("arm_controller", "gripper_free")
    shared_robot.clear_stop()
