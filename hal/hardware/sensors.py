"""Sensors behind a controller: described by the robot model, read through the connection."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from typing_extensions import override

from bestman_bt.messages import CameraIntrinsics, LaserScan, RGBDImage, Wrench
from bestman_bt.robot_model.part_fields import PartConfig
from bestman_bt.robot_model.sensor_parts import CameraPart, ForceTorquePart, ImuPart, LidarPart
from hal.api import Battery, BatteryReading, Camera, Failure, ForceTorque, Imu, ImuReading, Lidar, Sensor
from hal.parts.channels import ControlledPart
from hal.parts.part_connection import PartConnection
from hal.parts.stop_latch import StopLatch

Reading = TypeVar("Reading")


SAME_LENS = 0.01
"""Relative difference between a camera's lens and the robot file's above which a remark is reported."""
OTHER_LENS = 0.1
"""Relative difference of the focal length from which the camera counts as another one."""


def lens_differences(reported: CameraIntrinsics, file: CameraIntrinsics) -> tuple[str, ...]:
    """Return the lens parameters (pixels) of a camera that differ from the robot file's by more than 1 %."""
    pairs = {
        "fx": (reported.fx, file.fx, file.fx),
        "fy": (reported.fy, file.fy, file.fy),
        "cx": (reported.cx, file.cx, file.width),
        "cy": (reported.cy, file.cy, file.height),
    }
    return tuple(
        f"{name} {its:.1f} ({written:.1f} in the robot file)"
        for name, (its, written, whole) in pairs.items()
        if abs(its - written) > SAME_LENS * whole
    )


def is_another_camera(reported: CameraIntrinsics, file: CameraIntrinsics) -> str:
    """Return why the camera does not match the robot file; empty if it does."""
    if (reported.width, reported.height) != (file.width, file.height):
        return (
            f"reports images of {reported.width} x {reported.height}, the robot model says {file.width} x {file.height}"
        )
    for name, its, written in (("", reported.fx, file.fx), ("vertical ", reported.fy, file.fy)):
        if abs(its - written) > OTHER_LENS * written:
            return f"reports a {name}focal length of {its:.1f} pixels, the robot model says {written:.1f}"
    return ""


class HardwareSensor(ControlledPart, Sensor, Generic[Reading]):
    """A sensor behind a controller; reading it fails while the controller is lost.

    ``read``: returns the latest reading, or an image captured after the request; may wait, and raises NoDataError
    without a reading.
    """

    def __init__(self, name: str, model: PartConfig, latch: StopLatch, read: Callable[[], Reading]) -> None:
        super().__init__(name)
        self.model = model
        self._connection, self._read = PartConnection(name, latch), read

    def read(self) -> Reading:
        """Return the latest reading."""
        self._connection.check_reading()
        return self._read()

    def attach(self) -> None:
        """Handle the connection of the controller."""
        self._connection.open()

    def detach(self) -> None:
        """Handle the disconnection of the controller."""
        self._connection.close()

    @property
    def resting(self) -> bool:
        """Return True: a sensor does not move."""
        return True

    def fail(self, fault: Failure) -> None:
        """Do nothing: sensors have no motions; readings fail instead."""
        self._connection.fail_motion(fault)


class HardwareCamera(HardwareSensor[RGBDImage], Camera):
    """A camera; its connection replaces the robot model's ``intrinsics`` by those that the device reports."""

    def __init__(self, name: str, model: CameraPart, latch: StopLatch, read: Callable[[], RGBDImage]) -> None:
        super().__init__(name, model, latch, read)
        self.intrinsics, self.optical_frame = model.intrinsics, model.optical_frame

    @override
    def capture(self) -> RGBDImage:
        return self.read()


class HardwareLidar(HardwareSensor[LaserScan], Lidar):
    """A planar lidar."""

    def __init__(self, name: str, model: LidarPart, latch: StopLatch, read: Callable[[], LaserScan]) -> None:
        super().__init__(name, model, latch, read)
        self.frame = model.frame

    @override
    def scan(self) -> LaserScan:
        return self.read()


class HardwareForceTorque(HardwareSensor[Wrench], ForceTorque):
    """A force-torque sensor."""

    def __init__(self, name: str, model: ForceTorquePart, latch: StopLatch, read: Callable[[], Wrench]) -> None:
        super().__init__(name, model, latch, read)
        self.frame = model.frame

    @override
    def wrench(self) -> Wrench:
        return self.read()


class HardwareImu(HardwareSensor[ImuReading], Imu):
    """An inertial unit."""

    def __init__(self, name: str, model: ImuPart, latch: StopLatch, read: Callable[[], ImuReading]) -> None:
        super().__init__(name, model, latch, read)
        self.frame = model.frame


class HardwareBattery(HardwareSensor[BatteryReading], Battery):
    """A battery."""
