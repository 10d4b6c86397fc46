"""The twins of a UR and of its gripper in a process of their own, and the robot that the clients reach through them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from bestman_bt.robot_model import RobotModel, load_robot_model
from hal.hardware import HardwareRobot, IsolatedRobot
from hal.twins import TwinProcess

ROBOT = Path(__file__).parent / "ur5_on_a_base.yaml"


@pytest.fixture(scope="session")
def twin() -> Iterator[TwinProcess]:
    pytest.importorskip("rtde_control", reason="the extra ur is not installed")
    with TwinProcess(ROBOT, "pick_place_table", seed=1) as running:
        yield running


@pytest.fixture(scope="session")
def ur_model(twin: TwinProcess) -> RobotModel:
    return load_robot_model(ROBOT, twin.settings)


@pytest.fixture(scope="module")
def shared_robot(ur_model: RobotModel) -> Iterator[HardwareRobot]:
    with HardwareRobot(ur_model) as robot:
        yield robot


@pytest.fixture(scope="module")
def isolated_robot(ur_model: RobotModel) -> Iterator[IsolatedRobot]:
    """As a program uses it: with its connections in a process of their own. A UR takes one client at a time."""
    with IsolatedRobot(ur_model) as robot:
        yield robot


@pytest.fixture
def robot(shared_robot: HardwareRobot, twin: TwinProcess) -> Iterator[HardwareRobot]:
    """Connected and well; faults that a test makes are taken back."""
    yield shared_robot
    for connection in twin.addresses:
        twin.fault(connection, "restore")
    twin.fault("hand_controller", "gripper_free")
    shared_robot.clear_stop()
