"""What a camera tells of its lens, by which clock its frames are stamped, and what is stopped where it is lost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bestman_bt.messages import CameraIntrinsics, RGBDImage
from bestman_bt.registry import CONNECTIONS
from bestman_bt.robot_model.connection_config import ConnectionConfig, SafetyConfig
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.robot_model.sensor_parts import CameraPart
from hal.api import Camera, Failure, MotionErrorCode, NotConnectedError
from hal.hardware.connection import Connection, PartFactory
from hal.hardware.robot import HardwareRobot
from hal.hardware.sensors import HardwareCamera, is_another_camera, lens_differences
from hal.parts.part_connection import ConnectionFailedError
from hal.parts.simulated_clock import SimulatedClock
from hal.parts.stop_latch import StopLatch
from hal.realsense.connection import RealSenseConnection, RealSenseOptions
from tests.hal.twinned import wait_for

FILE = CameraIntrinsics(640, 480, 430.0, 430.0, 319.5, 239.5)


@pytest.mark.parametrize("changed", [{"fx": 436.0}, {"fy": 424.0}, {"cx": 312.0}, {"cy": 245.0}], ids=str)
def test_each_number_of_a_lens_that_is_another_one_by_more_than_one_per_cent_is_reported(
    changed: dict[str, float],
) -> None:
    assert lens_differences(replace(FILE, fx=433.0, fy=427.0, cx=316.0, cy=242.0), FILE) == ()
    (told,) = lens_differences(replace(FILE, **changed), FILE)
    ((name, value),) = changed.items()
    assert told.startswith(f"{name} {value}")
    assert is_another_camera(replace(FILE, **changed), FILE) == ""


@pytest.mark.parametrize("changed", [{"width": 320}, {"fx": 480.0}, {"fy": 380.0}], ids=str)
def test_another_size_or_focal_length_is_another_camera(changed: dict[str, float]) -> None:
    assert "the robot model says" in is_another_camera(replace(FILE, **changed), FILE)  # type: ignore[arg-type]  # of the fields' kinds


def test_each_clock_that_stamps_a_realsenses_frames_is_followed_and_one_that_is_set_back_too(
    robot_model: RobotModel,
) -> None:
    (name, *_) = robot_model.of(CameraPart)
    settings = ConnectionConfig("realsense", (name,), options=RealSenseOptions())
    camera = RealSenseConnection("eye", settings, robot_model, SafetyConfig(), SimulatedClock(0.01), StopLatch())

    def stamped(domain: str, seconds: float, now: float) -> float:
        frame = SimpleNamespace(get_timestamp=lambda: 1e3 * seconds, get_frame_timestamp_domain=lambda: domain)
        return camera._here(frame, now)

    assert stamped("hardware", 7.0, 100.0) == pytest.approx(100.0)
    assert stamped("global", 1e9, 100.1) == pytest.approx(100.1)
    assert stamped("hardware", 7.2, 100.2) == pytest.approx(100.2)
    assert stamped("global", 1e9 + 0.1, 100.25) == pytest.approx(100.2, abs=1e-3)
    assert stamped("global", 1e9 - 0.5, 100.3) == pytest.approx(100.3)


class Eye(Connection):
    """Its camera's images stay away when the test says so."""

    driver = "scripted"
    silent = False

    def factories(self) -> Mapping[str, PartFactory]:
        return {"camera": lambda name, model: HardwareCamera(name, model, self.latch, self.take)}

    def take(self) -> RGBDImage:
        black = np.zeros((FILE.height, FILE.width, 3), np.uint8)
        return RGBDImage(black, black[..., 0].astype(np.float32), FILE, self.clock.now())

    def open(self) -> None:
        self.silent = False

    def close(self) -> None:
        pass

    def heard(self) -> float:
        return -1e9 if self.silent else self.clock.now()

    def reported_fault(self) -> Failure | None:
        return None

    def recover(self) -> None:
        pass


def test_a_camera_that_is_lost_stops_nothing_is_reported_and_connected_again_by_clear_stop(
    robot_model: RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(CONNECTIONS, "resolve", lambda driver: Eye)
    (name, *_) = robot_model.of(CameraPart)
    with HardwareRobot(replace(robot_model, connections={"eye": ConnectionConfig("any", (name,))})) as robot:
        eye, camera = robot.connections["eye"], robot.part(name, Camera)
        assert isinstance(eye, Eye)
        eye.silent = True
        wait_for(lambda: bool(robot.faults), "the camera is missed")
        assert robot.faults["eye"].code is MotionErrorCode.DISCONNECTED
        assert not robot.stopped
        wait_for(lambda: _raises(camera), "it has no images")
        assert "no message from eye" in robot.diagnostics()["eye"]
        robot.clear_stop()
        assert camera.capture().intrinsics == FILE
        assert not robot.faults


def _raises(camera: Camera) -> bool:
    try:
        camera.capture()
    except NotConnectedError:
        return True
    return False


def test_a_camera_that_cannot_be_connected_again_keeps_nobody_from_clearing_a_stop(
    robot_model: RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(CONNECTIONS, "resolve", lambda driver: Eye)
    (name, *_) = robot_model.of(CameraPart)
    with HardwareRobot(replace(robot_model, connections={"eye": ConnectionConfig("any", (name,))})) as robot:
        eye = robot.connections["eye"]
        assert isinstance(eye, Eye)
        eye.silent = True
        wait_for(lambda: bool(robot.faults), "the camera is missed")

        def unplugged() -> None:
            raise ConnectionFailedError("eye: no such device")

        monkeypatch.setattr(eye, "open", unplugged)
        robot.stop()
        robot.clear_stop()
        assert not robot.stopped
        assert "no message from eye" in robot.faults["eye"].text
        monkeypatch.undo()
