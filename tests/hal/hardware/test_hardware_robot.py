"""A robot of connections: what it says before it connects, and when it cannot."""

from __future__ import annotations

from pathlib import Path

import pytest

import hal.xarm.connection
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import BaseModel, RobotModel
from hal.api import Arm
from hal.hardware.robot import HardwareRobot
from hal.parts.part_connection import ConnectionFailedError

ROBOT = Path(__file__).parents[1] / "xarm" / "xarm6_on_a_base.yaml"
NOBODY = "127.0.0.251"


@pytest.fixture(scope="module")
def model() -> RobotModel:
    return load_robot_model(ROBOT, {"connections.arm_controller.address": NOBODY})


def test_it_has_the_parts_that_are_behind_a_connection(model: RobotModel) -> None:
    robot = HardwareRobot(model)
    assert list(robot.parts) == ["arm", "gripper"]
    assert "base" in model.of(BaseModel)


def test_it_reports_what_its_controllers_cannot_do(model: RobotModel) -> None:
    missing = HardwareRobot(model).unsupported
    assert any("efforts" in what for what in missing)


def test_a_robot_without_connections_cannot_connect(robot_model: RobotModel) -> None:
    with pytest.raises(ConnectionFailedError, match="diff_panda"):
        HardwareRobot(robot_model).connect()


def test_a_controller_that_is_not_there_is_named_but_not_its_address(model: RobotModel) -> None:
    pytest.importorskip("xarm", reason="the extra xarm is not installed")
    robot = HardwareRobot(model)
    with pytest.raises(ConnectionFailedError, match="arm_controller") as error:
        robot.connect()
    assert NOBODY not in str(error.value)
    assert NOBODY not in str(robot.diagnostics())
    assert not robot.connections["arm_controller"].connected
    robot.part("arm", Arm).stop()


def test_without_the_sdk_the_extra_is_named(model: RobotModel, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr("hal.hardware.connection.import_module", missing)
    with pytest.raises(ConnectionFailedError, match=r"pip install .*\[xarm\]"):
        HardwareRobot(model).connect()


def test_the_package_of_a_vendor_does_not_import_its_sdk() -> None:
    source = Path(hal.xarm.connection.__file__).parent
    for file in source.glob("*.py"):
        assert "import xarm" not in file.read_text()
        assert "from xarm" not in file.read_text()
