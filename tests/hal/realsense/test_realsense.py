"""The RealSense SDK, unmodified, plays what its own software device has recorded; nobody had a camera."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import RobotModel
from hal.api import Camera
from hal.conformance.promises import MakeRobot, PromisesAboutConnecting
from hal.conformance.sensor_checks import SENSOR_CHECKS
from hal.conformance.subject import Check
from hal.hardware.robot import HardwareRobot
from hal.parts.part_connection import ConnectionFailedError
from hal.realsense.connection import realsense_sdk

pytestmark = pytest.mark.real_time
ROBOT = """
base_frame: base_link
parts:
  base:   {part: differential_base}
  camera: {part: rgbd_camera, mount: base_link, xyz: [0, 0, 1]}
connections:
  eye: {driver: realsense, parts: [camera], options: {recording: RECORDING}}
"""
SIZE = (480, 640)
COLOR = (200, 30, 10)
SERIAL = "0123456789"


@pytest.fixture(scope="module")
def sdk() -> Any:
    return realsense_sdk(lambda name: pytest.importorskip(name, reason="the extra realsense is not installed"))


@pytest.fixture(scope="module")
def recording(sdk: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A second of a red wall whose lower half is 1.2 m away, as the SDK's own recorder writes it."""
    path = tmp_path_factory.mktemp("realsense") / "wall.db3"
    device = sdk.software_device()
    kinds = ((sdk.stream.depth, sdk.format.z16, 2), (sdk.stream.color, sdk.format.rgb8, 3))
    device.register_info(sdk.camera_info.serial_number, SERIAL)
    sensors = [device.add_sensor("Depth"), device.add_sensor("Color")]
    profiles = [
        sensor.add_video_stream(_stream(sdk, number, *kind))
        for number, (sensor, kind) in enumerate(zip(sensors, kinds, strict=True))
    ]
    sensors[0].add_read_only_option(sdk.option.depth_units, 0.001)
    here = sdk.extrinsics()
    here.rotation, here.translation = np.eye(3).ravel().tolist(), [0.0, 0.0, 0.0]
    profiles[0].register_extrinsics_to(profiles[1], here)
    device.create_matcher(sdk.matchers.default)
    recorder, queue = sdk.recorder(str(path), device), sdk.frame_queue(50)
    recorded = recorder.query_sensors()
    for sensor, profile in zip(recorded, profiles, strict=True):
        sensor.open(profile)
        sensor.start(queue)
    depth = np.zeros(SIZE, np.uint16)
    depth[240:] = 1200
    pictures = depth, np.broadcast_to(np.array(COLOR, np.uint8), (*SIZE, 3)).copy()
    for number in range(30):
        for sensor, profile, (_, _, size), pixels in zip(sensors, profiles, kinds, pictures, strict=True):
            frame = sdk.software_video_frame()
            frame.stride, frame.bpp, frame.pixels = SIZE[1] * size, size, pixels.ravel()
            frame.timestamp, frame.domain = 1e6 + number * 33.3, sdk.timestamp_domain.system_time
            frame.frame_number, frame.profile = number, profile.as_video_stream_profile()
            if size == 2:
                frame.depth_units = 0.001
            sensor.on_video_frame(frame)
        time.sleep(0.01)
    for sensor in recorded:
        sensor.stop()
        sensor.close()
    return path


def _stream(sdk: Any, number: int, kind: Any, form: Any, size: int) -> Any:
    k = sdk.intrinsics()
    k.width, k.height, k.fx, k.fy, k.ppx, k.ppy = 640, 480, 432.97, 432.97, 319.5, 239.5
    k.model, k.coeffs = sdk.distortion.none, [0.0] * 5
    stream = sdk.video_stream()
    stream.type, stream.fmt, stream.bpp, stream.index, stream.uid = kind, form, size, 0, number
    stream.width, stream.height, stream.fps, stream.intrinsics = 640, 480, 30, k
    return stream


@pytest.fixture(scope="module")
def model(recording: Path) -> RobotModel:
    path = recording.parent / "robot.yaml"
    path.write_text(ROBOT.replace("RECORDING", str(recording)))
    return load_robot_model(path)


def test_colour_and_registered_depth_come_in_metres_and_newly_taken(model: RobotModel) -> None:
    with HardwareRobot(model) as robot:
        camera = robot.part("camera", Camera)
        asked = robot.clock.now()
        image = camera.capture()
        assert asked < image.stamp <= robot.clock.now()
        assert image.rgb[100, 100].tolist() == list(COLOR)
        assert image.intrinsics.fx == pytest.approx(432.97)  # the device's
        assert np.median(image.depth[300:470]) == pytest.approx(1.2)
        assert np.median(image.depth[10:200]) == 0.0
        assert camera.capture().stamp > image.stamp
        robot.clock.sleep(2.0)  # longer than the recording: it begins anew
        assert not robot.stopped, robot.faults
        assert camera.capture().rgb[100, 100].tolist() == list(COLOR)


def test_a_camera_of_another_serial_number_is_refused(model: RobotModel, recording: Path) -> None:
    file = recording.parent / "robot.yaml"
    with HardwareRobot(load_robot_model(file, {"connections.eye.options.serial": SERIAL})) as robot:
        assert robot.connections["eye"].identity().serial_number == SERIAL
    other = load_robot_model(file, {"connections.eye.options.serial": "9876543210"})
    with pytest.raises(ConnectionFailedError, match=f"camera has the serial number {SERIAL}; .* says 9876543210"):
        HardwareRobot(other).connect()
    brought_up = replace(model, serial_numbers={"eye": "9876543210"}, bringup="robot.bringup")
    with pytest.raises(ConnectionFailedError, match=f"serial number is {SERIAL}, that of the bring-up is 9876543210"):
        HardwareRobot(brought_up).connect()


@pytest.fixture(scope="module")
def make_robot(model: RobotModel) -> MakeRobot:
    return partial(HardwareRobot, model)


class TestConnecting(PromisesAboutConnecting):
    pass


@pytest.mark.parametrize("check", SENSOR_CHECKS, ids=lambda check: check.name)
def test_its_images_are_as_promised(check: Check, make_robot: MakeRobot) -> None:
    with make_robot() as robot:
        if check.why_not(robot) is None:
            check.run(robot)
        else:
            assert Camera not in check.needs


@pytest.mark.slow  # the SDK looks for one for 15 s
def test_a_camera_that_is_not_there_is_an_error_in_words(model: RobotModel, recording: Path) -> None:
    absent = load_robot_model(recording.parent / "robot.yaml", {"connections.eye.options.recording": ""})
    with pytest.raises(ConnectionFailedError, match="eye: camera does not start"):
        HardwareRobot(absent).connect()
