"""Sensors behind a controller: the robot model describes them, a connection brings what they read."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from bestman_bt.messages import CameraIntrinsics, LaserScan, RGBDImage, Wrench
from bestman_bt.robot_model.part_fields import PartConfig
from bestman_bt.robot_model.sensor_parts import CameraPart, ForceTorquePart, ImuPart, LidarPart
from hal.api import Battery, BatteryReading, Camera, Failure, ForceTorque, Imu, ImuReading, Lidar
from hal.parts.channels import ControlledPart
from hal.parts.part_connection import PartConnection
from hal.parts.stop_latch import StopLatch

Reading = TypeVar("Reading")


SAME_LENS = 0.01
"""Share by which a camera's own lens may differ from the robot file's before that is told."""
OTHER_LENS = 0.1
"""Share of the focal length from which on it is another camera."""


def lens_differences(told: CameraIntrinsics, file: CameraIntrinsics) -> tuple[str, ...]:
    """Return the lens parameters (pixels) of a camera that differ from the robot file's by more than 1 %."""
    pairs = {
        "fx": (told.fx, file.fx, file.fx),
        "fy": (told.fy, file.fy, file.fy),
        "cx": (told.cx, file.cx, file.width),
        "cy": (told.cy, file.cy, file.height),
    }
    return tuple(
        f"{name} {its:.1f} ({written:.1f} in the robot file)"
        for name, (its, written, whole) in pairs.items()
        if abs(its - written) > SAME_LENS * whole
    )


def is_another_camera(told: CameraIntrinsics, file: CameraIntrinsics) -> str:
    """Why the camera is not the one of the robot file; empty where it is."""
    if (told.width, told.height) != (file.width, file.height):
        return f"tells images of {told.width} x {told.height}, the robot model says {file.width} x {file.height}"
    for name, its, written in (("", told.fx, file.fx), ("vertical ", told.fy, file.fy)):
        if abs(its - written) > OTHER_LENS * written:
            return f"tells a {name}focal length of {its:.1f} pixels, the robot model says {written:.1f}"
    return ""


class HardwareSensor(ControlledPart, Generic[Reading]):
    """A sensor behind a controller; nothing of it moves, and nothing is read of a controller that was lost.

    ``read``: brings the latest reading, or an image that was taken after it was asked for; it may wait, and raises
    NoDataError where there is none.
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
        """The controller has connected."""
        self._connection.open()

    def detach(self) -> None:
        """The controller disconnects."""
        self._connection.close()

    @property
    def resting(self) -> bool:
        """Always."""
        return True

    def fail(self, fault: Failure) -> None:
        """There is no motion to fail; readings do."""
        self._connection.fail_motion(fault)

    def stop(self) -> None:
        """A sensor has nothing to stop."""


class HardwareCamera(HardwareSensor[RGBDImage], Camera):
    """A camera; its connection replaces the robot model's ``intrinsics`` by those that the device tells."""

    def __init__(self, name: str, model: CameraPart, latch: StopLatch, read: Callable[[], RGBDImage]) -> None:
        super().__init__(name, model, latch, read)
        self.intrinsics, self.optical_frame = model.intrinsics, model.optical_frame

    def capture(self) -> RGBDImage:
        """Take one image now."""
        return self.read()


class HardwareLidar(HardwareSensor[LaserScan], Lidar):
    """A planar lidar."""

    def __init__(self, name: str, model: LidarPart, latch: StopLatch, read: Callable[[], LaserScan]) -> None:
        super().__init__(name, model, latch, read)
        self.frame = model.frame

    def scan(self) -> LaserScan:
        """Return the latest scan."""
        return self.read()


class HardwareForceTorque(HardwareSensor[Wrench], ForceTorque):
    """A force-torque sensor."""

    def __init__(self, name: str, model: ForceTorquePart, latch: StopLatch, read: Callable[[], Wrench]) -> None:
        super().__init__(name, model, latch, read)
        self.frame = model.frame

    def wrench(self) -> Wrench:
        """Return the latest wrench."""
        return self.read()


class HardwareImu(HardwareSensor[ImuReading], Imu):
    """An inertial unit."""

    def __init__(self, name: str, model: ImuPart, latch: StopLatch, read: Callable[[], ImuReading]) -> None:
        super().__init__(name, model, latch, read)
        self.frame = model.frame


class HardwareBattery(HardwareSensor[BatteryReading], Battery):
    """A battery."""
