"""The twin of a ROS robot in a process of its own, and the robot that the clients reach through rosbridge."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from bestman_bt.robot_model import RobotModel, load_robot_model
from hal.hardware import HardwareRobot, IsolatedRobot
from hal.twins import TwinProcess

ROBOT = Path(__file__).parent / "ros_robot.yaml"


@pytest.fixture(scope="session")
def twin() -> Iterator[TwinProcess]:
    pytest.importorskip("roslibpy", reason="the extra rosbridge is not installed")
    with TwinProcess(ROBOT, "pick_place_table", seed=1) as running:
        yield running


@pytest.fixture(scope="session")
def ros_model(twin: TwinProcess) -> RobotModel:
    return load_robot_model(ROBOT, twin.settings)


@pytest.fixture(scope="module")
def isolated_robot(ros_model: RobotModel) -> Iterator[IsolatedRobot]:
    """As a program uses it: with its connections in a process of their own."""
    with IsolatedRobot(ros_model) as robot:
        yield robot


@pytest.fixture(scope="module")
def shared_robot(ros_model: RobotModel) -> Iterator[HardwareRobot]:
    with HardwareRobot(ros_model) as robot:
        yield robot


@pytest.fixture
def robot(shared_robot: HardwareRobot, twin: TwinProcess) -> Iterator[HardwareRobot]:
    """Connected and well; faults that a test makes are taken back."""
    yield shared_robot
    for fault in ("restore", "fresh_odometry", "free", "sighted"):
        twin.fault("platform", fault)
    shared_robot.clear_stop()
