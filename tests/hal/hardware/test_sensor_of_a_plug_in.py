"""A sensor of a kind that a plug-in brings, behind a controller."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

from bestman_bt.registry import CONNECTIONS, PARTS, undone
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import RobotModel
from hal.api import Battery, Bumper, Camera, ForceTorque, Imu, Lidar, NotConnectedError, Part, Sensor, Tactile
from hal.hardware.connection import Connection
from hal.hardware.isolated_robot import IsolatedRobot
from hal.hardware.robot import HardwareRobot

PLUG_IN = '''
from dataclasses import dataclass
from typing import Literal

from bestman_bt.registry import connection, part
from bestman_bt.robot_model.part_fields import PartConfig
from hal.hardware.connection import Connection
from hal.hardware.sensors import HardwareSensor


@part("thermometer")
@dataclass(frozen=True, kw_only=True)
class ThermometerPart(PartConfig):
    """A thermometer at the link ``frame``."""

    kind: Literal["thermometer"]
    frame: str


@dataclass(frozen=True)
class Options:
    """It has none."""


@connection("warm")
class WarmConnection(Connection):
    """One thermometer."""

    driver, options_type, needs_address = "warm", Options, False

    def factories(self):
        return {"thermometer": lambda name, model: HardwareSensor(name, model, self.latch, lambda: 21.5)}

    def open(self):
        """Nothing to open."""

    def close(self):
        """Nothing to close."""

    def heard(self):
        return self.clock.now()

    def reported_fault(self):
        return None

    def recover(self):
        """It has no faults."""
'''


@pytest.fixture
def warm_robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[RobotModel]:
    (tmp_path / "warm_plug_in.py").write_text(PLUG_IN)
    (tmp_path / "thermometer.yaml").write_text(
        "kind: thermometer\ndescription: of a test\ngenerated: built_in_sensor\nframe: <part>_link\n"
    )
    (tmp_path / "robot.yaml").write_text(
        "parts: {base: {part: differential_base}, warmth: {part: thermometer.yaml, mount: base_link}}\n"
        "connections: {c: {driver: warm, parts: [warmth]}}\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    with undone(PARTS, CONNECTIONS):
        monkeypatch.setitem(sys.modules, "warm_plug_in", None)  # so that it is forgotten afterwards
        del sys.modules["warm_plug_in"]
        import_module("warm_plug_in")
        yield load_robot_model("robot.yaml")


def test_it_is_a_sensor_whose_loss_only_fails_its_users(warm_robot: RobotModel) -> None:
    robot = HardwareRobot(warm_robot)
    with pytest.raises(NotConnectedError):
        robot.part("warmth", Sensor).read()
    assert not robot.connections["c"].stops_robot


@pytest.mark.real_time
def test_it_is_read_in_the_process_of_the_connections_too(warm_robot: RobotModel) -> None:
    with IsolatedRobot(warm_robot) as robot:
        assert robot.part("warmth", Sensor).read() == 21.5


@pytest.mark.parametrize(
    ("kind", "stops"),
    [
        *((kind, False) for kind in (Camera, Lidar, Imu, Battery, Sensor)),
        *((kind, True) for kind in (ForceTorque, Tactile, Bumper, Part)),
    ],
)
def test_the_loss_of_what_moves_or_feels_contacts_stops_the_robot(kind: type[Part], stops: bool) -> None:
    part = type("One", (kind,), dict.fromkeys(kind.__abstractmethods__))("one")
    connection = object.__new__(type("Own", (Connection,), dict.fromkeys(Connection.__abstractmethods__)))
    connection.parts = {"one": part}
    assert connection.stops_robot is stops
